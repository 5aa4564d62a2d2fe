!> Rate-and-state friction on a spring, against closed forms.
program test_rate_and_state
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_theory_rate_and_state, only: evolution_ageing, evolution_slip, friction_type, &
      & load_type, move_slider
   use testing, only: check, check_close, finish
   implicit none

   integer, parameter :: points = 50
   real(wp), parameter :: tolerance = 1.0e-9_wp
   !> V_0, a, b, D
   real(wp), parameter :: v0 = 1.0e-6_wp, a = 0.01_wp, b = 0.015_wp, distance = 1.0e-5_wp
   real(wp) :: times(points), force(points), displacement(points), expected(points)
   type(friction_type) :: friction
   type(load_type) :: load
   logical :: failed
   integer :: one

   times = [(0.2_wp * one, one = 1, points)]

   ! A stiff spring: the slider moves as the load point, and the state relaxes by itself.
   call make(evolution_slip, [b, 0.0_wp], 1.0e10_wp)
   call step(10.0_wp)
   call move_slider(friction, load, 5.0_wp + times, tolerance, force, displacement, failed)
   expected = log(10.0_wp) * (a - b + b * exp(-10 * v0 * times / distance))
   call check(.not. failed, "stiff, slip law")
   call check_close(maxval(abs(force - expected)), 0.0_wp, 1.0e-8_wp, "stiff, slip law: force")
   call check_close(displacement(points), 5 * v0 + 100 * v0, 1.0e-9_wp, "stiff: displacement")

   call make(evolution_ageing, [b, 0.0_wp], 1.0e10_wp)
   call move_slider(friction, load, 5.0_wp + times, tolerance, force, displacement, failed)
   expected = a * log(10.0_wp) + b * log(0.1_wp + 0.9_wp * exp(-10 * v0 * times / distance))
   call check_close(maxval(abs(force - expected)), 0.0_wp, 1.0e-8_wp, "stiff, ageing law")

   ! Two states relax side by side.
   call make(evolution_slip, [b, -0.5_wp * b], 1.0e10_wp)
   friction%states = 2
   friction%distance = [distance, 4 * distance]
   call move_slider(friction, load, 5.0_wp + times, tolerance, force, displacement, failed)
   expected = log(10.0_wp) * (a - 0.5_wp * b + b * exp(-10 * v0 * times / distance) &
      & - 0.5_wp * b * exp(-2.5_wp * v0 * times / distance))
   call check_close(maxval(abs(force - expected)), 0.0_wp, 1.0e-8_wp, "two states")

   ! Without evolution a hold is a relaxation: V = V_0/(1 + k V_0 t/a).
   call make(evolution_ageing, [0.0_wp, 0.0_wp], 1.0e3_wp)
   call step(0.0_wp)
   call move_slider(friction, load, 5.0_wp + times, tolerance, force, displacement, failed)
   expected = -a * log(1 + 1.0e3_wp * v0 * times / a)
   call check_close(maxval(abs(force - expected)), 0.0_wp, 1.0e-9_wp, "hold without evolution")

   ! A trend: the slider lags as the force grows.
   friction%trend = 10.0_wp
   call step(1.0_wp)
   call move_slider(friction, load, times, tolerance, force, displacement, failed)
   expected = 1.0e3_wp / 1.01e3_wp * v0 * times
   call check_close(maxval(abs(displacement - expected)) / v0, 0.0_wp, 1.0e-8_wp, "trend: lag")
   call check_close(maxval(abs(force - force(1) - 10 * (expected - expected(1)))), 0.0_wp, &
      & 1.0e-12_wp, "trend: force")

   ! A soft spring: steady in the end if it is stiffer than (b - a)/D = 500, unstable below.
   call make(evolution_ageing, [b, 0.0_wp], 2.0e3_wp)
   call step(10.0_wp)
   call move_slider(friction, load, 100 * times, tolerance, force, displacement, failed)
   call check_close(force(points), (a - b) * log(10.0_wp), 1.0e-9_wp, "steady in the end")
   call make(evolution_ageing, [b, 0.0_wp], 2.0e1_wp)
   call move_slider(friction, load, 100 * times, tolerance, force, displacement, failed)
   call check(failed, "unstable")

   ! A ramp of the velocity, stiff and without evolution: the force is a ln V.
   call make(evolution_slip, [0.0_wp, 0.0_wp], 1.0e10_wp)
   load%duration = [5.0_wp, 10.0_wp, 5.0_wp]
   load%start_velocity = [v0, v0, 3 * v0]
   load%end_velocity = [v0, 3 * v0, 3 * v0]
   call move_slider(friction, load, 5.0_wp + times, tolerance, force, displacement, failed)
   expected = a * log(1 + 0.2_wp * times)
   call check_close(maxval(abs(force - expected)), 0.0_wp, 1.0e-8_wp, "ramp")
   call finish()

contains

   !> Friction at V_0
   subroutine make(evolution, both, stiffness)
      !> One of the evolution_ codes
      integer, intent(in) :: evolution
      !> b of each state
      real(wp), intent(in) :: both(2)
      !> k
      real(wp), intent(in) :: stiffness

      friction = friction_type(evolution=evolution, reference_velocity=v0, a=a, b=both, &
         & distance=distance, stiffness=stiffness)
   end subroutine make

   !> Sliding at V_0 for 5 s, then at a multiple of it
   subroutine step(ratio)
      !> The multiple
      real(wp), intent(in) :: ratio

      load%duration = [5.0_wp, 5.0_wp]
      load%start_velocity = [v0, ratio * v0]
      load%end_velocity = load%start_velocity
   end subroutine step

end program test_rate_and_state
