!> Infinitely many contacts: the master equation under a slider that moves as it likes.
!>
!> Contacts are populations while they are pinned, and packets while they are detached. This module
!> chooses the steps of the slider and the force law of each. A step is so short that its
!> populations are points of a smooth density of origins, and that an inertial slider hardly changes
!> its acceleration. In a step the contact force changes with the displacement by what breaks, and
!> with the time by what attaches: a chord of the true force, shifted so that it does the true work.
!> Chords of successive steps meet, so that the slider is not shaken. The steps are of second order.
!> The distance of chord and true force at the end of a step is the estimate of the error.
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
   real(wp), parameter :: max_attached_part = 0.1_wp
   !> Part of a step's length below which a slider creeps
   real(wp), parameter :: creeping_part = 0.01_wp
   !> Part of a step's length over which breaks are looked for at least
   real(wp), parameter :: min_part = 1.0e-3_wp
   !> A step may last so many times as long as expected
   real(wp), parameter :: patience = 1.5_wp
   !> Times beyond which nothing is expected [s]
   real(wp), parameter :: max_time = 1.0e30_wp
   !> Duration of a step of resolution 1 over the time in which an inertial slider oscillates, per
   !> radian
   real(wp), parameter :: rate_part = 1.0_wp
   !> Populations whose work is that of one contact that breaks
   real(wp), parameter :: populations_per_cost = 16.0_wp

   !> Populations of contacts.
   type, extends(contacts_type) :: contact_populations_type
      type(pinned_populations_type), private :: pinned
      type(detached_packets_type), private :: detached

      !> The law that was offered for the step, if one was
      type(interface_law_type), private :: offered
      logical, private :: offers = .false.

      !> Contacts that attach in one step at most, when the slider moves and when it rests
      real(wp), private :: max_attached = 0.0_wp, max_attached_at_rest = 0.0_wp
      !> Breaks in one step of populations that start to break in it, at most
      real(wp), private :: max_late = 0.0_wp
      !> Part of the time of ageing that a step may last while thresholds fall, and how long this
      !> step may last for that [s]
      real(wp), private :: resolution = 1.0_wp, max_fall_time = huge(1.0_wp)
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
      procedure, non_overridable, private :: try, attach_due, max_duration, add_changes, &
         & look_ahead
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
      self%max_attached = parameters%count * resolution * max_attached_part
      self%max_attached_at_rest = self%max_attached * min(resolution, max_attached_part)
      self%max_late = self%max_attached * resolution
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

      real(wp) :: direction, max_span, span, distance, reach, limit, max_births, slack
      logical :: breaks, moves
      type(expected_births_type) :: births

      direction = pose%direction
      if (.not. abs(pose%velocity) > 0.0_wp .and. abs(pose%acceleration) > 0.0_wp) then
         direction = sign(1.0_wp, pose%acceleration)
      end if
      slack = tiny_gap * self%pinned%step
      if (direction > 0.0_wp) then
         breaks = self%pinned%ahead - pose%displacement <= slack
      else
         breaks = pose%displacement - self%pinned%behind <= slack
      end if
      call self%pinned%forget_trial()

      span = time_to_move(pose, direction, self%pinned%step)
      max_span = self%max_duration(pose)
      max_births = self%max_attached
      if (max_span >= max_time .and. .not. distance_in(pose, direction, span) > 0.0_wp) then
         max_births = self%max_attached_at_rest
      end if
      self%max_fall_time = huge(1.0_wp)
      if (self%pinned%some_fall) self%max_fall_time = time_to_fall(self, pose, span)
      max_span = min(max_span, self%max_fall_time)
      span = min(span, max_span)
      call self%detached%expect(pose%time, span, max_births, &
         & breaks .and. distance_in(pose, direction, span) > 0.0_wp, births)
      span = min(span, births%end_time - pose%time)
      distance = distance_in(pose, direction, span)
      reach = max(distance, min_part * self%pinned%step)
      limit = self%pinned%step
      if (breaks) call self%look_ahead(pose, direction, max_births, span, distance, reach, limit, &
         & births)
      breaks = self%pinned%trial%count > 0

      moves = breaks .or. births%number > 0.0_wp
      window%end_time = births%end_time
      if (moves .and. max_span < max_time) then
         window%end_time = min(window%end_time, max(pose%time + max_span, &
            & nearest(pose%time, huge(1.0_wp))))
      end if
      window%upper = max(self%pinned%ahead, pose%displacement)
      window%lower = min(self%pinned%behind, pose%displacement)
      if (moves) then
         ! Contacts break in one direction and attach with a force against it: the step ends where
         ! the slider turns round.
         reach = min(limit, max(reach, patience * distance))
         if (.not. distance > 0.0_wp) reach = limit
         if (direction > 0.0_wp) then
            reach = pose%displacement + reach
            if (breaks) window%upper = reach
            window%upper = min(window%upper, reach)
            window%lower = pose%displacement
            if (.not. pose%velocity > 0.0_wp) window%lower = window%lower - slack
         else
            reach = pose%displacement - reach
            if (breaks) window%lower = reach
            window%lower = max(window%lower, reach)
            window%upper = pose%displacement
            if (.not. pose%velocity < 0.0_wp) window%upper = window%upper + slack
         end if
      end if

      law = self%law()
      self%detached_count = self%detached%number%total()
      if (moves) call self%add_changes(pose, direction, span, distance, births, law)
      self%offered = law
      self%offers = .true.
   end subroutine offer

   !> Find what breaks in a step, and what of that attaches in it; the step may become shorter.
   subroutine look_ahead(self, pose, direction, max_births, span, distance, reach, limit, births)
      class(contact_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> The direction in which the slider moves, and contacts that may attach in a step
      real(wp), intent(in) :: direction, max_births
      !> Duration of the step [s], expected displacement in it, displacement until which breaks are
      !> found, and largest displacement of the step [m]
      real(wp), intent(inout) :: span, distance, reach, limit
      type(expected_births_type), intent(inout) :: births

      real(wp) :: part, wanted

      wanted = reach
      call self%try(pose, direction, reach)
      if (reach < wanted) limit = reach
      associate (trial => self%pinned%trial)
         if (reach < distance) call shorten(time_to_move(pose, direction, reach))
         call find_own()
         if (births%own > 0.0_wp .and. births%number + births%own > max_births) then
            part = max_births / (births%number + births%own)
            births%end_time = min(births%end_time, max(pose%time + part * span, &
               & nearest(pose%time, huge(1.0_wp))))
            call shorten(part * span)
            reach = max(distance, min_part * self%pinned%step)
            wanted = reach
            call self%try(pose, direction, reach)
            if (reach < wanted) limit = reach
            call find_own()
         end if
      end associate

   contains

      !> Let the step end earlier.
      subroutine shorten(time)
         real(wp), intent(in) :: time

         births%number = births%number * time / span
         births%mass = births%mass * time / span
         span = time
         distance = distance_in(pose, direction, span)
      end subroutine shorten

      !> Find what breaks and attaches in the step.
      subroutine find_own()
         births%own = 0.0_wp
         if (.not. (self%parameters%reattach .and. self%parameters%delay < span)) return
         if (.not. distance > 0.0_wp) return
         births%own = self%pinned%trial%breaks * distance / reach &
            & * (1.0_wp - self%parameters%delay / span)
         births%own_mass = 0.0_wp
         if (births%own > 0.0_wp) births%own_mass = births%own * self%pinned%trial%mass &
            & / self%pinned%trial%breaks
      end subroutine find_own

   end subroutine look_ahead

   !> Time in which the motion does not change much [s].
   pure function max_duration(self, pose) result(duration)
      class(contact_populations_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      real(wp) :: duration

      real(wp) :: rate

      rate = sqrt(pose%own_rate**2 + max(0.0_wp, self%pinned%stiffness%total()) &
         & * pose%inverse_mass) &
         & + self%parameters%drag * max(0.0_wp, self%detached%mass%total()) * pose%inverse_mass
      duration = huge(1.0_wp)
      if (rate > 1.0_wp / max_time) duration = self%resolution * rate_part / rate
   end function max_duration

   !> Add to a law how the force changes by what breaks and attaches.
   pure subroutine add_changes(self, pose, direction, span, distance, births, law)
      class(contact_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: direction
      !> How long the step lasts [s], and how far the slider comes in it [m]
      real(wp), intent(in) :: span, distance
      type(expected_births_type), intent(in) :: births
      type(interface_law_type), intent(inout) :: law

      real(wp) :: slope, rate, middle, mass, number, velocity

      associate (trial => self%pinned%trial, parameters => self%parameters)
         slope = 0.0_wp
         rate = 0.0_wp
         middle = 0.0_wp
         mass = -births%mass - births%own_mass
         number = -births%number - births%own
         if (trial%count > 0) then
            slope = -trial%drop / trial%reach
            middle = 0.5_wp * trial%drop - trial%work / trial%reach
            mass = mass + trial%mass * distance / trial%reach
            number = number + trial%breaks * distance / trial%reach
         end if
         slope = slope + 0.5_wp * self%pinned%newborn_stiffness * (births%number + births%own)
         middle = middle - self%pinned%newborn_stiffness * (births%number + births%own) * distance &
            & / 8.0_wp
         if (births%own > 0.0_wp) slope = slope + births%own * parameters%static_force &
            & * parameters%back_force_ratio / distance
         if (span > 0.0_wp .and. span < max_time) then
            velocity = max(0.0_wp, direction * (pose%velocity + span * pose%acceleration))
            rate = (births%number * parameters%static_force * parameters%back_force_ratio &
               & + parameters%drag * mass * velocity) / span
         end if
         law%stiffness = law%stiffness + slope
         law%offset = law%offset + slope * pose%displacement - direction * middle
         law%rate = direction * rate
         self%detached_count = max(0.0_wp, self%detached_count + 0.5_wp * number)
      end associate
   end subroutine add_changes

   !> Time in which the slider will move by a distance, or turn round; huge if it does not move.
   pure function time_to_move(pose, direction, distance) result(time)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: direction, distance
      real(wp) :: time

      real(wp) :: speed, square

      speed = abs(pose%velocity)
      square = speed**2 + 2.0_wp * direction * pose%acceleration * distance
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
      if (duration < max_time) time = max(time, creeping_part * duration)
      time = max(time, nearest(pose%time, huge(1.0_wp)) - pose%time)
   end function time_to_fall

   !> Distance that the slider will move in a time, in its direction.
   pure function distance_in(pose, direction, time) result(distance)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: direction, time
      real(wp) :: distance

      distance = 0.0_wp
      if (time < max_time) then
         distance = time * (abs(pose%velocity) + 0.5_wp * direction * pose%acceleration * time)
      end if
   end function distance_in

   !> Find what breaks in a displacement of the slider.
   !>
   !> Where many populations start to break together, as they do where the slider turned before, the
   !> force has a kink: the displacement ends there.
   subroutine try(self, pose, direction, distance)
      class(contact_populations_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> In which direction it goes
      real(wp), intent(in) :: direction
      !> Length of the displacement, which may become shorter [m]
      real(wp), intent(inout) :: distance

      real(wp) :: late, onset, displacement

      call self%pinned%try(pose, pose%displacement + direction * distance, &
         & expected_time(distance), direction, late, onset)
      if (late > self%max_late) then
         displacement = onset
         distance = abs(displacement - pose%displacement)
         call self%pinned%try(pose, displacement, expected_time(distance), direction, late, onset)
      end if

   contains

      !> When the slider will have come so far [s].
      pure function expected_time(distance) result(time)
         real(wp), intent(in) :: distance
         real(wp) :: time

         time = pose%time
         if (self%pinned%ages) time = pose%time &
            & + min(time_to_move(pose, direction, distance), self%max_fall_time, max_time)
      end function expected_time

   end subroutine try

   !> Break and attach contacts after a motion of the slider.
   subroutine respond(self, before, after)
      !> The populations
      class(contact_populations_type), intent(inout) :: self
      !> Where the slider was, and where it is
      type(pose_type), intent(in) :: before, after

      real(wp) :: direction, late, onset, distance
      logical :: reaches

      distance = after%displacement - before%displacement
      direction = sign(1.0_wp, distance)
      if (direction > 0.0_wp) then
         reaches = after%displacement > self%pinned%ahead
      else
         reaches = after%displacement < self%pinned%behind
      end if
      if (self%pinned%some_fall .and. .not. reaches) then
         ! Where thresholds fall contacts may break at rest.
         if (.not. abs(distance) > 0.0_wp) direction = after%direction
         if (direction > 0.0_wp) then
            reaches = after%displacement >= self%pinned%ahead
         else
            reaches = after%displacement <= self%pinned%behind
         end if
      end if
      if (reaches) then
         if (.not. self%pinned%has_tried(after%displacement, after%time)) then
            call self%pinned%try(before, after%displacement, after%time, direction, late, onset)
         end if
         call self%pinned%break_tried(self%break_loss)
         associate (trial => self%pinned%trial)
            self%breaks = self%breaks + trial%breaks
            call self%detached%add(before%time, after%time, trial%breaks, trial%mass)
         end associate
      end if
      if (.not. self%detached%is_empty()) call self%attach_due(before, after)
      if (self%pinned%ages) call self%pinned%see_ages(after%displacement, after%time)
      self%detached_count = self%detached%number%total()
      self%cost = 1.0_wp + self%pinned%count / populations_per_cost
      if (self%offers) then
         ! The jump of the force from the end of a step to the start of the next: what the lines of
         ! the steps leave open, of the order of the error of the force.
         self%error_estimate = max(self%error_estimate, abs(self%offered%rate &
            & * (after%time - before%time) + (self%offered%stiffness &
            & - self%pinned%stiffness%total()) * after%displacement &
            & - (self%offered%offset - self%pinned%offset%total()) + (self%offered%drag &
            & - self%parameters%drag * self%detached%mass%total()) * after%velocity))
      end if
      self%offers = .false.
   end subroutine respond

   !> Attach all contacts that are due, as one population where they do on average.
   subroutine attach_due(self, before, after)
      class(contact_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: births, moment, when, origin, force

      call self%detached%take_due(before, after, births, moment, when)
      if (.not. births > 0.0_wp) return

      call self%birth_gain%add(births * self%pinned%newborn_energy)
      origin = moment / births
      force = after%direction * self%parameters%back_force_ratio
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
