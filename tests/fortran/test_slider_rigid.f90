!> The rigid slider against closed forms, and at ends of windows.
program test_slider_rigid
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_base, only: motion_type
   use mesoslip_sliders_rigid, only: slider_rigid_type
   use testing, only: check, check_close, finish
   implicit none

   real(wp), parameter :: frequency = 3.0_wp, drive_velocity = 0.7_wp

   call oscillates()
   call stops_at_crossing()
   call climbs(1.0e-6_wp)
   call climbs(2.0e-4_wp)
   call climbs(8.0e-3_wp)
   call damps(2.0e-4_wp)
   call damps(8.0e-3_wp)
   call damps(1.0_wp)
   call turns_short_of_crossing()
   call stays_at_rest()
   call is_observed()
   call finish()

contains

   !> A slider in balance with the contacts, under a drive of constant velocity.
   subroutine set_up(slider, law, mass, damping)
      type(slider_rigid_type), intent(out) :: slider
      type(interface_law_type), intent(in) :: law
      real(wp), intent(in) :: mass, damping

      slider = slider_rigid_type(mass=mass, stiffness=mass * frequency**2, damping=damping)
      call slider%start(law)
      call slider%drive%change(slider%time, drive_velocity, 0.0_wp)
   end subroutine set_up

   !> From rest under a drive of constant velocity, x = v (t - sin(w t)/w).
   subroutine oscillates()
      type(slider_rigid_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window
      real(wp) :: time

      call set_up(slider, law, 2.0_wp, 0.0_wp)
      window%end_time = 10.0_wp
      do while (slider%time < window%end_time)
         call slider%advance(law, window)
      end do
      time = slider%time
      call check(abs(time - window%end_time) <= 0.0_wp, "the end of the window is met to the bit")
      call check_close(slider%displacement, drive_velocity * (time - sin(frequency * time) &
         & / frequency), 1.0e-13_wp, "displacement of a free oscillator")
      call check_close(slider%velocity, drive_velocity * (1.0_wp - cos(frequency * time)), &
         & 1.0e-13_wp, "velocity of a free oscillator")
      call check_close(slider%drive%work(), slider%energy(), 1.0e-12_wp, &
         & "energy is conserved")
   end subroutine oscillates

   !> A crossing is met to the bit in displacement, and to rounding in time.
   subroutine stops_at_crossing()
      type(slider_rigid_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window

      call set_up(slider, law, 1.0_wp, 0.0_wp)
      window%end_time = 10.0_wp
      window%upper = drive_velocity * (0.5_wp - sin(0.5_wp * frequency) / frequency)
      do while (slider%displacement < window%upper)
         call slider%advance(law, window)
      end do
      call check(abs(slider%displacement - window%upper) <= 0.0_wp, "displacement of a crossing")
      call check_close(slider%time, 0.5_wp, 1.0e-13_wp, "time of a crossing")
   end subroutine stops_at_crossing

   !> Many crossings, from rest under a steady drive: the displacement is met to the bit, time and
   !> velocity, from the closed form, to rounding.
   subroutine climbs(rung)
      !> Distance from one crossing to the next
      real(wp), intent(in) :: rung

      type(slider_rigid_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window
      real(wp) :: off, late, fast
      integer :: crossing

      call set_up(slider, law, 1.0_wp, 0.0_wp)
      window%end_time = 10.0_wp
      off = 0.0_wp
      late = 0.0_wp
      fast = 0.0_wp
      do crossing = 1, int(min(2000.0_wp, 0.5_wp / rung))
         window%upper = crossing * rung
         do while (slider%displacement < window%upper)
            call slider%advance(law, window)
         end do
         associate (phase => frequency * slider%time)
            off = max(off, abs(slider%displacement - window%upper))
            ! Over the velocity: the time by which a crossing is late.
            late = max(late, abs(drive_velocity * (slider%time - sin(phase) / frequency) &
               & - window%upper) / slider%velocity)
            fast = max(fast, abs(drive_velocity * (1.0_wp - cos(phase)) - slider%velocity))
         end associate
      end do
      call check(off <= 0.0_wp, "displacement of all crossings")
      call check_close(late, 0.0_wp, 1.0e-13_wp, "time of all crossings")
      call check_close(fast, 0.0_wp, 1.0e-12_wp, "velocity at all crossings")
      call check_close(slider%drive%work(), slider%energy(), 1.0e-13_wp, &
         & "energy over all crossings")
   end subroutine climbs

   !> Block and damper share the momentum: M (V + W) is the impulse of the drive, its work over its
   !> velocity. The energy that the damper takes is its loss.
   subroutine damps(rung)
      !> Distance from one crossing to the next, which makes steps short or long
      real(wp), intent(in) :: rung

      real(wp), parameter :: mass = 2.0_wp, damping = 1.3_wp
      type(slider_rigid_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window
      integer :: crossing

      call set_up(slider, law, mass, damping)
      window%end_time = 10.0_wp
      do crossing = 1, int(1.5_wp / rung)
         window%upper = crossing * rung
         do while (slider%displacement < window%upper)
            call slider%advance(law, window)
         end do
      end do
      call check_close(mass * (2.0_wp * slider%velocity - slider%damper / damping), &
         & slider%drive%work() / drive_velocity, 1.0e-12_wp, "momentum of block and damper")
      call check_close(slider%energy() + slider%damping_loss%total(), slider%drive%work(), &
         & 1.0e-12_wp, "energy with a damper")
   end subroutine damps

   !> An oscillation of amplitude 1 about 0 stays inside a slightly wider window, and leaves a
   !> slightly narrower one, on either side.
   subroutine turns_short_of_crossing()
      integer :: side

      do side = -1, 1, 2
         call check(reaches(1.0_wp + 1.0e-9_wp, side) > 9.0_wp, &
            & "no crossing beyond the turning point")
         call check_close(reaches(1.0_wp - 1.0e-9_wp, side), &
            & (acos(-1.0_wp) - acos(1.0_wp - 1.0e-9_wp)) / frequency, 1.0e-8_wp, &
            & "crossing right before the turning point")
      end do
   end subroutine turns_short_of_crossing

   !> Time at which a free oscillation from one side leaves a window on the other; 10 if never.
   function reaches(limit, side) result(time)
      real(wp), intent(in) :: limit
      integer, intent(in) :: side
      real(wp) :: time

      type(slider_rigid_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window

      call set_up(slider, law, 1.0_wp, 0.0_wp)
      call slider%drive%change(slider%time, 0.0_wp, 0.0_wp)
      slider%displacement = -side
      window%end_time = 10.0_wp
      if (side > 0) then
         window%upper = limit
      else
         window%lower = -limit
      end if
      do while (slider%time < window%end_time .and. slider%displacement < window%upper &
         & .and. slider%displacement > window%lower)
         call slider%advance(law, window)
      end do
      time = slider%time
   end function reaches

   !> At rest and in balance under a drive at rest nothing happens.
   subroutine stays_at_rest()
      type(slider_rigid_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window
      integer :: advances

      law = interface_law_type(stiffness=5.0_wp, offset=-1.0_wp, drag=0.1_wp)
      slider = slider_rigid_type(mass=1.0_wp, stiffness=frequency**2, damping=0.4_wp)
      call slider%start(law)
      window%end_time = 1.0_wp
      window%upper = 1.0e-300_wp
      do advances = 1, 100
         call slider%advance(law, window)
      end do
      call check(abs(slider%velocity) <= 1.0e-16_wp, "a balanced slider stays at rest")
      call check(slider%time >= 1.0_wp, "and time passes")
   end subroutine stays_at_rest

   !> The end of a step is observed from another origin, and so is a step without length.
   subroutine is_observed()
      type(slider_rigid_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window
      type(motion_type) :: motion
      real(wp) :: force

      law = interface_law_type(stiffness=5.0_wp, offset=-1.0_wp, drag=0.1_wp)
      call set_up(slider, law, 2.0_wp, 0.0_wp)
      window%end_time = 0.1_wp
      do while (slider%time < window%end_time)
         call slider%advance(law, window)
      end do
      force = law%stiffness * slider%displacement - law%offset + law%drag * slider%velocity
      call slider%shift_origin(0.25_wp)
      motion = slider%observe(slider%time)
      call check_close(motion%displacement, slider%origin + slider%displacement, 1.0e-14_wp, &
         & "displacement that is observed from another origin")
      call check_close(motion%contact_force, force, 1.0e-14_wp, &
         & "force that is observed from another origin")
      law%offset = law%offset - 0.25_wp * law%stiffness
      window%upper = slider%displacement
      window%end_time = 1.0_wp
      call slider%advance(law, window)
      motion = slider%observe(slider%time)
      call check_close(motion%velocity, slider%velocity, 1.0e-14_wp, &
         & "velocity in a step without length")
      call check_close(slider%start_acceleration, slider%acceleration, 1.0e-14_wp, &
         & "acceleration in a step without length")
   end subroutine is_observed

end program test_slider_rigid
