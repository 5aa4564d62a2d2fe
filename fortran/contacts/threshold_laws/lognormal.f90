!> Law of exp(mu + sigma z), z being a normal deviate.
module mesoslip_contacts_threshold_laws_lognormal
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
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
      procedure :: set_constants
      procedure :: plain_quantile, plain_density, plain_survival
   end type lognormal_law_type

contains

   subroutine set_constants(self)
      class(lognormal_law_type), intent(inout) :: self

      self%sigma = sqrt(log(1.0_wp + self%width**2))
      self%mu = -0.5_wp * self%sigma**2
      self%is_logarithmic = .true.
   end subroutine set_constants

   pure real(wp) function plain_quantile(self, argument) result(value)
      class(lognormal_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = exp(self%mu - self%sigma * inverse_normal(argument))
   end function plain_quantile

   pure real(wp) function plain_density(self, argument) result(value)
      class(lognormal_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      real(wp) :: z

      z = (log(argument) - self%mu) / self%sigma
      value = exp(-0.5_wp * z**2) / (sqrt_2_pi * self%sigma * argument)
   end function plain_density

   pure real(wp) function plain_survival(self, argument) result(value)
      class(lognormal_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = 1.0_wp
      if (argument > 0.0_wp) then
         value = 0.5_wp * erfc((log(argument) - self%mu) / (sqrt_2 * self%sigma))
      end if
   end function plain_survival

end module mesoslip_contacts_threshold_laws_lognormal
