!> Infinitely many contacts: the master equation under a slider that moves as it likes.
!>
!> Contacts are populations while they are pinned, and packets while they are detached; here is how
!> long the steps of the slider are, and what law holds in each. A step is so short that its
!> populations are points of a smooth density of origins. Over a step the contact force is a line
!> that does the work of the true force, which is known in advance, so the steps are of second
!> order. Work that a step did not do after all, the next ones make up for. The jump of the force
!> between two lines is the estimate of the error.
module mesoslip_contacts_populations
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_contacts_ageing_law, only: ageing_law_type, take_ageing_law
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type, exchange_contacts
   use mesoslip_contacts_detached_packets, only: detached_packets_type, expected_births_type, &
      & new_detached_packets
   use mesoslip_contacts_pinned_populations, only: new_pinned_populations, &
      & pinned_populations_type, tiny_gap
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   implicit none
   private

   public :: contact_populations_type, new_contact_populations, make_contact_populations
   public :: make_ageing_populations

   !> Part of the contacts that attach in a step of resolution 1 at most.
   real(wp), parameter :: most_attached_part = 0.1_wp
   !> Part of a step's length below which a slider creeps
   real(wp), parameter :: creeping_part = 0.01_wp
   !> Times beyond which nothing is expected [s]
   real(wp), parameter :: longest_time = 1.0e30_wp
   !> Populations whose work is that of one contact that breaks
   real(wp), parameter :: populations_per_cost = 16.0_wp

   !> Populations of contacts.
   type, extends(contacts_type) :: contact_populations_type
      type(pinned_populations_type), private :: pinned
      type(detached_packets_type), private :: detached

      !> Work that steps should have done and did not [J]: the next ones make up for it
      real(wp), private :: debt = 0.0_wp
      !> The law that was offered for the step, if one was
      type(interface_law_type), private :: offered
      logical, private :: offers = .false.

      !> Contacts that attach in one step at most, when the slider moves and when it rests
      real(wp), private :: most_attached = 0.0_wp, most_attached_at_rest = 0.0_wp
      !> Breaks in one step of populations that start to break in it, at most
      real(wp), private :: most_late = 0.0_wp
      !> Part of the time of ageing that a step may last while thresholds fall, and how long this
      !> step may last for that [s]
      real(wp), private :: resolution = 1.0_wp, longest_fall = huge(1.0_wp)
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
      procedure :: pinned_count
      procedure, non_overridable, private :: try, attach_due
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

      if (.not. resolution > 0.0_wp) then
         call raise(error, status_invalid, "the resolution of populations must be positive")
         return
      end if
      self%parameters = parameters
      self%resolution = resolution
      self%most_attached = parameters%count * resolution * most_attached_part
      self%most_attached_at_rest = self%most_attached * min(resolution, most_attached_part)
      self%most_late = self%most_attached * resolution
      call new_pinned_populations(self%pinned, parameters, resolution)
      call new_detached_packets(self%detached, parameters)
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
      call populations%pinned%let_age(ageing)
      call move_alloc(populations, contacts)
   end subroutine make_ageing_populations

   !> Prepare the populations for the start of a run.
   subroutine initialize(self, state)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      call self%pinned%initialize(state)
   end subroutine initialize

   !> Contact force as a law, for a slider that does not move.
   pure function law(self)
      !> The populations
      class(contact_populations_type), intent(in) :: self
      !> The law
      type(interface_law_type) :: law

      law%stiffness = self%pinned%stiffness%total()
      law%offset = self%pinned%offset%total()
      law%drag = self%parameters%drag * self%detached%mass%total()
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

      real(wp) :: sense, duration, reach, part, way, slack, ahead, behind
      logical :: breaks, rests, creeps
      type(expected_births_type) :: births

      sense = pose%direction
      if (.not. abs(pose%velocity) > 0.0_wp .and. abs(pose%acceleration) > 0.0_wp) then
         sense = sign(1.0_wp, pose%acceleration)
      end if
      rests = pose%velocity**2 <= creeping_part * sense * pose%acceleration * self%pinned%step
      slack = tiny_gap * self%pinned%step
      reach = self%pinned%step
      if (sense > 0.0_wp) then
         breaks = self%pinned%ahead - pose%displacement <= slack
      else
         breaks = pose%displacement - self%pinned%behind <= slack
      end if
      call self%pinned%forget_trial()
      self%longest_fall = huge(1.0_wp)
      if (self%pinned%some_fall) self%longest_fall = time_to_fall(self, pose, &
         & time_to_move(pose, sense, reach))
      if (breaks) call self%try(pose, sense, reach)
      breaks = self%pinned%trial%count > 0
      duration = time_to_move(pose, sense, reach)
      part = way_made(pose, sense, duration) / reach
      call expect(self%most_attached)
      creeps = .false.
      if (births%number > 0.0_wp) then
         creeps = rests .or. way_made(pose, sense, min(duration, births%end_time - pose%time)) &
            & < creeping_part * self%pinned%step
      end if
      if (creeps) then
         ! The slider may turn at any time, and with it the force of what attaches, which cannot be
         ! known: little may attach until it can.
         if (rests) duration = sqrt(creeping_part) * duration
         part = way_made(pose, sense, duration) / reach
         call expect(self%most_attached_at_rest)
      end if
      window%end_time = births%end_time
      if (self%pinned%some_fall) then
         window%end_time = min(window%end_time, pose%time + self%longest_fall)
      end if

      ahead = max(self%pinned%ahead, pose%displacement)
      behind = min(self%pinned%behind, pose%displacement)
      window%upper = ahead
      window%lower = behind
      if (breaks .or. births%number > 0.0_wp) then
         ! Contacts break one way and attach with a force against it: the step ends where the slider
         ! turns round.
         if (sense > 0.0_wp) then
            window%upper = pose%displacement + reach
            if (.not. breaks) window%upper = min(window%upper, ahead)
            window%lower = pose%displacement
            if (.not. pose%velocity > 0.0_wp) window%lower = window%lower - slack
         else
            window%lower = pose%displacement - reach
            if (.not. breaks) window%lower = max(window%lower, behind)
            window%upper = pose%displacement
            if (.not. pose%velocity < 0.0_wp) window%upper = window%upper + slack
         end if
      end if

      ! What an observer sees in the step is its middle; the step may end before all breaks.
      duration = min(duration, births%end_time - pose%time)
      way = way_made(pose, sense, duration)
      part = way / reach
      self%detached_count = max(0.0_wp, self%detached%number%total() &
         & + 0.5_wp * (part * self%pinned%trial%breaks - births%number))
      law = self%law()
      law%drag = max(0.0_wp, law%drag &
         & + 0.5_wp * self%parameters%drag * (part * self%pinned%trial%mass - births%mass))
      ! Lines that do the right work in the step, and start from the force there is: it does not
      ! depend on the direction in which the slider goes on.
      if (breaks) call add_line(0.0_wp, -2.0_wp * self%pinned%trial%work / reach**2)
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
         call add_line(sense * self%debt / self%pinned%step, 0.0_wp)
      end if
      self%offered = law
      self%offers = .true.

   contains

      !> Find what will attach in the step, at most so much.
      subroutine expect(most)
         real(wp), intent(in) :: most

         associate (trial => self%pinned%trial)
            call self%detached%expect(pose%time, duration, trial%breaks, trial%mass, part, most, &
               & births)
         end associate
      end subroutine expect

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
            & + self%pinned%newborn_stiffness * births%number * (way - place)**2 / way) / way)
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
      age = pose%time - self%pinned%last_birth
      if (self%pinned%ageing%is_old(age)) return
      time = self%resolution * max(self%pinned%ageing%time, age, self%parameters%delay)
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

      call self%pinned%try(pose, pose%displacement + sense * way, expected_time(way), sense, late, &
         & onset)
      if (late > self%most_late) then
         displacement = onset
         way = abs(displacement - pose%displacement)
         call self%pinned%try(pose, displacement, expected_time(way), sense, late, onset)
      end if

   contains

      !> When the slider will be at the end of its way [s].
      pure function expected_time(distance) result(time)
         real(wp), intent(in) :: distance
         real(wp) :: time

         time = pose%time
         if (self%pinned%ages) time = pose%time &
            & + min(time_to_move(pose, sense, distance), self%longest_fall, longest_time)
      end function expected_time

   end subroutine try

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
         reaches = after%displacement > self%pinned%ahead
      else
         reaches = after%displacement < self%pinned%behind
      end if
      if (self%pinned%some_fall .and. .not. reaches) then
         ! Where thresholds fall contacts may break at rest.
         if (.not. abs(way) > 0.0_wp) sense = after%direction
         if (sense > 0.0_wp) then
            reaches = after%displacement >= self%pinned%ahead
         else
            reaches = after%displacement <= self%pinned%behind
         end if
      end if
      ! The work that the offered law did, beyond that of the contacts which are pinned by now.
      gain = way * (0.5_wp * (self%offered%stiffness - self%pinned%stiffness%total()) &
         & * (after%displacement + before%displacement) &
         & - (self%offered%offset - self%pinned%offset%total()))
      if (reaches) then
         if (.not. self%pinned%has_tried(after%displacement, after%time)) then
            call self%pinned%try(before, after%displacement, after%time, sense, late, onset)
         end if
         call self%pinned%break_tried(self%break_loss)
         associate (trial => self%pinned%trial)
            self%breaks = self%breaks + trial%breaks
            if (trial%count > 0) gain = gain + trial%work
            call self%detached%add(before%time, after%time, trial%breaks, trial%mass)
         end associate
      end if
      if (.not. self%detached%is_empty()) call self%attach_due(before, after, gain)
      if (self%pinned%ages) call self%pinned%see_ages(after%displacement, after%time)
      self%detached_count = self%detached%number%total()
      self%cost = 1.0_wp + self%pinned%count / populations_per_cost
      if (self%offers) then
         self%debt = self%debt - gain
         ! The jump of the force from the end of a step to the start of the next: what the lines of
         ! the steps leave open, of the order of the error of the force.
         self%error_estimate = max(self%error_estimate, abs((self%offered%stiffness &
            & - self%pinned%stiffness%total()) * after%displacement &
            & - (self%offered%offset - self%pinned%offset%total()) + (self%offered%drag &
            & - self%parameters%drag * self%detached%mass%total()) * after%velocity))
      end if
      self%offers = .false.
   end subroutine respond

   !> Attach all contacts that are due, as one population where they do on average.
   subroutine attach_due(self, before, after, gain)
      class(contact_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after
      !> Work [J], less what the new contacts take up until the slider is where it is
      real(wp), intent(inout) :: gain

      real(wp) :: births, moment, when, origin, force, way

      call self%detached%take_due(before, after, births, moment, when)
      if (.not. births > 0.0_wp) return

      call self%birth_gain%add(births * self%pinned%newborn_energy)
      origin = moment / births
      force = after%direction * self%parameters%back_force_ratio
      way = after%displacement - origin
      gain = gain - births * way * (force * self%parameters%static_force &
         & + 0.5_wp * self%pinned%newborn_stiffness * way)
      call self%pinned%attach(births, moment, force, after%displacement, &
         & min(when / births, after%time), after%time)
   end subroutine attach_due

   !> Move the origin of displacements.
   subroutine shift_origin(self, shift, displacement)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift
      !> Displacement of the slider from the new origin [m]
      real(wp), intent(in) :: displacement

      call self%pinned%shift_origin(shift)
   end subroutine shift_origin

   !> Number of contacts that are pinned.
   pure function pinned_count(self) result(total)
      !> The populations
      class(contact_populations_type), intent(in) :: self
      !> Their number, in the mean of what it may be
      real(wp) :: total

      total = self%pinned%number_of_contacts()
   end function pinned_count

   !> Elastic energy of the pinned contacts.
   pure function elastic_energy(self, displacement) result(energy)
      !> The populations
      class(contact_populations_type), intent(in) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Energy [J]
      real(wp) :: energy

      energy = self%pinned%elastic_energy(displacement)
   end function elastic_energy

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%section("contact populations")
      call exchange_contacts(self, archive)
      call self%pinned%exchange(archive)
      call self%detached%exchange(archive)
      call archive%exchange("debt", self%debt)
   end subroutine exchange

   !> Nothing is derived from the state: all of it is in the archive.
   subroutine rebuild(self, displacement)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      call self%pinned%forget_trial()
   end subroutine rebuild

end module mesoslip_contacts_populations
