!> How the threshold of a contact changes with its age.
!>
!> A contact keeps the deviate with which it is born: its threshold at the age t [s] is
!> mean(t) + width(t) times the deviate (model section 9). The deviate is given by the configured
!> threshold, which is that of an old contact for the law `relax`, and that at birth for the law
!> `log`. At any age the threshold increases with it, so contacts of one age and force break in
!> the order of their configured thresholds.
!>
!> In the arguments below `configured` is the configured threshold of a contact and `mean` the mean
!> over all contacts, both in the unit of the result.
module mesoslip_ageing_law
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: ageing_law_type, ageing_relax, ageing_log, ageing_names, old

   !> Mean and width relax from those of the young to those of the old
   integer, parameter :: ageing_relax = 1
   !> They grow with the logarithm of the age
   integer, parameter :: ageing_log = 2
   !> Names of the ageing_ codes
   character(len=*), parameter :: ageing_names(2) = [character(len=5) :: "relax", "log"]

   !> Age over tau_a beyond which thresholds are constant: exp(-40) is below rounding
   real(wp), parameter :: old = 40.0_wp

   !> Time over that in which a threshold changes, up to which its growth is a series with a
   !> relative error below 1e-15
   real(wp), parameter :: max_ratio = 0.02_wp

   !> A law of ageing.
   type :: ageing_law_type
      !> One of the ageing_ codes
      integer :: kind = ageing_relax
      !> Time tau_a [s], and one over it [1/s]
      real(wp) :: time = 1.0_wp, inverse_time = 1.0_wp
      !> Age of the contacts at the start of a run [s]
      real(wp) :: initial_age = 0.0_wp
      !> Deficit at birth of the mean threshold, over that of the old, and of each deviation from it
      real(wp) :: mean_deficit = 0.0_wp, width_deficit = 0.0_wp
      !> Growth of the law `log` for each e-fold of the age
      real(wp) :: growth = 0.0_wp
   contains
      procedure, non_overridable :: evaluate, threshold, curvature, twist, is_cubic, grow, &
         & configured, deficit
      procedure, non_overridable :: falls, acts, is_constant, is_old, newborn_threshold
   end type ageing_law_type

contains

   !> Threshold at an age, not negative, and its rate of change [1/s].
   pure subroutine evaluate(self, configured, mean, age, threshold, rate)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: configured, mean, age
      real(wp), intent(out) :: threshold, rate

      real(wp) :: deficit

      if (self%kind == ageing_log) then
         threshold = configured * (1.0_wp + self%growth * log(1.0_wp + age / self%time))
         rate = configured * self%growth / (self%time + age)
      else if (age > old * self%time) then
         threshold = configured
         rate = 0.0_wp
      else
         deficit = self%deficit(configured, mean)
         if (age > 0.0_wp) deficit = deficit * exp(-age * self%inverse_time)
         threshold = configured - deficit
         rate = deficit * self%inverse_time
      end if
   end subroutine evaluate

   !> Second derivative of a threshold by the age [1/s2], given its rate at the age.
   elemental function curvature(self, rate, age)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: rate, age
      real(wp) :: curvature

      curvature = -rate * self%inverse_time
      if (self%kind == ageing_log) curvature = -rate / (self%time + age)
   end function curvature

   !> Third coefficient of the growth of a threshold as a power series in the time [1/s3], given the
   !> second one at an age.
   elemental function twist(self, bend, age)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: bend, age
      real(wp) :: twist

      twist = -(1.0_wp / 3.0_wp) * bend * self%inverse_time
      if (self%kind == ageing_log) twist = -(2.0_wp / 3.0_wp) * bend / (self%time + age)
   end function twist

   !> Whether these three coefficients are enough for a time [s] after an age, up to an error.
   elemental function is_cubic(self, rate, age, time, max_error)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: rate, age, time, max_error
      logical :: is_cubic

      ! The fourth one is smaller for the law `relax`, whose ages do not matter.
      if (self%kind == ageing_log) then
         is_cubic = abs(rate) * time * time**3 <= 4.0_wp * max_error * (self%time + age)**3
      else
         is_cubic = abs(rate) * time * time**3 <= 24.0_wp * max_error * self%time**3
      end if
   end function is_cubic

   !> Growth of a threshold in a time [s] after an age, given its rate then, and its rate later.
   elemental subroutine grow(self, rate, age, time, growth, later_rate)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: rate, age, time
      real(wp), intent(out) :: growth, later_rate

      real(wp) :: ratio, part, square

      if (self%kind == ageing_log) then
         ratio = time / (self%time + age)
         later_rate = rate / (1.0_wp + ratio)
         if (ratio < max_ratio) then
            ! The logarithm of 1 + x is 2 artanh(x/(2 + x)).
            part = ratio / (2.0_wp + ratio)
            square = part**2
            growth = 2.0_wp * rate * (self%time + age) * part * (1.0_wp &
               & + square * (1.0_wp / 3.0_wp + square * (0.2_wp + square * (1.0_wp / 7.0_wp))))
         else
            growth = rate * (self%time + age) * log(1.0_wp + ratio)
         end if
      else
         ratio = time * self%inverse_time
         if (ratio < max_ratio) then
            growth = rate * time * (1.0_wp - ratio * 0.5_wp * (1.0_wp - ratio &
               & * (1.0_wp / 3.0_wp) * (1.0_wp - ratio * 0.25_wp * (1.0_wp - ratio * 0.2_wp &
               & * (1.0_wp - ratio * (1.0_wp / 6.0_wp) * (1.0_wp - ratio * (1.0_wp / 7.0_wp)))))))
         else
            growth = rate * self%time * (1.0_wp - exp(-min(ratio, old)))
         end if
         later_rate = rate - growth * self%inverse_time
      end if
   end subroutine grow

   !> Deficit of the threshold of a contact at birth.
   elemental function deficit(self, configured, mean)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: configured, mean
      real(wp) :: deficit

      deficit = self%mean_deficit * mean + self%width_deficit * (configured - mean)
   end function deficit

   !> Threshold at an age, not negative.
   pure function threshold(self, configured, mean, age)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: configured, mean, age
      real(wp) :: threshold

      real(wp) :: rate

      call self%evaluate(configured, mean, age, threshold, rate)
   end function threshold

   !> Minimum of the threshold of a contact that attaches, now and when it is old.
   pure function newborn_threshold(self, configured, mean) result(threshold)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: configured, mean
      real(wp) :: threshold

      threshold = min(configured, self%threshold(configured, mean, 0.0_wp))
   end function newborn_threshold

   !> Configured threshold of the contacts that break at an age under a force, both over the mean.
   pure function configured(self, force, age)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: force, age
      real(wp) :: configured

      real(wp) :: remaining

      if (self%kind == ageing_log) then
         configured = force / (1.0_wp + self%growth * log(1.0_wp + age / self%time))
      else if (age > old * self%time) then
         configured = force
      else
         remaining = exp(-age / self%time)
         configured = (force + (self%mean_deficit - self%width_deficit) * remaining) &
            & / (1.0_wp - self%width_deficit * remaining)
      end if
   end function configured

   !> Whether the threshold falls with age: young thresholds are lower in the mean but often more
   !> scattered, so that the highest of them fall.
   pure function falls(self, configured, mean)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: configured, mean
      logical :: falls

      falls = self%deficit(configured, mean) < 0.0_wp
   end function falls

   !> Whether any threshold changes with age.
   pure function acts(self)
      class(ageing_law_type), intent(in) :: self
      logical :: acts

      acts = abs(self%growth) + abs(self%mean_deficit) + abs(self%width_deficit) > 0.0_wp
   end function acts

   !> Whether the threshold of a contact is the same at any age.
   pure function is_constant(self, configured, mean)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: configured, mean
      logical :: is_constant

      if (self%kind == ageing_log) then
         is_constant = .not. self%growth > 0.0_wp
      else
         is_constant = .not. abs(self%deficit(configured, mean)) > 0.0_wp
      end if
   end function is_constant

   !> Whether thresholds are constant from an age on.
   pure function is_old(self, age)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: age
      logical :: is_old

      is_old = self%kind == ageing_relax .and. age > old * self%time
   end function is_old

end module mesoslip_ageing_law
