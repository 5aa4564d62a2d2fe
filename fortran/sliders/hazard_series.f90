!> Clocks of thermally activated breaking in steps in which their rates are series in the time.
!>
!> The exponent of a rate is a polynomial of the time. Where it changes little in a step its
!> exponential function is a short series, and the time of a reading the reversion of its integral
!> and a step or two of Newton's method.
module mesoslip_sliders_hazard_series
   use mesoslip_interface_law, only: clocks, hazard_clock_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_motion_series, only: horner, inverse, max_terms
   implicit none
   private

   public :: try_series

   !> Relative change of a time after which one more step changes nothing
   real(wp), parameter :: converged = 1.0e-6_wp
   integer, parameter :: max_iterations = 60
   !> A step is short if the terms of the exponent, from the first to the fourth, change it by no
   !> more than this, and others by nothing: what a series of the sixth order leaves out of its
   !> exponential function is below 1e-15 of it
   integer, parameter :: short_terms = 4, short_order = 6
   real(wp), parameter :: max_short(short_terms) = [2.0e-2_wp, 1.0e-5_wp, 1.0e-7_wp, 1.0e-9_wp]
   !> A middling step has a longer series, the last coefficients of which say whether it is exact
   integer, parameter :: series_order = 14, tail = 3
   real(wp), parameter :: max_middling = 0.3_wp
   !> Bound on the mean of the exponential function over such a step, and one over it
   real(wp), parameter :: max_growth = 1.35_wp
   real(wp), parameter :: no_change = 1.0e-16_wp
   !> Highest order of the exponent that changes the exponential function of a middling step
   integer, parameter :: middling_terms = 12

contains

   !> Try a step in which the exponential function is a series: shorten it to the first time at
   !> which a clock comes to its reading, and let clocks go on.
   pure subroutine try_series(clock, series, terms, step, ended_by, is_done)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      real(wp), intent(inout) :: step
      !> The clock that ends the step, or 0
      integer, intent(out) :: ended_by
      !> Whether there is such a series; if not, nothing has changed
      logical, intent(out) :: is_done

      real(wp) :: change, length, exponent(max_terms), short(short_terms)
      integer :: term
      logical :: is_short

      ended_by = 0
      ! Both clocks have one slope but for its sign.
      length = clock(1)%slope
      short = 0.0_wp
      is_short = .true.
      do term = 1, min(terms, short_terms)
         length = length * step
         short(term) = series(term - 1) * inverse(term) * length
         is_short = is_short .and. abs(short(term)) <= max_short(term)
      end do
      if (is_short) then
         change = 0.0_wp
         do term = terms, short_terms + 1, -1
            change = (change + abs(series(term - 1)) * inverse(term)) * step
         end do
         is_short = change * abs(length) <= no_change
      end if
      if (is_short) then
         call go_short(clock, short, step, ended_by)
         is_done = .true.
         return
      end if

      length = clock(1)%slope
      change = 0.0_wp
      do term = 1, terms
         length = length * step
         exponent(term) = series(term - 1) * inverse(term) * length
         change = change + abs(exponent(term))
      end do
      is_done = change <= max_middling
      if (is_done) call go_middling(clock, exponent, min(terms, middling_terms), step, ended_by, &
         & is_done)
   end subroutine try_series

   !> Make a short step.
   pure subroutine go_short(clock, exponent, step, ended_by)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> The exponent of the first clock, over a step of length 1
      real(wp), intent(in) :: exponent(short_terms)
      real(wp), intent(inout) :: step
      integer, intent(out) :: ended_by

      real(wp) :: time, part, mean(0:short_order, clocks)
      integer :: number

      ended_by = 0
      time = 1.0_wp
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         mean(:, number) = short_means(sign(1.0_wp, clock(number)%slope * clock(1)%slope) &
            & * exponent)
         part = time_of(mean(:, number), short_order, clock(number)%left, &
            & clock(number)%rate * step, time)
         if (part > time) cycle
         time = part
         ended_by = number
      end do
      do number = 1, clocks
         if (clock(number)%is_used .and. number /= ended_by) clock(number)%elapsed &
            & = clock(number)%rate * step * (time * horner(mean(:, number), short_order + 1, time))
      end do
      if (ended_by > 0) step = time * step
   end subroutine go_short

   !> Make a middling step, unless the series does not converge.
   pure subroutine go_middling(clock, exponent, terms, step, ended_by, is_done)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> The exponent of the first clock, over a step of length 1, and its terms
      real(wp), intent(in) :: exponent(:)
      integer, intent(in) :: terms
      real(wp), intent(inout) :: step
      integer, intent(out) :: ended_by
      !> Whether it was made; if not, nothing has changed
      logical, intent(out) :: is_done

      real(wp) :: time, part, mean(0:series_order, clocks)
      integer :: number

      ended_by = 0
      time = 1.0_wp
      do number = 1, clocks
         if (.not. clock(number)%is_used) cycle
         mean(:, number) = long_means(sign(1.0_wp, clock(number)%slope * clock(1)%slope) &
            & * exponent(:terms), terms)
         is_done = all(abs(mean(series_order - tail + 1:, number)) <= no_change)
         if (.not. is_done) then
            ended_by = 0
            return
         end if
         part = time_of(mean(:, number), series_order, clock(number)%left, &
            & clock(number)%rate * step, time)
         if (part > time) cycle
         time = part
         ended_by = number
      end do
      is_done = .true.
      do number = 1, clocks
         if (clock(number)%is_used .and. number /= ended_by) clock(number)%elapsed &
            & = clock(number)%rate * step * (time * horner(mean(:, number), series_order + 1, time))
      end do
      if (ended_by > 0) step = time * step
   end subroutine go_middling

   !> Coefficients of the mean of the exponential function since the start of a short step, side by
   !> side: exp(e_1 t) times the same of the other terms.
   pure function short_means(e) result(mean)
      !> The exponent, over a step of length 1
      real(wp), intent(in) :: e(short_terms)
      real(wp) :: mean(0:short_order)

      real(wp) :: a_2, a_3, p_4, p_5, p_6

      associate (a => e(1))
         a_2 = 0.5_wp * a**2
         a_3 = inverse(3) * a * a_2
         p_4 = e(4) + 0.5_wp * e(2)**2
         p_5 = e(2) * e(3)
         p_6 = e(2) * e(4) + 0.5_wp * e(3)**2
         mean(0) = 1.0_wp
         mean(1) = inverse(2) * a
         mean(2) = inverse(3) * (a_2 + e(2))
         mean(3) = inverse(4) * (a_3 + (a * e(2) + e(3)))
         mean(4) = inverse(5) * (inverse(6) * a_2**2 + (a_2 * e(2) + (a * e(3) + p_4)))
         mean(5) = inverse(6) * ((0.1_wp * a_2 * a_3 + a_3 * e(2)) + (a_2 * e(3) + (a * p_4 + p_5)))
         mean(6) = inverse(7) * ((0.05_wp * a_3**2 + inverse(6) * a_2**2 * e(2)) &
            & + (a_3 * e(3) + (a_2 * p_4 + (a * p_5 + p_6))))
      end associate
   end function short_means

   !> The same of a middling step: of g = exp(e), n g_n is the sum over j of j e_j g_(n-j).
   pure function long_means(e, terms) result(mean)
      !> The exponent, over a step of length 1
      real(wp), intent(in) :: e(:)
      !> Its terms
      integer, intent(in) :: terms
      real(wp) :: mean(0:series_order)

      real(wp) :: g(0:series_order), slope(middling_terms), rest
      integer :: n, term

      do term = 1, terms
         slope(term) = term * e(term)
      end do
      g(0) = 1.0_wp
      mean(0) = 1.0_wp
      do n = 1, series_order
         ! The last one comes last, as the others do not wait for it.
         rest = 0.0_wp
         do term = min(n, terms), 2, -1
            rest = rest + slope(term) * g(n - term)
         end do
         g(n) = inverse(n) * (rest + slope(1) * g(n - 1))
         mean(n) = inverse(n + 1) * g(n)
      end do
   end function long_means

   !> Time at which a clock comes to its reading, in units of the step; huge if it is later than a
   !> time.
   pure function time_of(mean, order, left, whole, latest) result(time)
      !> Coefficients of the mean of the exponential function
      real(wp), intent(in) :: mean(0:)
      !> The last of them
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
