!> Threshold laws: mean and width, and the three functions of a law against each other.
program test_threshold_law
   use mesoslip_contacts_carried_law, only: carried_law_type, new_carried_law
   use mesoslip_contacts_mechanics, only: breaking_distance, coupling_equal, coupling_scaled
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_partial_moments, only: new_partial_moments, partial_moments_type
   use mesoslip_contacts_threshold_laws, only: law_names, make_threshold_law, new_threshold_law
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use mesoslip_contacts_threshold_laws_gaussian, only: inverse_normal
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use testing, only: check, check_close, finish
   implicit none

   real(wp), parameter :: widths(3) = [0.01_wp, 0.1_wp, 0.2_wp]
   real(wp), parameter :: wide(4) = [1.0e-4_wp, 0.1_wp, 0.55_wp, 1.0_wp]
   class(threshold_law_type), allocatable :: law
   type(error_type), allocatable :: error
   integer :: kind, width

   do kind = 1, size(law_names)
      if (law_names(kind) == "table") cycle
      do width = 1, size(widths)
         call new_threshold_law(law, law_names(kind), widths(width), 0.0_wp, error)
         call check(.not. allocated(error), "a law: " // law_names(kind))
         call moments(law, widths(width), trim(law_names(kind)))
         call consistency(law, trim(law_names(kind)))
         call new_threshold_law(law, law_names(kind), widths(width), 0.8_wp, error)
         call consistency(law, trim(law_names(kind)) // " above a minimum")
         call check(law%quantile(1.0_wp - 2.0_wp**(-53)) > 0.8_wp, "thresholds exceed the minimum")
      end do
      do width = 1, size(wide)
         if (law_names(kind) == "uniform" .and. wide(width) > 0.57_wp) cycle
         if (law_names(kind) == "exponential" .and. wide(width) > 1.0_wp) cycle
         call carried(law_names(kind), wide(width), 0.0_wp, "")
         call carried(law_names(kind), wide(width), 0.5_wp, " above a minimum")
      end do
   end do

   call several()
   call table()

   call check_close(inverse_normal(0.975_wp), 1.959963984540054_wp, 1.0e-15_wp, "normal quantile")
   call check_close(inverse_normal(1.0e-20_wp), -9.262340089798408_wp, 1.0e-14_wp, "far quantile")

   call new_threshold_law(law, "gaussian", 0.0_wp, 0.0_wp, error)
   call check(allocated(error), "a width of zero is refused")
   call new_threshold_law(law, "unheard", 0.1_wp, 0.0_wp, error)
   call check(allocated(error), "an unknown law is refused")
   call finish()

contains

   !> Quantiles of several probabilities are those of each to the bit, in the tails too.
   subroutine several()
      integer, parameter :: number = 1001
      real(wp) :: probability(number), threshold(number)
      real(wp), allocatable :: asked(:)
      integer :: place, kind, length
      logical :: agree

      probability = [(real(place, wp) / (number + 1), place=1, number)]**3
      do kind = 1, size(law_names)
         if (law_names(kind) == "table") cycle
         call new_threshold_law(law, law_names(kind), 0.3_wp, 0.2_wp, error)
         call law%quantiles(probability, threshold)
         call check(all(abs(threshold - law%quantile(probability)) <= 0.0_wp), &
            & "quantiles of several probabilities: " // law_names(kind))
         ! From the tail at small probabilities through the middle to the other tail.
         agree = .true.
         do length = 1, 70
            threshold = -1.0_wp
            asked = probability([(14 * place, place=1, length)])
            call law%quantiles(asked, threshold(:length))
            agree = agree .and. all(abs(threshold(:length) - law%quantile(asked)) <= 0.0_wp)
            agree = agree .and. all(threshold(length + 1:) < 0.0_wp)
         end do
         call check(agree, "quantiles of 1 to 70 probabilities: " // law_names(kind))
      end do
   end subroutine several

   !> A table: its functions, its width, and partial moments that add up cell by cell.
   subroutine table()
      real(wp), parameter :: edge(4) = [0.2_wp, 0.8_wp, 1.0_wp, 1.8_wp]
      real(wp), parameter :: weight(3) = [0.3_wp, 0.4_wp, 0.3_wp]
      real(wp), parameter :: exponent(5) = [0.0_wp, 0.5_wp, -0.5_wp, -1.0_wp, 2.0_wp]
      real(wp), parameter :: minimum = 0.5_wp, threshold = 0.9_wp
      type(parameters_type) :: parameters
      type(partial_moments_type) :: moments
      real(wp) :: expected(size(exponent)), found(size(exponent)), mean, stretch
      integer :: sample
      integer, parameter :: samples = 200000

      mean = sum(weight * 0.5_wp * (edge(:3) + edge(2:)))
      call new_parameters(parameters, [("threshold_edges  ", sample=1, 4), &
         & ("threshold_weights", sample=1, 3)], [edge / mean, weight])
      call make_threshold_law(law, "table", parameters, 0.0_wp, error)
      call check(.not. allocated(error), "a law of a table")
      call consistency(law, "table")
      call check_close(law%quantile(0.3_wp + 0.4_wp * 0.25_wp), 0.95_wp / mean, 1.0e-14_wp, &
         & "a quantile within a cell")
      stretch = sqrt(sum(weight * (edge(:3)**2 + edge(:3) * edge(2:) + edge(2:)**2)) / 3.0_wp &
         & / mean**2 - 1.0_wp)
      call check_close(law%width, stretch, 1.0e-14_wp, "the width of a table")

      call make_threshold_law(law, "table", parameters, minimum, error)
      call consistency(law, "table above a minimum")
      call new_partial_moments(moments, law, exponent)
      expected = 0.0_wp
      do sample = 1, samples
         associate (one => law%quantile((sample - 0.5_wp) / samples))
            if (one > threshold) expected = expected + one**exponent / samples
         end associate
      end do
      found = moments%above(threshold)
      call check(all(abs(found - expected) < 2.0e-5_wp), "partial moments of a table")
      call moments%interpolate(threshold, expected)
      call check(all(abs(found - expected) <= 0.0_wp), "partial moments of a table, once more")
      call check_close(sum(moments%above(0.0_wp) * [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), &
         & 1.0_wp, 0.0_wp, "all of a table")

      call new_parameters(parameters, [character(len=17) :: "threshold_edges", "threshold_edges", &
         & "threshold_weights"], [1.5_wp, 0.5_wp, 1.0_wp])
      call make_threshold_law(law, "table", parameters, 0.0_wp, error)
      call check(allocated(error), "edges that descend are refused")
      call new_parameters(parameters, [character(len=17) :: "threshold_edges", "threshold_edges", &
         & "threshold_weights"], [0.5_wp, 2.5_wp, 1.0_wp])
      deallocate (error)
      call make_threshold_law(law, "table", parameters, 0.0_wp, error)
      call check(allocated(error), "a mean that is not 1 is refused")
   end subroutine table

   !> Mean and standard deviation, integrated over the quantiles.
   subroutine moments(law, width, name)
      class(threshold_law_type), intent(in) :: law
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
      class(threshold_law_type), intent(in) :: law
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

   !> Thresholds weighted by the distance to breaking: integrals of the law, closed forms, ends.
   subroutine carried(kind, width, minimum, name)
      character(len=*), intent(in) :: kind
      real(wp), intent(in) :: width, minimum
      character(len=*), intent(in) :: name

      real(wp), parameter :: probability(6) = [1.0_wp - 2.0_wp**(-53), 0.999_wp, 0.7_wp, 0.3_wp, &
         & 1.0e-3_wp, 2.0_wp**(-53)]
      integer, parameter :: couplings(2) = [coupling_equal, coupling_scaled]
      class(threshold_law_type), allocatable :: law
      type(carried_law_type) :: weighted
      type(error_type), allocatable :: error
      real(wp) :: threshold, previous, mean, above, sigma
      integer :: coupling, point

      call new_threshold_law(law, kind, width, minimum, error)
      sigma = sqrt(log(1.0_wp + width**2))
      do coupling = 1, size(couplings)
         call new_carried_law(weighted, law, couplings(coupling), minimum)
         mean = distance_above(law, couplings(coupling), minimum, 1.0_wp)
         previous = 0.0_wp
         do point = 1, size(probability)
            threshold = weighted%quantile(probability(point))
            call check(threshold > max(previous, minimum), &
               & "carried thresholds grow: " // trim(kind) // name)
            previous = threshold
            if (abs(probability(point) - 0.5_wp) > 0.499_wp) cycle
            above = distance_above(law, couplings(coupling), minimum, law%survival(threshold))
            call check_close(above / mean, probability(point), 1.0e-4_wp, &
               & "carried: " // trim(kind) // name)
            if (couplings(coupling) /= coupling_equal) cycle
            select case (kind)
            case ("gaussian")
               call check_close(normal_above(threshold, width, minimum) &
                  & / normal_above(minimum, width, minimum), probability(point), 1.0e-11_wp, &
                  & "closed form of carried: " // trim(kind) // name)
            case ("lognormal")
               call check_close(lognormal_above(threshold, sigma, minimum) &
                  & / lognormal_above(minimum, sigma, minimum), probability(point), &
                  & 1.0e-11_wp, "closed form of carried: " // trim(kind) // name)
            case default
               cycle
            end select
         end do
      end do
   end subroutine carried

   !> Mean distance to breaking of the thresholds above that of a probability, by a sum.
   function distance_above(law, coupling, minimum, probability) result(distance)
      class(threshold_law_type), intent(in) :: law
      integer, intent(in) :: coupling
      real(wp), intent(in) :: minimum, probability
      real(wp) :: distance

      integer, parameter :: points = 20000
      real(wp) :: t
      integer :: point

      distance = 0.0_wp
      do point = 1, points
         ! Denser at the ends, where thresholds are far away or close to zero.
         t = (point - 0.5_wp) / points
         distance = distance + 6.0_wp * t * (1.0_wp - t) / points &
            & * breaking_distance(coupling, minimum, &
            & law%quantile(probability * t**2 * (3.0_wp - 2.0_wp * t)))
      end do
      distance = distance * probability
   end function distance_above

   !> E[u - minimum; u > threshold] of a normal law.
   pure function normal_above(threshold, width, minimum) result(distance)
      real(wp), intent(in) :: threshold, width, minimum
      real(wp) :: distance

      real(wp) :: z

      z = (threshold - 1.0_wp) / width
      distance = width * exp(-0.5_wp * z**2) / sqrt(2.0_wp * acos(-1.0_wp)) &
         & + (1.0_wp - minimum) * 0.5_wp * erfc(z / sqrt(2.0_wp))
   end function normal_above

   !> E[u - minimum; u > threshold] of a lognormal law.
   pure function lognormal_above(threshold, sigma, minimum) result(distance)
      real(wp), intent(in) :: threshold, sigma, minimum
      real(wp) :: distance

      real(wp) :: z

      distance = 1.0_wp - minimum
      if (.not. threshold > 0.0_wp) return
      z = (log(threshold) + 0.5_wp * sigma**2) / sigma
      distance = 0.5_wp * erfc((z - sigma) / sqrt(2.0_wp)) &
         & - minimum * 0.5_wp * erfc(z / sqrt(2.0_wp))
   end function lognormal_above

end program test_threshold_law
