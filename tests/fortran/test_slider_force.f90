!> The slider under a force against closed forms.
program test_slider_force
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_sliders_base, only: slider_type
   use mesoslip_sliders_force, only: make_slider_force
   use testing, only: check, check_close, finish
   implicit none

   real(wp), parameter :: mass = 2.0_wp, damping = 0.3_wp

   call creeps_with(0.0_wp, -6.0_wp)
   call creeps_with(0.5_wp, 0.0_wp)
   call creeps_with(0.5_wp, 3.0_wp)
   call finish()

contains

   !> Uniform creep, under a force and with contacts that attach, is advanced in one step.
   subroutine creeps_with(drive_rate, contact_rate)
      !> Rates of the external force and of the contact force [N/s]
      real(wp), intent(in) :: drive_rate, contact_rate

      real(wp), parameter :: force = 0.25_wp, duration = 1.0e6_wp
      class(slider_type), allocatable :: slider
      type(error_type), allocatable :: error
      type(parameters_type) :: parameters
      type(interface_law_type) :: law
      type(window_type) :: window
      real(wp) :: velocity

      call new_parameters(parameters, ["mass   ", "damping"], [mass, damping])
      call make_slider_force(slider, parameters, error)
      law = interface_law_type(stiffness=4.0_wp, drag=0.7_wp, rate=contact_rate)
      velocity = (drive_rate - contact_rate) / law%stiffness
      law%offset = (law%drag + mass * damping) * velocity - force
      slider%drive%value = force
      call slider%drive%change(slider%time, drive_rate, 0.0_wp)
      call slider%start(law)
      slider%velocity = velocity
      window%end_time = duration
      call slider%advance(law, window)
      call check(abs(slider%time - duration) <= 0.0_wp, "uniform creep takes one step")
      call check_close(slider%displacement, velocity * duration, 1.0e-9_wp * duration, &
         & "displacement of uniform creep")
   end subroutine creeps_with

end program test_slider_force
