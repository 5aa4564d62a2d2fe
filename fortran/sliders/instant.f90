!> Sliders without inertia: they jump to their equilibrium while the drive stands still.
module mesoslip_sliders_instant
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_base, only: exchange_slider, slider_type
   implicit none
   private

   public :: instant_slider_type, exchange_instant

   !> A slider without inertia. Each advance jumps to the equilibrium, or to the first contact
   !> before it; from the equilibrium the slider moves with the drive.
   type, abstract, extends(slider_type) :: instant_slider_type
      !> Whether it reached its equilibrium in the last advance, and where [m]
      logical :: is_settled = .false.
      real(wp) :: rest_displacement = 0.0_wp
      !> Whether it has no equilibrium: neither contacts nor a spring hold it
      logical :: is_unbound = .false.
      !> Displacements at which its motion with the drive ends, though it may jump beyond [m]
      real(wp) :: stop_upper = huge(1.0_wp), stop_lower = -huge(1.0_wp)
      !> Mean number of breaks of a contact in one avalanche after which the slider never settles:
      !> on a spring, whose force falls, it always does
      real(wp) :: max_breaks = huge(1.0_wp)
   contains
      procedure :: exchange => exchange_instant
   end type instant_slider_type

contains

   !> Exchange what these sliders have in common.
   subroutine exchange_instant(self, archive)
      class(instant_slider_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call exchange_slider(self, archive)
      call archive%exchange("is_settled", self%is_settled)
      call archive%exchange("rest_displacement", self%rest_displacement)
      call archive%exchange("is_unbound", self%is_unbound)
   end subroutine exchange_instant

end module mesoslip_sliders_instant
