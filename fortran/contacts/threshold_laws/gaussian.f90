!> Normal law.
module mesoslip_contacts_threshold_laws_gaussian
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: gaussian_law_type, inverse_normal

   !> Maximum distance of a probability from 1/2 in the middle of the law
   real(wp), parameter :: middle = 0.425_wp

   real(wp), parameter :: sqrt_2 = sqrt(2.0_wp), sqrt_2_pi = sqrt(2.0_wp * acos(-1.0_wp))

   !> Normal law.
   type, extends(threshold_law_type) :: gaussian_law_type
   contains
      procedure :: plain_quantile, plain_density, plain_survival
      procedure :: quantiles
   end type gaussian_law_type

contains

   pure real(wp) function plain_quantile(self, argument) result(value)
      class(gaussian_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = 1.0_wp - self%width * inverse_normal(argument)
   end function plain_quantile

   !> Most normal deviates are in the middle of the law, where the formula has no branch: they are
   !> computed in one vectorized loop, those in the tails one by one.
   pure subroutine quantiles(self, probability, threshold)
      class(gaussian_law_type), intent(in) :: self
      real(wp), intent(in), contiguous :: probability(:)
      real(wp), intent(out), contiguous :: threshold(:)

      integer :: draw, tail, tails, in_tail(size(probability) + 1)
      real(wp) :: centred, min_threshold

      min_threshold = self%min_threshold()
      do draw = 1, size(probability)
         centred = self%acceptance * probability(draw) - 0.5_wp
         threshold(draw) = max(1.0_wp - self%width * middle_normal(centred), min_threshold)
      end do
      ! Listed without a branch, which would be predicted wrongly one time in seven.
      tails = 0
      do draw = 1, size(probability)
         in_tail(tails + 1) = draw
         centred = self%acceptance * probability(draw) - 0.5_wp
         tails = tails + merge(1, 0, abs(centred) > middle)
      end do
      do tail = 1, tails
         threshold(in_tail(tail)) = self%quantile(probability(in_tail(tail)))
      end do
   end subroutine quantiles

   pure real(wp) function plain_density(self, argument) result(value)
      class(gaussian_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      real(wp) :: z

      z = (argument - 1.0_wp) / self%width
      value = exp(-0.5_wp * z**2) / (sqrt_2_pi * self%width)
   end function plain_density

   pure real(wp) function plain_survival(self, argument) result(value)
      class(gaussian_law_type), intent(in) :: self
      real(wp), intent(in) :: argument

      value = 0.5_wp * erfc((argument - 1.0_wp) / (sqrt_2 * self%width))
   end function plain_survival

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
      !> Probability minus 1/2, at most 0.425 in size
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

end module mesoslip_contacts_threshold_laws_gaussian
