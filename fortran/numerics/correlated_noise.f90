!> Density of residuals under white and exponentially correlated noise that is averaged over points.
!>
!> A point is the mean of its samples, which lie between two times. The correlation of two points
!> decays by one factor from each to the next. Subtracting the residual before, times this factor,
!> leaves correlations of neighbours only: a tridiagonal matrix.
module mesoslip_numerics_correlated_noise
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: log_density

   !> Length of a point over the correlation time below which means are series
   real(wp), parameter :: short = 0.02_wp
   !> Minimum of this length
   real(wp), parameter :: min_length = 1.0e-9_wp
   !> Number of pivots whose product does not underflow
   integer, parameter :: block = 8

contains

   !> Logarithm of the normal density of residuals, up to a constant; minus infinity (-huge) if the
   !> covariance is not positive.
   pure function log_density(start, end, count, residual, deviation, share, time) result(density)
      !> Start and end of each point, its number of samples, and its residual
      real(wp), intent(in) :: start(:), end(:), count(:), residual(:)
      !> Standard deviation of a sample, share of the correlated noise in its variance
      real(wp), intent(in) :: deviation, share
      !> Correlation time
      real(wp), intent(in) :: time
      real(wp) :: density

      real(wp) :: rate, length, decay, gap, mean, square, before, diagonal_before
      real(wp) :: diagonal, beside, factor, off, pivot, ratio, rest, product
      real(wp) :: end_before, residual_before
      integer :: i

      density = 0.0_wp
      rate = 1.0_wp / time
      product = 1.0_wp
      before = 0.0_wp
      decay = 0.0_wp
      diagonal_before = 0.0_wp
      pivot = 1.0_wp
      rest = 0.0_wp
      end_before = 0.0_wp
      residual_before = 0.0_wp
      do i = 1, size(start)
         length = max((end(i) - start(i)) * rate, min_length)
         call means(length, mean, square)
         diagonal = share * square + (1.0_wp - share) / count(i)
         factor = 0.0_wp
         off = 0.0_wp
         ratio = diagonal
         if (i > 1) then
            gap = exp(-max(start(i) - end_before, 0.0_wp) * rate)
            beside = share * mean * before * gap
            factor = mean / before * gap * decay
            off = beside - factor * diagonal_before
            ratio = diagonal + factor * (factor * diagonal_before - 2.0_wp * beside)
            rest = -factor * residual_before - off / pivot * rest
         end if
         rest = rest + residual(i)
         pivot = ratio - off**2 / pivot
         if (.not. pivot > 0.0_wp) then
            density = -huge(1.0_wp)
            return
         end if
         density = density + rest**2 / (pivot * deviation**2)
         product = product * pivot
         if (mod(i, block) == 0) then
            density = density + log(product)
            product = 1.0_wp
         end if
         before = mean
         decay = 1.0_wp - length * mean
         diagonal_before = diagonal
         end_before = end(i)
         residual_before = residual(i)
      end do
      density = -0.5_wp * (density + log(product)) - size(start) * log(deviation)
   end function log_density

   !> Mean of the correlation from an end of a point, and over all pairs of its times
   elemental subroutine means(length, mean, square)
      !> Length of the point over the correlation time
      real(wp), intent(in) :: length
      !> (1 - exp(-length))/length, and 2 (1 - that)/length
      real(wp), intent(out) :: mean, square

      if (length < short) then
         square = 1.0_wp - length * (1.0_wp / 3 - length * (1.0_wp / 12 - length / 60))
         mean = 1.0_wp - 0.5_wp * length * square
      else
         mean = (1.0_wp - exp(-length)) / length
         square = 2.0_wp * (1.0_wp - mean) / length
      end if
   end subroutine means

end module mesoslip_numerics_correlated_noise
