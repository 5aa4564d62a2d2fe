!> Thresholds of the contacts of a sliding interface: a threshold law weighted by the displacement
!> of a contact from attaching to breaking.
!>
!> Dimensionless as in mesoslip_contacts_mechanics. Thresholds are drawn by inversion of the
!> weighted law, E[d(u); u > U]/E[d] with d(u) = u - beta for equal contacts and
!> u^(1/2) - beta u^(-1/2) for scaled ones: one draw consumes one deviate, whatever the width of the
!> law. Break stretches of a table with stiffnesses are drawn in the same way: d = x_s - beta/k.
module mesoslip_contacts_carried_law
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_mechanics, only: breaking_distance, coupling_equal, coupling_table
   use mesoslip_contacts_partial_moments, only: new_partial_moments, partial_moments_type
   use mesoslip_contacts_stretch_cells, only: cell_of, stretch_cells_type
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: carried_law_type, new_carried_law

   !> Iterations of Newton's method and bisection, sufficient for bisection alone
   integer, parameter :: max_iterations = 200
   !> Relative change of a threshold at which the solution by interpolation has converged
   real(wp), parameter :: enough = 1.0e-8_wp
   !> Newton's steps after that, with moments exact to rounding, and their maximum relative change
   integer, parameter :: exact_steps = 2
   real(wp), parameter :: max_change = 1.0e-3_wp

   !> Thresholds weighted by the distance to breaking.
   type :: carried_law_type
      class(threshold_law_type), allocatable, private :: law
      type(partial_moments_type), private :: moments
      !> One of the coupling_ codes
      integer, private :: coupling = coupling_equal
      !> Force at attaching, f_b/f_s
      real(wp), private :: back_force = 0.0_wp
      !> Mean of the distance
      real(wp), private :: mean = 1.0_wp
      !> Cells of a law with stiffnesses, and the mean distance above each, times the probability
      type(stretch_cells_type), private :: cells
      real(wp), allocatable, private :: above(:)
   contains
      !> Threshold that is exceeded with a given probability
      procedure, non_overridable :: quantile
      procedure, non_overridable, private :: slope, sum_cells, quantile_in_cells
   end type carried_law_type

contains

   !> Set up the weighted law.
   subroutine new_carried_law(self, law, coupling, back_force)
      type(carried_law_type), intent(out) :: self
      !> Law of the thresholds of contacts that attach, all above the force at attaching
      class(threshold_law_type), intent(in) :: law
      !> One of the coupling_ codes
      integer, intent(in) :: coupling
      !> Force at attaching, f_b/f_s
      real(wp), intent(in) :: back_force

      allocate (self%law, source=law)
      self%coupling = coupling
      self%back_force = back_force
      if (coupling == coupling_table) then
         call self%sum_cells()
         return
      end if
      if (coupling == coupling_equal) then
         call new_partial_moments(self%moments, law, [1.0_wp, 0.0_wp])
      else
         call new_partial_moments(self%moments, law, [0.5_wp, -0.5_wp])
      end if
      self%mean = distance_of(self, self%moments%above(0.0_wp))
   end subroutine new_carried_law

   !> Sum the distances of contacts of a law with stiffnesses.
   subroutine sum_cells(self)
      class(carried_law_type), intent(inout) :: self

      integer :: cell

      self%cells = self%law%stretch_cells()
      associate (cells => self%cells)
         allocate (self%above(size(cells%share) + 1), source=0.0_wp)
         do cell = size(cells%share), 1, -1
            self%above(cell) = self%above(cell + 1) + cells%share(cell) * (0.5_wp &
               & * (cells%low(cell) + cells%high(cell)) - self%back_force / cells%stiffness(cell))
         end do
      end associate
      self%mean = self%above(1)
   end subroutine sum_cells

   !> Break stretch that is exceeded with a given probability, for a law with stiffnesses.
   pure function quantile_in_cells(self, probability) result(stretch)
      class(carried_law_type), intent(in) :: self
      !> Probability to exceed the stretch, 0 < probability < 1
      real(wp), intent(in) :: probability
      real(wp) :: stretch

      real(wp) :: wanted, life
      integer :: cell

      wanted = probability * self%mean
      cell = cell_of(self%above, wanted, -1.0_wp)
      ! Within a cell the probability grows with the square of the distance.
      associate (cells => self%cells)
         associate (low => cells%low(cell), high => cells%high(cell), &
            & attached => self%back_force / cells%stiffness(cell))
            life = sqrt(max(0.0_wp, (high - attached)**2 - 2.0_wp * (high - low) &
               & / cells%share(cell) * (wanted - self%above(cell + 1))))
            stretch = min(high, max(low, attached + life))
         end associate
      end associate
   end function quantile_in_cells

   !> Threshold that is exceeded with a given probability.
   pure function quantile(self, probability) result(threshold)
      class(carried_law_type), intent(in) :: self
      !> Probability to exceed the threshold, 0 < probability < 1
      real(wp), intent(in) :: probability
      !> Relative threshold; break stretch of a law with stiffnesses
      real(wp) :: threshold

      real(wp) :: lower, upper, least, next, wanted, excess, slope, step, moment(2)
      integer :: iteration

      if (self%coupling == coupling_table) then
         threshold = self%quantile_in_cells(probability)
         return
      end if
      wanted = probability * self%mean
      ! Contacts of low threshold break soon: they are fewer than among newborns.
      least = self%law%quantile(probability)
      upper = self%moments%max_threshold
      lower = min(least, upper)
      threshold = lower
      do iteration = 1, max_iterations
         call self%moments%interpolate(threshold, moment)
         excess = distance_of(self, moment) - wanted
         if (excess > 0.0_wp) then
            lower = threshold
         else
            upper = threshold
         end if
         if (upper - lower <= enough * upper) exit
         ! In the logarithm, as thresholds may span many orders of magnitude.
         next = sqrt(lower * upper)
         slope = self%slope(threshold)
         if (slope > 0.0_wp) then
            step = excess / (slope * threshold)
            if (abs(step) <= enough) exit
            step = threshold * exp(min(1.0_wp, max(-1.0_wp, step)))
            if (step > lower .and. step < upper) next = step
         end if
         threshold = next
      end do
      do iteration = 1, exact_steps
         slope = self%slope(threshold)
         if (.not. slope > 0.0_wp) exit
         step = (distance_of(self, self%moments%above(threshold)) - wanted) / slope
         threshold = threshold + min(max_change * threshold, max(-max_change * threshold, step))
      end do
      threshold = max(min(threshold, self%moments%max_threshold), least)
   end function quantile

   !> Density of the weighted law times the mean distance.
   pure function slope(self, threshold)
      class(carried_law_type), intent(in) :: self
      real(wp), intent(in) :: threshold
      real(wp) :: slope

      slope = self%law%density(threshold) &
         & * breaking_distance(self%coupling, self%back_force, threshold)
   end function slope

   !> The distance from moments of thresholds.
   pure function distance_of(self, moment) result(distance)
      type(carried_law_type), intent(in) :: self
      !> Moments of the exponents 1 and 0 for equal contacts, 1/2 and -1/2 for scaled ones
      real(wp), intent(in) :: moment(2)
      real(wp) :: distance

      distance = moment(1) - self%back_force * moment(2)
   end function distance_of

end module mesoslip_contacts_carried_law
