!> Moments of the contacts of a table with stiffnesses that survive a displacement.
!>
!> Contacts that attached with a force phi live for x_s - phi/k. If stiffnesses differ, the order of
!> lives is not that of break stretches: the cells of stretches overlap as cells of lives. Between
!> the ends of cells the density of each power of the stiffness is constant, so that all integrals
!> are sums. Dimensionless as in mesoslip_contacts_mechanics.
module mesoslip_contacts_life_moments
   use mesoslip_contacts_individual_sorting, only: sort
   use mesoslip_contacts_stretch_cells, only: cell_of, stretch_cells_type
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: life_moments_type, new_life_moments
   public :: min_power, max_power

   !> Powers of the stiffness whose densities are kept
   integer, parameter :: min_power = -1, max_power = 2
   !> Rounding error of the sum of all probabilities
   real(wp), parameter :: rounding = 1.0e-12_wp

   !> Moments E[k^a l^b; l > L] of stiffness and life.
   type :: life_moments_type
      !> Shortest and longest life
      real(wp) :: shortest = 0.0_wp, longest = 0.0_wp
      !> Number of moments
      integer :: orders = 0
      !> Exponents of the stiffness and of the life, shape (orders)
      integer, allocatable, private :: stiffness_power(:), life_power(:)
      !> Lives at which cells start or end, shape (pieces + 1), densities between them, shape
      !> (min_power:max_power, pieces), and moments above, shape (orders, pieces + 1)
      real(wp), allocatable, private :: edge(:), density(:, :), above_edge(:, :)
   contains
      !> Moments above a life
      procedure, non_overridable :: above
      !> Densities of the powers of the stiffness over the life
      procedure, non_overridable :: density_at
      procedure, non_overridable, private :: find_pieces
   end type life_moments_type

contains

   !> Set up the moments of contacts that attach with a force.
   subroutine new_life_moments(self, cells, force, stiffness_power, life_power)
      type(life_moments_type), intent(out) :: self
      !> Contacts that the force does not break
      type(stretch_cells_type), intent(in) :: cells
      !> Force at attaching along the displacement; negative against it
      real(wp), intent(in) :: force
      !> Exponents of stiffness, from min_power to max_power, and life, from -1 to 2, of each
      !> moment, shape (orders); both zero for the first one
      integer, intent(in) :: stiffness_power(:), life_power(:)

      real(wp) :: total, scale
      integer :: piece

      self%orders = size(stiffness_power)
      self%stiffness_power = stiffness_power
      self%life_power = life_power
      call self%find_pieces(cells, force)
      associate (pieces => size(self%edge) - 1)
         self%shortest = self%edge(1)
         self%longest = self%edge(pieces + 1)
         allocate (self%above_edge(size(life_power), pieces + 1), source=0.0_wp)
         do piece = pieces, 1, -1
            self%above_edge(:, piece) = self%above_edge(:, piece + 1) &
               & + self%density(stiffness_power, piece) &
               & * power_integral(life_power, self%edge(piece), self%edge(piece + 1))
         end do
      end associate
      ! The total is exactly 1: the number of contacts must not decay as they attach over and over.
      total = sum(cells%share)
      if (abs(total - 1.0_wp) < rounding) total = 1.0_wp
      scale = total / self%above_edge(1, 1)
      self%density = scale * self%density
      self%above_edge = scale * self%above_edge
      self%above_edge(1, 1) = total
   end subroutine new_life_moments

   !> Ends of cells in their order, and the densities between them.
   subroutine find_pieces(self, cells, force)
      class(life_moments_type), intent(inout) :: self
      type(stretch_cells_type), intent(in) :: cells
      real(wp), intent(in) :: force

      real(wp) :: life(2 * size(cells%low)), edge(2 * size(cells%low)), change(min_power:max_power)
      real(wp) :: found(min_power:max_power, 2 * size(cells%low))
      integer :: order(2 * size(cells%low)), event, cell, power, open, pieces
      type(accumulator_type) :: density(min_power:max_power)

      associate (count => size(cells%low))
         life(:count) = cells%low - force / cells%stiffness
         life(count + 1:) = cells%high - force / cells%stiffness
         order = [(event, event=1, 2 * count)]
         call sort(life, order, 2 * count)
         pieces = 0
         found = 0.0_wp
         open = 0
         do event = 1, 2 * count
            cell = modulo(order(event) - 1, count) + 1
            do power = min_power, max_power
               change(power) = cells%share(cell) / (cells%high(cell) - cells%low(cell)) &
                  & * cells%stiffness(cell)**power
            end do
            if (order(event) > count) change = -change
            call density%add(change)
            open = open + merge(1, -1, order(event) <= count)
            if (event < 2 * count) then
               if (.not. life(event + 1) > life(event)) cycle
            end if
            pieces = pieces + 1
            edge(pieces) = life(event)
            if (open > 0) found(:, pieces) = density%total()
         end do
      end associate
      self%edge = edge(:pieces)
      allocate (self%density(min_power:max_power, pieces - 1), source=found(:, :pieces - 1))
   end subroutine find_pieces

   !> Integral of a power from -1 to 2 between two limits.
   elemental function power_integral(power, lower, upper) result(integral)
      integer, intent(in) :: power
      real(wp), intent(in) :: lower, upper
      real(wp) :: integral

      select case (power)
      case (-1)
         integral = log(upper / lower)
      case (1)
         integral = 0.5_wp * (upper - lower) * (upper + lower)
      case (2)
         integral = (upper - lower) * (upper**2 + upper * lower + lower**2) / 3.0_wp
      case default
         integral = upper - lower
      end select
   end function power_integral

   !> Moments above a life.
   pure subroutine above(self, life, moment)
      class(life_moments_type), intent(in) :: self
      !> Relative displacement L since attaching
      real(wp), intent(in) :: life
      !> E[k^a l^b; l > L] of each pair of exponents, shape (orders)
      real(wp), intent(out), contiguous :: moment(:)

      integer :: piece

      if (life <= self%shortest) then
         moment = self%above_edge(:, 1)
      else if (life >= self%longest) then
         moment = 0.0_wp
      else
         piece = cell_of(self%edge, life, 1.0_wp)
         moment = self%above_edge(:, piece + 1) + self%density(self%stiffness_power, piece) &
            & * power_integral(self%life_power, life, self%edge(piece + 1))
      end if
   end subroutine above

   !> Densities of the powers of the stiffness at a life.
   pure function density_at(self, life) result(density)
      class(life_moments_type), intent(in) :: self
      !> Relative displacement since attaching
      real(wp), intent(in) :: life
      !> Density of contacts that break, times each power of their stiffness
      real(wp) :: density(min_power:max_power)

      density = 0.0_wp
      if (life < self%shortest .or. life > self%longest) return
      density = self%density(:, cell_of(self%edge, life, 1.0_wp))
   end function density_at

end module mesoslip_contacts_life_moments
