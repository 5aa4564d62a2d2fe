!> How the threshold of a contact changes with its age.
!>
!> A contact is born with a deviate of the threshold law, and keeps it: its threshold at the age t
!> is mean(t) + width(t) times this deviate (model section 9). The deviate is given by the threshold
!> that is configured, the old one of the law `relax` and that at birth of the law `log`. Thresholds
!> grow with it at any age, so contacts of one age and force break in its order.
module mesoslip_contacts_ageing_law
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: ageing_law_type, take_ageing_law, ageing_relax, ageing_log, ageing_names, &
      & old

   !> Mean and width relax from those of the young to those of the old
   integer, parameter :: ageing_relax = 1
   !> They grow with the logarithm of the age
   integer, parameter :: ageing_log = 2
   !> Names of the ageing_ codes
   character(len=*), parameter :: ageing_names(2) = [character(len=5) :: "relax", "log"]

   !> Ages over tau_a beyond which nothing relaxes any more, as exp(-40) is below rounding.
   real(wp), parameter :: old = 40.0_wp

   !> Time over that in which a threshold changes, up to which its growth is that of a series: what
   !> that leaves out is below 1e-15 of it.
   real(wp), parameter :: max_ratio = 0.02_wp

   !> A law of ageing.
   type :: ageing_law_type
      !> One of the ageing_ codes
      integer :: kind = ageing_relax
      !> Time tau_a [s]
      real(wp) :: time = 1.0_wp
      !> One over it [1/s]
      real(wp) :: inverse_time = 1.0_wp
      !> Age of the contacts at the start of a run [s]
      real(wp) :: initial_age = 0.0_wp
      !> Deficit of young contacts, over the mean: of the mean, and of each deviation from it
      real(wp) :: mean_lack = 0.0_wp, width_lack = 0.0_wp
      !> Growth of the law `log` for each e-fold of the age
      real(wp) :: growth = 0.0_wp
   contains
      !> Threshold at an age, and its rate
      procedure, non_overridable :: evaluate
      !> Threshold at an age
      procedure, non_overridable :: threshold
      !> Change of the rate in a second
      procedure, non_overridable :: bend
      !> Growth of a threshold from an age on
      procedure, non_overridable :: grow
      !> Configured threshold of the contacts that break at an age under a force
      procedure, non_overridable :: configured
      !> Whether the threshold falls with age
      procedure, non_overridable :: falls
      !> Whether any threshold changes with age, that of a contact, and whether it does so any more
      procedure, non_overridable :: acts
      procedure, non_overridable :: is_constant
      procedure, non_overridable :: is_old
      !> Deficit of the threshold of a contact at birth
      procedure, non_overridable :: lack
   end type ageing_law_type

contains

   !> Take a law of ageing, and the law of thresholds of contacts that can attach with it.
   subroutine take_ageing_law(self, law, parameters, error)
      type(ageing_law_type), intent(out) :: self
      !> Law of the configured thresholds, conditional on what is above the back force; on return
      !> also on what is so when it is young
      class(threshold_law_type), intent(inout) :: law
      !> Named numbers
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong, or no contact can attach
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: force_ratio, width, narrowing, minimum

      call parameters%take("ageing", ageing_names, self%kind, error)
      call parameters%take("ageing_time", self%time, error)
      call parameters%take("initial_age", self%initial_age, error)
      if (allocated(error)) return
      if (.not. (self%time > 0.0_wp .and. self%initial_age >= 0.0_wp)) then
         call raise(error, status_invalid, "the time of ageing must be positive, and no initial " &
            & // "age below 0")
         return
      end if
      self%inverse_time = 1.0_wp / self%time
      select case (self%kind)
      case (ageing_relax)
         call parameters%take("young_force_ratio", force_ratio, error)
         call parameters%take("young_relative_width", width, error)
         if (allocated(error)) return
         if (.not. (force_ratio > 0.0_wp .and. width > 0.0_wp)) then
            call raise(error, status_invalid, "force and width of the young must be positive")
            return
         end if
         narrowing = width / law%width
         self%mean_lack = 1.0_wp - force_ratio
         self%width_lack = 1.0_wp - force_ratio * narrowing
         minimum = (law%minimum - force_ratio * (1.0_wp - narrowing)) / (force_ratio * narrowing)
         if (minimum > law%minimum) call law%reject_below(minimum, error)
      case (ageing_log)
         call parameters%take("growth", self%growth, error)
         if (allocated(error)) return
         if (self%growth < 0.0_wp) then
            call raise(error, status_invalid, "the growth of thresholds must not be negative")
         end if
      case default
         call raise(error, status_invalid, "unknown law of ageing")
      end select
   end subroutine take_ageing_law

   !> Threshold at an age, and its rate.
   pure subroutine evaluate(self, configured, mean, age, threshold, rate)
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, in any unit
      real(wp), intent(in) :: configured, mean
      !> Age, not negative [s]
      real(wp), intent(in) :: age
      !> Threshold at this age, in that unit, and what it grows by in a second
      real(wp), intent(out) :: threshold, rate

      real(wp) :: lack

      if (self%kind == ageing_log) then
         threshold = configured * (1.0_wp + self%growth * log(1.0_wp + age / self%time))
         rate = configured * self%growth / (self%time + age)
      else if (age > old * self%time) then
         threshold = configured
         rate = 0.0_wp
      else
         lack = self%lack(configured, mean)
         if (age > 0.0_wp) lack = lack * exp(-age * self%inverse_time)
         threshold = configured - lack
         rate = lack * self%inverse_time
      end if
   end subroutine evaluate

   !> Change of the rate of a threshold in a second.
   elemental function bend(self, rate, age)
      class(ageing_law_type), intent(in) :: self
      !> Rate of the threshold, in any unit for a second, and age [s]
      real(wp), intent(in) :: rate, age
      !> Its change in that unit for a second squared
      real(wp) :: bend

      bend = -rate * self%inverse_time
      if (self%kind == ageing_log) bend = -rate / (self%time + age)
   end function bend

   !> Growth of a threshold from an age on. In a short time it is that of a series, which takes less
   !> time than a transcendental function.
   elemental subroutine grow(self, rate, age, time, growth, later_rate)
      class(ageing_law_type), intent(in) :: self
      !> Rate of the threshold at the age, in any unit for a second
      real(wp), intent(in) :: rate
      !> Age, and the time from then on, not negative [s]
      real(wp), intent(in) :: age, time
      !> Growth in this time, in that unit, and the rate at its end
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
   elemental function lack(self, configured, mean)
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, in any unit
      real(wp), intent(in) :: configured, mean
      !> The deficit, in that unit
      real(wp) :: lack

      lack = self%mean_lack * mean + self%width_lack * (configured - mean)
   end function lack

   !> Threshold at an age.
   pure function threshold(self, configured, mean, age)
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, in any unit
      real(wp), intent(in) :: configured, mean
      !> Age, not negative [s]
      real(wp), intent(in) :: age
      !> Threshold at this age, in that unit
      real(wp) :: threshold

      real(wp) :: rate

      call self%evaluate(configured, mean, age, threshold, rate)
   end function threshold

   !> Configured threshold of the contacts that break at an age under a force.
   pure function configured(self, force, age)
      class(ageing_law_type), intent(in) :: self
      !> Force over the mean configured threshold
      real(wp), intent(in) :: force
      !> Age, not negative [s]
      real(wp), intent(in) :: age
      !> Configured threshold over the mean: that of contacts whose threshold is the force
      real(wp) :: configured

      real(wp) :: lack

      if (self%kind == ageing_log) then
         configured = force / (1.0_wp + self%growth * log(1.0_wp + age / self%time))
      else if (age > old * self%time) then
         configured = force
      else
         lack = exp(-age / self%time)
         configured = (force + (self%mean_lack - self%width_lack) * lack) &
            & / (1.0_wp - self%width_lack * lack)
      end if
   end function configured

   !> Whether the threshold falls with age: the young are weaker in the mean, but often wider
   !> spread, so that the strongest of them become weaker.
   pure function falls(self, configured, mean)
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, in any unit
      real(wp), intent(in) :: configured, mean
      !> Whether it does
      logical :: falls

      falls = self%lack(configured, mean) < 0.0_wp
   end function falls

   !> Whether any threshold changes with age.
   pure function acts(self)
      class(ageing_law_type), intent(in) :: self
      !> Whether one does
      logical :: acts

      acts = abs(self%growth) + abs(self%mean_lack) + abs(self%width_lack) > 0.0_wp
   end function acts

   !> Whether the threshold of a contact is the same at any age.
   pure function is_constant(self, configured, mean)
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, in any unit
      real(wp), intent(in) :: configured, mean
      !> Whether it is
      logical :: is_constant

      if (self%kind == ageing_log) then
         is_constant = .not. self%growth > 0.0_wp
      else
         is_constant = .not. abs(self%lack(configured, mean)) > 0.0_wp
      end if
   end function is_constant

   !> Whether the threshold does not change any more.
   pure function is_old(self, age)
      class(ageing_law_type), intent(in) :: self
      !> Age [s]
      real(wp), intent(in) :: age
      !> Whether that is so
      logical :: is_old

      is_old = self%kind == ageing_relax .and. age > old * self%time
   end function is_old

end module mesoslip_contacts_ageing_law
