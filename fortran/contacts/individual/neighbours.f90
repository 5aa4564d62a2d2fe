!> Lattices without edges: the neighbours of each site.
module mesoslip_contacts_individual_neighbours
   implicit none
   private

   public :: lattice_triangular, lattice_square, lattice_names
   public :: coordination, find_neighbours, max_neighbours

   !> Six neighbours; odd rows are half a spacing to the right of even ones, counted from 0
   integer, parameter :: lattice_triangular = 1
   !> Four neighbours
   integer, parameter :: lattice_square = 2
   !> Maximum number of neighbours
   integer, parameter :: max_neighbours = 6
   !> Names of the lattice_ codes
   character(len=*), parameter :: lattice_names(2) = [character(len=10) :: "triangular", "square"]

contains

   !> Number of neighbours of each site; 0 for an unknown lattice.
   elemental function coordination(lattice) result(number)
      !> One of the lattice_ codes
      integer, intent(in) :: lattice
      integer :: number

      number = 0
      if (lattice == lattice_triangular) number = 6
      if (lattice == lattice_square) number = 4
   end function coordination

   !> Neighbours of a site. Sites are numbered from 1, row by row.
   !>
   !> They are computed each time, which is faster than loading a table from memory. On a lattice of
   !> two rows or columns a site is the neighbour of another twice.
   pure subroutine find_neighbours(lattice, columns, rows, site, neighbour)
      !> One of the lattice_ codes
      integer, intent(in) :: lattice
      !> Columns and rows; the rows of a triangular lattice are even in number
      integer, intent(in) :: columns, rows
      !> Number of the site
      integer, intent(in) :: site
      !> Numbers of the neighbours; 0 beyond the last
      integer, intent(out) :: neighbour(max_neighbours)

      integer :: column, row, left, right, up, down

      row = (site - 1) / columns
      column = site - 1 - row * columns
      left = merge(site - 1, site - 1 + columns, column > 0)
      right = merge(site + 1, site + 1 - columns, column < columns - 1)
      up = merge(-columns, (rows - 1) * columns, row > 0)
      down = merge(columns, (1 - rows) * columns, row < rows - 1)
      neighbour(:2) = [left, right]
      if (lattice == lattice_square) then
         neighbour(3:) = [site + up, site + down, 0, 0]
      else
         ! Those to the left in the rows above and below, then those to the right.
         if (modulo(row, 2) == 0) then
            right = site
         else
            left = site
         end if
         neighbour(3:) = [left + up, right + up, left + down, right + down]
      end if
   end subroutine find_neighbours

end module mesoslip_contacts_individual_neighbours
