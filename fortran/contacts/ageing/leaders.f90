!> The leaders: contacts that may break next while their thresholds grow.
!>
!> The breaks of leaders are extrapolated from the motion of the slider, with a margin: its
!> acceleration and jerk follow from the law that it is offered. A slider that arrives where a
!> leader was expected to break finds it due, or a little ahead; then its break is extrapolated
!> again.
module mesoslip_contacts_ageing_leaders
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type, any_motion, append, in_leaders, &
      & in_queue, leaders, life_birth, life_limit, life_motion, tiny_gap
   use mesoslip_contacts_individual_sorting, only: before
   use mesoslip_contacts_individual_record, only: row_origin
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: bound_leaders, break_leaders, add_leader, remove_leader

   !> Relative change of the speed of approach up to which the time of a break is a short series
   real(wp), parameter :: max_excess = 1.0e-5_wp
   !> The same up to which that series starts Newton's method, and relative change of the time after
   !> which it ends: the error is the square of that
   real(wp), parameter :: max_start_excess = 0.2_wp, max_change = 1.0e-6_wp
   !> Steps of Newton's method, which converges from one side: fewer only make windows shorter
   integer, parameter :: max_steps = 8
   !> Contacts that are taken out of the queue together
   integer, parameter :: max_gathered = 16
   !> Maximum duration for which a bound on the displacement is extrapolated [s], and its margin
   real(wp), parameter :: max_duration = 1.0e9_wp, margin = 1.5_wp

contains

   !> Bound a window by the breaks of the leaders and of the queue.
   subroutine bound_leaders(self, pose, end_time, upper)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Latest end of the window [s]
      real(wp), intent(in) :: end_time
      !> Coordinate before which no contact breaks [m]
      real(wp), intent(inout) :: upper

      real(wp) :: reach

      reach = reach_of(self, pose, end_time)
      call extrapolate_first(self, pose, reach, upper)
      if (self%queue%first_key < min(upper, reach)) then
         call gather(self, pose)
         call extrapolate_first(self, pose, reach, upper)
      end if
      upper = min(upper, self%queue%first_key)
   end subroutine bound_leaders

   !> Extrapolate the breaks of the first leaders, as many as may break next. Limits other than that
   !> of the first are solved again before, which makes the bounds closer.
   subroutine extrapolate_first(self, pose, reach, upper)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Coordinate that the slider does not reach in the window [m]
      real(wp), intent(in) :: reach
      !> Coordinate before which no leader breaks [m]
      real(wp), intent(inout) :: upper

      integer :: position, first, contact
      real(wp) :: key

      first = self%list(leaders)%count
      do position = first, 1, -1
         key = self%leader_key(position)
         if (.not. key < upper) exit
         if (key < reach) then
            contact = self%list(leaders)%contact(position)
            if (position < first .and. self%life(life_motion, contact) < any_motion) then
               call self%solve(contact, pose%displacement, pose%time)
               key = self%ahead_of(contact)
               self%leader_key(position) = key
            end if
            if (key < upper) key = extrapolated_break(self, contact, pose)
         end if
         upper = min(upper, key)
      end do
      call self%count_visits(first - position)
      do position = position + 1, first
         call sort_leader(self, position)
      end do
   end subroutine extrapolate_first

   !> Make leaders of the first contacts of the queue. Their limits are solved again from the
   !> present time on, which makes the bounds closer than those from birth.
   subroutine gather(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: number, position, contact(max_gathered)
      real(wp) :: last

      last = self%queue%first_key + max_gathered * self%stretch / self%parameters%count
      do number = 1, max_gathered
         if (self%queue%first_key > last) exit
         call self%queue%pop(self%record, contact(number))
      end do
      number = number - 1
      do position = 1, number
         if (self%life(life_motion, contact(position)) < any_motion) then
            call self%solve(contact(position), pose%displacement, pose%time)
         end if
         if (self%ahead_of(contact(position)) <= last) then
            call add_leader(self, contact(position))
         else
            call self%put(contact(position))
         end if
      end do
      call self%count_visits(number)
   end subroutine gather

   !> Add a contact to the leaders, which are in decreasing order of their keys.
   subroutine add_leader(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%kept(contact) = in_leaders
      call append(self%list(leaders), contact)
      self%leader_key(self%list(leaders)%count) = self%ahead_of(contact)
      call sort_leader(self, self%list(leaders)%count)
   end subroutine add_leader

   !> Move a leader back to its place by its key; those before it are sorted.
   subroutine sort_leader(self, first)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: first

      integer :: contact, position
      real(wp) :: key

      associate (list => self%list(leaders)%contact)
         contact = list(first)
         key = self%leader_key(first)
         do position = first, 2, -1
            if (before(key, contact, self%leader_key(position - 1), list(position - 1))) exit
            list(position) = list(position - 1)
            self%leader_key(position) = self%leader_key(position - 1)
         end do
         list(position) = contact
         self%leader_key(position) = key
      end associate
   end subroutine sort_leader

   !> Coordinate that the slider does not reach before a time [s].
   pure function reach_of(self, pose, time) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: time
      real(wp) :: coordinate

      real(wp) :: duration, speed

      coordinate = huge(1.0_wp)
      duration = time - pose%time
      if (self%jumps .or. duration > max_duration) return
      speed = abs(pose%velocity) &
         & + (abs(self%acceleration) + (abs(self%jerk) + self%jerk_bound) * duration) &
         & * duration
      coordinate = self%direction * pose%displacement + margin * speed * duration
   end function reach_of

   !> Coordinate at which a leader breaks by extrapolation, not beyond where it does break.
   !>
   !> In a time t the slider moves by speed t + pull t^2 + third t^3, with an error that grows as
   !> t^3, and the threshold grows by about rate t + bend t^2.
   pure function extrapolated_break(self, contact, pose) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      real(wp) :: coordinate

      real(wp) :: age, limit, rate, bend, here, gap, speed, pull, third, error, growth, later_rate
      real(wp) :: step, excess, slope, change
      integer :: number

      coordinate = self%ahead_of(contact)
      if (self%life(life_motion, contact) >= any_motion) return
      if (self%jumps .and. .not. self%is_unchanged) return
      age = pose%time - self%life(life_birth, contact)
      call self%ageing%evaluate(self%life(life_limit, contact), self%mean_of(contact), age, limit, &
         & rate)
      speed = self%direction * pose%velocity
      if (.not. speed > rate) return
      here = self%direction * self%record(row_origin, contact) + limit
      gap = here - self%direction * pose%displacement
      slope = 1.0_wp / (speed - rate)
      step = gap * slope
      if (.not. step > 0.0_wp) return
      pull = 0.5_wp * self%direction * self%acceleration
      third = (1.0_wp / 6.0_wp) * self%direction * self%jerk
      error = (1.0_wp / 6.0_wp) * self%jerk_bound * step**2
      if (.not. (error < 0.5_wp * speed .and. (abs(pull) + abs(third) * step) * step &
         & < 0.25_wp * speed)) return

      bend = 0.5_wp * self%ageing%curvature(rate, age)
      excess = (pull + third * step - bend) * step * slope
      if (abs(excess) <= max_excess .and. abs(bend) * step**3 &
         & <= 0.1_wp * tiny_gap * self%stretch * self%ageing%time) then
         step = step * (1.0_wp - excess * (1.0_wp - 2.0_wp * excess))
         growth = (rate + bend * step) * step
      else
         if (abs(excess) < max_start_excess) step = step * (1.0_wp - excess)
         do number = 1, max_steps
            call self%ageing%grow(rate, age, step, growth, later_rate)
            slope = speed + (2.0_wp * pull + 3.0_wp * third * step) * step - later_rate
            if (.not. slope > 0.0_wp) return
            change = (gap + growth - step * (speed + (pull + third * step) * step)) / slope
            step = max(0.0_wp, step + change)
            growth = growth + later_rate * change
            if (abs(change) <= max_change * step) exit
         end do
         growth = max(growth, 0.0_wp)
         ! A slider that slows down arrives later than one at the present speed.
         slope = 1.0_wp / min(speed - rate, slope)
         error = (1.0_wp / 6.0_wp) * self%jerk_bound * step**2
      end if
      coordinate = max(coordinate, here + max(0.0_wp, 1.0_wp - error * slope) * growth)
   end function extrapolated_break

   !> Break the leaders that are due, in the order of their keys.
   subroutine break_leaders(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: position, contact
      real(wp) :: reached

      reached = self%direction * pose%displacement + 2.0_wp * tiny_gap * self%stretch
      do position = self%list(leaders)%count, 1, -1
         if (.not. self%leader_key(position) < reached) exit
         contact = self%list(leaders)%contact(position)
         call self%refresh(contact, pose%time)
         self%leader_key(position) = self%ahead_of(contact)
      end do
      do position = position + 1, self%list(leaders)%count
         call sort_leader(self, position)
      end do
      do position = self%list(leaders)%count, 1, -1
         if (.not. self%leader_key(position) < reached) exit
         contact = self%list(leaders)%contact(position)
         if (.not. self%is_due(contact, pose)) cycle
         call self%record_lateness(contact, pose)
         call remove_leader(self, position)
         self%kept(contact) = in_queue
         call self%detach(contact, pose%displacement, pose%time)
      end do
   end subroutine break_leaders

   !> Remove a leader.
   subroutine remove_leader(self, position)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: position

      integer :: next

      associate (list => self%list(leaders))
         do next = position, list%count - 1
            list%contact(next) = list%contact(next + 1)
            self%leader_key(next) = self%leader_key(next + 1)
         end do
         list%count = list%count - 1
      end associate
   end subroutine remove_leader

end module mesoslip_contacts_ageing_leaders
