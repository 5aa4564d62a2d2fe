!> Interface of every threshold law: thresholds to draw, density and survival function.
!>
!> Thresholds are relative, u = f_si/f_s. A law has mean 1 before thresholds that could not attach,
!> u <= minimum, are rejected. Rejection is done by inversion: the conditional law is that of
!> drawing again, and one draw consumes one deviate.
!>
!> A table may have a stiffness for each threshold. Its law is that of the relative break stretches
!> x_s = f_s/k, which replace thresholds in quantiles, densities and survival: contacts break in
!> their order, and each stretch has one stiffness.
module mesoslip_contacts_threshold_laws_base
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_stretch_cells, only: stretch_cells_type
   implicit none
   private

   public :: threshold_law_type

   !> A law of relative thresholds, conditional on u > minimum.
   type, abstract :: threshold_law_type
      !> Standard deviation over mean, before rejection
      real(wp) :: width = 0.0_wp
      !> Thresholds at or below are rejected
      real(wp) :: minimum = 0.0_wp
      !> Probability that a draw is not rejected
      real(wp) :: acceptance = 1.0_wp
      !> Whether the density is smooth in the logarithm of the threshold: thresholds span orders of
      !> magnitude
      logical :: is_logarithmic = .false.
      !> Number of cells in which the density is constant; 0 if it has no such cells
      integer :: cells = 0
      !> Whether the law is that of break stretches, each with a stiffness
      logical :: has_stiffnesses = .false.
      !> Mean squared stiffness before rejection, where the mean stiffness is 1: masses are
      !> proportional to squares
      real(wp) :: mean_square_stiffness = 1.0_wp
   contains
      !> Take the parameters of the law, and compute its constants from its width
      procedure :: take, set_constants
      !> Quantile, density and survival function before rejection
      procedure(function_interface), deferred :: plain_quantile, plain_density, plain_survival
      !> Edges of the cells before rejection
      procedure :: cell_edges
      !> For a law with stiffnesses: cells after rejection, stiffness at a break stretch, and
      !> rejection of the contacts that a force breaks
      procedure :: stretch_cells, stiffness_at, reject_stretches
      !> Reject thresholds at or below a minimum
      procedure, non_overridable :: reject_below
      !> Quantile, density and survival function, and the smallest threshold
      procedure, non_overridable :: quantile, density, survival, min_threshold
      !> Quantiles of several probabilities, equal to those of quantile to the bit: some laws
      !> compute them faster together
      procedure :: quantiles
   end type threshold_law_type

   abstract interface
      !> A function of the law before rejection.
      pure function function_interface(self, argument) result(value)
         import :: threshold_law_type, wp
         implicit none
         class(threshold_law_type), intent(in) :: self
         !> Probability to exceed the threshold, or the threshold
         real(wp), intent(in) :: argument
         !> Threshold, density or probability
         real(wp) :: value
      end function function_interface
   end interface

contains

   !> Take the parameters of the law: its relative width, unless a law has others.
   subroutine take(self, parameters, error)
      class(threshold_law_type), intent(inout) :: self
      !> Named values
      type(parameters_type), intent(inout) :: parameters
      !> Set if one is missing or wrong
      type(error_type), allocatable, intent(inout) :: error

      call parameters%take("relative_width", self%width, error)
      if (allocated(error)) return
      if (.not. self%width > 0.0_wp) then
         call raise(error, status_invalid, "the relative width of a threshold law must be positive")
         return
      end if
      call self%set_constants()
   end subroutine take

   !> Compute the constants of the law from its width; by default there are none.
   subroutine set_constants(self)
      class(threshold_law_type), intent(inout) :: self

   end subroutine set_constants

   !> Reject thresholds at or below a minimum.
   subroutine reject_below(self, minimum, error)
      class(threshold_law_type), intent(inout) :: self
      !> Thresholds at or below are rejected; not negative
      real(wp), intent(in) :: minimum
      !> Set if the minimum is negative, or no threshold is above
      type(error_type), allocatable, intent(inout) :: error

      if (.not. minimum >= 0.0_wp) then
         call raise(error, status_invalid, "the minimum of thresholds must not be negative")
         return
      end if
      if (self%has_stiffnesses) then
         call self%reject_stretches(minimum, error)
         return
      end if
      self%minimum = minimum
      self%acceptance = self%plain_survival(minimum)
      if (.not. self%acceptance > 0.0_wp) then
         call raise(error, status_invalid, "no threshold of the law exceeds the back force")
      end if
   end subroutine reject_below

   !> Threshold that is exceeded with a given probability.
   elemental function quantile(self, probability) result(threshold)
      class(threshold_law_type), intent(in) :: self
      !> Probability to exceed the threshold, 0 < probability < 1
      real(wp), intent(in) :: probability
      !> Relative threshold, greater than the law's minimum
      real(wp) :: threshold

      threshold = max(self%plain_quantile(self%acceptance * probability), self%min_threshold())
   end function quantile

   !> Thresholds that are exceeded with several probabilities.
   pure subroutine quantiles(self, probability, threshold)
      class(threshold_law_type), intent(in) :: self
      !> Probabilities to exceed the thresholds, 0 < probability < 1
      real(wp), intent(in), contiguous :: probability(:)
      !> Relative thresholds, shape that of probability
      real(wp), intent(out), contiguous :: threshold(:)

      threshold = self%quantile(probability)
   end subroutine quantiles

   !> Edges of the cells in which the density is constant; by default there are none.
   pure function cell_edges(self) result(edge)
      class(threshold_law_type), intent(in) :: self
      !> Relative thresholds, ascending, before rejection, shape (cells + 1)
      real(wp) :: edge(self%cells + 1)

      edge = 0.0_wp
   end function cell_edges

   !> Cells of break stretches after rejection; empty for a law without stiffnesses.
   pure function stretch_cells(self) result(cells)
      class(threshold_law_type), intent(in) :: self
      !> The cells; their probabilities add up to 1
      type(stretch_cells_type) :: cells

      allocate (cells%low(0), cells%high(0), cells%share(0), cells%stiffness(0))
   end function stretch_cells

   !> Stiffness of contacts that break at a stretch; 1 for a law without stiffnesses.
   elemental function stiffness_at(self, stretch) result(stiffness)
      class(threshold_law_type), intent(in) :: self
      !> Relative break stretch
      real(wp), intent(in) :: stretch
      !> Relative stiffness
      real(wp) :: stiffness

      stiffness = 1.0_wp
   end function stiffness_at

   !> Reject the contacts of a law with stiffnesses that a force breaks.
   subroutine reject_stretches(self, force, error)
      class(threshold_law_type), intent(inout) :: self
      !> Relative thresholds at or below are rejected
      real(wp), intent(in) :: force
      !> Set if the force breaks all contacts, or the law has no stiffnesses
      type(error_type), allocatable, intent(inout) :: error

      self%minimum = force
      call raise(error, status_invalid, "the threshold law has no stiffnesses")
   end subroutine reject_stretches

   !> Smallest threshold after rejection, just above the minimum.
   pure function min_threshold(self) result(threshold)
      class(threshold_law_type), intent(in) :: self
      real(wp) :: threshold

      threshold = self%minimum + epsilon(1.0_wp) * max(self%minimum, 1.0_wp)
   end function min_threshold

   !> Probability density of the thresholds.
   elemental function density(self, threshold)
      class(threshold_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: threshold
      real(wp) :: density

      density = 0.0_wp
      if (threshold > self%minimum) density = self%plain_density(threshold) / self%acceptance
   end function density

   !> Probability that a threshold is greater than a given one.
   elemental function survival(self, threshold)
      class(threshold_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: threshold
      real(wp) :: survival

      survival = 1.0_wp
      if (threshold > self%minimum) survival = self%plain_survival(threshold) / self%acceptance
   end function survival

end module mesoslip_contacts_threshold_laws_base
