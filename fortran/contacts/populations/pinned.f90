!> Pinned contacts of infinitely many: their initial states, and how they attach.
module mesoslip_contacts_populations_pinned
   use mesoslip_contacts_ageing_law, only: ageing_law_type
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_mechanics, only: breaking_distance, broken_threshold, coupling_scaled, &
      & coupling_table, initial_steady, initial_uniform
   use mesoslip_contacts_partial_moments, only: new_partial_moments
   use mesoslip_contacts_populations_activation, only: new_activation
   use mesoslip_contacts_populations_breaking, only: unresolved_part
   use mesoslip_contacts_populations_rows, only: column_origin, column_weight, compliant, &
      & moments_length, new_population_rows, number, stiff
   use mesoslip_contacts_populations_table_lives, only: new_table_lives, newborn_law
   use mesoslip_contacts_populations_thermal, only: joining_part, thermal_populations_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: pinned_populations_type, new_pinned_populations

   !> Relative width of the law of thresholds beyond which the length of steps does not grow
   real(wp), parameter :: max_spread = 0.35_wp
   !> Length of a step over the resolution times the spread of the breaking stretches
   real(wp), parameter :: step_part = 0.6_wp
   !> The same over the resolution times the correlation length of a track
   real(wp), parameter :: track_part = 0.4_wp
   !> Stretch beyond which the cells of the initial states of wide laws grow with it
   real(wp), parameter :: min_even = 0.02_wp
   !> Part of a cell that is no cell of its own
   real(wp), parameter :: tiny_part = 1.0e-6_wp
   !> Maximum length of a step in which the force hardly bends: over that by the resolution, over
   !> the spread of the breaking stretches, and over the resolution times the stretch in a life
   real(wp), parameter :: max_growth = 4.0_wp, max_part = 0.9_wp, max_stretch_part = 0.02_wp
   !> Distance of neighbouring populations over the sum of the displacements in which they attached,
   !> and maximum shift over the latter
   real(wp), parameter :: min_gap = 0.3_wp, max_gap = 0.7_wp, max_shift = 0.2_wp
   !> Maximum distance to a population that contacts join, over the length of a step, and maximum
   !> broken part of it
   real(wp), parameter :: join_part = 0.125_wp, max_loss = 1.0e-3_wp
   !> Number of forces at attaching if they have a width, evenly spaced, and their range in standard
   !> deviations
   integer, parameter :: max_classes = 25
   real(wp), parameter :: reach = 6.0_wp

   !> Populations of pinned contacts.
   type, extends(thermal_populations_type) :: pinned_populations_type
      !> Mean stiffness of a contact that attaches [N/m], and the energy it gains [J]
      real(wp) :: newborn_stiffness = 0.0_wp, newborn_energy = 0.0_wp
      !> Factor of the thresholds of contacts that attach, on a track
      real(wp) :: factor = 1.0_wp
      !> Mean relative force of a contact that attaches
      real(wp) :: newborn_force = 0.0_wp
      !> Mean stiffness of a contact that touches [N/m]
      real(wp) :: touching_stiffness = 0.0_wp
      !> Maximum displacement of a step in which the force hardly bends [m]; whether steps become
      !> longer and populations follow the density of neighbours: where thresholds are narrow
      real(wp) :: max_step = 0.0_wp
      logical :: adapts = .false.
      !> Whether contacts that attach may join a population that attached close by, as it does not
      !> matter when or at which strength
      logical, private :: may_join_any = .false.
      !> Number of forces at attaching; for each the relative force, the threshold up to which no
      !> contact can attach with it, and the shares of contacts: before the rejection of these, not
      !> normalized and normalized, and after it
      integer, private :: classes = 1
      real(wp), private :: class_force(max_classes) = 0.0_wp, class_broken(max_classes) = 0.0_wp, &
         & weight(max_classes) = 1.0_wp, share(max_classes) = 1.0_wp, &
         & newborn_share(max_classes) = 1.0_wp
   contains
      procedure, non_overridable :: set_ageing, activate, initialize, attach, touch, sum_newborns
      procedure, non_overridable, private :: tabulate_moments, place_classes, law_of, &
         & may_join_last, add_sliding, follow_neighbour
   end type pinned_populations_type

contains

   !> Set up populations without contacts, with the length of a step over the spread of the breaking
   !> stretches.
   subroutine new_pinned_populations(self, parameters, resolution)
      type(pinned_populations_type), intent(out) :: self
      type(contact_parameters_type), intent(in) :: parameters
      real(wp), intent(in) :: resolution

      call new_population_rows(self, parameters)
      self%step = step_length(parameters%law%width, resolution, self%stretch)
      if (parameters%coupling == coupling_scaled) self%step = 0.5_wp * self%step
      if (self%has_track) self%step = min(self%step, &
         & track_part * resolution * parameters%strength%correlation_length())

      self%class_force(1) = parameters%back_force_ratio
      self%newborn_force = parameters%back_force_ratio
      if (parameters%newborn_width > 0.0_wp) call self%place_classes()
      self%has_table = parameters%coupling == coupling_table
      if (self%has_table) then
         call new_table_lives(self%table_lives, parameters%law%stretch_cells(), &
            & parameters%law%mean_square_stiffness, self%class_force(:self%classes))
      else
         call self%tabulate_moments()
      end if
      self%max_step = min(max_growth * self%step, max_part * self%step / (step_part * resolution), &
         & max_stretch_part * resolution * self%stretch * (1.0_wp - parameters%back_force_ratio))
      if (self%has_track) self%max_step = self%step
      self%adapts = self%max_step > self%step
      self%may_join_any = .not. (self%has_table .or. self%has_track)
      call self%sum_newborns(1.0_wp)
   end subroutine new_pinned_populations

   !> Tabulate the moments of the law of thresholds.
   subroutine tabulate_moments(self)
      class(pinned_populations_type), intent(inout) :: self

      real(wp) :: exponent(moments_length), one_over_stretch

      exponent = [0.0_wp, 0.0_wp, 0.0_wp, 2.0_wp, 0.0_wp]
      one_over_stretch = -1.0_wp
      if (self%parameters%coupling == coupling_scaled) then
         exponent = [0.0_wp, 0.5_wp, -0.5_wp, 1.5_wp, 1.0_wp]
         one_over_stretch = -0.5_wp
      end if
      call new_partial_moments(self%moments(1), self%parameters%law, exponent)
      call new_partial_moments(self%moments(2), self%parameters%law, exponent + one_over_stretch)
      self%first_broken = self%parameters%law%quantile(1.0_wp - unresolved_part)
   end subroutine tabulate_moments

   !> Maximum displacement in which one population of equal contacts attaches [m], given the spread
   !> of the breaking stretches and f_s/k [m].
   pure function step_length(spread, resolution, stretch) result(length)
      real(wp), intent(in) :: spread, resolution, stretch
      real(wp) :: length

      length = step_part * resolution * min(spread, max_spread) * stretch
   end function step_length

   !> Let contacts break by thermal activation at a rate [1/s] with the width f_T/f_s, which spreads
   !> their breaking stretches too. Ageing is set before.
   subroutine activate(self, rate, width, resolution)
      class(pinned_populations_type), intent(inout) :: self
      real(wp), intent(in) :: rate, width, resolution

      self%adapts = .false.
      self%may_join_any = .false.
      call self%set_activation(new_activation(rate, width, self%stretch), resolution)
      self%step = step_length(hypot(self%parameters%law%width, width), resolution, self%stretch)
      self%max_step = self%step
   end subroutine activate

   !> Set the forces with which contacts attach, from a normal law.
   subroutine place_classes(self)
      class(pinned_populations_type), intent(inout) :: self

      real(wp) :: deviate
      integer :: class

      self%classes = max_classes
      do class = 1, max_classes
         ! Evenly spaced points are exact for a normal law without tails.
         deviate = reach * (2.0_wp * (class - 1) / (max_classes - 1) - 1.0_wp)
         self%class_force(class) = self%parameters%back_force_ratio &
            & + self%parameters%newborn_width * deviate
         self%weight(class) = exp(-0.5_wp * deviate**2)
         ! The law of a table with stiffnesses depends on the force.
         if (self%parameters%coupling /= coupling_table) then
            self%class_broken(class) = abs(self%class_force(class))
         end if
      end do
   end subroutine place_classes

   !> Sum up the contacts that attach: the law of forces is cut off at the thresholds, which are
   !> multiplied by a factor.
   subroutine sum_newborns(self, factor)
      class(pinned_populations_type), intent(inout) :: self
      real(wp), intent(in) :: factor

      real(wp) :: left(moments_length, max_classes), touching(moments_length)
      integer :: class

      self%factor = factor
      if (self%has_track) then
         self%class_broken(:self%classes) = abs(self%class_force(:self%classes)) / factor
         if (self%ages) self%class_broken(1) = max(self%class_broken(1), &
            & self%ageing%configured(self%class_broken(1), 0.0_wp))
      end if
      do class = 1, self%classes
         if (self%has_table) then
            call self%table_lives%left(newborn_law(class, 1.0_wp), 0.0_wp, 0.0_wp, left(:, class))
         else
            call self%moments(1)%interpolate(self%class_broken(class), left(:, class))
         end if
      end do
      associate (static => self%parameters%static_force, share => self%share(:self%classes), &
         & force => self%class_force(:self%classes), all => left(:, :self%classes))
         if (self%classes > 1 .or. self%has_track) then
            share = self%weight(:self%classes) / sum(self%weight(:self%classes) * all(number, :))
            self%newborn_share(:self%classes) = share * all(number, :)
            self%newborn_force = sum(share * all(number, :) * force)
         end if
         self%newborn_stiffness = self%parameters%stiffness * sum(share * all(stiff, :))
         if (self%has_table) then
            call self%table_lives%left(1, 0.0_wp, 0.0_wp, touching)
         else
            call self%moments(1)%interpolate(0.0_wp, touching)
         end if
         self%touching_stiffness = self%parameters%stiffness * touching(stiff)
         self%newborn_energy = 0.5_wp * sum(share * all(compliant, :) * force**2) * static &
            & * self%stretch
      end associate
   end subroutine sum_newborns

   !> Let thresholds change with age.
   subroutine set_ageing(self, ageing)
      class(pinned_populations_type), intent(inout) :: self
      type(ageing_law_type), intent(in) :: ageing

      self%ages = .true.
      self%may_join_any = .false.
      self%ageing = ageing
      self%some_fall = ageing%falls(self%moments(1)%min_threshold, 1.0_wp) &
         & .or. ageing%falls(self%moments(1)%max_threshold, 1.0_wp)
   end subroutine set_ageing

   !> Prepare the populations for the start of a run.
   subroutine initialize(self, state, error)
      class(pinned_populations_type), intent(inout) :: self
      integer, intent(in) :: state
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: class
      real(wp) :: total

      if (state == initial_steady) then
         do class = 1, self%classes
            call self%add_sliding(self%class_force(class), self%share(class), &
               & self%law_of(class, 1.0_wp), self%class_broken(class), error)
         end do
      else if (state == initial_uniform) then
         call self%add_sliding(0.0_wp, 1.0_wp, 2, 0.0_wp, error)
      else
         call self%add(0.0_wp, 0.0_wp, self%factor, real(self%parameters%count, wp), 1, 0.0_wp, &
            & 0.0_wp, -self%ageing%initial_age, 0.0_wp, error)
      end if
      if (allocated(error)) return
      if (state == initial_steady .or. state == initial_uniform) then
         total = self%number_of_contacts()
         associate (weight => self%population(:self%count, column_weight), &
            & left => self%left(:, :self%count))
            weight = weight * (self%parameters%count / total)
            left = left * (self%parameters%count / total)
         end associate
      end if
      self%last_birth = -self%ageing%initial_age
      call self%sum_forces()
   end subroutine initialize

   !> Add contacts that attached with one force, evenly in displacement.
   subroutine add_sliding(self, force, share, moments, broken, error)
      class(pinned_populations_type), intent(inout) :: self
      !> Relative force at attaching, and relative number of contacts
      real(wp), intent(in) :: force, share
      !> Index of their moments
      integer, intent(in) :: moments
      !> Relative threshold up to which no contact attached
      real(wp), intent(in) :: broken
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: bound(0:2), left, cell, middle, edge, even, reached
      integer :: part

      associate (coupling => self%parameters%coupling)
         ! Where contacts start to break their number may have a kink: a cell ends there.
         bound = 0.0_wp
         if (self%has_table) then
            bound(1:) = [max(0.0_wp, self%table_lives%shortest(moments, 1.0_wp)), &
               & self%table_lives%longest(moments)]
         else
            bound(1:) = max(0.0_wp, self%factor * breaking_distance(coupling, &
               & force / self%factor, [self%moments(1)%min_threshold, &
               & self%moments(1)%max_threshold]))
         end if
         even = 1.0_wp
         if (self%parameters%law%width > max_spread) even = min_even
         do part = 1, 2
            edge = bound(part - 1)
            do while (edge < bound(part) .and. .not. allocated(error))
               ! The tails of wide laws are spread over many stretches, and smooth; many of their
               ! thresholds are small.
               cell = self%step / self%stretch * max(even, edge)
               left = bound(part) - edge
               cell = left / max(1, ceiling(left / cell - tiny_part))
               middle = edge + 0.5_wp * cell
               edge = edge + cell
               if (.not. cell < left) edge = bound(part)
               reached = middle
               if (.not. self%has_table) then
                  reached = max(broken, broken_threshold(coupling, force / self%factor, &
                     & middle / self%factor))
               end if
               call self%add(-middle * self%stretch, force, self%factor, share * cell, moments, &
                  & reached, 0.0_wp, -self%ageing%initial_age, 0.0_wp, error)
            end do
         end do
      end associate
   end subroutine add_sliding

   !> Attach contacts as one population for each force, at their mean displacement, or let them join
   !> others.
   subroutine attach(self, births, origin, variance, direction, slowness, displacement, birth, &
      & time, lost, error)
      class(pinned_populations_type), intent(inout) :: self
      !> Number of contacts, mean [m] and variance [m2] of the displacements at which they attach,
      !> direction of their forces, and time over displacement in the motion [s/m]
      real(wp), intent(in) :: births, origin, variance, direction, slowness
      !> Displacement of the slider [m], mean time of attaching, and time [s]
      real(wp), intent(in) :: displacement, birth, time
      !> Elastic energy that is lost as contacts join others [J]
      real(wp), intent(out) :: lost
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: force, mean_force, moments(moments_length)
      integer :: class, row
      logical :: joins

      call self%stiffness%add(self%newborn_stiffness * births)
      call self%offset%add(births * (self%newborn_stiffness * origin &
         & - self%parameters%static_force * (direction * self%newborn_force)))
      self%last_birth = time
      lost = 0.0_wp
      joins = .false.
      if (self%is_thermal) joins = self%may_join_last(origin, birth, direction)
      do class = 1, self%classes
         force = direction * self%class_force(class)
         mean_force = force + 0.5_wp * (displacement - origin) / self%stretch
         row = 0
         if (self%may_join_any) then
            call self%moments(1)%interpolate(self%class_broken(class), moments)
            if (moments(number) > 0.0_wp) row = self%row_to_join(origin, force, &
               & join_part * self%step, (1.0_wp - max_loss) * moments(number))
         end if
         if (row > 0) then
            call self%join(row, origin, self%class_broken(class), &
               & self%share(class) * births * moments, displacement, time, lost)
         else if (joins) then
            call self%join_last(self%count - self%classes + class, origin, birth, &
               & self%class_broken(class), births * self%newborn_share(class), mean_force, &
               & displacement, time, lost)
         else
            call self%add(origin, force, self%factor, self%share(class) * births, &
               & self%law_of(class, direction), self%class_broken(class), displacement, birth, &
               & time, error)
            if (allocated(error)) return
            if (self%is_thermal) call self%begin_hazard(self%count, time - birth, mean_force)
         end if
      end do
      if (self%adapts .and. self%classes == 1) call self%follow_neighbour(row, births, &
         & sqrt(12.0_wp * variance), direction, slowness, displacement, time, lost)
      if (joins .or. .not. self%is_thermal) return
      self%open_count = self%classes
      self%open_origin = origin
      self%open_direction = direction
   end subroutine attach

   !> Shift the origins of the last two populations, neighbours of different density.
   !>
   !> A sum over populations at their mean origins lacks the spread of each: its error is that of a
   !> sum of a_i f'' with a = births * width**2 / 24. With f'' by the differences of f' between
   !> neighbours it becomes one of f', which shifts of the origins cancel.
   subroutine follow_neighbour(self, joined, births, width, direction, slowness, displacement, &
      & time, lost)
      class(pinned_populations_type), intent(inout) :: self
      !> Population that the contacts joined, 0 if none; their number, the displacement in which
      !> they attached [m], direction of their forces, and time over displacement [s/m]
      integer, intent(in) :: joined
      real(wp), intent(in) :: births, width, direction, slowness
      !> Displacement of the slider [m], and time [s]
      real(wp), intent(in) :: displacement, time
      !> Elastic energy, to which that lost by the shifts is added [J]
      real(wp), intent(inout) :: lost

      real(wp) :: last_width, gap, moment

      if (joined > 0) then
         self%newest = 0
         return
      end if
      last_width = direction * self%newest_width
      if (self%newest > 0 .and. last_width > 0.0_wp) then
         gap = direction * (self%population(self%count, column_origin) &
            & - self%population(self%newest, column_origin))
         if (gap > min_gap * (width + last_width) .and. gap < max_gap * (width + last_width)) then
            moment = direction * (self%newest_births * last_width - births * width) / 48.0_wp
            call self%shift_row(self%newest, bounded(moment / self%newest_births, &
               & max_shift * last_width), slowness, displacement, time, lost)
            call self%shift_row(self%count, bounded(moment / births, max_shift * width), &
               & slowness, displacement, time, lost)
         end if
      end if
      self%newest = self%count
      self%newest_births = births
      self%newest_width = direction * width
   end subroutine follow_neighbour

   !> A number, or the nearest one within a bound.
   elemental function bounded(number, bound)
      real(wp), intent(in) :: number, bound
      real(wp) :: bounded

      bounded = max(-bound, min(bound, number))
   end function bounded

   !> Let contacts touch as one population without a force.
   subroutine touch(self, contacts, factor, origin, birth, displacement, time, error)
      class(pinned_populations_type), intent(inout) :: self
      !> Their number, the factor of their thresholds on a track, and where [m] and when [s] they
      !> touch on average
      real(wp), intent(in) :: contacts, factor, origin, birth
      !> Displacement of the slider [m], and time [s]
      real(wp), intent(in) :: displacement, time
      type(error_type), allocatable, intent(inout) :: error

      call self%add(origin, 0.0_wp, factor, contacts, 1, 0.0_wp, displacement, birth, time, error)
      if (allocated(error)) return
      if (self%is_thermal) call self%begin_hazard(self%count, time - birth, &
         & 0.5_wp * (displacement - origin) / self%stretch)
      call self%stiffness%add(self%touching_stiffness * contacts)
      call self%offset%add(self%touching_stiffness * contacts * origin)
      self%last_birth = time
      ! Contacts that attach later do not join these.
      self%open_count = 0
   end subroutine touch

   !> Law of the contacts that attach with one of the forces in a direction of motion.
   pure function law_of(self, class, direction) result(law)
      class(pinned_populations_type), intent(in) :: self
      integer, intent(in) :: class
      real(wp), intent(in) :: direction
      integer :: law

      law = 1
      if (self%has_table) law = newborn_law(class, direction)
   end function law_of

   !> Whether contacts that attach at an origin [m] and a time [s] may join the last populations.
   pure function may_join_last(self, origin, birth, direction) result(joins)
      class(pinned_populations_type), intent(in) :: self
      real(wp), intent(in) :: origin, birth, direction
      logical :: joins

      integer :: row

      joins = self%open_count == self%classes .and. self%open_direction * direction > 0.0_wp &
         & .and. abs(origin - self%open_origin) <= joining_part * self%step
      do row = self%count - self%open_count + 1, self%count
         joins = joins .and. self%may_join(row, birth)
      end do
   end function may_join_last

end module mesoslip_contacts_populations_pinned
