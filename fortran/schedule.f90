!> The next breaks and attachments of a motion in one direction, in their order.
!>
!> Contacts write a schedule. It records the time and displacement of each event while a slider runs
!> through it; afterwards contacts update their records for many events at once. A schedule has the
!> change of the contact force in each event, so that sliders do not depend on contacts.
!>
!> It ends before any event that it does not foresee: results do not depend on its length.
!>
!> With clocks of thermally activated breaking a contact may be in two lists, by coordinate and by
!> the reading of a clock; after it broke as an entry of one list, that of the other is gone.
!>
!> Of thresholds that grow the coordinates are bounds. Before each step those of contacts that may
!> break in it are evaluated, and their breaks extrapolated from the motion of the slider.
module mesoslip_schedule
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_ageing_law, only: ageing_law_type
   use mesoslip_hazard, only: hazard_type
   use mesoslip_interface_law, only: clocks, interface_law_type, pose_type, window_type
   use mesoslip_motion_prediction, only: prediction_type
   use mesoslip_track_strength, only: track_strength_type
   implicit none
   private

   public :: schedule_type, max_events

   !> Maximum number of breaks, and of attachments, in a schedule
   integer, parameter :: max_events = 64

   !> Coming and past events.
   type :: schedule_type
      !> Listed breaks and attachments
      integer :: breaks = 0, attachments = 0
      !> Those that are past, and moments in which contacts broke
      integer :: broken = 0, attached = 0, moments = 0
      !> Whether it is at its end
      logical :: is_over = .true.
      !> Whether the only listed break is a bound, at which the contacts decide which of them break;
      !> whether the slider has reached it
      logical :: is_bounded = .false., at_bound = .false.

      !> Direction of motion, +1 or -1
      real(wp) :: direction = 1.0_wp
      !> Sums over pinned contacts (stiffness; stiffness times origin) and detached ones (drag)
      type(accumulator_type) :: stiffness, offset, drag
      !> Number of pinned and of detached contacts
      integer :: pinned = 0, detached = 0
      !> Maximum coordinate at which a contact breaks after a reversal [m]
      real(wp) :: behind = -huge(1.0_wp)
      !> Time after which a contact that breaks attaches; huge if it does not [s]
      real(wp) :: delay = 0.0_wp
      !> Time at which it ends, and maximum duration of a step [s]
      real(wp) :: end_time = 0.0_wp, max_step = 0.0_wp
      !> Mean stiffness of a contact [N/m]; the schedule ends where that times the displacement is
      !> max_force [N]
      real(wp) :: mean_stiffness = 0.0_wp, max_force = 0.0_wp

      !> For each break: coordinate along the direction [m], stiffness [N/m], origin [m], and drag
      !> of the detached contact [N s/m]
      real(wp) :: break_coordinate(max_events) = 0.0_wp, break_stiffness(max_events) = 0.0_wp, &
         & break_origin(max_events) = 0.0_wp, break_drag(max_events) = 0.0_wp
      !> Times [s] and displacements [m] of past breaks, in their order
      real(wp) :: break_time(2 * max_events) = 0.0_wp, &
         & break_displacement(2 * max_events) = 0.0_wp
      !> For each attachment: its time [s], followed by that of the first one beyond the schedule;
      !> stiffness [N/m], first stretch and stretch at breaking [m], and drag until then [N s/m]
      real(wp) :: attach_time(max_events + 1) = 0.0_wp, attach_stiffness(max_events) = 0.0_wp, &
         & attach_stretch(max_events) = 0.0_wp, attach_limit(max_events) = 0.0_wp, &
         & attach_drag(max_events) = 0.0_wp
      !> Displacements of past attachments [m]
      real(wp) :: attach_displacement(max_events) = 0.0_wp
      !> Listed sites that touch or separate as the normal load changes, and those that have. For
      !> each its time [s], followed by that of the first one beyond the list; whether it touches;
      !> stiffness [N/m], origin if it separates [m], and stretch at breaking if it touches [m];
      !> displacement [m] of past ones
      integer :: sites = 0, moved = 0
      real(wp) :: site_time(max_events + 1) = huge(1.0_wp)
      logical :: site_touches(max_events) = .false.
      real(wp) :: site_stiffness(max_events) = 0.0_wp, site_origin(max_events) = 0.0_wp, &
         & site_limit(max_events) = 0.0_wp, site_displacement(max_events) = 0.0_wp
      !> Strength along the track, which multiplies breaking stretches where contacts attach; not
      !> allocated where there is none
      class(track_strength_type), allocatable :: strength
      !> Whether it multiplies first stretches too
      logical :: scales_stretches = .false.
      !> Whether contacts that break may attach within the schedule; for each break the delay until
      !> then [s], the stiffness [N/m], the first stretch and that at breaking [m], and the deviate
      !> of the next life. Breaks by a clock are listed after the others.
      logical :: has_births = .false.
      real(wp) :: birth_delay(2 * max_events) = 0.0_wp, birth_stiffness(2 * max_events) = 0.0_wp, &
         & birth_stretch(2 * max_events) = 0.0_wp, birth_limit(2 * max_events) = 0.0_wp, &
         & birth_left(2 * max_events) = 0.0_wp

      !> Whether there are clocks; the clocks, and the number of that of the list
      logical :: has_clocks = .false.
      type(hazard_type) :: hazard
      integer :: number = 1
      !> Listed breaks by the clock, and those that are past or gone
      integer :: clock_breaks = 0, clock_broken = 0
      !> For each its reading [s], and origin [m]
      real(wp) :: clock_key(max_events) = 0.0_wp, clock_origin(max_events) = 0.0_wp
      !> Entry of the clock's list that ends the schedule without a break, or 0
      integer :: clock_stop = 0
      !> For each entry that of the same contact in the other list, or 0, and whether it is gone
      integer :: break_twin(max_events) = 0, clock_twin(max_events) = 0
      logical :: break_gone(max_events) = .false., clock_gone(max_events) = .false.
      !> For each entry by coordinate whether the contact does not break there, but its force gets
      !> the sign of the motion; its stretch at breaking [m], its remaining deviate, and its reading
      !> [s], by the other clock before that and by this one after it
      logical :: break_turns(max_events) = .false.
      real(wp) :: turn_limit(max_events) = 0.0_wp, turn_left(max_events) = 0.0_wp, &
         & turn_key(max_events) = 0.0_wp
      !> Past changes of sign; contacts of the other clock, and the entry of the first of them to
      !> break, 0 if it is not listed
      integer :: turned = 0, others = 0, other_first = 0
      !> All past breaks, and the entry of each, negative in the list of the clock
      integer :: came_count = 0, came(2 * max_events) = 0
      !> Whether contacts broke in the last step
      logical :: breaks_now = .false.
      !> For each attachment the deviate, and the reading at which the contact breaks [s]
      real(wp) :: attach_left(max_events) = 0.0_wp, attach_key(max_events) = 0.0_wp

      !> Whether thresholds grow; how, and the motion of the slider as predicted
      logical :: has_growth = .false.
      type(ageing_law_type) :: ageing
      type(prediction_type) :: prediction
      !> Distance to its threshold at which a contact breaks [m]; coordinate before which no contact
      !> breaks that is not listed, that before which none does in the next step [m], and the time
      !> at which this ends [s]; maximum distance by which one broke too late [m]
      real(wp) :: resolution = 0.0_wp, unlisted = huge(1.0_wp), meeting = huge(1.0_wp), &
         & window_time = huge(1.0_wp), lateness = 0.0_wp
      !> Number of breaks as written; for each break its entry then: the order changes as thresholds
      !> grow. For each entry whether its threshold is constant; its stretch at the coordinate, its
      !> configured breaking stretch and the mean one [m], and the time of its birth [s]
      integer :: written = 0, break_entry(max_events) = 0
      logical :: entry_is_constant(max_events) = .false.
      real(wp) :: entry_limit(max_events) = 0.0_wp, entry_configured(max_events) = 0.0_wp, &
         & entry_mean(max_events) = 0.0_wp, entry_birth(max_events) = 0.0_wp
   contains
      !> Contact force until the next event, and the window until then
      procedure, non_overridable :: law, window
      !> Find where the next step ends, if thresholds grow
      procedure, non_overridable :: look_ahead
      !> Number of contacts that broke
      procedure, non_overridable :: break_count
      !> Make the events that are due at a time and a displacement
      procedure, non_overridable :: pass
      procedure, non_overridable, private :: break_due, attach_due, fit_to_track, &
         & insert_attachment, cut_breaks
      !> Let sites touch or separate. By dispatch, because a copy of it in pass would keep that from
      !> being inlined into the loops of sliders.
      procedure, private :: follow_load
      procedure, non_overridable, private :: pass_clocks, break_by_clock, &
         & pass_coordinate, break_with_clocks, attach_with_clocks, &
         & change_sign, cut_lists, skip_gone, find_met, sort_breaks
   end type schedule_type

contains

   !> Contact force until the next event.
   pure function law(self)
      class(schedule_type), intent(in) :: self
      type(interface_law_type) :: law

      law%stiffness = self%stiffness%total()
      law%offset = self%offset%total()
      law%drag = self%drag%total()
   end function law

   !> Window until the next event, before the end of the schedule.
   pure function window(self, time)
      class(schedule_type), intent(in) :: self
      !> Time now [s]
      real(wp), intent(in) :: time
      type(window_type) :: window

      real(wp) :: ahead

      window%end_time = min(self%attach_time(self%attached + 1), &
         & self%site_time(self%moved + 1), self%end_time, time + self%max_step)
      ahead = self%break_coordinate(self%broken + 1)
      if (self%has_growth) then
         ahead = self%meeting
         window%end_time = min(window%end_time, self%window_time)
      end if
      if (self%direction > 0.0_wp) then
         window%upper = ahead
         window%lower = self%behind
      else
         window%upper = -self%behind
         window%lower = -ahead
      end if
      if (self%has_clocks) call self%hazard%limit_window(window)
   end function window

   !> Number of contacts that broke.
   pure function break_count(self) result(number)
      class(schedule_type), intent(in) :: self
      integer :: number

      number = merge(self%came_count, self%broken, self%has_clocks)
   end function break_count

   !> Make the events that are due: first contacts break, then contacts attach, then sites touch or
   !> separate.
   subroutine pass(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      !> Time [s] and displacement of the slider [m]
      real(wp), intent(in) :: time, displacement

      if (self%has_clocks) then
         call self%pass_clocks(time, displacement)
         return
      end if
      if (self%has_growth) call self%find_met(time, displacement)
      if (self%break_coordinate(self%broken + 1) <= self%direction * displacement) then
         if (self%is_bounded) then
            self%at_bound = .true.
            self%is_over = .true.
            return
         end if
         call self%break_due(time, displacement)
      end if
      if (self%attach_time(self%attached + 1) <= time) then
         if (allocated(self%strength)) call self%fit_to_track(time, displacement)
         call self%attach_due(time, displacement)
      end if
      if (self%site_time(self%moved + 1) <= time) call self%follow_load(time, displacement)
      self%is_over = self%broken == self%breaks .or. time >= self%end_time &
         & .or. self%attach_time(self%attached + 1) <= time &
         & .or. abs(displacement) * self%mean_stiffness >= self%max_force
   end subroutine pass

   !> Break all contacts that are due.
   subroutine break_due(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      integer :: event, broken, entry

      do event = self%broken + 1, self%breaks
         if (self%break_coordinate(event) > self%direction * displacement) exit
         self%break_time(event) = time
         self%break_displacement(event) = displacement
         call self%stiffness%add(-self%break_stiffness(event))
         call self%offset%add(-self%break_stiffness(event) * self%break_origin(event))
         if (self%break_drag(event) > 0.0_wp) call self%drag%add(self%break_drag(event))
      end do
      if (self%has_births) then
         do broken = self%broken + 1, event - 1
            entry = broken
            if (self%has_growth) entry = self%break_entry(broken)
            call self%insert_attachment(entry, time, self%break_drag(broken))
         end do
      else if (self%broken == 0) then
         ! With one delay for all, those that break now attach after all listed ones.
         self%attach_time(self%attachments + 1) = min(self%attach_time(self%attachments + 1), &
            & time + self%delay)
      end if
      self%moments = self%moments + 1
      self%pinned = self%pinned - (event - 1 - self%broken)
      self%detached = self%detached + (event - 1 - self%broken)
      self%broken = event - 1
      ! A sum over no contacts has no rounding errors.
      if (self%pinned == 0) then
         self%stiffness = accumulator_type()
         self%offset = accumulator_type()
      end if
   end subroutine break_due

   !> Insert the attachment of a contact that breaks now, unless it is after the end of the list.
   subroutine insert_attachment(self, event, time, drag)
      class(schedule_type), intent(inout) :: self
      !> Number of its break, or of its birth
      integer, intent(in) :: event
      !> Time [s], and drag of the contact until it attaches [N s/m]
      real(wp), intent(in) :: time, drag

      real(wp) :: due
      integer :: place

      due = time + self%birth_delay(event)
      if (due < self%attach_time(self%attachments + 1) .and. self%attachments == max_events) then
         ! The last one leaves a full list, and its time is the first beyond the list.
         if (self%attached == max_events) self%attach_time(max_events + 1) = due
         self%attachments = max(self%attached, max_events - 1)
      end if
      if (due >= self%attach_time(self%attachments + 1)) return
      if (self%has_clocks .and. self%direction * self%birth_stretch(event) < 0.0_wp) then
         ! The contact is one of the other clock, which ends the schedule.
         do while (self%attachments > self%attached)
            if (self%attach_time(self%attachments) <= due) exit
            self%attachments = self%attachments - 1
         end do
         self%attach_time(self%attachments + 1) = due
         return
      end if
      place = self%attachments + 1
      self%attach_time(place + 1) = self%attach_time(place)
      do while (place > self%attached + 1)
         if (self%attach_time(place - 1) <= due) exit
         self%attach_time(place) = self%attach_time(place - 1)
         self%attach_stiffness(place) = self%attach_stiffness(place - 1)
         self%attach_stretch(place) = self%attach_stretch(place - 1)
         self%attach_limit(place) = self%attach_limit(place - 1)
         self%attach_drag(place) = self%attach_drag(place - 1)
         if (self%has_clocks) self%attach_left(place) = self%attach_left(place - 1)
         place = place - 1
      end do
      self%attach_time(place) = due
      self%attach_stiffness(place) = self%birth_stiffness(event)
      self%attach_stretch(place) = self%birth_stretch(event)
      self%attach_limit(place) = self%birth_limit(event)
      self%attach_drag(place) = drag
      if (self%has_clocks) self%attach_left(place) = self%birth_left(event)
      self%attachments = self%attachments + 1
   end subroutine insert_attachment

   !> Set the stretches of all contacts that are due by the strength where they attach. The schedule
   !> ends before one that is too weak there to attach.
   subroutine fit_to_track(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      integer :: event

      do event = self%attached + 1, self%attachments
         if (self%attach_time(event) > time) return
         if (.not. self%strength%lets_attach(displacement, self%scales_stretches, &
            & self%attach_limit(event), self%attach_stretch(event))) exit
      end do
      self%attachments = min(self%attachments, event - 1)
   end subroutine fit_to_track

   !> Attach all contacts that are due. One that would break before listed ones ends the list there.
   subroutine attach_due(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      real(wp) :: origin
      integer :: event

      do event = self%attached + 1, self%attachments
         if (self%attach_time(event) > time) exit
         self%attach_displacement(event) = displacement
         origin = displacement - self%attach_stretch(event)
         call self%drag%add(-self%attach_drag(event))
         self%pinned = self%pinned + 1
         self%detached = self%detached - 1
         if (self%detached == 0) self%drag = accumulator_type()
         call self%stiffness%add(self%attach_stiffness(event))
         call self%offset%add(self%attach_stiffness(event) * origin)
         call self%cut_breaks(origin, self%attach_limit(event))
      end do
      self%attached = event - 1
   end subroutine attach_due

   !> Let all sites touch or separate that are due. The contact of one that touches bears no force.
   subroutine follow_load(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      integer :: event

      ! Contacts that are not listed, and are due, attach before.
      if (self%attach_time(self%attached + 1) <= time) return
      do event = self%moved + 1, self%sites
         if (self%site_time(event) > time) exit
         self%site_displacement(event) = displacement
         associate (stiffness => self%site_stiffness(event))
            if (self%site_touches(event)) then
               self%pinned = self%pinned + 1
               call self%stiffness%add(stiffness)
               call self%offset%add(stiffness * displacement)
               call self%cut_breaks(displacement, self%site_limit(event))
            else
               self%pinned = self%pinned - 1
               call self%stiffness%add(-stiffness)
               call self%offset%add(-stiffness * self%site_origin(event))
               if (self%pinned == 0) then
                  self%stiffness = accumulator_type()
                  self%offset = accumulator_type()
               end if
            end if
         end associate
      end do
      self%moved = event - 1
   end subroutine follow_load

   !> End the list of breaks before a contact that is not in it.
   subroutine cut_breaks(self, origin, limit)
      class(schedule_type), intent(inout) :: self
      !> Origin of the contact, and its stretch at breaking [m]
      real(wp), intent(in) :: origin, limit

      real(wp) :: ahead

      self%behind = max(self%behind, self%direction * origin - limit)
      ahead = self%direction * origin + limit
      if (self%has_growth) then
         self%unlisted = min(self%unlisted, ahead)
         return
      end if
      do while (self%breaks > self%broken)
         if (self%break_coordinate(self%breaks) < ahead) exit
         self%breaks = self%breaks - 1
      end do
   end subroutine cut_breaks

   !> Find where the next step ends, if thresholds grow: at the first break by extrapolation of
   !> those that may come in it. The schedule is over where a contact that is not listed may break.
   subroutine look_ahead(self, pose)
      class(schedule_type), intent(inout) :: self
      !> Complete pose of the slider
      type(pose_type), intent(in) :: pose

      real(wp) :: reach, coordinate
      integer :: event

      if (.not. self%has_growth) return
      call self%prediction%predict(pose, self%law())
      self%window_time = min(self%attach_time(self%attached + 1), self%site_time(self%moved + 1))
      call self%prediction%limit_time(pose, self%window_time)
      reach = self%prediction%reach(pose, self%direction, self%window_time)
      self%meeting = huge(1.0_wp)
      do event = self%broken + 1, self%breaks
         if (.not. self%break_coordinate(event) < min(self%meeting, reach)) exit
         coordinate = self%break_coordinate(event)
         associate (entry => self%break_entry(event), &
            & origin => self%direction * self%break_origin(event))
            if (.not. self%entry_is_constant(entry)) then
               call self%prediction%meet(self%ageing, self%entry_configured(entry), &
                  & self%entry_mean(entry), pose%time - self%entry_birth(entry), origin, pose, &
                  & self%direction, self%resolution, self%entry_limit(entry), coordinate)
               self%break_coordinate(event) = origin + self%entry_limit(entry)
            end if
         end associate
         self%meeting = min(self%meeting, coordinate)
      end do
      self%is_over = self%unlisted < min(self%meeting, reach)
      self%meeting = min(self%meeting, self%unlisted)
      if (event <= self%breaks) self%meeting = min(self%meeting, self%break_coordinate(event))
      call self%sort_breaks(event - 1)
   end subroutine look_ahead

   !> Evaluate the thresholds that a slider at a displacement [m] may have met at a time [s]. Those
   !> that it has get its coordinate, so that they are due.
   subroutine find_met(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      real(wp) :: here, gap
      integer :: event

      call self%prediction%complete()
      here = self%direction * displacement
      do event = self%broken + 1, self%breaks
         if (.not. self%break_coordinate(event) < here + 2.0_wp * self%resolution) exit
         associate (entry => self%break_entry(event))
            if (self%entry_is_constant(entry)) cycle
            self%entry_limit(entry) = self%ageing%threshold(self%entry_configured(entry), &
               & self%entry_mean(entry), time - self%entry_birth(entry))
            self%break_coordinate(event) = self%direction * self%break_origin(event) &
               & + self%entry_limit(entry)
         end associate
      end do
      call self%sort_breaks(event - 1)
      do event = self%broken + 1, self%breaks
         gap = self%break_coordinate(event) - here
         if (self%entry_is_constant(self%break_entry(event))) then
            if (gap > 0.0_wp) exit
         else
            if (gap > self%resolution) exit
            self%lateness = max(self%lateness, -gap)
         end if
         self%break_coordinate(event) = here
      end do
   end subroutine find_met

   !> Sort the breaks again whose coordinates have grown, up to the last of them.
   subroutine sort_breaks(self, last)
      class(schedule_type), intent(inout) :: self
      integer, intent(in) :: last

      real(wp) :: coordinate, origin
      integer :: event, place, entry

      do event = min(last, self%breaks - 1), self%broken + 1, -1
         coordinate = self%break_coordinate(event)
         if (coordinate <= self%break_coordinate(event + 1)) cycle
         origin = self%break_origin(event)
         entry = self%break_entry(event)
         do place = event, self%breaks - 1
            if (coordinate <= self%break_coordinate(place + 1)) exit
            self%break_coordinate(place) = self%break_coordinate(place + 1)
            self%break_origin(place) = self%break_origin(place + 1)
            self%break_entry(place) = self%break_entry(place + 1)
         end do
         self%break_coordinate(place) = coordinate
         self%break_origin(place) = origin
         self%break_entry(place) = entry
      end do
   end subroutine sort_breaks

   !> The same as pass with clocks: contacts break by their clock, then by coordinate, then others
   !> attach. At the end of the schedule further events that are due are left to the contacts.
   subroutine pass_clocks(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      logical :: far(clocks)
      integer :: earlier, other

      earlier = self%came_count
      other = clocks + 1 - self%number
      if (self%clock_key(self%clock_broken + 1) <= self%hazard%reading(self%number)) then
         call self%break_by_clock(time, displacement)
      end if
      if (self%broken < self%breaks) then
         if (self%break_coordinate(self%broken + 1) <= self%direction * displacement) then
            call self%pass_coordinate(time, displacement)
         end if
      end if
      self%breaks_now = self%came_count > earlier
      if (self%breaks_now) self%moments = self%moments + 1

      call self%hazard%is_far(self%number, displacement, far(self%number))
      far(other) = .false.
      if (self%hazard%is_used(other)) then
         call self%hazard%is_far(other, displacement, far(other))
         far(other) = far(other) .or. self%hazard%reading(other) >= self%hazard%next(other)
      end if
      self%is_over = self%is_over .or. any(far) .or. time >= self%end_time &
         & .or. abs(displacement) * self%mean_stiffness >= self%max_force &
         & .or. self%broken == self%breaks .or. self%clock_broken == self%clock_breaks &
         & .or. self%pinned == self%others
      if (self%is_over) return
      if (self%attach_time(self%attached + 1) <= time) then
         if (allocated(self%strength)) call self%fit_to_track(time, displacement)
         call self%attach_with_clocks(time, displacement)
         self%is_over = self%broken == self%breaks .or. self%clock_broken == self%clock_breaks &
            & .or. self%attach_time(self%attached + 1) <= time
         if (self%is_over) return
      end if
      self%hazard%next(self%number) = self%clock_key(self%clock_broken + 1)
   end subroutine pass_clocks

   !> Break the contacts whose keys the clock has reached.
   subroutine break_by_clock(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      do while (self%clock_broken < self%clock_breaks)
         associate (event => self%clock_broken + 1)
            if (event == self%clock_stop &
               & .or. self%clock_key(event) > self%hazard%reading(self%number)) exit
            call self%break_with_clocks(time, displacement, -event, self%clock_origin(event))
            if (self%clock_twin(event) > 0) self%break_gone(self%clock_twin(event)) = .true.
         end associate
         self%clock_broken = self%clock_broken + 1
      end do
      call self%skip_gone()
   end subroutine break_by_clock

   !> Break the contacts that have reached their thresholds, and move those to the other clock that
   !> have reached where they turn.
   subroutine pass_coordinate(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      integer :: other

      other = clocks + 1 - self%number
      do while (self%broken < self%breaks)
         associate (event => self%broken + 1)
            if (self%break_coordinate(event) > self%direction * displacement) exit
            if (self%break_turns(event)) then
               ! Contacts of the other clock break first.
               if (self%hazard%reading(other) >= self%hazard%next(other)) then
                  self%is_over = .true.
                  exit
               end if
               call self%change_sign(event)
            else
               call self%break_with_clocks(time, displacement, event, self%break_origin(event))
               if (self%break_twin(event) > 0) self%clock_gone(self%break_twin(event)) = .true.
            end if
         end associate
         self%broken = self%broken + 1
         call self%skip_gone()
      end do
   end subroutine pass_coordinate

   !> Break a contact.
   subroutine break_with_clocks(self, time, displacement, entry, origin)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement
      !> Entry of its list, negative in that of the clock
      integer, intent(in) :: entry
      !> Its origin [m]
      real(wp), intent(in) :: origin

      self%came_count = self%came_count + 1
      self%came(self%came_count) = entry
      self%break_time(self%came_count) = time
      self%break_displacement(self%came_count) = displacement
      call self%stiffness%add(-self%break_stiffness(1))
      call self%offset%add(-self%break_stiffness(1) * origin)
      if (self%break_drag(1) > 0.0_wp) call self%drag%add(self%break_drag(1))
      if (self%has_births) then
         call self%insert_attachment(merge(entry, max_events - entry, entry > 0), time, &
            & self%break_drag(1))
      else if (self%came_count == 1) then
         ! With one delay for all, those that break now attach after all listed ones.
         self%attach_time(self%attachments + 1) = min(self%attach_time(self%attachments + 1), &
            & time + self%delay)
      end if
      self%pinned = self%pinned - 1
      self%detached = self%detached + 1
      if (self%pinned == 0) then
         self%stiffness = accumulator_type()
         self%offset = accumulator_type()
      end if
   end subroutine break_with_clocks

   !> Skip contacts that have broken as entries of the other list.
   pure subroutine skip_gone(self)
      class(schedule_type), intent(inout) :: self

      do while (self%broken < self%breaks)
         if (.not. self%break_gone(self%broken + 1)) exit
         self%broken = self%broken + 1
      end do
      do while (self%clock_broken < self%clock_breaks)
         if (.not. self%clock_gone(self%clock_broken + 1)) exit
         self%clock_broken = self%clock_broken + 1
      end do
   end subroutine skip_gone

   !> The same as attach_due with clocks.
   subroutine attach_with_clocks(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      real(wp) :: origin
      integer :: event

      do event = self%attached + 1, self%attachments
         if (self%attach_time(event) > time) exit
         self%attach_displacement(event) = displacement
         origin = displacement - self%attach_stretch(event)
         call self%drag%add(-self%attach_drag(event))
         self%pinned = self%pinned + 1
         self%detached = self%detached - 1
         if (self%detached == 0) self%drag = accumulator_type()
         call self%stiffness%add(self%attach_stiffness(event))
         call self%offset%add(self%attach_stiffness(event) * origin)
         self%attach_key(event) = self%hazard%key(self%number, self%attach_left(event), &
            & self%attach_limit(event), origin)
         call self%cut_lists(origin, self%attach_limit(event), self%attach_key(event))
      end do
      self%attached = event - 1
   end subroutine attach_with_clocks

   !> Move a contact to the other clock, as its force gets the sign of the motion.
   subroutine change_sign(self, event)
      class(schedule_type), intent(inout) :: self
      !> Entry of the list by coordinate
      integer, intent(in) :: event

      associate (origin => self%break_origin(event), limit => self%turn_limit(event), &
         & left => self%turn_left(event), key => self%turn_key(event))
         left = self%hazard%left(clocks + 1 - self%number, key, left, limit, origin)
         key = self%hazard%key(self%number, left, limit, origin)
         self%turned = self%turned + 1
         self%others = self%others - 1
         ! Then the next contact of the other clock is not known.
         if (event == self%other_first .or. self%others == 0) self%is_over = .true.
         ! Its own entry must stay.
         self%broken = event
         call self%cut_lists(origin, limit, key)
         self%broken = event - 1
      end associate
   end subroutine change_sign

   !> End the lists before a contact that is not in them.
   subroutine cut_lists(self, origin, limit, key)
      class(schedule_type), intent(inout) :: self
      !> Origin of the contact, its stretch at breaking [m], and the reading at which it breaks [s]
      real(wp), intent(in) :: origin, limit, key

      real(wp) :: ahead

      self%behind = max(self%behind, self%direction * origin - self%hazard%turn_stretch(limit))
      ahead = self%direction * origin + limit
      do while (self%breaks > self%broken)
         if (self%break_coordinate(self%breaks) < ahead) exit
         self%breaks = self%breaks - 1
      end do
      do while (self%clock_breaks > self%clock_broken)
         if (self%clock_key(self%clock_breaks) < key) exit
         self%clock_breaks = self%clock_breaks - 1
      end do
   end subroutine cut_lists

end module mesoslip_schedule
