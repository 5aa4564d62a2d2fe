!> Infinitely many contacts: the master equation under a slider that moves as it likes.
!>
!> A population is what attached within one step. It is labelled by its origin, so that nothing is
!> advected, and remembers below which threshold its contacts have broken: the greatest force that
!> it has borne, in either direction. A step of the slider is so short that its populations are
!> points of a smooth density of origins. Over a step the contact force is a line that
!> does the work of the true force, which is known in advance, so the steps are of second order.
!>
!> Forces of populations are in units of f_s, their stiffness of k, distances of f_s/k.
module mesoslip_contacts_populations
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_mechanics, only: breaking_distance, broken_threshold, coupling_scaled, &
      & initial_steady, initial_uniform
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type, exchange_contacts
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_contacts_partial_moments, only: new_partial_moments, partial_moments_type
   implicit none
   private

   public :: contact_populations_type, new_contact_populations, make_contact_populations

   !> Moments of the thresholds of a population's pinned contacts: their number, stiffness, one over
   !> it, twice the energy that they lose in breaking, and mass.
   integer, parameter :: moments_length = 5
   integer, parameter :: number = 1, stiff = 2, compliant = 3, lost = 4, massive = 5

   !> Numbers kept for a population
   integer, parameter :: population_length = 7 + moments_length
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
   !> The moments come after these
   integer, parameter :: row_moments = 7

   !> Numbers kept for detached contacts: they broke evenly from one time to another [s], so many,
   !> with such a mass
   integer, parameter :: packet_length = 4
   integer, parameter :: row_start = 1, row_end = 2, row_number = 3, row_mass = 4

   !> Relative width of the law of thresholds beyond which steps do not become longer.
   real(wp), parameter :: widest_spread = 0.35_wp
   !> Part of the contacts that attach in a step of resolution 1 at most.
   real(wp), parameter :: most_attached_part = 0.1_wp
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

   !> Populations of contacts.
   type, extends(contacts_type) :: contact_populations_type
      !> Number of populations
      integer :: count = 0
      !> Length of a step [m]
      real(wp) :: step = 0.0_wp

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

      !> What breaks until a displacement in a direction: the populations, the thresholds below
      !> which they will have broken, and what they will be
      real(wp), private :: trial_end = 0.0_wp, trial_sense = 1.0_wp
      integer, private :: trials = 0
      integer, allocatable, private :: trial_population(:)
      real(wp), allocatable, private :: trial_broken(:), trial_moments(:, :)
      !> Breaks then, and their mass; work that need not be done for them [J]
      real(wp), private :: trial_breaks = 0.0_wp, trial_mass = 0.0_wp, trial_work = 0.0_wp
      !> Where the next population breaks [m]
      real(wp), private :: trial_next = 0.0_wp

      !> Distance of a mean threshold f_s/k [m]
      real(wp), private :: stretch = 1.0_wp
      !> Contacts that attach in one step at most
      real(wp), private :: most_attached = 0.0_wp
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
      procedure, private :: add_population, bear, try, break_tried, make_room, make_room_for_packets
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

   !> Prepare the populations for the start of a run.
   subroutine initialize(self, state)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      real(wp) :: longest, total, back, cell, middle, edge, even

      associate (parameters => self%parameters, moments => self%moments(1))
         if (state /= initial_steady .and. state /= initial_uniform) then
            call self%add_population(0.0_wp, 0.0_wp, real(parameters%count, wp), 1, 0.0_wp, 0.0_wp)
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
                  & broken_threshold(parameters%coupling, back, middle), 0.0_wp)
            end do
            total = sum(self%population(:self%count, row_moments + number))
            associate (all => self%population(:self%count, :))
               all(:, row_weight) = all(:, row_weight) * (parameters%count / total)
               all(:, row_moments + 1:) = all(:, row_moments + 1:) * (parameters%count / total)
            end associate
         end if
      end associate
      call self%bear()
   end subroutine initialize

   !> Add a population.
   subroutine add_population(self, origin, force, weight, law, broken, displacement)
      class(contact_populations_type), intent(inout) :: self
      !> Where it attached [m], with what force, how many contacts, with which law
      real(wp), intent(in) :: origin, force, weight
      integer, intent(in) :: law
      !> Threshold below which they have broken before
      real(wp), intent(in) :: broken
      !> Where the slider is [m]: what is due to break there does so when the slider moves on
      real(wp), intent(in) :: displacement

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
         population(place, row_moments + 1:) = weight * moments
         population(place, row_ahead) = max(displacement, next_break(self, place, 1.0_wp))
         population(place, row_behind) = min(displacement, next_break(self, place, -1.0_wp))
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
   pure function next_break(self, place, sense) result(displacement)
      class(contact_populations_type), intent(in) :: self
      integer, intent(in) :: place
      real(wp), intent(in) :: sense
      real(wp) :: displacement

      displacement = self%population(place, row_origin) + sense * self%stretch &
         & * breaking_distance(self%parameters%coupling, &
         & sense * self%population(place, row_force), self%population(place, row_broken))
   end function next_break

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

      real(wp) :: sense, duration, part, births, mass, way, mean_force, slack
      logical :: breaks

      sense = pose%sense
      if (.not. abs(pose%velocity) > 0.0_wp .and. abs(pose%acceleration) > 0.0_wp) then
         sense = sign(1.0_wp, pose%acceleration)
      end if
      slack = tiny_gap * self%step
      if (sense > 0.0_wp) then
         breaks = self%ahead - pose%displacement <= slack
      else
         breaks = pose%displacement - self%behind <= slack
      end if
      self%trials = 0
      self%trial_breaks = 0.0_wp
      self%trial_mass = 0.0_wp
      if (breaks) call self%try(pose%displacement + sense * self%step, sense)
      breaks = self%trials > 0
      duration = time_to_move(pose, sense, self%step)
      call self%expect(pose%time, duration, births, mass, window%end_time)
      ! What is expected holds for about the time the slider is expected to take.
      if (births > 0.0_wp .and. duration < longest_time) then
         window%end_time = min(window%end_time, pose%time + patience * duration)
      end if

      window%upper = max(self%ahead, pose%displacement)
      window%lower = min(self%behind, pose%displacement)
      if (breaks .or. births > 0.0_wp) then
         window%upper = min(window%upper, pose%displacement + self%step)
         window%lower = max(window%lower, pose%displacement - self%step)
      end if
      if (breaks) then
         ! Contacts break one way: the step ends where the slider turns round.
         if (sense > 0.0_wp) then
            window%upper = pose%displacement + self%step
            window%lower = pose%displacement
            if (.not. pose%velocity > 0.0_wp) window%lower = window%lower - slack
         else
            window%lower = pose%displacement - self%step
            window%upper = pose%displacement
            if (.not. pose%velocity < 0.0_wp) window%upper = window%upper + slack
         end if
      end if

      ! What an observer sees in the step is its middle; the step may end before all breaks.
      part = 0.0_wp
      if (duration < longest_time) then
         part = (min(window%end_time, pose%time + duration) - pose%time) / duration
      end if
      self%detached_count = max(0.0_wp, self%detached_number%total() &
         & + 0.5_wp * (part * self%trial_breaks - births))
      law = self%law()
      law%drag = max(0.0_wp, law%drag &
         & + 0.5_wp * self%parameters%drag * (part * self%trial_mass - mass))
      ! Lines that do the right work in the step, and start from the force there is: it does not
      ! depend on the direction in which the slider goes on.
      if (breaks) call add_slope(-2.0_wp * self%trial_work / self%step**2)
      if (births > 0.0_wp) then
         way = min(self%step, abs(pose%velocity) * min(duration, window%end_time - pose%time))
         mean_force = births * (0.5_wp * self%parameters%static_force &
            & * self%parameters%back_force_ratio + self%newborn_stiffness * way / 6.0_wp)
         if (way > 0.5_wp * self%step) then
            call add_slope(2.0_wp * mean_force / way)
         else
            ! Near a turning point the sign of their force is open.
            law%offset = law%offset - sense * mean_force * (2.0_wp * way / self%step)
         end if
      end if

   contains

      !> Have the force change with the way that the slider makes in the step.
      subroutine add_slope(slope)
         real(wp), intent(in) :: slope

         law%stiffness = law%stiffness + slope
         law%offset = law%offset + slope * pose%displacement
      end subroutine add_slope

   end subroutine offer

   !> Time in which the slider will move by a distance; huge if it does not.
   pure function time_to_move(pose, sense, distance) result(time)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: sense, distance
      real(wp) :: time

      real(wp) :: speed

      speed = abs(pose%velocity)
      speed = speed + sqrt(max(0.0_wp, speed**2 + 2.0_wp * sense * pose%acceleration * distance))
      time = huge(1.0_wp)
      if (speed > distance / time) time = 2.0_wp * distance / speed
   end function time_to_move

   !> Find what breaks until the slider comes to a displacement.
   subroutine try(self, displacement, sense)
      class(contact_populations_type), intent(inout) :: self
      real(wp), intent(in) :: displacement, sense

      real(wp) :: moments(moments_length), loss(moments_length), distance, force, broken, next
      integer :: place, row

      row = merge(row_ahead, row_behind, sense > 0.0_wp)
      next = huge(1.0_wp)
      self%trials = 0
      if (allocated(self%trial_population)) then
         if (size(self%trial_population) < self%count) then
            deallocate (self%trial_population, self%trial_broken, self%trial_moments)
         end if
      end if
      if (.not. allocated(self%trial_population)) then
         associate (places => size(self%population, 1))
            allocate (self%trial_population(places), self%trial_broken(places))
            allocate (self%trial_moments(moments_length, places))
         end associate
      end if
      self%trial_end = displacement
      self%trial_sense = sense
      self%trial_breaks = 0.0_wp
      self%trial_mass = 0.0_wp
      self%trial_work = 0.0_wp
      do place = 1, self%count
         if (sense * (self%population(place, row) - displacement) >= 0.0_wp) then
            next = min(next, sense * self%population(place, row))
            cycle
         end if
         force = sense * self%population(place, row_force)
         distance = sense * (displacement - self%population(place, row_origin)) / self%stretch
         broken = max(self%population(place, row_broken), &
            & broken_threshold(self%parameters%coupling, force, distance))
         call self%moments(nint(self%population(place, row_law)))%interpolate(broken, moments)
         moments = min(self%population(place, row_weight) * moments, &
            & self%population(place, row_moments + 1:))
         loss = self%population(place, row_moments + 1:) - moments
         self%trials = self%trials + 1
         self%trial_population(self%trials) = place
         self%trial_broken(self%trials) = broken
         self%trial_moments(:, self%trials) = moments
         self%trial_breaks = self%trial_breaks + loss(number)
         self%trial_mass = self%trial_mass + loss(massive)
         self%trial_work = self%trial_work + 0.5_wp * (loss(stiff) * distance**2 &
            & + 2.0_wp * loss(number) * force * distance + loss(compliant) * force**2 - loss(lost))
      end do
      self%trial_work = self%trial_work * self%parameters%static_force * self%stretch
      self%trial_next = sense * next
      if (self%trials == 0) then
         if (sense > 0.0_wp) self%ahead = self%trial_next
         if (sense < 0.0_wp) self%behind = self%trial_next
      end if
   end subroutine try

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
            call self%break_loss%add(0.5_wp * parameters%static_force * self%stretch * loss(lost))
            population(place, row_moments + 1:) = self%trial_moments(:, trial)
            population(place, row_broken) = self%trial_broken(trial)
            if (population(place, row_moments + number) > 0.0_wp) then
               if (self%trial_sense > 0.0_wp) then
                  population(place, row_ahead) = self%trial_end
                  population(place, row_behind) = next_break(self, place, -1.0_wp)
               else
                  population(place, row_behind) = self%trial_end
                  population(place, row_ahead) = next_break(self, place, 1.0_wp)
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

      real(wp) :: sense
      logical :: reaches

      sense = sign(1.0_wp, after%displacement - before%displacement)
      if (sense > 0.0_wp) then
         reaches = after%displacement > self%ahead
      else
         reaches = after%displacement < self%behind
      end if
      if (reaches) then
         if (self%trials == 0 .or. abs(self%trial_end - after%displacement) > 0.0_wp) then
            call self%try(after%displacement, sense)
         end if
         call self%break_tried()
         if (self%parameters%reattach .and. self%trial_breaks > 0.0_wp) then
            if (self%last == size(self%packet, 2)) call self%make_room_for_packets()
            self%last = self%last + 1
            self%packet(:, self%last) = [before%time, after%time, self%trial_breaks, &
               & self%trial_mass]
         end if
      end if
      if (self%first <= self%last) call self%attach_due(before, after)
      self%detached_count = self%detached_number%total()
      self%cost = 1.0_wp + self%count / populations_per_cost
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

   !> How many contacts will attach in a step, and until when it may last for it.
   subroutine expect(self, time, duration, births, mass, end_time)
      class(contact_populations_type), intent(in) :: self
      !> When the step starts, and how long it will last if nothing ends it
      real(wp), intent(in) :: time, duration
      !> Contacts that will attach in the step, their mass, and the end of the step
      real(wp), intent(out) :: births, mass, end_time

      real(wp) :: early, late, until, left, more
      integer :: place

      births = 0.0_wp
      mass = 0.0_wp
      end_time = huge(1.0_wp)
      until = time
      do place = self%first, self%last
         call due_times(self, place, early, late)
         if (early > until) then
            ! Nothing attaches for a while: the step ends where that changes.
            end_time = early
            if (births > 0.0_wp) end_time = until
            return
         end if
         left = self%packet(row_number, place)
         if (place == self%first) left = left * (1.0_wp - self%attached_part)
         until = min(late, time + duration)
         more = left
         if (until < late) more = left * max(0.0_wp, until - early) / (late - early)
         if (births + more > self%most_attached) then
            more = self%most_attached - births
            end_time = max(early + more / left * (late - early), nearest(time, 1.0_wp))
         end if
         births = births + more
         mass = mass + more * self%packet(row_mass, place) / self%packet(row_number, place)
         if (until < late .or. end_time < huge(1.0_wp)) return
      end do
      if (self%parameters%reattach .and. self%parameters%delay < duration &
         & .and. self%trial_breaks > 0.0_wp) then
         ! What breaks in this step starts to attach in it.
         more = self%trial_breaks * (1.0_wp - self%parameters%delay / duration)
         if (births + more > self%most_attached) then
            more = self%most_attached - births
            end_time = time + self%parameters%delay + more / self%trial_breaks * duration
         end if
         births = births + more
         mass = mass + more * self%trial_mass / self%trial_breaks
      end if
   end subroutine expect

   !> Attach all contacts that are due, as one population where they do on average.
   subroutine attach_due(self, before, after)
      class(contact_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: early, late, until, part, part_before, births, moment, more

      births = 0.0_wp
      moment = 0.0_wp
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
      call self%add_population(moment / births, &
         & after%sense * self%parameters%back_force_ratio, births, 1, 0.0_wp, after%displacement)
      call self%stiffness%add(self%newborn_stiffness * births)
      call self%offset%add(self%newborn_stiffness * moment - self%parameters%static_force * births &
         & * after%sense * self%parameters%back_force_ratio)
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
