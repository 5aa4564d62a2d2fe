!> Contacts that age under a slider that moves steadily.
!>
!> They are queued by where they break if it goes on so, whether their thresholds grow or fall,
!> which is solved once, at birth, or before that for the next lives of several contacts together.
module mesoslip_contacts_ageing_steady
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type, any_motion, falling, in_falling, &
      & in_queue, leaders, life_birth, life_limit, life_motion, near, next_configured, &
      & next_length, next_limit, next_speed, solved_together
   use mesoslip_contacts_ageing_falling, only: scan
   use mesoslip_contacts_ageing_lists, only: append
   use mesoslip_contacts_ageing_meeting, only: meet, meet_newborn
   use mesoslip_contacts_individual_births, only: drag_of
   use mesoslip_contacts_individual_record, only: row_limit, row_next, row_origin, row_stiffness, &
      & ahead_coordinate
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: begin_steady, end_steady, break_steady, queue_newborn, plan_steady, settle_steady

contains

   !> Order all for a steady motion, whether their thresholds grow or fall.
   subroutine begin_steady(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: position
      logical :: was_slower

      self%is_steady = .true.
      self%motion = self%motion + 1.0_wp
      was_slower = abs(pose%velocity) > self%speed
      self%speed = abs(pose%velocity)
      if (was_slower) then
         call self%order_all(pose)
      else
         do position = 1, self%list(leaders)%count
            call self%order(self%list(leaders)%contact(position), pose%displacement, pose%time)
            call self%put(self%list(leaders)%contact(position))
         end do
         do position = 1, self%list(falling)%count
            call self%order(self%list(falling)%contact(position), pose%displacement, pose%time)
            call self%put(self%list(falling)%contact(position))
         end do
         self%list(leaders)%count = 0
      end if
      if (self%list(falling)%count > 0) self%behind = self%max_behind()
      self%list(falling)%count = 0
      self%list(near)%count = 0
   end subroutine begin_steady

   !> Take those out of the queue that may break earlier when the motion is another.
   subroutine end_steady(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      self%is_steady = .false.
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         if (self%life(life_motion, contact) >= any_motion) cycle
         if (.not. self%ageing%falls(self%life(life_limit, contact), self%stretch)) cycle
         call append(self%list(falling), contact)
         self%kept(contact) = in_falling
      end do
      if (self%list(falling)%count == 0) return
      call self%queue%clear(self%direction, self%direction * pose%displacement)
      call scan(self, pose)
      call self%rebuild(pose%displacement)
   end subroutine end_steady

   !> Break the contacts that are due under a steady motion; others were queued for a faster one.
   subroutine break_steady(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do while (self%queue%first_key <= self%direction * pose%displacement)
         call self%queue%pop(self%record, contact)
         if (self%life(life_motion, contact) < self%motion) then
            call self%order(contact, pose%displacement, pose%time)
            if (ahead_coordinate(self%record(:, contact), self%direction) &
               & > self%direction * pose%displacement) then
               call self%put(contact)
               cycle
            end if
            call self%record_lateness(contact, pose)
         end if
         call self%detach(contact, pose%displacement, pose%time)
      end do
   end subroutine break_steady

   !> Queue a contact that is born in a steady motion.
   subroutine queue_newborn(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      real(wp) :: stretch, solved(next_length)

      stretch = self%parameters%back_force_ratio * self%stretch
      solved = self%next(:, contact)
      self%next(next_speed, contact) = 0.0_wp
      associate (life => self%life(:, contact))
         if (self%ageing%is_constant(life(life_limit), self%stretch)) then
            self%kept(contact) = in_queue
            life(life_motion) = any_motion
            return
         end if
         self%kept(contact) = in_queue
         life(life_motion) = self%motion
         if (abs(solved(next_speed) - self%speed) > 0.0_wp) then
            self%record(row_limit, contact) = meet(self%ageing, life(life_limit), self%stretch, &
               & 0.0_wp, stretch, self%speed)
         else
            self%record(row_limit, contact) = solved(next_limit)
         end if
      end associate
      call solve_later(self, contact)
   end subroutine queue_newborn

   !> Have the next life of a contact solved with those of others.
   subroutine solve_later(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%solved = self%solved + 1
      self%unsolved_count = self%unsolved_count + 1
      self%unsolved(self%unsolved_count) = contact
      if (self%unsolved_count == solved_together) call solve_next_lives(self, &
         & self%parameters%back_force_ratio * self%stretch)
   end subroutine solve_later

   !> Solve ahead where contacts will break in their next lives, if their thresholds are drawn.
   subroutine solve_next_lives(self, stretch)
      class(ageing_contacts_type), intent(inout) :: self
      !> Stretch at birth [m]
      real(wp), intent(in) :: stretch

      real(wp), dimension(solved_together) :: configured, limit
      integer :: contact(solved_together), position, number, left

      number = 0
      left = 0
      do position = 1, self%unsolved_count
         associate (one => self%unsolved(position))
            if (self%record(row_next, one) > 0.0_wp) then
               number = number + 1
               contact(number) = one
               configured(number) = self%record(row_next, one) * self%parameters%static_force &
                  & / self%parameters%stiffness
            else
               left = left + 1
               self%unsolved(left) = one
            end if
         end associate
      end do
      ! Of few contacts the same ones are there again and again: those left out are solved at birth.
      self%unsolved_count = min(left, solved_together / 2)
      call meet_newborn(self%ageing, configured(:number), self%stretch, stretch, self%speed, &
         & limit(:number))
      do position = 1, number
         self%next(:next_speed, contact(position)) = [limit(position), self%speed]
      end do
   end subroutine solve_next_lives

   !> Write a schedule of what comes next in a steady motion: the breaks at the front of the queue,
   !> up to a contact that was queued for another motion, and about as many attachments.
   subroutine plan_steady(self, pose, limit, schedule)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Maximum number of breaks, and of attachments
      integer, intent(in) :: limit
      !> The schedule; at its end if there is none
      type(schedule_type), intent(inout) :: schedule

      integer :: number, event, contact(max_events)

      call self%queue%preview(self%record, min(limit, max_events), self%listed, &
         & schedule%break_coordinate, number)
      do event = 1, number
         if (self%life(life_motion, self%listed(event)) < self%motion) exit
         schedule%break_origin(event) = self%record(row_origin, self%listed(event))
      end do
      number = event - 1
      if (number == 0) return
      schedule%break_stiffness(:number) = self%parameters%stiffness
      schedule%break_drag(:number) = drag_of(self%parameters, self%parameters%stiffness)
      schedule%breaks = number
      schedule%broken = 0
      schedule%moments = 0
      schedule%direction = self%direction
      schedule%behind = self%behind
      call self%list_attachments(min(limit, max_events, 2 * number + 4), pose%direction, &
         & schedule, contact)
      call solve_listed(self, contact(:schedule%attachments), schedule%attach_limit)
      call self%list_births(self%listed(:number), 0, pose%direction, schedule)
      if (schedule%has_births) then
         call solve_listed(self, self%listed(:number), schedule%birth_limit)
      end if
      schedule%is_over = .false.
   end subroutine plan_steady

   !> Solve where listed contacts will break that are born in a steady motion.
   subroutine solve_listed(self, contact, limit)
      class(ageing_contacts_type), intent(inout) :: self
      !> Numbers of the contacts
      integer, intent(in) :: contact(:)
      !> Their configured breaking stretches, and those at which they will break [m]
      real(wp), intent(inout) :: limit(:)

      real(wp) :: stretch
      integer :: event

      stretch = self%parameters%back_force_ratio * self%stretch
      do event = 1, size(contact)
         associate (next => self%next(:, contact(event)))
            next(next_configured) = limit(event)
            if (self%ageing%is_constant(limit(event), self%stretch)) cycle
            if (abs(next(next_speed) - self%speed) > 0.0_wp) then
               next(next_limit) = meet(self%ageing, limit(event), self%stretch, 0.0_wp, stretch, &
                  & self%speed)
               next(next_speed) = self%speed
            end if
            limit(event) = next(next_limit)
         end associate
      end do
   end subroutine solve_listed

   !> Keep the books of a schedule in a steady motion.
   subroutine settle_steady(self, schedule)
      class(ageing_contacts_type), intent(inout) :: self
      !> The schedule, as far as the slider came
      type(schedule_type), intent(in) :: schedule

      integer :: event, contact(max_events)

      call self%detach_listed(self%listed(:schedule%broken), schedule)
      if (schedule%broken > 0) call self%queue%remove_previewed(self%record, schedule%broken)
      call self%attach_listed(schedule, contact)
      do event = 1, schedule%attached
         associate (one => contact(event))
            self%life(life_birth, one) = schedule%attach_time(event)
            self%life(life_limit, one) = self%next(next_configured, one)
            self%life(life_motion, one) = self%motion
            if (self%ageing%is_constant(self%life(life_limit, one), self%stretch)) then
               self%life(life_motion, one) = any_motion
            end if
            self%next(next_speed, one) = 0.0_wp
            call self%put(one)
            self%behind = max(self%behind, self%behind_at(one, schedule%attach_time(event)))
         end associate
      end do
      ! Not before all are queued: what is known of one that is not would be of the life after it.
      do event = 1, schedule%attached
         if (self%life(life_motion, contact(event)) < any_motion) then
            call solve_later(self, contact(event))
         end if
      end do
   end subroutine settle_steady

end module mesoslip_contacts_ageing_steady
