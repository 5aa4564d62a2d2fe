!> The leaders: contacts that may break next while their thresholds grow.
!>
!> The breaks of leaders are extrapolated from the motion of the slider, with a margin: its
!> acceleration and jerk follow from the law that it is offered
!> (mesoslip_motion_prediction). A slider that arrives where a leader was expected to break
!> finds it due, or a little ahead; then its break is extrapolated again.
module mesoslip_contacts_ageing_leaders
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type, any_motion, append, in_leaders, &
      & in_queue, leaders, life_birth, life_limit, life_motion, tiny_gap
   use mesoslip_contacts_ageing_falling, only: add_falling
   use mesoslip_contacts_individual_sorting, only: before
   use mesoslip_contacts_individual_record, only: row_limit, row_origin
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_schedule, only: max_events
   implicit none
   private

   public :: bound_leaders, break_leaders, gather_leaders, sort_leaders, add_leader, remove_leader

   !> Spacings of contacts with evenly spread thresholds within which they are taken out of the
   !> queue together: minimum, as many as there are leaders, and maximum, which narrow thresholds
   !> reach; and contacts in them at most, more than a bucket of the queue has
   integer, parameter :: min_gathered = 16, max_gathered = 256, crowding = 4

contains

   !> Bound a window by the breaks of the leaders and of the queue.
   subroutine bound_leaders(self, pose, upper, end_time)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Coordinate before which no contact breaks [m], until a time [s]
      real(wp), intent(inout) :: upper, end_time

      real(wp) :: reach

      reach = huge(1.0_wp)
      if (.not. self%jumps) then
         call self%prediction%limit_time(pose, end_time)
         reach = self%prediction%reach(pose, self%direction, end_time)
      end if
      do
         call extrapolate_first(self, pose, reach, upper)
         if (.not. self%queue%first_key < min(upper, reach)) exit
         call gather(self, pose)
      end do
      upper = min(upper, self%queue%first_key)
   end subroutine bound_leaders

   !> Extrapolate the breaks of the leaders that may break next. The same rule as look_ahead of a
   !> schedule, so that results agree to the bit.
   subroutine extrapolate_first(self, pose, reach, upper)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Coordinate that the slider does not reach in the window [m]
      real(wp), intent(in) :: reach
      !> Coordinate before which no leader breaks [m]
      real(wp), intent(inout) :: upper

      integer :: position, contact
      real(wp) :: meeting

      do position = self%list(leaders)%count, 1, -1
         if (.not. self%leader_key(position) < min(upper, reach)) then
            upper = min(upper, self%leader_key(position))
            exit
         end if
         contact = self%list(leaders)%contact(position)
         if (self%is_falling(contact)) then
            call remove_leader(self, position)
            call add_falling(self, contact)
            cycle
         end if
         call extrapolate(self, contact, pose, meeting)
         self%leader_key(position) = self%ahead_of(contact)
         upper = min(upper, meeting)
      end do
      call self%count_visits(self%list(leaders)%count - position)
      call sort_leaders(self, position + 1)
   end subroutine extrapolate_first

   !> Make leaders of the first contacts of the queue, for a schedule.
   subroutine gather_leaders(self, pose, number)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Number of leaders before the queue that is enough
      integer, intent(in) :: number

      integer :: surplus, position

      surplus = self%list(leaders)%count - 2 * max_events
      if (surplus > 0) then
         do position = 1, surplus
            call self%put(self%list(leaders)%contact(position))
         end do
         self%list(leaders)%contact(:2 * max_events) = &
            & self%list(leaders)%contact(surplus + 1:surplus + 2 * max_events)
         self%leader_key(:2 * max_events) = self%leader_key(surplus + 1:surplus + 2 * max_events)
         self%list(leaders)%count = 2 * max_events
      end if
      do while (self%queue%first_key < huge(1.0_wp))
         associate (count => self%list(leaders)%count)
            if (count >= number) then
               if (self%leader_key(count - number + 1) < self%queue%first_key) exit
            end if
         end associate
         call gather(self, pose)
      end do
   end subroutine gather_leaders

   !> Make leaders of the first contacts of the queue, with their present thresholds as limits.
   subroutine gather(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: wanted, number, added, position, contact(crowding * max_gathered)
      real(wp) :: last

      wanted = max(min_gathered, min(max_gathered, self%list(leaders)%count))
      last = self%queue%first_key + wanted * self%stretch / self%parameters%count
      call self%queue%take(self%record, last, contact(:crowding * wanted), number)
      call self%count_visits(number)
      ! Apart from the next loop: its branches would wait for each of them.
      do position = 1, number
         if (self%life(life_motion, contact(position)) < any_motion) then
            call self%solve(contact(position), pose%displacement, pose%time)
         end if
      end do
      added = 0
      do position = 1, number
         if (self%ahead_of(contact(position)) <= last) then
            added = added + 1
            contact(added) = contact(position)
         else
            call self%put(contact(position))
         end if
      end do
      ! Most are beyond all leaders.
      associate (list => self%list(leaders))
         list%contact(added + 1:added + list%count) = list%contact(:list%count)
         self%leader_key(added + 1:added + list%count) = self%leader_key(:list%count)
         list%count = added + list%count
         do position = 1, added
            list%contact(added + 1 - position) = contact(position)
            self%leader_key(added + 1 - position) = self%ahead_of(contact(position))
            self%kept(contact(position)) = in_leaders
         end do
      end associate
      call sort_leaders(self, 2)
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

   !> Sort the leaders from a position on, whose keys have grown.
   subroutine sort_leaders(self, first)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: first

      integer :: position

      do position = first, self%list(leaders)%count
         call sort_leader(self, position)
      end do
   end subroutine sort_leaders

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

   !> Set the limit of a leader to its present threshold, and find where the slider meets that, or
   !> before.
   subroutine extrapolate(self, contact, pose, meeting)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      !> The coordinate [m]
      real(wp), intent(out) :: meeting

      meeting = self%ahead_of(contact)
      if (self%life(life_motion, contact) >= any_motion) return
      call self%prediction%meet(self%ageing, self%life(life_limit, contact), &
         & self%mean_of(contact), pose%time - self%life(life_birth, contact), &
         & self%direction * self%record(row_origin, contact), pose, self%direction, &
         & tiny_gap * self%stretch, self%record(row_limit, contact), meeting)
      if (self%jumps .and. .not. self%is_unchanged) meeting = self%ahead_of(contact)
   end subroutine extrapolate

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
         if (self%is_falling(contact)) then
            call remove_leader(self, position)
            call add_falling(self, contact)
         else
            call self%refresh(contact, pose%time)
            self%leader_key(position) = self%ahead_of(contact)
         end if
      end do
      call sort_leaders(self, position + 1)
      do position = self%list(leaders)%count, 1, -1
         if (.not. self%leader_key(position) < reached) exit
         contact = self%list(leaders)%contact(position)
         if (.not. self%is_due(contact, pose)) exit
         call self%record_lateness(contact, pose)
         call remove_leader(self, position)
         self%kept(contact) = in_queue
         call self%end_life(contact)
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
