!> Partial moments of a threshold law, E[u^a; u > U]: those of contacts that have not broken at U.
module mesoslip_contacts_partial_moments
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_quadrature, only: gauss_legendre
   use mesoslip_contacts_stretch_cells, only: cell_of
   use mesoslip_contacts_threshold_coordinate, only: new_threshold_coordinate, &
      & threshold_coordinate_type
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   private

   public :: partial_moments_type, new_partial_moments

   !> Cells of the table, and points of the rule in a cell
   integer, parameter :: cells = 4096, points = 8
   !> Probability that a threshold is above the table
   real(wp), parameter :: outside = 1.0e-17_wp

   !> Partial moments of some orders.
   type :: partial_moments_type
      !> Range of the thresholds
      real(wp) :: min_threshold = 0.0_wp, max_threshold = 0.0_wp
      class(threshold_law_type), allocatable, private :: law
      !> Coordinate in which the table is uniform, its start and its step
      type(threshold_coordinate_type) :: coordinate
      real(wp), private :: first = 0.0_wp, step = 1.0_wp
      !> Correction of the density for thresholds outside the table
      real(wp), private :: scale = 1.0_wp
      real(wp), private :: point(points) = 0.0_wp, weight(points) = 0.0_wp
      !> Exponents, shape (orders), and their numbers of halves, huge for others
      real(wp), allocatable, private :: exponent(:)
      integer, allocatable, private :: halves(:)
      !> Moments above each knot and their slopes, shape (orders, 2, cells + 1)
      real(wp), allocatable, private :: table(:, :, :)
      !> For a law with a constant density in cells, instead of a table: edges of the cells, density
      !> in each, and moments above each edge, shape (orders, edges)
      real(wp), allocatable :: edge(:), cell_density(:)
      real(wp), allocatable, private :: above_edge(:, :)
   contains
      !> Moments above a threshold: to rounding, and by interpolation to about 1e-12
      procedure, non_overridable :: above, interpolate
      procedure, non_overridable, private :: density, sum_cells, above_in_cells
   end type partial_moments_type

contains

   !> Tabulate the partial moments of a law.
   subroutine new_partial_moments(self, law, exponent)
      type(partial_moments_type), intent(out) :: self
      !> The law
      class(threshold_law_type), intent(in) :: law
      !> Exponents a, shape (orders)
      real(wp), intent(in) :: exponent(:)

      real(wp) :: knot
      integer :: cell, node

      allocate (self%law, source=law)
      self%exponent = exponent
      self%halves = merge(nint(2.0_wp * exponent), huge(1), &
         & .not. abs(2.0_wp * exponent - nint(2.0_wp * exponent)) > 0.0_wp)
      self%min_threshold = law%quantile(1.0_wp - epsilon(1.0_wp))
      self%max_threshold = law%quantile(outside)
      if (law%cells > 0) then
         call self%sum_cells()
         return
      end if
      self%coordinate = new_threshold_coordinate(law%is_logarithmic, self%min_threshold)
      self%first = self%coordinate%at(self%min_threshold)
      self%step = (self%coordinate%at(self%max_threshold) - self%first) / cells
      call gauss_legendre(self%point, self%weight)

      allocate (self%table(size(exponent), 2, cells + 1))
      self%table(:, 1, cells + 1) = 0.0_wp
      do cell = cells, 1, -1
         knot = self%first + (cell - 1) * self%step
         self%table(:, 1, cell) = self%table(:, 1, cell + 1)
         do node = 1, points
            self%table(:, 1, cell) = self%table(:, 1, cell) + self%step * self%weight(node) &
               & * self%density(knot + self%step * self%point(node))
         end do
      end do
      ! The total is exactly 1: the number of contacts must not decay as they attach over and over.
      do node = 1, size(exponent)
         if (abs(exponent(node)) > 0.0_wp) cycle
         self%scale = 1.0_wp / self%table(node, 1, 1)
         self%table(:, 1, :) = self%table(:, 1, :) * self%scale
         exit
      end do
      do cell = 1, cells + 1
         ! Slopes from within the support, at whose ends the density may be discontinuous.
         knot = self%first + min(max(cell - 1.0_wp, 1.0e-9_wp), cells - 1.0e-9_wp) * self%step
         self%table(:, 2, cell) = -self%step * self%density(knot)
      end do
   end subroutine new_partial_moments

   !> Sum the moments of a law with a constant density in cells.
   subroutine sum_cells(self)
      class(partial_moments_type), intent(inout) :: self

      integer :: cell, order

      associate (all => self%law%cell_edges())
         self%edge = [self%min_threshold, &
            & pack(all, all > self%min_threshold .and. all < self%max_threshold), &
            & self%max_threshold]
      end associate
      associate (cells => size(self%edge) - 1)
         self%cell_density = self%law%density(0.5_wp * (self%edge(:cells) + self%edge(2:)))
         allocate (self%above_edge(size(self%exponent), cells + 1), source=0.0_wp)
         do cell = cells, 1, -1
            self%above_edge(:, cell) = self%above_edge(:, cell + 1) + self%cell_density(cell) &
               & * power_integral(self%exponent, self%edge(cell), self%edge(cell + 1))
         end do
      end associate
      ! The total is exactly 1, as for other laws.
      do order = 1, size(self%exponent)
         if (abs(self%exponent(order)) > 0.0_wp) cycle
         self%scale = 1.0_wp / self%above_edge(order, 1)
         self%cell_density = self%scale * self%cell_density
         self%above_edge = self%scale * self%above_edge
         self%above_edge(order, 1) = 1.0_wp
         exit
      end do
   end subroutine sum_cells

   !> Moments above a threshold of a law with a constant density in cells.
   pure subroutine above_in_cells(self, threshold, moment)
      class(partial_moments_type), intent(in) :: self
      !> Less than the maximum
      real(wp), intent(in) :: threshold
      real(wp), intent(out) :: moment(:)

      integer :: cell

      if (threshold <= self%min_threshold) then
         moment = self%above_edge(:, 1)
         return
      end if
      cell = cell_of(self%edge, threshold, 1.0_wp)
      moment = self%above_edge(:, cell + 1) + self%cell_density(cell) &
         & * power_integral(self%exponent, threshold, self%edge(cell + 1))
   end subroutine above_in_cells

   !> Integral of a power between two positive limits.
   elemental function power_integral(exponent, lower, upper) result(integral)
      real(wp), intent(in) :: exponent, lower, upper
      real(wp) :: integral

      if (abs(exponent) > 0.0_wp) then
         if (abs(exponent + 1.0_wp) > 0.0_wp) then
            integral = (upper**(exponent + 1.0_wp) - lower**(exponent + 1.0_wp)) &
               & / (exponent + 1.0_wp)
         else
            integral = log(upper / lower)
         end if
      else
         integral = upper - lower
      end if
   end function power_integral

   !> Density of each moment over the coordinate of the table.
   pure function density(self, coordinate)
      class(partial_moments_type), intent(in) :: self
      real(wp), intent(in) :: coordinate
      real(wp) :: density(size(self%exponent))

      real(wp) :: threshold, root

      threshold = self%coordinate%threshold(coordinate)
      root = sqrt(threshold)
      density = self%scale * self%law%density(threshold) * power(threshold, root, self%exponent, &
         & self%halves) * self%coordinate%slope(coordinate)
   end function density

   !> A power of a threshold, by its root and products for multiples of 1/2 from -1 to 2.
   elemental function power(threshold, root, exponent, halves)
      real(wp), intent(in) :: threshold, root, exponent
      !> Number of halves in the exponent
      integer, intent(in) :: halves
      real(wp) :: power

      select case (halves)
      case (-2)
         power = 1.0_wp / threshold
      case (-1)
         power = 1.0_wp / root
      case (0)
         power = 1.0_wp
      case (1)
         power = root
      case (2)
         power = threshold
      case (3)
         power = threshold * root
      case (4)
         power = threshold**2
      case default
         power = threshold**exponent
      end select
   end function power

   !> Moments above a threshold.
   pure function above(self, threshold) result(moment)
      class(partial_moments_type), intent(in) :: self
      !> Relative threshold U
      real(wp), intent(in) :: threshold
      !> E[u^a; u > U] of each exponent, shape (orders)
      real(wp) :: moment(size(self%exponent))

      real(wp) :: place, knot, length
      integer :: cell, node

      if (threshold >= self%max_threshold) then
         moment = 0.0_wp
         return
      end if
      if (allocated(self%edge)) then
         call self%above_in_cells(threshold, moment)
         return
      end if
      place = 0.0_wp
      if (threshold > self%min_threshold) then
         place = (self%coordinate%at(threshold) - self%first) / self%step
      end if
      cell = min(int(place), cells - 1) + 1
      moment = self%table(:, 1, cell + 1)
      length = max(0.0_wp, cell - place) * self%step
      knot = self%first + cell * self%step - length
      do node = 1, points
         moment = moment + length * self%weight(node) &
            & * self%density(knot + length * self%point(node))
      end do
   end function above

   !> Moments above a threshold by Hermite interpolation.
   pure subroutine interpolate(self, threshold, moment)
      class(partial_moments_type), intent(in) :: self
      !> Relative threshold U
      real(wp), intent(in) :: threshold
      !> E[u^a; u > U] of each exponent, shape (orders)
      real(wp), intent(out), contiguous :: moment(:)

      real(wp) :: place
      integer :: cell

      if (threshold <= self%min_threshold .and. .not. allocated(self%edge)) then
         moment = self%table(:, 1, 1)
      else if (threshold >= self%max_threshold) then
         moment = 0.0_wp
      else if (allocated(self%edge)) then
         call self%above_in_cells(threshold, moment)
      else
         place = (self%coordinate%at(threshold) - self%first) / self%step
         cell = min(int(place), cells - 1)
         call hermite(size(moment), cells + 1, self%table, cell, place - cell, moment)
      end if
   end subroutine interpolate

   !> Moments within a cell of the table by Hermite interpolation.
   pure subroutine hermite(orders, knots, table, cell, t, moment)
      integer, intent(in) :: orders, knots
      real(wp), intent(in) :: table(orders, 2, knots)
      !> The cell, from 0, and the position in it, 0 to 1
      integer, intent(in) :: cell
      real(wp), intent(in) :: t
      real(wp), intent(out) :: moment(orders)

      real(wp) :: s, weight(4)
      integer :: order

      s = 1.0_wp - t
      weight = [s**2 * (1.0_wp + 2.0_wp * t), s**2 * t, t**2 * (1.0_wp + 2.0_wp * s), -s * t**2]
      do order = 1, orders
         moment(order) = weight(1) * table(order, 1, cell + 1) &
            & + weight(2) * table(order, 2, cell + 1) &
            & + weight(3) * table(order, 1, cell + 2) &
            & + weight(4) * table(order, 2, cell + 2)
      end do
   end subroutine hermite

end module mesoslip_contacts_partial_moments
