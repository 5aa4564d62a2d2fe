!> Polynomials in time that are the motion of a block over a step.
module mesoslip_sliders_interface_polynomials
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_quadrature, only: gauss_legendre
   use mesoslip_sliders_motion_series, only: inverse
   implicit none
   private

   public :: max_order, min_points, max_points, rule_type, new_rules, points_for
   public :: bound, evaluate, evaluate_all, integrals, moments, move, reach_of

   !> Maximum order of the displacement
   integer, parameter :: max_order = 28
   !> Numbers of points of the rules for losses
   integer, parameter :: min_points = 3, max_points = 10
   !> Change of the phase of the fastest oscillation in a step, up to which the square of its
   !> velocity is integrated to rounding by a number of points
   real(wp), parameter :: max_phase(min_points:max_points) = [0.012_wp, 0.073_wp, 0.22_wp, &
      & 0.48_wp, 0.85_wp, 1.33_wp, 1.9_wp, 2.5_wp]

   !> A rule of Gauss and Legendre on [0, 1].
   type :: rule_type
      real(wp) :: point(max_points) = 0.0_wp, weight(max_points) = 0.0_wp
   end type rule_type

contains

   !> Set up the rules.
   subroutine new_rules(rule)
      type(rule_type), intent(out) :: rule(min_points:max_points)

      integer :: points

      do points = min_points, max_points
         call gauss_legendre(rule(points)%point(:points), rule(points)%weight(:points))
      end do
   end subroutine new_rules

   !> Number of points of the rule for a step.
   pure function points_for(phase) result(points)
      !> Duration of the step times the fastest rate
      real(wp), intent(in) :: phase
      integer :: points

      do points = min_points, max_points - 1
         if (phase <= max_phase(points)) return
      end do
   end function points_for

   !> Step, in units of one over the fastest rate, up to which an order is exact to rounding.
   pure function reach_of(order) result(reach)
      integer, intent(in) :: order
      real(wp) :: reach

      reach = exp((log(1.0e-17_wp) + log_gamma(order + 1.0_wp)) / order)
   end function reach_of

   !> Value, first and half the second derivative.
   pure subroutine evaluate(series, order, time, value, slope, bend)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: order
      real(wp), intent(in) :: time
      real(wp), intent(out) :: value, slope, bend

      integer :: term

      value = 0.0_wp
      slope = 0.0_wp
      bend = 0.0_wp
      do term = order, 0, -1
         bend = bend * time + slope
         slope = slope * time + value
         value = value * time + series(term)
      end do
   end subroutine evaluate

   !> The same, with the third and fourth derivatives.
   pure subroutine evaluate_all(series, order, time, value, slope, bend, jerk, snap)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: order
      real(wp), intent(in) :: time
      real(wp), intent(out) :: value, slope, bend, jerk, snap

      integer :: term

      value = 0.0_wp
      slope = 0.0_wp
      bend = 0.0_wp
      jerk = 0.0_wp
      snap = 0.0_wp
      do term = order, 0, -1
         snap = snap * time + jerk
         jerk = jerk * time + bend
         bend = bend * time + slope
         slope = slope * time + value
         value = value * time + series(term)
      end do
      jerk = 6.0_wp * jerk
      snap = 24.0_wp * snap
   end subroutine evaluate_all

   !> Value, and the one-, two- and threefold integrals from zero.
   pure subroutine moments(series, order, time, values)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: order
      real(wp), intent(in) :: time
      real(wp), intent(out) :: values(0:3)

      real(wp) :: part
      integer :: term

      values = 0.0_wp
      do term = order, 0, -1
         part = series(term)
         values(0) = values(0) * time + part
         part = part * inverse(term + 1)
         values(1) = values(1) * time + part
         part = part * inverse(term + 2)
         values(2) = values(2) * time + part
         values(3) = values(3) * time + part * (1.0_wp / (term + 3))
      end do
      values(1:) = values(1:) * [time, time**2, time**3]
   end subroutine moments

   !> Let a polynomial count from a later time; only its first terms are kept. By Horner's rule with
   !> polynomials as values: sums over terms side by side, unlike those of repeated division.
   pure subroutine move(series, order, time, kept)
      real(wp), intent(inout) :: series(0:)
      integer, intent(in) :: order
      real(wp), intent(in) :: time
      !> Order up to which the result is needed
      integer, intent(in) :: kept

      real(wp) :: moved(0:max_order)
      integer :: term, degree, power

      if (.not. abs(time) > 0.0_wp) return
      moved(0) = series(order)
      do term = order - 1, 0, -1
         degree = min(kept, order - term)
         if (degree == order - term) moved(degree) = 0.0_wp
         ! In vectors, each would wait for the overlapping ones that were just written.
         !GCC$ NOVECTOR
         do power = degree, 1, -1
            moved(power) = time * moved(power) + moved(power - 1)
         end do
         moved(0) = time * moved(0) + series(term)
      end do
      series(:kept) = moved(:kept)
   end subroutine move

   !> Integral from zero, and the integral of that.
   pure subroutine integrals(series, order, time, once, twice)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: order
      real(wp), intent(in) :: time
      real(wp), intent(out) :: once, twice

      real(wp) :: part
      integer :: term

      once = 0.0_wp
      twice = 0.0_wp
      do term = order, 0, -1
         part = series(term) * inverse(term + 1)
         once = once * time + part
         twice = twice * time + part * inverse(term + 2)
      end do
      once = once * time
      twice = twice * time**2
   end subroutine integrals

   !> Bound on the twofold integral of a polynomial up to a time, and on the integral.
   pure subroutine bound(series, order, time, once, twice)
      real(wp), intent(in) :: series(0:)
      integer, intent(in) :: order
      real(wp), intent(in) :: time
      real(wp), intent(out) :: once, twice

      call integrals(abs(series(0:order)), order, time, once, twice)
   end subroutine bound

end module mesoslip_sliders_interface_polynomials
