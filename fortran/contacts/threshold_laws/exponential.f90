!> Shifted exponential law, 1 - width + width e, e being an exponential deviate.
module mesoslip_contacts_threshold_laws_exponential
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_threshold_laws_base, only: take_relative_width, threshold_law_type
   implicit none
   private

   public :: exponential_law_type

   !> Shifted exponential law, 1 - width + width e, e being an exponential deviate.
   type, extends(threshold_law_type) :: exponential_law_type
   contains
      procedure :: take
      procedure :: plain_quantile
      procedure :: plain_density
      procedure :: plain_survival
   end type exponential_law_type

contains

   !> Take the parameters of the law.
   subroutine take(self, parameters, error)
      !> The law
      class(exponential_law_type), intent(inout) :: self
      !> Its relative width, by name
      type(parameters_type), intent(inout) :: parameters
      !> Set if the width is missing or not positive
      type(error_type), allocatable, intent(inout) :: error

      call take_relative_width(self, parameters, error)
   end subroutine take

   !> Threshold that is exceeded with a given probability, before rejection.
   pure function plain_quantile(self, argument) result(value)
      !> The law
      class(exponential_law_type), intent(in) :: self
      !> Probability to exceed the threshold
      real(wp), intent(in) :: argument
      !> Relative threshold
      real(wp) :: value

      value = (1.0_wp - self%width) - self%width * log(argument)
   end function plain_quantile

   !> Probability density before rejection.
   pure function plain_density(self, argument) result(value)
      !> The law
      class(exponential_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability density
      real(wp) :: value

      real(wp) :: z

      value = 0.0_wp
      z = (argument - (1.0_wp - self%width)) / self%width
      if (z >= 0.0_wp) value = exp(-z) / self%width
   end function plain_density

   !> Survival function before rejection.
   pure function plain_survival(self, argument) result(value)
      !> The law
      class(exponential_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability to exceed it
      real(wp) :: value

      value = exp(-max(0.0_wp, (argument - (1.0_wp - self%width)) / self%width))
   end function plain_survival

end module mesoslip_contacts_threshold_laws_exponential
