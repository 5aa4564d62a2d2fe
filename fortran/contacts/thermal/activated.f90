!> N independent contacts, which break by thermal activation.
!>
!> A contact under the force f breaks at the rate omega_0 exp((abs(f) - f_s)/f_T), and at once where
!> abs(f) = f_s (Bell's law). Breaks below the threshold are drawn by thinning, or in closed form
!> in a uniform motion; there is no time step. The direction ahead is kept until an event on the
!> way back.
module mesoslip_contacts_thermal_activated
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_base, only: exchange_individual, individual_contacts_type, &
      & total_law
   use mesoslip_contacts_individual_births, only: drag_of
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, &
      & row_stiffness
   use mesoslip_contacts_individual_scan_order, only: new_scan_order, scan_order_type
   use mesoslip_contacts_thermal_candidates, only: by_newborn, by_upward_force, &
      & candidates_type, new_candidates, take_activation
   use mesoslip_contacts_thermal_uniform, only: new_uniform_motion, uniform_motion_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: make_activated_contacts

   !> Minimum length of a list of a schedule
   integer, parameter :: min_length = 8
   !> The lists: breaks by coordinate, attachments
   integer, parameter :: lists = 2, by_coordinate = 1, attachments = 2

   !> Contacts that break by thermal activation.
   type, extends(individual_contacts_type) :: activated_contacts_type
      type(candidates_type) :: candidates
      !> Where contacts break in a uniform motion, in which there are no candidates
      type(uniform_motion_type) :: uniform
      !> Contacts by their breaks at the threshold in a motion up and down, and the order ahead
      type(scan_order_type) :: order(2)
      integer :: ahead = 1
      !> Whether candidates must be drawn, as a contact exceeds its bound, or none have been
      logical :: is_late = .true.
      !> Contacts of the schedule: by coordinate, then of the candidates
      integer, private :: listed(2 * max_events) = 0
      !> Lengths of the next lists, by how much of the last ones happened
      integer, private :: max_length(lists) = max_events
      !> Entry of each contact in the schedule; 0 except while it is written
      integer, allocatable, private :: entry(:)
   contains
      procedure :: initialize, offer, respond, plan, settle, join, leave, exchange, rebuild, &
         & shift_order
      procedure, non_overridable, private :: insert, place, follow, follow_motion, break_contact, &
         & draw_candidates, list_breaks, list_candidates, detach_came, attach_came
   end type activated_contacts_type

contains

   !> Set up contacts from named numbers.
   subroutine make_activated_contacts(contacts, common, parameters, error)
      class(contacts_type), allocatable, intent(out) :: contacts
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: columns and rows, rate and force of activation
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(activated_contacts_type), allocatable :: self
      real(wp) :: rate, slope
      integer :: columns, rows, number, stat

      call parameters%take("columns", columns, error)
      call parameters%take("rows", rows, error)
      call take_activation(parameters, common, rate, slope, error)
      call parameters%finish(error)
      if (allocated(error)) return
      allocate (self)
      self%parameters = common
      call self%allocate_records(columns, rows, error)
      if (allocated(error)) return
      call new_candidates(self%candidates, common%count, rate, slope, &
         & common%seed, common%realization, error)
      if (.not. allocated(error)) call new_uniform_motion(self%uniform, common%count, rate, &
         & slope, common%seed, common%realization, error)
      do number = 1, size(self%order)
         if (.not. allocated(error)) call new_scan_order(self%order(number), common%count, error)
      end do
      if (allocated(error)) return
      allocate (self%entry(common%count), source=0, stat=stat)
      if (stat /= 0) call raise(error, status_memory, "not enough memory for lists of contacts")
      call move_alloc(self, contacts)
   end subroutine make_activated_contacts

   subroutine initialize(self, state)
      class(activated_contacts_type), intent(inout) :: self
      integer, intent(in) :: state

      call self%draw(state)
      call self%rebuild_queue(0.0_wp)
   end subroutine initialize

   !> The law holds until a contact breaks or attaches, or a candidate is tried.
   subroutine offer(self, pose, law, window)
      class(activated_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      real(wp) :: ahead

      call self%follow_motion(pose)
      law = total_law(self)
      call self%order(self%ahead)%first(ahead)
      window = self%window_between(self%behind, ahead, &
         & min(self%detached%next_due, self%candidates%next_time()))
      window%may_turn = .true.
      window%upper = min(window%upper, self%candidates%upper)
      window%lower = max(window%lower, self%candidates%lower)
      if (self%are_broken()) window%end_time = huge(1.0_wp)
   end subroutine offer

   subroutine respond(self, before, after)
      class(activated_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      call self%follow(after)
   end subroutine respond

   !> Break and attach all contacts that are due where the slider is.
   subroutine follow(self, pose)
      class(activated_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks
      integer :: contact

      breaks = self%breaks
      if (self%direction * pose%displacement <= self%behind &
         & .and. .not. self%uniform%is_used()) then
         ! The bound may be that of a contact that has broken since.
         self%behind = -self%order(3 - self%ahead)%lowest()
         if (self%direction * pose%displacement <= self%behind) then
            self%direction = -self%direction
            self%ahead = 3 - self%ahead
            self%behind = -self%order(3 - self%ahead)%lowest()
         end if
      end if
      do
         call self%order(self%ahead)%due(self%direction * pose%displacement, contact)
         if (contact == 0) exit
         call self%break_contact(contact, pose)
      end do
      do while (self%candidates%next_time() <= pose%time)
         associate (candidate => self%candidates%candidate(self%candidates%next))
            if (self%candidates%accepts(candidate, pose%displacement, &
               & self%record(:, candidate%contact), self%record(row_limit, candidate%contact))) then
               call self%break_contact(candidate%contact, pose)
            end if
         end associate
         self%candidates%next = self%candidates%next + 1
      end do
      if (self%breaks > breaks) self%track%generation = self%track%generation + 1
      call self%attach_due(pose)
      if (self%is_late .or. self%candidates%is_over(pose%displacement)) then
         call self%draw_candidates(pose)
      end if
   end subroutine follow

   !> Prepare for the present motion of the slider: uniform, or with candidates.
   subroutine follow_motion(self, pose)
      class(activated_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact
      logical :: is_new

      is_new = .false.
      ! With a track it is not known before where contacts attach, nor thus where they break.
      if (.not. self%parameters%strength%is_used) call self%uniform%follow(pose, is_new)
      if (is_new) then
         call self%candidates%forget()
         self%is_late = .not. self%uniform%is_used()
         if (.not. self%is_late) self%direction = sign(1.0_wp, pose%velocity)
         do contact = 1, self%parameters%count
            associate (record => self%record(:, contact))
               if (self%is_late .or. .not. record(row_stiffness) > 0.0_wp) cycle
               call self%uniform%solve_pinned(contact, &
                  & self%direction * (pose%displacement - record(row_origin)), record(row_limit))
            end associate
         end do
         call self%rebuild_queue(pose%displacement)
      end if
      if (self%is_late) call self%draw_candidates(pose)
   end subroutine follow_motion

   !> Draw candidates from now on.
   subroutine draw_candidates(self, pose)
      class(activated_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      call self%candidates%draw(pose%time, pose%displacement, pose%velocity, self%record)
      self%is_late = .false.
   end subroutine draw_candidates

   !> Break a contact.
   subroutine break_contact(self, contact, pose)
      class(activated_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      call self%leave(contact)
      call self%detach(contact, pose%displacement, pose%time)
   end subroutine break_contact

   subroutine join(self, contact, pose)
      class(activated_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: breaking(1)

      if (self%uniform%is_used()) then
         breaking = self%record(row_limit, contact)
         call self%uniform%solve_newborn([contact], self%record, 0_i8, &
            & [self%direction * merge(0.0_wp, self%newborn_stretch, self%touches)], breaking)
         self%uniform%stretch(contact) = breaking(1)
      end if
      call self%place(contact)
   end subroutine join

   !> Place a contact that has attached in the order of breaking.
   subroutine place(self, contact)
      class(activated_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      associate (origin => self%record(row_origin, contact), &
         & limit => self%record(row_limit, contact))
         call self%candidates%insert(contact, origin, limit)
         call self%insert(contact)
         self%behind = max(self%behind, self%behind_of(contact))
         self%is_late = self%is_late .or. self%candidates%exceeds_bound(origin, limit)
      end associate
   end subroutine place

   !> Insert a contact into the orders of both directions.
   subroutine insert(self, contact)
      class(activated_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      real(wp) :: stretch

      associate (origin => self%record(row_origin, contact), &
         & limit => self%record(row_limit, contact))
         stretch = limit
         if (self%uniform%is_used()) stretch = self%uniform%stretch(contact)
         call self%order(self%ahead)%put(contact, self%direction * origin + stretch)
         call self%order(3 - self%ahead)%put(contact, limit - self%direction * origin)
      end associate
   end subroutine insert

   subroutine leave(self, contact)
      class(activated_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%candidates%remove(contact)
      call self%order(1)%remove(contact)
      call self%order(2)%remove(contact)
   end subroutine leave

   subroutine plan(self, pose, limit, schedule)
      class(activated_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      integer :: contact(max_events), number

      call self%follow_motion(pose)
      schedule%is_over = .true.
      if (self%track%columns > 0 .or. .not. self%knows_lives() .or. self%are_broken()) return
      call self%list_breaks(min(limit, self%max_length(by_coordinate)), pose, schedule)
      call self%list_candidates(limit, schedule)
      call self%list_attachments(min(limit, self%max_length(attachments)), pose%direction, &
         & schedule, contact)
      if (self%uniform%is_used()) call self%uniform%solve_newborn( &
         & contact(:schedule%attachments), self%record, 0_i8, &
         & self%direction * schedule%attach_stretch(:schedule%attachments), schedule%attach_limit)
      ! The first contact beyond the list may break by a candidate.
      number = schedule%breaks
      if (self%listed(number + 1) > 0) number = number + 1
      call self%list_births(self%listed(:number), 0, pose%direction, schedule)
      if (schedule%has_births .and. self%uniform%is_used()) call self%uniform%solve_newborn( &
         & self%listed(:number), self%record, 1_i8, &
         & self%direction * schedule%birth_stretch(:number), schedule%birth_limit)
      if (schedule%has_births) call self%list_births(self%listed(max_events + 1: &
         & max_events + schedule%candidates), max_events, pose%direction, schedule)
      schedule%is_over = .false.
   end subroutine plan

   !> List the next breaks at thresholds, up to the first one beyond the window of the candidates.
   !> On the way back the contacts decide which break at the bound.
   subroutine list_breaks(self, limit, pose, schedule)
      class(activated_contacts_type), intent(inout) :: self
      integer, intent(in) :: limit
      type(pose_type), intent(in) :: pose
      type(schedule_type), intent(inout) :: schedule

      real(wp) :: edge
      integer :: event, number

      schedule%direction = pose%direction
      schedule%behind = self%behind
      if (pose%direction * self%direction < 0.0_wp) then
         number = 1
         self%listed(1) = 0
         schedule%break_coordinate(1) = -self%behind
         call self%order(self%ahead)%first(schedule%behind)
         schedule%behind = -schedule%behind
      else
         call self%order(self%ahead)%preview(limit, self%listed, schedule%break_coordinate, number)
         if (number == 0) then
            number = 1
            call self%order(self%ahead)%first(schedule%break_coordinate(1))
            call self%order(self%ahead)%due(huge(1.0_wp), self%listed(1))
         end if
         edge = merge(self%candidates%upper, -self%candidates%lower, self%direction > 0.0_wp)
      end if
      do event = 1, number - 1
         if (schedule%break_coordinate(event) > edge) exit
         schedule%break_origin(event) = self%record(row_origin, self%listed(event))
      end do
      schedule%breaks = event - 1
      if (self%listed(event) > 0) then
         schedule%break_origin(event) = self%record(row_origin, self%listed(event))
      end if
      schedule%break_stiffness(1) = self%parameters%stiffness
      schedule%break_drag(1) = drag_of(self%parameters, self%parameters%stiffness)
      schedule%broken = 0
      schedule%moments = 0
      schedule%came_count = 0
      schedule%is_gone(:schedule%breaks + 1) = .false.
   end subroutine list_breaks

   !> List the next candidates.
   subroutine list_candidates(self, limit, schedule)
      class(activated_contacts_type), intent(inout) :: self
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      integer :: event, number

      schedule%has_candidates = .true.
      schedule%upper = self%candidates%upper
      schedule%lower = self%candidates%lower
      schedule%newborn_upper = self%candidates%newborn_upper
      schedule%newborn_lower = self%candidates%newborn_lower
      schedule%tried = 0
      number = min(limit, self%candidates%drawn - self%candidates%next + 1)
      schedule%candidates = number
      do event = 1, schedule%breaks + 1
         if (self%listed(event) > 0) self%entry(self%listed(event)) = event
      end do
      do event = 1, number
         associate (candidate => self%candidates%candidate(self%candidates%next + event - 1))
            schedule%candidate_time(event) = candidate%time
            self%listed(max_events + event) = candidate%contact
            if (self%entry(candidate%contact) == 0) then
               self%entry(candidate%contact) = max_events + event
            end if
            schedule%candidate_entry(event) = self%entry(candidate%contact)
            schedule%is_gone(max_events + event) = .false.
            schedule%candidate_upper(event) = huge(1.0_wp)
            schedule%candidate_lower(event) = -huge(1.0_wp)
            associate (record => self%record(:, candidate%contact))
               schedule%break_origin(max_events + event) = record(row_origin)
               if (candidate%purpose == by_newborn) then
                  schedule%candidate_entry(event) = 0
               else if (.not. record(row_stiffness) > 0.0_wp &
                  & .or. abs(record(row_renewal) - candidate%life) > 0.0_wp) then
                  ! The contact has broken since.
                  cycle
               else if (candidate%purpose == by_upward_force) then
                  schedule%candidate_upper(event) = max(candidate%bound, record(row_origin))
               else
                  ! A contact without a force has none of that sign.
                  schedule%candidate_lower(event) = min(candidate%bound, &
                     & nearest(record(row_origin), -1.0_wp))
               end if
            end associate
         end associate
      end do
      schedule%candidate_time(number + 1) = huge(1.0_wp)
      if (self%candidates%next + number <= self%candidates%drawn) then
         schedule%candidate_time(number + 1) &
            & = self%candidates%candidate(self%candidates%next + number)%time
      end if
      do event = 1, schedule%breaks + 1
         if (self%listed(event) > 0) self%entry(self%listed(event)) = 0
      end do
      do event = 1, number
         self%entry(self%listed(max_events + event)) = 0
      end do
   end subroutine list_candidates

   subroutine settle(self, schedule, pose)
      class(activated_contacts_type), intent(inout) :: self
      type(schedule_type), intent(inout) :: schedule
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks

      self%max_length = min(max_events, max(min_length, 2 * [schedule%broken, schedule%attached]))
      self%candidates%next = self%candidates%next + schedule%tried
      call self%detach_came(schedule)
      call self%attach_came(schedule)
      if (schedule%is_over) then
         breaks = self%breaks
         call self%follow(pose)
         if (self%breaks > breaks .and. .not. schedule%breaks_now) then
            schedule%moments = schedule%moments + 1
         end if
      end if
      self%detached_count = real(self%detached%count, wp)
   end subroutine settle

   !> Update the contacts that broke in a schedule.
   subroutine detach_came(self, schedule)
      class(activated_contacts_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      real(wp) :: delay
      integer :: event

      delay = self%parameters%delay
      do event = 1, schedule%came_count
         associate (contact => self%listed(schedule%came(event)))
            call self%leave(contact)
            if (allocated(self%births%delay)) delay = self%births%delay(contact)
            self%record(row_stiffness, contact) = 0.0_wp
            self%record(row_renewal, contact) = self%record(row_renewal, contact) + 1.0_wp
            call self%break_loss%add(0.5_wp * schedule%break_stiffness(1) &
               & * (schedule%break_displacement(event) - self%record(row_origin, contact))**2)
            call self%detached%push(contact, schedule%break_time(event) + delay, &
               & schedule%break_drag(1))
         end associate
      end do
      self%breaks = self%breaks + schedule%came_count
      self%stiffness = schedule%stiffness
      self%offset = schedule%offset
      self%drag = schedule%drag
   end subroutine detach_came

   !> Update the contacts that attached in a schedule.
   subroutine attach_came(self, schedule)
      class(activated_contacts_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      integer :: event, contact(max_events)

      call self%attach_listed(schedule, contact)
      do event = 1, schedule%attached
         associate (record => self%record(:, contact(event)))
            if (self%uniform%is_used()) then
               self%uniform%stretch(contact(event)) = record(row_limit)
               record(row_limit) = self%uniform%limit(contact(event))
            end if
         end associate
         call self%place(contact(event))
      end do
   end subroutine attach_came

   subroutine rebuild(self, displacement)
      class(activated_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      integer :: contact

      self%ahead = merge(1, 2, self%direction > 0.0_wp)
      call self%order(1)%clear()
      call self%order(2)%clear()
      do contact = 1, self%parameters%count
         if (self%record(row_stiffness, contact) > 0.0_wp) call self%insert(contact)
      end do
      call self%candidates%fill(self%record)
   end subroutine rebuild

   !> Shift the windows of the candidates.
   subroutine shift_order(self, shift)
      class(activated_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call self%candidates%shift_origin(shift)
   end subroutine shift_order

   subroutine exchange(self, archive)
      class(activated_contacts_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("activated contacts")
      call exchange_individual(self, archive)
      call archive%exchange("is_late", self%is_late)
      call self%uniform%exchange(archive)
      call self%candidates%exchange(archive)
   end subroutine exchange

end module mesoslip_contacts_thermal_activated
