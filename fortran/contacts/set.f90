!> N contacts one by one: their records and random numbers, how one lets go and takes hold.
!>
!> The earthquake-like model but for the order in which contacts break, which is left to those who
!> extend it. Displacements are relative to an origin that the caller moves along.
module mesoslip_contacts_set
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory
   use mesoslip_contacts_avalanche_track, only: avalanche_track_type, new_avalanche_track, &
      & row_generation
   use mesoslip_numerics_random, only: uniform_pairs
   use mesoslip_interface_law, only: interface_law_type
   use mesoslip_schedule, only: max_events, schedule_type
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type, exchange_contacts, &
      & extent_length
   use mesoslip_contacts_carried_law, only: carried_law_type, new_carried_law
   use mesoslip_contacts_mechanics, only: coupling_scaled, initial_steady, initial_uniform
   use mesoslip_contacts_record, only: record_length, row_limit, row_next, row_origin, &
      & row_renewal, row_stiffness
   implicit none
   private

   public :: contact_set_type, drag_of, exchange_set, law_set, snapshot_set
   public :: detached_length

   !> Numbers kept for a detached contact
   integer, parameter :: detached_length = 2
   !> When it attaches again [s]
   integer, parameter :: row_due = 1
   !> Its drag while it is detached [N s/m]
   integer, parameter :: row_drag = 2

   !> Draws that are made together
   integer, parameter :: draws_together = 32

   !> N contacts one by one.
   type, abstract, extends(contacts_type) :: contact_set_type
      !> Records of the contacts, shape (record_length, count)
      real(wp), allocatable :: record(:, :)
      !> A ring of detached contacts in the order of attaching, shape (detached_length, count)
      real(wp), allocatable :: detached(:, :)
      !> Numbers of the contacts in that ring, shape (count)
      integer, allocatable :: detached_contact(:)
      !> Time at which the next contact attaches; huge when there is none [s]
      real(wp) :: next_attachment = huge(1.0_wp)
      !> Totals of stiffness and of stiffness times origin of the pinned, of drag of the detached
      type(accumulator_type) :: stiffness, offset, drag
      !> Contacts of the present avalanche
      type(avalanche_track_type) :: track
      !> Number of contacts that are detached, and their first place in the ring
      integer :: waiting = 0, first_detached = 0
      !> Contacts whose next thresholds are still to be drawn: their keys in draws, which count
      !> contacts from 0, and their renewals then
      integer, private :: undrawn_count = 0
      integer(i8), private :: undrawn(draws_together) = 0_i8, undrawn_renewal(draws_together) = 0_i8
   contains
      procedure :: law => law_set
      procedure :: elastic_energy
      procedure :: snapshot => snapshot_set
      procedure :: followed
      procedure :: records
      procedure :: take_extent
      !> Make room for the contacts
      procedure, non_overridable :: allocate_records
      !> Draw all contacts for the start of a run
      procedure, non_overridable :: draw
      !> What happens to a contact that breaks
      procedure, non_overridable :: let_go
      !> Attach the contact that broke first
      procedure, non_overridable :: take_hold
      !> Sum stiffness and offset anew, from the records
      procedure, non_overridable :: bear
      !> Stiffness, breaking stretch and drag of the next contacts to attach, and their times
      procedure, non_overridable :: list_attachments
      !> Keep the books of a schedule, but for the order of breaking
      procedure, non_overridable :: let_go_listed
      procedure, non_overridable :: take_hold_listed
      procedure, non_overridable, private :: draw_next, draw_undrawn
      !> Move all origins
      procedure, non_overridable :: shift_records
   end type contact_set_type

contains

   !> Make room for the contacts, and for their avalanches if they are on a lattice.
   subroutine allocate_records(self, columns, rows, error)
      !> The contacts, their parameters set
      class(contact_set_type), intent(inout) :: self
      !> Columns and rows of the lattice; no columns when contacts are not on one
      integer, intent(in) :: columns, rows
      !> Set if there is not enough memory, or the lattice does not hold the contacts
      type(error_type), allocatable, intent(out) :: error

      integer :: stat

      if (columns > 0 .and. columns * rows /= self%parameters%count) then
         call raise(error, status_invalid, "columns times rows of the lattice must be the number " &
            & // "of contacts")
         return
      end if
      associate (count => self%parameters%count)
         allocate (self%record(record_length, count), stat=stat)
         if (stat == 0) allocate (self%detached(detached_length, count), stat=stat)
         if (stat == 0) allocate (self%detached_contact(count), stat=stat)
      end associate
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the contacts")
         return
      end if
      self%record = 0.0_wp
      self%detached = 0.0_wp
      self%detached_contact = 0
      call new_avalanche_track(self%track, columns, rows, error)
   end subroutine allocate_records

   !> Draw all contacts for the start of a run.
   subroutine draw(self, state)
      !> The contacts
      class(contact_set_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      integer :: drawn, number, place, contact
      integer(i8) :: name(draws_together), renewal(draws_together)
      real(wp) :: first(draws_together), second(draws_together), threshold(draws_together)
      real(wp) :: stiffness, limit, back, stretch
      type(carried_law_type) :: carried

      if (state == initial_steady) call new_carried_law(carried, self%parameters%law, &
         & self%parameters%coupling, self%parameters%back_force_ratio)
      renewal = 0_i8
      do drawn = 0, self%parameters%count - 1, draws_together
         number = min(draws_together, self%parameters%count - drawn)
         do place = 1, number
            name(place) = int(drawn + place - 1, i8)
         end do
         call uniform_pairs(self%parameters%seed, self%parameters%realization, name(:number), &
            & renewal(:number), first(:number), second(:number))
         if (state == initial_steady) then
            do place = 1, number
               threshold(place) = carried%quantile(first(place))
            end do
         else
            call self%parameters%law%quantiles(first(:number), threshold(:number))
         end if

         do place = 1, number
            contact = drawn + place
            call born(self%parameters, threshold(place), stiffness, limit)
            select case (state)
            case (initial_steady)
               back = self%parameters%back_force_ratio * self%parameters%static_force / stiffness
               stretch = back + second(place) * (limit - back)
            case (initial_uniform)
               stretch = second(place) * limit
            case default
               stretch = 0.0_wp
            end select
            self%record(row_origin, contact) = -stretch
            self%record(row_stiffness, contact) = stiffness
            self%record(row_limit, contact) = limit
            self%record(row_renewal, contact) = 0.0_wp
            call self%draw_next(contact, 1.0_wp)
         end do
      end do
      call self%bear()
   end subroutine draw

   !> Contact force as a law.
   pure function law_set(self) result(law)
      !> The contacts
      class(contact_set_type), intent(in) :: self
      !> The law that holds until a contact breaks or attaches
      type(interface_law_type) :: law

      law%stiffness = self%stiffness%total()
      law%offset = self%offset%total()
      law%drag = self%drag%total()
   end function law_set

   !> What happens to a contact that breaks: it leaves its force, and waits to attach again.
   subroutine let_go(self, contact, displacement, time)
      !> The contacts
      class(contact_set_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Displacement [m] and time [s]
      real(wp), intent(in) :: displacement, time

      integer :: place
      real(wp) :: stiffness, origin, drag

      associate (record => self%record(:, contact))
         origin = record(row_origin)
         stiffness = record(row_stiffness)
         record(row_stiffness) = 0.0_wp
         record(row_renewal) = record(row_renewal) + 1.0_wp
      end associate

      drag = drag_of(self%parameters, stiffness)
      call self%break_loss%add(0.5_wp * stiffness * (displacement - origin)**2)
      call self%stiffness%add(-stiffness)
      call self%offset%add(-stiffness * origin)
      if (drag > 0.0_wp) call self%drag%add(drag)
      self%breaks = self%breaks + 1.0_wp
      call self%track%add(contact)

      place = self%first_detached + self%waiting
      if (place >= self%parameters%count) place = place - self%parameters%count
      self%waiting = self%waiting + 1
      if (self%waiting == self%parameters%count) then
         self%stiffness = accumulator_type()
         self%offset = accumulator_type()
      end if
      self%detached_contact(place + 1) = contact
      self%detached(row_due, place + 1) = time + self%parameters%delay
      self%detached(row_drag, place + 1) = drag
      if (self%waiting == 1 .and. self%parameters%reattach) then
         self%next_attachment = self%detached(row_due, place + 1)
      end if
   end subroutine let_go

   !> Attach the contact that broke first.
   subroutine take_hold(self, displacement, force, bond, contact)
      !> The contacts
      class(contact_set_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Force that the contact bears when it attaches, and that of its neighbours on it [N]
      real(wp), intent(in) :: force
      !> Stiffness of its bonds to its neighbours [N/m]
      real(wp), intent(in) :: bond
      !> Number of the contact
      integer, intent(out) :: contact

      integer :: place
      real(wp) :: stiffness, limit, origin

      place = self%first_detached + 1
      contact = self%detached_contact(place)
      if (.not. self%record(row_next, contact) > 0.0_wp) call self%draw_undrawn()
      call born(self%parameters, self%record(row_next, contact), stiffness, limit)
      origin = displacement - force / (stiffness + bond)

      call self%drag%add(-self%detached(row_drag, place))
      self%waiting = self%waiting - 1
      self%first_detached = place
      if (place == self%parameters%count) self%first_detached = 0
      self%next_attachment = huge(1.0_wp)
      if (self%waiting > 0) then
         self%next_attachment = self%detached(row_due, self%first_detached + 1)
      else
         self%drag = accumulator_type()
      end if

      call self%birth_gain%add(0.5_wp * stiffness * (displacement - origin)**2)
      call self%stiffness%add(stiffness)
      call self%offset%add(stiffness * origin)
      associate (record => self%record(:, contact))
         record(row_origin) = origin
         record(row_stiffness) = stiffness
         record(row_limit) = limit
         call self%draw_next(contact, record(row_renewal) + 1.0_wp)
      end associate
   end subroutine take_hold

   !> See to it that the threshold of a contact at its next birth is drawn, with those of others.
   subroutine draw_next(self, contact, renewal)
      class(contact_set_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> How often it will have been born again then
      real(wp), intent(in) :: renewal

      ! No threshold is zero: this one is still to be drawn.
      self%record(row_next, contact) = 0.0_wp
      self%undrawn_count = self%undrawn_count + 1
      self%undrawn(self%undrawn_count) = int(contact - 1, i8)
      self%undrawn_renewal(self%undrawn_count) = int(renewal, i8)
      if (self%undrawn_count == draws_together) call self%draw_undrawn()
   end subroutine draw_next

   !> Draw the thresholds that are still to be drawn.
   subroutine draw_undrawn(self)
      class(contact_set_type), intent(inout) :: self

      integer :: place
      real(wp) :: first(draws_together), second(draws_together), threshold(draws_together)

      associate (count => self%undrawn_count)
         call uniform_pairs(self%parameters%seed, self%parameters%realization, &
            & self%undrawn(:count), self%undrawn_renewal(:count), first(:count), second(:count))
         call self%parameters%law%quantiles(first(:count), threshold(:count))
         do place = 1, count
            self%record(row_next, self%undrawn(place) + 1_i8) = threshold(place)
         end do
         count = 0
      end associate
   end subroutine draw_undrawn

   !> List the next contacts to attach in a schedule, up to a number.
   subroutine list_attachments(self, most, sense, schedule)
      !> The contacts
      class(contact_set_type), intent(inout) :: self
      !> Greatest number
      integer, intent(in) :: most
      !> Sign of the velocity at which they attach
      real(wp), intent(in) :: sense
      !> The schedule
      type(schedule_type), intent(inout) :: schedule

      integer :: number, event, place, contact
      real(wp) :: threshold(max_events), back_force

      number = 0
      schedule%attach_time(1) = huge(1.0_wp)
      if (self%parameters%reattach) then
         number = min(most, self%waiting)
         place = self%first_detached
         do event = 1, number
            contact = self%detached_contact(place + 1)
            if (.not. self%record(row_next, contact) > 0.0_wp) call self%draw_undrawn()
            threshold(event) = self%record(row_next, contact)
            schedule%attach_time(event) = self%detached(row_due, place + 1)
            schedule%attach_drag(event) = self%detached(row_drag, place + 1)
            place = place + 1
            if (place == self%parameters%count) place = 0
         end do
         schedule%attach_time(number + 1) = huge(1.0_wp)
         if (self%waiting > number) then
            schedule%attach_time(number + 1) = self%detached(row_due, place + 1)
         end if
      end if
      back_force = sense * self%parameters%back_force_ratio * self%parameters%static_force
      do event = 1, number
         call born(self%parameters, threshold(event), schedule%attach_stiffness(event), &
            & schedule%attach_limit(event))
         schedule%attach_stretch(event) = back_force / schedule%attach_stiffness(event)
      end do
      schedule%attachments = number
      schedule%attached = 0
      schedule%delay = self%parameters%delay
      if (.not. self%parameters%reattach) schedule%delay = huge(1.0_wp)
      schedule%stiffness = self%stiffness
      schedule%offset = self%offset
      schedule%drag = self%drag
      schedule%detached = self%waiting
      schedule%pinned = self%parameters%count - self%waiting
   end subroutine list_attachments

   !> Keep the books of the contacts of a schedule that broke.
   subroutine let_go_listed(self, contact, schedule)
      !> The contacts
      class(contact_set_type), intent(inout) :: self
      !> Numbers of those that broke, in their order
      integer, intent(in) :: contact(:)
      !> The schedule
      type(schedule_type), intent(in) :: schedule

      integer :: event, place

      place = self%first_detached + self%waiting
      do event = 1, schedule%broken
         if (place >= self%parameters%count) place = place - self%parameters%count
         self%record(row_stiffness, contact(event)) = 0.0_wp
         self%record(row_renewal, contact(event)) = self%record(row_renewal, contact(event)) &
            & + 1.0_wp
         call self%break_loss%add(0.5_wp * schedule%break_stiffness(event) &
            & * (schedule%break_displacement(event) - schedule%break_origin(event))**2)
         self%detached_contact(place + 1) = contact(event)
         self%detached(row_due, place + 1) = schedule%break_time(event) + self%parameters%delay
         self%detached(row_drag, place + 1) = schedule%break_drag(event)
         place = place + 1
      end do
      self%breaks = self%breaks + schedule%broken
      self%waiting = self%waiting + schedule%broken
      self%stiffness = schedule%stiffness
      self%offset = schedule%offset
      self%drag = schedule%drag
   end subroutine let_go_listed

   !> Keep the books of the contacts of a schedule that attached.
   subroutine take_hold_listed(self, schedule, contact)
      !> The contacts, those that broke having let go
      class(contact_set_type), intent(inout) :: self
      !> The schedule
      type(schedule_type), intent(in) :: schedule
      !> Numbers of those that attached, in their order
      integer, intent(out) :: contact(:)

      integer :: event

      do event = 1, schedule%attached
         contact(event) = self%detached_contact(self%first_detached + 1)
         self%first_detached = self%first_detached + 1
         if (self%first_detached == self%parameters%count) self%first_detached = 0
         associate (record => self%record(:, contact(event)))
            record(row_origin) = schedule%attach_displacement(event) &
               & - schedule%attach_stretch(event)
            record(row_stiffness) = schedule%attach_stiffness(event)
            record(row_limit) = schedule%attach_limit(event)
            call self%birth_gain%add(0.5_wp * record(row_stiffness) &
               & * (schedule%attach_displacement(event) - record(row_origin))**2)
            call self%draw_next(contact(event), record(row_renewal) + 1.0_wp)
         end associate
      end do
      self%waiting = self%waiting - schedule%attached
      self%next_attachment = huge(1.0_wp)
      if (self%waiting > 0 .and. self%parameters%reattach) then
         self%next_attachment = self%detached(row_due, self%first_detached + 1)
      end if
   end subroutine take_hold_listed

   !> Drag of a contact while it is detached.
   pure function drag_of(parameters, stiffness) result(drag)
      !> What the contacts are made of
      type(contact_parameters_type), intent(in) :: parameters
      !> Stiffness of the contact [N/m]
      real(wp), intent(in) :: stiffness
      !> Drag [N s/m]
      real(wp) :: drag

      drag = parameters%drag
      if (drag > 0.0_wp .and. parameters%coupling == coupling_scaled) then
         drag = drag * (stiffness / parameters%stiffness)**2
      end if
   end function drag_of

   !> Move all origins.
   subroutine shift_records(self, shift)
      !> The contacts
      class(contact_set_type), intent(inout) :: self
      !> Displacement of the new origin of displacements [m]
      real(wp), intent(in) :: shift

      integer :: contact

      do contact = 1, self%parameters%count
         self%record(row_origin, contact) = self%record(row_origin, contact) - shift
      end do
      call self%bear()
   end subroutine shift_records

   !> Contacts and extent of the avalanche that is over, and forget it.
   subroutine take_extent(self, extent)
      !> The contacts
      class(contact_set_type), intent(inout) :: self
      !> Contacts that broke, columns and rows around them, generations; 0 without a lattice
      integer, intent(out) :: extent(extent_length)

      extent(1) = self%track%area
      call self%track%extent(extent(2), extent(3))
      extent(4) = self%track%generation
      call self%track%clear()
   end subroutine take_extent

   !> How the contacts are.
   pure subroutine snapshot_set(self, displacement, values)
      !> The contacts
      class(contact_set_type), intent(in) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Of each contact its stretch, huge if it is detached [m], force over threshold, and
      !> generation in the present avalanche, shape (snapshot_length, count)
      real(wp), intent(out) :: values(:, :)

      integer :: contact

      do contact = 1, self%parameters%count
         values(:, contact) = [huge(1.0_wp), 0.0_wp, 0.0_wp]
         if (self%track%columns > 0) then
            values(3, contact) = real(self%track%contact(row_generation, contact), wp)
         end if
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         values(1, contact) = displacement - self%record(row_origin, contact)
         values(2, contact) = values(1, contact) / self%record(row_limit, contact)
      end do
   end subroutine snapshot_set

   !> Sum stiffness and offset anew, from the records.
   subroutine bear(self)
      class(contact_set_type), intent(inout) :: self

      integer :: contact

      self%stiffness = accumulator_type()
      self%offset = accumulator_type()
      do contact = 1, self%parameters%count
         call self%stiffness%add(self%record(row_stiffness, contact))
         call self%offset%add(self%record(row_stiffness, contact) &
            & * self%record(row_origin, contact))
      end do
   end subroutine bear

   !> Elastic energy of the pinned contacts.
   pure function elastic_energy(self, displacement) result(energy)
      !> The contacts
      class(contact_set_type), intent(in) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Energy [J]
      real(wp) :: energy

      integer :: contact
      type(accumulator_type) :: total

      do contact = 1, self%parameters%count
         call total%add(0.5_wp * self%record(row_stiffness, contact) &
            & * (displacement - self%record(row_origin, contact))**2)
      end do
      energy = total%total()
   end function elastic_energy

   !> Number of contacts that are followed one by one.
   pure function followed(self) result(number)
      !> The contacts
      class(contact_set_type), intent(in) :: self
      !> All of them
      integer :: number

      number = self%parameters%count
   end function followed

   !> What each contact is.
   pure subroutine records(self, values)
      !> The contacts
      class(contact_set_type), intent(in) :: self
      !> Origin [m], stiffness [N/m], 0 while it is detached, breaking stretch [m], number of
      !> renewals of each contact, shape (contact_record_length, count)
      real(wp), intent(out) :: values(:, :)

      values = self%record([row_origin, row_stiffness, row_limit, row_renewal], :)
   end subroutine records

   !> Put the state into an archive or take it out.
   subroutine exchange_set(self, archive)
      !> The contacts
      class(contact_set_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      if (self%undrawn_count > 0) call self%draw_undrawn()
      call exchange_contacts(self, archive)
      call archive%exchange("record", self%record)
      call archive%exchange("detached", self%detached)
      call archive%exchange("detached_contact", self%detached_contact)
      call archive%exchange("waiting", self%waiting)
      call archive%exchange("first_detached", self%first_detached)
      call archive%exchange("next_attachment", self%next_attachment)
      call archive%exchange("stiffness", self%stiffness)
      call archive%exchange("offset", self%offset)
      call archive%exchange("drag", self%drag)
      call self%track%exchange(archive)
   end subroutine exchange_set

   !> Stiffness and breaking stretch of a contact that is born with a relative threshold.
   pure subroutine born(parameters, threshold, stiffness, limit)
      type(contact_parameters_type), intent(in) :: parameters
      real(wp), intent(in) :: threshold
      real(wp), intent(out) :: stiffness, limit

      stiffness = parameters%stiffness
      if (parameters%coupling == coupling_scaled) stiffness = stiffness * sqrt(threshold)
      limit = threshold * parameters%static_force / stiffness
   end subroutine born

end module mesoslip_contacts_set
