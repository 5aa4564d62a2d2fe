!> Lives of contacts under a slider that moves forward: their breaks, and the force of the pinned.
!>
!> Dimensionless as in mesoslip_contacts_mechanics, for one contact. A newborn contact is followed
!> from its attaching, a contact of the first generation from the start of the motion.
module mesoslip_theory_lives
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: name_length, parameters_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_contacts_mechanics, only: breaking_distance, broken_threshold, &
      & broken_threshold_slope, coupling_equal, coupling_names, coupling_table, initial_names, &
      & initial_relaxed, initial_steady, initial_uniform, stiffness_of
   use mesoslip_contacts_partial_moments, only: new_partial_moments, partial_moments_type
   use mesoslip_numerics_quadrature, only: gauss_legendre
   use mesoslip_contacts_threshold_laws, only: make_threshold_law
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use mesoslip_theory_table_lives, only: new_table_lives, table_lives_type
   implicit none
   private

   public :: contact_lives_type, make_contact_lives
   public :: scale_names

   !> Scales of the lives: shortest, longest and mean life of newborns; their stiffness and force at
   !> attaching; shortest and longest life of a relaxed first generation; mean force of stationary
   !> sliding; mean mass
   character(len=*), parameter :: scale_names(*) = [character(len=name_length) :: "shortest", &
      & "longest", "mean_life", "newborn_stiffness", "newborn_force", "first_shortest", &
      & "first_longest", "steady_force", "mean_mass"]

   !> Exponents of the partial moments in use, and their places
   real(wp), parameter :: exponents(7) = [0.0_wp, 0.5_wp, 1.0_wp, 1.5_wp, 2.0_wp, -0.5_wp, -1.0_wp]
   integer, parameter :: zero = 1, half = 2, one = 3, three_halves = 4, two = 5, minus_half = 6, &
      & minus_one = 7

   !> Rule for averages over a newborn's stretch: pieces of its range and of the law's, points in
   !> each; half the range in standard deviations
   integer, parameter :: pieces = 9, law_pieces = 12, points = 12
   real(wp), parameter :: reach = 9.0_wp

   !> The contacts.
   type :: contact_lives_type
      !> Law of the relative thresholds
      class(threshold_law_type), allocatable :: law
      !> One of the coupling_ codes
      integer :: coupling = coupling_equal
      !> One of the initial_ codes
      integer :: initial = initial_relaxed
      !> Whether a broken contact attaches again
      logical :: reattach = .true.
      !> Force at attaching, f_b/f_s, and the standard deviation of the stretch there
      real(wp) :: back_force = 0.0_wp, newborn_width = 0.0_wp
      !> Shortest and longest lives of newborns, and of a relaxed first generation
      real(wp) :: shortest = 0.0_wp, longest = 0.0_wp
      real(wp) :: first_shortest = 0.0_wp, first_longest = 0.0_wp
      !> Mean life of newborns, their stiffness and force at attaching
      real(wp) :: mean_life = 0.0_wp, newborn_stiffness = 0.0_wp, newborn_force = 0.0_wp
      !> Mean force of stationary sliding, and mean mass of contacts
      real(wp) :: steady_force = 0.0_wp, mean_mass = 1.0_wp

      type(partial_moments_type), private :: moments
      !> Lives of contacts with the stiffnesses of a table
      type(table_lives_type), private :: table
      !> Longest and shortest lives of contacts that attach with no spread
      real(wp), private :: sharp_longest = 0.0_wp, sharp_shortest = 0.0_wp
      !> Probability that a newborn of spread stretch is not broken at once
      real(wp), private :: acceptance = 1.0_wp
      real(wp), private :: point(points) = 0.0_wp, weight(points) = 0.0_wp
   contains
      procedure, non_overridable :: newborn_rates
      procedure, non_overridable :: newborn_state
      procedure, non_overridable :: first_rates
      procedure, non_overridable :: first_state
      procedure, non_overridable :: spread_table
      procedure, non_overridable :: scales
   end type contact_lives_type

   abstract interface
      !> A function of the life of a contact that attaches with no spread.
      pure function life_interface(self, life) result(values)
         import :: contact_lives_type, wp
         implicit none
         type(contact_lives_type), intent(in) :: self
         real(wp), intent(in) :: life
         real(wp) :: values(3)
      end function life_interface
   end interface

contains

   !> Set up the lives of contacts from named numbers.
   subroutine make_contact_lives(self, parameters, error)
      type(contact_lives_type), intent(out) :: self
      !> Law, coupling and initial state; relative width, back force and spread of the
      !> stretch of newborns; whether contacts attach again
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or superfluous, or the law does not exist
      type(error_type), allocatable, intent(out) :: error

      character(len=name_length) :: law
      real(wp) :: state(3), stretching
      logical :: reattach

      call parameters%take("threshold_law", law, error)
      call parameters%take("coupling", coupling_names, self%coupling, error)
      call parameters%take("back_force_ratio", self%back_force, error)
      call parameters%take("newborn_width", self%newborn_width, error)
      call parameters%take("reattach", reattach, error)
      call parameters%take("initial", initial_names, self%initial, error)
      if (allocated(error)) return
      call make_threshold_law(self%law, law, parameters, self%back_force, error)
      call parameters%finish(error)
      if (allocated(error)) return
      call gauss_legendre(self%point, self%weight)
      if (self%coupling == coupling_table) then
         call take_table(self, stretching)
      else
         call take_moments(self, stretching)
      end if
      self%shortest = max(0.0_wp, self%sharp_shortest - reach * self%newborn_width)
      self%longest = self%sharp_longest + reach * self%newborn_width
      if (self%newborn_width > 0.0_wp) then
         state = averaged(self, sharp_state, 0.0_wp)
         self%acceptance = state(1)
         call integrate_life(self, self%mean_life, stretching)
      end if
      self%reattach = reattach
      state = self%newborn_state(0.0_wp)
      self%newborn_stiffness = state(2)
      self%newborn_force = state(3)
      if (reattach) self%steady_force = stretching / self%mean_life
   end subroutine make_contact_lives

   !> Moments and scales of lives of contacts without spread.
   subroutine take_moments(self, stretching)
      type(contact_lives_type), intent(inout) :: self
      !> Area under the force of a life
      real(wp), intent(out) :: stretching

      real(wp) :: all(size(exponents))

      call new_partial_moments(self%moments, self%law, exponents)
      associate (coupling => self%coupling, back_force => self%back_force, &
         & moments => self%moments)
         self%sharp_shortest = max(0.0_wp, &
            & breaking_distance(coupling, back_force, moments%min_threshold))
         self%sharp_longest = breaking_distance(coupling, back_force, moments%max_threshold)
         self%first_shortest = breaking_distance(coupling, 0.0_wp, moments%min_threshold)
         self%first_longest = breaking_distance(coupling, 0.0_wp, moments%max_threshold)
         ! Mean life <x_s - x_b> and the area under the force of a life, <k (x_s^2 - x_b^2)/2>.
         all = moments%above(0.0_wp)
         if (coupling == coupling_equal) then
            self%mean_life = all(one) - back_force
            stretching = 0.5_wp * (all(two) - back_force**2)
         else
            self%mean_mass = all(one)
            self%mean_life = all(half) - back_force * all(minus_half)
            stretching = 0.5_wp * (all(three_halves) - back_force**2 * all(minus_half))
         end if
      end associate
   end subroutine take_moments

   !> The same of contacts with the stiffnesses of a table.
   subroutine take_table(self, stretching)
      type(contact_lives_type), intent(inout) :: self
      !> Area under the force of a life
      real(wp), intent(out) :: stretching

      call new_table_lives(self%table, self%law%stretch_cells(), self%law%mean_square_stiffness, &
         & self%back_force)
      associate (table => self%table)
         self%sharp_shortest = table%shortest
         self%sharp_longest = table%longest
         self%first_shortest = table%first_shortest
         self%first_longest = table%first_longest
         self%mean_mass = table%mean_mass
         self%mean_life = table%mean_life
         stretching = table%stretching
      end associate
   end subroutine take_table

   !> Spread the lives of contacts with the stiffnesses of a table over a window.
   subroutine spread_table(self, window)
      class(contact_lives_type), intent(inout) :: self
      !> Length of the window
      real(wp), intent(in) :: window

      self%table%window = window
   end subroutine spread_table

   !> Scales of the lives, in the order of scale_names.
   pure function scales(self)
      class(contact_lives_type), intent(in) :: self
      real(wp) :: scales(size(scale_names))

      scales = [self%shortest, self%longest, self%mean_life, self%newborn_stiffness, &
         & self%newborn_force, self%first_shortest, self%first_longest, self%steady_force, &
         & self%mean_mass]
   end function scales

   !> Integrals of the newborns' state over their lives.
   subroutine integrate_life(self, mean_life, stretching)
      type(contact_lives_type), intent(in) :: self
      !> Integrals of the pinned share, and of the force
      real(wp), intent(out) :: mean_life, stretching

      integer, parameter :: max_cells = 2000
      real(wp) :: state(3), length
      integer :: cell, cells, node

      mean_life = 0.0_wp
      stretching = 0.0_wp
      ! The spread of the stretch smooths the state over its standard deviation.
      cells = ceiling(min(real(max_cells, wp), 0.5_wp * self%longest / self%newborn_width))
      length = self%longest / cells
      do cell = 0, cells - 1
         do node = 1, points
            state = self%newborn_state((cell + self%point(node)) * length)
            mean_life = mean_life + length * self%weight(node) * state(1)
            stretching = stretching + length * self%weight(node) * state(3)
         end do
      end do
   end subroutine integrate_life

   !> Breaks of newborns over displacement: density of breaks, of the force released by them, and of
   !> the stiffness lost.
   pure function newborn_rates(self, life) result(rates)
      class(contact_lives_type), intent(in) :: self
      !> Displacement since attaching
      real(wp), intent(in) :: life
      real(wp) :: rates(3)

      rates = 0.0_wp
      if (life <= 0.0_wp .or. .not. self%reattach) return
      if (self%newborn_width > 0.0_wp) then
         rates = averaged(self, sharp_rates, life) / self%acceptance
      else
         rates = sharp_rates(self, life)
      end if
   end function newborn_rates

   !> Survival of newborns: pinned share, its stiffness and force.
   pure function newborn_state(self, life) result(state)
      class(contact_lives_type), intent(in) :: self
      !> Displacement since attaching
      real(wp), intent(in) :: life
      real(wp) :: state(3)

      if (.not. self%reattach) then
         state = 0.0_wp
      else if (self%newborn_width > 0.0_wp) then
         state = averaged(self, sharp_state, life) / self%acceptance
      else
         state = sharp_state(self, life)
      end if
   end function newborn_state

   !> Rates of newborns whose stretch has no spread.
   pure function sharp_rates(self, life) result(rates)
      type(contact_lives_type), intent(in) :: self
      real(wp), intent(in) :: life
      real(wp) :: rates(3)

      real(wp) :: threshold, density, state(3)

      rates = 0.0_wp
      if (self%coupling == coupling_table) then
         if (life > 0.0_wp) call self%table%newborn_at(life, state, rates)
         return
      end if
      if (life < self%sharp_shortest .or. life > self%sharp_longest) return
      threshold = broken_threshold(self%coupling, self%back_force, life)
      density = self%law%density(threshold) &
         & * broken_threshold_slope(self%coupling, self%back_force, life)
      rates = density * [1.0_wp, threshold, stiffness_of(self%coupling, threshold)]
   end function sharp_rates

   !> State of newborns whose stretch has no spread.
   pure function sharp_state(self, life) result(state)
      type(contact_lives_type), intent(in) :: self
      real(wp), intent(in) :: life
      real(wp) :: state(3)

      real(wp) :: moment(size(exponents)), rates(3)

      if (self%coupling == coupling_table) then
         call self%table%newborn_at(life, state, rates)
         return
      end if
      moment = self%moments%above(broken_threshold(self%coupling, self%back_force, life))
      state(1) = moment(zero)
      state(2) = moment(half)
      if (self%coupling == coupling_equal) state(2) = moment(zero)
      state(3) = self%back_force * state(1) + life * state(2)
   end function sharp_state

   !> Average over the spread of the stretch at attaching, a normal law.
   pure function averaged(self, of, life) result(average)
      type(contact_lives_type), intent(in) :: self
      procedure(life_interface) :: of
      real(wp), intent(in) :: life
      real(wp) :: average(3)

      real(wp), parameter :: sqrt_2_pi = sqrt(2.0_wp * acos(-1.0_wp))
      real(wp) :: edge(pieces + law_pieces + 2), swap, length, z, first, last
      integer :: piece, other, node

      ! Pieces end where the function is not smooth, and are short compared with the law.
      do piece = 1, pieces + 1
         edge(piece) = reach * (2.0_wp * (piece - 1) / pieces - 1.0_wp)
      end do
      first = (self%sharp_shortest - life) / self%newborn_width
      last = (self%sharp_longest - life) / self%newborn_width
      do piece = 0, law_pieces
         edge(pieces + 2 + piece) = first + (last - first) * piece / law_pieces
      end do
      edge = min(reach, max(-reach, edge))
      do piece = pieces + 2, size(edge)
         do other = piece, 2, -1
            if (edge(other) >= edge(other - 1)) exit
            swap = edge(other)
            edge(other) = edge(other - 1)
            edge(other - 1) = swap
         end do
      end do

      average = 0.0_wp
      do piece = 1, size(edge) - 1
         length = edge(piece + 1) - edge(piece)
         if (length <= 0.0_wp) cycle
         do node = 1, points
            z = edge(piece) + length * self%point(node)
            average = average + length * self%weight(node) * exp(-0.5_wp * z**2) / sqrt_2_pi &
               & * of(self, life + self%newborn_width * z)
         end do
      end do
   end function averaged

   !> The same rates of the first generation, after a displacement since the start.
   pure function first_rates(self, displacement) result(rates)
      class(contact_lives_type), intent(in) :: self
      real(wp), intent(in) :: displacement
      real(wp) :: rates(3)

      real(wp) :: threshold, density, moment(size(exponents)), back, state(3)

      rates = 0.0_wp
      if (self%coupling == coupling_table) then
         call self%table%first_at(self%initial, merge(displacement, max(0.0_wp, displacement), &
            & self%initial == initial_relaxed), state, rates)
         return
      end if
      back = 0.0_wp
      if (self%initial == initial_steady) back = self%back_force
      threshold = broken_threshold(self%coupling, back, max(0.0_wp, displacement))
      if (self%initial == initial_relaxed) then
         if (threshold < self%moments%min_threshold &
            & .or. threshold > self%moments%max_threshold) return
         density = self%law%density(threshold) &
            & * broken_threshold_slope(self%coupling, 0.0_wp, displacement)
         rates = density * [1.0_wp, threshold, stiffness_of(self%coupling, threshold)]
         return
      end if
      moment = self%moments%above(threshold)
      if (self%initial == initial_steady) then
         rates = [moment(zero), moment(one), moment(half)] / self%mean_life
         if (self%coupling == coupling_equal) rates(3) = rates(1)
      else if (self%coupling == coupling_equal) then
         rates = [moment(minus_one), moment(zero), moment(minus_one)]
      else
         rates = [moment(minus_half), moment(half), moment(zero)]
      end if
   end function first_rates

   !> The same state of the first generation, after a displacement since the start.
   pure function first_state(self, displacement) result(state)
      class(contact_lives_type), intent(in) :: self
      real(wp), intent(in) :: displacement
      real(wp) :: state(3)

      real(wp) :: m(size(exponents)), x, b, threshold, rates(3)

      if (self%coupling == coupling_table) then
         call self%table%first_at(self%initial, displacement, state, rates)
         return
      end if
      x = displacement
      b = self%back_force
      if (self%initial == initial_steady) then
         threshold = broken_threshold(self%coupling, b, max(0.0_wp, x))
      else
         threshold = broken_threshold(self%coupling, 0.0_wp, max(0.0_wp, x))
      end if
      m = self%moments%above(threshold)
      select case (self%initial)
      case (initial_steady)
         ! Of a life l the share 1 - x/l remains, with stretches uniform above x_b + x.
         if (self%coupling == coupling_equal) then
            state(1) = m(one) - (b + x) * m(zero)
            state(2) = state(1)
            state(3) = 0.5_wp * (m(two) - (b + x)**2 * m(zero))
         else
            state(1) = m(half) - b * m(minus_half) - x * m(zero)
            state(2) = m(one) - b * m(zero) - x * m(half)
            state(3) = 0.5_wp * (m(three_halves) - b**2 * m(minus_half) - 2.0_wp * b * x * m(zero) &
               & - x**2 * m(half))
         end if
         state = state / self%mean_life
      case (initial_uniform)
         ! The share 1 - x/x_s remains, with stretches uniform above x.
         if (self%coupling == coupling_equal) then
            state(1) = m(zero) - x * m(minus_one)
            state(2) = state(1)
            state(3) = 0.5_wp * (m(one) - x**2 * m(minus_one))
         else
            state(1) = m(zero) - x * m(minus_half)
            state(2) = m(half) - x * m(zero)
            state(3) = 0.5_wp * (m(one) - x**2 * m(zero))
         end if
      case default
         state(1) = m(zero)
         state(2) = m(half)
         if (self%coupling == coupling_equal) state(2) = m(zero)
         state(3) = x * state(2)
      end select
   end function first_state

end module mesoslip_theory_lives
