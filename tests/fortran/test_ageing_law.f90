!> Ageing laws: limits, rates by differences, and the contacts that break under a force.
program test_ageing_law
   use mesoslip_contacts_ageing_law, only: ageing_law_type, take_ageing_law
   use mesoslip_contacts_ageing_meeting, only: meet, meet_newborn
   use mesoslip_motion_prediction, only: prediction_type
   use mesoslip_contacts_threshold_laws, only: new_threshold_law
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use mesoslip_interface_law, only: interface_law_type, pose_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: name_length, new_parameters, parameters_type
   use testing, only: check, check_close, finish
   implicit none

   real(wp), parameter :: width = 0.1_wp, tau = 2.0_wp
   type(ageing_law_type) :: law
   class(threshold_law_type), allocatable :: thresholds
   type(error_type), allocatable :: error
   ! Oscillation of a slider about its drive, and rate of a threshold
   real(wp) :: amplitude, phase, rate

   call take("relax", [0.5_wp, 0.4_wp])
   call check(.not. allocated(error), "relax")
   ! Two deviations above the mean: 0.5 (1 + 2 0.4) when young, 1 + 2 0.1 when old.
   call check_close(law%threshold(1.2_wp, 1.0_wp, 0.0_wp), 0.9_wp, 1.0e-15_wp, "young")
   call check_close(law%threshold(1.2_wp, 1.0_wp, 1.0e3_wp), 1.2_wp, 0.0_wp, "old")
   call check_close(law%threshold(1.2_wp, 1.0_wp, tau), 1.2_wp - 0.3_wp * exp(-1.0_wp), &
      & 1.0e-15_wp, "at tau_a")
   call check(law%falls(1.6_wp, 1.0_wp) .and. .not. law%falls(1.4_wp, 1.0_wp), &
      & "the strongest fall, beyond five deviations")
   call check(law%is_old(100.0_wp) .and. .not. law%is_old(10.0_wp), "old after some tau_a")
   ! 0.5 (1 + 0.4 z) = 0.1 for z = -2.
   call check_close(thresholds%minimum, 0.8_wp, 1.0e-14_wp, "the weakest young cannot attach")
   call consistent()
   call meeting()

   call take("relax", [1.0_wp, width])
   call check_close(thresholds%minimum, 0.1_wp, 0.0_wp, "young like old: the same contacts attach")
   call check_close(law%threshold(1.2_wp, 1.0_wp, 0.3_wp), 1.2_wp, 0.0_wp, "young like old")
   call check(.not. law%acts() .and. law%is_constant(1.2_wp, 1.0_wp), "nothing changes")
   call check_close(meet(law, 1.2_wp, 1.0_wp, 0.3_wp, 0.1_wp, 0.7_wp), 1.2_wp, 0.0_wp, &
      & "young like old break where they would")

   call take("log", [0.05_wp])
   call check(.not. allocated(error), "log")
   call check_close(law%threshold(1.2_wp, 1.0_wp, 0.0_wp), 1.2_wp, 0.0_wp, "at birth")
   call check_close(law%threshold(1.2_wp, 1.0_wp, tau * (exp(3.0_wp) - 1.0_wp)), 1.38_wp, &
      & 1.0e-14_wp, "three e-folds")
   call check(.not. law%falls(9.0_wp, 1.0_wp) .and. .not. law%is_old(1.0e9_wp), "grows for ever")
   call consistent()
   call meeting()
   call check(law%acts() .and. .not. law%is_constant(1.2_wp, 1.0_wp), "thresholds change")
   call never_late()

   call take("relax", [0.0_wp, 0.4_wp])
   call check(allocated(error), "young without force are refused")
   call take("relax", [0.01_wp, 0.001_wp])
   call check(allocated(error), "young contacts that cannot attach are refused")
   call take("log", [-0.1_wp])
   call check(allocated(error), "a growth below 0 is refused")
   call take("none", [0.1_wp])
   call check(allocated(error), "an unknown law is refused")
   call finish()

contains

   !> A slider that oscillates about a drive without damping meets a growing threshold no earlier
   !> than predicted, and not much later.
   subroutine never_late()
      integer, parameter :: phases = 180
      real(wp), parameter :: amplitudes(3) = [0.02_wp, 0.17_wp, 0.7_wp]
      real(wp), parameter :: rates(4) = [0.1_wp, 0.7_wp, 0.95_wp, 0.999_wp]
      real(wp), parameter :: times(3) = [0.1_wp, 0.25_wp, 0.5_wp]

      type(prediction_type) :: prediction
      type(pose_type) :: pose
      type(interface_law_type) :: nothing
      real(wp) :: gap, growth, found, late, early
      logical :: is_known
      integer :: i, j, k, l, count

      count = 0
      late = 0.0_wp
      early = 0.0_wp
      do i = 1, phases
         phase = i * 4.0_wp * atan(1.0_wp) / 90.0_wp
         do j = 1, size(amplitudes)
            amplitude = amplitudes(j)
            pose = pose_type(velocity=1.0_wp + amplitude * cos(phase), &
               & acceleration=-amplitude * sin(phase), inverse_mass=1.0_wp, own_rate=1.0_wp, &
               & is_known=.true., driving=1.0_wp)
            prediction = prediction_type()
            call prediction%predict(pose, nothing)
            do k = 1, size(rates)
               rate = rates(k) * pose%velocity
               do l = 1, size(times)
                  gap = distance(times(l), 0.0_wp)
                  if (.not. gap > 0.0_wp) cycle
                  found = 0.0_wp
                  call prediction%extrapolate(law, rate, 0.5_wp, gap, pose%velocity, 1.0_wp, &
                     & 1.0e-12_wp, found, is_known)
                  if (.not. is_known) cycle
                  growth = moved(meeting_time(gap)) - gap
                  count = count + 1
                  late = max(late, found - growth)
                  if (k <= 2) early = max(early, 1.0_wp - found / growth)
               end do
            end do
         end do
      end do
      call check(count > 3000, "motions that are predicted")
      call check(late < 1.0e-13_wp, "breaks are not predicted late")
      call check(early < 0.1_wp, "nor much too early where they are met fast")
   end subroutine never_late

   !> Displacement of the slider at a time.
   real(wp) function moved(time)
      real(wp), intent(in) :: time

      moved = time + amplitude * (sin(time + phase) - sin(phase))
   end function moved

   !> Displacement less the growth of the threshold and a gap.
   real(wp) function distance(time, gap)
      real(wp), intent(in) :: time, gap

      real(wp) :: grown, later_rate

      call law%grow(rate, 0.5_wp, time, grown, later_rate)
      distance = moved(time) - grown - gap
   end function distance

   !> First time at which the slider meets the threshold.
   real(wp) function meeting_time(gap)
      real(wp), intent(in) :: gap

      real(wp) :: low, high
      integer :: step

      high = 0.0_wp
      do step = 1, 400
         high = step * 0.002_wp
         if (distance(high, gap) >= -1.0e-14_wp) exit
      end do
      low = high - 0.002_wp
      do step = 1, 60
         meeting_time = 0.5_wp * (low + high)
         if (distance(meeting_time, gap) >= 0.0_wp) then
            high = meeting_time
         else
            low = meeting_time
         end if
      end do
   end function meeting_time

   !> Take a law of ageing from named numbers.
   subroutine take(kind, values)
      character(len=*), intent(in) :: kind
      real(wp), intent(in) :: values(:)

      type(parameters_type) :: parameters

      call new_threshold_law(thresholds, "gaussian", width, 0.1_wp, error)
      select case (kind)
      case ("relax")
         call new_parameters(parameters, [character(len=name_length) :: "ageing_time", &
            & "initial_age", "young_force_ratio", "young_relative_width"], [tau, 0.0_wp, values])
      case ("log")
         call new_parameters(parameters, [character(len=name_length) :: "ageing_time", &
            & "initial_age", "growth"], [tau, 0.0_wp, values])
      case default
         call new_parameters(parameters, [character(len=name_length) :: "ageing_time", &
            & "initial_age"], [tau, 0.0_wp])
      end select
      call parameters%add_word("ageing", kind)
      call take_ageing_law(law, thresholds, parameters, error)
   end subroutine take

   !> Rates are those of differences, and the contacts that break are those whose threshold is met.
   subroutine consistent()
      real(wp), parameter :: ages(4) = [0.0_wp, 0.5_wp, 3.0_wp, 20.0_wp], step = 1.0e-5_wp
      real(wp), parameter :: times(5) = [0.0_wp, 1.0e-4_wp, 0.02_wp, 0.06_wp, 9.0_wp]
      real(wp) :: threshold, rate, difference, growth, later
      integer :: place, part

      do place = 1, size(ages)
         call law%evaluate(0.9_wp, 1.0_wp, ages(place) + step, threshold, rate)
         difference = (law%threshold(0.9_wp, 1.0_wp, ages(place) + 2.0_wp * step) &
            & - law%threshold(0.9_wp, 1.0_wp, ages(place))) / (2.0_wp * step)
         call check_close(rate, difference, 1.0e-9_wp, "rate")
         call check_close(law%configured(threshold, ages(place) + step), 0.9_wp, 1.0e-14_wp, &
            & "threshold that breaks")
         ! In any unit.
         call check_close(law%threshold(0.9e-8_wp, 1.0e-8_wp, ages(place) + step), &
            & 1.0e-8_wp * threshold, 1.0e-22_wp, "unit")
         do part = 1, size(times)
            call law%evaluate(0.9_wp, 1.0_wp, ages(place), threshold, rate)
            call law%grow(rate, ages(place), times(part), growth, difference)
            call law%evaluate(0.9_wp, 1.0_wp, ages(place) + times(part), later, rate)
            call check_close(growth, later - threshold, 1.0e-15_wp, "growth from an age on")
            call check_close(difference, rate, 1.0e-15_wp, "rate at its end")
         end do
      end do
   end subroutine consistent

   !> A contact breaks where its stretch is its threshold, and does so there for the first time.
   subroutine meeting()
      real(wp), parameter :: configured(6) = [0.82_wp, 0.9_wp, 1.0_wp, 1.3_wp, 1.6_wp, 1.9_wp]
      real(wp), parameter :: speeds(8) = [1.0e-3_wp, 0.1_wp, 0.2_wp, 0.3_wp, 0.5_wp, 2.0_wp, &
         & 1.0e2_wp, 1.0e6_wp]
      real(wp), parameter :: ages(3) = [0.0_wp, 0.7_wp, 5.0_wp], stretch = 0.1_wp
      real(wp) :: found, time, together(size(configured))
      integer :: speed, age, place, part
      logical :: is_first

      do speed = 1, size(speeds)
         call meet_newborn(law, configured, 1.0_wp, stretch, speeds(speed), together)
         do age = 1, size(ages)
            do place = 1, size(configured)
               found = meet(law, configured(place), 1.0_wp, ages(age), stretch, speeds(speed))
               time = (found - stretch) / speeds(speed)
               call check_close(law%threshold(configured(place), 1.0_wp, ages(age) + time), found, &
                  & 1.0e-13_wp, "the threshold where it is met")
               is_first = .true.
               do part = 1, 99
                  is_first = is_first .and. law%threshold(configured(place), 1.0_wp, ages(age) &
                     & + 0.01_wp * part * time) > stretch + 0.01_wp * part * (found - stretch)
               end do
               call check(is_first, "it was not met before")
            end do
         end do
         do place = 1, size(configured)
            call check_close(together(place), meet(law, configured(place), 1.0_wp, 0.0_wp, &
               & stretch, speeds(speed)), 0.0_wp, "many together, to the bit")
         end do
      end do
   end subroutine meeting

end program test_ageing_law
