!> Clocks of thermally activated breaking: when they come to a reading during a motion.
!>
!> The reading is the integral of exp(slope X) over the motion, which is known as a series of the
!> velocity. It is a Gauss rule over parts of a step so short that the rule is exact to rounding;
!> the time of a reading is found by Halley's method. In most steps between two events the exponent
!> changes so little that the reading is a polynomial of the time.
module mesoslip_sliders_hazard_clock
   use mesoslip_interface_law, only: clocks, hazard_clock_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_motion_series, only: horner, inverse, max_terms
   implicit none
   private

   public :: advance_clocks, time_to_reading, reading_after

   !> Maximum change of the exponent in a part of a step, in which the rule is exact to rounding
   real(wp), parameter :: max_change = 0.5_wp
   !> Relative change of a time after which one more step changes nothing: convergence is cubic
   real(wp), parameter :: converged = 1.0e-6_wp
   integer, parameter :: max_iterations = 60
   !> A step is short if the terms of the exponent, from the first to the fourth, change it by no
   !> more than this, and others by nothing: what a series of the sixth order leaves out of its
   !> exponential function is below 1e-15 of it
   integer, parameter :: short_terms = 4, short_order = 6
   real(wp), parameter :: max_short(short_terms) = [2.0e-2_wp, 1.0e-5_wp, 1.0e-7_wp, 1.0e-9_wp]
   real(wp), parameter :: no_change = 1.0e-16_wp
   !> Bounds on the mean of the exponential function over a short step
   real(wp), parameter :: min_growth = 0.97_wp, max_growth = 1.03_wp

   !> Change of an exponent below which three terms of a series do
   real(wp), parameter :: small = 1.0e-4_wp

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

   !> Shorten a step to the first time at which a clock comes to its reading, and let clocks go on.
   pure subroutine advance_clocks(clock, series, terms, step, is_ended)
      !> The clocks
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> Coefficients of the velocity in the time
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Length of the step [s]
      real(wp), intent(inout) :: step
      !> Whether a clock ends the step
      logical, intent(out) :: is_ended

      integer :: number, ended_by
      logical :: is_short
      real(wp) :: time

      call try_short_step(clock, series, terms, step, ended_by, is_short)
      is_ended = ended_by > 0
      if (is_ended) clock(ended_by)%is_due = .true.
      if (is_short) return
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

   !> Time at which a clock comes to its reading; huge if it does not within a step.
   pure function time_to_reading(clock, series, terms, step) result(time)
      !> The clock
      type(hazard_clock_type), intent(in) :: clock
      !> Coefficients of the velocity in the time
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Length of the step [s]
      real(wp), intent(in) :: step
      !> The time from the start of the step [s]
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

   !> Integral of exp(slope D(t)) over a step, D being the displacement since its start.
   pure function reading_after(slope, series, terms, step) result(reading)
      !> Change of the exponent with the displacement [1/m]
      real(wp), intent(in) :: slope
      !> Coefficients of the velocity in the time
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Length of the step [s]
      real(wp), intent(in) :: step
      !> The integral [s]
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

   !> Try a short step: shorten it to the first time at which a clock comes to its reading, and let
   !> clocks go on.
   pure subroutine try_short_step(clock, series, terms, step, ended_by, is_short)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      real(wp), intent(inout) :: step
      !> The clock that ends the step, or 0
      integer, intent(out) :: ended_by
      !> Whether the step is short; if not, nothing has changed
      logical, intent(out) :: is_short

      real(wp) :: change, length, part, time
      real(wp) :: exponent(short_terms), growth(0:short_order, clocks)
      integer :: term, number

      ended_by = 0
      is_short = .true.
      exponent = 0.0_wp
      ! Both clocks have one slope but for its sign.
      length = clock(1)%slope
      do term = 1, min(terms, short_terms)
         length = length * step
         exponent(term) = series(term - 1) * inverse(term) * length
         if (.not. abs(exponent(term)) <= max_short(term)) is_short = .false.
      end do
      if (.not. is_short) return
      change = 0.0_wp
      do term = terms, short_terms + 1, -1
         change = (change + abs(series(term - 1)) * inverse(term)) * step
      end do
      is_short = change * abs(length) <= no_change
      if (.not. is_short) return

      length = step
      time = 1.0_wp
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         growth(:, number) = expand_growth(sign(1.0_wp, clock(number)%slope * clock(1)%slope) &
            & * exponent)
         part = short_time(growth(:, number), clock(number)%left, clock(number)%rate * length, time)
         if (part > time) cycle
         time = part
         ended_by = number
      end do
      do number = 1, clocks
         if (clock(number)%is_used) clock(number)%elapsed = clock(number)%rate * length &
            & * short_integral(growth(:, number), time)
      end do
      if (ended_by > 0) step = time * length
   end subroutine try_short_step

   !> Coefficients of the exponential function, from those of the exponent: of g = exp(e), n g_n is
   !> the sum over j of j e_j g_(n-j).
   pure function expand_growth(e) result(g)
      real(wp), intent(in) :: e(short_terms)
      real(wp) :: g(0:short_order)

      real(wp) :: e_2, e_3, e_4

      e_2 = 2.0_wp * e(2)
      e_3 = 3.0_wp * e(3)
      e_4 = 4.0_wp * e(4)
      g(0) = 1.0_wp
      g(1) = e(1)
      g(2) = inverse(2) * (e(1) * g(1) + e_2)
      g(3) = inverse(3) * (e(1) * g(2) + e_2 * g(1) + e_3)
      g(4) = inverse(4) * ((e(1) * g(3) + e_2 * g(2)) + (e_3 * g(1) + e_4))
      g(5) = inverse(5) * ((e(1) * g(4) + e_2 * g(3)) + (e_3 * g(2) + e_4 * g(1)))
      g(6) = inverse(6) * ((e(1) * g(5) + e_2 * g(4)) + (e_3 * g(3) + e_4 * g(2)))
   end function expand_growth

   !> Integral of the exponential function over a part of a short step, in units of the step.
   pure function short_integral(growth, time) result(integral)
      !> Its coefficients
      real(wp), intent(in) :: growth(0:short_order)
      real(wp), intent(in) :: time
      real(wp) :: integral

      associate (g => growth)
         integral = time * (g(0) + time * (inverse(2) * g(1) + time * (inverse(3) * g(2) &
            & + time * (inverse(4) * g(3) + time * (inverse(5) * g(4) + time * (inverse(6) * g(5) &
            & + time * inverse(7) * g(6)))))))
      end associate
   end function short_integral

   !> Time at which a clock comes to its reading in a short step, in units of the step; huge if it
   !> is later than a time.
   pure function short_time(growth, left, whole, latest) result(time)
      real(wp), intent(in) :: growth(0:short_order)
      !> What is left, and what the clock would go on by in the step at its first rate
      real(wp), intent(in) :: left, whole
      real(wp), intent(in) :: latest
      real(wp) :: time

      real(wp) :: wanted, change, pace
      integer :: iteration

      time = huge(1.0_wp)
      if (left > max_growth * latest * whole) return
      wanted = left / whole
      if (wanted > min_growth * latest) then
         if (wanted > short_integral(growth, latest)) return
      end if
      pace = growth(1) * wanted
      time = wanted * (1.0_wp - pace * (0.5_wp - inverse(3) * pace))
      do iteration = 1, max_iterations
         associate (g => growth)
            change = (short_integral(g, time) - wanted) / (g(0) + time * (g(1) + time * (g(2) &
               & + time * (g(3) + time * g(4)))))
         end associate
         time = time - change
         ! Newton's method squares the error; the slope is right to 1e-9.
         if (abs(change) <= converged * time) exit
      end do
      time = min(time, latest)
   end function short_time

   !> Parts of a step in each of which the exponent changes so little that a rule is exact.
   pure function parts_of(exponent, step) result(parts)
      type(exponent_type), intent(in) :: exponent
      real(wp), intent(in) :: step
      integer :: parts

      parts = max(1, ceiling(max_change_until(exponent, step) / max_change))
   end function parts_of

   !> Bound on the change of the exponent until a time.
   pure function max_change_until(exponent, time) result(change)
      type(exponent_type), intent(in) :: exponent
      real(wp), intent(in) :: time
      real(wp) :: change

      integer :: term

      change = 0.0_wp
      do term = exponent%terms - 1, 0, -1
         change = change * time + abs(exponent%mean(term))
      end do
      change = change * time
   end function max_change_until

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

   !> Time within a part of a step at which an integral is reached, in a bracket.
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
         time = wanted * (1.0_wp - y * (0.5_wp - y * (inverse(3) - y * (0.25_wp - 0.2_wp * y))))
      else if (above > 0.5_wp * huge(1.0_wp)) then
         time = (log(growth) + log(wanted)) / growth
      else if (above > 0.0_wp) then
         ! W. Kahan: the error of the sum is that of its difference from 1 as well.
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
         return
      end if
      half = 0.5_wp * z
      mean = exp(half)
      if (abs(half) < small) then
         mean = mean * (1.0_wp + half**2 / 6.0_wp)
      else
         mean = mean * sinh(half) / half
      end if
   end function mean_growth

end module mesoslip_sliders_hazard_clock
