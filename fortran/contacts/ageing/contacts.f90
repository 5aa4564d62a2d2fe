!> N independent contacts whose thresholds change with their age.
!>
!> A contact breaks at the first time at which its force equals its threshold, while both change.
!> Contacts are queued by bounds on where that happens:
!>
!> - In a steady motion it happens there, which is solved once, at birth
!>   (mesoslip_contacts_ageing_steady).
!> - Otherwise the bound of a growing threshold is its last value. The first contacts of the queue
!>   are the leaders, whose breaks are extrapolated from the motion of the slider
!>   (mesoslip_contacts_ageing_leaders). A schedule has the leaders.
!> - The bound of a falling threshold is its value when it is old. A contact that has reached that
!>   is kept apart (mesoslip_contacts_ageing_falling).
!>
!> A contact that does not age breaks as in the ensemble without ageing, to the bit.
module mesoslip_contacts_ageing_contacts
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type, any_motion, falling, in_falling, &
      & in_leaders, in_queue, leaders, life_birth, life_length, life_limit, life_motion, near, &
      & next_configured, next_length, next_speed, no_motion, position_of, remove, &
      & tiny_gap
   use mesoslip_contacts_ageing_falling, only: add_falling, bound_falling, break_falling, scan, &
      & scan_if_needed
   use mesoslip_contacts_ageing_law, only: take_ageing_law
   use mesoslip_contacts_ageing_leaders, only: add_leader, bound_leaders, break_leaders, &
      & gather_leaders, remove_leader, sort_leaders
   use mesoslip_contacts_ageing_motion, only: follow_motion
   use mesoslip_contacts_ageing_steady, only: break_steady, list_steady, queue_newborn, &
      & solve_attached, solve_listed
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_base, only: exchange_individual, total_law
   use mesoslip_contacts_individual_queue, only: new_contact_queue
   use mesoslip_contacts_individual_births, only: drag_of
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_stiffness
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: contact_ageing_type, make_contact_ageing
   ! For kinds that extend this one: a call by a component would lose their own procedures.
   public :: set_up_ageing, initialize_ageing, offer_ageing, respond_ageing, plan_ageing, &
      & settle_ageing, shift_ageing, exchange_ageing

   !> Probability of a threshold beyond the ring of buckets of the queue
   real(wp), parameter :: negligible = 1.0e-4_wp
   !> Distance of the slider from the bound behind it, over the mean breaking stretch, at which the
   !> queue is reversed: a receding bound would be approached in ever smaller steps
   real(wp), parameter :: near_behind = 1.0e-2_wp

   !> Minimum number of breaks in a schedule of leaders, and maximum
   integer, parameter :: min_listed = 8, max_listed = 48

   !> Contacts that age.
   type, extends(ageing_contacts_type) :: contact_ageing_type
      !> Number of breaks in the next schedule of leaders, by how much happened in the last one
      integer, private :: wanted = max_listed
   contains
      procedure :: initialize => initialize_ageing
      procedure :: offer => offer_ageing
      procedure :: respond => respond_ageing
      procedure :: plan => plan_ageing
      procedure :: settle => settle_ageing
      procedure :: shift_order => shift_ageing
      procedure :: exchange => exchange_ageing
      procedure :: join, leave, list_bounds, settle_activated
      procedure, non_overridable :: list_limits
      procedure, private, non_overridable :: break_due, reverse, list_leaders, settle_leaders
   end type contact_ageing_type

contains

   !> Set up contacts that age from named numbers.
   subroutine make_contact_ageing(contacts, common, parameters, error)
      class(contacts_type), allocatable, intent(out) :: contacts
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: the law of ageing, and whether the slider jumps
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(contact_ageing_type), allocatable :: self

      allocate (self)
      call set_up_ageing(self, common, 0, 0, parameters, error)
      call parameters%finish(error)
      call move_alloc(self, contacts)
   end subroutine make_contact_ageing

   !> Set up contacts of a kind.
   subroutine set_up_ageing(self, common, columns, rows, parameters, error)
      class(contact_ageing_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: common
      !> Columns and rows of the lattice; 0 columns without a lattice
      integer, intent(in) :: columns, rows
      !> The other numbers: the law of ageing, and whether the slider jumps
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: longest, rate
      integer :: stat

      self%parameters = common
      call take_ageing_law(self%ageing, self%parameters%law, parameters, error)
      call parameters%take("slider_jumps", self%jumps, error)
      if (allocated(error)) return
      self%stretch = common%static_force / common%stiffness
      call self%allocate_records(columns, rows, error)
      if (.not. allocated(error)) call self%births%record_factors(self%parameters, error)
      if (allocated(error)) return
      self%lists_sites = .not. (allocated(self%births%force) .or. common%strength%is_used)
      associate (count => common%count)
         allocate (self%life(life_length, count), source=0.0_wp, stat=stat)
         if (stat == 0) allocate (self%next(next_length, count), source=0.0_wp, stat=stat)
         if (stat == 0) allocate (self%kept(count), source=in_queue, stat=stat)
         if (stat == 0) allocate (self%list(leaders)%contact(count), source=0, stat=stat)
         if (stat == 0) allocate (self%leader_key(count), source=0.0_wp, stat=stat)
         if (stat == 0) allocate (self%list(falling)%contact(count), source=0, stat=stat)
         if (stat == 0) allocate (self%list(near)%contact(count), source=0, stat=stat)
      end associate
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the ages of contacts")
         return
      end if
      ! As for contacts that do not age, but growing thresholds have keys farther along the ring.
      call self%ageing%evaluate(max(self%parameters%law%quantile(negligible), 1.0_wp), 1.0_wp, &
         & self%ageing%time, longest, rate)
      longest = max(longest, self%parameters%law%quantile(negligible), 1.0_wp)
      call new_contact_queue(self%queue, common%count, &
         & 1.1_wp * self%stretch * longest * (1.0_wp + common%back_force_ratio) &
         & * common%strength%usual_max(), error)
   end subroutine set_up_ageing

   !> Draw all contacts, and queue them.
   subroutine initialize_ageing(self, state)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: state

      integer :: contact

      call self%draw(state)
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         self%life(life_birth, contact) = -self%ageing%initial_age
         self%life(life_limit, contact) = self%record(row_limit, contact)
         call self%solve(contact, 0.0_wp, 0.0_wp)
      end do
      call self%rebuild_queue(0.0_wp)
      ! The slider is in balance under this law.
      self%prediction%law = total_law(self)
      self%prediction%offered = self%prediction%law
   end subroutine initialize_ageing

   !> The law holds until a contact breaks or attaches.
   subroutine offer_ageing(self, pose, law, window)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      real(wp) :: upper, lower, end_time

      law = total_law(self)
      upper = huge(1.0_wp)
      lower = self%behind
      end_time = min(self%detached%next_due, self%sites%next_time)
      self%cost = 1.0_wp
      call self%prediction%predict(pose, law)
      call follow_motion(self, pose)
      if (self%is_steady) then
         upper = self%queue%first_key
      else
         call scan_if_needed(self, pose)
         call bound_leaders(self, pose, upper, end_time)
         call bound_falling(self, pose, upper, lower, end_time)
      end if
      window = self%window_between(lower, upper, end_time)
   end subroutine offer_ageing

   !> Break all contacts that are due, then attach those that are, in the order in which they broke.
   subroutine respond_ageing(self, before, after)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: breaks

      self%now = after%time
      call self%prediction%compare(before, after)
      if (self%is_steady) self%prediction%jerk_error = 0.0_wp
      breaks = self%breaks
      self%is_unchanged = min(self%detached%next_due, self%sites%next_time) > after%time
      if (self%is_steady) then
         if (abs(after%velocity - before%velocity) + abs(after%acceleration) > 0.0_wp) then
            self%is_steady = .false.
         end if
      end if
      call self%break_due(after)
      if (self%breaks > breaks) self%is_unchanged = .false.
      call self%attach_due(after)
   end subroutine respond_ageing

   !> Write a schedule of the next breaks and about as many attachments.
   subroutine plan_ageing(self, pose, limit, schedule)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Maximum number of breaks, and of attachments
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      integer :: number, contact(max_events)

      schedule%is_over = .true.
      if (self%jumps .or. pose%direction * self%direction < 0.0_wp) return
      ! Limits are solved before it is known where contacts attach, and under one force.
      if (self%parameters%strength%is_used .or. self%parameters%keeps_thresholds) return
      self%cost = 1.0_wp
      call follow_motion(self, pose)
      schedule%has_growth = .not. self%is_steady
      if (self%is_steady) then
         call list_steady(self, min(limit, max_events), schedule, number)
      else
         if (.not. (pose%is_known .and. self%list(falling)%count == 0)) return
         call self%list_leaders(pose, min(limit, self%wanted), schedule, number)
      end if
      if (number == 0) return
      schedule%break_stiffness(:number) = self%parameters%stiffness
      schedule%break_drag(:number) = drag_of(self%parameters, self%parameters%stiffness)
      schedule%breaks = number
      schedule%written = number
      schedule%broken = 0
      schedule%moments = 0
      schedule%direction = self%direction
      schedule%behind = self%behind
      call self%list_attachments(min(limit, max_events, &
         & merge(2, 1, self%is_steady) * number + 4), pose%direction, schedule, contact)
      call self%list_limits(contact(:schedule%attachments), schedule%attach_limit, &
         & schedule%attach_bound)
      call self%list_births(self%listed(:number), 0, pose%direction, schedule)
      if (schedule%has_births) call self%list_limits(self%listed(:number), &
         & schedule%birth_limit, schedule%birth_bound)
      call self%list_sites(min(limit, max_events), self%listed(:number), schedule)
      schedule%is_over = .false.
   end subroutine plan_ageing

   !> List the breaks of the leaders.
   subroutine list_leaders(self, pose, limit, schedule, number)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Maximum number of breaks
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule
      integer, intent(out) :: number

      integer :: event

      call gather_leaders(self, pose, limit)
      self%cost = 1.0_wp
      schedule%unlisted = self%queue%first_key
      associate (list => self%list(leaders))
         do event = 1, min(limit, list%count)
            associate (one => list%contact(list%count + 1 - event))
               if (self%is_falling(one) &
                  & .or. self%leader_key(list%count + 1 - event) >= schedule%unlisted) exit
               self%listed(event) = one
               schedule%break_entry(event) = event
               schedule%break_coordinate(event) = self%leader_key(list%count + 1 - event)
               schedule%break_origin(event) = self%record(row_origin, one)
               schedule%entry_is_constant(event) = self%life(life_motion, one) >= any_motion
               schedule%entry_limit(event) = self%record(row_limit, one)
               schedule%entry_configured(event) = self%life(life_limit, one)
               schedule%entry_mean(event) = self%mean_of(one)
               schedule%entry_birth(event) = self%life(life_birth, one)
            end associate
         end do
         number = event - 1
         if (number < list%count) then
            schedule%unlisted = min(schedule%unlisted, self%leader_key(list%count - number))
         end if
      end associate
      schedule%lateness = 0.0_wp
      schedule%ageing = self%ageing
      schedule%prediction = self%prediction
      schedule%resolution = tiny_gap * self%stretch
   end subroutine list_leaders

   !> Replace the configured breaking stretches of contacts by their limits in the next life [m]:
   !> where they break in the steady motion, else bounds.
   subroutine list_limits(self, contact, limit, bound)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact(:)
      real(wp), intent(inout) :: limit(:)
      !> Bounds on their thresholds [m], for kinds that need them
      real(wp), intent(inout) :: bound(:)

      integer :: event

      do event = 1, size(contact)
         self%next(next_configured, contact(event)) = limit(event)
      end do
      if (self%is_steady) then
         call solve_listed(self, contact, limit)
      else
         do event = 1, size(contact)
            limit(event) = self%limit_at_birth(limit(event))
         end do
      end if
      call self%list_bounds(contact, bound)
   end subroutine list_limits

   !> List bounds on the thresholds of contacts in their next life, the configured stretches of
   !> which are set: not needed here.
   subroutine list_bounds(self, contact, bound)
      class(contact_ageing_type), intent(in) :: self
      integer, intent(in) :: contact(:)
      !> The bounds [m]
      real(wp), intent(inout) :: bound(:)

   end subroutine list_bounds

   !> Update the contacts after a schedule.
   subroutine settle_ageing(self, schedule, pose)
      class(contact_ageing_type), intent(inout) :: self
      !> The schedule; moments in which contacts broke may be added
      type(schedule_type), intent(inout) :: schedule
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks
      integer :: event, number, contact(max_events)

      self%now = pose%time
      call self%settle_activated(schedule, number)
      call self%detach_listed(self%listed(schedule%break_entry(:schedule%broken)), schedule)
      if (schedule%has_growth) then
         call self%settle_leaders(schedule)
      else
         self%prediction%jerk_error = 0.0_wp
         if (schedule%broken > number) then
            call self%queue%remove_previewed(self%record, schedule%broken - number)
         end if
      end if
      call self%attach_listed(schedule, contact)
      do event = 1, schedule%attached
         associate (one => contact(event))
            self%life(:, one) = [schedule%attach_time(event), self%next(next_configured, one), &
               & merge(self%motion, no_motion, self%is_steady)]
            if (self%ageing%is_constant(self%life(life_limit, one), self%stretch)) then
               self%life(life_motion, one) = any_motion
            end if
            self%next(next_speed, one) = 0.0_wp
            call self%put(one)
            if (self%is_steady) then
               self%behind = max(self%behind, self%behind_at(one, schedule%attach_time(event)))
            end if
            call self%begin_life(one)
         end associate
      end do
      if (self%is_steady) call solve_attached(self, contact(:schedule%attached))
      call self%move_listed(schedule, pose)
      if (schedule%is_over) then
         breaks = self%breaks
         call self%break_activated(pose)
         if (self%breaks > breaks .and. .not. schedule%breaks_now) then
            schedule%moments = schedule%moments + 1
         end if
         ! A contact that has just broken and attaches at once was not in the schedule.
         call self%attach_due(pose)
      end if
      self%detached_count = real(self%detached%count, wp)
   end subroutine settle_ageing

   !> Update the leaders after a schedule of them.
   subroutine settle_leaders(self, schedule)
      class(contact_ageing_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      integer :: event, first

      self%wanted = min(max_listed, min_listed + 2 * max(schedule%broken, schedule%attached))
      self%prediction = schedule%prediction
      self%error_estimate = max(self%error_estimate, merge(schedule%lateness, 0.0_wp, &
         & schedule%lateness > schedule%resolution) * self%parameters%stiffness)
      self%kept(self%listed(schedule%break_entry(:schedule%broken))) = in_queue
      associate (list => self%list(leaders))
         ! Those that were listed are the last ones.
         first = list%count - schedule%written
         list%count = first + schedule%breaks - schedule%broken
         do event = schedule%broken + 1, schedule%breaks
            associate (entry => schedule%break_entry(event), &
               & position => first + 1 + schedule%breaks - event)
               list%contact(position) = self%listed(entry)
               self%leader_key(position) = schedule%break_coordinate(event)
               self%record(row_limit, self%listed(entry)) = schedule%entry_limit(entry)
            end associate
         end do
      end associate
      call sort_leaders(self, first + 1)
      self%behind = schedule%behind
   end subroutine settle_leaders

   !> Take contacts that broke by thermal activation in a schedule out of the order of breaking, but
   !> leaders that were listed: there are none here.
   subroutine settle_activated(self, schedule, number)
      class(contact_ageing_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule
      !> Their number, with those leaders
      integer, intent(out) :: number

      number = 0
   end subroutine settle_activated

   !> Break all contacts that are due.
   subroutine break_due(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks, margin
      integer :: contact

      breaks = self%breaks
      call self%break_activated(pose)
      if (self%direction * pose%displacement <= self%behind) then
         ! The bound may be that of a contact that has broken since.
         self%behind = self%max_behind()
         margin = 0.0_wp
         if (self%ageing%acts()) margin = near_behind * self%stretch
         if (self%direction * pose%displacement <= self%behind + margin) call self%reverse(pose)
      end if
      if (self%is_steady) then
         call break_steady(self, pose)
      else
         call break_leaders(self, pose)
         do while (self%queue%first_key <= self%direction * pose%displacement)
            call self%queue%pop(self%record, contact)
            if (self%is_falling(contact)) then
               call add_falling(self, contact)
               cycle
            end if
            call self%refresh(contact, pose%time)
            if (self%is_due(contact, pose)) then
               call self%record_lateness(contact, pose)
               call self%end_life(contact)
               call self%detach(contact, pose%displacement, pose%time)
            else
               call add_leader(self, contact)
            end if
         end do
         call break_falling(self, pose)
      end if
      if (self%breaks > breaks) self%track%generation = self%track%generation + 1
   end subroutine break_due

   !> Begin the life of a contact that has attached, and queue it.
   subroutine join(self, contact, pose)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      self%life(life_birth, contact) = pose%time
      self%life(life_limit, contact) = self%record(row_limit, contact)
      if (self%is_steady .and. self%touches) then
         ! Its limit is not that of a contact that attaches under the back force.
         self%next(next_speed, contact) = 0.0_wp
         self%kept(contact) = in_queue
         call self%solve(contact, pose%displacement, pose%time)
      else if (self%is_steady) then
         call queue_newborn(self, contact)
      else
         self%next(next_speed, contact) = 0.0_wp
         call self%solve(contact, pose%displacement, pose%time)
      end if
      call self%put(contact)
      self%behind = max(self%behind, self%behind_at(contact, pose%time))
      call self%begin_life(contact)
   end subroutine join

   subroutine leave(self, contact)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: position

      select case (self%kept(contact))
      case (in_leaders)
         call remove_leader(self, position_of(self%list(leaders), contact))
      case (in_falling)
         position = position_of(self%list(near), contact)
         if (position > 0) call remove(self%list(near), position)
         call remove(self%list(falling), position_of(self%list(falling), contact))
      case default
         call self%queue%remove(self%record, contact)
      end select
      self%kept(contact) = in_queue
      call self%end_life(contact)
   end subroutine leave

   !> Reverse the direction of motion for which the queue is kept.
   subroutine reverse(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      self%is_steady = .false.
      self%speed = huge(1.0_wp)
      self%direction = -self%direction
      if (self%list(falling)%count > 0) call scan(self, pose)
      call self%solve_all(pose)
      self%behind = self%max_behind()
   end subroutine reverse

   !> Shift the coordinates of the last scan, and the law that was offered.
   subroutine shift_ageing(self, shift)
      class(contact_ageing_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call self%prediction%shift(shift)
      if (self%scan_upper < huge(1.0_wp)) then
         self%scan_upper = self%scan_upper - self%direction * shift
         self%scan_lower = self%scan_lower - self%direction * shift
      end if
   end subroutine shift_ageing

   !> Write the state to an archive, or read it.
   subroutine exchange_ageing(self, archive)
      class(contact_ageing_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("contacts that age")
      call exchange_individual(self, archive)
      call archive%exchange("life", self%life)
      call archive%exchange("kept", self%kept)
      call archive%exchange("leaders", self%list(leaders)%contact)
      call archive%exchange("leaders_count", self%list(leaders)%count)
      call archive%exchange("falling", self%list(falling)%contact)
      call archive%exchange("falling_count", self%list(falling)%count)
      call archive%exchange("near", self%list(near)%contact)
      call archive%exchange("near_count", self%list(near)%count)
      call archive%exchange("scan_upper", self%scan_upper)
      call archive%exchange("scan_lower", self%scan_lower)
      call archive%exchange("scan_time", self%scan_time)
      call archive%exchange("now", self%now)
      call self%prediction%exchange(archive)
      call archive%exchange("is_unchanged", self%is_unchanged)
      call archive%exchange("is_steady", self%is_steady)
      call archive%exchange("motion", self%motion)
      call archive%exchange("speed", self%speed)
   end subroutine exchange_ageing

end module mesoslip_contacts_ageing_contacts
