!> Uniform law on 1 +- sqrt(3) width.
module mesoslip_contacts_threshold_laws_uniform
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_threshold_laws_base, only: take_relative_width, threshold_law_type
   implicit none
   private

   public :: uniform_law_type

   !> Uniform law on 1 +- sqrt(3) width.
   type, extends(threshold_law_type) :: uniform_law_type
      !> Half the width of the interval
      real(wp), private :: half = 0.0_wp
   contains
      procedure :: take
      procedure :: plain_quantile
      procedure :: plain_density
      procedure :: plain_survival
      procedure :: cell_edges
   end type uniform_law_type

contains

   !> Take the parameters of the law.
   subroutine take(self, parameters, error)
      !> The law
      class(uniform_law_type), intent(inout) :: self
      !> Its relative width, by name
      type(parameters_type), intent(inout) :: parameters
      !> Set if the width is missing or not positive
      type(error_type), allocatable, intent(inout) :: error

      call take_relative_width(self, parameters, error)
      self%half = sqrt(3.0_wp) * self%width
      self%cells = 1
   end subroutine take

   !> Threshold that is exceeded with a given probability, before rejection.
   pure function plain_quantile(self, argument) result(value)
      !> The law
      class(uniform_law_type), intent(in) :: self
      !> Probability to exceed the threshold
      real(wp), intent(in) :: argument
      !> Relative threshold
      real(wp) :: value

      value = 1.0_wp + self%half * (1.0_wp - 2.0_wp * argument)
   end function plain_quantile

   !> Probability density before rejection.
   pure function plain_density(self, argument) result(value)
      !> The law
      class(uniform_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability density
      real(wp) :: value

      value = 0.0_wp
      if (abs(argument - 1.0_wp) <= self%half) value = 0.5_wp / self%half
   end function plain_density

   !> Survival function before rejection.
   pure function plain_survival(self, argument) result(value)
      !> The law
      class(uniform_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability to exceed it
      real(wp) :: value

      value = min(1.0_wp, max(0.0_wp, 0.5_wp * (1.0_wp - (argument - 1.0_wp) / self%half)))
   end function plain_survival

   !> The ends of the interval: its density is constant in one cell.
   pure function cell_edges(self) result(edge)
      !> The law
      class(uniform_law_type), intent(in) :: self
      !> Relative thresholds, ascending, before rejection, shape (cells + 1)
      real(wp) :: edge(self%cells + 1)

      edge = 1.0_wp + self%half * [-1.0_wp, 1.0_wp]
   end function cell_edges

end module mesoslip_contacts_threshold_laws_uniform
