!> Clocks of thermally activated breaking in steps in which their rates are series in time.
!>
!> The exponent of a rate is a polynomial of time. In most steps it changes little: then the mean of
!> its exponential function follows from values and derivatives at both ends, and the time of a
!> reading from a step or two of Halley's method. Where it bends more the function is a series, and
!> where it changes more but nearly linearly that of the linear term, times a short series.
module mesoslip_sliders_hazard_series
   use mesoslip_interface_law, only: clocks, hazard_clock_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_motion_series, only: horner, inverse, max_terms, point_6, weight_6
   implicit none
   private

   public :: try_series

   !> Relative change of a time after which another iteration changes nothing, by methods of Newton
   !> and of Halley
   real(wp), parameter :: converged = 1.0e-6_wp, nearly = 1.0e-4_wp
   integer, parameter :: max_iterations = 60
   !> Maximum terms of the exponent in a step in which values and derivatives at both ends are exact
   !> to 2e-12, and of the sum of those beyond; weights of the first to third derivatives
   integer, parameter :: end_terms = 6
   real(wp), parameter :: max_end(end_terms) = [0.12_wp, 4.0e-3_wp, 1.0e-4_wp, 1.0e-6_wp, &
      & 1.0e-8_wp, 1.0e-9_wp], max_end_rest = 1.0e-12_wp
   real(wp), parameter :: weight_1 = 3.0_wp / 28.0_wp, weight_2 = 1.0_wp / 84.0_wp, &
      & weight_3 = 1.0_wp / 1680.0_wp
   !> A middling step has a longer series, whose last coefficients show whether it is exact
   integer, parameter :: low_order = 10, tail = 3
   real(wp), parameter :: max_low = 0.12_wp
   real(wp), parameter :: no_change = 1.0e-16_wp
   real(wp), parameter :: max_tail(tail) = no_change * [1.0e4_wp, 1.0e2_wp, 1.0_wp]
   !> Maximum terms of the exponent in a step in which a rule of six points is exact to 1e-15, and
   !> of the sum of those beyond
   integer, parameter :: smooth_terms = 6
   real(wp), parameter :: max_smooth(smooth_terms) = [0.12_wp, 6.0e-2_wp, 4.0e-3_wp, 3.0e-4_wp, &
      & 1.0e-5_wp, 1.0e-5_wp], max_rest = 1.0e-10_wp
   !> Bound on the mean of the exponential function over such a step, and one over it
   real(wp), parameter :: max_growth = 1.35_wp
   !> Order of the series beside a linear exponent, and maximum change of that
   integer, parameter :: bent_order = 12
   real(wp), parameter :: max_linear = 2.0_wp
   !> The same below which it hardly changes the first estimate of a time
   real(wp), parameter :: min_linear = 1.0e-3_wp
   !> Moment of that order over the exponential function at the end, in powers of minus the exponent
   integer, parameter :: moment_terms = 12
   integer :: i
   real(wp), parameter :: moment(0:moment_terms - 1) = [(gamma(bent_order + 1.0_wp) &
      & / gamma(bent_order + 2.0_wp + i), i=0, moment_terms - 1)]

   !> Mean of the exponential function of an exponent over a step: its parts even and odd in the
   !> exponent; the function at the end, and the derivative of the exponent there.
   type :: means_type
      real(wp) :: even, odd, growth = 0.0_wp, slope = 0.0_wp
   end type means_type

contains

   !> Try a step in which the exponential function is a series: shorten it to the first time at
   !> which a clock reaches its reading, and advance the clocks.
   pure subroutine try_series(clock, series, terms, step, ended_by, is_done)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      real(wp), intent(inout) :: step
      !> The clock that ends the step, or 0
      integer, intent(out) :: ended_by
      !> Whether there is such a series; if not, nothing has changed
      logical, intent(out) :: is_done

      real(wp) :: length, exponent(max_terms)
      integer :: term, first
      logical :: may_end

      ended_by = 0
      ! Both clocks have one slope but for its sign.
      length = clock(1)%slope
      first = 1
      if (terms >= end_terms) then
         ! Of constant length, for the compiler.
         do term = 1, end_terms
            length = length * step
            exponent(term) = series(term - 1) * inverse(term) * length
         end do
         first = end_terms + 1
      else
         exponent(terms + 1:end_terms) = 0.0_wp
      end if
      do term = first, terms
         length = length * step
         exponent(term) = series(term - 1) * inverse(term) * length
      end do
      ! Most steps end before any reading.
      may_end = any(clock%is_used .and. clock%left <= max_growth * (clock%rate * step))
      is_done = all(abs(exponent(:end_terms)) <= max_end)
      if (is_done .and. terms > end_terms) then
         is_done = sum(abs(exponent(end_terms + 1:terms))) <= max_end_rest
      end if
      if (is_done .and. may_end) then
         call advance_by_ends(clock, exponent(:end_terms), step, ended_by)
      else if (is_done) then
         call pass(clock, step, means_of(exponent(:end_terms)))
      end if
      if (is_done) return
      if (.not. may_end) then
         call pass_smooth(clock, exponent, terms, step, is_done)
         if (is_done) return
      end if
      exponent(terms + 1:bent_order) = 0.0_wp
      is_done = sum(abs(exponent(:terms))) <= max_low
      if (is_done) call advance_middling(clock, exponent, step, ended_by, is_done)
      if (is_done) return
      is_done = abs(exponent(1)) <= max_linear
      if (is_done) call advance_bent(clock, exponent, step, ended_by, is_done)
   end subroutine try_series

   !> Shorten a step to the first time at which a clock reaches its reading, and advance the clocks.
   pure subroutine advance_by_ends(clock, exponent, step, ended_by)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> The exponent of the first clock, over a step of length 1
      real(wp), intent(in) :: exponent(end_terms)
      real(wp), intent(inout) :: step
      !> The clock that ends the step, or 0
      integer, intent(out) :: ended_by

      real(wp) :: time, whole, direction
      type(means_type) :: means
      integer :: number

      ended_by = 0
      time = 1.0_wp
      means = means_of(exponent)
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         whole = clock(number)%rate * step
         if (clock(number)%left > max_growth * time * whole) cycle
         direction = sign(1.0_wp, clock(number)%slope * clock(1)%slope)
         if (clock(number)%left > whole * (time * (means%even + direction * means%odd))) cycle
         time = time_by_ends(direction * exponent, clock(number)%left / whole, time)
         means = means_of(exponent_until(exponent, time))
         ended_by = number
      end do
      call pass(clock, time * step, means)
      if (ended_by == 0) return
      clock(ended_by)%elapsed = 0.0_wp
      step = time * step
   end subroutine advance_by_ends

   !> Time at which the integral of the exponential function has a value, by Halley's method.
   pure function time_by_ends(exponent, wanted, latest) result(time)
      !> The exponent, over a step of length 1
      real(wp), intent(in) :: exponent(end_terms)
      !> The integral, and a time at which it is not less
      real(wp), intent(in) :: wanted, latest
      real(wp) :: time

      real(wp) :: change
      type(means_type) :: means
      integer :: iteration

      time = 0.0_wp
      if (.not. wanted > 0.0_wp) return
      associate (b => 0.5_wp * exponent(1))
         time = wanted * (1.0_wp - wanted * (b - wanted * (2.0_wp * b**2 &
            & - inverse(3) * (2.0_wp * b**2 + exponent(2)))))
      end associate
      do iteration = 1, max_iterations
         means = means_of(exponent_until(exponent, time))
         change = (time * (means%even + means%odd) - wanted) / means%growth
         change = change / (1.0_wp - 0.5_wp * change * means%slope / time)
         time = time - change
         ! Convergence is cubic.
         if (abs(change) <= nearly * time) exit
      end do
      time = min(time, latest)
   end function time_by_ends

   !> The exponent of a part of a step, over a step of length 1.
   pure function exponent_until(exponent, time) result(part)
      real(wp), intent(in) :: exponent(end_terms)
      !> The part of the step
      real(wp), intent(in) :: time
      real(wp) :: part(end_terms)

      real(wp) :: power
      integer :: term

      power = 1.0_wp
      do term = 1, end_terms
         power = power * time
         part(term) = power * exponent(term)
      end do
   end function exponent_until


   !> Advance by a middling step, unless the series does not converge.
   pure subroutine advance_middling(clock, exponent, step, ended_by, is_done)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> The exponent of the first clock, over a step of length 1
      real(wp), intent(in) :: exponent(max_terms)
      real(wp), intent(inout) :: step
      !> The clock that ends the step, or 0
      integer, intent(out) :: ended_by
      !> Whether it converges; if not, nothing has changed
      logical, intent(out) :: is_done

      real(wp) :: time, part, mean(0:low_order, clocks)
      integer :: number

      ended_by = 0
      time = 1.0_wp
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         mean(:, number) = low_means(sign(1.0_wp, clock(number)%slope * clock(1)%slope) &
            & * exponent(:low_order))
         is_done = all(abs(mean(low_order - tail + 1:, number)) <= max_tail)
         if (.not. is_done) then
            ended_by = 0
            return
         end if
         part = time_of(mean(:, number), low_order, clock(number)%left, &
            & clock(number)%rate * step, time)
         if (part > time) cycle
         time = part
         ended_by = number
      end do
      is_done = .true.
      do number = 1, clocks
         if (clock(number)%is_used .and. number /= ended_by) clock(number)%elapsed &
            & = clock(number)%rate * step * (time * horner(mean(:, number), low_order + 1, time))
      end do
      if (ended_by > 0) step = time * step
   end subroutine advance_middling

   !> Advance by a step in which the exponent is nearly linear, unless it is not.
   pure subroutine advance_bent(clock, exponent, step, ended_by, is_done)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> The exponent of the first clock, over a step of length 1
      real(wp), intent(in) :: exponent(max_terms)
      real(wp), intent(inout) :: step
      !> The clock that ends the step, or 0
      integer, intent(out) :: ended_by
      !> Whether the series converges; if not, nothing has changed
      logical, intent(out) :: is_done

      real(wp) :: time, wanted, bent(0:bent_order, clocks), linear(clocks), reading(clocks)
      integer :: number

      ended_by = 0
      time = 1.0_wp
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         linear(number) = sign(1.0_wp, clock(number)%slope * clock(1)%slope)
         bent(:, number) = bent_series(linear(number) * exponent(:bent_order))
         linear(number) = linear(number) * exponent(1)
         is_done = all(abs(bent(bent_order - tail + 1:, number)) <= max_tail)
         if (.not. is_done) then
            ended_by = 0
            return
         end if
         reading(number) = bent_integral(linear(number), bent(:, number), time)
         if (clock(number)%left > reading(number) * clock(number)%rate * step) cycle
         wanted = clock(number)%left / (clock(number)%rate * step)
         time = bent_time(linear(number), bent(:, number), wanted, reading(number), time)
         ended_by = number
      end do
      is_done = .true.
      do number = 1, clocks
         if (.not. clock(number)%is_used .or. number == ended_by) cycle
         if (ended_by > 0) reading(number) = bent_integral(linear(number), bent(:, number), time)
         clock(number)%elapsed = clock(number)%rate * step * reading(number)
      end do
      if (ended_by > 0) step = time * step
   end subroutine advance_bent

   !> Exponential function of an exponent without its linear term, as a series.
   pure function bent_series(e) result(g)
      !> The exponent, over a step of length 1
      real(wp), intent(in) :: e(bent_order)
      real(wp) :: g(0:bent_order)

      real(wp) :: slope(bent_order)
      integer :: n, term

      slope = [(real(term, wp), term=1, bent_order)] * e
      g(:1) = [1.0_wp, 0.0_wp]
      do n = 2, bent_order
         g(n) = slope(n)
         do term = n - 2, 2, -1
            g(n) = g(n) + slope(term) * g(n - term)
         end do
         g(n) = inverse(n) * g(n)
      end do
   end function bent_series

   !> Integral of exp(linear t) times a series from 0 to a time.
   pure function bent_integral(linear, series, time) result(value)
      real(wp), intent(in) :: linear, series(0:bent_order), time
      real(wp) :: value

      real(wp) :: growth, last, change, term(0:bent_order)
      integer :: n

      ! Moments of t**n from the highest down, by parts.
      change = linear * time
      growth = exp(change)
      last = growth * horner(moment, moment_terms, -change)
      term(bent_order) = series(bent_order) * last
      do n = bent_order, 1, -1
         last = (growth - change * last) * inverse(n)
         term(n - 1) = series(n - 1) * last
      end do
      value = time * horner(term, bent_order + 1, time)
   end function bent_integral

   !> Time at which that integral has a value.
   pure function bent_time(linear, series, wanted, whole, latest) result(time)
      real(wp), intent(in) :: linear, series(0:bent_order)
      !> The value, and that at a time which is not before
      real(wp), intent(in) :: wanted, whole, latest
      real(wp) :: time

      real(wp) :: change, pace
      integer :: iteration

      ! As if the exponent were linear.
      time = latest * (wanted / whole)
      if (abs(linear * latest) > min_linear) time = log(1.0_wp + (exp(linear * latest) - 1.0_wp) &
         & * (wanted / whole)) / linear
      do iteration = 1, max_iterations
         pace = exp(linear * time) * horner(series, bent_order + 1, time)
         change = (bent_integral(linear, series, time) - wanted) / pace
         change = change / max(0.5_wp, 1.0_wp - (0.5_wp * linear + series(2) * time) * change)
         time = min(max(time - change, 0.0_wp), latest)
         ! Halley's method, but for higher terms of the bend: the error is nearly cubic.
         if (abs(change) <= converged * time) exit
      end do
   end function bent_time

   !> Advance clocks by the mean of the exponential function over a step.
   pure subroutine pass(clock, step, means)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      real(wp), intent(in) :: step
      type(means_type), intent(in) :: means

      integer :: number

      do number = 1, clocks
         if (clock(number)%is_used) clock(number)%elapsed = clock(number)%rate * step &
            & * (means%even + sign(1.0_wp, clock(number)%slope * clock(1)%slope) * means%odd)
      end do
   end subroutine pass

   !> Mean of the exponential function over a step from its values and three derivatives at both
   !> ends. The error is its eighth derivative over 25401600.
   pure function means_of(e) result(means)
      !> The exponent, over a step of length 1
      real(wp), intent(in) :: e(end_terms)
      type(means_type) :: means

      real(wp) :: total, bend, twist, square, even, odd, cosine, sine

      total = e(1) + (e(2) + (e(3) + (e(4) + (e(5) + e(6)))))
      means%slope = e(1) + (2.0_wp * e(2) + (3.0_wp * e(3) + (4.0_wp * e(4) &
         & + (5.0_wp * e(5) + 6.0_wp * e(6)))))
      bend = 2.0_wp * e(2) + (6.0_wp * e(3) + (12.0_wp * e(4) + (20.0_wp * e(5) + 30.0_wp * e(6))))
      twist = 6.0_wp * e(3) + (24.0_wp * e(4) + (60.0_wp * e(5) + 120.0_wp * e(6)))
      square = total**2
      cosine = 1.0_wp + square * (0.5_wp + square * ((1.0_wp / 24.0_wp) + square &
         & * ((1.0_wp / 720.0_wp) + square * (1.0_wp / 40320.0_wp))))
      sine = total * (1.0_wp + square * ((1.0_wp / 6.0_wp) + square * ((1.0_wp / 120.0_wp) &
         & + square * ((1.0_wp / 5040.0_wp) + square * (1.0_wp / 362880.0_wp)))))
      means%growth = cosine + sine
      associate (slope => means%slope)
         even = 0.5_wp + slope * (weight_2 * slope - (3.0_wp * weight_3) * bend)
         odd = weight_2 * bend - slope * (weight_1 + weight_3 * slope**2) - weight_3 * twist
      end associate
      means%even = 0.5_wp + e(1) * (weight_2 * e(1) + (6.0_wp * weight_3) * e(2)) &
         & + (cosine * even + sine * odd)
      means%odd = (2.0_wp * weight_2) * e(2) + e(1) * (weight_1 + weight_3 * e(1)**2) &
         & + (6.0_wp * weight_3) * e(3) + (cosine * odd + sine * even)
   end function means_of

   !> Advance by a step which no clock ends, unless the exponent changes too much.
   pure subroutine pass_smooth(clock, exponent, terms, step, is_done)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> The exponent of the first clock, over a step of length 1
      real(wp), intent(in) :: exponent(max_terms)
      integer, intent(in) :: terms
      real(wp), intent(in) :: step
      !> Whether it is advanced; if not, nothing has changed
      logical, intent(out) :: is_done

      real(wp), dimension(size(point_6)) :: value, square, even, odd
      integer :: term

      is_done = terms >= smooth_terms
      if (is_done) is_done = all(abs(exponent(:smooth_terms)) <= max_smooth) &
         & .and. sum(abs(exponent(smooth_terms + 1:terms))) <= max_rest
      if (.not. is_done) return
      value = 0.0_wp
      do term = terms, 1, -1
         value = (value + exponent(term)) * point_6
      end do
      square = value**2
      even = 1.0_wp + square * (0.5_wp + square * ((1.0_wp / 24.0_wp) + square &
         & * ((1.0_wp / 720.0_wp) + square * ((1.0_wp / 40320.0_wp) &
         & + square * (1.0_wp / 3628800.0_wp)))))
      odd = value * (1.0_wp + square * ((1.0_wp / 6.0_wp) + square * ((1.0_wp / 120.0_wp) &
         & + square * ((1.0_wp / 5040.0_wp) + square * (1.0_wp / 362880.0_wp)))))
      call pass(clock, step, means_type(even=sum(weight_6 * even), odd=sum(weight_6 * odd)))
   end subroutine pass_smooth

   !> The same of a middling step that changes the exponent little: of g = exp(e), n g_n is the sum
   !> over j of j e_j g_(n-j). The last factors come last, as the others do not wait for them.
   pure function low_means(e) result(mean)
      !> The exponent, over a step of length 1
      real(wp), intent(in) :: e(low_order)
      real(wp) :: mean(0:low_order)

      real(wp) :: s(low_order), g_1, g_2, g_3, g_4, g_5, g_6, g_7, g_8, g_9, g_10
      integer :: term

      s = [(real(term, wp), term=1, low_order)] * e
      g_1 = s(1)
      g_2 = inverse(2) * (s(2) + s(1) * g_1)
      g_3 = inverse(3) * ((s(3) + s(2) * g_1) + s(1) * g_2)
      g_4 = inverse(4) * ((s(4) + s(3) * g_1) + s(2) * g_2 + s(1) * g_3)
      g_5 = inverse(5) * ((s(5) + s(4) * g_1) + s(3) * g_2 + s(2) * g_3 + s(1) * g_4)
      g_6 = inverse(6) * ((s(6) + s(5) * g_1) + s(4) * g_2 + s(3) * g_3 + s(2) * g_4 + s(1) * g_5)
      g_7 = inverse(7) * ((s(7) + s(6) * g_1) + s(5) * g_2 + s(4) * g_3 + s(3) * g_4 + s(2) * g_5 &
         & + s(1) * g_6)
      g_8 = inverse(8) * ((s(8) + s(7) * g_1) + s(6) * g_2 + s(5) * g_3 + s(4) * g_4 + s(3) * g_5 &
         & + s(2) * g_6 + s(1) * g_7)
      g_9 = inverse(9) * ((s(9) + s(8) * g_1) + s(7) * g_2 + s(6) * g_3 + s(5) * g_4 + s(4) * g_5 &
         & + s(3) * g_6 + s(2) * g_7 + s(1) * g_8)
      g_10 = inverse(10) * ((s(10) + s(9) * g_1) + s(8) * g_2 + s(7) * g_3 + s(6) * g_4 &
         & + s(5) * g_5 + s(4) * g_6 + s(3) * g_7 + s(2) * g_8 + s(1) * g_9)
      mean = [1.0_wp, inverse(2) * g_1, inverse(3) * g_2, inverse(4) * g_3, inverse(5) * g_4, &
         & inverse(6) * g_5, inverse(7) * g_6, inverse(8) * g_7, inverse(9) * g_8, &
         & inverse(10) * g_9, inverse(11) * g_10]
   end function low_means

   !> Time at which a clock reaches its reading, in units of the step; huge if later than a bound.
   pure function time_of(mean, order, left, whole, latest) result(time)
      !> Coefficients of the mean of the exponential function, and their order
      real(wp), intent(in) :: mean(0:)
      integer, intent(in) :: order
      !> The remaining deviate, and the advance of the clock in the step at its first rate
      real(wp), intent(in) :: left, whole
      real(wp), intent(in) :: latest
      real(wp) :: time

      real(wp) :: wanted, change, slope
      integer :: iteration, n

      time = huge(1.0_wp)
      if (left > max_growth * latest * whole) return
      wanted = left / whole
      if (wanted > latest / max_growth) then
         if (wanted > latest * horner(mean, order + 1, latest)) return
      end if
      ! The reversion of the series, to the third order.
      associate (b => mean, w => wanted)
         time = w * (1.0_wp - w * (b(1) - w * ((2.0_wp * b(1)**2 - b(2)) - w * (b(1) &
            & * (5.0_wp * (b(1)**2 - b(2))) + b(3)))))
      end associate
      do iteration = 1, max_iterations
         slope = 0.0_wp
         do n = order, 0, -1
            slope = slope * time + (n + 1) * mean(n)
         end do
         change = (time * horner(mean, order + 1, time) - wanted) / slope
         time = time - change
         ! Newton's method squares the error.
         if (abs(change) <= converged * time) exit
      end do
      time = min(time, latest)
   end function time_of

end module mesoslip_sliders_hazard_series
