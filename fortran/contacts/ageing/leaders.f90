!> Contacts that age and may break next: the leaders.
!>
!> Where they break is foreseen from the motion of the slider, and held back by what is not known of
!> it. A slider that comes to where a leader was to break finds it there, or a little ahead of it
!> and foresees again.
module mesoslip_contacts_ageing_leaders
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type, any_motion, in_leaders, &
      & in_queue, leaders, life_birth, life_limit, life_motion, safety, tiny_gap
   use mesoslip_contacts_ageing_lists, only: append, remove
   use mesoslip_contacts_individual_record, only: row_origin, ahead_coordinate
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: bound_leaders, break_leaders

   !> Change of the speed of approach, relative, over which the time of a break is a short series.
   real(wp), parameter :: max_excess = 1.0e-5_wp
   !> Steps of Newton's method: it converges from one side, and what is left is only foreseen worse.
   integer, parameter :: max_steps = 8
   !> Contacts that are taken out of the queue for one window: where thresholds are narrow, all may
   !> be queued before the first one is foreseen to break.
   integer, parameter :: max_popped = 8
   !> Duration up to which the motion is foreseen to bound how far the slider may come [s], and
   !> factor by which that is beyond what is foreseen
   real(wp), parameter :: max_duration = 1.0e9_wp, margin = 1.5_wp

contains

   !> Bring those to the leaders that may break next, and find until where the slider may go. What
   !> it cannot come to before the window ends is bounded by where the contacts are queued.
   subroutine bound_leaders(self, pose, end_time, upper)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Time at which the window ends at the latest [s]
      real(wp), intent(in) :: end_time
      !> Coordinate until which no contact breaks [m]
      real(wp), intent(inout) :: upper

      integer :: position, contact, visited, popped
      real(wp) :: key, reach

      reach = reach_of(self, pose, end_time)
      visited = self%list(leaders)%count
      do position = 1, self%list(leaders)%count
         contact = self%list(leaders)%contact(position)
         key = ahead_coordinate(self%record(:, contact), self%direction)
         if (key < reach) key = foresee(self, contact, pose)
         upper = min(upper, key)
      end do
      ! Contacts beyond those looked at are bounded by where they are queued, too.
      do popped = 1, max_popped
         if (.not. self%queue%first_key < min(upper, reach)) exit
         call self%queue%pop(self%record, contact)
         visited = visited + 1
         if (self%life(life_motion, contact) < any_motion) then
            call self%order(contact, pose%displacement, pose%time)
            key = ahead_coordinate(self%record(:, contact), self%direction)
            if (key > min(upper, self%queue%first_key)) then
               call self%queue%insert(contact, key)
               cycle
            end if
         end if
         call append(self%list(leaders), contact)
         self%kept(contact) = in_leaders
         upper = min(upper, foresee(self, contact, pose))
      end do
      upper = min(upper, self%queue%first_key)
      do position = self%list(leaders)%count, 1, -1
         contact = self%list(leaders)%contact(position)
         if (ahead_coordinate(self%record(:, contact), self%direction) > upper) then
            call self%put(contact)
            call remove(self%list(leaders), position)
         end if
      end do
      call self%count_visits(visited)
   end subroutine bound_leaders

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
         & + (abs(pose%acceleration) + safety * self%acceleration_jump) * duration
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
      real(wp) :: held
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
      pull = 0.5_wp * self%direction * pose%acceleration
      doubt = 0.5_wp * safety * self%acceleration_jump * step
      if (step > self%duration .and. self%duration > 0.0_wp) doubt = doubt * step / self%duration
      if (.not. (doubt < 0.5_wp * speed .and. abs(pull) * step < 0.25_wp * speed)) return

      held = max(0.0_wp, 1.0_wp - doubt * slope)
      bend = 0.5_wp * self%ageing%bend(rate, age)
      excess = (pull - bend) * step * slope
      if (abs(excess) <= max_excess .and. abs(bend) * step**3 &
         & <= 0.1_wp * tiny_gap * self%stretch * self%ageing%time) then
         ! So close that the threshold grows along a parabola.
         step = step * (1.0_wp - excess * (1.0_wp - 2.0_wp * excess))
         grown = (rate + bend * step) * step
      else
         grown = 0.0_wp
         do number = 1, max_steps
            call self%ageing%evaluate(self%life(life_limit, contact), self%stretch, age + step, &
               & grown, rate)
            grown = grown - limit
            excess = gap + grown - step * (speed + pull * step)
            slope = speed + 2.0_wp * pull * step - rate
            if (.not. slope > 0.0_wp) return
            step = max(0.0_wp, step + excess / slope)
            if (abs(excess) <= 0.1_wp * tiny_gap * self%stretch) exit
         end do
         grown = max(grown, 0.0_wp)
      end if
      coordinate = max(coordinate, here + held * grown)
   end function foresee

   !> Break the leaders that are due, in the order of their places.
   subroutine break_leaders(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: position, first, contact
      real(wp) :: key, least

      do
         first = 0
         least = self%direction * pose%displacement + 2.0_wp * tiny_gap * self%stretch
         do position = 1, self%list(leaders)%count
            contact = self%list(leaders)%contact(position)
            key = ahead_coordinate(self%record(:, contact), self%direction)
            if (.not. key < least) cycle
            call self%refresh(contact, pose%time)
            key = ahead_coordinate(self%record(:, contact), self%direction)
            if (key < least .and. self%is_due(contact, pose)) then
               least = key
               first = position
            end if
         end do
         if (first == 0) return
         contact = self%list(leaders)%contact(first)
         call self%record_lateness(contact, pose)
         call remove(self%list(leaders), first)
         self%kept(contact) = in_queue
         call self%detach(contact, pose%displacement, pose%time)
      end do
   end subroutine break_leaders

end module mesoslip_contacts_ageing_leaders
