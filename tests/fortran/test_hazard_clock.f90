!> Clocks of thermal activation: readings and their times against a fine rule of Simpson.
program test_hazard_clock
   use mesoslip_interface_law, only: clocks, hazard_clock_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_hazard_clock, only: advance_clocks, reading_after, time_to_reading
   use testing, only: check, check_close, finish
   implicit none

   real(wp), parameter :: turning(6) = [1.0_wp, -2.0_wp, 0.3_wp, 0.1_wp, -0.05_wp, 0.01_wp]
   real(wp), parameter :: even(6) = [1.0_wp, 2.0e-2_wp, -1.0e-3_wp, 2.0e-5_wp, 1.0e-7_wp, 1.0e-9_wp]

   call exercise(1.0e-2_wp, [1.0_wp, 0.1_wp, -0.01_wp, 0.0_wp, 0.0_wp, 0.0_wp], "short step")
   call exercise(1.0e-2_wp, turning * 0.5_wp, "short step with a turn")
   call exercise(0.2_wp, turning, "step of one part")
   call exercise(1.0_wp, turning, "step with a turn")
   call exercise(-1.0_wp, turning, "the other sign")
   call exercise(20.0_wp, turning, "many parts")
   call exercise(-30.0_wp, turning, "steep")
   call exercise(5.0_wp, [0.7_wp], "steady motion")
   call exercise(1.0e-6_wp, [0.7_wp], "steady motion, nearly at rest")
   call exercise(-30.0_wp, [1.0_wp], "steady motion, a rate that falls")
   call exercise(1.0_wp, [0.0_wp], "rest")
   call the_first_ends_the_step(turning, 2.0_wp, "many parts")
   call the_first_ends_the_step(turning, 0.3_wp, "one part")
   call the_first_ends_the_step(turning, 2.0e-3_wp, "series of a small change")
   call the_first_ends_the_step(even, 0.6_wp, "nearly linear exponent")
   call the_first_ends_the_step(even * 0.2_wp, 1.2_wp, "exponent of a slow motion")
   call the_first_ends_the_step([1.0_wp, 5.0e-3_wp, -1.0e-4_wp], 1.9_wp, "steep, nearly linear")
   call the_first_ends_the_step(even, 0.1_wp, "middling series")
   call the_first_ends_the_step(even, 1.0e-2_wp, "short series")
   call the_first_ends_the_step([1.0_wp, 4.0e-3_wp, 1.0e-4_wp, 2.0e-6_wp], 2.0e-2_wp, &
      & "short series with all its terms")
   call the_first_ends_the_step([0.2_wp, 0.4_wp, 0.05_wp, 4.0e-3_wp, 1.0e-4_wp, 1.0e-4_wp], &
      & 0.5_wp, "smooth series")
   call the_first_ends_the_step([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 100.0_wp, 0.0_wp], 0.1_wp, &
      & "series that is not smooth")
   call check_largest([0.12_wp, 6.0e-2_wp, 4.0e-3_wp, 3.0e-4_wp, 1.0e-5_wp, 1.0e-5_wp], &
      & 1.0e-15_wp, "smooth step")
   call check_largest([0.12_wp, 4.0e-3_wp, 1.0e-4_wp, 1.0e-6_wp, 1.0e-8_wp, 1.0e-9_wp], &
      & 2.0e-12_wp, "step by its ends")
   call check_largest([-0.12_wp, 4.0e-3_wp, -1.0e-4_wp, 1.0e-6_wp, -1.0e-8_wp, 1.0e-9_wp], &
      & 2.0e-12_wp, "step by its ends, the other direction")
   call finish()

contains

   !> A step with the largest exponents of a rule, with and without an end, against ten points.
   subroutine check_largest(exponent, tolerance, name)
      !> The exponent over the step
      real(wp), intent(in) :: exponent(6), tolerance
      character(len=*), intent(in) :: name

      type(hazard_clock_type) :: clock(clocks)
      real(wp) :: step, series(6), expected
      integer :: term, number, ended_by
      logical :: is_ended

      series = 0.999_wp * [(term * exponent(term), term=1, size(exponent))]
      do ended_by = 0, clocks
         clock%is_used = .true.
         clock%slope = [1.0_wp, -1.0_wp]
         clock%rate = 1.0_wp
         clock%left = [(merge(0.8_wp, 1.0e3_wp, number == ended_by), number=1, clocks)]
         clock%is_due = .false.
         step = 1.0_wp
         call advance_clocks(clock, series, size(series), step, is_ended)
         call check(is_ended .eqv. ended_by > 0, name // ": end")
         do number = 1, clocks
            expected = reading_after(clock(number)%slope, series, size(series), step)
            if (number == ended_by) then
               call check_close(0.8_wp, expected, tolerance, name // ": reading at the end")
            else
               call check_close(clock(number)%elapsed, expected, tolerance, name)
            end if
         end do
      end do
   end subroutine check_largest

   !> Readings over parts of a step, and the times at which a clock reaches them.
   subroutine exercise(slope, series, name)
      !> Change of the exponent with the displacement
      real(wp), intent(in) :: slope
      !> Coefficients of the velocity in a step of length 1
      real(wp), intent(in) :: series(0:)
      character(len=*), intent(in) :: name

      type(hazard_clock_type) :: clock
      real(wp) :: time, reading, expected
      integer :: part

      clock%is_used = .true.
      clock%slope = slope
      clock%rate = 3.0_wp
      do part = 1, 5
         time = 0.2_wp * part
         reading = clock%rate * reading_after(slope, series, size(series), time)
         expected = clock%rate * simpson(slope, series, time)
         call check_close(reading, expected, 1.0e-12_wp * expected, name // ": reading")
         clock%left = expected
         call check_close(clock%rate * simpson(slope, series, &
            & min(2.0_wp, time_to_reading(clock, series, size(series), 1.01_wp))), expected, &
            & 1.0e-12_wp * expected, name // ": time")
      end do
      clock%left = 1.001_wp * expected
      time = time_to_reading(clock, series, size(series), 1.0_wp)
      call check(time > 1.0_wp, name // ": not within the step")
   end subroutine exercise

   !> The first of two clocks to reach its reading ends the step, and the other advances until then.
   subroutine the_first_ends_the_step(series, slope, name)
      !> Coefficients of the velocity in a step of length 1
      real(wp), intent(in) :: series(0:)
      !> Change of the exponent of the first clock with the displacement; minus that of the second
      real(wp), intent(in) :: slope
      character(len=*), intent(in) :: name

      type(hazard_clock_type) :: clock(clocks)
      real(wp) :: step
      logical :: is_ended

      clock%is_used = .true.
      clock%slope = [slope, -slope]
      clock%rate = [1.0_wp, 5.0_wp]
      clock(1)%left = simpson(slope, series, 0.6_wp)
      clock(2)%left = 5.0_wp * simpson(-slope, series, 0.4_wp)
      step = 1.0_wp
      call advance_clocks(clock, series, size(series), step, is_ended)
      call check(is_ended .and. clock(2)%is_due .and. .not. clock(1)%is_due, &
         & name // ": the second is due")
      call check_close(step, 0.4_wp, 1.0e-13_wp, name // ": when it is due")
      call check_close(clock(1)%elapsed, simpson(slope, series, 0.4_wp), 1.0e-13_wp, &
         & name // ": reading of the other")
      clock%is_due = .false.
      clock%left = 1.0e3_wp
      step = 0.5_wp
      call advance_clocks(clock, series, size(series), step, is_ended)
      call check(.not. is_ended, name // ": none is due")
      call check_close(clock(2)%elapsed, 5.0_wp * simpson(-slope, series, 0.5_wp), 1.0e-13_wp, &
         & name // ": reading of the second")
   end subroutine the_first_ends_the_step

   !> Integral of exp(slope D(t)) by a fine rule.
   pure function simpson(slope, series, time) result(integral)
      real(wp), intent(in) :: slope, series(0:), time
      real(wp) :: integral

      integer, parameter :: intervals = 20000
      integer :: node, term
      real(wp) :: now, path, weight

      integral = 0.0_wp
      do node = 0, intervals
         now = time * node / intervals
         path = 0.0_wp
         do term = ubound(series, 1), 0, -1
            path = (path + series(term) / (term + 1)) * now
         end do
         weight = merge(4.0_wp, 2.0_wp, mod(node, 2) == 1)
         if (node == 0 .or. node == intervals) weight = 1.0_wp
         integral = integral + weight * exp(slope * path)
      end do
      integral = integral * time / (3.0_wp * intervals)
   end function simpson

end program test_hazard_clock
