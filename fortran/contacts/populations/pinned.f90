!> Pinned contacts of infinitely many: how they are at the start, and how they attach.
module mesoslip_contacts_populations_pinned
   use mesoslip_contacts_ageing_law, only: ageing_law_type
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_mechanics, only: breaking_distance, broken_threshold, coupling_scaled, &
      & initial_steady, initial_uniform
   use mesoslip_contacts_partial_moments, only: new_partial_moments
   use mesoslip_contacts_populations_breaking, only: breaking_populations_type, unresolved_part
   use mesoslip_contacts_populations_rows, only: column_weight, compliant, moments_length, &
      & new_population_rows, number, stiff
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: pinned_populations_type, new_pinned_populations

   !> Relative width of the law of thresholds beyond which populations are not farther apart.
   real(wp), parameter :: max_spread = 0.35_wp
   !> Length of a step over the resolution times the spread of the breaking stretches
   real(wp), parameter :: step_part = 0.6_wp
   !> Stretch beyond which the cells of the initial states of wide laws grow with it
   real(wp), parameter :: min_even = 0.02_wp
   !> Forces at attaching if they have a width, evenly spaced, and how far they reach in standard
   !> deviations
   integer, parameter :: max_classes = 25
   real(wp), parameter :: reach = 6.0_wp

   !> Populations of pinned contacts.
   type, extends(breaking_populations_type) :: pinned_populations_type
      !> Mean stiffness of a contact that attaches [N/m], and the energy it gains [J]
      real(wp) :: newborn_stiffness = 0.0_wp, newborn_energy = 0.0_wp
      !> Mean relative force of a contact that attaches
      real(wp) :: newborn_force = 0.0_wp
      !> Forces with which contacts attach: how many there are, the relative forces, thresholds at
      !> or below which a contact could not attach with each, and the shares of contacts
      integer, private :: classes = 1
      real(wp), private :: class_force(max_classes) = 0.0_wp, class_broken(max_classes) = 0.0_wp, &
         & share(max_classes) = 1.0_wp
   contains
      !> Let thresholds change with age
      procedure, non_overridable :: set_ageing
      !> Prepare the populations for the start of a run
      procedure, non_overridable :: initialize
      !> Attach contacts as a population, or as one for each force
      procedure, non_overridable :: attach
      procedure, non_overridable, private :: spread_newborns
   end type pinned_populations_type

contains

   !> Set up populations: none.
   subroutine new_pinned_populations(self, parameters, resolution)
      !> The populations
      type(pinned_populations_type), intent(out) :: self
      !> What the contacts are made of
      type(contact_parameters_type), intent(in) :: parameters
      !> Length of a step over the spread of the breaking stretches, positive
      real(wp), intent(in) :: resolution

      real(wp) :: exponent(moments_length), one_over_stretch, all(moments_length)

      call new_population_rows(self, parameters)
      self%step = step_part * resolution * min(parameters%law%width, max_spread) * self%stretch
      if (parameters%coupling == coupling_scaled) self%step = 0.5_wp * self%step

      exponent = [0.0_wp, 0.0_wp, 0.0_wp, 2.0_wp, 0.0_wp]
      one_over_stretch = -1.0_wp
      if (parameters%coupling == coupling_scaled) then
         exponent = [0.0_wp, 0.5_wp, -0.5_wp, 1.5_wp, 1.0_wp]
         one_over_stretch = -0.5_wp
      end if
      call new_partial_moments(self%moments(1), parameters%law, exponent)
      call new_partial_moments(self%moments(2), parameters%law, exponent + one_over_stretch)
      self%first_broken = parameters%law%quantile(1.0_wp - unresolved_part)
      call self%moments(1)%interpolate(0.0_wp, all)
      self%newborn_stiffness = parameters%stiffness * all(stiff)
      self%newborn_energy = 0.5_wp * parameters%back_force_ratio**2 * all(compliant) &
         & * parameters%static_force * self%stretch
      self%newborn_force = parameters%back_force_ratio
      self%class_force(1) = parameters%back_force_ratio
      if (parameters%newborn_width > 0.0_wp) call self%spread_newborns()
   end subroutine new_pinned_populations

   !> Set the forces with which contacts attach, from a normal law cut off at the thresholds.
   subroutine spread_newborns(self)
      class(pinned_populations_type), intent(inout) :: self

      real(wp) :: left(moments_length, max_classes), deviate
      integer :: class

      self%classes = max_classes
      do class = 1, max_classes
         ! Evenly spaced points are exact for a normal law, but for what its tails lack.
         deviate = reach * (2.0_wp * (class - 1) / (max_classes - 1) - 1.0_wp)
         self%class_force(class) = self%parameters%back_force_ratio &
            & + self%parameters%newborn_width * deviate
         self%class_broken(class) = abs(self%class_force(class))
         self%share(class) = exp(-0.5_wp * deviate**2)
         call self%moments(1)%interpolate(self%class_broken(class), left(:, class))
      end do
      self%share = self%share / sum(self%share * left(number, :))
      associate (static => self%parameters%static_force, force => self%class_force)
         self%newborn_stiffness = self%parameters%stiffness * sum(self%share * left(stiff, :))
         self%newborn_force = sum(self%share * left(number, :) * force)
         self%newborn_energy = 0.5_wp * sum(self%share * left(compliant, :) * force**2) * static &
            & * self%stretch
      end associate
   end subroutine spread_newborns

   !> Let thresholds change with age.
   subroutine set_ageing(self, ageing)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> How they change
      type(ageing_law_type), intent(in) :: ageing

      self%ages = .true.
      self%ageing = ageing
      self%some_fall = ageing%falls(self%moments(1)%min_threshold, 1.0_wp) &
         & .or. ageing%falls(self%moments(1)%max_threshold, 1.0_wp)
   end subroutine set_ageing

   !> Prepare the populations for the start of a run.
   subroutine initialize(self, state)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      real(wp) :: max_distance, total, back, cell, middle, edge, even

      associate (parameters => self%parameters, moments => self%moments(1))
         if (state /= initial_steady .and. state /= initial_uniform) then
            call self%add(0.0_wp, 0.0_wp, real(parameters%count, wp), 1, 0.0_wp, &
               & 0.0_wp, -self%ageing%initial_age, 0.0_wp)
         else
            back = 0.0_wp
            if (state == initial_steady) back = parameters%back_force_ratio
            max_distance = breaking_distance(parameters%coupling, back, moments%max_threshold)
            edge = 0.0_wp
            even = 1.0_wp
            if (parameters%law%width > max_spread) even = min_even
            do while (edge < max_distance)
               ! The tails of wide laws are spread over many stretches, and smooth; many of their
               ! thresholds are small.
               cell = min(self%step / self%stretch * max(even, edge), max_distance - edge)
               middle = edge + 0.5_wp * cell
               edge = edge + cell
               call self%add(-middle * self%stretch, back, cell, &
                  & merge(1, 2, state == initial_steady), &
                  & broken_threshold(parameters%coupling, back, middle), 0.0_wp, &
                  & -self%ageing%initial_age, 0.0_wp)
            end do
            total = self%number_of_contacts()
            associate (weight => self%population(:self%count, column_weight), &
               & left => self%left(:, :self%count))
               weight = weight * (parameters%count / total)
               left = left * (parameters%count / total)
            end associate
         end if
      end associate
      self%last_birth = -self%ageing%initial_age
      call self%sum_forces()
   end subroutine initialize

   !> Attach contacts as one population for each force, where they do on average.
   subroutine attach(self, births, moment, direction, displacement, birth, time)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> How many they are, the sum of their displacements [m], and the direction of their forces
      real(wp), intent(in) :: births, moment, direction
      !> Where the slider is [m], when the contacts attached on average, and when that is [s]
      real(wp), intent(in) :: displacement, birth, time

      integer :: class

      call self%stiffness%add(self%newborn_stiffness * births)
      call self%offset%add(self%newborn_stiffness * moment &
         & - self%parameters%static_force * births * (direction * self%newborn_force))
      self%last_birth = time
      do class = 1, self%classes
         call self%add(moment / births, direction * self%class_force(class), &
            & self%share(class) * births, 1, self%class_broken(class), displacement, birth, time)
      end do
   end subroutine attach

end module mesoslip_contacts_populations_pinned
