!> The next breaks and attachments of a motion in one direction, in their order.
!>
!> Contacts write a schedule. It records the time and displacement of each event while a slider runs
!> through it; afterwards contacts update their records for many events at once. A schedule has the
!> change of the contact force in each event, so that sliders do not depend on contacts.
!>
!> It ends before any event that it does not foresee: results do not depend on its length.
!>
!> Of thresholds that grow the coordinates are bounds. Before each step those of contacts that may
!> break in it are evaluated, and their breaks extrapolated from the motion of the slider.
!>
!> With thermal activation candidates for breaking have times that are known before.
module mesoslip_schedule
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_ageing_law, only: ageing_law_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
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

      !> For each break: coordinate along the direction [m], with candidates followed by that of the
      !> first one beyond the list; stiffness [N/m], origin [m], and drag of the detached contact
      !> [N s/m]
      real(wp) :: break_coordinate(max_events + 1) = 0.0_wp, break_stiffness(max_events) = 0.0_wp, &
         & break_origin(2 * max_events) = 0.0_wp, break_drag(max_events) = 0.0_wp
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
      !> then [s], the stiffness [N/m], the first stretch and that at breaking [m]. Those of
      !> candidates are listed after the others.
      logical :: has_births = .false.
      real(wp) :: birth_delay(2 * max_events) = 0.0_wp, birth_stiffness(2 * max_events) = 0.0_wp, &
         & birth_stretch(2 * max_events) = 0.0_wp, birth_limit(2 * max_events) = 0.0_wp

      !> All past breaks, and the entry of each
      integer :: came_count = 0, came(2 * max_events) = 0
      !> Whether contacts broke in the last step
      logical :: breaks_now = .false.
      !> Whether contacts break by thermal activation; listed candidates of their breaks, and those
      !> that are past
      logical :: has_candidates = .false.
      integer :: candidates = 0, tried = 0
      !> For each its time [s], followed by that of the first one beyond the list; displacements
      !> from which on, and down to which, it is accepted [m]; and the entry of its contact among
      !> the breaks, which continue with those of candidates, 0 if the contacts decide
      real(wp) :: candidate_time(max_events + 1) = huge(1.0_wp), &
         & candidate_upper(max_events) = 0.0_wp, candidate_lower(max_events) = 0.0_wp
      integer :: candidate_entry(max_events) = 0
      !> For each break, and for the first one beyond the list, whether the contact has broken
      logical :: is_gone(2 * max_events) = .false.
      !> Displacements at which it ends, and between which the contacts that attach end it [m]
      real(wp) :: upper = huge(1.0_wp), lower = -huge(1.0_wp), newborn_upper = huge(1.0_wp), &
         & newborn_lower = -huge(1.0_wp)

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

      !> Whether contacts with changing thresholds break by candidates, too. For each candidate the
      !> direction of its force, and the displacement from which on in that direction it is accepted
      !> if the threshold is its bound [m]; of those that are past whether the contact broke, or was
      !> refused for the growth of its threshold alone. The entry is 0 if the contact is gone
      logical :: has_entries = .false.
      real(wp) :: candidate_side(max_events) = 0.0_wp, candidate_start(max_events) = 0.0_wp
      logical :: candidate_breaks(max_events) = .false., candidate_refused(max_events) = .false.
      !> For each entry its origin, and the bound on its threshold as a stretch [m]
      real(wp) :: entry_origin(max_events) = 0.0_wp, entry_bound(max_events) = 0.0_wp
      !> Whether a contact has attached that ends it. For each attachment and birth a bound on the
      !> threshold, as a stretch [m]
      logical :: has_newborn = .false.
      real(wp) :: attach_bound(max_events) = 0.0_wp, birth_bound(max_events) = 0.0_wp
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
      !> Break the contacts of candidates. By dispatch, as below.
      procedure, private :: try_candidates
      !> Let sites touch or separate. By dispatch, because a copy of it in pass would keep that from
      !> being inlined into the loops of sliders.
      procedure, private :: follow_load
      !> The same as pass with candidates
      procedure, private :: pass_candidates
      procedure, non_overridable, private :: find_met, sort_breaks, break_candidate
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
      if (self%has_candidates) then
         window%end_time = min(window%end_time, self%candidate_time(self%tried + 1))
         window%may_turn = .true.
         window%upper = min(window%upper, self%upper)
         window%lower = max(window%lower, self%lower)
      end if
   end function window

   !> Number of contacts that broke.
   pure function break_count(self) result(number)
      class(schedule_type), intent(in) :: self
      integer :: number

      number = merge(self%came_count, self%broken, &
         & self%has_candidates .and. .not. self%has_entries)
   end function break_count

   !> Make the events that are due: first contacts break, then contacts attach, then sites touch or
   !> separate.
   subroutine pass(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      !> Time [s] and displacement of the slider [m]
      real(wp), intent(in) :: time, displacement

      if (self%has_candidates .and. .not. self%has_entries) then
         call self%pass_candidates(time, displacement)
         return
      end if
      if (self%has_growth) call self%find_met(time, displacement)
      if (self%has_entries) call self%try_candidates(time, displacement)
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
      if (self%has_entries) self%is_over = self%is_over .or. self%has_newborn &
         & .or. self%tried == self%candidates .and. self%candidates > 0 &
         & .or. self%candidate_time(self%tried + 1) <= time &
         & .or. displacement >= self%upper .or. displacement <= self%lower
   end subroutine pass

   !> Try the candidates that are due. Those that break become the first breaks of the list.
   subroutine try_candidates(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      real(wp) :: excess, growth
      integer :: candidate

      self%breaks_now = .false.
      do candidate = self%tried + 1, self%candidates
         if (self%candidate_time(candidate) > time) exit
         self%candidate_breaks(candidate) = .false.
         self%candidate_refused(candidate) = .false.
         associate (entry => self%candidate_entry(candidate), &
            & side => self%candidate_side(candidate))
            if (entry == 0) cycle
            excess = side * (displacement - self%candidate_start(candidate))
            if (self%is_gone(entry) .or. excess < 0.0_wp) cycle
            if (displacement < self%entry_origin(entry) .neqv. side < 0.0_wp) cycle
            growth = self%ageing%threshold(self%entry_configured(entry), self%entry_mean(entry), &
               & time - self%entry_birth(entry)) - self%entry_bound(entry)
            self%candidate_refused(candidate) = excess < growth
            if (self%candidate_refused(candidate)) cycle
            self%candidate_breaks(candidate) = .true.
            self%is_gone(entry) = .true.
            call move_first(self, entry, self%direction * displacement)
         end associate
      end do
      self%tried = candidate - 1
   end subroutine try_candidates

   !> Make an entry the first one that breaks next.
   subroutine move_first(self, entry, coordinate)
      type(schedule_type), intent(inout) :: self
      integer, intent(in) :: entry
      !> Coordinate at which it breaks [m]
      real(wp), intent(in) :: coordinate

      integer :: place, event

      do place = self%broken + 1, self%breaks
         if (self%break_entry(place) == entry) exit
      end do
      if (place > self%breaks) then
         self%breaks = place
         self%break_stiffness(place) = self%mean_stiffness
         self%break_drag(place) = self%break_drag(1)
      end if
      do event = place, self%broken + 2, -1
         self%break_coordinate(event) = self%break_coordinate(event - 1)
         self%break_origin(event) = self%break_origin(event - 1)
         self%break_entry(event) = self%break_entry(event - 1)
      end do
      self%break_coordinate(self%broken + 1) = coordinate
      self%break_origin(self%broken + 1) = self%entry_origin(entry)
      self%break_entry(self%broken + 1) = entry
   end subroutine move_first

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
            if (self%has_growth .or. self%has_entries) entry = self%break_entry(broken)
            call self%insert_attachment(entry, time, self%break_drag(broken))
         end do
      else if (self%broken == 0) then
         ! With one delay for all, those that break now attach after all listed ones.
         self%attach_time(self%attachments + 1) = min(self%attach_time(self%attachments + 1), &
            & time + self%delay)
      end if
      if (self%has_entries) then
         self%is_gone(self%break_entry(self%broken + 1:event - 1)) = .true.
         self%breaks_now = .true.
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
      place = self%attachments + 1
      self%attach_time(place + 1) = self%attach_time(place)
      do while (place > self%attached + 1)
         if (self%attach_time(place - 1) <= due) exit
         self%attach_time(place) = self%attach_time(place - 1)
         self%attach_stiffness(place) = self%attach_stiffness(place - 1)
         self%attach_stretch(place) = self%attach_stretch(place - 1)
         self%attach_limit(place) = self%attach_limit(place - 1)
         self%attach_drag(place) = self%attach_drag(place - 1)
         if (self%has_entries) self%attach_bound(place) = self%attach_bound(place - 1)
         place = place - 1
      end do
      self%attach_time(place) = due
      self%attach_stiffness(place) = self%birth_stiffness(event)
      self%attach_stretch(place) = self%birth_stretch(event)
      self%attach_limit(place) = self%birth_limit(event)
      self%attach_drag(place) = drag
      if (self%has_entries) self%attach_bound(place) = self%birth_bound(event)
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
         if (self%has_entries) self%has_newborn = self%has_newborn &
            & .or. origin + self%attach_bound(event) < self%newborn_upper &
            & .or. origin - self%attach_bound(event) > self%newborn_lower
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
      if (self%has_candidates .and. .not. self%has_entries) then
         self%is_over = self%is_over .or. origin + limit < self%newborn_upper &
            & .or. origin - limit > self%newborn_lower
      end if
      if (self%has_growth) then
         self%unlisted = min(self%unlisted, ahead)
         return
      end if
      do while (self%breaks > self%broken)
         if (self%break_coordinate(self%breaks) < ahead) exit
         self%breaks = self%breaks - 1
      end do
      if (self%has_candidates .and. .not. self%has_entries) then
         self%break_coordinate(self%breaks + 1) = min(self%break_coordinate(self%breaks + 1), ahead)
      end if
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
      self%window_time = min(self%attach_time(self%attached + 1), &
         & self%site_time(self%moved + 1), self%candidate_time(self%tried + 1))
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

   !> Contacts break by coordinate, then by candidates, then others attach. At the end of the
   !> schedule further events that are due are left to the contacts.
   subroutine pass_candidates(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      integer :: earlier

      earlier = self%came_count
      do while (self%broken < self%breaks)
         associate (event => self%broken + 1)
            if (.not. self%is_gone(event)) then
               if (self%break_coordinate(event) > self%direction * displacement) exit
               call self%break_candidate(event, time, displacement)
            end if
         end associate
         self%broken = self%broken + 1
      end do
      do while (self%candidate_time(self%tried + 1) <= time .and. self%tried < self%candidates)
         associate (event => self%tried + 1, entry => self%candidate_entry(self%tried + 1))
            if (entry == 0) then
               self%is_over = .true.
               exit
            end if
            if (.not. self%is_gone(entry) .and. (displacement >= self%candidate_upper(event) &
               & .or. displacement <= self%candidate_lower(event))) then
               call self%break_candidate(entry, time, displacement)
            end if
         end associate
         self%tried = self%tried + 1
      end do
      do while (self%broken < self%breaks)
         if (.not. self%is_gone(self%broken + 1)) exit
         self%broken = self%broken + 1
      end do
      self%breaks_now = self%came_count > earlier
      if (self%breaks_now) self%moments = self%moments + 1

      ! Without the first contact beyond the list it is not known where the next one breaks.
      self%is_over = self%is_over .or. self%is_gone(self%breaks + 1) .or. time >= self%end_time &
         & .or. abs(displacement) * self%mean_stiffness >= self%max_force &
         & .or. (self%tried == self%candidates .and. self%candidates > 0) &
         & .or. displacement >= self%upper .or. displacement <= self%lower &
         & .or. self%break_coordinate(self%broken + 1) <= self%direction * displacement
      if (self%is_over .or. self%attach_time(self%attached + 1) > time) return
      if (allocated(self%strength)) call self%fit_to_track(time, displacement)
      call self%attach_due(time, displacement)
      self%is_over = self%is_over .or. self%attach_time(self%attached + 1) <= time &
         & .or. self%break_coordinate(self%broken + 1) <= self%direction * displacement
   end subroutine pass_candidates

   !> Break the contact of an entry.
   subroutine break_candidate(self, entry, time, displacement)
      class(schedule_type), intent(inout) :: self
      integer, intent(in) :: entry
      real(wp), intent(in) :: time, displacement

      self%is_gone(entry) = .true.
      self%came_count = self%came_count + 1
      self%came(self%came_count) = entry
      self%break_time(self%came_count) = time
      self%break_displacement(self%came_count) = displacement
      call self%stiffness%add(-self%break_stiffness(1))
      call self%offset%add(-self%break_stiffness(1) * self%break_origin(entry))
      if (self%break_drag(1) > 0.0_wp) call self%drag%add(self%break_drag(1))
      if (self%has_births) then
         call self%insert_attachment(entry, time, self%break_drag(1))
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
   end subroutine break_candidate

end module mesoslip_schedule
