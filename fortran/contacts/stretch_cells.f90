!> A table of thresholds with stiffnesses: cells of break stretches, x_s = f_s/k, in each of which
!> the density is constant and contacts have one stiffness.
!>
!> Dimensionless as in mesoslip_contacts_mechanics.
module mesoslip_contacts_stretch_cells
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: stretch_cells_type, cell_of

   !> Cells in the order of their stretches; they do not overlap.
   type :: stretch_cells_type
      !> Stretches between which the contacts of each cell break, shape (cells)
      real(wp), allocatable :: low(:), high(:)
      !> Probability and stiffness of each, shape (cells)
      real(wp), allocatable :: share(:), stiffness(:)
   contains
      !> Reject contacts that a force breaks
      procedure, non_overridable :: reject_below
   end type stretch_cells_type

contains

   !> Reject contacts whose threshold is not above a force; the others keep their probabilities.
   pure subroutine reject_below(self, force)
      class(stretch_cells_type), intent(inout) :: self
      !> The force; not negative
      real(wp), intent(in) :: force

      real(wp) :: low(size(self%low))
      logical :: is_left(size(self%low))

      low = max(self%low, force / self%stiffness)
      is_left = low < self%high
      self%share = pack(self%share * (self%high - low) / (self%high - self%low), is_left)
      self%low = pack(low, is_left)
      self%high = pack(self%high, is_left)
      self%stiffness = pack(self%stiffness, is_left)
   end subroutine reject_below

   !> The cell that contains a value, by bisection; the first or the last one beyond the edges.
   pure function cell_of(edge, value, direction) result(cell)
      !> Edges of the cells, shape (cells + 1)
      real(wp), intent(in), contiguous :: edge(:)
      !> The value, and +1 for ascending edges, -1 for descending ones
      real(wp), intent(in) :: value, direction
      integer :: cell

      integer :: last, middle

      cell = 1
      last = size(edge)
      do while (last - cell > 1)
         middle = (cell + last) / 2
         if (direction * edge(middle) <= direction * value) then
            cell = middle
         else
            last = middle
         end if
      end do
   end function cell_of

end module mesoslip_contacts_stretch_cells
