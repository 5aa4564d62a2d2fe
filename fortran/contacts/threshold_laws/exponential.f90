!> Shifted exponential law, 1 - width + width e, e being an exponential deviate.
module mesoslip_contacts_threshold_laws_exponential
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: exponential_law_type

   !> Shifted exponential law, 1 - width + width e, e being an exponential deviate.
   type, extends(threshold_law_type) :: exponential_law_type
   contains
      procedure :: plain_quantile, plain_density, plain_survival
   end type exponential_law_type

contains

   pure real(wp) function plain_quantile(self, argument) result(value)
      class(exponential_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = (1.0_wp - self%width) - self%width * log(argument)
   end function plain_quantile

   pure real(wp) function plain_density(self, argument) result(value)
      class(exponential_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      real(wp) :: z

      value = 0.0_wp
      z = (argument - (1.0_wp - self%width)) / self%width
      if (z >= 0.0_wp) value = exp(-z) / self%width
   end function plain_density

   pure real(wp) function plain_survival(self, argument) result(value)
      class(exponential_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = exp(-max(0.0_wp, (argument - (1.0_wp - self%width)) / self%width))
   end function plain_survival

end module mesoslip_contacts_threshold_laws_exponential
