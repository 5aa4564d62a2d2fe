!> Laws of the relative breaking threshold u = f_si/f_s of a contact.
!>
!> Each law has mean 1 and a given relative width (standard deviation over mean) before draws that
!> could not attach, u <= minimum, are rejected. Rejecting is done by inversion: the law that is
!> left is the same as that of drawing again, and one draw consumes one deviate.
module mesoslip_contacts_threshold_law
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   implicit none
   private

   public :: threshold_law_type, new_threshold_law, inverse_normal
   public :: law_gaussian, law_uniform, law_lognormal, law_weibull, law_exponential

   !> Normal law
   integer, parameter :: law_gaussian = 1
   !> Uniform law on 1 +- sqrt(3) width
   integer, parameter :: law_uniform = 2
   !> Law of exp(mu + sigma z)
   integer, parameter :: law_lognormal = 3
   !> Weibull's law
   integer, parameter :: law_weibull = 4
   !> Shifted exponential law, 1 - width + width e
   integer, parameter :: law_exponential = 5

   !> Distance of a probability from one half up to which a deviate is in the middle of the law
   real(wp), parameter :: middle = 0.425_wp

   real(wp), parameter :: sqrt_2 = sqrt(2.0_wp), sqrt_3 = sqrt(3.0_wp)
   real(wp), parameter :: sqrt_2_pi = sqrt(2.0_wp * acos(-1.0_wp))

   !> A law of relative thresholds, conditional on u > minimum.
   type :: threshold_law_type
      !> One of the law_ codes
      integer :: kind = law_gaussian
      !> Standard deviation over mean, before rejection
      real(wp) :: width = 0.0_wp
      !> Thresholds at or below are rejected
      real(wp) :: minimum = 0.0_wp
      !> Probability that a draw is not rejected
      real(wp) :: acceptance = 1.0_wp
      !> Location: mu of the lognormal law
      real(wp) :: location = 1.0_wp
      !> Scale: width, half width, sigma of the lognormal, lambda of Weibull's law
      real(wp) :: scale = 0.0_wp
      !> Shape of Weibull's law
      real(wp) :: shape = 1.0_wp
   contains
      !> Threshold that is exceeded with a given probability
      procedure, non_overridable :: quantile
      !> The same for several probabilities, to the same bits and in less time
      procedure, non_overridable :: quantiles
      !> Probability density
      procedure, non_overridable :: density
      !> Probability to exceed a threshold
      procedure, non_overridable :: survival
      procedure, non_overridable, private :: plain_survival
   end type threshold_law_type

contains

   !> Set up a law.
   subroutine new_threshold_law(self, kind, width, minimum, error)
      !> The law
      type(threshold_law_type), intent(out) :: self
      !> One of the law_ codes
      integer, intent(in) :: kind
      !> Standard deviation over mean, positive
      real(wp), intent(in) :: width
      !> Thresholds at or below are rejected; not negative
      real(wp), intent(in) :: minimum
      !> Set if the law does not exist
      type(error_type), allocatable, intent(out) :: error

      if (.not. width > 0.0_wp) then
         call raise(error, status_invalid, "the relative width of a threshold law must be positive")
         return
      end if
      if (.not. minimum >= 0.0_wp) then
         call raise(error, status_invalid, "the least threshold must not be negative")
         return
      end if

      self%kind = kind
      self%width = width
      self%minimum = minimum
      select case (kind)
      case (law_gaussian)
         self%location = 1.0_wp
         self%scale = width
      case (law_uniform)
         self%location = 1.0_wp
         self%scale = sqrt_3 * width
      case (law_lognormal)
         self%scale = sqrt(log(1.0_wp + width**2))
         self%location = -0.5_wp * self%scale**2
      case (law_weibull)
         self%shape = weibull_shape(width)
         self%scale = exp(-log_gamma(1.0_wp + 1.0_wp / self%shape))
      case (law_exponential)
         self%location = 1.0_wp - width
         self%scale = width
      case default
         call raise(error, status_invalid, "unknown threshold law")
         return
      end select

      self%acceptance = self%plain_survival(minimum)
      if (.not. self%acceptance > 0.0_wp) then
         call raise(error, status_invalid, "no threshold of the law exceeds the back force")
      end if
   end subroutine new_threshold_law

   !> Threshold that is exceeded with a given probability.
   elemental function quantile(self, probability) result(threshold)
      !> The law
      class(threshold_law_type), intent(in) :: self
      !> Probability to exceed the threshold, 0 < probability < 1
      real(wp), intent(in) :: probability
      !> Relative threshold, greater than the law's minimum
      real(wp) :: threshold

      real(wp) :: exceedance

      exceedance = self%acceptance * probability
      select case (self%kind)
      case (law_uniform)
         threshold = 1.0_wp + self%scale * (1.0_wp - 2.0_wp * exceedance)
      case (law_lognormal)
         threshold = exp(self%location - self%scale * inverse_normal(exceedance))
      case (law_weibull)
         threshold = self%scale * (-log(exceedance))**(1.0_wp / self%shape)
      case (law_exponential)
         threshold = self%location - self%scale * log(exceedance)
      case default
         threshold = 1.0_wp - self%scale * inverse_normal(exceedance)
      end select
      threshold = max(threshold, self%minimum + epsilon(1.0_wp) * max(self%minimum, 1.0_wp))
   end function quantile

   !> Thresholds that are exceeded with given probabilities.
   !>
   !> Nearly all normal deviates are from the middle of the law, where no choice is to be made: they
   !> are found side by side, and those of the tails, which are listed, one by one.
   pure subroutine quantiles(self, probability, threshold)
      !> The law
      class(threshold_law_type), intent(in) :: self
      !> Probabilities to exceed the thresholds, 0 < probability < 1
      real(wp), intent(in), contiguous :: probability(:)
      !> Relative thresholds, shape that of probability
      real(wp), intent(out), contiguous :: threshold(:)

      integer :: place, tail, tails, in_tail(size(probability) + 1)
      real(wp) :: centred

      if (self%kind /= law_gaussian) then
         threshold = self%quantile(probability)
         return
      end if
      do place = 1, size(probability)
         centred = self%acceptance * probability(place) - 0.5_wp
         threshold(place) = max(1.0_wp - self%scale * middle_normal(centred), &
            & self%minimum + epsilon(1.0_wp) * max(self%minimum, 1.0_wp))
      end do
      ! Listed without a branch, of which one in seven would be guessed wrong.
      tails = 0
      do place = 1, size(probability)
         in_tail(tails + 1) = place
         centred = self%acceptance * probability(place) - 0.5_wp
         tails = tails + merge(1, 0, abs(centred) > middle)
      end do
      do tail = 1, tails
         threshold(in_tail(tail)) = self%quantile(probability(in_tail(tail)))
      end do
   end subroutine quantiles

   !> Probability density of the thresholds.
   elemental function density(self, threshold)
      !> The law
      class(threshold_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: threshold
      !> Probability density
      real(wp) :: density

      real(wp) :: z

      density = 0.0_wp
      if (threshold <= self%minimum) return
      select case (self%kind)
      case (law_gaussian)
         z = (threshold - 1.0_wp) / self%scale
         density = exp(-0.5_wp * z**2) / (sqrt_2_pi * self%scale)
      case (law_uniform)
         if (abs(threshold - 1.0_wp) <= self%scale) density = 0.5_wp / self%scale
      case (law_lognormal)
         z = (log(threshold) - self%location) / self%scale
         density = exp(-0.5_wp * z**2) / (sqrt_2_pi * self%scale * threshold)
      case (law_weibull)
         z = threshold / self%scale
         density = self%shape / self%scale * z**(self%shape - 1.0_wp) * exp(-z**self%shape)
      case (law_exponential)
         z = (threshold - self%location) / self%scale
         if (z >= 0.0_wp) density = exp(-z) / self%scale
      case default
         return
      end select
      density = density / self%acceptance
   end function density

   !> Probability that a threshold is greater than a given one.
   elemental function survival(self, threshold)
      !> The law
      class(threshold_law_type), intent(in) :: self
      !> Relative threshold
      real(wp), intent(in) :: threshold
      !> Probability
      real(wp) :: survival

      survival = 1.0_wp
      if (threshold > self%minimum) survival = self%plain_survival(threshold) / self%acceptance
   end function survival

   !> Survival function before rejection.
   elemental function plain_survival(self, threshold) result(survival)
      class(threshold_law_type), intent(in) :: self
      real(wp), intent(in) :: threshold
      real(wp) :: survival

      survival = 1.0_wp
      select case (self%kind)
      case (law_gaussian)
         survival = 0.5_wp * erfc((threshold - 1.0_wp) / (sqrt_2 * self%scale))
      case (law_uniform)
         survival = min(1.0_wp, max(0.0_wp, 0.5_wp * (1.0_wp - (threshold - 1.0_wp) / self%scale)))
      case (law_lognormal)
         if (threshold > 0.0_wp) then
            survival = 0.5_wp * erfc((log(threshold) - self%location) / (sqrt_2 * self%scale))
         end if
      case (law_weibull)
         if (threshold > 0.0_wp) survival = exp(-(threshold / self%scale)**self%shape)
      case (law_exponential)
         survival = exp(-max(0.0_wp, (threshold - self%location) / self%scale))
      case default
         return
      end select
   end function plain_survival

   !> Shape of Weibull's law of a given relative width, by bisection.
   pure function weibull_shape(width) result(shape)
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
   end function weibull_shape

   !> Inverse of the standard normal distribution function.
   !>
   !> Algorithm AS 241 (PPND16) of M. J. Wichura, Appl. Statist. 37 (1988) 477; relative accuracy
   !> about 1e-16.
   elemental function inverse_normal(probability) result(z)
      !> Probability, 0 < probability < 1
      real(wp), intent(in) :: probability
      !> The deviate that is not exceeded with this probability
      real(wp) :: z

      real(wp), parameter :: c(0:7) = [ &
         & 1.42343711074968357734e0_wp, 4.63033784615654529590e0_wp, &
         & 5.76949722146069140550e0_wp, 3.64784832476320460504e0_wp, &
         & 1.27045825245236838258e0_wp, 2.41780725177450611770e-1_wp, &
         & 2.27238449892691845833e-2_wp, 7.74545014278341407640e-4_wp]
      real(wp), parameter :: d(7) = [ &
         & 2.05319162663775882187e0_wp, 1.67638483018380384940e0_wp, &
         & 6.89767334985100004550e-1_wp, 1.48103976427480074590e-1_wp, &
         & 1.51986665636164571966e-2_wp, 5.47593808499534494600e-4_wp, &
         & 1.05075007164441684324e-9_wp]
      real(wp), parameter :: e(0:7) = [ &
         & 6.65790464350110377720e0_wp, 5.46378491116411436990e0_wp, &
         & 1.78482653991729133580e0_wp, 2.96560571828504891230e-1_wp, &
         & 2.65321895265761230930e-2_wp, 1.24266094738807843860e-3_wp, &
         & 2.71155556874348757815e-5_wp, 2.01033439929228813265e-7_wp]
      real(wp), parameter :: f(7) = [ &
         & 5.99832206555887937690e-1_wp, 1.36929880922735805310e-1_wp, &
         & 1.48753612908506148525e-2_wp, 7.86869131145613259100e-4_wp, &
         & 1.84631831751005468180e-5_wp, 1.42151175831644588870e-7_wp, &
         & 2.04426310338993978564e-15_wp]
      real(wp) :: centred, r

      centred = probability - 0.5_wp
      if (abs(centred) <= middle) then
         z = middle_normal(centred)
      else
         r = sqrt(-log(min(probability, 1.0_wp - probability)))
         if (r <= 5.0_wp) then
            z = sign(ratio(c, d, r - 1.6_wp), centred)
         else
            z = sign(ratio(e, f, r - 5.0_wp), centred)
         end if
      end if
   end function inverse_normal

   !> Inverse of the standard normal distribution function in the middle of the law.
   elemental function middle_normal(centred) result(z)
      !> Probability less one half, at most 0.425 in size
      real(wp), intent(in) :: centred
      !> The deviate that is not exceeded with this probability
      real(wp) :: z

      real(wp), parameter :: a(0:7) = [ &
         & 3.3871328727963666080e0_wp, 1.3314166789178437745e+2_wp, &
         & 1.9715909503065514427e+3_wp, 1.3731693765509461125e+4_wp, &
         & 4.5921953931549871457e+4_wp, 6.7265770927008700853e+4_wp, &
         & 3.3430575583588128105e+4_wp, 2.5090809287301226727e+3_wp]
      real(wp), parameter :: b(7) = [ &
         & 4.2313330701600911252e+1_wp, 6.8718700749205790830e+2_wp, &
         & 5.3941960214247511077e+3_wp, 2.1213794301586595867e+4_wp, &
         & 3.9307895800092710610e+4_wp, 2.8729085735721942674e+4_wp, &
         & 5.2264952788528545610e+3_wp]

      z = centred * ratio(a, b, 0.180625_wp - centred**2)
   end function middle_normal

   !> Ratio of two polynomials of degree 7, the lower one with constant term 1.
   pure function ratio(upper, lower, x)
      real(wp), intent(in) :: upper(0:7), lower(7), x
      real(wp) :: ratio

      ratio = (((((((upper(7) * x + upper(6)) * x + upper(5)) * x + upper(4)) * x + upper(3)) * x &
         & + upper(2)) * x + upper(1)) * x + upper(0)) &
         & / (((((((lower(7) * x + lower(6)) * x + lower(5)) * x + lower(4)) * x + lower(3)) * x &
         & + lower(2)) * x + lower(1)) * x + 1.0_wp)
   end function ratio

end module mesoslip_contacts_threshold_law
