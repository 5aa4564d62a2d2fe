!> Sliders without inertia: they jump to their equilibrium while the drive stands still.
module mesoslip_sliders_instant
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_base, only: exchange_slider, slider_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: instant_slider_type, exchange_instant

   !> A slider without inertia. Each advance jumps to the equilibrium, or to the first contact
   !> before it; from the equilibrium it goes with the drive.
   type, abstract, extends(slider_type) :: instant_slider_type
      !> Whether it came to its equilibrium in the last advance, and where [m]
      logical :: is_settled = .false.
      real(wp) :: rest_displacement = 0.0_wp
      !> Whether no equilibrium is left: neither contacts nor a spring hold it
      logical :: is_unbound = .false.
      !> Displacements at which its motion with the drive ends, though it may jump beyond [m]
      real(wp) :: stop_upper = huge(1.0_wp), stop_lower = -huge(1.0_wp)
   contains
      !> Breaks of each contact in one avalanche after which it will never settle
      procedure :: max_breaks
      !> The force of the drive jumps: extremes are noted in each advance
      procedure :: note_extreme
      procedure :: select_extremes
      !> Put the state into an archive or take it out
      procedure :: exchange => exchange_instant
   end type instant_slider_type

contains

   !> Breaks of each contact in one avalanche after which it will never settle: the force of a
   !> spring falls until it does.
   pure function max_breaks(self) result(breaks)
      !> The slider
      class(instant_slider_type), intent(in) :: self
      !> Their mean number
      real(wp) :: breaks

      breaks = huge(1.0_wp)
   end function max_breaks

   !> Extremes are noted in each advance.
   subroutine note_extreme(self)
      !> The slider
      class(instant_slider_type), intent(inout) :: self

   end subroutine note_extreme

   !> No step is needed for extremes.
   pure subroutine select_extremes(self, filter)
      !> The slider
      class(instant_slider_type), intent(in) :: self
      !> The filter
      type(step_filter_type), intent(inout) :: filter

   end subroutine select_extremes

   !> Put the state into an archive or take it out.
   subroutine exchange_instant(self, archive)
      !> The slider
      class(instant_slider_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call exchange_slider(self, archive)
      call archive%exchange("is_settled", self%is_settled)
      call archive%exchange("rest_displacement", self%rest_displacement)
      call archive%exchange("is_unbound", self%is_unbound)
   end subroutine exchange_instant

end module mesoslip_sliders_instant
