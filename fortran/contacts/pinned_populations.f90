!> Pinned contacts of infinitely many: populations of them, and what breaks of these.
!>
!> A population is what attached within one step. It is labelled by its origin, so that nothing is
!> advected, and remembers below which threshold its contacts have broken: the greatest force that
!> it has borne, in either direction.
!>
!> Thresholds may change with the age of a population: what has broken of it is told by the
!> configured threshold of the last contact that did, as contacts of one age and force break in its
!> order. It is found anew at the end of each step, from the force and the age.
!>
!> Forces of populations are in units of f_s, their stiffness of k, distances of f_s/k.
module mesoslip_contacts_pinned_populations
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_contacts_ageing_law, only: ageing_law_type
   use mesoslip_contacts_mechanics, only: breaking_distance, broken_threshold, coupling_scaled, &
      & initial_steady, initial_uniform
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_interface_law, only: pose_type
   use mesoslip_contacts_partial_moments, only: new_partial_moments, partial_moments_type
   implicit none
   private

   public :: pinned_populations_type, trial_type, new_pinned_populations, tiny_gap

   !> Moments of the thresholds of a population's pinned contacts: their number, stiffness, one over
   !> it, twice the energy that they lose in breaking, and mass.
   integer, parameter :: moments_length = 5
   integer, parameter :: number = 1, stiff = 2, compliant = 3, lost = 4, massive = 5

   !> Numbers kept for a population, besides its moments
   integer, parameter :: population_length = 8
   !> Displacement at which stretches are zero but for the force at attaching [m]
   integer, parameter :: row_origin = 1
   !> Force at attaching, signed
   integer, parameter :: row_force = 2
   !> Contacts that attached, broken or not
   integer, parameter :: row_weight = 3
   !> Threshold below which they have broken
   integer, parameter :: row_broken = 4
   !> 1 for the law of thresholds, 2 for that weighted by one over the breaking stretch
   integer, parameter :: row_law = 5
   !> Displacements at which contacts break, forward and backward [m]
   integer, parameter :: row_ahead = 6, row_behind = 7
   !> When it attached [s]
   integer, parameter :: row_birth = 8

   !> Relative width of the law of thresholds beyond which populations are not farther apart.
   real(wp), parameter :: widest_spread = 0.35_wp
   !> Length of a step over the resolution times the spread of the breaking stretches
   real(wp), parameter :: step_part = 0.6_wp
   !> Part of a population that does not break before others of it, and that does not stay behind
   !> them: what breaks is a difference of numbers with rounding errors, which are to decide nothing
   real(wp), parameter :: unresolved_part = 1.0e-12_wp
   !> Stretch beyond which the cells of the initial states of wide laws grow with it
   real(wp), parameter :: shortest_even = 0.02_wp
   !> Populations for which there is room at first
   integer, parameter :: first_places = 64
   !> Populations that are looked at together for one that breaks
   integer, parameter :: block = 8
   !> A gap that counts as none, over the length of a step.
   real(wp), parameter :: tiny_gap = 1.0e-6_wp

   !> What breaks until a displacement and time in a direction.
   type :: trial_type
      !> The displacement [m], time [s] and direction
      real(wp) :: end = 0.0_wp, time = 0.0_wp, sense = 1.0_wp
      !> The populations of which contacts break, their forces at attaching along the direction,
      !> the distances from there, the thresholds below which they will have broken, what the
      !> moments will be, and twice the energy that is lost; shape (count, or more)
      integer :: count = 0
      integer, allocatable :: population(:)
      real(wp), allocatable :: force(:), distance(:), broken(:), moments(:, :), lost(:)
      !> Breaks, and their mass; work that need not be done for them [J]
      real(wp) :: breaks = 0.0_wp, mass = 0.0_wp, work = 0.0_wp
      !> What the contacts would bear at the end [N], and how far it is [m]
      real(wp) :: drop = 0.0_wp, reach = 0.0_wp
      !> Where the next population breaks [m]
      real(wp) :: next = 0.0_wp
   end type trial_type

   !> Populations of pinned contacts.
   type :: pinned_populations_type
      !> Number of populations
      integer :: count = 0
      !> Longest way in which one population attaches [m]
      real(wp) :: step = 0.0_wp
      !> Bounds on the displacements at which contacts break next, forward and backward [m]
      real(wp) :: ahead = huge(1.0_wp), behind = -huge(1.0_wp)
      !> Total stiffness [N/m] and stiffness times origin less force at attaching [N]
      type(accumulator_type) :: stiffness, offset
      !> Mean stiffness of a contact that attaches [N/m], and the energy it gains [J]
      real(wp) :: newborn_stiffness = 0.0_wp, newborn_energy = 0.0_wp
      !> What was found to break
      type(trial_type) :: trial

      !> Whether thresholds change with age, how, and whether some fall
      logical :: ages = .false.
      type(ageing_law_type) :: ageing
      logical :: some_fall = .false.
      !> Since when all contacts age that are attached [s]
      real(wp) :: last_birth = 0.0_wp

      !> What the contacts are made of
      type(contact_parameters_type), private :: parameters
      !> Distance of a mean threshold f_s/k [m]
      real(wp), private :: stretch = 1.0_wp
      !> Threshold at which the first contacts of a population break
      real(wp), private :: first_broken = 0.0_wp
      !> Moments of the law of thresholds, and of that weighted by one over the breaking stretch
      type(partial_moments_type), private :: moments(2)
      !> Populations, shape (places, population_length), as many are in use as there are
      real(wp), allocatable, private :: population(:, :)
      !> Moments of their contacts that are left, shape (moments_length, places)
      real(wp), allocatable, private :: left(:, :)
   contains
      !> Let thresholds change with age
      procedure, non_overridable :: let_age
      !> Prepare the populations for the start of a run
      procedure, non_overridable :: initialize
      !> Attach contacts as a population
      procedure, non_overridable :: attach
      !> Find what breaks until the slider comes to a displacement, whether that is known, forget it
      procedure, non_overridable :: try
      procedure, non_overridable :: has_tried
      procedure, non_overridable :: forget_trial
      !> Break what was found to break
      procedure, non_overridable :: break_tried
      !> Find anew where populations break next, as their thresholds have changed
      procedure, non_overridable :: see_ages
      !> Move the origin of displacements
      procedure, non_overridable :: shift_origin
      !> Number of contacts
      procedure, non_overridable :: number_of_contacts
      !> Elastic energy of the contacts
      procedure, non_overridable :: elastic_energy
      !> Put the state into an archive or take it out
      procedure, non_overridable :: exchange
      procedure, non_overridable, private :: add, bear, make_room, next_break, make_room_to_try, &
         & list_breaking
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

      self%parameters = parameters
      self%stretch = parameters%static_force / parameters%stiffness
      self%step = step_part * resolution * min(parameters%law%width, widest_spread) * self%stretch
      if (parameters%coupling == coupling_scaled) self%step = 0.5_wp * self%step
      allocate (self%population(first_places, population_length), source=0.0_wp)
      allocate (self%left(moments_length, first_places), source=0.0_wp)

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
   subroutine let_age(self, ageing)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> How they change
      type(ageing_law_type), intent(in) :: ageing

      self%ages = .true.
      self%ageing = ageing
      self%some_fall = ageing%falls(self%moments(1)%least, 1.0_wp) &
         & .or. ageing%falls(self%moments(1)%greatest, 1.0_wp)
   end subroutine let_age

   !> Prepare the populations for the start of a run.
   subroutine initialize(self, state)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      real(wp) :: longest, total, back, cell, middle, edge, even

      associate (parameters => self%parameters, moments => self%moments(1))
         if (state /= initial_steady .and. state /= initial_uniform) then
            call self%add(0.0_wp, 0.0_wp, real(parameters%count, wp), 1, 0.0_wp, &
               & 0.0_wp, -self%ageing%initial_age, 0.0_wp)
         else
            back = 0.0_wp
            if (state == initial_steady) back = parameters%back_force_ratio
            longest = breaking_distance(parameters%coupling, back, moments%greatest)
            edge = 0.0_wp
            even = 1.0_wp
            if (parameters%law%width > widest_spread) even = shortest_even
            do while (edge < longest)
               ! The tails of wide laws are spread over many stretches, and smooth; many of their
               ! thresholds are small.
               cell = min(self%step / self%stretch * max(even, edge), longest - edge)
               middle = edge + 0.5_wp * cell
               edge = edge + cell
               call self%add(-middle * self%stretch, back, cell, &
                  & merge(1, 2, state == initial_steady), &
                  & broken_threshold(parameters%coupling, back, middle), 0.0_wp, &
                  & -self%ageing%initial_age, 0.0_wp)
            end do
            total = self%number_of_contacts()
            associate (weight => self%population(:self%count, row_weight), &
               & left => self%left(:, :self%count))
               weight = weight * (parameters%count / total)
               left = left * (parameters%count / total)
            end associate
         end if
      end associate
      self%last_birth = -self%ageing%initial_age
      call self%bear()
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

   !> Add a population.
   subroutine add(self, origin, force, weight, law, broken, displacement, birth, time)
      class(pinned_populations_type), intent(inout) :: self
      !> Where it attached [m], with what force, how many contacts, with which law
      real(wp), intent(in) :: origin, force, weight
      integer, intent(in) :: law
      !> Threshold below which they have broken before
      real(wp), intent(in) :: broken
      !> Where the slider is [m]: what is due to break there does so when the slider moves on
      real(wp), intent(in) :: displacement
      !> When it attached, and when that is [s]
      real(wp), intent(in) :: birth, time

      real(wp) :: moments(moments_length)

      call self%make_room()
      self%count = self%count + 1
      call self%moments(law)%interpolate(broken, moments)
      associate (place => self%count, population => self%population)
         population(place, row_origin) = origin
         population(place, row_force) = force
         population(place, row_weight) = weight
         population(place, row_law) = real(law, wp)
         population(place, row_broken) = max(broken, self%first_broken)
         population(place, row_birth) = birth
         self%left(:, place) = weight * moments
         population(place, row_ahead) = max(displacement, self%next_break(place, 1.0_wp, time))
         population(place, row_behind) = min(displacement, self%next_break(place, -1.0_wp, time))
         self%ahead = min(self%ahead, population(place, row_ahead))
         self%behind = max(self%behind, population(place, row_behind))
      end associate
   end subroutine add

   !> Make room for one more population.
   subroutine make_room(self)
      class(pinned_populations_type), intent(inout) :: self

      real(wp), allocatable :: larger(:, :)

      if (self%count < size(self%population, 1)) return
      allocate (larger(2 * self%count, population_length), source=0.0_wp)
      larger(:self%count, :) = self%population
      call move_alloc(larger, self%population)
      allocate (larger(moments_length, 2 * self%count), source=0.0_wp)
      larger(:, :self%count) = self%left
      call move_alloc(larger, self%left)
   end subroutine make_room

   !> Displacement at which contacts of a population break next in a direction.
   pure function next_break(self, place, sense, time) result(displacement)
      class(pinned_populations_type), intent(in) :: self
      integer, intent(in) :: place
      !> The direction, and when that is [s]
      real(wp), intent(in) :: sense, time
      real(wp) :: displacement

      real(wp) :: threshold

      threshold = self%population(place, row_broken)
      if (self%ages) threshold = self%ageing%threshold(threshold, 1.0_wp, &
         & time - self%population(place, row_birth))
      displacement = self%population(place, row_origin) + sense * self%stretch &
         & * breaking_distance(self%parameters%coupling, &
         & sense * self%population(place, row_force), threshold)
   end function next_break

   !> Find anew where populations break next, as their thresholds have changed.
   subroutine see_ages(self, displacement, time)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> Where the slider is [m], and when that is [s]
      real(wp), intent(in) :: displacement, time

      real(wp) :: threshold, rate
      integer :: place

      if (self%ageing%is_old(time - self%last_birth)) return
      do place = 1, self%count
         associate (one => self%population(place, :))
            call self%ageing%evaluate(one(row_broken), 1.0_wp, time - one(row_birth), threshold, &
               & rate)
            if (.not. abs(rate) > 0.0_wp) cycle
            self%population(place, row_ahead) = &
               & max(displacement, self%next_break(place, 1.0_wp, time))
            self%population(place, row_behind) = &
               & min(displacement, self%next_break(place, -1.0_wp, time))
         end associate
      end do
      self%ahead = minval(self%population(:self%count, row_ahead))
      self%behind = maxval(self%population(:self%count, row_behind))
   end subroutine see_ages

   !> Sum stiffness and offset anew, and find what breaks next.
   subroutine bear(self)
      class(pinned_populations_type), intent(inout) :: self

      integer :: place

      self%stiffness = accumulator_type()
      self%offset = accumulator_type()
      do place = 1, self%count
         associate (one => self%population(place, :), left => self%left(:, place))
            call self%stiffness%add(self%parameters%stiffness * left(stiff))
            call self%offset%add(self%parameters%stiffness * left(stiff) * one(row_origin))
            call self%offset%add(-self%parameters%static_force * left(number) * one(row_force))
         end associate
      end do
      self%ahead = minval(self%population(:self%count, row_ahead))
      self%behind = maxval(self%population(:self%count, row_behind))
   end subroutine bear

   !> Find what breaks until the slider comes to a displacement.
   subroutine try(self, before, displacement, time, sense, late, onset)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: before
      !> Where it comes to [m] and when [s], and in which direction it goes
      real(wp), intent(in) :: displacement, time, sense
      !> Breaks of populations that start to break on the way, and where most of them do so [m]
      real(wp), intent(out) :: late, onset

      real(wp) :: moments(moments_length), loss(moments_length), distance, force, broken, next
      real(wp) :: most, edge, start, breaks, mass, work, drop
      integer :: place, row, trial, listed

      start = before%displacement
      row = merge(row_ahead, row_behind, sense > 0.0_wp)
      late = 0.0_wp
      most = 0.0_wp
      onset = displacement
      edge = sense * start + tiny_gap * self%step
      call self%make_room_to_try()
      self%trial%end = displacement
      self%trial%time = time
      self%trial%sense = sense
      call self%list_breaking(displacement, sense, row, listed, next)

      ! Thresholds of all first, then moments, then losses: those of one do not wait for those of
      ! another.
      do trial = 1, listed
         place = self%trial%population(trial)
         force = sense * self%population(place, row_force)
         distance = sense * (displacement - self%population(place, row_origin)) / self%stretch
         if (self%ages) then
            broken = self%ageing%configured(max(0.0_wp, distance + force), &
               & time - self%population(place, row_birth))
         else
            broken = broken_threshold(self%parameters%coupling, force, distance)
         end if
         self%trial%force(trial) = force
         self%trial%distance(trial) = distance
         self%trial%broken(trial) = max(self%population(place, row_broken), broken)
      end do
      do trial = 1, listed
         place = self%trial%population(trial)
         call self%moments(int(self%population(place, row_law)))%interpolate( &
            & self%trial%broken(trial), moments)
         if (moments(number) < unresolved_part) moments = 0.0_wp
         self%trial%moments(:, trial) = min(self%population(place, row_weight) * moments, &
            & self%left(:, place))
      end do

      breaks = 0.0_wp
      mass = 0.0_wp
      work = 0.0_wp
      drop = 0.0_wp
      do trial = 1, listed
         place = self%trial%population(trial)
         force = self%trial%force(trial)
         distance = self%trial%distance(trial)
         loss = self%left(:, place) - self%trial%moments(:, trial)
         if (self%ages) loss(lost) = loss(lost) + loss(number) &
            & * more_lost(place, self%trial%broken(trial), distance + force)
         self%trial%lost(trial) = loss(lost)
         breaks = breaks + loss(number)
         mass = mass + loss(massive)
         drop = drop + loss(stiff) * distance + loss(number) * force
         work = work + 0.5_wp * (loss(stiff) * distance**2 &
            & + 2.0_wp * loss(number) * force * distance + loss(compliant) * force**2 - loss(lost))
         if (sense * self%population(place, row) > edge) then
            late = late + loss(number)
            if (loss(number) > most) then
               most = loss(number)
               onset = self%population(place, row)
            end if
         end if
      end do
      self%trial%breaks = breaks
      self%trial%mass = mass
      self%trial%work = work * self%parameters%static_force * self%stretch
      self%trial%drop = drop * self%parameters%static_force
      self%trial%reach = abs(displacement - start)
      self%trial%count = listed
      self%trial%next = sense * next
      if (self%trial%count == 0) then
         if (sense > 0.0_wp) self%ahead = self%trial%next
         if (sense < 0.0_wp) self%behind = self%trial%next
      end if

   contains

      !> Energy of the contacts of a population that break on the way, beyond that of their
      !> configured thresholds: twice that of each of them in the mean, if on the way the force at
      !> which they break is a line over those.
      pure function more_lost(population, last, last_force) result(energy)
         integer, intent(in) :: population
         !> Threshold below which they will have broken, and the force then
         real(wp), intent(in) :: last, last_force
         real(wp) :: energy

         real(wp) :: first, start_force, start_broken, part, first_force

         energy = 0.0_wp
         first = self%population(population, row_broken)
         if (.not. last > first) return
         start_force = max(0.0_wp, sense * self%population(population, row_force) + sense &
            & * (start - self%population(population, row_origin)) / self%stretch)
         start_broken = self%ageing%configured(start_force, &
            & before%time - self%population(population, row_birth))
         part = 0.0_wp
         if (start_broken < first) part = (first - start_broken) / (last - start_broken)
         first_force = start_force + part * (last_force - start_force)
         if (start_broken > first) first = start_broken
         energy = ((first_force**2 - first**2) + (first_force * last_force - first * last) &
            & + (last_force**2 - last**2)) / 3.0_wp
      end function more_lost

   end subroutine try

   !> Make room for a trial of all populations.
   subroutine make_room_to_try(self)
      class(pinned_populations_type), intent(inout) :: self

      integer :: places

      places = size(self%population, 1)
      if (allocated(self%trial%population)) then
         if (size(self%trial%population) == places) return
         deallocate (self%trial%population, self%trial%force, self%trial%distance, &
            & self%trial%broken, self%trial%moments, self%trial%lost)
      end if
      allocate (self%trial%population(places), self%trial%force(places), &
         & self%trial%distance(places), self%trial%broken(places))
      allocate (self%trial%moments(moments_length, places), self%trial%lost(places))
   end subroutine make_room_to_try

   !> List the populations of which contacts break until the slider comes to a displacement.
   subroutine list_breaking(self, displacement, sense, row, listed, next)
      class(pinned_populations_type), intent(inout) :: self
      !> Where the slider comes to [m], in which direction, and the row that is about this direction
      real(wp), intent(in) :: displacement, sense
      integer, intent(in) :: row
      !> How many they are, and the coordinate along the direction where the next one breaks [m]
      integer, intent(out) :: listed
      real(wp), intent(out) :: next

      real(wp) :: here, coordinate, least(4)
      integer :: first, place
      logical :: breaks

      listed = 0
      next = huge(1.0_wp)
      here = sense * displacement
      do first = 1, self%count, block
         if (first + block - 1 <= self%count) then
            ! Of most blocks no population breaks.
            associate (place_of => self%population(first:first + block - 1, row))
               least = min(sense * place_of(:4), sense * place_of(5:))
            end associate
            coordinate = min(min(least(1), least(2)), min(least(3), least(4)))
            if (coordinate > here) then
               next = min(next, coordinate)
               cycle
            end if
         end if
         ! In the others which ones do is as good as random: they are listed without a branch.
         ! Contacts whose thresholds fall may break while the slider rests.
         do place = first, min(first + block - 1, self%count)
            coordinate = sense * self%population(place, row)
            breaks = coordinate < here .or. (self%some_fall .and. .not. coordinate > here)
            self%trial%population(listed + 1) = place
            listed = listed + merge(1, 0, breaks)
            next = min(next, merge(huge(1.0_wp), coordinate, breaks))
         end do
      end do
   end subroutine list_breaking

   !> Whether it is known what breaks until the slider is at a displacement at a time.
   pure function has_tried(self, displacement, time)
      !> The populations
      class(pinned_populations_type), intent(in) :: self
      !> The displacement [m] and the time [s], on which it depends only if thresholds do
      real(wp), intent(in) :: displacement, time
      !> Whether it is
      logical :: has_tried

      has_tried = self%trial%count > 0 .and. .not. abs(self%trial%end - displacement) > 0.0_wp
      if (self%ages) has_tried = has_tried .and. .not. abs(self%trial%time - time) > 0.0_wp
   end function has_tried

   !> Forget what was found to break.
   pure subroutine forget_trial(self)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self

      self%trial%count = 0
      self%trial%breaks = 0.0_wp
      self%trial%mass = 0.0_wp
   end subroutine forget_trial

   !> Break what was found to break.
   subroutine break_tried(self, break_loss)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> Elastic energy lost by breaking [J]
      type(accumulator_type), intent(inout) :: break_loss

      type(accumulator_type) :: stiffness, offset, energy
      real(wp) :: loss(moments_length), ahead, behind
      integer :: trial, place

      ! In variables of their own, which stay in registers: each break waits for the one before.
      stiffness = self%stiffness
      offset = self%offset
      energy = break_loss
      ahead = self%ahead
      behind = self%behind
      if (self%trial%sense > 0.0_wp) then
         ahead = self%trial%next
      else
         behind = self%trial%next
      end if
      associate (population => self%population, parameters => self%parameters)
         ! The last population takes the place of one that is removed: it has had its turn.
         do trial = self%trial%count, 1, -1
            place = self%trial%population(trial)
            loss = self%left(:, place) - self%trial%moments(:, trial)
            call stiffness%add(-parameters%stiffness * loss(stiff))
            call offset%add(parameters%static_force * loss(number) &
               & * population(place, row_force) &
               & - parameters%stiffness * loss(stiff) * population(place, row_origin))
            call energy%add(0.5_wp * parameters%static_force * self%stretch &
               & * self%trial%lost(trial))
            self%left(:, place) = self%trial%moments(:, trial)
            population(place, row_broken) = self%trial%broken(trial)
            if (self%left(number, place) > 0.0_wp) then
               if (self%trial%sense > 0.0_wp) then
                  population(place, row_ahead) = self%trial%end
                  population(place, row_behind) = self%next_break(place, -1.0_wp, self%trial%time)
               else
                  population(place, row_behind) = self%trial%end
                  population(place, row_ahead) = self%next_break(place, 1.0_wp, self%trial%time)
               end if
               ahead = min(ahead, population(place, row_ahead))
               behind = max(behind, population(place, row_behind))
            else
               population(place, :) = population(self%count, :)
               self%left(:, place) = self%left(:, self%count)
               self%count = self%count - 1
            end if
         end do
      end associate
      self%stiffness = stiffness
      self%offset = offset
      break_loss = energy
      self%ahead = ahead
      self%behind = behind
      if (self%count == 0) then
         self%stiffness = accumulator_type()
         self%offset = accumulator_type()
      end if
   end subroutine break_tried

   !> Move the origin of displacements.
   subroutine shift_origin(self, shift)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      associate (all => self%population(:self%count, :))
         all(:, row_origin) = all(:, row_origin) - shift
         all(:, row_ahead) = all(:, row_ahead) - shift
         all(:, row_behind) = all(:, row_behind) - shift
      end associate
      call self%bear()
   end subroutine shift_origin

   !> Number of contacts.
   pure function number_of_contacts(self) result(total)
      !> The populations
      class(pinned_populations_type), intent(in) :: self
      !> Their number, in the mean of what it may be
      real(wp) :: total

      total = sum(self%left(number, :self%count))
   end function number_of_contacts

   !> Elastic energy of the contacts.
   pure function elastic_energy(self, displacement) result(energy)
      !> The populations
      class(pinned_populations_type), intent(in) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Energy [J]
      real(wp) :: energy

      type(accumulator_type) :: total
      real(wp) :: distance
      integer :: place

      do place = 1, self%count
         associate (force => self%population(place, row_force), &
            & left => self%left(:, place))
            distance = (displacement - self%population(place, row_origin)) / self%stretch
            call total%add(left(stiff) * distance**2 + 2.0_wp * left(number) * force &
               & * distance + left(compliant) * force**2)
         end associate
      end do
      energy = 0.5_wp * self%parameters%static_force * self%stretch * total%total()
   end function elastic_energy

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The populations
      class(pinned_populations_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%section("pinned populations")
      call archive%exchange("population", self%population)
      call archive%exchange("left", self%left)
      call archive%exchange("count", self%count)
      call archive%exchange("ahead", self%ahead)
      call archive%exchange("behind", self%behind)
      call archive%exchange("stiffness", self%stiffness)
      call archive%exchange("offset", self%offset)
      call archive%exchange("last_birth", self%last_birth)
   end subroutine exchange

end module mesoslip_contacts_pinned_populations
