!> The events of a motion that goes on forward: the next breaks and attachments in their order.
!>
!> Contacts write a schedule; a slider runs through it and it notes when and where each event came;
!> contacts read that afterwards and keep their books for many events at once. It knows nothing
!> but what each event does to the law of the contact force, so that sliders need not know contacts.
!>
!> A schedule is never wrong, only short: it ends before anything unforeseen, and the
!> numbers of a run do not depend on its length.
!>
!> With clocks of thermally activated breaking a contact may be in two lists, that of coordinates
!> and that of readings of a clock; where it breaks by one it is gone from the other.
module mesoslip_schedule
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_hazard, only: hazard_type
   use mesoslip_interface_law, only: clocks, interface_law_type, window_type
   implicit none
   private

   public :: schedule_type, max_events

   !> Maximum number of breaks, and of attachments, in a schedule
   integer, parameter :: max_events = 64

   !> Events to come, and those that came.
   type :: schedule_type
      !> Breaks and attachments to come
      integer :: breaks = 0, attachments = 0
      !> Those that came, and moments in which contacts broke
      integer :: broken = 0, attached = 0, moments = 0
      !> Whether it ends here
      logical :: is_over = .true.
      !> Whether the only break listed is a bound, where contacts are to say which of them break;
      !> whether the slider has come there
      logical :: is_bounded = .false., at_bound = .false.

      !> Direction of motion, +1 or -1
      real(wp) :: direction = 1.0_wp
      !> Totals of stiffness and stiffness times origin of the pinned, of drag of the detached
      type(accumulator_type) :: stiffness, offset, drag
      !> Contacts that are pinned and detached
      integer :: pinned = 0, detached = 0
      !> Maximum coordinate at which a contact breaks in a motion back [m]
      real(wp) :: behind = -huge(1.0_wp)
      !> Time after which a contact that breaks attaches; huge if it does not [s]
      real(wp) :: delay = 0.0_wp
      !> Time at which it ends, and maximum duration of a step [s]
      real(wp) :: end_time = 0.0_wp, max_step = 0.0_wp
      !> Mean stiffness of a contact [N/m]; it ends where that times the displacement is a force [N]
      real(wp) :: mean_stiffness = 0.0_wp, max_force = 0.0_wp

      !> Of each break: coordinate along the direction [m], stiffness [N/m], origin [m], and drag
      !> of the contact when it is detached [N s/m]
      real(wp) :: break_coordinate(max_events) = 0.0_wp, break_stiffness(max_events) = 0.0_wp, &
         & break_origin(max_events) = 0.0_wp, break_drag(max_events) = 0.0_wp
      !> When and where those came, in their order [s, m]
      real(wp) :: break_time(2 * max_events) = 0.0_wp, &
         & break_displacement(2 * max_events) = 0.0_wp
      !> Of each attachment: its time [s], with that of the first one that is not in the schedule;
      !> stiffness [N/m], stretch at first and at breaking [m] and drag until then [N s/m]
      real(wp) :: attach_time(max_events + 1) = 0.0_wp, attach_stiffness(max_events) = 0.0_wp, &
         & attach_stretch(max_events) = 0.0_wp, attach_limit(max_events) = 0.0_wp, &
         & attach_drag(max_events) = 0.0_wp
      !> Where it came [m]
      real(wp) :: attach_displacement(max_events) = 0.0_wp
      !> Whether contacts that break may attach here, and of each break the delay until then [s],
      !> the stiffness [N/m], and the stretches at first and at breaking [m] of the next life, and
      !> the deviate of that; those of breaks by a clock come after the others
      logical :: has_births = .false.
      real(wp) :: birth_delay(2 * max_events) = 0.0_wp, birth_stiffness(2 * max_events) = 0.0_wp, &
         & birth_stretch(2 * max_events) = 0.0_wp, birth_limit(2 * max_events) = 0.0_wp, &
         & birth_left(2 * max_events) = 0.0_wp

      !> Whether there are clocks, which they are, and the one by which contacts break here
      logical :: has_clocks = .false.
      type(hazard_type) :: hazard
      integer :: number = 1
      !> Breaks by the clock to come, and those that came or are gone
      integer :: clock_breaks = 0, clock_broken = 0
      !> Of each its reading [s], and origin [m]
      real(wp) :: clock_key(max_events) = 0.0_wp, clock_origin(max_events) = 0.0_wp
      !> Entry of the clock's list that ends the schedule without a break, 0 for none
      integer :: clock_stop = 0
      !> Of each entry the same contact in the other list, or 0, and whether it is gone
      integer :: break_twin(max_events) = 0, clock_twin(max_events) = 0
      logical :: break_gone(max_events) = .false., clock_gone(max_events) = .false.
      !> Of each entry by coordinates whether the contact does not break there, but its force gets
      !> the sign of the motion; its stretch at breaking [m], what is left of its deviate, and its
      !> reading: by the other clock until then, and by this one after that [s]
      logical :: break_turns(max_events) = .false.
      real(wp) :: turn_limit(max_events) = 0.0_wp, turn_left(max_events) = 0.0_wp, &
         & turn_key(max_events) = 0.0_wp
      !> Those that came; contacts that go by the other clock, and the entry of the first of them to
      !> break, 0 if it is not listed
      integer :: turned = 0, others = 0, other_first = 0
      !> Breaks in all, and the entry of each, negative if it is one of the clock
      integer :: came_count = 0, came(2 * max_events) = 0
      !> Whether contacts broke in the last moment
      logical :: breaks_now = .false.
      !> Of each attachment the deviate, and the reading at which the contact breaks [s]; distance
      !> from its origin at which its force changes its sign on the way back [m]
      real(wp) :: attach_left(max_events) = 0.0_wp, attach_key(max_events) = 0.0_wp, &
         & tiny_stretch = 0.0_wp
   contains
      !> Contact force until the next event, and where and when that is
      procedure, non_overridable :: law
      procedure, non_overridable :: window
      !> Number of contacts that broke
      procedure, non_overridable :: break_count
      !> Let what is due at a time and a displacement happen
      procedure, non_overridable :: pass
      procedure, non_overridable, private :: break_due, attach_due, &
         & insert_attachments, insert_attachment
      procedure, non_overridable, private :: pass_clocks, break_with_clocks, attach_with_clocks, &
         & change_sign, cut_lists, skip_gone
   end type schedule_type

contains

   !> Contact force until the next event.
   pure function law(self)
      class(schedule_type), intent(in) :: self
      !> The law
      type(interface_law_type) :: law

      law%stiffness = self%stiffness%total()
      law%offset = self%offset%total()
      law%drag = self%drag%total()
   end function law

   !> Where the next event is.
   pure function window(self, time)
      class(schedule_type), intent(in) :: self
      !> Time now [s]
      real(wp), intent(in) :: time
      !> Displacements and time at which the law ends
      type(window_type) :: window

      if (self%direction > 0.0_wp) then
         window%upper = self%break_coordinate(self%broken + 1)
         window%lower = self%behind
      else
         window%upper = -self%behind
         window%lower = -self%break_coordinate(self%broken + 1)
      end if
      window%end_time = min(self%attach_time(self%attached + 1), self%end_time, &
         & time + self%max_step)
      if (self%has_clocks) call self%hazard%limit_window(window)
   end function window

   !> Number of contacts that broke.
   pure function break_count(self) result(number)
      class(schedule_type), intent(in) :: self
      !> Their number
      integer :: number

      number = merge(self%came_count, self%broken, self%has_clocks)
   end function break_count

   !> Let what is due happen: first contacts break, then contacts attach.
   subroutine pass(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      !> Time [s] and displacement of the slider [m]
      real(wp), intent(in) :: time, displacement

      if (self%has_clocks) then
         call self%pass_clocks(time, displacement)
         return
      end if
      if (self%break_coordinate(self%broken + 1) <= self%direction * displacement) then
         if (self%is_bounded) then
            self%at_bound = .true.
            self%is_over = .true.
            return
         end if
         call self%break_due(time, displacement)
      end if
      if (self%attach_time(self%attached + 1) <= time) call self%attach_due(time, displacement)
      self%is_over = self%broken == self%breaks .or. time >= self%end_time &
         & .or. self%attach_time(self%attached + 1) <= time &
         & .or. abs(displacement) * self%mean_stiffness >= self%max_force
   end subroutine pass

   !> Contacts break.
   subroutine break_due(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      integer :: event

      do event = self%broken + 1, self%breaks
         if (self%break_coordinate(event) > self%direction * displacement) exit
         self%break_time(event) = time
         self%break_displacement(event) = displacement
         call self%stiffness%add(-self%break_stiffness(event))
         call self%offset%add(-self%break_stiffness(event) * self%break_origin(event))
         if (self%break_drag(event) > 0.0_wp) call self%drag%add(self%break_drag(event))
      end do
      ! Those that break now come after all that wait to attach.
      if (self%has_births) then
         call self%insert_attachments(event - 1, time)
      else if (self%broken == 0) then
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

   !> Insert the attachments of the contacts that break now.
   subroutine insert_attachments(self, last, time)
      class(schedule_type), intent(inout) :: self
      !> Number of the last break
      integer, intent(in) :: last
      !> Time [s]
      real(wp), intent(in) :: time

      integer :: event

      do event = self%broken + 1, last
         call self%insert_attachment(event, time, self%break_drag(event))
      end do
   end subroutine insert_attachments

   !> Insert the attachment of a contact that breaks now, unless it comes after those listed.
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
         ! The last one leaves a full list, whose next time is its own then.
         if (self%attached == max_events) self%attach_time(max_events + 1) = due
         self%attachments = max(self%attached, max_events - 1)
      end if
      if (due >= self%attach_time(self%attachments + 1)) return
      if (self%has_clocks .and. self%direction * self%birth_stretch(event) < 0.0_wp) then
         ! It goes by the other clock, which ends the schedule.
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

   !> Contacts attach. One that would break before another of the schedule cuts it short.
   subroutine attach_due(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      real(wp) :: origin, ahead
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
         self%behind = max(self%behind, self%direction * origin - self%attach_limit(event))
         ahead = self%direction * origin + self%attach_limit(event)
         do while (self%breaks > self%broken)
            if (self%break_coordinate(self%breaks) < ahead) exit
            self%breaks = self%breaks - 1
         end do
      end do
      self%attached = event - 1
   end subroutine attach_due

   !> The same with clocks: contacts break by their clock, then at coordinates, then others attach.
   !> Other events that are due where the schedule ends are left to the contacts.
   subroutine pass_clocks(self, time, displacement)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement

      logical :: far(clocks)
      integer :: earlier, other

      earlier = self%came_count
      other = clocks + 1 - self%number
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
      do while (self%broken < self%breaks)
         associate (event => self%broken + 1)
            if (self%break_coordinate(event) > self%direction * displacement) exit
            if (self%break_turns(event)) then
               ! Contacts of the other clock break before that.
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
         call self%attach_with_clocks(time, displacement)
         self%is_over = self%broken == self%breaks .or. self%clock_broken == self%clock_breaks &
            & .or. self%attach_time(self%attached + 1) <= time
         if (self%is_over) return
      end if
      self%hazard%next(self%number) = self%clock_key(self%clock_broken + 1)
   end subroutine pass_clocks

   !> A contact breaks.
   subroutine break_with_clocks(self, time, displacement, entry, origin)
      class(schedule_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement
      !> Entry of its list, negative if it is that of the clock
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
         ! Those that break now come after all that wait to attach.
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

   !> Contacts attach. One that would break before another of a list cuts it short.
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

   !> The force of a contact gets the sign of the motion: it goes by the other clock from now on.
   subroutine change_sign(self, event)
      class(schedule_type), intent(inout) :: self
      !> Entry of the list by coordinates
      integer, intent(in) :: event

      associate (origin => self%break_origin(event), limit => self%turn_limit(event), &
         & left => self%turn_left(event), key => self%turn_key(event))
         left = self%hazard%left(clocks + 1 - self%number, key, left, limit, origin)
         key = self%hazard%key(self%number, left, limit, origin)
         self%turned = self%turned + 1
         self%others = self%others - 1
         ! Which contact is the next one of the other clock is not known then.
         if (event == self%other_first .or. self%others == 0) self%is_over = .true.
         ! Its own entry stays, as it is passed after that.
         self%broken = event
         call self%cut_lists(origin, limit, key)
         self%broken = event - 1
      end associate
   end subroutine change_sign

   !> Cut lists short before the entries of a contact that is new in them.
   subroutine cut_lists(self, origin, limit, key)
      class(schedule_type), intent(inout) :: self
      !> Origin of the contact, its stretch at breaking [m], and the reading at which it breaks [s]
      real(wp), intent(in) :: origin, limit, key

      real(wp) :: ahead

      self%behind = max(self%behind, self%direction * origin - self%tiny_stretch)
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
