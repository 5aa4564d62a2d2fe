!> Lattices without edges: who is next to whom.
module mesoslip_contacts_individual_neighbours
   implicit none
   private

   public :: lattice_triangular, lattice_square, lattice_names
   public :: coordination, find_neighbours

   !> Six neighbours; odd rows are half a spacing to the right of even ones, counted from 0
   integer, parameter :: lattice_triangular = 1
   !> Four neighbours
   integer, parameter :: lattice_square = 2
   !> Names of the lattice_ codes
   character(len=*), parameter :: lattice_names(2) = [character(len=10) :: "triangular", "square"]

contains

   !> Number of neighbours of each site; 0 for an unknown lattice.
   elemental function coordination(lattice) result(number)
      !> One of the lattice_ codes
      integer, intent(in) :: lattice
      !> Their number
      integer :: number

      number = 0
      if (lattice == lattice_triangular) number = 6
      if (lattice == lattice_square) number = 4
   end function coordination

   !> Neighbours of all sites, numbered from 1, row by row.
   !>
   !> With two rows or columns in all, a site is the neighbour of another twice.
   pure subroutine find_neighbours(lattice, columns, rows, neighbour)
      !> One of the lattice_ codes
      integer, intent(in) :: lattice
      !> Columns and rows; of a triangular lattice an even number of rows
      integer, intent(in) :: columns, rows
      !> Numbers of the neighbours, shape (coordination, columns rows)
      integer, intent(out) :: neighbour(:, :)

      integer :: column, row, site, slant

      do row = 0, rows - 1
         do column = 0, columns - 1
            site = row * columns + column + 1
            neighbour(:2, site) = [at(column - 1, row), at(column + 1, row)]
            if (lattice == lattice_triangular) then
               slant = modulo(row, 2) - 1
               neighbour(3:, site) = [at(column + slant, row - 1), &
                  & at(column + slant + 1, row - 1), at(column + slant, row + 1), &
                  & at(column + slant + 1, row + 1)]
            else
               neighbour(3:, site) = [at(column, row - 1), at(column, row + 1)]
            end if
         end do
      end do

   contains

      !> Number of a site.
      pure integer function at(column, row)
         integer, intent(in) :: column, row

         at = modulo(row, rows) * columns + modulo(column, columns) + 1
      end function at
   end subroutine find_neighbours

end module mesoslip_contacts_individual_neighbours
