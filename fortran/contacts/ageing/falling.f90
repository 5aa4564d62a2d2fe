!> Contacts whose thresholds fall with age.
!>
!> Such a contact may break while the slider rests, and in either direction of motion, once its
!> stretch has reached its threshold when it is old. From then on its threshold is bounded until the
!> end of a window by the value at that end. Usually few thresholds fall; among many, only those
!> contacts are looked at that are near: they may break before the next scan.
module mesoslip_contacts_ageing_falling
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type, any_motion, append, falling, &
      & in_falling, in_queue, life_birth, life_limit, life_motion, near, position_of, remove, &
      & tiny_gap
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, behind_coordinate
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: scan, scan_if_needed, bound_falling, break_falling, add_falling

   !> Number of contacts up to which all are near, without a scan
   integer, parameter :: max_unscanned = 32
   !> Steps of Newton's method, which converges from one side: fewer only make windows shorter
   integer, parameter :: max_steps = 32

contains

   !> Find the contacts that are near, and the range in which no others break.
   subroutine scan(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: position, contact
      real(wp) :: fastest, limit, rate, reach

      do position = self%list(falling)%count, 1, -1
         call retire(self, self%list(falling)%contact(position), pose%time)
      end do
      call clear_scan(self)
      if (self%list(falling)%count > max_unscanned) then
         fastest = 0.0_wp
         do position = 1, self%list(falling)%count
            contact = self%list(falling)%contact(position)
            call self%ageing%evaluate(self%life(life_limit, contact), self%mean_of(contact), &
               & pose%time - self%life(life_birth, contact), limit, rate)
            fastest = max(fastest, -rate)
         end do
         ! While the slider moves by a stretch, there are about as many scans as near contacts.
         reach = 0.5_wp * self%stretch / sqrt(real(self%list(falling)%count, wp))
         self%scan_upper = self%direction * pose%displacement + reach
         self%scan_lower = self%direction * pose%displacement - reach
         if (fastest > 0.0_wp) then
            self%scan_time = max(pose%time + reach / fastest, nearest(pose%time, 1.0_wp))
         end if
      end if
      self%list(near)%count = 0
      do position = 1, self%list(falling)%count
         contact = self%list(falling)%contact(position)
         call self%refresh(contact, self%scan_time)
         if (self%ahead_of(contact) < self%scan_upper .or. &
            & behind_coordinate(self%record(:, contact), self%direction) > self%scan_lower) then
            call append(self%list(near), contact)
         end if
      end do
      call self%count_visits(2 * self%list(falling)%count)
   end subroutine scan

   !> Add a contact whose stretch has reached its threshold when it is old: until then it could not
   !> break.
   subroutine add_falling(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      ! Schedules let the time of the last scan pass.
      if (self%list(falling)%count == 0) call clear_scan(self)
      self%kept(contact) = in_falling
      call append(self%list(falling), contact)
      call append(self%list(near), contact)
      call self%refresh(contact, self%scan_time)
   end subroutine add_falling

   !> Let all contacts be near, everywhere and always.
   pure subroutine clear_scan(self)
      class(ageing_contacts_type), intent(inout) :: self

      self%scan_upper = huge(1.0_wp)
      self%scan_lower = -huge(1.0_wp)
      self%scan_time = huge(1.0_wp)
   end subroutine clear_scan

   !> Scan if the slider has left the range of the last scan, or most contacts are near.
   subroutine scan_if_needed(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: position

      do position = self%list(near)%count, 1, -1
         call retire(self, self%list(near)%contact(position), pose%time)
      end do
      if (self%list(falling)%count == 0) then
         call clear_scan(self)
         return
      end if
      if (pose%time >= self%scan_time &
         & .or. self%direction * pose%displacement >= self%scan_upper &
         & .or. self%direction * pose%displacement <= self%scan_lower &
         & .or. self%list(near)%count > max(max_unscanned, self%list(falling)%count / 2)) then
         call scan(self, pose)
      end if
   end subroutine scan_if_needed

   !> Put a contact into the queue if its threshold is constant from now on.
   subroutine retire(self, contact, time)
      class(ageing_contacts_type), intent(inout) :: self
      !> By value, because it may be an element of the lists that change here
      integer, value :: contact
      real(wp), intent(in) :: time

      integer :: position

      if (.not. self%ageing%is_old(time - self%life(life_birth, contact))) return
      position = position_of(self%list(near), contact)
      if (position > 0) call remove(self%list(near), position)
      call remove(self%list(falling), position_of(self%list(falling), contact))
      self%record(row_limit, contact) = self%life(life_limit, contact)
      self%life(life_motion, contact) = any_motion
      call self%put(contact)
      self%behind = max(self%behind, self%behind_at(contact, time))
   end subroutine retire

   !> Narrow a window to where no contact breaks whose threshold falls.
   subroutine bound_falling(self, pose, upper, lower, end_time)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Coordinates along the direction of motion [m], and time [s]
      real(wp), intent(inout) :: upper, lower, end_time

      integer :: position

      upper = min(upper, self%scan_upper)
      lower = max(lower, self%scan_lower)
      end_time = min(end_time, self%scan_time)
      do position = 1, self%list(near)%count
         associate (contact => self%list(near)%contact(position))
            if (self%ahead_of(contact) < upper &
               & .or. behind_coordinate(self%record(:, contact), self%direction) > lower) then
               call exclude_break(self, contact, pose, upper, lower, end_time)
            end if
         end associate
      end do
      call self%count_visits(self%list(near)%count)
   end subroutine bound_falling

   !> Narrow a window until a contact cannot break in it.
   pure subroutine exclude_break(self, contact, pose, upper, lower, end_time)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      real(wp), intent(inout) :: upper, lower, end_time

      real(wp) :: age, limit, rate, stretch, speed, step, gap, max_step
      integer :: number

      age = pose%time - self%life(life_birth, contact)
      stretch = pose%displacement - self%record(row_origin, contact)
      speed = max(0.0_wp, sign(1.0_wp, stretch) * pose%velocity)
      stretch = abs(stretch)
      max_step = end_time - pose%time
      step = 0.0_wp
      do number = 1, max_steps
         call self%ageing%evaluate(self%life(life_limit, contact), self%mean_of(contact), &
            & age + step, limit, rate)
         gap = limit - stretch - speed * step
         if (gap <= 0.1_wp * tiny_gap * self%stretch) exit
         if (speed - rate > 0.0_wp) then
            step = step + gap / (speed - rate)
         else
            step = max_step
         end if
         if (.not. step < max_step) exit
      end do
      ! A slider that jumps approaches at a fixed time, and one that turns slowly at first: half of
      ! the gap is for that.
      if (speed < abs(self%prediction%acceleration) * step &
         & .or. (self%jumps .and. .not. speed > 0.0_wp)) step = 0.5_wp * step
      if (step < max_step) end_time = max(pose%time + step, nearest(pose%time, 1.0_wp))
      limit = max(stretch, self%threshold(contact, end_time))
      upper = min(upper, self%direction * self%record(row_origin, contact) + limit)
      lower = max(lower, self%direction * self%record(row_origin, contact) - limit)
   end subroutine exclude_break

   !> Break the contacts whose thresholds have fallen to their forces, in either direction.
   subroutine break_falling(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: stretch
      integer :: position, contact

      do position = self%list(near)%count, 1, -1
         contact = self%list(near)%contact(position)
         stretch = abs(pose%displacement - self%record(row_origin, contact)) &
            & + tiny_gap * self%stretch
         if (self%record(row_limit, contact) > stretch) cycle
         if (self%threshold(contact, pose%time) > stretch) cycle
         call self%end_life(contact)
         call self%detach(contact, pose%displacement, pose%time)
         call remove(self%list(near), position)
         call remove(self%list(falling), position_of(self%list(falling), contact))
         self%kept(contact) = in_queue
      end do
   end subroutine break_falling

end module mesoslip_contacts_ageing_falling
