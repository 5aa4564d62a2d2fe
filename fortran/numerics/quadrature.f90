!> Gauss-Legendre rules and the interpolation through their points.
module mesoslip_numerics_quadrature
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: gauss_legendre, barycentric_weights, lagrange_basis, integration_matrix

contains

   !> Points and weights of the Gauss-Legendre rule on [0, 1], by Newton's method.
   pure subroutine gauss_legendre(point, weight)
      !> Points in increasing order, any number of them
      real(wp), intent(out) :: point(:)
      !> Weights, shape of the points
      real(wp), intent(out) :: weight(:)

      integer, parameter :: max_iterations = 20
      real(wp), parameter :: pi = acos(-1.0_wp)
      real(wp) :: x, last, before, next, slope, change
      integer :: order, root, degree, iteration

      order = size(point)
      do root = 1, order
         x = -cos(pi * (root - 0.25_wp) / (order + 0.5_wp))
         slope = 1.0_wp
         do iteration = 1, max_iterations
            before = 0.0_wp
            last = 1.0_wp
            do degree = 1, order
               next = ((2 * degree - 1) * x * last - (degree - 1) * before) / degree
               before = last
               last = next
            end do
            slope = order * (x * last - before) / (x**2 - 1.0_wp)
            change = last / slope
            x = x - change
            if (abs(change) <= 2.0_wp * epsilon(1.0_wp)) exit
         end do
         point(root) = 0.5_wp * (1.0_wp + x)
         weight(root) = 1.0_wp / ((1.0_wp - x**2) * slope**2)
      end do
   end subroutine gauss_legendre

   !> Weights of the barycentric formula of the polynomial through some points.
   pure function barycentric_weights(point) result(weight)
      !> Points, all different
      real(wp), intent(in) :: point(:)
      !> Weights, shape of the points
      real(wp) :: weight(size(point))

      integer :: i, j

      weight = 1.0_wp
      do i = 1, size(point)
         do j = 1, size(point)
            if (j /= i) weight(i) = weight(i) / (point(i) - point(j))
         end do
      end do
   end function barycentric_weights

   !> Values of the Lagrange polynomials of some points.
   pure function lagrange_basis(point, barycentric, x) result(value)
      !> Points, and their barycentric weights
      real(wp), intent(in) :: point(:), barycentric(:)
      !> Where
      real(wp), intent(in) :: x
      !> Value of each polynomial, shape of the points
      real(wp) :: value(size(point))

      integer :: i

      do i = 1, size(point)
         if (abs(x - point(i)) <= 0.0_wp) then
            value = 0.0_wp
            value(i) = 1.0_wp
            return
         end if
      end do
      value = barycentric / (x - point)
      value = value / sum(value)
   end function lagrange_basis

   !> Integrals of the Lagrange polynomials of some points in [0, 1] from 0 to each point.
   pure function integration_matrix(point) result(matrix)
      !> Points
      real(wp), intent(in) :: point(:)
      !> Integral from 0 to point i of polynomial k, shape (points, points)
      real(wp) :: matrix(size(point), size(point))

      real(wp) :: node(size(point)), weight(size(point)), barycentric(size(point))
      integer :: i, k

      call gauss_legendre(node, weight)
      barycentric = barycentric_weights(point)
      matrix = 0.0_wp
      do i = 1, size(point)
         do k = 1, size(node)
            matrix(i, :) = matrix(i, :) + point(i) * weight(k) &
               & * lagrange_basis(point, barycentric, point(i) * node(k))
         end do
      end do
   end function integration_matrix

end module mesoslip_numerics_quadrature
