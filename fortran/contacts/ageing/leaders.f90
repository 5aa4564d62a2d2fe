!> The leaders: contacts that may break next while their thresholds grow.
!>
!> The breaks of leaders are extrapolated from the motion of the slider, with a margin: its
!> acceleration and jerk follow from the law that it is offered
!> (mesoslip_contacts_ageing_prediction). A slider that arrives where a leader was expected to break
!> finds it due, or a little ahead; then its break is extrapolated again.
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

   !> Contacts that are taken out of the queue together
   integer, parameter :: max_gathered = 16
   !> Leaders that are extrapolated at once: extrapolating more costs more than a stop at the bound
   !> of the next
   integer, parameter :: max_extrapolated = 4

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

      reach = huge(1.0_wp)
      if (.not. self%jumps) reach = self%prediction%reach(pose, self%direction, end_time)
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
         if (first - position == max_extrapolated) then
            upper = key
            exit
         end if
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

   !> Coordinate at which a leader breaks by extrapolation, not beyond where it does break.
   pure function extrapolated_break(self, contact, pose) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      real(wp) :: coordinate

      real(wp) :: age, limit, rate, here, growth
      logical :: is_known

      coordinate = self%ahead_of(contact)
      if (self%life(life_motion, contact) >= any_motion) return
      if (self%jumps .and. .not. self%is_unchanged) return
      age = pose%time - self%life(life_birth, contact)
      call self%ageing%evaluate(self%life(life_limit, contact), self%mean_of(contact), age, limit, &
         & rate)
      here = self%direction * self%record(row_origin, contact) + limit
      call self%prediction%extrapolate(self%ageing, rate, age, &
         & here - self%direction * pose%displacement, self%direction * pose%velocity, &
         & self%direction, tiny_gap * self%stretch, growth, is_known)
      if (is_known) coordinate = max(coordinate, here + growth)
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
