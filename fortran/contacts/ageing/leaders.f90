!> Contacts that age and may break next: the leaders.
!>
!> Where they break is foreseen from the motion of the slider, of which acceleration and jerk follow
!> from the law that it is offered, and held back by what is not known of it. A slider that comes to
!> where a leader was to break finds it there, or a little ahead of it and foresees again.
module mesoslip_contacts_ageing_leaders
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type, any_motion, in_leaders, &
      & in_queue, leaders, life_birth, life_limit, life_motion, safety, tiny_gap
   use mesoslip_contacts_ageing_lists, only: append
   use mesoslip_contacts_individual_sorting, only: before
   use mesoslip_contacts_individual_record, only: row_origin, ahead_coordinate
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: bound_leaders, break_leaders, add_leader

   !> Change of the speed of approach, relative, over which the time of a break is a short series.
   real(wp), parameter :: max_excess = 1.0e-5_wp
   !> The same up to which the first terms are a start, and relative change of the time after which
   !> no other follows: what is left is its square.
   real(wp), parameter :: max_start_excess = 0.2_wp, max_change = 1.0e-6_wp
   !> Steps of Newton's method: it converges from one side, and what is left is only foreseen worse.
   integer, parameter :: max_steps = 8
   !> Contacts that are taken out of the queue together
   integer, parameter :: max_gathered = 16
   !> Duration up to which the motion is foreseen to bound how far the slider may come [s], and
   !> factor by which that is beyond what is foreseen
   real(wp), parameter :: max_duration = 1.0e9_wp, margin = 1.5_wp

contains

   !> Find until where the slider may go before a contact breaks, of the leaders and of the queue.
   !> What it cannot come to before the window ends is bounded by where the contacts are queued.
   subroutine bound_leaders(self, pose, end_time, upper)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Time at which the window ends at the latest [s]
      real(wp), intent(in) :: end_time
      !> Coordinate until which no contact breaks [m]
      real(wp), intent(inout) :: upper

      real(wp) :: reach

      reach = reach_of(self, pose, end_time)
      call foresee_first(self, pose, reach, upper)
      if (self%queue%first_key < min(upper, reach)) then
         call gather(self, pose)
         call foresee_first(self, pose, reach, upper)
      end if
      ! Contacts beyond those looked at are bounded by where they are queued, too.
      upper = min(upper, self%queue%first_key)
   end subroutine bound_leaders

   !> Foresee where the first leaders break, as many as may do so next. Of those after the first one
   !> a closer bound is solved before.
   subroutine foresee_first(self, pose, reach, upper)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Coordinate that the slider does not come to in the window [m]
      real(wp), intent(in) :: reach
      !> Coordinate until which no leader breaks [m]
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
               call self%order(contact, pose%displacement, pose%time)
               key = ahead_coordinate(self%record(:, contact), self%direction)
               self%leader_key(position) = key
            end if
            if (key < upper) key = foresee(self, contact, pose)
         end if
         upper = min(upper, key)
      end do
      call self%count_visits(first - position)
      do position = position + 1, first
         call sort_leader(self, position)
      end do
   end subroutine foresee_first

   !> Bring the first contacts of the queue to the leaders. Where they break is solved again from
   !> now on, which is a closer bound than that at birth.
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
            call self%order(contact(position), pose%displacement, pose%time)
         end if
         if (ahead_coordinate(self%record(:, contact(position)), self%direction) <= last) then
            call add_leader(self, contact(position))
         else
            call self%put(contact(position))
         end if
      end do
      call self%count_visits(number)
   end subroutine gather

   !> Add a contact to the leaders, which are in the order of their keys, the first one last.
   subroutine add_leader(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%kept(contact) = in_leaders
      call append(self%list(leaders), contact)
      self%leader_key(self%list(leaders)%count) = &
         & ahead_coordinate(self%record(:, contact), self%direction)
      call sort_leader(self, self%list(leaders)%count)
   end subroutine add_leader

   !> Find the place of a leader whose key is too great for where it is.
   subroutine sort_leader(self, first)
      class(ageing_contacts_type), intent(inout) :: self
      !> Position of the leader; those before it are sorted
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

   !> Coordinate that the slider does not come to before a time, by what is known of its motion.
   pure function reach_of(self, pose, time) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      !> The time [s]
      real(wp), intent(in) :: time
      real(wp) :: coordinate

      real(wp) :: duration, speed

      coordinate = huge(1.0_wp)
      duration = time - pose%time
      if (self%jumps .or. duration > max_duration) return
      speed = abs(pose%velocity) &
         & + (abs(self%acceleration) + (abs(self%jerk) + self%jerk_doubt) * duration) &
         & * duration
      coordinate = self%direction * pose%displacement + margin * speed * duration
   end function reach_of

   !> Where a leader is foreseen to break.
   pure function foresee(self, contact, pose) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      !> Coordinate along the direction of motion, not beyond where it breaks [m]
      real(wp) :: coordinate

      real(wp) :: age, limit, rate, bend, here, gap, speed, pull, grown, step, excess, slope, doubt
      real(wp) :: third, later_rate, change
      integer :: number

      coordinate = ahead_coordinate(self%record(:, contact), self%direction)
      if (self%life(life_motion, contact) >= any_motion) return
      if (self%jumps .and. .not. self%is_unchanged) return
      age = pose%time - self%life(life_birth, contact)
      call self%ageing%evaluate(self%life(life_limit, contact), self%stretch, age, limit, rate)
      speed = self%direction * pose%velocity
      if (.not. speed > rate) return
      here = self%direction * self%record(row_origin, contact) + limit
      gap = here - self%direction * pose%displacement
      slope = 1.0_wp / (speed - rate)
      step = gap * slope
      if (.not. step > 0.0_wp) return
      pull = 0.5_wp * self%direction * self%acceleration
      third = (1.0_wp / 6.0_wp) * self%direction * self%jerk
      doubt = (1.0_wp / 6.0_wp) * self%jerk_doubt * step**2
      if (.not. (doubt < 0.5_wp * speed .and. (abs(pull) + abs(third) * step) * step &
         & < 0.25_wp * speed)) return

      bend = 0.5_wp * self%ageing%bend(rate, age)
      excess = (pull + third * step - bend) * step * slope
      if (abs(excess) <= max_excess .and. abs(bend) * step**3 &
         & <= 0.1_wp * tiny_gap * self%stretch * self%ageing%time) then
         ! So close that the threshold grows along a parabola.
         step = step * (1.0_wp - excess * (1.0_wp - 2.0_wp * excess))
         grown = (rate + bend * step) * step
      else
         if (abs(excess) < max_start_excess) step = step * (1.0_wp - excess)
         do number = 1, max_steps
            call self%ageing%grow(rate, age, step, grown, later_rate)
            slope = speed + (2.0_wp * pull + 3.0_wp * third * step) * step - later_rate
            if (.not. slope > 0.0_wp) return
            change = (gap + grown - step * (speed + (pull + third * step) * step)) / slope
            step = max(0.0_wp, step + change)
            grown = grown + later_rate * change
            if (abs(change) <= max_change * step) exit
         end do
         grown = max(grown, 0.0_wp)
         ! A slider that becomes slower comes there later than one at the present speed.
         slope = 1.0_wp / min(speed - rate, slope)
         doubt = (1.0_wp / 6.0_wp) * self%jerk_doubt * step**2
      end if
      coordinate = max(coordinate, here + max(0.0_wp, 1.0_wp - doubt * slope) * grown)
   end function foresee

   !> Break the leaders that are due, in the order of their places.
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
         self%leader_key(position) = ahead_coordinate(self%record(:, contact), self%direction)
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
