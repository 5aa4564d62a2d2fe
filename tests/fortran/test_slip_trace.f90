!> Finer samples around slips have increasing times.
program test_slip_trace
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_recording_slip_trace, only: slip_trace_type
   use mesoslip_sliders_base, only: slider_type
   use mesoslip_sliders_force, only: make_slider_force
   use testing, only: check, finish
   implicit none

   type(slip_trace_type) :: trace
   class(slider_type), allocatable :: slider

   call advance_to_one()
   call trace%open(0.25_wp)
   call trace%begin(0.0_wp, 0_i8)
   call trace%take_samples(slider, 0.0_wp, 0.3_wp)
   call trace%confirm(0_i8)
   ! A fall begins at the time of a sample, and again after one without a duration.
   call trace%begin(0.25_wp, 1_i8)
   call trace%begin(0.25_wp, 1_i8)
   call trace%take_samples(slider, 0.0_wp, 0.6_wp)
   call check_times([0.0_wp, 0.25_wp, 0.5_wp], "no time twice")
   call trace%begin(0.55_wp, 1_i8)
   call trace%take_samples(slider, 0.0_wp, 0.7_wp)
   call check_times([0.0_wp, 0.25_wp, 0.5_wp, 0.55_wp], "a fall has its start")
   ! Samples of a fall without a slip are taken again.
   call trace%stop()
   call trace%begin(0.8_wp, 1_i8)
   call trace%take_samples(slider, 0.0_wp, 0.9_wp)
   call trace%drop_or_stop()
   call trace%begin(0.8_wp, 1_i8)
   call trace%take_samples(slider, 0.0_wp, 0.9_wp)
   call check_times([0.0_wp, 0.25_wp, 0.5_wp, 0.55_wp, 0.8_wp], "after samples that were dropped")
   call finish()

contains

   !> A slider that creeps from the time 0 to 1.
   subroutine advance_to_one()
      type(error_type), allocatable :: error
      type(parameters_type) :: parameters
      type(interface_law_type) :: law
      type(window_type) :: window

      call new_parameters(parameters, ["mass   ", "damping"], [1.0_wp, 1.0_wp])
      call make_slider_force(slider, parameters, error)
      law = interface_law_type(stiffness=4.0_wp)
      call slider%start(law)
      window%end_time = 1.0_wp
      call slider%advance(law, window)
   end subroutine advance_to_one

   !> The samples have these times [s].
   subroutine check_times(times, what)
      real(wp), intent(in) :: times(:)
      character(len=*), intent(in) :: what

      logical :: are_equal

      are_equal = trace%rows%count == size(times)
      if (are_equal) are_equal = all(abs(trace%rows%row(1, :size(times)) - times) <= 0.0_wp)
      call check(are_equal, what)
   end subroutine check_times

end program test_slip_trace
