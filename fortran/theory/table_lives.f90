!> Lives of contacts with the stiffnesses of a table, under a slider that moves forward.
!>
!> Dimensionless as in mesoslip_contacts_mechanics, for one contact. A newborn of stiffness k and
!> life l bears k d + beta after the displacement d, and breaks at d = l.
!>
!> The density of breaks of a table is as rough as the gaps between its samples. To solve an
!> integral equation each life is spread evenly over a window: rates and states are those of such
!> contacts to rounding, so that no contact is lost, and averages differ from those of the table by
!> the window squared.
module mesoslip_theory_table_lives
   use mesoslip_contacts_life_moments, only: life_moments_type, new_life_moments
   use mesoslip_contacts_mechanics, only: initial_steady, initial_uniform
   use mesoslip_contacts_stretch_cells, only: stretch_cells_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: table_lives_type, new_table_lives

   !> Moments E[k^a l^b], and their places
   integer, parameter :: orders = 9
   integer, parameter :: stiffness_power(orders) = [0, 1, 0, 1, 0, 1, 2, 0, 1]
   integer, parameter :: life_power(orders) = [0, 0, 1, 1, 2, 2, 0, -1, -1]
   integer, parameter :: one = 1, k = 2, l = 3, k_l = 4, k_l_squared = 6, k_squared = 7, &
      & inverse_l = 8, k_over_l = 9

   !> The contacts.
   type :: table_lives_type
      !> Mean life, area under the force of a life and mean mass of newborns; shortest and longest
      !> lives of newborns and of contacts that attached with no force
      real(wp) :: mean_life = 0.0_wp, stretching = 0.0_wp, mean_mass = 1.0_wp
      real(wp) :: shortest = 0.0_wp, longest = 0.0_wp
      real(wp) :: first_shortest = 0.0_wp, first_longest = 0.0_wp
      !> Window over which a life is spread; it does not begin before 0
      real(wp) :: window = 0.0_wp
      !> Force at attaching, f_b/f_s
      real(wp), private :: back_force = 0.0_wp
      !> Moments of newborns, and of contacts that attached with no force
      type(life_moments_type), private :: newborn, unforced
   contains
      procedure, non_overridable :: newborn_at
      procedure, non_overridable :: first_at
   end type table_lives_type

contains

   !> Set up the lives of the contacts of a table.
   subroutine new_table_lives(self, cells, mean_square, back_force)
      type(table_lives_type), intent(out) :: self
      !> The table, without contacts that the back force breaks
      type(stretch_cells_type), intent(in) :: cells
      !> Mean of the squared stiffness, to which the mean mass belongs
      real(wp), intent(in) :: mean_square
      !> Force at attaching, f_b/f_s
      real(wp), intent(in) :: back_force

      real(wp) :: all(orders)

      self%back_force = back_force
      ! Newborns need no moments with 1/l: their shortest life may be 0.
      call new_life_moments(self%newborn, cells, back_force, stiffness_power(:k_squared), &
         & life_power(:k_squared))
      call new_life_moments(self%unforced, cells, 0.0_wp, stiffness_power, life_power)
      self%shortest = self%newborn%shortest
      self%longest = self%newborn%longest
      self%first_shortest = self%unforced%shortest
      self%first_longest = self%unforced%longest
      call self%newborn%above(0.0_wp, all(:k_squared))
      self%mean_life = all(l)
      ! <k (x_s^2 - x_b^2)/2> with x_s = l + x_b.
      self%stretching = 0.5_wp * all(k_l_squared) + back_force * all(l)
      self%mean_mass = all(k_squared) / mean_square
   end subroutine new_table_lives

   !> Survival of contacts that attached together, and their breaks over displacement.
   pure subroutine follow(moments, force, window, displacement, state, rates)
      type(life_moments_type), intent(in) :: moments
      !> Force at attaching, window of a life, displacement since attaching
      real(wp), intent(in) :: force, window, displacement
      !> Pinned share, its stiffness and force; density of breaks, of the force released by them,
      !> and of the stiffness lost
      real(wp), intent(out) :: state(3), rates(3)

      real(wp) :: half, low(moments%orders), high(moments%orders), pinned(2), broken(2)

      half = 0.5_wp * min(window, 2.0_wp * displacement)
      call moments%above(displacement - half, low)
      if (half > 0.0_wp) then
         call moments%above(displacement + half, high)
         ! Means of the pinned share over the window, from integrals E[(l - x) k^a; l > x].
         pinned = ((low([l, k_l]) - (displacement - half) * low([one, k])) &
            & - (high([l, k_l]) - (displacement + half) * high([one, k]))) / (2.0_wp * half)
         if (window < 2.0_wp * displacement) then
            broken = (low([one, k]) - high([one, k])) / (2.0_wp * half)
         else
            ! The window grows with the displacement.
            broken = (pinned - high([one, k])) / half
         end if
      else
         pinned = low([one, k])
         ! By powers of the stiffness from -1 on.
         associate (density => moments%density_at(displacement))
            broken = density(2:3)
         end associate
      end if
      state = [pinned, force * pinned(1) + displacement * pinned(2)]
      rates = [broken(1), force * broken(1) + displacement * broken(2), broken(2)]
   end subroutine follow

   !> State and rates of newborns, as those of follow, after a displacement since attaching.
   pure subroutine newborn_at(self, displacement, state, rates)
      class(table_lives_type), intent(in) :: self
      real(wp), intent(in) :: displacement
      real(wp), intent(out) :: state(3), rates(3)

      call follow(self%newborn, self%back_force, self%window, displacement, state, rates)
   end subroutine newborn_at

   !> State and rates of the first generation, as those of follow, after a displacement since the
   !> start.
   pure subroutine first_at(self, initial, displacement, state, rates)
      class(table_lives_type), intent(in) :: self
      !> One of the initial_ codes
      integer, intent(in) :: initial
      real(wp), intent(in) :: displacement
      real(wp), intent(out) :: state(3), rates(3)

      real(wp) :: m(orders)

      associate (x => displacement)
         select case (initial)
         case (initial_steady)
            ! Displacements since attaching are uniform: of a life l the share 1 - x/l remains.
            call self%newborn%above(x, m(:k_squared))
            state(1) = m(l) - x * m(one)
            state(2) = m(k_l) - x * m(k)
            state(3) = 0.5_wp * (m(k_l_squared) - x**2 * m(k)) + self%back_force * state(1)
            state = state / self%mean_life
            rates = [m(one), m(k_l) + self%back_force * m(one), m(k)] / self%mean_life
         case (initial_uniform)
            ! The share 1 - x/x_s remains, with stretches uniform above x.
            call self%unforced%above(x, m)
            state = [m(one) - x * m(inverse_l), m(k) - x * m(k_over_l), &
               & 0.5_wp * (m(k_l) - x**2 * m(k_over_l))]
            rates = [m(inverse_l), m(k), m(k_over_l)]
         case default
            call follow(self%unforced, 0.0_wp, self%window, x, state, rates)
         end select
      end associate
   end subroutine first_at

end module mesoslip_theory_table_lives
