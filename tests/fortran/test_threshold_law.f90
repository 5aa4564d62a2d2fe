!> Threshold laws: mean and width, and the three functions of a law against each other.
program test_threshold_law
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_threshold_law, only: inverse_normal, law_exponential, law_gaussian, &
      & law_lognormal, law_uniform, law_weibull, new_threshold_law, threshold_law_type
   use testing, only: check, check_close, finish
   implicit none

   integer, parameter :: laws(5) = [law_gaussian, law_uniform, law_lognormal, law_weibull, &
      & law_exponential]
   character(len=11), parameter :: names(5) = [character(len=11) :: "gaussian", "uniform", &
      & "lognormal", "Weibull", "exponential"]
   real(wp), parameter :: widths(3) = [0.01_wp, 0.1_wp, 0.2_wp]
   type(threshold_law_type) :: law
   type(error_type), allocatable :: error
   integer :: kind, width

   do kind = 1, size(laws)
      do width = 1, size(widths)
         call new_threshold_law(law, laws(kind), widths(width), 0.0_wp, error)
         call check(.not. allocated(error), "a law: " // names(kind))
         call moments(law, widths(width), trim(names(kind)))
         call consistency(law, trim(names(kind)))
         call new_threshold_law(law, laws(kind), widths(width), 0.8_wp, error)
         call consistency(law, trim(names(kind)) // " above a minimum")
         call check(law%quantile(1.0_wp - 2.0_wp**(-53)) > 0.8_wp, "thresholds exceed the minimum")
      end do
   end do

   call several()

   call check_close(inverse_normal(0.975_wp), 1.959963984540054_wp, 1.0e-15_wp, "normal quantile")
   call check_close(inverse_normal(1.0e-20_wp), -9.262340089798408_wp, 1.0e-14_wp, "far quantile")

   call new_threshold_law(law, law_gaussian, 0.0_wp, 0.0_wp, error)
   call check(allocated(error), "a width of zero is refused")
   call new_threshold_law(law, 99, 0.1_wp, 0.0_wp, error)
   call check(allocated(error), "an unknown law is refused")
   call finish()

contains

   !> Quantiles of several probabilities are those of each to the bit, in the tails too.
   subroutine several()
      integer, parameter :: number = 1001
      real(wp) :: probability(number), threshold(number)
      integer :: place, kind

      probability = [(real(place, wp) / (number + 1), place=1, number)]**3
      do kind = 1, size(laws)
         call new_threshold_law(law, laws(kind), 0.3_wp, 0.2_wp, error)
         call law%quantiles(probability, threshold)
         call check(all(abs(threshold - law%quantile(probability)) <= 0.0_wp), &
            & "quantiles of several probabilities: " // names(kind))
      end do
   end subroutine several

   !> Mean and standard deviation, integrated over the quantiles.
   subroutine moments(law, width, name)
      type(threshold_law_type), intent(in) :: law
      real(wp), intent(in) :: width
      character(len=*), intent(in) :: name

      integer, parameter :: points = 200000
      real(wp) :: threshold, mean, square
      integer :: point

      mean = 0.0_wp
      square = 0.0_wp
      do point = 1, points
         threshold = law%quantile((point - 0.5_wp) / points)
         mean = mean + threshold / points
         square = square + (threshold - 1.0_wp)**2 / points
      end do
      call check_close(mean, 1.0_wp, 1.0e-4_wp, "mean: " // name)
      call check_close(sqrt(square), width, 1.0e-2_wp * width, "width: " // name)
   end subroutine moments

   !> The survival function inverts the quantiles, and the density is its slope.
   subroutine consistency(law, name)
      type(threshold_law_type), intent(in) :: law
      character(len=*), intent(in) :: name

      real(wp), parameter :: probability(5) = [0.999_wp, 0.8_wp, 0.5_wp, 0.1_wp, 1.0e-4_wp]
      real(wp) :: threshold, slope, change
      integer :: point

      do point = 1, size(probability)
         threshold = law%quantile(probability(point))
         call check_close(law%survival(threshold), probability(point), &
            & 1.0e-12_wp / law%width, "survival: " // name)
         change = 1.0e-5_wp * law%width
         slope = (law%survival(threshold - change) - law%survival(threshold + change)) &
            & / (2.0_wp * change)
         call check_close(law%density(threshold) / slope, 1.0_wp, 1.0e-4_wp, "density: " // name)
      end do
   end subroutine consistency

end program test_threshold_law
