!> Weibull's law.
module mesoslip_contacts_threshold_laws_weibull
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_threshold_laws_base, only: take_relative_width, threshold_law_type
   implicit none
   private

   public :: weibull_law_type

   !> Weibull's law.
   type, extends(threshold_law_type) :: weibull_law_type
      !> Scale lambda, and shape
      real(wp), private :: scale = 0.0_wp, shape = 1.0_wp
   contains
      procedure :: take
      procedure :: plain_quantile
      procedure :: plain_density
      procedure :: plain_survival
   end type weibull_law_type

contains

   !> Take the parameters of the law.
   subroutine take(self, parameters, error)
      !> The law
      class(weibull_law_type), intent(inout) :: self
      !> Its relative width, by name
      type(parameters_type), intent(inout) :: parameters
      !> Set if the width is missing or not positive
      type(error_type), allocatable, intent(inout) :: error

      call take_relative_width(self, parameters, error)
      if (allocated(error)) return
      self%shape = shape_of(self%width)
      self%scale = exp(-log_gamma(1.0_wp + 1.0_wp / self%shape))
      self%is_logarithmic = .true.
   end subroutine take

   !> Threshold that is exceeded with a given probability, before rejection.
   pure function plain_quantile(self, argument) result(value)
      !> The law
      class(weibull_law_type), intent(in) :: self
      !> Probability to exceed the threshold
      real(wp), intent(in) :: argument
      !> Relative threshold
      real(wp) :: value

      value = self%scale * (-log(argument))**(1.0_wp / self%shape)
   end function plain_quantile

   !> Probability density before rejection.
   pure function plain_density(self, argument) result(value)
      !> The law
      class(weibull_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability density
      real(wp) :: value

      real(wp) :: z

      z = argument / self%scale
      value = self%shape / self%scale * z**(self%shape - 1.0_wp) * exp(-z**self%shape)
   end function plain_density

   !> Survival function before rejection.
   pure function plain_survival(self, argument) result(value)
      !> The law
      class(weibull_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: argument
      !> Probability to exceed it
      real(wp) :: value

      value = 1.0_wp
      if (argument > 0.0_wp) value = exp(-(argument / self%scale)**self%shape)
   end function plain_survival

   !> Shape of the law of a given relative width, by bisection.
   pure function shape_of(width) result(shape)
      real(wp), intent(in) :: width
      real(wp) :: shape

      real(wp) :: lower, upper
      integer :: iteration

      ! The squared width is Gamma(1 + 2/shape)/Gamma(1 + 1/shape)**2 - 1 and falls with the shape.
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
