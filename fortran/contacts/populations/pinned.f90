!> Pinned contacts of infinitely many: how they are at the start, and how they attach.
module mesoslip_contacts_populations_pinned
   use mesoslip_contacts_ageing_law, only: ageing_law_type
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_mechanics, only: breaking_distance, broken_threshold, coupling_scaled, &
      & initial_steady, initial_uniform
   use mesoslip_contacts_partial_moments, only: new_partial_moments
   use mesoslip_contacts_populations_breaking, only: breaking_populations_type, unresolved_part
   use mesoslip_contacts_populations_rows, only: column_weight, compliant, moments_length, &
      & new_population_rows, stiff
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

   !> Populations of pinned contacts.
   type, extends(breaking_populations_type) :: pinned_populations_type
      !> Mean stiffness of a contact that attaches [N/m], and the energy it gains [J]
      real(wp) :: newborn_stiffness = 0.0_wp, newborn_energy = 0.0_wp
   contains
      !> Let thresholds change with age
      procedure, non_overridable :: set_ageing
      !> Prepare the populations for the start of a run
      procedure, non_overridable :: initialize
      !> Attach contacts as a population
      procedure, non_overridable :: attach
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
   end subroutine new_pinned_populations

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

   !> Attach contacts as one population, where they do on average.
   subroutine attach(self, births, moment, force, displacement, birth, time)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> How many they are, the sum of their displacements [m], and the force of each, signed
      real(wp), intent(in) :: births, moment, force
      !> Where the slider is [m], when the contacts attached on average, and when that is [s]
      real(wp), intent(in) :: displacement, birth, time

      call self%stiffness%add(self%newborn_stiffness * births)
      call self%offset%add(self%newborn_stiffness * moment &
         & - self%parameters%static_force * births * force)
      self%last_birth = time
      call self%add(moment / births, force, births, 1, 0.0_wp, displacement, birth, time)
   end subroutine attach

end module mesoslip_contacts_populations_pinned
