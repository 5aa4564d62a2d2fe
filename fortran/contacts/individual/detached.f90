!> Detached contacts in the order in which they attach again.
!>
!> Where all wait for the same delay the order is that of breaking: a ring. Where each has a delay
!> of its own they are a binary heap, which uses the same arrays from their start.
module mesoslip_contacts_individual_detached
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: detached_contacts_type, new_detached_contacts

   !> Numbers kept for a contact: when it attaches again [s], its drag until then [N s/m]
   integer, parameter :: length = 2, row_due = 1, row_drag = 2

   !> The detached contacts.
   type :: detached_contacts_type
      !> Their number
      integer :: count = 0
      !> Time at which the next one attaches; huge when none does [s]
      real(wp) :: next_due = huge(1.0_wp)
      !> Whether they attach again, and whether they do so in the order in which they broke
      logical, private :: attach = .true., in_order = .true.
      !> Number of contacts in all, and the position of the first one in the ring, from 0
      integer, private :: capacity = 0, first = 0
      !> The ring: numbers of the contacts, shape (capacity), and what is kept for them, shape
      !> (length, capacity)
      integer, allocatable, private :: contact(:)
      real(wp), allocatable, private :: value(:, :)
   contains
      !> Put a contact in
      procedure, non_overridable :: push
      !> The contact that attaches next
      procedure, non_overridable :: next_contact
      !> Take the contact out that attaches next
      procedure, non_overridable :: pop
      !> The next contacts and their times
      procedure, non_overridable :: preview
      !> Put the state into an archive or take it out
      procedure, non_overridable :: exchange
      procedure, non_overridable, private :: sift_up, sift_down
   end type detached_contacts_type

contains

   !> Set up without contacts.
   subroutine new_detached_contacts(self, capacity, attach, in_order, error)
      !> The detached contacts
      type(detached_contacts_type), intent(out) :: self
      !> Number of contacts in all
      integer, intent(in) :: capacity
      !> Whether detached contacts attach again, and whether all wait for the same delay
      logical, intent(in) :: attach, in_order
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      self%capacity = capacity
      self%attach = attach
      self%in_order = in_order
      allocate (self%contact(capacity), source=0, stat=stat)
      if (stat == 0) allocate (self%value(length, capacity), source=0.0_wp, stat=stat)
      if (stat /= 0) call raise(error, status_memory, "not enough memory for detached contacts")
   end subroutine new_detached_contacts

   !> Put a contact in, behind all others if all wait for the same delay.
   pure subroutine push(self, contact, due, drag)
      !> The detached contacts
      class(detached_contacts_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> When it attaches again [s], and its drag until then [N s/m]
      real(wp), intent(in) :: due, drag

      integer :: position

      position = self%first + self%count
      if (position >= self%capacity) position = position - self%capacity
      self%contact(position + 1) = contact
      self%value(row_due, position + 1) = due
      self%value(row_drag, position + 1) = drag
      self%count = self%count + 1
      if (.not. self%in_order) call self%sift_up()
      if (self%attach) self%next_due = self%value(row_due, self%first + 1)
   end subroutine push

   !> The contact that attaches next.
   pure function next_contact(self) result(contact)
      !> The detached contacts, at least one
      class(detached_contacts_type), intent(in) :: self
      !> Its number
      integer :: contact

      contact = self%contact(self%first + 1)
   end function next_contact

   !> Take the contact out that attaches next.
   pure subroutine pop(self, contact, drag)
      !> The detached contacts, at least one
      class(detached_contacts_type), intent(inout) :: self
      !> Its number, and its drag while it was detached [N s/m]
      integer, intent(out) :: contact
      real(wp), intent(out) :: drag

      contact = self%contact(self%first + 1)
      drag = self%value(row_drag, self%first + 1)
      self%count = self%count - 1
      if (self%in_order) then
         self%first = self%first + 1
         if (self%first == self%capacity) self%first = 0
      else
         self%contact(1) = self%contact(self%count + 1)
         self%value(:, 1) = self%value(:, self%count + 1)
         call self%sift_down()
      end if
      self%next_due = huge(1.0_wp)
      if (self%count > 0) self%next_due = self%value(row_due, self%first + 1)
   end subroutine pop

   !> Move the last contact of the heap up to its place.
   pure subroutine sift_up(self)
      class(detached_contacts_type), intent(inout) :: self

      integer :: place, above, contact
      real(wp) :: kept(length)

      place = self%count
      contact = self%contact(place)
      kept = self%value(:, place)
      do while (place > 1)
         above = place / 2
         if (self%value(row_due, above) <= kept(row_due)) exit
         self%contact(place) = self%contact(above)
         self%value(:, place) = self%value(:, above)
         place = above
      end do
      self%contact(place) = contact
      self%value(:, place) = kept
   end subroutine sift_up

   !> Move the first contact of the heap down to its place.
   pure subroutine sift_down(self)
      class(detached_contacts_type), intent(inout) :: self

      integer :: place, below, contact
      real(wp) :: kept(length)

      place = 1
      contact = self%contact(place)
      kept = self%value(:, place)
      do
         below = 2 * place
         if (below > self%count) exit
         if (below < self%count) then
            if (self%value(row_due, below + 1) < self%value(row_due, below)) below = below + 1
         end if
         if (kept(row_due) <= self%value(row_due, below)) exit
         self%contact(place) = self%contact(below)
         self%value(:, place) = self%value(:, below)
         place = below
      end do
      self%contact(place) = contact
      self%value(:, place) = kept
   end subroutine sift_down

   !> The next contacts to attach, and their times.
   pure subroutine preview(self, limit, number, contact, due, drag)
      !> The detached contacts, which all wait for the same delay
      class(detached_contacts_type), intent(in) :: self
      !> Maximum number
      integer, intent(in) :: limit
      !> How many they are
      integer, intent(out) :: number
      !> Their numbers, shape (limit)
      integer, intent(out) :: contact(:)
      !> When they attach, and then when the next one does that is not listed, huge if none does
      !> [s]; their drags until then [N s/m]
      real(wp), intent(inout) :: due(:), drag(:)

      integer :: event, position

      number = 0
      if (self%attach) number = min(limit, self%count)
      position = self%first
      do event = 1, number
         contact(event) = self%contact(position + 1)
         due(event) = self%value(row_due, position + 1)
         drag(event) = self%value(row_drag, position + 1)
         position = position + 1
         if (position == self%capacity) position = 0
      end do
      due(number + 1) = huge(1.0_wp)
      if (self%attach .and. self%count > number) due(number + 1) = self%value(row_due, position + 1)
   end subroutine preview

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The detached contacts
      class(detached_contacts_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%exchange("detached", self%value)
      call archive%exchange("detached_contact", self%contact)
      call archive%exchange("detached_contacts", self%count)
      call archive%exchange("first_detached", self%first)
      call archive%exchange("next_due", self%next_due)
   end subroutine exchange

end module mesoslip_contacts_individual_detached
