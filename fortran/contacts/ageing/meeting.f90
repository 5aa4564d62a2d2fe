!> Threshold at which a contact breaks whose stretch grows steadily while it ages.
!>
!> In the arguments below `configured` is the configured threshold of the contact and `mean` the
!> mean over all contacts, as stretches [m]. At the age [s], not negative, the contact has the
!> stretch [m], which grows at the speed [m/s], positive.
module mesoslip_contacts_ageing_meeting
   use mesoslip_contacts_ageing_law, only: ageing_law_type, ageing_log, ageing_relax, old
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: meet, meet_newborn

   !> Coefficients of exp(T(p)), where T = p exp(T) < 1, in powers of (1 - e p)^(1/2), in which it
   !> is analytic; exact to 5e-5
   real(wp), parameter :: tree_start(0:6) = [2.718238_wp, -3.839751_wp, 4.452257_wp, &
      & -4.483397_wp, 3.511888_wp, -1.760118_wp, 0.400914_wp]
   !> Speed times tau_a beyond which thresholds do not change while a contact is stretched [m]
   real(wp), parameter :: max_scale = 1.0e30_wp
   real(wp), parameter :: euler = 2.718281828459045235_wp
   !> Size of a step of fourth order after which the error is below rounding
   real(wp), parameter :: max_step = 1.0e-4_wp
   !> Rate over speed up to which one such step is enough
   real(wp), parameter :: max_plain = 0.9_wp
   !> Relative size of a step of Newton's method after which the error is below rounding
   real(wp), parameter :: max_newton_step = 1.0e-8_wp
   !> Maximum number of steps, which is reached only where a contact just does not break
   integer, parameter :: max_iterations = 60

contains

   !> Threshold at which a contact breaks [m]; its present threshold if the stretch is above it.
   !>
   !> A growing threshold is higher where a slower contact breaks, so that this is a lower bound for
   !> lower speeds.
   !>
   !> With the distance w in units of s = speed times tau_a, the threshold is U - L exp(-w) and the
   !> stretch is x + s w. They meet at the threshold U - s T, where T is the lesser solution of
   !> T = p exp(T) with p = L/s exp(-(U - x)/s), the rate of the threshold over the speed
   !> (R. Corless et al., Adv. Comput. Math. 5 (1996) 329).
   pure function meet(law, configured, mean, age, stretch, speed) result(threshold)
      type(ageing_law_type), intent(in) :: law
      real(wp), intent(in) :: configured, mean, age, stretch, speed
      real(wp) :: threshold

      real(wp) :: deficit, scale, distance

      scale = speed * law%time
      if (law%kind == ageing_log) then
         threshold = meet_grown(law, configured, age / law%time, stretch, scale)
         return
      end if
      deficit = law%deficit(configured, mean)
      if (age > 0.0_wp) deficit = deficit * exp(-min(age / law%time, old))
      threshold = configured - deficit
      if (threshold <= stretch .or. scale > max_scale) return
      distance = (configured - stretch) / scale
      if (deficit > 0.0_wp) then
         threshold = configured
         if (distance < old) then
            threshold = configured - scale * tree(deficit / scale * exp(-distance))
         end if
      else if (deficit < 0.0_wp) then
         threshold = configured - deficit * exp(-fallen(distance, deficit / scale))
      end if
   end function meet

   !> The same as meet, to the bit, for many contacts at birth, which is faster together.
   pure subroutine meet_newborn(law, configured, mean, stretch, speed, threshold)
      type(ageing_law_type), intent(in) :: law
      real(wp), intent(in), contiguous :: configured(:)
      real(wp), intent(in) :: mean, stretch, speed
      real(wp), intent(out), contiguous :: threshold(:)

      real(wp), dimension(size(configured)) :: p, t, step, slope
      logical :: is_plain(size(configured))
      real(wp) :: deficit, scale, distance
      integer :: contact

      scale = speed * law%time
      is_plain = law%kind == ageing_relax .and. scale <= max_scale
      do contact = 1, size(configured)
         deficit = law%deficit(configured(contact), mean)
         distance = (configured(contact) - stretch) / scale
         is_plain(contact) = is_plain(contact) .and. deficit > 0.0_wp .and. distance < old &
            & .and. configured(contact) - deficit > stretch
         p(contact) = 0.0_wp
         if (is_plain(contact)) p(contact) = deficit / scale * exp(-distance)
      end do
      t = first_tree(p)
      do contact = 1, size(configured)
         ! Conditional, because a vectorized exponential function has another last digit.
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

   !> Solution below 1 of T = p exp(T), where p is between 0 and 1/e.
   pure function tree(p) result(t)
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

   !> The same by a series.
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

   !> One step of the fourth order to T, given p exp(T) below 1, and its size over the distance to
   !> where the solution ends.
   elemental subroutine improve_tree(grown, t, change)
      real(wp), intent(in) :: grown
      real(wp), intent(inout) :: t
      real(wp), intent(out) :: change

      real(wp) :: slope, step

      slope = 1.0_wp / (1.0_wp - grown)
      step = (grown - t) * slope
      slope = grown * slope
      t = t + step * (1.0_wp + slope * step * (0.5_wp + (0.5_wp * slope + 1.0_wp / 6.0_wp) * step))
      change = abs(slope * step)
   end subroutine improve_tree

   !> Solution w of w + part exp(-w) = distance, the distance to a falling threshold with the
   !> negative deficit `part`, less than the distance.
   pure function fallen(distance, part) result(w)
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
   !> With z = 1 + t/tau_a the stretch is x + s (z - z_0) and the threshold U (1 + beta ln z). They
   !> meet at the greater solution of z - kappa ln z = (U - x)/s + z_0 with kappa = U beta/s. Here
   !> the age is in units of tau_a, and s is the scale.
   pure function meet_grown(law, configured, age, stretch, scale) result(threshold)
      type(ageing_law_type), intent(in) :: law
      real(wp), intent(in) :: configured, age, stretch, scale
      real(wp) :: threshold

      real(wp) :: kappa, wanted, z, step
      integer :: iteration

      threshold = configured * (1.0_wp + law%growth * log(1.0_wp + age))
      if (threshold <= stretch .or. scale > max_scale .or. .not. law%growth > 0.0_wp) return
      kappa = configured * law%growth / scale
      z = 1.0_wp + age
      wanted = (configured - stretch) / scale + z
      ! From the right of the minimum Newton's method converges from one side.
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
