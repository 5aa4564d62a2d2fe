!> A slider without inertia that follows its equilibrium under a force, without a spring.
!>
!> The force is the drive's value, in N. Contacts can break under it without end, and a slider whose
!> contacts break a thousand times each in one avalanche never settles.
module mesoslip_sliders_quasistatic_force
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_sliders_base, only: motion_type, shift_law, slider_type
   use mesoslip_sliders_quasistatic, only: slider_quasistatic_type
   implicit none
   private

   public :: slider_quasistatic_force_type, make_slider_quasistatic_force

   !> A slider in equilibrium under a force.
   type, extends(slider_quasistatic_type) :: slider_quasistatic_force_type
   contains
      procedure :: add_jump
      procedure :: add_motion
      procedure :: observe
      procedure :: shift_origin
   end type slider_quasistatic_force_type

contains

   !> Set up a slider under a force, which has no parameters.
   subroutine make_slider_quasistatic_force(slider, parameters, error)
      class(slider_type), allocatable, intent(out) :: slider
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(slider_quasistatic_force_type), allocatable :: self

      allocate (self)
      call parameters%finish(error)
      if (allocated(error)) return
      self%pull_over_value = 1.0_wp
      self%max_breaks = 1000.0_wp
      call move_alloc(self, slider)
   end subroutine make_slider_quasistatic_force

   subroutine add_jump(self, distance, pull)
      class(slider_quasistatic_force_type), intent(inout) :: self
      real(wp), intent(in) :: distance, pull

      call self%drive%add_work(distance * pull)
   end subroutine add_jump

   subroutine add_motion(self, step, distance)
      class(slider_quasistatic_force_type), intent(inout) :: self
      real(wp), intent(in) :: step, distance

      real(wp) :: pull, rate, acceleration

      pull = self%pull(self%step_time)
      rate = self%drive%rate_at(self%step_time)
      acceleration = self%drive%acceleration
      ! The displacement grows with the force, so the work is that of their mean.
      call self%drive%add_work(distance &
         & * (pull + step * (0.5_wp * rate + 0.25_wp * acceleration * step)))
      call self%drive%earlier_impulse%add(step &
         & * (pull + step * (0.5_wp * rate + acceleration * step / 6.0_wp)))
   end subroutine add_motion

   !> The drive's displacement is that of the slider.
   pure function observe(self, time) result(motion)
      class(slider_quasistatic_force_type), intent(in) :: self
      real(wp), intent(in) :: time
      type(motion_type) :: motion

      motion = self%slider_quasistatic_type%observe(time)
      motion%drive_displacement = motion%displacement
   end function observe

   !> The force does not depend on the origin.
   subroutine shift_origin(self, shift)
      class(slider_quasistatic_force_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call self%drive%rebase(self%time, 0.0_wp)
      self%displacement = self%displacement - shift
      self%origin = self%origin + shift
      self%rest_displacement = self%rest_displacement - shift
      call shift_law(self%law, shift)
   end subroutine shift_origin

end module mesoslip_sliders_quasistatic_force
