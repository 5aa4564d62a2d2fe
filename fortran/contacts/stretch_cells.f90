!> Cells of break stretches, x_s = f_s/k, in each of which the density is constant and contacts have
!> one stiffness: what a table of thresholds with stiffnesses is.
!>
!> Dimensionless as in mesoslip_contacts_mechanics.
module mesoslip_contacts_stretch_cells
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: stretch_cells_type

   !> Cells, which do not overlap, in the order of their stretches.
   type :: stretch_cells_type
      !> Stretches between which the contacts of each cell break, shape (cells)
      real(wp), allocatable :: low(:), high(:)
      !> Probability and stiffness of each, shape (cells)
      real(wp), allocatable :: share(:), stiffness(:)
   contains
      !> Leave out contacts that a force breaks
      procedure, non_overridable :: reject_below
   end type stretch_cells_type

contains

   !> Leave out contacts whose threshold is not above a force; the others keep their probabilities.
   pure subroutine reject_below(self, force)
      !> The cells
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

end module mesoslip_contacts_stretch_cells
