!> Schedules of contacts that break by thermal activation, with clocks.
module mesoslip_contacts_thermal_lists
   use mesoslip_contacts_individual_births, only: drag_of
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, row_stiffness
   use mesoslip_contacts_thermal_keys, only: thermal_keys_type, life_clock, life_key, &
      & life_left, life_next, motions
   use mesoslip_hazard, only: never
   use mesoslip_interface_law, only: clocks, pose_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: uniform_pairs
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: thermal_lists_type

   !> Minimum length of a list of a schedule
   integer, parameter :: min_length = 8
   !> The lists: events by coordinate, breaks by the clock, attachments
   integer, parameter :: lists = 3, by_coordinate = 1, by_clock = 2, attachments = 3

   !> Contacts that break by thermal activation, and write schedules with clocks.
   type, abstract, extends(thermal_keys_type) :: thermal_lists_type
      !> Contacts of the schedule, by coordinate and by clock, and those that attach in it
      integer, private :: listed(max_events) = 0, clock_listed(max_events) = 0, &
         & attaching(max_events) = 0
      !> Lengths of the next lists, by how much of the last ones happened
      integer, private :: max_length(lists) = max_events
      !> Entry of each contact in the list by coordinate; 0 except while lists are written
      integer, allocatable :: entry(:)
   contains
      procedure, non_overridable :: plan_by_clocks, set_next, draw_deviates, settle_lists
      procedure, non_overridable, private :: list_attaching, list_breaks, detach_came, turn_came, &
         & attach_came
   end type thermal_lists_type

contains

   !> Set the next keys of the clocks.
   subroutine set_next(self)
      class(thermal_lists_type), intent(inout) :: self

      integer :: number

      self%hazard%is_used = self%members > 0
      do number = 1, clocks
         if (self%members(number) > 0) then
            call self%order(motions + number)%first(self%hazard%next(number))
         end if
      end do
   end subroutine set_next

   !> Draw the deviates of the next lives of at most max_events contacts, if they have none.
   subroutine draw_deviates(self, contact, later)
      class(thermal_lists_type), intent(inout) :: self
      integer, intent(in) :: contact(:)
      !> Renewals until those lives: 1 for pinned contacts
      integer(i8), intent(in) :: later

      integer :: number, position, drawn(max_events)
      integer(i8) :: key(max_events), renewal(max_events)
      real(wp) :: first(max_events), second(max_events)

      number = 0
      do position = 1, size(contact)
         if (self%life(life_next, contact(position)) > 0.0_wp) cycle
         number = number + 1
         drawn(number) = contact(position)
         key(number) = int(contact(position) - 1, i8)
         renewal(number) = int(self%record(row_renewal, contact(position)), i8) + later
      end do
      if (number == 0) return
      call uniform_pairs(self%parameters%seed, self%parameters%realization, key(:number), &
         & renewal(:number), 1_i8, first(:number), second(:number))
      do position = 1, number
         self%life(life_next, drawn(position)) = -log(first(position))
      end do
   end subroutine draw_deviates

   !> Write a schedule of breaks at thresholds, of breaks by the clock of the forces along the
   !> motion, and of attachments.
   subroutine plan_by_clocks(self, pose, limit, schedule)
      class(thermal_lists_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      integer :: length(lists)

      schedule%is_over = .true.
      if (self%track%columns > 0 .or. pose%direction * self%direction < 0.0_wp) return
      if (.not. self%knows_lives()) return
      schedule%number = merge(1, 2, self%direction > 0.0_wp)
      if (self%members(schedule%number) == 0) return
      length = min(limit, self%max_length)
      call self%list_breaks(length(by_coordinate), length(by_clock), schedule)
      if (schedule%breaks == 0 .or. schedule%clock_breaks == 0) return
      schedule%has_clocks = .true.
      call self%set_next()
      schedule%hazard = self%hazard
      schedule%hazard%next(schedule%number) = schedule%clock_key(1)
      schedule%direction = self%direction
      schedule%behind = self%behind
      schedule%break_stiffness(1) = self%parameters%stiffness
      schedule%break_drag(1) = drag_of(self%parameters, self%parameters%stiffness)
      call self%list_attaching(length(attachments), pose%direction, schedule)
      schedule%is_over = .false.
   end subroutine plan_by_clocks

   !> List the next attachments in a direction of motion, and the births of contacts that break and
   !> may attach in the schedule.
   subroutine list_attaching(self, limit, direction, schedule)
      class(thermal_lists_type), intent(inout) :: self
      integer, intent(in) :: limit
      real(wp), intent(in) :: direction
      type(schedule_type), intent(inout) :: schedule

      integer :: event

      call self%list_attachments(limit, direction, schedule, self%attaching)
      do event = 1, schedule%attachments
         ! A contact of the other clock ends the schedule.
         if (direction * schedule%attach_stretch(event) < 0.0_wp) exit
      end do
      schedule%attachments = event - 1
      associate (attaching => self%attaching(:schedule%attachments))
         call self%draw_deviates(attaching, 0_i8)
         do event = 1, schedule%attachments
            schedule%attach_left(event) = self%life(life_next, attaching(event))
         end do
      end associate
      associate (listed => self%listed(:schedule%breaks), &
         & clock_listed => self%clock_listed(:merge(0, schedule%clock_breaks, &
         & schedule%clock_stop > 0)))
         call self%list_births(listed, 0, direction, schedule)
         if (.not. schedule%has_births) return
         call self%list_births(clock_listed, max_events, direction, schedule)
         call self%draw_deviates(listed, 1_i8)
         call self%draw_deviates(clock_listed, 1_i8)
         do event = 1, size(listed)
            schedule%birth_left(event) = self%life(life_next, listed(event))
         end do
         do event = 1, size(clock_listed)
            schedule%birth_left(max_events + event) = self%life(life_next, clock_listed(event))
         end do
      end associate
   end subroutine list_attaching

   !> List the next breaks at thresholds, with the contacts of the other clock whose forces change
   !> their sign, and breaks by the clock. That list ends before a key that is not known.
   subroutine list_breaks(self, limit, clock_limit, schedule)
      class(thermal_lists_type), intent(inout) :: self
      !> Maximum lengths of the lists by coordinate and by the clock
      integer, intent(in) :: limit, clock_limit
      type(schedule_type), intent(inout) :: schedule

      integer :: event, other, first

      call self%order(self%ahead)%preview(limit, self%listed, &
         & schedule%break_coordinate, schedule%breaks)
      call self%order(motions + schedule%number)%preview(clock_limit, self%clock_listed, &
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

   !> Update the contacts after a schedule.
   subroutine settle_lists(self, schedule)
      class(thermal_lists_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      self%max_length = min(max_events, max(min_length, &
         & 2 * [schedule%broken, schedule%clock_broken, schedule%attached]))
      self%hazard = schedule%hazard
      call self%detach_came(schedule)
      call self%turn_came(schedule)
      call self%attach_came(schedule)
      self%behind = schedule%behind
   end subroutine settle_lists

   !> Update the contacts that broke.
   subroutine detach_came(self, schedule)
      class(thermal_lists_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      real(wp) :: delay
      integer :: event, contact

      delay = self%parameters%delay
      do event = 1, schedule%came_count
         if (schedule%came(event) > 0) then
            contact = self%listed(schedule%came(event))
         else
            contact = self%clock_listed(-schedule%came(event))
         end if
         call self%take_out(contact)
         self%life(:life_key, contact) = 0.0_wp
         if (allocated(self%births%delay)) delay = self%births%delay(contact)
         self%record(row_stiffness, contact) = 0.0_wp
         self%record(row_renewal, contact) = self%record(row_renewal, contact) + 1.0_wp
         call self%break_loss%add(0.5_wp * schedule%break_stiffness(1) &
            & * (schedule%break_displacement(event) - self%record(row_origin, contact))**2)
         call self%detached%push(contact, schedule%break_time(event) + delay, &
            & schedule%break_drag(1))
      end do
      self%breaks = self%breaks + schedule%came_count
      self%stiffness = schedule%stiffness
      self%offset = schedule%offset
      self%drag = schedule%drag
   end subroutine detach_came

   !> Update the contacts whose forces changed their sign.
   subroutine turn_came(self, schedule)
      class(thermal_lists_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      integer :: event

      if (schedule%turned == 0) return
      do event = 1, schedule%broken
         if (.not. schedule%break_turns(event)) cycle
         associate (contact => self%listed(event))
            call self%take_out(contact)
            self%life(:life_key, contact) = [real(schedule%number, wp), &
               & schedule%turn_left(event), schedule%turn_key(event)]
            call self%insert(contact)
         end associate
      end do
   end subroutine turn_came

   !> Update the contacts that attached.
   subroutine attach_came(self, schedule)
      class(thermal_lists_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      integer :: event, contact(max_events)

      call self%attach_listed(schedule, contact)
      do event = 1, schedule%attached
         self%life(:, contact(event)) = [real(schedule%number, wp), schedule%attach_left(event), &
            & schedule%attach_key(event), 0.0_wp]
         call self%insert(contact(event))
      end do
   end subroutine attach_came

end module mesoslip_contacts_thermal_lists
