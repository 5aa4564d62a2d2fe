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

   !> Maximum changes of the exponent in a part of a step for the rules of 3, 4 and 6 points: their
   !> errors are 5e-7 z**6, 6e-10 z**8 and 2e-16 z**12.
   real(wp), parameter :: max_change_3 = 0.025_wp, max_change_4 = 0.13_wp, max_change = 1.0_wp
   !> Relative change of a time after which one more step changes nothing: convergence is cubic
   real(wp), parameter :: converged = 1.0e-6_wp
   integer, parameter :: max_iterations = 60
   !> A step is short if the terms of the exponent, from the first to the fifth, change it by no
   !> more than this, and others not at all: what a series of the eighth order leaves out of its
   !> exponential function is below 1e-14 of it
   integer, parameter :: short_terms = 5, short_order = 8
   real(wp), parameter :: max_short(short_terms) = [0.1_wp, 1.0e-4_wp, 1.0e-6_wp, 1.0e-8_wp, &
      & 1.0e-10_wp]
   real(wp), parameter :: no_change = 1.0e-16_wp
   !> Bounds on the integral over a short step, relative to its length
   real(wp), parameter :: min_growth = 0.9_wp, max_growth = 1.11_wp
   !> Change of an exponent below which three terms of a series do
   real(wp), parameter :: small = 1.0e-4_wp

   !> Gauss-Legendre points and weights on [0, 1]
   real(wp), parameter :: point_3(3) = [0.11270166537925831148_wp, 0.5_wp, &
      & 0.88729833462074168852_wp]
   real(wp), parameter :: weight_3(3) = [5.0_wp / 18.0_wp, 4.0_wp / 9.0_wp, 5.0_wp / 18.0_wp]
   real(wp), parameter :: point_4(4) = [0.069431844202973712388_wp, 0.33000947820757186760_wp, &
      & 0.66999052179242813240_wp, 0.93056815579702628761_wp]
   real(wp), parameter :: weight_4(4) = [0.17392742256872692869_wp, 0.32607257743127307131_wp, &
      & 0.32607257743127307131_wp, 0.17392742256872692869_wp]
   real(wp), parameter :: point_6(6) = [0.033765242898423986094_wp, 0.16939530676686774317_wp, &
      & 0.38069040695840154568_wp, 0.61930959304159845432_wp, 0.83060469323313225683_wp, &
      & 0.96623475710157601391_wp]
   real(wp), parameter :: weight_6(6) = [0.085662246189585172520_wp, 0.18038078652406930378_wp, &
      & 0.23395696728634552369_wp, 0.23395696728634552369_wp, 0.18038078652406930378_wp, &
      & 0.085662246189585172520_wp]

   !> The exponent of a clock during a step: time times a polynomial.
   type :: exponent_type
      integer :: terms
      !> Coefficients of the exponent over the time [1/s], and of its rate
      real(wp) :: mean(0:max_terms - 1), rate(0:max_terms - 1)
      !> Whether the step is short, and then coefficients of the exponential function
      logical :: is_short
      real(wp) :: growth(0:short_order)
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
      real(wp) :: time

      ended_by = 0
      do number = 1, clocks
         clock(number)%elapsed = 0.0_wp
         clock(number)%is_due = .false.
         if (.not. clock(number)%is_used) cycle
         time = time_to_reading(clock(number), series, terms, step)
         if (time <= step) then
            step = time
            ended_by = number
         end if
      end do
      do number = 1, clocks
         if (number == ended_by) then
            clock(number)%elapsed = clock(number)%left
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
      call expand_exponent(clock%slope, series, terms, step, exponent)
      if (exponent%is_short) then
         if (wanted <= step * max_growth) time = short_time(exponent, step, wanted)
         return
      end if
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
      call expand_exponent(slope, series, terms, step, exponent)
      if (exponent%is_short) then
         reading = short_integral(exponent%growth, step)
         return
      end if
      parts = parts_of(exponent, step)
      length = step / parts
      reading = 0.0_wp
      do number = 1, parts
         start = (number - 1) * length
         reading = reading + exp(start * horner(exponent%mean, terms, start)) &
            & * integral_from(exponent, start, length)
      end do
   end function reading_after

   !> The exponent during a step, and its exponential function if the step is short.
   pure subroutine expand_exponent(slope, series, terms, step, exponent)
      real(wp), intent(in) :: slope, series(0:), step
      integer, intent(in) :: terms
      type(exponent_type), intent(out) :: exponent

      integer :: term, order
      real(wp) :: change, power, part(short_terms)

      exponent%terms = terms
      do term = 0, terms - 1
         exponent%rate(term) = slope * series(term)
         exponent%mean(term) = exponent%rate(term) * inverse(term + 1)
      end do
      part = 0.0_wp
      change = 0.0_wp
      do term = terms, short_terms + 1, -1
         change = (change + abs(exponent%mean(term - 1))) * step
      end do
      power = 1.0_wp
      exponent%is_short = .true.
      do term = 1, min(terms, short_terms)
         power = power * step
         part(term) = exponent%rate(term - 1)
         if (abs(exponent%mean(term - 1)) * power > max_short(term)) exponent%is_short = .false.
      end do
      if (.not. change * power <= no_change) exponent%is_short = .false.
      if (.not. exponent%is_short) return
      ! Of g = exp(e): n g_n is the sum over j of j e_j g_(n-j).
      exponent%growth(0) = 1.0_wp
      do order = 1, short_order
         change = 0.0_wp
         do term = 1, min(order, short_terms)
            change = change + part(term) * exponent%growth(order - term)
         end do
         exponent%growth(order) = change * inverse(order)
      end do
   end subroutine expand_exponent

   !> Integral of the exponential function over a short step.
   pure function short_integral(growth, time) result(integral)
      !> Its coefficients
      real(wp), intent(in) :: growth(0:short_order)
      real(wp), intent(in) :: time
      real(wp) :: integral

      integer :: order

      integral = 0.0_wp
      do order = short_order, 0, -1
         integral = integral * time + growth(order) * inverse(order + 1)
      end do
      integral = integral * time
   end function short_integral

   !> Time at which an integral is reached in a short step; huge if it is not.
   pure function short_time(exponent, step, wanted) result(time)
      type(exponent_type), intent(in) :: exponent
      real(wp), intent(in) :: step, wanted
      real(wp) :: time

      real(wp) :: change, pace
      integer :: iteration

      time = huge(1.0_wp)
      if (wanted > step * min_growth) then
         if (wanted > short_integral(exponent%growth, step)) return
      end if
      pace = exponent%rate(0) * wanted
      time = wanted * (1.0_wp - pace * (0.5_wp - pace * (inverse(3) - 0.25_wp * pace)))
      do iteration = 1, max_iterations
         change = (short_integral(exponent%growth, time) - wanted) &
            & / horner(exponent%growth, short_order + 1, time)
         time = time - change * (1.0_wp + 0.5_wp * change * exponent%rate(0))
         if (abs(change) <= converged * time) exit
      end do
      time = min(time, step)
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

      real(wp) :: change

      change = max_change
      if (.not. start > 0.0_wp) change = max_change_until(exponent, length)
      if (change <= max_change_3) then
         integral = length * rule(exponent, start, length, point_3, weight_3)
      else if (change <= max_change_4) then
         integral = length * rule(exponent, start, length, point_4, weight_4)
      else
         integral = length * rule(exponent, start, length, point_6, weight_6)
      end if
   end function integral_from

   !> Mean of the exponential function over a part of a step, by a rule.
   pure function rule(exponent, start, length, point, weight) result(mean)
      type(exponent_type), intent(in) :: exponent
      real(wp), intent(in) :: start, length, point(:), weight(:)
      real(wp) :: mean

      real(wp) :: before, time
      integer :: node

      before = start * horner(exponent%mean, exponent%terms, start)
      mean = 0.0_wp
      do node = 1, size(point)
         time = start + point(node) * length
         mean = mean + weight(node) * exp(time * horner(exponent%mean, exponent%terms, time) &
            & - before)
      end do
   end function rule

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
