!> The master equation under a slider that moves forward, as a renewal equation.
!>
!> Contacts break at the rate Gamma(X) = p_1(X) + integral of Gamma(X') p(X - X') dX', p_1 and p
!> being the densities of breaks in the first generation and of newborns. Collocation at
!> Gauss-Legendre points of equal panels, with the integrals of the kernel over Lagrange polynomials
!> computed once: a block Toeplitz system that is solved panel after panel. As lives are bounded,
!> the work is proportional to the number of panels.
module mesoslip_theory_renewal
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_theory_lives, only: contact_lives_type
   use mesoslip_contacts_mechanics, only: coupling_equal
   use mesoslip_numerics_quadrature, only: barycentric_weights, gauss_legendre, &
      & integration_matrix, lagrange_basis
   implicit none
   private

   public :: renewal_solution_type, solve_renewal

   character(len=*), parameter :: no_memory = "not enough memory for the force curve"

   !> Breaks, and the force of the contacts, on panels of the displacement.
   type :: renewal_solution_type
      !> Points within a panel, shape (points)
      real(wp), allocatable :: point(:)
      !> Breaks over displacement Gamma, slope F' of the force, force F and stiffness K_c at the
      !> points, shape (points, panels)
      real(wp), allocatable :: breaks(:, :), slope(:, :), force(:, :), stiffness(:, :)
      !> Share of pinned contacts at the edges of the panels, shape (panels + 1)
      real(wp), allocatable :: pinned(:)
      !> Maximum difference of the force at the end of a panel when integrated from its start
      real(wp) :: mismatch = 0.0_wp
   end type renewal_solution_type

contains

   !> Solve the renewal equation.
   subroutine solve_renewal(lives, start, width, panels, points, solution, error)
      type(contact_lives_type), intent(in) :: lives
      !> Start of the first panel, at or below the start of the motion at 0; width of the panels
      real(wp), intent(in) :: start, width
      !> Number of panels, and of points in each
      integer, intent(in) :: panels, points
      type(renewal_solution_type), intent(out) :: solution
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      real(wp), allocatable :: kernel(:, :, :, :), released(:, :, :)
      real(wp) :: weight(points), system(points, points), rates(3)
      integer :: first, last, panel, lag, i, kinds, kind, stat

      allocate (solution%point(points), stat=stat)
      if (stat == 0) allocate (solution%breaks(points, panels), stat=stat)
      if (stat == 0) allocate (solution%slope(points, panels), stat=stat)
      if (stat == 0) allocate (solution%force(points, panels), stat=stat)
      if (stat == 0) allocate (solution%stiffness(points, panels), stat=stat)
      if (stat == 0) allocate (solution%pinned(panels + 1), stat=stat)
      if (stat == 0) allocate (released(points, panels, 3), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, no_memory)
         return
      end if
      call gauss_legendre(solution%point, weight)
      ! Equal contacts lose stiffness as they break.
      kinds = 3
      if (lives%coupling == coupling_equal) kinds = 2
      call kernel_blocks(lives, width, panels, solution%point, kinds, kernel, first, last, error)
      if (allocated(error)) return

      ! Rates of breaks, of released force, of lost stiffness.
      do panel = 1, panels
         do i = 1, points
            rates = lives%first_rates(start + (panel - 1 + solution%point(i)) * width)
            released(i, panel, :) = rates
         end do
      end do
      system = 0.0_wp
      if (first == 0) system = -kernel(:, :, 1, 0)
      do i = 1, points
         system(i, i) = system(i, i) + 1.0_wp
      end do
      do panel = 1, panels
         do lag = max(1, first), min(last, panel - 1)
            released(:, panel, 1) = released(:, panel, 1) &
               & + matmul(kernel(:, :, 1, lag), released(:, panel - lag, 1))
         end do
         if (first == 0) released(:, panel, 1) = solved(system, released(:, panel, 1))
         do kind = 2, kinds
            do lag = first, min(last, panel - 1)
               released(:, panel, kind) = released(:, panel, kind) &
                  & + matmul(kernel(:, :, kind, lag), released(:, panel - lag, 1))
            end do
         end do
         if (kinds == 2) released(:, panel, 3) = released(:, panel, 1)
      end do

      call bear(lives, start, width, weight, released, solution, error)
      solution%breaks = released(:, :, 1)
   end subroutine solve_renewal

   !> Integrals of the kernels over the Lagrange polynomials of earlier panels, by their lag.
   subroutine kernel_blocks(lives, width, panels, point, kinds, kernel, first, last, error)
      type(contact_lives_type), intent(in) :: lives
      real(wp), intent(in) :: width
      integer, intent(in) :: panels
      !> Points within a panel, shape (points)
      real(wp), intent(in) :: point(:)
      !> Number of kernels: breaks, released force, lost stiffness
      integer, intent(in) :: kinds
      !> Blocks, shape (points, points, kinds, lags)
      real(wp), allocatable, intent(out) :: kernel(:, :, :, :)
      !> Lags of the first block and the last
      integer, intent(out) :: first, last
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: node(2 * size(point)), weight(2 * size(point)), barycentric(size(point))
      real(wp) :: edge(4), rates(3), basis(size(point)), length, t
      integer :: lag, i, j, piece, kind, stat

      first = max(0, int(lives%shortest / width) - 1)
      last = min(panels - 1, int(lives%longest / width) + 2)
      call gauss_legendre(node, weight)
      barycentric = barycentric_weights(point)
      allocate (kernel(size(point), size(point), kinds, first:last), source=0.0_wp, stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, no_memory)
         return
      end if
      do lag = first, last
         do i = 1, size(point)
            ! The kernel at (lag + point - t) width is not smooth at the ends of the lives.
            edge(1) = 0.0_wp
            edge(2) = point(i) + lag - lives%longest / width
            edge(3) = point(i) + lag - lives%shortest / width
            edge(4) = min(1.0_wp, point(i) + lag)
            edge(2:3) = min(edge(4), max(0.0_wp, edge(2:3)))
            do piece = 1, 3
               length = edge(piece + 1) - edge(piece)
               if (length <= 0.0_wp) cycle
               do j = 1, size(node)
                  t = edge(piece) + length * node(j)
                  rates = width * length * weight(j) &
                     & * lives%newborn_rates((lag + point(i) - t) * width)
                  basis = lagrange_basis(point, barycentric, t)
                  do kind = 1, kinds
                     kernel(i, :, kind, lag) = kernel(i, :, kind, lag) + rates(kind) * basis
                  end do
               end do
            end do
         end do
      end do
   end subroutine kernel_blocks

   !> Force on the contacts: at the edges of panels from all that attached, between by rates.
   subroutine bear(lives, start, width, weight, released, solution, error)
      type(contact_lives_type), intent(in) :: lives
      real(wp), intent(in) :: start, width
      !> Weights of the points of a panel, shape (points)
      real(wp), intent(in) :: weight(:)
      !> Rates of breaks, of released force and of lost stiffness, shape (points, panels, 3)
      real(wp), intent(in) :: released(:, :, :)
      type(renewal_solution_type), intent(inout) :: solution
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: matrix(size(weight), size(weight)), state(3), whole, age
      real(wp), allocatable :: left(:, :, :)
      integer :: points, panels, panel, lag, lags, young, i, stat

      points = size(released, 1)
      panels = size(released, 2)
      matrix = width * integration_matrix(solution%point)
      lags = min(panels, int(lives%longest / width) + 2)
      ! Contacts that attached in the last young panels are all pinned.
      young = min(lags, int(lives%shortest / width))
      allocate (left(points, 3, young + 1:lags), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, no_memory)
         return
      end if
      do lag = young + 1, lags
         do i = 1, points
            left(i, :, lag) = width * weight(i) &
               & * lives%newborn_state((lag - solution%point(i)) * width)
         end do
      end do

      ! Number of these contacts, and sum of their ages.
      whole = 0.0_wp
      age = 0.0_wp
      do panel = 1, panels + 1
         state = lives%first_state(start + (panel - 1) * width)
         do lag = young + 1, min(lags, panel - 1)
            do i = 1, 3
               state(i) = state(i) + dot_product(left(:, i, lag), released(:, panel - lag, 1))
            end do
         end do
         if (young > 0 .and. panel > 1) then
            age = age + width * whole
            call count_young(1, 1.0_wp)
            if (panel > young + 1) call count_young(young + 1, -1.0_wp)
         end if
         state = state + [whole, lives%newborn_stiffness * whole, &
            & lives%newborn_force * whole + lives%newborn_stiffness * age]
         solution%pinned(panel) = state(1)
         if (panel > 1) then
            solution%mismatch = max(solution%mismatch, abs(state(3) - solution%force(1, panel - 1) &
               & - width * dot_product(weight, solution%slope(:, panel - 1))))
            solution%force(:, panel - 1) = solution%force(1, panel - 1) &
               & + matmul(matrix, solution%slope(:, panel - 1))
         end if
         if (panel > panels) exit
         solution%stiffness(:, panel) = state(2) + matmul(matrix, &
            & lives%newborn_stiffness * released(:, panel, 1) - released(:, panel, 3))
         solution%slope(:, panel) = solution%stiffness(:, panel) &
            & + lives%newborn_force * released(:, panel, 1) - released(:, panel, 2)
         solution%force(:, panel) = state(3)
      end do

   contains

      !> Add the contacts that attached some panels back to the young ones, or remove them.
      subroutine count_young(lag, sign_of_change)
         integer, intent(in) :: lag
         real(wp), intent(in) :: sign_of_change

         associate (attached => width * weight * released(:, panel - lag, 1))
            whole = whole + sign_of_change * sum(attached)
            age = age + sign_of_change * width * sum((lag - solution%point) * attached)
         end associate
      end subroutine count_young

   end subroutine bear

   !> Solution of a small linear system whose matrix is close to the identity.
   pure function solved(matrix, right) result(x)
      !> Shape (n, n)
      real(wp), intent(in) :: matrix(:, :)
      !> Right side, shape (n)
      real(wp), intent(in) :: right(:)
      real(wp) :: x(size(right))

      real(wp) :: work(size(right), size(right)), factor
      integer :: row, pivot

      work = matrix
      x = right
      do pivot = 1, size(x)
         do row = pivot + 1, size(x)
            factor = work(row, pivot) / work(pivot, pivot)
            work(row, pivot + 1:) = work(row, pivot + 1:) - factor * work(pivot, pivot + 1:)
            x(row) = x(row) - factor * x(pivot)
         end do
      end do
      do row = size(x), 1, -1
         x(row) = (x(row) - dot_product(work(row, row + 1:), x(row + 1:))) / work(row, row)
      end do
   end function solved

end module mesoslip_theory_renewal
