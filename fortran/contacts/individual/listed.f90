!> What contacts write into a schedule of attachments, and what they note after it.
!>
!> Each kind lists its breaks itself, as it sorts its contacts in its own way.
module mesoslip_contacts_individual_listed
   use mesoslip_contacts_individual_base, only: individual_contacts_type
   use mesoslip_contacts_individual_births, only: bear
   use mesoslip_contacts_individual_record, only: row_limit, row_next, row_origin, row_renewal, &
      & row_stiffness
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: list_attachments, list_births, detach_listed, attach_listed

contains

   !> List the next contacts to attach in a schedule, up to a maximum number.
   subroutine list_attachments(self, limit, direction, schedule, contact)
      !> The contacts
      class(individual_contacts_type), intent(inout) :: self
      !> Maximum number
      integer, intent(in) :: limit
      !> Sign of the velocity at which they attach
      real(wp), intent(in) :: direction
      !> The schedule
      type(schedule_type), intent(inout) :: schedule
      !> Their numbers
      integer, intent(out) :: contact(max_events)

      integer :: number, event
      real(wp) :: back_force, force

      call self%detached%preview(limit, number, contact, schedule%attach_time, &
         & schedule%attach_drag)
      call self%draw_births(contact(:number))
      back_force = direction * self%parameters%back_force_ratio * self%parameters%static_force
      do event = 1, number
         call bear(self%parameters, self%record(row_next, contact(event)), &
            & schedule%attach_stiffness(event), schedule%attach_limit(event))
         schedule%attach_stretch(event) = back_force / schedule%attach_stiffness(event)
      end do
      if (allocated(self%births%force)) then
         do event = 1, number
            force = self%birth_force(contact(event), back_force, direction)
            schedule%attach_stretch(event) = force / schedule%attach_stiffness(event)
         end do
      end if
      schedule%attachments = number
      schedule%attached = 0
      schedule%delay = self%parameters%delay
      if (.not. self%parameters%reattach) schedule%delay = huge(1.0_wp)
      schedule%stiffness = self%stiffness
      schedule%offset = self%offset
      schedule%drag = self%drag
      schedule%detached = self%detached%count
      schedule%pinned = self%parameters%count - self%detached%count
   end subroutine list_attachments

   !> List the next births of the contacts that break in a schedule, if they may attach in it.
   subroutine list_births(self, contact, direction, schedule)
      !> The contacts
      class(individual_contacts_type), intent(inout) :: self
      !> Numbers of those that are listed to break
      integer, intent(in) :: contact(:)
      !> Sign of the velocity at which they attach
      real(wp), intent(in) :: direction
      !> The schedule
      type(schedule_type), intent(inout) :: schedule

      real(wp) :: back_force, force
      integer :: event

      schedule%has_births = self%parameters%reattach .and. (allocated(self%births%delay) &
         & .or. .not. self%parameters%delay > 0.0_wp)
      if (.not. schedule%has_births) return
      call self%draw_births(contact)
      back_force = direction * self%parameters%back_force_ratio * self%parameters%static_force
      do event = 1, size(contact)
         call bear(self%parameters, self%record(row_next, contact(event)), &
            & schedule%birth_stiffness(event), schedule%birth_limit(event))
         force = self%birth_force(contact(event), back_force, direction)
         schedule%birth_stretch(event) = force / schedule%birth_stiffness(event)
         schedule%birth_delay(event) = self%parameters%delay
      end do
      if (.not. allocated(self%births%delay)) return
      do event = 1, size(contact)
         schedule%birth_delay(event) = self%births%delay(contact(event))
      end do
   end subroutine list_births

   !> Update records and sums for the contacts that broke in a schedule.
   subroutine detach_listed(self, contact, schedule)
      !> The contacts
      class(individual_contacts_type), intent(inout) :: self
      !> Numbers of the contacts that broke, in their order
      integer, intent(in) :: contact(:)
      !> The schedule
      type(schedule_type), intent(in) :: schedule

      integer :: event
      real(wp) :: delay

      delay = self%parameters%delay
      do event = 1, schedule%broken
         if (allocated(self%births%delay)) delay = self%births%delay(contact(event))
         self%record(row_stiffness, contact(event)) = 0.0_wp
         self%record(row_renewal, contact(event)) = self%record(row_renewal, contact(event)) &
            & + 1.0_wp
         call self%break_loss%add(0.5_wp * schedule%break_stiffness(event) &
            * (schedule%break_displacement(event) - schedule%break_origin(event))**2)
         call self%detached%push(contact(event), &
            & schedule%break_time(event) + delay, schedule%break_drag(event))
      end do
      self%breaks = self%breaks + schedule%broken
      self%stiffness = schedule%stiffness
      self%offset = schedule%offset
      self%drag = schedule%drag
   end subroutine detach_listed

   !> Update records and sums for the contacts that attached in a schedule.
   subroutine attach_listed(self, schedule, contact)
      !> The contacts; those that broke are detached
      class(individual_contacts_type), intent(inout) :: self
      !> The schedule
      type(schedule_type), intent(in) :: schedule
      !> Numbers of the contacts that attached, in their order
      integer, intent(out) :: contact(:)

      integer :: event
      real(wp) :: drag

      do event = 1, schedule%attached
         call self%detached%pop(contact(event), drag)
         associate (record => self%record(:, contact(event)))
            record(row_origin) = schedule%attach_displacement(event) &
               & - schedule%attach_stretch(event)
            record(row_stiffness) = schedule%attach_stiffness(event)
            record(row_limit) = schedule%attach_limit(event)
            call self%birth_gain%add(0.5_wp * record(row_stiffness) &
               & * (schedule%attach_displacement(event) - record(row_origin))**2)
         end associate
         call self%births%request(contact(event), self%parameters, self%record)
      end do
   end subroutine attach_listed

end module mesoslip_contacts_individual_listed
