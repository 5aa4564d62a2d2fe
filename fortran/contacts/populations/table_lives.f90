!> Survival of populations whose contacts have the stiffnesses of a table.
!>
!> A population that attached with the force phi breaks forward in the order of x_s - phi/k, and
!> backward in that of x_s + phi/k. If stiffnesses differ these are two orders, so that no threshold
!> separates the survivors: they depend on how far the slider was ahead of the origin and behind it.
!> Distances, forces and moments are relative, as in mesoslip_contacts_mechanics.
module mesoslip_contacts_populations_table_lives
   use mesoslip_contacts_life_moments, only: life_moments_type, new_life_moments
   use mesoslip_contacts_stretch_cells, only: stretch_cells_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: table_lives_type, new_table_lives, newborn_law, unforced_law, weighted_law

   !> Laws of populations without force at attaching, evenly spread in stretch: of all contacts, and
   !> weighted by one over the breaking stretch. Those of each force at attaching and of its
   !> opposite follow
   integer, parameter :: unforced_law = 1, weighted_law = 2
   !> Moments of stiffness and life, and their positions
   integer, parameter :: orders = 6
   integer, parameter :: stiffness_power(orders) = [0, 1, -1, 2, 0, 1]
   integer, parameter :: life_power(orders) = [0, 0, 0, 0, 1, 2]
   integer, parameter :: one = 1, k = 2, inverse_k = 3, k_squared = 4, l = 5, k_l_squared = 6

   !> Contacts that attached with a force.
   type :: forced_type
      !> The force, positive in the direction in which breaks are counted
      real(wp) :: force = 0.0_wp
      !> Contacts that survive the force, and their moments
      type(stretch_cells_type) :: cells
      type(life_moments_type) :: moments
   end type forced_type

   !> Surviving fraction of populations.
   type :: table_lives_type
      !> By the law of the population
      type(forced_type), allocatable, private :: law(:)
      real(wp), private :: min_stiffness = 1.0_wp, max_stiffness = 1.0_wp
      !> Mean of the squared stiffness of all contacts
      real(wp), private :: mean_square = 1.0_wp
   contains
      procedure, non_overridable :: shortest, longest, left, min_opposite
      procedure, non_overridable, private :: sum_cells
   end type table_lives_type

contains

   !> Set up the survival of the contacts of a table.
   subroutine new_table_lives(self, cells, mean_square, force)
      type(table_lives_type), intent(out) :: self
      type(stretch_cells_type), intent(in) :: cells
      !> Mean of the squared stiffness, to which the mean mass belongs
      real(wp), intent(in) :: mean_square
      !> Forces at attaching in the direction of motion, shape (classes)
      real(wp), intent(in) :: force(:)

      integer :: class, law

      self%mean_square = mean_square
      self%min_stiffness = minval(cells%stiffness)
      self%max_stiffness = maxval(cells%stiffness)
      allocate (self%law(weighted_law + 2 * size(force)))
      do law = 1, weighted_law
         self%law(law)%cells = cells
      end do
      call new_life_moments(self%law(unforced_law)%moments, cells, 0.0_wp, stiffness_power, &
         & life_power)
      ! Twice the energy over the stretch is k x_s.
      call new_life_moments(self%law(weighted_law)%moments, cells, 0.0_wp, &
         & [0, stiffness_power], [0, life_power - 1])
      do class = 1, size(force)
         do law = weighted_law + 2 * class - 1, weighted_law + 2 * class
            associate (forced => self%law(law))
               forced%force = merge(force(class), -force(class), &
                  & law == newborn_law(class, 1.0_wp))
               forced%cells = cells
               call forced%cells%reject_below(abs(forced%force))
               call new_life_moments(forced%moments, forced%cells, forced%force, stiffness_power, &
                  & life_power)
            end associate
         end do
      end do
   end subroutine new_table_lives

   !> Law of a population that attached with one of the forces in a direction of motion.
   pure function newborn_law(class, direction) result(law)
      integer, intent(in) :: class
      real(wp), intent(in) :: direction
      integer :: law

      law = weighted_law + 2 * class - merge(1, 0, direction > 0.0_wp)
   end function newborn_law

   !> Law of the same contacts in the other direction.
   pure function opposite(law)
      integer, intent(in) :: law
      integer :: opposite

      opposite = law
      if (law > weighted_law) opposite = law + merge(1, -1, modulo(law - weighted_law, 2) == 1)
   end function opposite

   !> Distance in a direction after which the first contacts of a law break.
   pure function shortest(self, law, direction) result(distance)
      class(table_lives_type), intent(in) :: self
      integer, intent(in) :: law
      real(wp), intent(in) :: direction
      real(wp) :: distance

      distance = self%law(merge(law, opposite(law), direction > 0.0_wp))%moments%shortest
   end function shortest

   !> Distance after which the last contacts of a law break, forward.
   pure function longest(self, law) result(distance)
      class(table_lives_type), intent(in) :: self
      integer, intent(in) :: law
      real(wp) :: distance

      distance = self%law(law)%moments%longest
   end function longest

   !> Distance in the other direction up to which no contact breaks that survived a distance in one.
   pure function min_opposite(self, law, direction, distance) result(opposite_distance)
      class(table_lives_type), intent(in) :: self
      integer, intent(in) :: law
      real(wp), intent(in) :: direction, distance
      real(wp) :: opposite_distance

      real(wp) :: force

      ! Survivors have x_s > d + phi/k, and break in the other direction after x_s + phi/k.
      force = sign(1.0_wp, direction) * self%law(law)%force
      opposite_distance = distance + 2.0_wp * force &
         & / merge(self%max_stiffness, self%min_stiffness, force > 0.0_wp)
   end function min_opposite

   !> Moments of the survivors after maximum distances of the slider ahead of the origin and behind
   !> it: number, stiffness, one over it, twice the energy lost in breaking, and mass.
   pure subroutine left(self, law, ahead, behind, moments)
      class(table_lives_type), intent(in) :: self
      integer, intent(in) :: law
      real(wp), intent(in) :: ahead, behind
      real(wp), intent(out) :: moments(5)

      real(wp) :: all(orders), weighted(orders + 1), force

      force = self%law(law)%force
      if (law == weighted_law) then
         call self%law(law)%moments%above(max(ahead, behind), weighted)
         all = weighted(2:)
      else if (ahead - behind >= -2.0_wp * force / merge(self%max_stiffness, self%min_stiffness, &
         & force > 0.0_wp)) then
         call self%law(law)%moments%above(ahead, all)
      else if (ahead - behind <= -2.0_wp * force / merge(self%min_stiffness, self%max_stiffness, &
         & force > 0.0_wp)) then
         call self%law(opposite(law))%moments%above(behind, all)
         force = -force
      else
         call self%sum_cells(law, ahead, behind, moments)
         return
      end if
      ! Twice the energy is k x_s^2 with x_s = l + phi/k.
      moments = [all(one), all(k), all(inverse_k), all(k_l_squared) + 2.0_wp * force * all(l) &
         & + force**2 * all(inverse_k), all(k_squared) / self%mean_square]
   end subroutine left

   !> The same where survival depends on both distances.
   pure subroutine sum_cells(self, law, ahead, behind, moments)
      class(table_lives_type), intent(in) :: self
      integer, intent(in) :: law
      real(wp), intent(in) :: ahead, behind
      real(wp), intent(out) :: moments(5)

      real(wp) :: low, density, number
      integer :: cell

      moments = 0.0_wp
      associate (cells => self%law(law)%cells, force => self%law(law)%force)
         do cell = 1, size(cells%share)
            associate (high => cells%high(cell), stiffness => cells%stiffness(cell))
               low = max(cells%low(cell), ahead + force / stiffness, behind - force / stiffness)
               if (low >= high) cycle
               density = cells%share(cell) / (high - cells%low(cell))
               number = density * (high - low)
               moments = moments + number * [1.0_wp, stiffness, 1.0_wp / stiffness, &
                  & stiffness * (high**2 + high * low + low**2) / 3.0_wp, &
                  & stiffness**2 / self%mean_square]
            end associate
         end do
      end associate
   end subroutine sum_cells

end module mesoslip_contacts_populations_table_lives
