!> Law of exp(mu + sigma z), z being a normal deviate.
module mesoslip_contacts_threshold_laws_lognormal
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_threshold_laws_base, only: take_relative_width, threshold_law_type
   use mesoslip_contacts_threshold_laws_gaussian, only: inverse_normal
   implicit none
   private

   public :: lognormal_law_type

   real(wp), parameter :: sqrt_2 = sqrt(2.0_wp), sqrt_2_pi = sqrt(2.0_wp * acos(-1.0_wp))

   !> Law of exp(mu + sigma z), z being a normal deviate.
   type, extends(threshold_law_type) :: lognormal_law_type
      !> sigma and mu
      real(wp), private :: sigma = 0.0_wp, mu = 0.0_wp
   contains
      procedure :: take
      procedure :: plain_quantile
      procedure :: plain_density
      procedure :: plain_survival
   end type lognormal_law_type

contains

   !> Take the parameters of the law.
   subroutine take(self, parameters, error)
      !> The law
      class(lognormal_law_type), intent(inout) :: self
      !> Its relative width, by name
      type(parameters_type), intent(inout) :: parameters
      !> Set if the width is missing or not positive
      type(error_type), allocatable, intent(inout) :: error

      call take_relative_width(self, parameters, error)
      self%sigma = sqrt(log(1.0_wp + self%width**2))
      self%mu = -0.5_wp * self%sigma**2
      self%is_logarithmic = .true.
   end subroutine take

   !> Threshold that is exceeded with a given probability, before rejection.
   pure function plain_quantile(self, argument) result(value)
      !> The law
      class(lognormal_law_type), intent(in) :: self
      !> Probability to exceed the threshold
      real(wp), intent(in) :: argument
      !> Relative threshold
      real(wp) :: value

      value = exp(self%mu - self%sigma * inverse_normal(argument))
   end function plain_quantile

   !> Probability density before rejection.
   pure function plain_density(self, argument) result(value)
      !> The law
      class(lognormal_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability density
      real(wp) :: value

      real(wp) :: z

      z = (log(argument) - self%mu) / self%sigma
      value = exp(-0.5_wp * z**2) / (sqrt_2_pi * self%sigma * argument)
   end function plain_density

   !> Survival function before rejection.
   pure function plain_survival(self, argument) result(value)
      !> The law
      class(lognormal_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability to exceed it
      real(wp) :: value

      value = 1.0_wp
      if (argument > 0.0_wp) then
         value = 0.5_wp * erfc((log(argument) - self%mu) / (sqrt_2 * self%sigma))
      end if
   end function plain_survival

end module mesoslip_contacts_threshold_laws_lognormal
