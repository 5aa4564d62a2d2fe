!> Weibull's law.
module mesoslip_contacts_threshold_laws_weibull
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: weibull_law_type

   !> Weibull's law.
   type, extends(threshold_law_type) :: weibull_law_type
      !> Scale lambda, and shape
      real(wp), private :: scale = 0.0_wp, shape = 1.0_wp
   contains
      procedure :: set_constants
      procedure :: plain_quantile, plain_density, plain_survival
   end type weibull_law_type

contains

   subroutine set_constants(self)
      class(weibull_law_type), intent(inout) :: self

      self%shape = shape_of(self%width)
      self%scale = exp(-log_gamma(1.0_wp + 1.0_wp / self%shape))
      self%is_logarithmic = .true.
   end subroutine set_constants

   pure real(wp) function plain_quantile(self, argument) result(value)
      class(weibull_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = self%scale * (-log(argument))**(1.0_wp / self%shape)
   end function plain_quantile

   pure real(wp) function plain_density(self, argument) result(value)
      class(weibull_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      real(wp) :: z

      z = argument / self%scale
      value = self%shape / self%scale * z**(self%shape - 1.0_wp) * exp(-z**self%shape)
   end function plain_density

   pure real(wp) function plain_survival(self, argument) result(value)
      class(weibull_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = 1.0_wp
      if (argument > 0.0_wp) value = exp(-(argument / self%scale)**self%shape)
   end function plain_survival

   !> Shape of the law of a given relative width, by bisection.
   pure function shape_of(width) result(shape)
      real(wp), intent(in) :: width
      real(wp) :: shape

      real(wp) :: lower, upper
      integer :: iteration

      ! The squared width, Gamma(1 + 2/shape)/Gamma(1 + 1/shape)**2 - 1, falls with the shape.
      lower = log(0.05_wp)
      upper = log(1.3_wp / min(width, 1.0_wp) + 1.0_wp)
      do iteration = 1, 100
         shape = exp(0.5_wp * (lower + upper))
         if (log_gamma(1.0_wp + 2.0_wp / shape) - 2.0_wp * log_gamma(1.0_wp + 1.0_wp / shape) &
            & > log(1.0_wp + width**2)) then
            lower = log(shape)
         else
            upper = log(shape)
         end if
      end do
   end function shape_of

end module mesoslip_contacts_threshold_laws_weibull
