!> Infinitely many contacts: the master equation under a slider that moves as it likes.
!>
!> A population is what attached within one step. It is labelled by its origin, so that nothing is
!> advected, and remembers below which threshold its contacts have broken: the greatest force that
!> it has borne, in either direction. A step of the slider is so short that its populations are
!> points of a smooth density of origins. Over a step the contact force is a line that
!> does the work of the true force, which is known in advance, so the steps are of second order.
!> Work that a step did not do after all, the next ones make up for. The jump of the force between
!> two lines is the estimate of the error.
!>
!> Thresholds may change with the age of a population: what has broken of it is told by the
!> configured threshold of the last contact that did, as contacts of one age and force break in its
!> order. It is found anew at the end of each step, from the force and the age.
!>
!> Forces of populations are in units of f_s, their stiffness of k, distances of f_s/k.
module mesoslip_contacts_populations
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_ageing_law, only: ageing_law_type, take_ageing_law
   use mesoslip_contacts_mechanics, only: breaking_distance, broken_threshold, coupling_scaled, &
      & initial_steady, initial_uniform
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type, exchange_contacts
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_contacts_partial_moments, only: new_partial_moments, partial_moments_type
   implicit none
   private

   public :: contact_populations_type, new_contact_populations, make_contact_populations
   public :: make_ageing_populations

   !> Moments of the thresholds of a population's pinned contacts: their number, stiffness, one over
   !> it, twice the energy that they lose in breaking, and mass.
   integer, parameter :: moments_length = 5
   integer, parameter :: number = 1, stiff = 2, compliant = 3, lost = 4, massive = 5

   !> Numbers kept for a population
   integer, parameter :: population_length = 8 + moments_length
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
   !> The moments come after these
   integer, parameter :: row_moments = 8

   !> Numbers kept for detached contacts: they broke evenly from one time to another [s], so many,
   !> with such a mass
   integer, parameter :: packet_length = 4
   integer, parameter :: row_start = 1, row_end = 2, row_number = 3, row_mass = 4

   !> Relative width of the law of thresholds beyond which steps do not become longer.
   real(wp), parameter :: widest_spread = 0.35_wp
   !> Part of the contacts that attach in a step of resolution 1 at most.
   real(wp), parameter :: most_attached_part = 0.1_wp
   !> Part of the contacts that is too small to attach again
   real(wp), parameter :: negligible_part = 1.0e-30_wp
   !> Part of a step's length below which a slider creeps
   real(wp), parameter :: creeping_part = 0.01_wp
   !> A step may last so many times as long as expected
   real(wp), parameter :: patience = 1.5_wp
   !> Times beyond which nothing is expected [s]
   real(wp), parameter :: longest_time = 1.0e30_wp
   !> Stretch beyond which the cells of the initial states of wide laws grow with it
   real(wp), parameter :: shortest_even = 0.02_wp
   !> Populations and packets for which there is room at first
   integer, parameter :: first_places = 64
   !> Populations whose work is that of one contact that breaks
   real(wp), parameter :: populations_per_cost = 16.0_wp
   !> A gap that counts as none, over the length of a step.
   real(wp), parameter :: tiny_gap = 1.0e-6_wp

   !> What is expected to attach in a step.
   type :: expected_births_type
      !> How many contacts, and their mass
      real(wp) :: number = 0.0_wp, mass = 0.0_wp
      !> Sums over them of the time from the start of the step [s], and of its square
      real(wp) :: moment = 0.0_wp, square = 0.0_wp
      !> Until when the step may last for it [s]
      real(wp) :: end_time = huge(1.0_wp)
   end type expected_births_type

   !> Populations of contacts.
   type, extends(contacts_type) :: contact_populations_type
      !> Whether thresholds change with age, and how
      logical :: ages = .false.
      type(ageing_law_type) :: ageing
      !> Whether some thresholds fall, and over what part of the time of ageing a step may last then
      logical, private :: some_fall = .false.
      real(wp), private :: resolution = 1.0_wp
      !> Since when all contacts age that are attached [s], and how long this step may last for
      !> those whose thresholds fall [s]
      real(wp), private :: last_birth = 0.0_wp, longest_fall = huge(1.0_wp)

      !> Number of populations
      integer :: count = 0
      !> Length of a step [m]
      real(wp) :: step = 0.0_wp

      !> Work that steps should have done and did not [J]: the next ones make up for it
      real(wp), private :: debt = 0.0_wp
      !> The law that was offered for the step, if one was
      type(interface_law_type), private :: offered
      logical, private :: offers = .false.

      !> First and last packet of detached contacts
      integer, private :: first = 1, last = 0
      !> Part of the first one that is attached again
      real(wp), private :: attached_part = 0.0_wp
      !> Number and mass of the detached contacts
      type(accumulator_type), private :: detached_number, detached_mass
      !> Bounds on the displacements at which contacts break next, forward and backward [m]
      real(wp), private :: ahead = huge(1.0_wp), behind = -huge(1.0_wp)
      !> Total stiffness [N/m] and stiffness times origin less force at attaching [N]
      type(accumulator_type), private :: stiffness, offset

      !> What breaks until a displacement and time in a direction: the populations, the thresholds
      !> below which they will have broken, and what they will be
      real(wp), private :: trial_end = 0.0_wp, trial_time = 0.0_wp, trial_sense = 1.0_wp
      integer, private :: trials = 0
      integer, allocatable, private :: trial_population(:)
      real(wp), allocatable, private :: trial_broken(:), trial_moments(:, :), trial_lost(:)
      !> Breaks then, and their mass; work that need not be done for them [J]
      real(wp), private :: trial_breaks = 0.0_wp, trial_mass = 0.0_wp, trial_work = 0.0_wp
      !> Where the next population breaks [m]
      real(wp), private :: trial_next = 0.0_wp

      !> Distance of a mean threshold f_s/k [m]
      real(wp), private :: stretch = 1.0_wp
      !> Contacts that attach in one step at most, when the slider moves and when it rests
      real(wp), private :: most_attached = 0.0_wp, most_attached_at_rest = 0.0_wp
      !> Breaks in one step of populations that start to break in it, at most
      real(wp), private :: most_late = 0.0_wp
      !> Mean stiffness of a contact that attaches [N/m], and the energy it gains [J]
      real(wp), private :: newborn_stiffness = 0.0_wp, newborn_energy = 0.0_wp
      !> Moments of the law of thresholds, and of that weighted by one over the breaking stretch
      type(partial_moments_type), private :: moments(2)
      !> Populations, shape (places, population_length), as many as are in use or more
      real(wp), allocatable, private :: population(:, :)
      !> Packets of detached contacts, shape (packet_length, places)
      real(wp), allocatable, private :: packet(:, :)
   contains
      procedure :: initialize
      procedure :: law
      procedure :: offer
      procedure :: respond
      procedure :: shift_origin
      procedure :: elastic_energy
      procedure :: exchange
      procedure :: rebuild
      !> Number of contacts that are pinned
      procedure :: pinned
      procedure, private :: add_population, bear, try, try_until, break_tried, see_ages
      procedure, private :: make_room, make_room_for_packets
      procedure, private :: expect, attach_due
   end type contact_populations_type

contains

   !> Set up populations.
   subroutine new_contact_populations(self, parameters, resolution, error)
      !> The populations
      type(contact_populations_type), intent(out) :: self
      !> What the contacts are made of
      type(contact_parameters_type), intent(in) :: parameters
      !> Length of a step over the spread of the breaking stretches, positive
      real(wp), intent(in) :: resolution
      !> Set if the resolution is not positive
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: exponent(moments_length), one_over_stretch, all(moments_length)

      if (.not. resolution > 0.0_wp) then
         call raise(error, status_invalid, "the resolution of populations must be positive")
         return
      end if
      self%parameters = parameters
      self%stretch = parameters%static_force / parameters%stiffness
      self%step = resolution * min(parameters%law%width, widest_spread) * self%stretch
      if (parameters%coupling == coupling_scaled) self%step = 0.5_wp * self%step
      self%most_attached = parameters%count * resolution * most_attached_part
      allocate (self%population(first_places, population_length), source=0.0_wp)
      allocate (self%packet(packet_length, first_places), source=0.0_wp)
      self%most_attached_at_rest = self%most_attached * min(resolution, most_attached_part)
      self%most_late = self%most_attached * resolution

      exponent = [0.0_wp, 0.0_wp, 0.0_wp, 2.0_wp, 0.0_wp]
      one_over_stretch = -1.0_wp
      if (parameters%coupling == coupling_scaled) then
         exponent = [0.0_wp, 0.5_wp, -0.5_wp, 1.5_wp, 1.0_wp]
         one_over_stretch = -0.5_wp
      end if
      call new_partial_moments(self%moments(1), parameters%law, exponent)
      call new_partial_moments(self%moments(2), parameters%law, exponent + one_over_stretch)
      call self%moments(1)%interpolate(0.0_wp, all)
      self%newborn_stiffness = parameters%stiffness * all(stiff)
      self%newborn_energy = 0.5_wp * parameters%back_force_ratio**2 * all(compliant) &
         & * parameters%static_force * self%stretch
   end subroutine new_contact_populations

   !> Set up populations from named numbers.
   subroutine make_contact_populations(contacts, common, parameters, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> What all kinds of contacts are made of
      type(contact_parameters_type), intent(in) :: common
      !> The other number: resolution
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing, or the resolution is not positive
      type(error_type), allocatable, intent(inout) :: error

      type(contact_populations_type), allocatable :: populations
      real(wp) :: resolution

      call parameters%take("resolution", resolution, error)
      call parameters%finish(error)
      if (allocated(error)) return
      allocate (populations)
      call new_contact_populations(populations, common, resolution, error)
      call move_alloc(populations, contacts)
   end subroutine make_contact_populations

   !> Set up populations whose thresholds change with age from named numbers.
   subroutine make_ageing_populations(contacts, common, parameters, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> What all kinds of contacts are made of
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: resolution, and the law of ageing
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong
      type(error_type), allocatable, intent(inout) :: error

      type(contact_populations_type), allocatable :: populations
      type(contact_parameters_type) :: all
      type(ageing_law_type) :: ageing
      real(wp) :: resolution

      all = common
      call parameters%take("resolution", resolution, error)
      call take_ageing_law(ageing, all%law, parameters, error)
      call parameters%finish(error)
      if (allocated(error)) return
      allocate (populations)
      call new_contact_populations(populations, all, resolution, error)
      if (allocated(error)) return
      populations%ages = .true.
      populations%ageing = ageing
      associate (moments => populations%moments(1))
         if (ageing%falls(moments%least, 1.0_wp) .or. ageing%falls(moments%greatest, 1.0_wp)) then
            populations%some_fall = .true.
         end if
      end associate
      populations%resolution = resolution
      call move_alloc(populations, contacts)
   end subroutine make_ageing_populations

   !> Prepare the populations for the start of a run.
   subroutine initialize(self, state)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      real(wp) :: longest, total, back, cell, middle, edge, even

      associate (parameters => self%parameters, moments => self%moments(1))
         if (state /= initial_steady .and. state /= initial_uniform) then
            call self%add_population(0.0_wp, 0.0_wp, real(parameters%count, wp), 1, 0.0_wp, &
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
               call self%add_population(-middle * self%stretch, back, cell, &
                  & merge(1, 2, state == initial_steady), &
                  & broken_threshold(parameters%coupling, back, middle), 0.0_wp, &
                  & -self%ageing%initial_age, 0.0_wp)
            end do
            total = sum(self%population(:self%count, row_moments + number))
            associate (all => self%population(:self%count, :))
               all(:, row_weight) = all(:, row_weight) * (parameters%count / total)
               all(:, row_moments + 1:) = all(:, row_moments + 1:) * (parameters%count / total)
            end associate
         end if
      end associate
      self%last_birth = -self%ageing%initial_age
      call self%bear()
   end subroutine initialize

   !> Add a population.
   subroutine add_population(self, origin, force, weight, law, broken, displacement, birth, time)
      class(contact_populations_type), intent(inout) :: self
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
         population(place, row_broken) = max(broken, self%moments(law)%least)
         population(place, row_birth) = birth
         population(place, row_moments + 1:) = weight * moments
         population(place, row_ahead) = max(displacement, next_break(self, place, 1.0_wp, time))
         population(place, row_behind) = min(displacement, next_break(self, place, -1.0_wp, time))
         self%ahead = min(self%ahead, population(place, row_ahead))
         self%behind = max(self%behind, population(place, row_behind))
      end associate
   end subroutine add_population

   !> Make room for one more population.
   subroutine make_room(self)
      class(contact_populations_type), intent(inout) :: self

      real(wp), allocatable :: larger(:, :)

      if (self%count < size(self%population, 1)) return
      allocate (larger(2 * self%count, population_length), source=0.0_wp)
      larger(:self%count, :) = self%population
      call move_alloc(larger, self%population)
   end subroutine make_room

   !> Displacement at which contacts of a population break next in a direction.
   pure function next_break(self, place, sense, time) result(displacement)
      class(contact_populations_type), intent(in) :: self
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
      class(contact_populations_type), intent(inout) :: self
      !> Where the slider is [m], and when that is [s]
      real(wp), intent(in) :: displacement, time

      real(wp) :: threshold, rate
      integer :: place

      if (self%ageing%is_old(time - self%last_birth)) return
      do place = 1, self%count
         associate (one => self%population(place, :))
            call self%ageing%follow(one(row_broken), 1.0_wp, time - one(row_birth), threshold, rate)
            if (.not. abs(rate) > 0.0_wp) cycle
            self%population(place, row_ahead) = &
               & max(displacement, next_break(self, place, 1.0_wp, time))
            self%population(place, row_behind) = &
               & min(displacement, next_break(self, place, -1.0_wp, time))
         end associate
      end do
      self%ahead = minval(self%population(:self%count, row_ahead))
      self%behind = maxval(self%population(:self%count, row_behind))
   end subroutine see_ages

   !> Sum stiffness and offset anew, and find what breaks next.
   subroutine bear(self)
      class(contact_populations_type), intent(inout) :: self

      integer :: place

      self%stiffness = accumulator_type()
      self%offset = accumulator_type()
      do place = 1, self%count
         associate (one => self%population(place, :))
            call self%stiffness%add(self%parameters%stiffness * one(row_moments + stiff))
            call self%offset%add(self%parameters%stiffness * one(row_moments + stiff) &
               & * one(row_origin))
            call self%offset%add(-self%parameters%static_force * one(row_moments + number) &
               & * one(row_force))
         end associate
      end do
      self%ahead = minval(self%population(:self%count, row_ahead))
      self%behind = maxval(self%population(:self%count, row_behind))
   end subroutine bear

   !> Contact force as a law, for a slider that does not move.
   pure function law(self)
      !> The populations
      class(contact_populations_type), intent(in) :: self
      !> The law
      type(interface_law_type) :: law

      law%stiffness = self%stiffness%total()
      law%offset = self%offset%total()
      law%drag = self%parameters%drag * self%detached_mass%total()
   end function law

   !> Contact force as a law, and where it holds: until contacts break, or for a step.
   subroutine offer(self, pose, law, window)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> The law
      type(interface_law_type), intent(out) :: law
      !> Where it holds
      type(window_type), intent(out) :: window

      real(wp) :: sense, duration, reach, part, way, slack
      logical :: breaks, rests, creeps
      type(expected_births_type) :: births

      sense = pose%sense
      if (.not. abs(pose%velocity) > 0.0_wp .and. abs(pose%acceleration) > 0.0_wp) then
         sense = sign(1.0_wp, pose%acceleration)
      end if
      rests = pose%velocity**2 <= creeping_part * sense * pose%acceleration * self%step
      slack = tiny_gap * self%step
      reach = self%step
      if (sense > 0.0_wp) then
         breaks = self%ahead - pose%displacement <= slack
      else
         breaks = pose%displacement - self%behind <= slack
      end if
      self%trials = 0
      self%trial_breaks = 0.0_wp
      self%trial_mass = 0.0_wp
      self%longest_fall = huge(1.0_wp)
      if (self%some_fall) self%longest_fall = time_to_fall(self, pose, &
         & time_to_move(pose, sense, reach))
      if (breaks) call self%try(pose, sense, reach)
      breaks = self%trials > 0
      duration = time_to_move(pose, sense, reach)
      part = way_made(pose, sense, duration) / reach
      call self%expect(pose%time, duration, part * self%trial_breaks, self%most_attached, births)
      creeps = .false.
      if (births%number > 0.0_wp) then
         creeps = rests .or. way_made(pose, sense, min(duration, births%end_time - pose%time)) &
            & < creeping_part * self%step
      end if
      if (creeps) then
         ! The slider may turn at any time, and with it the force of what attaches, which cannot be
         ! known: little may attach until it can.
         if (rests) duration = sqrt(creeping_part) * duration
         part = way_made(pose, sense, duration) / reach
         call self%expect(pose%time, duration, part * self%trial_breaks, &
            & self%most_attached_at_rest, births)
      end if
      window%end_time = births%end_time
      if (self%some_fall) then
         window%end_time = min(window%end_time, pose%time + self%longest_fall)
      end if

      window%upper = max(self%ahead, pose%displacement)
      window%lower = min(self%behind, pose%displacement)
      if (breaks .or. births%number > 0.0_wp) then
         ! Contacts break one way and attach with a force against it: the step ends where the slider
         ! turns round.
         if (sense > 0.0_wp) then
            window%upper = pose%displacement + reach
            if (.not. breaks) window%upper = min(window%upper, max(self%ahead, pose%displacement))
            window%lower = pose%displacement
            if (.not. pose%velocity > 0.0_wp) window%lower = window%lower - slack
         else
            window%lower = pose%displacement - reach
            if (.not. breaks) window%lower = max(window%lower, min(self%behind, pose%displacement))
            window%upper = pose%displacement
            if (.not. pose%velocity < 0.0_wp) window%upper = window%upper + slack
         end if
      end if

      ! What an observer sees in the step is its middle; the step may end before all breaks.
      duration = min(duration, births%end_time - pose%time)
      way = way_made(pose, sense, duration)
      part = way / reach
      self%detached_count = max(0.0_wp, self%detached_number%total() &
         & + 0.5_wp * (part * self%trial_breaks - births%number))
      law = self%law()
      law%drag = max(0.0_wp, law%drag &
         & + 0.5_wp * self%parameters%drag * (part * self%trial_mass - births%mass))
      ! Lines that do the right work in the step, and start from the force there is: it does not
      ! depend on the direction in which the slider goes on.
      if (breaks) call add_line(0.0_wp, -2.0_wp * self%trial_work / reach**2)
      if (births%number > 0.0_wp) then
         if (.not. creeps) then
            call add_births()
         else if (.not. abs(pose%velocity) + abs(pose%acceleration) > 0.0_wp) then
            ! While the slider rests the force is what it will be on average.
            call add_line(sense * 0.5_wp * births%number * self%parameters%static_force &
               & * self%parameters%back_force_ratio, 0.0_wp)
         end if
      end if
      if ((breaks .or. births%number > 0.0_wp) .and. .not. rests) then
         call add_line(sense * self%debt / self%step, 0.0_wp)
      end if
      self%offered = law
      self%offers = .true.

   contains

      !> Add a force and its change with the way that the slider makes in the step.
      subroutine add_line(force, slope)
         real(wp), intent(in) :: force, slope

         law%stiffness = law%stiffness + slope
         law%offset = law%offset + slope * pose%displacement - force
      end subroutine add_line

      !> Add what the contacts that attach in the step will bear.
      subroutine add_births()
         real(wp) :: time, square, place, sum, force

         time = births%moment / births%number
         square = births%square / births%number
         place = abs(pose%velocity) * time + 0.5_wp * sense * pose%acceleration * square
         sum = births%number * self%parameters%static_force * self%parameters%back_force_ratio
         ! The line is that of contacts which attach evenly on the way; what it starts with makes up
         ! for the work when the velocity changes in the step.
         force = sum * 0.5_wp * sense * pose%acceleration * (time * duration - square) / way
         call add_line(sense * force, (2.0_wp * sum * (1.0_wp - time / duration) &
            & + self%newborn_stiffness * births%number * (way - place)**2 / way) / way)
      end subroutine add_births

   end subroutine offer

   !> Time in which the slider will move by a distance, or turn round; huge if it does not move.
   pure function time_to_move(pose, sense, distance) result(time)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: sense, distance
      real(wp) :: time

      real(wp) :: speed, square

      speed = abs(pose%velocity)
      square = speed**2 + 2.0_wp * sense * pose%acceleration * distance
      time = huge(1.0_wp)
      if (square > 0.0_wp) then
         speed = speed + sqrt(square)
         if (speed > distance / time) time = 2.0_wp * distance / speed
      else if (speed > 0.0_wp) then
         time = speed / abs(pose%acceleration)
      end if
   end function time_to_move

   !> How long a step may last while thresholds fall, so that contacts let go in time that do so at
   !> rest; while the slider moves its steps are short enough.
   pure function time_to_fall(self, pose, duration) result(time)
      class(contact_populations_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      !> Time in which the slider makes a step [s]
      real(wp), intent(in) :: duration
      real(wp) :: time

      real(wp) :: age

      time = huge(1.0_wp)
      age = pose%time - self%last_birth
      if (self%ageing%is_old(age)) return
      time = self%resolution * max(self%ageing%time, age, self%parameters%delay)
      if (duration < longest_time) time = max(time, creeping_part * duration)
      time = max(time, nearest(pose%time, huge(1.0_wp)) - pose%time)
   end function time_to_fall

   !> Way that the slider will make in a time, in the direction in which it moves.
   pure function way_made(pose, sense, time) result(way)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: sense, time
      real(wp) :: way

      way = 0.0_wp
      if (time < longest_time) then
         way = time * (abs(pose%velocity) + 0.5_wp * sense * pose%acceleration * time)
      end if
   end function way_made

   !> Find what breaks on a way of the slider.
   !>
   !> Where many populations start to break together, as they do where the slider turned before, the
   !> force has a kink: a way ends there.
   subroutine try(self, pose, sense, way)
      class(contact_populations_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> In which direction it goes
      real(wp), intent(in) :: sense
      !> Length of the way [m]
      real(wp), intent(inout) :: way

      real(wp) :: late, onset, displacement

      call self%try_until(pose, pose%displacement + sense * way, expected_time(way), sense, late, &
         & onset)
      if (late > self%most_late) then
         displacement = onset
         way = abs(displacement - pose%displacement)
         call self%try_until(pose, displacement, expected_time(way), sense, late, onset)
      end if

   contains

      !> When the slider will be at the end of its way [s].
      pure function expected_time(distance) result(time)
         real(wp), intent(in) :: distance
         real(wp) :: time

         time = pose%time
         if (self%ages) time = pose%time &
            & + min(time_to_move(pose, sense, distance), self%longest_fall, longest_time)
      end function expected_time

   end subroutine try

   !> Find what breaks until the slider comes to a displacement.
   subroutine try_until(self, before, displacement, time, sense, late, onset)
      class(contact_populations_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: before
      !> Where it comes to [m] and when [s], and in which direction it goes
      real(wp), intent(in) :: displacement, time, sense
      !> Breaks of populations that start to break on the way, and where most of them do so [m]
      real(wp), intent(out) :: late, onset

      real(wp) :: moments(moments_length), loss(moments_length), distance, force, broken, next
      real(wp) :: most, edge, start
      integer :: place, row, trial, listed
      logical :: breaks

      start = before%displacement
      row = merge(row_ahead, row_behind, sense > 0.0_wp)
      next = huge(1.0_wp)
      late = 0.0_wp
      most = 0.0_wp
      onset = displacement
      edge = sense * start + tiny_gap * self%step
      if (allocated(self%trial_population)) then
         if (size(self%trial_population) < self%count) then
            deallocate (self%trial_population, self%trial_broken, self%trial_moments, &
               & self%trial_lost)
         end if
      end if
      if (.not. allocated(self%trial_population)) then
         associate (places => size(self%population, 1))
            allocate (self%trial_population(places), self%trial_broken(places))
            allocate (self%trial_moments(moments_length, places), self%trial_lost(places))
         end associate
      end if
      self%trial_end = displacement
      self%trial_time = time
      self%trial_sense = sense
      self%trial_breaks = 0.0_wp
      self%trial_mass = 0.0_wp
      self%trial_work = 0.0_wp
      ! Which ones break is as good as random: they are listed without a branch.
      listed = 0
      do place = 1, self%count
         breaks = sense * (self%population(place, row) - displacement) < 0.0_wp
         if (self%some_fall) breaks = breaks .or. falls_at_rest(place)
         self%trial_population(listed + 1) = place
         listed = listed + merge(1, 0, breaks)
         next = min(next, merge(huge(1.0_wp), sense * self%population(place, row), breaks))
      end do
      do trial = 1, listed
         place = self%trial_population(trial)
         force = sense * self%population(place, row_force)
         distance = sense * (displacement - self%population(place, row_origin)) / self%stretch
         if (self%ages) then
            broken = max(self%population(place, row_broken), self%ageing%configured( &
               & max(0.0_wp, distance + force), time - self%population(place, row_birth)))
         else
            broken = max(self%population(place, row_broken), &
               & broken_threshold(self%parameters%coupling, force, distance))
         end if
         call self%moments(int(self%population(place, row_law)))%interpolate(broken, moments)
         moments = min(self%population(place, row_weight) * moments, &
            & self%population(place, row_moments + 1:))
         loss = self%population(place, row_moments + 1:) - moments
         self%trial_broken(trial) = broken
         self%trial_moments(:, trial) = moments
         self%trial_lost(trial) = loss(lost)
         if (self%ages) self%trial_lost(trial) = loss(lost) + loss(number) &
            & * more_lost(place, broken, distance + force)
         self%trial_breaks = self%trial_breaks + loss(number)
         self%trial_mass = self%trial_mass + loss(massive)
         self%trial_work = self%trial_work + 0.5_wp * (loss(stiff) * distance**2 &
            & + 2.0_wp * loss(number) * force * distance + loss(compliant) * force**2 &
            & - self%trial_lost(trial))
         if (sense * self%population(place, row) > edge) then
            late = late + loss(number)
            if (loss(number) > most) then
               most = loss(number)
               onset = self%population(place, row)
            end if
         end if
      end do
      self%trials = listed
      self%trial_work = self%trial_work * self%parameters%static_force * self%stretch
      self%trial_next = sense * next
      if (self%trials == 0) then
         if (sense > 0.0_wp) self%ahead = self%trial_next
         if (sense < 0.0_wp) self%behind = self%trial_next
      end if

   contains

      !> Whether contacts of a population may break while the slider rests.
      pure function falls_at_rest(population)
         integer, intent(in) :: population
         logical :: falls_at_rest

         falls_at_rest = .false.
         if (self%some_fall) then
            falls_at_rest = .not. sense * (self%population(population, row) - displacement) > 0.0_wp
         end if
      end function falls_at_rest

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
         start_force = max(0.0_wp, force + sense &
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

   end subroutine try_until

   !> Break what was found to break.
   subroutine break_tried(self)
      class(contact_populations_type), intent(inout) :: self

      real(wp) :: loss(moments_length)
      integer :: trial, place

      if (self%trial_sense > 0.0_wp) then
         self%ahead = self%trial_next
      else
         self%behind = self%trial_next
      end if
      associate (population => self%population, parameters => self%parameters)
         ! The last population takes the place of one that is removed: it has had its turn.
         do trial = self%trials, 1, -1
            place = self%trial_population(trial)
            loss = population(place, row_moments + 1:) - self%trial_moments(:, trial)
            call self%stiffness%add(-parameters%stiffness * loss(stiff))
            call self%offset%add(parameters%static_force * loss(number) &
               & * population(place, row_force) &
               & - parameters%stiffness * loss(stiff) * population(place, row_origin))
            call self%break_loss%add(0.5_wp * parameters%static_force * self%stretch &
               & * self%trial_lost(trial))
            population(place, row_moments + 1:) = self%trial_moments(:, trial)
            population(place, row_broken) = self%trial_broken(trial)
            if (population(place, row_moments + number) > 0.0_wp) then
               if (self%trial_sense > 0.0_wp) then
                  population(place, row_ahead) = self%trial_end
                  population(place, row_behind) = next_break(self, place, -1.0_wp, self%trial_time)
               else
                  population(place, row_behind) = self%trial_end
                  population(place, row_ahead) = next_break(self, place, 1.0_wp, self%trial_time)
               end if
               self%ahead = min(self%ahead, population(place, row_ahead))
               self%behind = max(self%behind, population(place, row_behind))
            else
               population(place, :) = population(self%count, :)
               self%count = self%count - 1
            end if
         end do
      end associate
      self%breaks = self%breaks + self%trial_breaks
      call self%detached_number%add(self%trial_breaks)
      call self%detached_mass%add(self%trial_mass)
      if (self%count == 0) then
         self%stiffness = accumulator_type()
         self%offset = accumulator_type()
      end if
   end subroutine break_tried

   !> Break and attach contacts after a motion of the slider.
   subroutine respond(self, before, after)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> Where the slider was, and where it is
      type(pose_type), intent(in) :: before, after

      real(wp) :: sense, late, onset, way, gain
      logical :: reaches

      way = after%displacement - before%displacement
      sense = sign(1.0_wp, way)
      if (sense > 0.0_wp) then
         reaches = after%displacement > self%ahead
      else
         reaches = after%displacement < self%behind
      end if
      if (self%some_fall .and. .not. reaches) then
         ! Where thresholds fall contacts may break at rest.
         if (.not. abs(way) > 0.0_wp) sense = after%sense
         if (sense > 0.0_wp) then
            reaches = after%displacement >= self%ahead
         else
            reaches = after%displacement <= self%behind
         end if
      end if
      ! The work that the offered law did, beyond that of the contacts which are pinned by now.
      gain = way * (0.5_wp * (self%offered%stiffness - self%stiffness%total()) &
         & * (after%displacement + before%displacement) &
         & - (self%offered%offset - self%offset%total()))
      if (reaches) then
         if (self%trials == 0 .or. abs(self%trial_end - after%displacement) > 0.0_wp &
            & .or. (self%ages .and. abs(self%trial_time - after%time) > 0.0_wp)) then
            call self%try_until(before, after%displacement, after%time, sense, late, onset)
         end if
         call self%break_tried()
         if (self%trials > 0) gain = gain + self%trial_work
         if (self%parameters%reattach &
            & .and. self%trial_breaks > negligible_part * self%parameters%count) then
            if (self%last == size(self%packet, 2)) call self%make_room_for_packets()
            self%last = self%last + 1
            self%packet(:, self%last) = [before%time, after%time, self%trial_breaks, &
               & self%trial_mass]
         end if
      end if
      if (self%first <= self%last) call self%attach_due(before, after, gain)
      if (self%ages) call self%see_ages(after%displacement, after%time)
      self%detached_count = self%detached_number%total()
      self%cost = 1.0_wp + self%count / populations_per_cost
      if (self%offers) then
         self%debt = self%debt - gain
         ! The jump of the force from the end of a step to the start of the next: what the lines of
         ! the steps leave open, of the order of the error of the force.
         self%error_estimate = max(self%error_estimate, abs((self%offered%stiffness &
            & - self%stiffness%total()) * after%displacement &
            & - (self%offered%offset - self%offset%total()) + (self%offered%drag &
            & - self%parameters%drag * self%detached_mass%total()) * after%velocity))
      end if
      self%offers = .false.
   end subroutine respond

   !> Make room for one more packet: where some have attached, or in a larger array.
   subroutine make_room_for_packets(self)
      class(contact_populations_type), intent(inout) :: self

      real(wp), allocatable :: larger(:, :)
      integer :: waiting

      waiting = self%last - self%first + 1
      if (2 * waiting > size(self%packet, 2)) then
         allocate (larger(packet_length, 2 * size(self%packet, 2)), source=0.0_wp)
         larger(:, :waiting) = self%packet(:, self%first:self%last)
         call move_alloc(larger, self%packet)
      else
         self%packet(:, :waiting) = self%packet(:, self%first:self%last)
      end if
      self%first = 1
      self%last = waiting
   end subroutine make_room_for_packets

   !> Times at which a packet attaches, from its first contact that has not yet to its last.
   pure subroutine due_times(self, place, early, late)
      type(contact_populations_type), intent(in) :: self
      integer, intent(in) :: place
      real(wp), intent(out) :: early, late

      early = self%packet(row_start, place) + self%parameters%delay
      late = self%packet(row_end, place) + self%parameters%delay
      if (place == self%first) early = early + self%attached_part * (late - early)
   end subroutine due_times

   !> What will attach in a step, and until when it may last for it.
   subroutine expect(self, time, duration, breaks, most, births)
      class(contact_populations_type), intent(in) :: self
      !> When the step starts, and how long it will last if nothing ends it [s]
      real(wp), intent(in) :: time, duration
      !> Contacts that break in the step
      real(wp), intent(in) :: breaks
      !> Contacts that may attach in one step
      real(wp), intent(in) :: most
      !> What is expected
      type(expected_births_type), intent(out) :: births

      real(wp) :: early, late, until, left
      integer :: place

      until = time
      do place = self%first, self%last
         call due_times(self, place, early, late)
         if (early > until) then
            ! Nothing attaches for a while: the step ends where that changes.
            births%end_time = early
            if (births%number > 0.0_wp) births%end_time = until
            return
         end if
         left = self%packet(row_number, place)
         if (place == self%first) left = left * (1.0_wp - self%attached_part)
         call add(left, self%packet(row_mass, place) / self%packet(row_number, place))
         if (births%end_time < huge(1.0_wp)) return
         if (late >= time + duration) then
            ! What is expected holds for about the time the slider is expected to take.
            births%end_time = max(time + patience * duration, nearest(time, 1.0_wp))
            return
         end if
         until = late
      end do
      if (self%parameters%reattach .and. self%parameters%delay < duration &
         & .and. breaks > 0.0_wp) then
         ! What breaks in this step starts to attach in it.
         early = time + self%parameters%delay
         late = early + duration
         call add(breaks, self%trial_mass / self%trial_breaks)
         births%end_time = min(births%end_time, max(time + patience * duration, &
            & nearest(time, 1.0_wp)))
      else if (births%number > 0.0_wp) then
         births%end_time = until
      end if

   contains

      !> Add contacts that attach evenly from early to late.
      subroutine add(count, mass)
         !> How many, and their mean mass
         real(wp), intent(in) :: count, mass

         real(wp) :: more, middle, length

         length = late - early
         more = count
         if (late > time + duration) then
            length = max(0.0_wp, time + duration - early)
            more = count * length / (late - early)
         end if
         if (births%number + more > most) then
            if (more > 0.0_wp) length = length * (most - births%number) / more
            more = most - births%number
            births%end_time = max(early + length, nearest(time, 1.0_wp))
         end if
         middle = max(0.0_wp, early + 0.5_wp * length - time)
         births%number = births%number + more
         births%mass = births%mass + more * mass
         births%moment = births%moment + more * middle
         births%square = births%square + more * (middle**2 + length**2 / 12.0_wp)
      end subroutine add

   end subroutine expect

   !> Attach all contacts that are due, as one population where they do on average.
   subroutine attach_due(self, before, after, gain)
      class(contact_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after
      !> Work [J], less what the new contacts take up until the slider is where it is
      real(wp), intent(inout) :: gain

      real(wp) :: early, late, until, part, part_before, births, moment, more, origin, force, way
      real(wp) :: when

      births = 0.0_wp
      moment = 0.0_wp
      when = 0.0_wp
      do while (self%first <= self%last)
         call due_times(self, self%first, early, late)
         if (early > after%time) exit
         part_before = self%attached_part
         part = 1.0_wp
         until = late
         if (late > after%time) then
            until = after%time
            part = part_before + (1.0_wp - part_before) * (until - early) / (late - early)
         end if
         more = self%packet(row_number, self%first) * (part - part_before)
         births = births + more
         moment = moment + more * position_at(before, after, 0.5_wp * (early + until))
         when = when + more * 0.5_wp * (early + until)
         call self%detached_mass%add(-self%packet(row_mass, self%first) * (part - part_before))
         self%attached_part = part
         if (part < 1.0_wp) exit
         self%attached_part = 0.0_wp
         self%first = self%first + 1
      end do
      if (self%first > self%last) then
         self%first = 1
         self%last = 0
      end if
      if (.not. births > 0.0_wp) return

      call self%detached_number%add(-births)
      call self%birth_gain%add(births * self%newborn_energy)
      origin = moment / births
      force = after%sense * self%parameters%back_force_ratio
      way = after%displacement - origin
      gain = gain - births * way * (force * self%parameters%static_force &
         & + 0.5_wp * self%newborn_stiffness * way)
      call self%stiffness%add(self%newborn_stiffness * births)
      call self%offset%add(self%newborn_stiffness * moment &
         & - self%parameters%static_force * births * force)
      self%last_birth = after%time
      call self%add_population(origin, force, births, 1, 0.0_wp, after%displacement, &
         & min(when / births, after%time), after%time)
   end subroutine attach_due

   !> Where the slider was at a time of its last motion, by Hermite's interpolation [m].
   pure function position_at(before, after, time) result(displacement)
      type(pose_type), intent(in) :: before, after
      real(wp), intent(in) :: time
      real(wp) :: displacement

      real(wp) :: length, t, s

      length = after%time - before%time
      displacement = after%displacement
      if (.not. length > 0.0_wp) return
      t = min(1.0_wp, max(0.0_wp, (time - before%time) / length))
      s = 1.0_wp - t
      displacement = s**2 * ((1.0_wp + 2.0_wp * t) * before%displacement &
         & + t * length * before%velocity) &
         & + t**2 * ((1.0_wp + 2.0_wp * s) * after%displacement - s * length * after%velocity)
   end function position_at

   !> Move the origin of displacements.
   subroutine shift_origin(self, shift, displacement)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift
      !> Displacement of the slider from the new origin [m]
      real(wp), intent(in) :: displacement

      associate (all => self%population(:self%count, :))
         all(:, row_origin) = all(:, row_origin) - shift
         all(:, row_ahead) = all(:, row_ahead) - shift
         all(:, row_behind) = all(:, row_behind) - shift
      end associate
      call self%bear()
   end subroutine shift_origin

   !> Number of contacts that are pinned.
   pure function pinned(self) result(total)
      !> The populations
      class(contact_populations_type), intent(in) :: self
      !> Their number, in the mean of what it may be
      real(wp) :: total

      total = sum(self%population(:self%count, row_moments + number))
   end function pinned

   !> Elastic energy of the pinned contacts.
   pure function elastic_energy(self, displacement) result(energy)
      !> The populations
      class(contact_populations_type), intent(in) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Energy [J]
      real(wp) :: energy

      type(accumulator_type) :: total
      real(wp) :: distance
      integer :: place

      do place = 1, self%count
         associate (force => self%population(place, row_force), &
            & moments => self%population(place, row_moments + 1:))
            distance = (displacement - self%population(place, row_origin)) / self%stretch
            call total%add(moments(stiff) * distance**2 + 2.0_wp * moments(number) * force &
               & * distance + moments(compliant) * force**2)
         end associate
      end do
      energy = 0.5_wp * self%parameters%static_force * self%stretch * total%total()
   end function elastic_energy

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%section("contact populations")
      call exchange_contacts(self, archive)
      call archive%exchange("population", self%population)
      call archive%exchange("packet", self%packet)
      call archive%exchange("count", self%count)
      call archive%exchange("first", self%first)
      call archive%exchange("last", self%last)
      call archive%exchange("attached_part", self%attached_part)
      call archive%exchange("detached_number", self%detached_number)
      call archive%exchange("detached_mass", self%detached_mass)
      call archive%exchange("ahead", self%ahead)
      call archive%exchange("behind", self%behind)
      call archive%exchange("stiffness", self%stiffness)
      call archive%exchange("offset", self%offset)
      call archive%exchange("debt", self%debt)
      call archive%exchange("last_birth", self%last_birth)
   end subroutine exchange

   !> Nothing is derived from the state: all of it is in the archive.
   subroutine rebuild(self, displacement)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      self%trials = 0
   end subroutine rebuild

end module mesoslip_contacts_populations
