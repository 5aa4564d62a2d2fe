!> Where a contact breaks whose stretch grows steadily while its threshold changes with age.
module mesoslip_contacts_ageing_meeting
   use mesoslip_contacts_ageing_law, only: ageing_law_type, ageing_log, ageing_relax, old
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: meet, meet_bound, meet_newborn

   !> Coefficients of exp(T(p)), where T = p exp(T) < 1, in powers of (1 - e p)^(1/2), in which it
   !> is analytic; right to 5e-5.
   real(wp), parameter :: tree_start(0:6) = [2.718238_wp, -3.839751_wp, 4.452257_wp, &
      & -4.483397_wp, 3.511888_wp, -1.760118_wp, 0.400914_wp]
   !> Speed times time beyond which thresholds do not change while a contact is stretched [m]
   real(wp), parameter :: max_scale = 1.0e30_wp
   real(wp), parameter :: euler = 2.718281828459045235_wp
   !> Step of an iteration of the fourth order after which nothing is left to correct
   real(wp), parameter :: max_step = 1.0e-4_wp
   !> Rate over speed up to which there is one step only
   real(wp), parameter :: max_plain = 0.9_wp
   !> Change of the rate of a threshold, relative, up to which a parabola is a close bound
   real(wp), parameter :: max_bend = 0.2_wp
   !> The same of Newton's method, relative
   real(wp), parameter :: max_newton_step = 1.0e-8_wp
   !> Iterations, more than are ever needed but where a contact just does not break
   integer, parameter :: max_iterations = 60

contains

   !> Threshold at which a contact breaks whose stretch grows at a steady speed.
   !>
   !> It is the threshold that a slower contact at least has where it breaks, if thresholds grow.
   !>
   !> With the distance w in units of s = speed times tau_a, the threshold is U - L exp(-w) and the
   !> stretch is x + s w. Where both are the same the threshold is U - s T, with T = p exp(T) and
   !> p = L/s exp(-(U - x)/s), of which the lesser solution is meant: T is the rate of the threshold
   !> over the speed (R. Corless et al., Adv. Comput. Math. 5 (1996) 329).
   pure function meet(law, configured, mean, age, stretch, speed) result(threshold)
      !> The law
      type(ageing_law_type), intent(in) :: law
      !> Configured threshold of the contact, and the mean of all contacts, as stretches [m]
      real(wp), intent(in) :: configured, mean
      !> Age, not negative [s]
      real(wp), intent(in) :: age
      !> Stretch at this age [m], and the speed at which it grows, positive [m/s]
      real(wp), intent(in) :: stretch, speed
      !> Threshold where it breaks, that of now if the stretch is beyond it [m]
      real(wp) :: threshold

      real(wp) :: lack, scale, distance, part

      scale = speed * law%time
      if (law%kind == ageing_log) then
         threshold = meet_grown(law, configured, age / law%time, stretch, scale)
         return
      end if
      lack = law%lack(configured, mean)
      if (age > 0.0_wp) lack = lack * exp(-min(age / law%time, old))
      threshold = configured - lack
      if (threshold <= stretch .or. scale > max_scale) return
      distance = (configured - stretch) / scale
      if (lack > 0.0_wp) then
         threshold = configured
         if (distance < old) threshold = configured - scale * tree(lack / scale * exp(-distance))
      else if (lack < 0.0_wp) then
         part = lack / scale
         threshold = configured - lack * exp(-fallen(distance, part))
      end if
   end function meet

   !> A bound from below on that threshold, which takes less time where it is near, if it grows.
   pure function meet_bound(law, configured, mean, age, stretch, speed) result(threshold)
      !> The law
      type(ageing_law_type), intent(in) :: law
      !> Configured threshold of the contact, and the mean of all contacts, as stretches [m]
      real(wp), intent(in) :: configured, mean
      !> Age, not negative [s]
      real(wp), intent(in) :: age
      !> Stretch at this age [m], and the speed at which it grows, positive [m/s]
      real(wp), intent(in) :: stretch, speed
      !> Threshold that the contact has where it breaks, or a lower one [m]
      real(wp) :: threshold

      real(wp) :: rate, bend, gap, time, slowness

      call law%evaluate(configured, mean, age, threshold, rate)
      gap = threshold - stretch
      if (.not. (gap > 0.0_wp .and. rate > 0.0_wp) .or. speed * law%time > max_scale) return
      bend = 0.5_wp * law%bend(rate, age)
      if (2.0_wp * gap * abs(bend) < max_bend * rate * speed .and. 2.0_wp * rate < speed) then
         ! The third derivatives of thresholds are positive: a parabola is below.
         slowness = 1.0_wp / speed
         time = gap * slowness
         time = (gap + (rate + bend * time) * time) * slowness
         threshold = threshold + (rate + bend * time) * time
      else
         threshold = meet(law, configured, mean, age, stretch, speed)
      end if
   end function meet_bound

   !> The same as meet for many contacts at birth: together they take less time.
   pure subroutine meet_newborn(law, configured, mean, stretch, speed, threshold)
      !> The law
      type(ageing_law_type), intent(in) :: law
      !> Configured thresholds of the contacts, and the mean of all contacts, as stretches [m]
      real(wp), intent(in), contiguous :: configured(:)
      real(wp), intent(in) :: mean
      !> Stretch at birth [m], and the speed at which it grows, positive [m/s]
      real(wp), intent(in) :: stretch, speed
      !> Thresholds where they break, the same as those of meet to the bit; shape (contacts) [m]
      real(wp), intent(out), contiguous :: threshold(:)

      real(wp), dimension(size(configured)) :: p, t, step, slope
      logical :: is_plain(size(configured))
      real(wp) :: lack, scale, distance
      integer :: contact

      scale = speed * law%time
      is_plain = law%kind == ageing_relax .and. scale <= max_scale
      do contact = 1, size(configured)
         lack = law%lack(configured(contact), mean)
         distance = (configured(contact) - stretch) / scale
         is_plain(contact) = is_plain(contact) .and. lack > 0.0_wp .and. distance < old &
            & .and. configured(contact) - lack > stretch
         p(contact) = 0.0_wp
         if (is_plain(contact)) p(contact) = lack / scale * exp(-distance)
      end do
      t = first_tree(p)
      do contact = 1, size(configured)
         ! Under a condition, as the exponential function of vectors has another last digit.
         slope(contact) = 0.0_wp
         if (is_plain(contact)) slope(contact) = p(contact) * exp(t(contact))
         if (slope(contact) < max_plain) cycle
         is_plain(contact) = .false.
         slope(contact) = 0.0_wp
      end do
      call improve_tree(slope, t, step)
      threshold = configured - scale * t
      do contact = 1, size(configured)
         if (is_plain(contact) .and. step(contact) <= max_step) cycle
         threshold(contact) = meet(law, configured(contact), mean, 0.0_wp, stretch, speed)
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
      do iteration = 1, max_iterations
         slope = p * exp(t)
         if (.not. slope < 1.0_wp) return
         call improve_tree(slope, t, step)
         if (step <= max_step) return
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

   !> Distance w after which a threshold that falls is met: w + part exp(-w) = distance.
   pure function fallen(distance, part) result(w)
      !> Distance to the old threshold, and what is lacking at first, negative: distance > part
      real(wp), intent(in) :: distance, part
      real(wp) :: w

      real(wp) :: grown, step
      integer :: iteration

      w = max(0.0_wp, distance)
      do iteration = 1, max_iterations
         grown = part * exp(-min(w, old))
         step = (distance - w - grown) / (1.0_wp - grown)
         w = w + step
         if (abs(step) <= max_newton_step * max(1.0_wp, w)) return
      end do
   end function fallen

   !> The same as meet for the law `log`.
   !>
   !> With z = 1 + t/tau_a the stretch is x + s (z - z_0), the threshold U (1 + beta ln z): the
   !> greater solution of z - kappa ln z = (U - x)/s + z_0 with kappa = U beta/s.
   pure function meet_grown(law, configured, age, stretch, scale) result(threshold)
      type(ageing_law_type), intent(in) :: law
      !> Configured threshold [m], age over tau_a, stretch [m], speed times tau_a [m]
      real(wp), intent(in) :: configured, age, stretch, scale
      real(wp) :: threshold

      real(wp) :: kappa, wanted, z, step
      integer :: iteration

      threshold = configured * (1.0_wp + law%growth * log(1.0_wp + age))
      if (threshold <= stretch .or. scale > max_scale .or. .not. law%growth > 0.0_wp) return
      kappa = configured * law%growth / scale
      z = 1.0_wp + age
      wanted = (configured - stretch) / scale + z
      ! To the right of the least value: from there Newton's method comes from one side.
      if (wanted > z) z = wanted + kappa * log(wanted)
      z = max(z, 2.0_wp * kappa)
      do iteration = 1, max_iterations
         step = (wanted + kappa * log(z) - z) / (1.0_wp - kappa / z)
         z = z + step
         if (abs(step) <= max_newton_step * z) exit
      end do
      threshold = configured * (1.0_wp + law%growth * log(z))
   end function meet_grown

end module mesoslip_contacts_ageing_meeting
