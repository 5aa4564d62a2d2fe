!> Motions as power series of the velocity in time: values, displacements, ends of steps.
!>
!> The number of terms is a constant in most calls, so that link-time optimization makes copies for
!> the numbers of terms in use: a quarter of the time of an event depends on it.
module mesoslip_sliders_motion_series
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: max_terms, inverse, rounding, long_time
   public :: point_6, weight_6
   public :: first_end, horner, slope, integral, second_integral, lever

   !> Maximum number of terms
   integer, parameter :: max_terms = 28
   !> Reciprocals of the natural numbers
   integer :: i
   real(wp), parameter :: inverse(max_terms + 2) = [(1.0_wp / i, i=1, max_terms + 2)]
   !> Forces whose relative difference is smaller are equal up to rounding
   real(wp), parameter :: rounding = 16.0_wp * epsilon(1.0_wp)
   !> Duration of a step, in radians of an oscillation, from which an oscillation below the
   !> resolution of the contact force is ignored
   real(wp), parameter :: long_time = 2.0_wp
   !> Gauss-Legendre points and weights on [0, 1]
   real(wp), parameter :: point_6(6) = [0.033765242898423986094_wp, 0.16939530676686774317_wp, &
      & 0.38069040695840154568_wp, 0.61930959304159845432_wp, 0.83060469323313225683_wp, &
      & 0.96623475710157601391_wp]
   real(wp), parameter :: weight_6(6) = [0.085662246189585172520_wp, 0.18038078652406930378_wp, &
      & 0.23395696728634552369_wp, 0.23395696728634552369_wp, 0.18038078652406930378_wp, &
      & 0.085662246189585172520_wp]

contains

   !> Shorten a step to the first time at which the motion leaves a window or turns round.
   subroutine first_end(series, terms, above, below, change, step, crosses, turns, direction)
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Displacements to the upper end of the window and to the lower one, which is not positive
      real(wp), intent(in) :: above, below
      !> Bound on the change of the velocity in the whole step
      real(wp), intent(in) :: change
      real(wp), intent(inout) :: step
      !> Whether it ends at an end of the window, or at a turning point
      logical, intent(out) :: crosses, turns
      !> Direction of the motion at first, +1 or -1
      real(wp), intent(out) :: direction

      real(wp) :: distance

      turns = .false.
      direction = sign(1.0_wp, series(0))
      if (abs(series(0)) <= change) call next_turn(series, terms, step, turns, direction)
      distance = merge(above, below, direction > 0.0_wp)
      crosses = direction * (integral(series, terms, step) - distance) >= 0.0_wp
      if (crosses) then
         step = crossing(series, terms, distance, step)
         turns = .false.
      end if
   end subroutine first_end

   !> Shorten a step until the motion in it has one direction, to a turning point if there is one.
   subroutine next_turn(series, terms, step, turns, direction)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      real(wp), intent(inout) :: step
      !> Whether the step ends at a turning point
      logical, intent(out) :: turns
      !> Direction of the motion, +1 or -1
      real(wp), intent(out) :: direction

      integer, parameter :: max_halvings = 100
      real(wp) :: rate(0:max_terms - 1), end_velocity
      integer :: halving, term

      turns = .false.
      direction = sign(1.0_wp, series(0))
      do term = 0, terms - 2
         rate(term) = (term + 1) * series(term + 1)
      end do
      do halving = 1, max_halvings
         if (leads(series, terms, step)) exit
         if (leads(rate, terms - 1, step)) then
            ! The acceleration keeps its sign, so there is at most one turning point.
            end_velocity = horner(series, terms, step)
            if (series(0) * end_velocity < 0.0_wp) then
               step = turning_point(series, rate, terms, step)
               turns = .true.
            else
               direction = sign(1.0_wp, series(0) + end_velocity)
            end if
            exit
         end if
         if (abs(series(0)) + abs(series(1)) <= 0.0_wp) then
            ! At rest and in balance the jerk decides.
            direction = sign(1.0_wp, series(2))
            if (leads(rate(1:), terms - 2, step)) exit
         end if
         step = 0.5_wp * step
      end do
   end subroutine next_turn

   !> Whether a series keeps the sign of its constant term, by the size of the terms after it.
   pure function leads(series, terms, time)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      logical :: leads

      real(wp) :: rest
      integer :: term

      rest = 0.0_wp
      do term = terms - 1, 1, -1
         rest = (rest + abs(series(term))) * time
      end do
      leads = abs(series(0)) > rest
   end function leads

   !> Time at which a motion in one direction reaches a displacement, by Halley's method in a
   !> bracket.
   pure function crossing(series, terms, distance, longest) result(time)
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: terms
      !> Displacement, which is reached at the longest time or before
      real(wp), intent(in) :: distance, longest
      real(wp) :: time

      integer, parameter :: max_iterations = 100
      real(wp), parameter :: converged = 1.0e-5_wp
      real(wp) :: lower, upper, excess, discriminant, velocity, change, next
      integer :: iteration

      lower = 0.0_wp
      upper = longest
      time = longest
      discriminant = series(0)**2 + 2.0_wp * series(1) * distance
      if (discriminant > 0.0_wp) then
         time = min(2.0_wp * distance / (series(0) + sign(sqrt(discriminant), distance)), longest)
      end if
      do iteration = 1, max_iterations
         excess = integral(series, terms, time) - distance
         velocity = horner(series, terms, time)
         if (excess * distance >= 0.0_wp) then
            upper = time
         else
            lower = time
         end if
         next = lower
         if (abs(excess) < abs(velocity) * longest) then
            change = excess / velocity
            next = time - change &
               & * (1.0_wp + change * (0.5_wp * series(1) + series(2) * time) / velocity)
         end if
         if (next > lower .and. next < upper) then
            change = next - time
            time = next
            ! Convergence is cubic: the next change would be below rounding.
            if (abs(change) <= converged * next) exit
         else
            if (upper - lower <= spacing(upper) .or. abs(excess) <= 0.0_wp) exit
            time = 0.5_wp * (lower + upper)
         end if
      end do
   end function crossing

   !> Time at which the velocity of a motion with one turning point is zero, by Newton's method in a
   !> bracket.
   pure function turning_point(series, rate, terms, longest) result(time)
      !> Coefficients of the velocity and the acceleration
      real(wp), intent(in) :: series(0:), rate(0:)
      integer, intent(in) :: terms
      !> Time after the turning point
      real(wp), intent(in) :: longest
      real(wp) :: time

      integer, parameter :: max_iterations = 100
      real(wp) :: lower, upper, velocity, next
      integer :: iteration

      lower = 0.0_wp
      upper = longest
      time = 0.5_wp * longest
      do iteration = 1, max_iterations
         velocity = horner(series, terms, time)
         if (velocity * series(0) > 0.0_wp) then
            lower = time
         else
            upper = time
         end if
         next = time - velocity / horner(rate, terms - 1, time)
         if (.not. (next > lower .and. next < upper)) next = 0.5_wp * (lower + upper)
         if (abs(next - time) <= epsilon(1.0_wp) * longest) exit
         time = next
      end do
   end function turning_point

   !> Value of a series; even and odd terms apart, so that the two sums run side by side.
   pure function horner(series, terms, time) result(value)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp) :: value

      real(wp) :: even, odd, square
      integer :: term

      square = time**2
      even = 0.0_wp
      odd = 0.0_wp
      do term = 2 * ((terms - 1) / 2), 0, -2
         even = even * square + series(term)
      end do
      do term = 2 * (terms / 2) - 1, 1, -2
         odd = odd * square + series(term)
      end do
      value = even + time * odd
   end function horner

   !> Derivative of a series.
   pure function slope(series, terms, time)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp) :: slope

      integer :: term

      slope = 0.0_wp
      do term = terms - 1, 1, -1
         slope = slope * time + term * series(term)
      end do
   end function slope

   !> Integral of a series from zero.
   pure function integral(series, terms, time) result(value)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp) :: value

      integer :: term
      real(wp) :: once(0:max_terms - 1)

      do term = 0, terms - 1
         once(term) = series(term) * inverse(term + 1)
      end do
      value = time * horner(once, terms, time)
   end function integral

   !> Integral of the integral of a series from zero.
   pure function second_integral(series, terms, time) result(value)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp) :: value

      integer :: term
      real(wp) :: twice(0:max_terms - 1)

      do term = 0, terms - 1
         twice(term) = series(term) * (inverse(term + 1) * inverse(term + 2))
      end do
      value = time**2 * horner(twice, terms, time)
   end function second_integral

   !> Integral of the displacement, the integral of a series from zero, times the time.
   pure function lever(series, terms, time) result(value)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp) :: value

      integer :: term

      value = 0.0_wp
      do term = terms - 1, 0, -1
         value = value * time + series(term) * (inverse(term + 1) / (term + 3))
      end do
      value = value * time**3
   end function lever

end module mesoslip_sliders_motion_series
