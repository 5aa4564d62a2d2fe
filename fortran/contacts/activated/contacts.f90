!> N contacts that know nothing of each other, which break by thermal activation.
!>
!> A contact under the force f breaks at the rate omega_0 exp((abs(f) - f_s)/f_T), and at once where
!> abs(f) = f_s (Bell's law). Contacts whose forces have one sign share a clock, the integral of
!> omega_0 exp(s k (X - R)/f_T) over the time, s being the sign and R a displacement near the
!> slider's. Each draws an exponential deviate once in a life; it breaks where its clock has gone on
!> by the deviate times exp((f_s + s k (Y - R))/f_T), a key known when it attaches. Where its force
!> changes its sign, what is left of the deviate goes on with the other clock. There is no time
!> step.
module mesoslip_contacts_activated_contacts
   use mesoslip_contacts_activated_keys, only: activated_keys_type, exchange_activated, &
      & life_clock, life_key, life_left, motions, set_up_activated
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_base, only: total_law
   use mesoslip_contacts_individual_births, only: drag_of
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, &
      & row_stiffness
   use mesoslip_contacts_mechanics, only: delay_fixed
   use mesoslip_hazard, only: force_sign, never
   use mesoslip_interface_law, only: clocks, interface_law_type, pose_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_random, only: uniform_pairs
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: contact_activated_type, make_contact_activated
   ! For kinds that extend this one: a call by a component would lose their own procedures.
   public :: initialize_activated, offer_activated

   !> Minimum length of a schedule
   integer, parameter :: min_length = 4

   !> Contacts that break by thermal activation.
   type, extends(activated_keys_type) :: contact_activated_type
      !> Contacts of the schedule, by coordinate and by clock, and those that attach in it
      integer, private :: listed(max_events) = 0, clock_listed(max_events) = 0, &
         & attaching(max_events) = 0
      !> Length of the next schedule, by how far the slider came in the last one
      integer, private :: max_length = max_events
      !> Entry of each contact in the list by coordinate, 0 but while lists are written
      integer, allocatable, private :: entry(:)
   contains
      procedure :: initialize => initialize_activated
      procedure :: offer => offer_activated
      procedure :: respond => respond_activated
      procedure :: plan
      procedure :: settle
      procedure :: join
      procedure :: exchange
      !> Prepare the life of a contact that has attached
      procedure :: prepare
      !> Whether a contact breaks that has come to its threshold, or its clock to its key
      procedure :: confirms
      !> Take note of what has changed with the time alone
      procedure :: renew_due
      !> A contact breaks
      procedure, non_overridable :: break_contact
      procedure, non_overridable, private :: respond_here, pass_ahead, break_activated, &
         & draw_deviates, list_breaks, detach_came, turn_came, attach_came
   end type contact_activated_type

contains

   !> Set up contacts from named numbers.
   subroutine make_contact_activated(contacts, common, parameters, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> What all kinds of contacts are made of
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: columns and rows, rate and force of activation
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong, or there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      type(contact_activated_type), allocatable :: self
      integer :: stat

      allocate (self)
      self%parameters = common
      call set_up_activated(self, parameters, error)
      allocate (self%entry(common%count), source=0, stat=stat)
      if (stat /= 0) call raise(error, status_memory, "not enough memory for lists of contacts")
      call move_alloc(self, contacts)
   end subroutine make_contact_activated

   !> Draw all contacts for the start of a run.
   subroutine initialize_activated(self, state)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      type(pose_type) :: pose
      integer :: contact

      call self%draw(state)
      do contact = 1, self%parameters%count
         call self%join(contact, pose)
      end do
   end subroutine initialize_activated

   !> Contact force as a law, which holds until a contact breaks, attaches or bears no force.
   subroutine offer_activated(self, pose, law, window)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> The law
      type(interface_law_type), intent(out) :: law
      !> Where it holds
      type(window_type), intent(out) :: window

      real(wp) :: ahead

      law = total_law(self)
      call self%order(self%ahead)%first(ahead)
      window = self%window_between(self%behind, ahead, self%detached%next_due)
      call set_next(self)
      call self%hazard%offer(pose%displacement, self%clock)
      call self%hazard%limit_window(window)
   end subroutine offer_activated

   !> Find where the clocks come to their next keys.
   subroutine set_next(self)
      class(contact_activated_type), intent(inout) :: self

      integer :: number

      self%hazard%is_used = self%members > 0
      do number = 1, clocks
         if (self%members(number) > 0) then
            call self%order(motions + number)%first(self%hazard%next(number))
         end if
      end do
   end subroutine set_next

   !> Break all contacts that are due, then attach those that are, in the order in which they broke.
   subroutine respond_activated(self, before, after)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Where the slider was, and where it is
      type(pose_type), intent(in) :: before, after

      call self%hazard%go_on(self%clock)
      call self%respond_here(after)
   end subroutine respond_activated

   !> Break and attach contacts where the slider is.
   subroutine respond_here(self, pose)
      class(contact_activated_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks
      integer :: number

      breaks = self%breaks
      do number = 1, clocks
         call self%break_activated(number, pose)
      end do
      call self%turn_round(pose%displacement)
      call self%pass_ahead(pose)
      call self%renew_due(pose)
      if (self%breaks > breaks) self%track%generation = self%track%generation + 1
      do number = 1, clocks
         call self%move_reference(number, pose%displacement)
      end do
      call self%attach_due(pose)
   end subroutine respond_here

   !> Break the contacts whose keys a clock has come to.
   subroutine break_activated(self, number, pose)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: number
      type(pose_type), intent(in) :: pose

      integer :: contact

      if (self%members(number) == 0) return
      do
         call self%order(motions + number)%due(self%hazard%reading(number), contact)
         if (contact == 0) return
         if (self%confirms(contact, pose, .true.)) call self%break_contact(contact, pose)
      end do
   end subroutine break_activated

   !> Let contacts respond to a motion ahead: they break at their thresholds, or their forces change
   !> their signs.
   subroutine pass_ahead(self, pose)
      class(contact_activated_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do
         call self%order(self%ahead)%due(self%direction * pose%displacement, contact)
         if (contact == 0) return
         if (force_sign(int(self%life(life_clock, contact))) * self%direction < 0.0_wp) then
            call self%change_sign(contact)
         else if (self%confirms(contact, pose, .false.)) then
            call self%break_contact(contact, pose)
         end if
      end do
   end subroutine pass_ahead

   !> A contact breaks.
   subroutine break_contact(self, contact, pose)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      call self%take_out(contact)
      call self%detach(contact, pose%displacement, pose%time)
      self%life(:, contact) = 0.0_wp
   end subroutine break_contact

   !> Give a contact that has attached a deviate and a place in each order.
   subroutine join(self, contact, pose)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Where the slider is
      type(pose_type), intent(in) :: pose

      real(wp) :: stretch
      integer :: number

      call self%draw_deviates([contact])
      stretch = pose%displacement - self%record(row_origin, contact)
      if (.not. abs(stretch) > 0.0_wp) stretch = pose%direction
      number = merge(1, 2, stretch > 0.0_wp)
      self%life(life_clock, contact) = real(number, wp)
      self%life(life_key, contact) = never
      call self%prepare(contact, pose)
      call self%move_reference(number, pose%displacement)
      call self%put(contact)
   end subroutine join

   !> Draw the deviates of the next lives of contacts that have none yet.
   subroutine draw_deviates(self, contact)
      class(contact_activated_type), intent(inout) :: self
      !> Their numbers, at most max_events
      integer, intent(in) :: contact(:)

      integer :: number, position, drawn(max_events)
      integer(i8) :: key(max_events), renewal(max_events)
      real(wp) :: first(max_events), second(max_events)

      number = 0
      do position = 1, size(contact)
         if (self%life(life_left, contact(position)) > 0.0_wp) cycle
         number = number + 1
         drawn(number) = contact(position)
         key(number) = int(contact(position) - 1, i8)
         renewal(number) = int(self%record(row_renewal, contact(position)), i8)
      end do
      if (number == 0) return
      call uniform_pairs(self%parameters%seed, self%parameters%realization, key(:number), &
         & renewal(:number), 1_i8, first(:number), second(:number))
      do position = 1, number
         self%life(life_left, drawn(position)) = -log(first(position))
      end do
   end subroutine draw_deviates

   !> Write a schedule of what comes next: breaks at thresholds and by the clock of those whose
   !> force has the sign of the motion, and attachments.
   subroutine plan(self, pose, limit, schedule)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> Maximum number of breaks, and of attachments
      integer, intent(in) :: limit
      !> The schedule; at its end if there is none
      type(schedule_type), intent(inout) :: schedule

      integer :: length, number

      schedule%is_over = .true.
      if (self%track%columns > 0 .or. pose%direction * self%direction < 0.0_wp) return
      ! Without a delay a contact attaches where it breaks, which ends a schedule at once.
      if (.not. self%parameters%delay > 0.0_wp) return
      ! A schedule attaches contacts in the order in which they broke, with one force.
      if (self%parameters%delay_law /= delay_fixed &
         & .or. self%parameters%newborn_width > 0.0_wp) return
      schedule%number = merge(1, 2, self%direction > 0.0_wp)
      if (self%members(schedule%number) == 0) return
      length = min(limit, self%max_length)
      call self%list_breaks(length, schedule)
      if (schedule%breaks == 0 .or. schedule%clock_breaks == 0) return
      schedule%has_clocks = .true.
      call set_next(self)
      schedule%hazard = self%hazard
      schedule%hazard%next(schedule%number) = schedule%clock_key(1)
      schedule%direction = self%direction
      schedule%behind = self%behind
      schedule%tiny_stretch = self%distance_behind(schedule%number, 0.0_wp)
      schedule%break_stiffness(1) = self%parameters%stiffness
      schedule%break_drag(1) = drag_of(self%parameters, self%parameters%stiffness)
      call self%list_attachments(length, pose%direction, schedule, self%attaching)
      associate (attaching => self%attaching(:schedule%attachments))
         call self%draw_deviates(attaching)
         do number = 1, schedule%attachments
            schedule%attach_left(number) = self%life(life_left, attaching(number))
         end do
      end associate
      schedule%is_over = .false.
   end subroutine plan

   !> List the next breaks at thresholds, those whose forces get the sign of the motion with them,
   !> and breaks by the clock. That list ends at a key that is not known.
   subroutine list_breaks(self, limit, schedule)
      class(contact_activated_type), intent(inout) :: self
      !> Maximum length of each list
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      integer :: event, other, first

      call self%order(self%ahead)%preview(limit, self%listed, &
         & schedule%break_coordinate, schedule%breaks)
      call self%order(motions + schedule%number)%preview(limit, self%clock_listed, &
         & schedule%clock_key, schedule%clock_breaks)
      schedule%clock_stop = 0
      schedule%turned = 0
      other = clocks + 1 - schedule%number
      schedule%others = self%members(other)
      schedule%other_first = 0
      first = 0
      if (schedule%others > 0) call self%order(motions + other)%due(never, first)
      schedule%broken = 0
      schedule%clock_broken = 0
      schedule%came_count = 0
      schedule%moments = 0
      do event = 1, schedule%breaks
         associate (contact => self%listed(event))
            schedule%break_origin(event) = self%record(row_origin, contact)
            schedule%break_turns(event) = int(self%life(life_clock, contact)) /= schedule%number
            if (schedule%break_turns(event)) then
               schedule%turn_limit(event) = self%record(row_limit, contact)
               schedule%turn_left(event) = self%life(life_left, contact)
               schedule%turn_key(event) = self%life(life_key, contact)
               if (contact == first) schedule%other_first = event
            else
               self%entry(contact) = event
            end if
         end associate
      end do
      schedule%break_twin(:schedule%breaks) = 0
      schedule%break_gone(:schedule%breaks) = .false.
      do event = 1, schedule%clock_breaks
         associate (contact => self%clock_listed(event))
            schedule%clock_origin(event) = self%record(row_origin, contact)
            schedule%clock_twin(event) = self%entry(contact)
            if (self%entry(contact) > 0) schedule%break_twin(self%entry(contact)) = event
         end associate
      end do
      schedule%clock_gone(:schedule%clock_breaks) = .false.
      do event = 1, schedule%breaks
         self%entry(self%listed(event)) = 0
      end do
      if (schedule%clock_breaks == 0) then
         call self%order(motions + schedule%number)%first(schedule%clock_key(1))
         if (.not. schedule%clock_key(1) < never) then
            schedule%clock_breaks = 1
            schedule%clock_stop = 1
            schedule%clock_twin(1) = 0
            schedule%clock_gone(1) = .false.
         end if
      end if
   end subroutine list_breaks

   !> Keep the books of a schedule.
   subroutine settle(self, schedule, pose)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> The schedule, as far as the slider came; a moment in which contacts broke may be added
      type(schedule_type), intent(inout) :: schedule
      !> Where the slider is
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks
      integer :: number

      self%max_length = min(max_events, max(min_length, &
         & 2 * max(schedule%came_count + schedule%turned, schedule%attached)))
      self%hazard = schedule%hazard
      call self%detach_came(schedule)
      call self%turn_came(schedule)
      call self%attach_came(schedule)
      self%behind = schedule%behind
      if (schedule%is_over) then
         breaks = self%breaks
         call self%respond_here(pose)
         if (self%breaks > breaks .and. .not. schedule%breaks_now) then
            schedule%moments = schedule%moments + 1
         end if
      else
         number = clocks + 1 - schedule%number
         if (self%members(number) == 0) call self%move_reference(number, pose%displacement)
      end if
      self%detached_count = real(self%detached%count, wp)
   end subroutine settle

   !> Keep the books of the contacts of a schedule that broke.
   subroutine detach_came(self, schedule)
      class(contact_activated_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      integer :: event, contact

      do event = 1, schedule%came_count
         if (schedule%came(event) > 0) then
            contact = self%listed(schedule%came(event))
         else
            contact = self%clock_listed(-schedule%came(event))
         end if
         call self%take_out(contact)
         self%life(:, contact) = 0.0_wp
         self%record(row_stiffness, contact) = 0.0_wp
         self%record(row_renewal, contact) = self%record(row_renewal, contact) + 1.0_wp
         call self%break_loss%add(0.5_wp * schedule%break_stiffness(1) &
            & * (schedule%break_displacement(event) - self%record(row_origin, contact))**2)
         call self%detached%push(contact, schedule%break_time(event) + self%parameters%delay, &
            & schedule%break_drag(1))
      end do
      self%breaks = self%breaks + schedule%came_count
      self%stiffness = schedule%stiffness
      self%offset = schedule%offset
      self%drag = schedule%drag
   end subroutine detach_came

   !> Keep the books of the contacts of a schedule whose forces changed their signs.
   subroutine turn_came(self, schedule)
      class(contact_activated_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      integer :: event

      if (schedule%turned == 0) return
      do event = 1, schedule%broken
         if (.not. schedule%break_turns(event)) cycle
         associate (contact => self%listed(event))
            call self%take_out(contact)
            self%life(:, contact) = [real(schedule%number, wp), schedule%turn_left(event), &
               & schedule%turn_key(event)]
            call self%place(contact)
         end associate
      end do
   end subroutine turn_came

   !> Keep the books of the contacts of a schedule that attached.
   subroutine attach_came(self, schedule)
      class(contact_activated_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      integer :: event, contact(max_events)

      call self%attach_listed(schedule, contact)
      do event = 1, schedule%attached
         self%life(life_clock, contact(event)) = real(schedule%number, wp)
         self%life(life_key, contact(event)) = schedule%attach_key(event)
         call self%place(contact(event))
      end do
   end subroutine attach_came

   !> Prepare the life of a contact that has attached: nothing unless a kind has more to know.
   subroutine prepare(self, contact, pose)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Where the slider is
      type(pose_type), intent(in) :: pose

   end subroutine prepare

   !> Whether a contact breaks that has come to its threshold, or its clock to its key: it does
   !> unless these were bounds.
   function confirms(self, contact, pose, by_clock)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> Whether it is the clock
      logical, intent(in) :: by_clock
      !> Whether it breaks
      logical :: confirms

      confirms = .true.
   end function confirms

   !> Take note of what has changed with the time alone: nothing unless thresholds do.
   subroutine renew_due(self, pose)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose

   end subroutine renew_due

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call exchange_activated(self, archive)
   end subroutine exchange

end module mesoslip_contacts_activated_contacts
