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

   public :: ageing_law_type, take_ageing_law, ageing_relax, ageing_log, ageing_names

   !> Mean and width relax from those of the young to those of the old
   integer, parameter :: ageing_relax = 1
   !> They grow with the logarithm of the age
   integer, parameter :: ageing_log = 2
   !> Names of the ageing_ codes
   character(len=*), parameter :: ageing_names(2) = [character(len=5) :: "relax", "log"]

   !> Ages over tau_a beyond which nothing relaxes any more, as exp(-40) is below rounding.
   real(wp), parameter :: old = 40.0_wp

   !> Coefficients of exp(T(p)), where T = p exp(T) < 1, in powers of (1 - e p)^(1/2), in which it
   !> is analytic; right to 5e-5.
   real(wp), parameter :: tree_start(0:6) = [2.718238_wp, -3.839751_wp, 4.452257_wp, &
      & -4.483397_wp, 3.511888_wp, -1.760118_wp, 0.400914_wp]
   !> Speed times time beyond which thresholds do not change while a contact is stretched [m]
   real(wp), parameter :: longest_scale = 1.0e30_wp
   real(wp), parameter :: euler = 2.718281828459045235_wp
   !> Step of an iteration of the fourth order after which nothing is left to correct
   real(wp), parameter :: enough = 1.0e-4_wp
   !> Rate over speed up to which there is one step only
   real(wp), parameter :: most_plain = 0.9_wp
   !> Change of the rate of a threshold, relative, up to which a parabola is a close bound
   real(wp), parameter :: most_bent = 0.2_wp
   !> The same of Newton's method, relative
   real(wp), parameter :: enough_of_newton = 1.0e-8_wp
   !> Iterations, more than are ever needed but where a contact just does not break
   integer, parameter :: most_iterations = 60

   !> A law of ageing.
   type :: ageing_law_type
      !> One of the ageing_ codes
      integer :: kind = ageing_relax
      !> Time tau_a [s]
      real(wp) :: time = 1.0_wp
      !> One over it [1/s]
      real(wp), private :: inverse_time = 1.0_wp
      !> Age of the contacts at the start of a run [s]
      real(wp) :: initial_age = 0.0_wp
      !> What the young lack, over the mean: of the mean, and of each deviation from it
      real(wp) :: mean_lack = 0.0_wp, width_lack = 0.0_wp
      !> Growth of the law `log` for each e-fold of the age
      real(wp) :: growth = 0.0_wp
   contains
      !> Threshold at an age, and its rate
      procedure, non_overridable :: follow
      !> Threshold at an age
      procedure, non_overridable :: threshold
      !> Threshold at which a contact breaks whose stretch grows at a steady speed
      procedure, non_overridable :: meet
      !> A bound on it from below; the same at birth, of many contacts
      procedure, non_overridable :: meet_least
      procedure, non_overridable :: meet_newborn
      !> What the rate changes by in a second
      procedure, non_overridable :: bend
      !> Configured threshold of the contacts that break at an age under a force
      procedure, non_overridable :: configured
      !> Whether the threshold falls with age
      procedure, non_overridable :: falls
      !> Whether any threshold changes with age, that of a contact, and whether it does so any more
      procedure, non_overridable :: acts
      procedure, non_overridable :: is_constant
      procedure, non_overridable :: is_old
      procedure, non_overridable, private :: lack, meet_grown
   end type ageing_law_type

contains

   !> Take a law of ageing, and the law of thresholds of contacts that can attach with it.
   subroutine take_ageing_law(self, law, parameters, error)
      !> The law of ageing
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
   pure subroutine follow(self, configured, mean, age, threshold, rate)
      !> The law
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
   end subroutine follow

   !> What the rate of a threshold changes by in a second.
   elemental function bend(self, rate, age)
      !> The law
      class(ageing_law_type), intent(in) :: self
      !> Rate of the threshold, in any unit for a second, and age [s]
      real(wp), intent(in) :: rate, age
      !> Its change in that unit for a second squared
      real(wp) :: bend

      bend = -rate * self%inverse_time
      if (self%kind == ageing_log) bend = -rate / (self%time + age)
   end function bend

   !> What the threshold of a contact lacks at birth.
   elemental function lack(self, configured, mean)
      class(ageing_law_type), intent(in) :: self
      real(wp), intent(in) :: configured, mean
      real(wp) :: lack

      lack = self%mean_lack * mean + self%width_lack * (configured - mean)
   end function lack

   !> Threshold at an age.
   pure function threshold(self, configured, mean, age)
      !> The law
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, in any unit
      real(wp), intent(in) :: configured, mean
      !> Age, not negative [s]
      real(wp), intent(in) :: age
      !> Threshold at this age, in that unit
      real(wp) :: threshold

      real(wp) :: rate

      call self%follow(configured, mean, age, threshold, rate)
   end function threshold

   !> Threshold at which a contact breaks whose stretch grows at a steady speed.
   !>
   !> It is the threshold that a slower contact at least has where it breaks, if thresholds grow.
   !>
   !> With the way w in units of s = speed times tau_a, the threshold is U - L exp(-w) and the
   !> stretch is x + s w. Where both are the same the threshold is U - s T, with T = p exp(T) and
   !> p = L/s exp(-(U - x)/s), of which the lesser solution is meant: T is the rate of the threshold
   !> over the speed (R. Corless et al., Adv. Comput. Math. 5 (1996) 329).
   pure function meet(self, configured, mean, age, stretch, speed) result(threshold)
      !> The law
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, as stretches [m]
      real(wp), intent(in) :: configured, mean
      !> Age, not negative [s]
      real(wp), intent(in) :: age
      !> Stretch at this age [m], and the speed at which it grows, positive [m/s]
      real(wp), intent(in) :: stretch, speed
      !> Threshold where it breaks, that of now if the stretch is beyond it [m]
      real(wp) :: threshold

      real(wp) :: lack, scale, way, part

      scale = speed * self%time
      if (self%kind == ageing_log) then
         threshold = self%meet_grown(configured, age / self%time, stretch, scale)
         return
      end if
      lack = self%lack(configured, mean)
      if (age > 0.0_wp) lack = lack * exp(-min(age / self%time, old))
      threshold = configured - lack
      if (threshold <= stretch .or. scale > longest_scale) return
      way = (configured - stretch) / scale
      if (lack > 0.0_wp) then
         threshold = configured
         if (way < old) threshold = configured - scale * tree(lack / scale * exp(-way))
      else if (lack < 0.0_wp) then
         part = lack / scale
         threshold = configured - lack * exp(-fallen(way, part))
      end if
   end function meet

   !> A bound from below on that threshold, which takes less time where it is near, if it grows.
   pure function meet_least(self, configured, mean, age, stretch, speed) result(threshold)
      !> The law
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, as stretches [m]
      real(wp), intent(in) :: configured, mean
      !> Age, not negative [s]
      real(wp), intent(in) :: age
      !> Stretch at this age [m], and the speed at which it grows, positive [m/s]
      real(wp), intent(in) :: stretch, speed
      !> Threshold that the contact has where it breaks, or a lower one [m]
      real(wp) :: threshold

      real(wp) :: rate, bend, gap, time, slowness

      call self%follow(configured, mean, age, threshold, rate)
      gap = threshold - stretch
      if (.not. (gap > 0.0_wp .and. rate > 0.0_wp) .or. speed * self%time > longest_scale) return
      bend = 0.5_wp * self%bend(rate, age)
      if (2.0_wp * gap * abs(bend) < most_bent * rate * speed .and. 2.0_wp * rate < speed) then
         ! The third derivatives of thresholds are positive: a parabola is below.
         slowness = 1.0_wp / speed
         time = gap * slowness
         time = (gap + (rate + bend * time) * time) * slowness
         threshold = threshold + (rate + bend * time) * time
      else
         threshold = self%meet(configured, mean, age, stretch, speed)
      end if
   end function meet_least

   !> The same as meet for many contacts at birth: together they take less time.
   pure subroutine meet_newborn(self, configured, mean, stretch, speed, threshold)
      !> The law
      class(ageing_law_type), intent(in) :: self
      !> Configured thresholds of the contacts, and the mean of all contacts, as stretches [m]
      real(wp), intent(in), contiguous :: configured(:)
      real(wp), intent(in) :: mean
      !> Stretch at birth [m], and the speed at which it grows, positive [m/s]
      real(wp), intent(in) :: stretch, speed
      !> Thresholds where they break, the same as those of meet to the bit; shape (contacts) [m]
      real(wp), intent(out), contiguous :: threshold(:)

      real(wp), dimension(size(configured)) :: p, t, step, slope
      logical :: is_plain(size(configured))
      real(wp) :: lack, scale, way
      integer :: contact

      scale = speed * self%time
      is_plain = self%kind == ageing_relax .and. scale <= longest_scale
      do contact = 1, size(configured)
         lack = self%lack(configured(contact), mean)
         way = (configured(contact) - stretch) / scale
         is_plain(contact) = is_plain(contact) .and. lack > 0.0_wp .and. way < old &
            & .and. configured(contact) - lack > stretch
         p(contact) = 0.0_wp
         if (is_plain(contact)) p(contact) = lack / scale * exp(-way)
      end do
      t = first_tree(p)
      do contact = 1, size(configured)
         ! Under a condition, as the exponential function of vectors has another last digit.
         slope(contact) = 0.0_wp
         if (is_plain(contact)) slope(contact) = p(contact) * exp(t(contact))
         if (slope(contact) < most_plain) cycle
         is_plain(contact) = .false.
         slope(contact) = 0.0_wp
      end do
      call improve_tree(slope, t, step)
      threshold = configured - scale * t
      do contact = 1, size(configured)
         if (is_plain(contact) .and. step(contact) <= enough) cycle
         threshold(contact) = self%meet(configured(contact), mean, 0.0_wp, stretch, speed)
      end do
   end subroutine meet_newborn

   !> Solution below 1 of T = p exp(T).
   pure function tree(p) result(t)
      !> Not negative, and at most 1/e
      real(wp), intent(in) :: p
      real(wp) :: t

      real(wp) :: slope, step
      integer :: iteration

      t = first_tree(p)
      do iteration = 1, most_iterations
         slope = p * exp(t)
         if (.not. slope < 1.0_wp) return
         call improve_tree(slope, t, step)
         if (step <= enough) return
      end do
   end function tree

   !> The same to a few digits.
   elemental function first_tree(p) result(t)
      real(wp), intent(in) :: p
      real(wp) :: t

      real(wp) :: q

      q = sqrt(max(0.0_wp, 1.0_wp - euler * p))
      associate (c => tree_start)
         t = p * ((c(0) + q * c(1)) + q**2 * ((c(2) + q * c(3)) &
            & + q**2 * ((c(4) + q * c(5)) + q**2 * c(6))))
      end associate
   end function first_tree

   !> One step of the fourth order.
   elemental subroutine improve_tree(grown, t, change)
      !> p exp(t), below 1
      real(wp), intent(in) :: grown
      !> The solution
      real(wp), intent(inout) :: t
      !> Size of the step, over that to where the solution ends
      real(wp), intent(out) :: change

      real(wp) :: slope, step

      slope = 1.0_wp / (1.0_wp - grown)
      step = (grown - t) * slope
      slope = grown * slope
      t = t + step * (1.0_wp + slope * step * (0.5_wp + (0.5_wp * slope + 1.0_wp / 6.0_wp) * step))
      change = abs(slope * step)
   end subroutine improve_tree

   !> Way w after which a threshold that falls is met: w + part exp(-w) = way.
   pure function fallen(way, part) result(w)
      !> Way to the old threshold, and what is lacking at first, negative: way > part
      real(wp), intent(in) :: way, part
      real(wp) :: w

      real(wp) :: grown, step
      integer :: iteration

      w = max(0.0_wp, way)
      do iteration = 1, most_iterations
         grown = part * exp(-min(w, old))
         step = (way - w - grown) / (1.0_wp - grown)
         w = w + step
         if (abs(step) <= enough_of_newton * max(1.0_wp, w)) return
      end do
   end function fallen

   !> The same as meet for the law `log`.
   !>
   !> With z = 1 + t/tau_a the stretch is x + s (z - z_0), the threshold U (1 + beta ln z): the
   !> greater solution of z - kappa ln z = (U - x)/s + z_0 with kappa = U beta/s.
   pure function meet_grown(self, configured, age, stretch, scale) result(threshold)
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold [m], age over tau_a, stretch [m], speed times tau_a [m]
      real(wp), intent(in) :: configured, age, stretch, scale
      real(wp) :: threshold

      real(wp) :: kappa, wanted, z, step
      integer :: iteration

      threshold = configured * (1.0_wp + self%growth * log(1.0_wp + age))
      if (threshold <= stretch .or. scale > longest_scale .or. .not. self%growth > 0.0_wp) return
      kappa = configured * self%growth / scale
      z = 1.0_wp + age
      wanted = (configured - stretch) / scale + z
      ! To the right of the least value: from there Newton's method comes from one side.
      if (wanted > z) z = wanted + kappa * log(wanted)
      z = max(z, 2.0_wp * kappa)
      do iteration = 1, most_iterations
         step = (wanted + kappa * log(z) - z) / (1.0_wp - kappa / z)
         z = z + step
         if (abs(step) <= enough_of_newton * z) exit
      end do
      threshold = configured * (1.0_wp + self%growth * log(z))
   end function meet_grown

   !> Configured threshold of the contacts that break at an age under a force.
   pure function configured(self, force, age)
      !> The law
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
      !> The law
      class(ageing_law_type), intent(in) :: self
      !> Configured threshold of the contact, and the mean of all contacts, in any unit
      real(wp), intent(in) :: configured, mean
      !> Whether it does
      logical :: falls

      falls = self%lack(configured, mean) < 0.0_wp
   end function falls

   !> Whether any threshold changes with age.
   pure function acts(self)
      !> The law
      class(ageing_law_type), intent(in) :: self
      !> Whether one does
      logical :: acts

      acts = abs(self%growth) + abs(self%mean_lack) + abs(self%width_lack) > 0.0_wp
   end function acts

   !> Whether the threshold of a contact is the same at any age.
   pure function is_constant(self, configured, mean)
      !> The law
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
      !> The law
      class(ageing_law_type), intent(in) :: self
      !> Age [s]
      real(wp), intent(in) :: age
      !> Whether that is so
      logical :: is_old

      is_old = self%kind == ageing_relax .and. age > old * self%time
   end function is_old

end module mesoslip_contacts_ageing_law
