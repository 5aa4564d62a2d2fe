!> A slider without inertia that follows its equilibrium under a force, without a spring.
!>
!> The force is the drive's value, in N. Contacts can break under it without end.
module mesoslip_sliders_quasistatic_force
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_sliders_base, only: motion_type, shift_law, slider_type
   use mesoslip_sliders_quasistatic, only: observe_quasistatic, slider_quasistatic_type
   implicit none
   private

   public :: slider_quasistatic_force_type, make_slider_quasistatic_force

   !> A slider in equilibrium under a force.
   type, extends(slider_quasistatic_type) :: slider_quasistatic_force_type
   contains
      procedure :: max_breaks
      procedure :: value_of_pull
      procedure :: add_jump
      procedure :: add_motion
      procedure :: observe
      procedure :: energy
      procedure :: shift_origin
   end type slider_quasistatic_force_type

contains

   !> Set up a slider under a force from named numbers.
   subroutine make_slider_quasistatic_force(slider, parameters, error)
      !> The slider
      class(slider_type), allocatable, intent(out) :: slider
      !> No numbers
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is superfluous
      type(error_type), allocatable, intent(inout) :: error

      type(slider_quasistatic_force_type), allocatable :: self

      allocate (self)
      call parameters%finish(error)
      if (allocated(error)) return
      self%pull_over_value = 1.0_wp
      call move_alloc(self, slider)
   end subroutine make_slider_quasistatic_force

   !> Breaks of each contact in one avalanche from which on it is taken to slide for ever.
   pure function max_breaks(self) result(breaks)
      !> The slider
      class(slider_quasistatic_force_type), intent(in) :: self
      !> Their mean number
      real(wp) :: breaks

      breaks = 1000.0_wp
   end function max_breaks

   !> Value of the drive that pulls with a force: the force.
   pure function value_of_pull(self, force) result(value)
      !> The slider
      class(slider_quasistatic_force_type), intent(in) :: self
      !> Force [N]
      real(wp), intent(in) :: force
      !> The same [N]
      real(wp) :: value

      value = force
   end function value_of_pull

   !> Add the work of the force in a jump.
   subroutine add_jump(self, distance, pull)
      !> The slider
      class(slider_quasistatic_force_type), intent(inout) :: self
      !> Displacement in the jump [m], and force of the drive [N]
      real(wp), intent(in) :: distance, pull

      call self%drive%earlier_work%add(distance * pull)
   end subroutine add_jump

   !> Add the work and the impulse of the force in the motion of the last advance.
   subroutine add_motion(self, step, distance)
      !> The slider
      class(slider_quasistatic_force_type), intent(inout) :: self
      !> Duration [s] and displacement [m] of the motion
      real(wp), intent(in) :: step, distance

      real(wp) :: pull, rate, acceleration

      pull = self%pull(self%step_time)
      rate = self%drive%rate_at(self%step_time)
      acceleration = self%drive%acceleration
      ! The displacement grows with the force, so the work is that of their mean.
      call self%drive%earlier_work%add(distance &
         & * (pull + step * (0.5_wp * rate + 0.25_wp * acceleration * step)))
      call self%drive%earlier_impulse%add(step &
         & * (pull + step * (0.5_wp * rate + acceleration * step / 6.0_wp)))
   end subroutine add_motion

   !> The motion at a time of the last advance.
   pure function observe(self, time) result(motion)
      !> The slider
      class(slider_quasistatic_force_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> The motion; the drive is where the slider is
      type(motion_type) :: motion

      motion = observe_quasistatic(self, time)
      motion%drive_displacement = motion%displacement
   end function observe

   !> A slider without mass and spring has no energy.
   pure function energy(self)
      !> The slider
      class(slider_quasistatic_force_type), intent(in) :: self
      !> Energy [J]
      real(wp) :: energy

      energy = 0.0_wp
   end function energy

   !> Move the origin of displacements, which the force does not depend on.
   subroutine shift_origin(self, shift)
      !> The slider
      class(slider_quasistatic_force_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      call self%drive%rebase(self%time, 0.0_wp)
      self%displacement = self%displacement - shift
      self%origin = self%origin + shift
      self%rest_displacement = self%rest_displacement - shift
      call shift_law(self%law, shift)
   end subroutine shift_origin

end module mesoslip_sliders_quasistatic_force
