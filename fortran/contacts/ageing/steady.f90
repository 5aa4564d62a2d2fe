!> Contacts that age under a slider that moves steadily.
!>
!> They are queued by where they break if the motion continues, whether their thresholds grow or
!> fall. That is solved once, at birth, or before it for several contacts together.
module mesoslip_contacts_ageing_steady
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type, any_motion, falling, in_queue, &
      & life_limit, life_motion, next_limit, next_speed, solved_together
   use mesoslip_contacts_ageing_meeting, only: meet, meet_newborn
   use mesoslip_contacts_individual_record, only: row_limit, row_next, row_origin, row_stiffness
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_schedule, only: schedule_type
   implicit none
   private

   public :: begin_steady, break_steady, queue_newborn, list_steady, solve_listed, solve_attached

contains

   !> Queue all contacts for a steady motion, whether their thresholds grow or fall.
   subroutine begin_steady(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      self%is_steady = .true.
      self%motion = self%motion + 1.0_wp
      if (abs(pose%velocity) > self%speed .or. .not. self%speed < huge(1.0_wp)) then
         self%speed = abs(pose%velocity)
         call self%solve_all(pose)
      else
         ! A slower slider meets thresholds that fall earlier.
         self%speed = abs(pose%velocity)
         do contact = 1, self%parameters%count
            if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
            if (self%kept(contact) == in_queue) then
               if (.not. self%is_falling(contact)) cycle
               call self%queue%remove(self%record, contact)
            end if
            call self%solve(contact, pose%displacement, pose%time)
            call self%put(contact)
         end do
      end if
      if (self%list(falling)%count > 0) self%behind = self%max_behind()
      self%list%count = 0
   end subroutine begin_steady

   !> Break the contacts that are due; those queued for a faster motion are solved again before.
   subroutine break_steady(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do while (self%queue%first_key <= self%direction * pose%displacement)
         call self%queue%pop(self%record, contact)
         if (self%life(life_motion, contact) < self%motion) then
            call self%solve(contact, pose%displacement, pose%time)
            if (self%ahead_of(contact) > self%direction * pose%displacement) then
               call self%put(contact)
               cycle
            end if
            call self%record_lateness(contact, pose)
         end if
         call self%end_life(contact)
         call self%detach(contact, pose%displacement, pose%time)
      end do
   end subroutine break_steady

   !> Begin the life of a contact that is born in a steady motion.
   subroutine queue_newborn(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%kept(contact) = in_queue
      associate (life => self%life(:, contact), next => self%next(:, contact))
         if (self%ageing%is_constant(life(life_limit), self%mean_of(contact))) then
            life(life_motion) = any_motion
            next(next_speed) = 0.0_wp
            return
         end if
         life(life_motion) = self%motion
         if (abs(next(next_speed) - self%speed) > 0.0_wp &
            & .or. self%parameters%strength%is_used .or. self%parameters%keeps_thresholds) then
            next(next_limit) = newborn_limit(self, life(life_limit), self%mean_of(contact))
         end if
         self%record(row_limit, contact) = next(next_limit)
         next(next_speed) = 0.0_wp
      end associate
      call solve_later(self, contact)
   end subroutine queue_newborn

   !> Limit of a contact with a configured breaking stretch [m] that is born in the steady motion,
   !> given the mean one there.
   pure function newborn_limit(self, configured, mean) result(limit)
      class(ageing_contacts_type), intent(in) :: self
      real(wp), intent(in) :: configured, mean
      real(wp) :: limit

      real(wp) :: stretch

      stretch = self%parameters%back_force_ratio * self%stretch
      if (self%parameters%keeps_thresholds) stretch = self%parameters%back_force_ratio &
         & * self%ageing%newborn_threshold(configured, mean)
      limit = meet(self%ageing, configured, mean, 0.0_wp, stretch, self%speed)
   end function newborn_limit

   !> Have the next limit of a contact solved with those of others.
   subroutine solve_later(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      ! With a track, limits depend on where contacts attach.
      if (self%parameters%strength%is_used .or. self%parameters%keeps_thresholds) return
      self%unsolved_count = self%unsolved_count + 1
      self%unsolved(self%unsolved_count) = contact
      if (self%unsolved_count == solved_together) call solve_next_lives(self)
   end subroutine solve_later

   !> Solve the next limits of contacts whose next thresholds are drawn.
   subroutine solve_next_lives(self)
      class(ageing_contacts_type), intent(inout) :: self

      real(wp), dimension(solved_together) :: configured, limit
      integer :: contact(solved_together), position, number, remaining

      number = 0
      remaining = 0
      do position = 1, self%unsolved_count
         associate (one => self%unsolved(position))
            if (self%record(row_next, one) > 0.0_wp) then
               number = number + 1
               contact(number) = one
               configured(number) = self%record(row_next, one) * self%parameters%static_force &
                  & / self%parameters%stiffness
            else
               remaining = remaining + 1
               self%unsolved(remaining) = one
            end if
         end associate
      end do
      ! Few contacts would fill the list again and again: those dropped are solved at birth.
      self%unsolved_count = min(remaining, solved_together / 2)
      call meet_newborn(self%ageing, configured(:number), self%stretch, &
         & self%parameters%back_force_ratio * self%stretch, self%speed, limit(:number))
      do position = 1, number
         self%next(:next_speed, contact(position)) = [limit(position), self%speed]
      end do
   end subroutine solve_next_lives

   !> List the breaks at the front of the queue, up to a contact that was queued for another motion.
   subroutine list_steady(self, limit, schedule, number)
      class(ageing_contacts_type), intent(inout) :: self
      !> Maximum number of breaks
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule
      integer, intent(out) :: number

      integer :: event

      call self%queue%preview(self%record, limit, self%listed, schedule%break_coordinate, number)
      do event = 1, number
         if (self%life(life_motion, self%listed(event)) < self%motion) exit
         schedule%break_entry(event) = event
         schedule%break_origin(event) = self%record(row_origin, self%listed(event))
      end do
      number = event - 1
   end subroutine list_steady

   !> Replace the configured breaking stretches of contacts by their limits in the next life [m].
   subroutine solve_listed(self, contact, limit)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact(:)
      real(wp), intent(inout) :: limit(:)

      integer :: event

      do event = 1, size(contact)
         associate (next => self%next(:, contact(event)))
            if (self%ageing%is_constant(limit(event), self%stretch)) cycle
            if (abs(next(next_speed) - self%speed) > 0.0_wp) then
               next(next_limit) = newborn_limit(self, limit(event), self%stretch)
               next(next_speed) = self%speed
            end if
            limit(event) = next(next_limit)
         end associate
      end do
   end subroutine solve_listed

   !> Have the next limits of contacts that have attached in a schedule solved, after all are
   !> queued, because that discards a solved next limit.
   subroutine solve_attached(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact(:)

      integer :: event

      do event = 1, size(contact)
         if (self%life(life_motion, contact(event)) < any_motion) then
            call solve_later(self, contact(event))
         end if
      end do
   end subroutine solve_attached

end module mesoslip_contacts_ageing_steady
