!> Thermal activation of populations: how their levels increase while the slider moves.
!>
!> A contact under the force g breaks at the rate omega_0 exp((abs(g) - u)/theta), in units of f_s
!> with theta = f_T/f_s. The integral over the time is exp((e - u)/theta) with the level e of its
!> population. Populations whose forces have one sign share the integral of exp(x/theta) over the
!> motion x of the slider. All is relative to the start of the motion, so that exponents are only
!> differences of forces in a step.
module mesoslip_contacts_populations_activation
   use mesoslip_contacts_populations_motion, only: position_at
   use mesoslip_contacts_populations_survivors, only: no_level
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_quadrature, only: gauss_legendre
   implicit none
   private

   public :: activation_type, growth_type, new_activation

   !> Points of the rule over a motion
   integer, parameter :: points = 12
   !> Exponent of a negligible force
   real(wp), parameter :: tiny_exponent = 1.0e-6_wp

   !> Parameters of activation.
   type :: activation_type
      !> Rate of breaking at the threshold [1/s], and f_T/f_s
      real(wp) :: rate = 0.0_wp, width = 1.0_wp
      !> Displacement of a force f_s [m]
      real(wp), private :: stretch = 1.0_wp
      real(wp), private :: point(points) = 0.0_wp, weight(points) = 0.0_wp
   contains
      procedure, non_overridable :: growth, added, level_after, newborn_level
   end type activation_type

   !> Increase of the levels of populations in a motion of the slider, over its force at the start.
   type :: growth_type
      !> Under positive force, and under negative force
      real(wp), private :: level(2) = no_level
      !> Under no force, if the slider rested
      real(wp), private :: rest = no_level
      !> Mean time of the hazard over the duration, under positive and negative force
      real(wp), private :: time(2) = 0.5_wp
   contains
      procedure, non_overridable :: mean_time
   end type growth_type

contains

   !> Set up activation.
   pure function new_activation(rate, width, stretch) result(self)
      !> Rate of breaking at the threshold [1/s], f_T/f_s, and f_s/k [m]
      real(wp), intent(in) :: rate, width, stretch
      type(activation_type) :: self

      self%rate = rate
      self%width = width
      self%stretch = stretch
      call gauss_legendre(self%point, self%weight)
   end function new_activation

   !> Increase of levels in a motion.
   pure function growth(self, before, after)
      class(activation_type), intent(in) :: self
      type(pose_type), intent(in) :: before, after
      type(growth_type) :: growth

      real(wp) :: duration, exponent(points), hazard(points), position, max_exponent, sign
      integer :: node, one

      duration = after%time - before%time
      if (.not. self%rate * duration > 0.0_wp) return
      growth%rest = self%width * log(self%rate * duration)
      do node = 1, points
         position = position_at(before, after, before%time + self%point(node) * duration)
         exponent(node) = (position - before%displacement) / (self%stretch * self%width)
      end do
      sign = 1.0_wp
      do one = 1, 2
         max_exponent = maxval(sign * exponent)
         hazard = self%weight * exp(sign * exponent - max_exponent)
         growth%level(one) = growth%rest + self%width * (max_exponent + log(sum(hazard)))
         growth%time(one) = sum(hazard * self%point) / sum(hazard)
         sign = -1.0_wp
      end do
   end function growth

   !> Mean time of the hazard over the duration of a motion, given the forces before and after.
   elemental function mean_time(self, start_force, end_force) result(time)
      class(growth_type), intent(in) :: self
      real(wp), intent(in) :: start_force, end_force
      real(wp) :: time

      time = 0.5_wp
      if (start_force * end_force >= 0.0_wp) then
         time = self%time(merge(1, 2, start_force + end_force >= 0.0_wp))
      end if
   end function mean_time

   !> Increase of the level of a population in a motion, given the forces before and after.
   elemental function added(self, growth, start_force, end_force) result(more)
      class(activation_type), intent(in) :: self
      type(growth_type), intent(in) :: growth
      real(wp), intent(in) :: start_force, end_force
      real(wp) :: more

      real(wp) :: low, high

      if (.not. growth%rest > no_level) then
         more = no_level
      else if (start_force * end_force >= 0.0_wp) then
         more = abs(start_force) + growth%level(merge(1, 2, start_force + end_force >= 0.0_wp))
      else
         ! The force changes its sign, evenly in time.
         low = min(abs(start_force), abs(end_force)) / self%width
         high = max(abs(start_force), abs(end_force)) / self%width
         more = growth%rest + self%width * (high + log((1.0_wp + exp(low - high) &
            & - 2.0_wp * exp(-high)) / (low + high)))
         if (high < tiny_exponent) more = growth%rest
      end if
   end function added

   !> Level of a population after a motion, given the level before and the forces before and after.
   elemental function level_after(self, growth, level, start_force, end_force) result(after)
      class(activation_type), intent(in) :: self
      type(growth_type), intent(in) :: growth
      real(wp), intent(in) :: level, start_force, end_force
      real(wp) :: after

      real(wp) :: more

      after = level
      more = self%added(growth, start_force, end_force)
      if (.not. more > no_level) return
      after = more
      if (.not. level > no_level) return
      after = max(level, more) + self%width * log(1.0_wp + exp(-abs(level - more) / self%width))
   end function level_after

   !> Level of contacts a time [s] after they attached, under a force.
   elemental function newborn_level(self, duration, force) result(level)
      class(activation_type), intent(in) :: self
      real(wp), intent(in) :: duration, force
      real(wp) :: level

      level = no_level
      if (self%rate * duration > 0.0_wp) level = abs(force) + self%width * log(self%rate * duration)
   end function newborn_level

end module mesoslip_contacts_populations_activation
