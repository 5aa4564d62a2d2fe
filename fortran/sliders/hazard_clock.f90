!> Clocks of thermally activated breaking: the time in a motion at which one reaches a reading.
!>
!> The reading is the integral of exp(slope X) over the motion, which is a series of the velocity.
!> In most steps between two events the exponent changes so little, or so nearly linearly, that the
!> reading follows from a series in time, too. In others it is a Gauss rule over parts of a step so
!> short that the rule is exact to rounding, and the time of a reading is found by Halley's method.
module mesoslip_sliders_hazard_clock
   use mesoslip_interface_law, only: clocks, hazard_clock_type, window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_hazard_series, only: try_series
   use mesoslip_sliders_motion_series, only: horner, inverse, max_terms
   implicit none
   private

   public :: advance_clocks, limit_window, time_to_reading, reading_after

   !> Duration of a window over the time in which a clock is expected to reach its reading
   real(wp), parameter :: window_ratio = 1.25_wp
   !> Remaining reading over that of the window at its first rate, beyond which it is not expected;
   !> maximum duration of a window for that, against overflow [s]
   real(wp), parameter :: max_expected = 3.0_wp, max_rest = 1.0e100_wp

   !> Maximum change of the exponent in a part of a step, in which the rule is exact to rounding
   real(wp), parameter :: max_change = 0.5_wp
   !> Maximum change of the exponent in a step in which the clocks advance side by side
   real(wp), parameter :: max_passed = 100.0_wp
   !> Relative change of a time after which another iteration changes nothing: convergence is cubic
   real(wp), parameter :: converged = 1.0e-6_wp
   integer, parameter :: max_iterations = 60
   !> Change of an exponent below which eight terms of a series are enough
   real(wp), parameter :: small = 1.0e-2_wp

   integer :: i
   !> Coefficients of 1 - log(1 + y)/y and of (exp(z) - 1)/z - 1
   real(wp), parameter :: logarithm(0:8) = [0.0_wp, (-(-1.0_wp)**i / (i + 1), i=1, 8)]
   real(wp), parameter :: growth(0:7) = [0.0_wp, (1.0_wp / gamma(i + 2.0_wp), i=1, 7)]

   !> Gauss-Legendre points and weights on [0, 1]
   integer, parameter :: points = 10
   real(wp), parameter :: point(points) = [0.01304673574141413996_wp, 0.06746831665550774463_wp, &
      & 0.16029521585048779688_wp, &
      & 0.28330230293537640460_wp, 0.42556283050918439456_wp, 0.57443716949081560544_wp, &
      & 0.71669769706462359540_wp, 0.83970478414951220312_wp, 0.93253168334449225537_wp, &
      & 0.98695326425858586004_wp]
   real(wp), parameter :: weight(points) = [0.03333567215434406880_wp, 0.07472567457529029657_wp, &
      & 0.10954318125799102200_wp, &
      & 0.13463335965499817755_wp, 0.14776211235737643509_wp, 0.14776211235737643509_wp, &
      & 0.13463335965499817755_wp, 0.10954318125799102200_wp, 0.07472567457529029657_wp, &
      & 0.03333567215434406880_wp]

   !> The exponent of a clock during a step: time times a polynomial.
   type :: exponent_type
      integer :: terms
      !> Coefficients of the exponent over the time [1/s], and of its rate
      real(wp) :: mean(0:max_terms - 1), rate(0:max_terms - 1)
   end type exponent_type

contains

   !> End a window a little after the first clock is expected to reach its reading: a shorter step
   !> takes less time to compute.
   pure subroutine limit_window(clock, time, velocity, window)
      type(hazard_clock_type), intent(in) :: clock(clocks)
      !> Time [s] and velocity [m/s] of the slider
      real(wp), intent(in) :: time, velocity
      type(window_type), intent(inout) :: window

      real(wp) :: expected, rest
      integer :: number

      expected = huge(1.0_wp)
      rest = max_expected * min(window%end_time - time, max_rest)
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         if (clock(number)%left > rest * clock(number)%rate) cycle
         expected = min(expected, expected_time(clock(number)%slope * velocity, &
            & clock(number)%left / clock(number)%rate))
      end do
      if (expected < huge(1.0_wp)) window%end_time = min(window%end_time, &
         & time + max(window_ratio * expected, epsilon(time) * time, tiny(time)))
   end subroutine limit_window

   !> Time in which the integral of exp(growth t) has a value; huge if it never has.
   pure function expected_time(growth, wanted) result(time)
      !> Growth of the exponent [1/s], and the integral [s]
      real(wp), intent(in) :: growth, wanted
      real(wp) :: time

      real(wp) :: y

      y = growth * wanted
      time = wanted
      if (abs(y) < 0.1_wp) then
         time = wanted * (1.0_wp - y * (0.5_wp - y / 3.0_wp))
      else
         time = huge(1.0_wp)
         if (y > -1.0_wp) time = log(1.0_wp + y) / growth
      end if
   end function expected_time

   !> Shorten a step to the first time at which a clock reaches its reading, and advance the clocks.
   pure subroutine advance_clocks(clock, series, terms, step, is_ended)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Length of the step [s]
      real(wp), intent(inout) :: step
      !> Whether a clock ends the step
      logical, intent(out) :: is_ended

      integer :: number, ended_by
      logical :: is_done
      real(wp) :: time

      if (terms == 1) then
         call advance_uniformly(clock, series(0), step, ended_by)
         is_done = .true.
      else
         call try_series(clock, series, terms, step, ended_by, is_done)
      end if
      if (.not. is_done) call try_pass(clock, series, terms, step, is_done)
      is_ended = ended_by > 0
      if (is_ended) clock(ended_by)%is_due = .true.
      if (is_done) return
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         time = time_to_reading(clock(number), series, terms, step)
         if (time <= step) then
            step = time
            ended_by = number
         end if
      end do
      do number = 1, clocks
         if (number == ended_by) then
            clock(number)%is_due = .true.
         else if (clock(number)%is_used) then
            clock(number)%elapsed = clock(number)%rate &
               & * reading_after(clock(number)%slope, series, terms, step)
         end if
      end do
      is_ended = ended_by > 0
   end subroutine advance_clocks

   !> Advance the clocks in a step of any length, unless one may end it.
   pure subroutine try_pass(clock, series, terms, step, is_done)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Length of the step [s]
      real(wp), intent(in) :: step
      !> Whether they are advanced; if not, nothing has changed
      logical, intent(out) :: is_done

      type(exponent_type) :: exponent
      real(wp) :: change, growth, sums(clocks), length, now
      integer :: part, parts, node, number

      call expand_exponent(clock(1)%slope, series, terms, exponent)
      change = max_change_of(exponent, step)
      is_done = change < max_passed
      if (is_done) is_done = .not. any(clock%is_used &
         & .and. clock%left <= exp(change) * (clock%rate * step))
      if (.not. is_done) return
      parts = max(1, ceiling(change / max_change))
      length = step / parts
      sums = 0.0_wp
      do part = 1, parts
         do node = 1, points
            now = (part - 1 + point(node)) * length
            growth = exp(now * horner(exponent%mean, terms, now))
            ! Both clocks have one slope but for its sign.
            sums = sums + weight(node) * [growth, 1.0_wp / growth]
         end do
      end do
      do number = 1, clocks
         if (clock(number)%is_used) clock(number)%elapsed = clock(number)%rate * length &
            & * merge(sums(1), sums(2), clock(number)%slope * clock(1)%slope > 0.0_wp)
      end do
   end subroutine try_pass

   !> Time from the start of a step at which a clock reaches its reading [s]; huge if it does not.
   pure function time_to_reading(clock, series, terms, step) result(time)
      type(hazard_clock_type), intent(in) :: clock
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Length of the step [s]
      real(wp), intent(in) :: step
      real(wp) :: time

      type(exponent_type) :: exponent
      real(wp) :: wanted, start, length, factor, part
      integer :: parts, number

      time = 0.0_wp
      if (clock%left <= 0.0_wp) return
      time = huge(1.0_wp)
      if (.not. (clock%left < huge(1.0_wp) .and. clock%rate > 0.0_wp)) return
      wanted = clock%left / clock%rate
      if (terms == 1) then
         time = steady_time(clock%slope * series(0), wanted)
         return
      end if
      call expand_exponent(clock%slope, series, terms, exponent)
      parts = parts_of(exponent, step)
      length = step / parts
      do number = 1, parts
         start = (number - 1) * length
         factor = exp(start * horner(exponent%mean, terms, start))
         part = integral_from(exponent, start, length)
         if (factor * part >= wanted) then
            time = min(step, start + time_within(exponent, start, length, wanted / factor, part))
            return
         end if
         wanted = wanted - factor * part
      end do
   end function time_to_reading

   !> Integral of exp(slope D(t)) over a step [s], D being the displacement since its start.
   pure function reading_after(slope, series, terms, step) result(reading)
      !> Change of the exponent with the displacement [1/m]
      real(wp), intent(in) :: slope
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Length of the step [s]
      real(wp), intent(in) :: step
      real(wp) :: reading

      type(exponent_type) :: exponent
      real(wp) :: length, start
      integer :: parts, number

      if (terms == 1) then
         reading = step * mean_growth(slope * series(0) * step)
         return
      end if
      call expand_exponent(slope, series, terms, exponent)
      parts = parts_of(exponent, step)
      length = step / parts
      reading = 0.0_wp
      do number = 1, parts
         start = (number - 1) * length
         reading = reading + exp(start * horner(exponent%mean, terms, start)) &
            & * integral_from(exponent, start, length)
      end do
   end function reading_after

   !> The exponent during a step.
   pure subroutine expand_exponent(slope, series, terms, exponent)
      real(wp), intent(in) :: slope, series(0:)
      integer, intent(in) :: terms
      type(exponent_type), intent(out) :: exponent

      integer :: term

      exponent%terms = terms
      do term = 0, terms - 1
         exponent%rate(term) = slope * series(term)
         exponent%mean(term) = exponent%rate(term) * inverse(term + 1)
      end do
   end subroutine expand_exponent

   !> The same at a constant velocity.
   pure subroutine advance_uniformly(clock, velocity, step, ended_by)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      real(wp), intent(in) :: velocity
      real(wp), intent(inout) :: step
      !> The clock that ends the step, or 0
      integer, intent(out) :: ended_by

      real(wp) :: time
      integer :: number

      ended_by = 0
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         associate (one => clock(number))
            if (one%left > 0.0_wp) then
               if (.not. (one%left < huge(1.0_wp) .and. one%rate > 0.0_wp)) cycle
               time = steady_time(one%slope * velocity, one%left / one%rate)
            else
               time = 0.0_wp
            end if
            if (time > step) cycle
            step = time
            ended_by = number
         end associate
      end do
      do number = 1, clocks
         if (clock(number)%is_used .and. number /= ended_by) clock(number)%elapsed = step &
            & * clock(number)%rate * mean_growth(clock(number)%slope * velocity * step)
      end do
   end subroutine advance_uniformly

   !> Parts of a step in each of which the exponent changes so little that the rule is exact.
   pure function parts_of(exponent, step) result(parts)
      type(exponent_type), intent(in) :: exponent
      real(wp), intent(in) :: step
      integer :: parts

      parts = max(1, ceiling(max_change_of(exponent, step) / max_change))
   end function parts_of

   !> Bound on the change of the exponent in a step.
   pure function max_change_of(exponent, step) result(change)
      type(exponent_type), intent(in) :: exponent
      real(wp), intent(in) :: step
      real(wp) :: change

      integer :: term

      change = 0.0_wp
      do term = exponent%terms - 1, 0, -1
         change = (change + abs(exponent%mean(term))) * step
      end do
   end function max_change_of

   !> Integral of the exponential function over a part of a step, relative to its start.
   pure function integral_from(exponent, start, length) result(integral)
      type(exponent_type), intent(in) :: exponent
      !> Start and length of the part [s]
      real(wp), intent(in) :: start, length
      real(wp) :: integral

      real(wp) :: before, time
      integer :: node

      before = start * horner(exponent%mean, exponent%terms, start)
      integral = 0.0_wp
      do node = 1, points
         time = start + point(node) * length
         integral = integral + weight(node) * exp(time * horner(exponent%mean, exponent%terms, &
            & time) - before)
      end do
      integral = integral * length
   end function integral_from

   !> Time within a part of a step at which an integral is reached, by Halley's method in a bracket.
   pure function time_within(exponent, start, length, wanted, whole) result(time)
      type(exponent_type), intent(in) :: exponent
      !> Start and length of the part [s]
      real(wp), intent(in) :: start, length
      !> The integral that is wanted, and that over the whole part, which is not less [s]
      real(wp), intent(in) :: wanted, whole
      real(wp) :: time

      real(wp) :: lower, upper, change, before, pace, now
      integer :: iteration

      lower = 0.0_wp
      upper = length
      before = start * horner(exponent%mean, exponent%terms, start)
      time = steady_time(horner(exponent%rate, exponent%terms, start), wanted)
      if (.not. time < length) time = length * min(1.0_wp, wanted / whole)
      do iteration = 1, max_iterations
         change = integral_from(exponent, start, time) - wanted
         if (change > 0.0_wp) then
            upper = time
         else
            lower = time
         end if
         now = start + time
         change = change * exp(before - now * horner(exponent%mean, exponent%terms, now))
         pace = horner(exponent%rate, exponent%terms, now)
         change = change / max(0.5_wp, 1.0_wp - 0.5_wp * change * pace)
         if (time - change >= lower .and. time - change <= upper) then
            time = time - change
         else
            change = time - 0.5_wp * (lower + upper)
            time = time - change
         end if
         if (abs(change) <= converged * time) return
      end do
   end function time_within

   !> Time in which exp(growth t) has a given integral; huge if it never has.
   pure function steady_time(growth, wanted) result(time)
      !> Growth of the exponent [1/s], and the integral [s]
      real(wp), intent(in) :: growth, wanted
      real(wp) :: time

      real(wp) :: y, above

      y = growth * wanted
      above = 1.0_wp + y
      if (abs(y) < small) then
         time = wanted * (1.0_wp - horner(logarithm, size(logarithm), y))
      else if (above > 0.5_wp * huge(1.0_wp)) then
         time = (log(growth) + log(wanted)) / growth
      else if (above > 0.0_wp) then
         ! W. Kahan: the rounding of the sum cancels in the quotient.
         time = wanted * (log(above) / (above - 1.0_wp))
      else
         time = huge(1.0_wp)
      end if
   end function steady_time

   !> Mean of the exponential function over a change of its exponent, (exp(z) - 1)/z.
   pure function mean_growth(z) result(mean)
      real(wp), intent(in) :: z
      real(wp) :: mean

      real(wp) :: half

      if (abs(z) > 1.0_wp) then
         mean = (exp(z) - 1.0_wp) / z
      else if (abs(z) < small) then
         mean = 1.0_wp + horner(growth, size(growth), z)
      else
         half = 0.5_wp * z
         mean = exp(half) * sinh(half) / half
      end if
   end function mean_growth

end module mesoslip_sliders_hazard_clock
