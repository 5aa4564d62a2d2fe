!> Contacts that break by thermal activation, whose thresholds change with their age.
!>
!> Breaks at thresholds are those of contacts that age. Breaks before are drawn by thinning
!> (mesoslip_contacts_thermal_candidates): by a lower bound on its threshold the rate of a contact
!> is too high, and a candidate is accepted with the ratio of its rate to that. The bound of a
!> growing threshold is its value at birth, or when a candidate was refused for its growth; that of
!> a falling one is its value when it is old, then that at the end of a short time, after which
!> candidates are drawn again.
module mesoslip_contacts_thermal_ageing
   use mesoslip_contacts_ageing_base, only: life_birth, life_limit, next_configured, rebuild_ageing
   use mesoslip_contacts_ageing_contacts, only: contact_ageing_type, exchange_ageing, &
      & initialize_ageing, offer_ageing, plan_ageing, respond_ageing, set_up_ageing, &
      & settle_ageing, shift_ageing
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_record, only: row_origin, row_renewal, row_stiffness
   use mesoslip_contacts_thermal_candidates, only: by_newborn, candidate_type, &
      & candidates_type, new_candidates, take_activation
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: thermal_ageing_contacts_type, make_thermal_ageing_contacts

   !> Fall of a threshold over f_T until its bound is renewed
   real(wp), parameter :: max_drop = 0.5_wp
   !> Maximum number of candidates in a schedule
   integer, parameter :: max_candidates = 16

   !> Thermally activated contacts that age.
   type, extends(contact_ageing_type) :: thermal_ageing_contacts_type
      type(candidates_type), private :: candidates
      !> Whether candidates must be drawn, as a contact that has attached exceeds its bound, or none
      !> have been; time after which they must be, as thresholds fall [s]
      logical, private :: is_late = .true.
      real(wp), private :: fall_time = huge(1.0_wp)
      !> Contacts that were refused since the last draw, and those whose thresholds fall
      integer, private :: refused_count = 0
      integer, allocatable, private :: refused(:)
      !> Entry of each contact in the schedule; 0 except while it is written
      integer, allocatable, private :: entry(:)
   contains
      procedure :: initialize, offer, respond, plan, settle, begin_life, end_life, &
         & break_activated, settle_activated, list_bounds, rebuild, shift_order, exchange
      procedure, non_overridable, private :: update_candidates, drop_candidates, is_in_vain, &
         & renew_bounds, refuse, bound_of, is_accepted, list_candidates
   end type thermal_ageing_contacts_type

contains

   !> Set up contacts from named numbers.
   subroutine make_thermal_ageing_contacts(contacts, common, parameters, error)
      class(contacts_type), allocatable, intent(out) :: contacts
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: the law of ageing, whether the slider jumps, columns and rows, rate and
      !> force of activation
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(thermal_ageing_contacts_type), allocatable :: self
      real(wp) :: rate, slope
      integer :: columns, rows, stat

      call parameters%take("columns", columns, error)
      call parameters%take("rows", rows, error)
      call take_activation(parameters, common, rate, slope, error)
      if (allocated(error)) return
      allocate (self)
      call set_up_ageing(self, common, columns, rows, parameters, error)
      call parameters%finish(error)
      if (allocated(error)) return
      ! Candidates are listed by the slider's motion, and sites of a load are not.
      self%lists_sites = .false.
      call new_candidates(self%candidates, common%count, rate, slope, &
         & common%seed, common%realization, error)
      if (allocated(error)) return
      allocate (self%candidates%limit(common%count), source=0.0_wp, stat=stat)
      if (stat == 0) allocate (self%refused(common%count), source=0, stat=stat)
      if (stat == 0) allocate (self%entry(common%count), source=0, stat=stat)
      if (stat /= 0) call raise(error, status_memory, "not enough memory for lists of contacts")
      call move_alloc(self, contacts)
   end subroutine make_thermal_ageing_contacts

   subroutine initialize(self, state)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: state

      integer :: contact

      call initialize_ageing(self, state)
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         call self%begin_life(contact)
         if (self%ageing%falls(self%life(life_limit, contact), self%mean_of(contact))) cycle
         ! An old contact may bear more than a newborn one could.
         call self%candidates%insert(contact, self%record(row_origin, contact), &
            & self%threshold(contact, 0.0_wp))
      end do
   end subroutine initialize

   !> The law holds until a contact breaks or attaches, or a candidate is tried.
   subroutine offer(self, pose, law, window)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      if (self%is_late) call self%update_candidates(pose)
      call offer_ageing(self, pose, law, window)
      window%end_time = min(window%end_time, self%candidates%next_time(), self%fall_time)
      window%may_turn = .true.
      window%upper = min(window%upper, self%candidates%upper)
      window%lower = max(window%lower, self%candidates%lower)
      if (self%are_broken()) window%end_time = huge(1.0_wp)
   end subroutine offer

   subroutine respond(self, before, after)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      call respond_ageing(self, before, after)
      call self%update_candidates(after)
   end subroutine respond

   subroutine settle(self, schedule, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(schedule_type), intent(inout) :: schedule
      type(pose_type), intent(in) :: pose

      call settle_ageing(self, schedule, pose)
      ! Otherwise candidates that are due have not been tried.
      if (schedule%is_over) call self%update_candidates(pose)
   end subroutine settle

   !> Draw candidates if it is due.
   subroutine update_candidates(self, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      if (.not. (self%is_late .or. pose%time >= self%fall_time &
         & .or. self%candidates%is_over(pose%displacement))) return
      call self%renew_bounds(pose%time)
      call self%candidates%draw(pose%time, pose%displacement, pose%velocity, self%record)
      call self%drop_candidates(pose%time)
      self%is_late = .false.
   end subroutine update_candidates

   !> Drop candidates that would be refused anywhere in the window, as their thresholds have grown.
   !> The last one ends the list, and must stay.
   subroutine drop_candidates(self, time)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: time

      integer :: event, kept

      kept = 0
      do event = 1, self%candidates%drawn
         associate (candidate => self%candidates%candidate(event))
            if (event < self%candidates%drawn) then
               if (self%is_in_vain(candidate, time)) then
                  call self%refuse(candidate%contact)
                  cycle
               end if
            end if
            kept = kept + 1
            self%candidates%candidate(kept) = candidate
         end associate
      end do
      self%candidates%drawn = kept
   end subroutine drop_candidates

   !> Whether a candidate would be refused where the window ends, with its threshold now.
   pure function is_in_vain(self, candidate, time)
      class(thermal_ageing_contacts_type), intent(in) :: self
      type(candidate_type), intent(in) :: candidate
      real(wp), intent(in) :: time
      logical :: is_in_vain

      real(wp) :: side, edge

      is_in_vain = .false.
      associate (contact => candidate%contact)
         if (candidate%purpose == by_newborn .or. self%ageing%falls( &
            & self%life(life_limit, contact), self%mean_of(contact))) return
         side = candidate%side()
         edge = merge(self%candidates%upper, self%candidates%lower, side > 0.0_wp)
         is_in_vain = side * (edge - candidate%bound) < self%threshold(contact, time) &
            & - self%candidates%limit(contact)
      end associate
   end function is_in_vain

   !> Renew the bounds of the contacts that were refused, and of those whose thresholds fall.
   subroutine renew_bounds(self, time)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: time

      real(wp) :: fastest, threshold, rate
      integer :: number, place, contact

      number = 0
      fastest = 0.0_wp
      do place = 1, self%refused_count
         contact = self%refused(place)
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         call self%ageing%evaluate(self%life(life_limit, contact), self%mean_of(contact), &
            & time - self%life(life_birth, contact), threshold, rate)
         if (rate < 0.0_wp) then
            number = number + 1
            self%refused(number) = contact
            fastest = max(fastest, -rate)
         else
            call self%candidates%insert(contact, self%record(row_origin, contact), threshold)
         end if
      end do
      self%refused_count = number
      self%fall_time = huge(1.0_wp)
      if (number == 0) return
      self%fall_time = max(time + max_drop / (self%candidates%slope * fastest), &
         & nearest(time, huge(1.0_wp)))
      do place = 1, number
         contact = self%refused(place)
         call self%candidates%insert(contact, self%record(row_origin, contact), &
            & self%threshold(contact, self%fall_time))
      end do
   end subroutine renew_bounds

   !> Have the bound of a contact renewed at the next draw.
   subroutine refuse(self, contact)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: place

      do place = 1, self%refused_count
         if (self%refused(place) == contact) return
      end do
      self%refused_count = self%refused_count + 1
      self%refused(self%refused_count) = contact
   end subroutine refuse

   !> Lower bound on the threshold of a contact at any age [m].
   pure function bound_of(self, configured, mean) result(bound)
      class(thermal_ageing_contacts_type), intent(in) :: self
      !> Configured breaking stretch, and the mean one [m]
      real(wp), intent(in) :: configured, mean
      real(wp) :: bound

      bound = self%ageing%newborn_threshold(configured, mean)
   end function bound_of

   subroutine begin_life(self, contact)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      real(wp) :: bound

      bound = self%bound_of(self%life(life_limit, contact), self%mean_of(contact))
      associate (origin => self%record(row_origin, contact))
         call self%candidates%insert(contact, origin, bound)
         self%is_late = self%is_late .or. self%candidates%exceeds_bound(origin, bound)
      end associate
   end subroutine begin_life

   subroutine end_life(self, contact)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%candidates%remove(contact)
   end subroutine end_life

   !> Break the contacts of the candidates that are due and accepted.
   subroutine break_activated(self, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do while (self%candidates%next_time() <= pose%time)
         associate (candidate => self%candidates%candidate(self%candidates%next))
            self%candidates%next = self%candidates%next + 1
            if (.not. self%is_accepted(candidate, pose)) cycle
            contact = candidate%contact
         end associate
         call self%leave(contact)
         call self%detach(contact, pose%displacement, pose%time)
      end do
   end subroutine break_activated

   !> Whether a candidate breaks. The same rule as that of a schedule.
   function is_accepted(self, candidate, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(candidate_type), intent(in) :: candidate
      type(pose_type), intent(in) :: pose
      logical :: is_accepted

      associate (contact => candidate%contact)
         is_accepted = self%candidates%accepts(candidate, pose%displacement, &
            & self%record(:, contact), self%candidates%limit(contact))
         if (.not. is_accepted) return
         is_accepted = self%candidates%accepts(candidate, pose%displacement, &
            & self%record(:, contact), self%threshold(contact, pose%time))
         if (.not. is_accepted) call self%refuse(contact)
      end associate
   end function is_accepted

   subroutine plan(self, pose, limit, schedule)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      if (self%is_late) call self%update_candidates(pose)
      call plan_ageing(self, pose, min(limit, max_events - max_candidates), schedule)
      if (.not. schedule%is_over) call self%list_candidates(pose, limit, schedule)
   end subroutine plan

   !> List the next candidates in a schedule of breaks at thresholds.
   subroutine list_candidates(self, pose, limit, schedule)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Maximum number
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      type(candidate_type) :: candidate
      integer :: number, entries, event

      schedule%has_candidates = .true.
      schedule%has_entries = .true.
      schedule%has_newborn = .false.
      schedule%upper = self%candidates%upper
      schedule%lower = self%candidates%lower
      schedule%newborn_upper = self%candidates%newborn_upper
      schedule%newborn_lower = self%candidates%newborn_lower
      schedule%ageing = self%ageing
      schedule%tried = 0
      do event = 1, schedule%breaks
         self%entry(self%listed(event)) = event
      end do
      entries = schedule%breaks
      do number = 1, min(limit, max_candidates, self%candidates%drawn - self%candidates%next + 1)
         candidate = self%candidates%candidate(self%candidates%next + number - 1)
         ! Contacts that attach in the schedule are not known in it.
         if (candidate%purpose == by_newborn .or. candidate%time >= self%fall_time) exit
         associate (contact => candidate%contact, entry => schedule%candidate_entry(number))
            schedule%candidate_time(number) = candidate%time
            schedule%candidate_side(number) = candidate%side()
            schedule%candidate_start(number) = candidate%bound
            entry = 0
            if (.not. self%record(row_stiffness, contact) > 0.0_wp &
               & .or. abs(self%record(row_renewal, contact) - candidate%life) > 0.0_wp) cycle
            if (self%entry(contact) == 0) then
               entries = entries + 1
               self%listed(entries) = contact
               self%entry(contact) = entries
            end if
            entry = self%entry(contact)
            schedule%entry_origin(entry) = self%record(row_origin, contact)
            schedule%entry_bound(entry) = self%candidates%limit(contact)
            schedule%entry_configured(entry) = self%life(life_limit, contact)
            schedule%entry_mean(entry) = self%mean_of(contact)
            schedule%entry_birth(entry) = self%life(life_birth, contact)
         end associate
      end do
      schedule%candidates = number - 1
      schedule%candidate_time(number) = self%fall_time
      if (self%candidates%next + number - 1 <= self%candidates%drawn) then
         candidate = self%candidates%candidate(self%candidates%next + number - 1)
         schedule%candidate_time(number) = min(candidate%time, self%fall_time)
      end if
      schedule%is_gone(:entries) = .false.
      self%entry(self%listed(:entries)) = 0
      associate (first => schedule%breaks + 1)
         if (.not. schedule%has_births .or. entries < first) return
         call self%list_births(self%listed(first:entries), schedule%breaks, pose%direction, &
            & schedule)
         call self%list_limits(self%listed(first:entries), schedule%birth_limit(first:), &
            & schedule%birth_bound(first:))
      end associate
   end subroutine list_candidates

   subroutine list_bounds(self, contact, bound)
      class(thermal_ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact(:)
      real(wp), intent(inout) :: bound(:)

      integer :: event

      do event = 1, size(contact)
         bound(event) = self%bound_of(self%next(next_configured, contact(event)), self%stretch)
      end do
   end subroutine list_bounds

   subroutine settle_activated(self, schedule, number)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule
      integer, intent(out) :: number

      integer :: event

      self%candidates%next = self%candidates%next + schedule%tried
      number = 0
      do event = 1, schedule%tried
         associate (entry => schedule%candidate_entry(event))
            if (entry == 0) cycle
            if (schedule%candidate_refused(event)) call self%refuse(self%listed(entry))
            if (.not. schedule%candidate_breaks(event)) cycle
            number = number + 1
            if (.not. schedule%has_growth .or. entry > schedule%written) then
               call self%leave(self%listed(entry))
            end if
         end associate
      end do
      do event = 1, schedule%broken
         call self%end_life(self%listed(schedule%break_entry(event)))
      end do
   end subroutine settle_activated

   subroutine rebuild(self, displacement)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      call rebuild_ageing(self, displacement)
      call self%candidates%fill(self%record)
   end subroutine rebuild

   subroutine shift_order(self, shift)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call shift_ageing(self, shift)
      call self%candidates%shift_origin(shift)
   end subroutine shift_order

   subroutine exchange(self, archive)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call exchange_ageing(self, archive)
      call archive%section("candidates of contacts that age")
      call archive%exchange("bound", self%candidates%limit)
      call archive%exchange("refused", self%refused)
      call archive%exchange("refused_count", self%refused_count)
      call archive%exchange("is_late", self%is_late)
      call archive%exchange("fall_time", self%fall_time)
      call self%candidates%exchange(archive)
   end subroutine exchange

end module mesoslip_contacts_thermal_ageing
