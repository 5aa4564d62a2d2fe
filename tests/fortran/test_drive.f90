!> The drive, and its work on sliders in equilibrium.
program test_drive
   use mesoslip_drive, only: drive_type
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_recording_steady, only: steady_recorder_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   use mesoslip_sliders_instant, only: instant_slider_type
   use mesoslip_sliders_prescribed, only: slider_prescribed_type
   use mesoslip_sliders_quasistatic, only: slider_quasistatic_type
   use mesoslip_sliders_quasistatic_force, only: make_slider_quasistatic_force
   use testing, only: check, check_close, finish
   implicit none

   call goes_through_parts()
   call ramp_to_rest()
   call keeps_value_and_work()
   call has_a_part()
   call pulls_a_spring()
   call pulls_with_a_force()
   call finds_a_maximum(-2.0_wp)
   call finds_a_maximum(2.0_wp)
   call is_steady_at_once()
   call finish()

contains

   !> A ramp up, a ramp that turns round, and a second stage at rest.
   subroutine goes_through_parts()
      type(drive_type) :: drive
      type(error_type), allocatable :: error

      call drive%open([2.0_wp, 4.0_wp, 5.0_wp], [0.0_wp, 4.0_wp, 0.0_wp], &
         & [4.0_wp, -4.0_wp, 0.0_wp], [0, 0, 1], error)
      call check(.not. allocated(error) .and. drive%is_open(), "a drive has its parts")
      call drive%begin(0.0_wp)
      call check_close(drive%acceleration, 2.0_wp, 0.0_wp, "acceleration of a ramp")
      call check_close(drive%next_change(), 2.0_wp, 0.0_wp, "a ramp up does not turn round")
      call check_close(drive%at(2.0_wp), 4.0_wp, 0.0_wp, "displacement after a ramp")
      call check(.not. drive%is_stage_over(), "a stage of two parts")
      call drive%take_next_part(2.0_wp)
      call check_close(drive%acceleration, -4.0_wp, 0.0_wp, "acceleration of the next part")
      call check_close(drive%next_change(), 3.0_wp, 0.0_wp, "a ramp down turns round")
      call check_close(drive%rate_at(3.0_wp + 1.0e-9_wp), 0.0_wp, 0.0_wp, &
         & "rounding does not turn it round")
      call drive%turn_round(3.0_wp)
      call check_close(drive%at(3.0_wp), 6.0_wp, 0.0_wp, "displacement at the turn")
      call check(drive%direction < 0.0_wp, "a drive that turns round changes its direction")
      call check_close(drive%next_change(), 4.0_wp, 0.0_wp, "it turns round once")
      call check(drive%is_stage_over() .and. .not. drive%is_last_part(), "the stage ends")
      call drive%take_next_part(4.0_wp)
      call check(drive%is_last_part() .and. drive%stage() == 1, "the last stage")
      call check_close(drive%at(5.0_wp), 4.0_wp, 0.0_wp, "a drive at rest")
   end subroutine goes_through_parts

   !> A ramp to rest does not turn round, whatever the rounding of its time of rest.
   subroutine ramp_to_rest()
      integer, parameter :: cases = 200
      type(error_type), allocatable :: error
      integer :: first, second
      real(wp) :: start, end
      logical :: is_right

      is_right = .true.
      do first = 1, cases
         start = 0.01_wp * first
         do second = 1, 20
            end = start + 0.07_wp * second
            block
               type(drive_type) :: drive

               call drive%open([start, end], [0.03_wp, 0.03_wp], [0.03_wp, 0.0_wp], [0, 1], error)
               call drive%begin(0.0_wp)
               call drive%take_next_part(start)
               is_right = is_right .and. .not. drive%next_change() < end
            end block
         end do
      end do
      call check(is_right .and. .not. allocated(error), "a ramp to rest ends at its end")
   end subroutine ramp_to_rest

   !> Another origin changes neither work nor impulse; a stage counts its impulse from zero.
   subroutine keeps_value_and_work()
      type(drive_type) :: drive
      type(error_type), allocatable :: error

      call drive%open([1.0_wp, 2.0_wp], [3.0_wp, 5.0_wp], [3.0_wp, 5.0_wp], [0, 1], error)
      call drive%begin(0.0_wp)
      call drive%begin_stage()
      call drive%impulse%add(7.0_wp)
      call drive%rebase(0.5_wp, 1.0_wp)
      call check_close(drive%at(1.0_wp), 2.0_wp, 0.0_wp, "displacement from another origin")
      call check_close(drive%work(), 21.0_wp, 0.0_wp, "work at a constant velocity")
      call drive%take_next_part(1.0_wp)
      call check_close(drive%stage_impulse(), 7.0_wp, 0.0_wp, "impulse of a stage")
      call drive%begin_stage()
      call drive%impulse%add(2.0_wp)
      call check_close(drive%stage_impulse(), 2.0_wp, 0.0_wp, "impulse of the next stage")
      call check_close(drive%work(), 31.0_wp, 0.0_wp, "work at two velocities")
   end subroutine keeps_value_and_work

   !> A drive without parts is refused.
   subroutine has_a_part()
      type(drive_type) :: drive
      type(error_type), allocatable :: error

      call drive%open([real(wp) ::], [real(wp) ::], [real(wp) ::], [integer ::], error)
      call check(allocated(error) .and. .not. drive%is_open(), "a drive without parts")
   end subroutine has_a_part

   !> Under an accelerated spring on contacts that hold, work is the energy of both, and the impulse
   !> is the integral of the force: x = K X_d/(K + K_c), X_d = v t + a t**2/2.
   subroutine pulls_a_spring()
      real(wp), parameter :: spring = 2.0_wp, contacts = 3.0_wp, velocity = 0.5_wp, &
         & acceleration = 0.7_wp, time = 1.5_wp
      type(slider_quasistatic_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window
      real(wp) :: series, drive

      slider = slider_quasistatic_type(stiffness=spring, pull_over_value=spring)
      law%stiffness = contacts
      series = spring * contacts / (spring + contacts)
      call slider%start(law)
      call slider%drive%change(0.0_wp, velocity, acceleration)
      window%end_time = time
      call slider%advance(law, window)
      drive = velocity * time + 0.5_wp * acceleration * time**2
      call check_close(slider%displacement, spring * drive / (spring + contacts), 1.0e-15_wp, &
         & "equilibrium of spring and contacts")
      call check_close(slider%drive%work(), 0.5_wp * series * drive**2, 1.0e-15_wp, &
         & "work of an accelerated drive")
      call check_close(slider%drive%stage_impulse(), series &
         & * (0.5_wp * velocity * time**2 + acceleration * time**3 / 6.0_wp), 1.0e-15_wp, &
         & "impulse of an accelerated drive")
      call check_close(slider%drive%extremes%max_force, series * drive, 1.0e-15_wp, &
         & "maximum of the force")
   end subroutine pulls_a_spring

   !> The same under an accelerated force, with another origin halfway: x = F/K_c.
   subroutine pulls_with_a_force()
      real(wp), parameter :: contacts = 3.0_wp, rate = 0.5_wp, acceleration = 0.7_wp, &
         & times(2) = [0.6_wp, 1.5_wp], shift = 0.125_wp
      class(slider_type), allocatable :: slider
      type(parameters_type) :: parameters
      type(error_type), allocatable :: error
      type(interface_law_type) :: law
      type(window_type) :: window
      type(motion_type) :: motion
      real(wp) :: force

      call new_parameters(parameters, [character(len=1) ::], [real(wp) ::])
      call make_slider_quasistatic_force(slider, parameters, error)
      law%stiffness = contacts
      call slider%start(law)
      call slider%drive%change(0.0_wp, rate, acceleration)
      window%end_time = times(1)
      call slider%advance(law, window)
      call slider%shift_origin(shift)
      motion = slider%observe(slider%time)
      force = rate * times(1) + 0.5_wp * acceleration * times(1)**2
      call check_close(motion%displacement, force / contacts, 1.0e-15_wp, &
         & "displacement that is observed from another origin")
      call check_close(motion%contact_force, force, 1.0e-15_wp, &
         & "force that is observed from another origin")
      law%offset = -contacts * shift
      window%end_time = times(2)
      call slider%advance(law, window)
      force = rate * times(2) + 0.5_wp * acceleration * times(2)**2
      call check_close(slider%origin + slider%displacement, force / contacts, 1.0e-15_wp, &
         & "equilibrium under a force")
      call check_close(slider%drive%work(), 0.5_wp * force**2 / contacts, 1.0e-15_wp, &
         & "work of a force")
      call check_close(slider%drive%stage_impulse(), &
         & 0.5_wp * rate * times(2)**2 + acceleration * times(2)**3 / 6.0_wp, 1.0e-15_wp, &
         & "impulse of a force")
      select type (slider)
      class is (instant_slider_type)
         call check(slider%max_breaks < huge(1.0_wp), "contacts can break without end")
      end select
   end subroutine pulls_with_a_force

   !> A prescribed slider that accelerates from rest: the contact force K x + C v has an extreme at
   !> t = -C/K, for K < 0 and C > 0 as for K > 0 and C < 0.
   subroutine finds_a_maximum(stiffness)
      real(wp), intent(in) :: stiffness

      real(wp), parameter :: drag = 1.0_wp, acceleration = 0.7_wp
      type(slider_prescribed_type) :: slider
      type(interface_law_type) :: law
      type(window_type) :: window
      real(wp) :: extreme

      law%stiffness = stiffness
      law%drag = sign(drag, -stiffness)
      call slider%start(law)
      call slider%drive%change(0.0_wp, 0.0_wp, acceleration)
      window%end_time = 2.0_wp * drag / abs(stiffness)
      call slider%advance(law, window)
      extreme = merge(slider%drive%extremes%max_force, slider%drive%extremes%min_force, &
         & stiffness < 0.0_wp)
      call check_close(extreme, -0.5_wp * drag**2 * acceleration / stiffness, 1.0e-15_wp, &
         & "extreme of the force within a step")
      call check_close(merge(slider%drive%extremes%max_time, slider%drive%extremes%min_time, &
         & stiffness < 0.0_wp), drag / abs(stiffness), 1.0e-15_wp, "time of the extreme")
   end subroutine finds_a_maximum

   !> A constant force is steady after twice the blocks, also within a stage that has begun before.
   subroutine is_steady_at_once()
      real(wp), parameter :: velocity = 2.0_wp, force = 3.0_wp, duration = 0.5_wp
      integer, parameter :: blocks = 2
      type(steady_recorder_type) :: recorder
      logical :: is_steady
      integer :: block

      call recorder%open(velocity * duration, blocks, 1.0e-9_wp)
      call recorder%begin(10.0_wp, velocity, 7.0_wp)
      do block = 1, 2 * blocks
         call recorder%end_block(7.0_wp + block * force * duration, is_steady)
         call check(is_steady .eqv. block == 2 * blocks, "a constant force is steady")
      end do
   end subroutine is_steady_at_once

end program test_drive
