!> Detached contacts in the order in which they attach again.
!>
!> If all have the same delay, the order is that of breaking: a ring. If delays differ, the next
!> ones are a sorted list and the others a binary heap, which uses the arrays of the ring.
module mesoslip_contacts_individual_detached
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: detached_contacts_type, new_detached_contacts

   !> Values of a contact: time at which it attaches [s], drag until then [N s/m]
   integer, parameter :: length = 2, row_due = 1, row_drag = 2
   !> Contacts that move from the heap to the sorted list at once, and maximum length of the list
   integer, parameter :: moved_together = 96, max_sorted = 256

   !> The detached contacts.
   type :: detached_contacts_type
      !> Their number
      integer :: count = 0
      !> Time at which the next one attaches [s]; huge without one
      real(wp) :: next_due = huge(1.0_wp)
      !> Whether they attach again, and whether in the order of breaking
      logical, private :: attach = .true., in_order = .true.
      !> Number of all contacts, and position of the first in the ring, from 0
      integer, private :: capacity = 0, first = 0
      !> The ring: numbers of the contacts, shape (capacity), and values, shape (length, capacity)
      integer, allocatable, private :: contact(:)
      real(wp), allocatable, private :: value(:, :)
      !> The sorted list, from its first position to its last
      integer, private :: sorted_first = 1, sorted_last = 0
      integer, private :: sorted_contact(max_sorted) = 0
      real(wp), private :: sorted_value(length, max_sorted) = 0.0_wp
   contains
      !> Add a contact, find or remove the one that attaches next, remove any one
      procedure, non_overridable :: push, find_next, pop, remove
      !> The next contacts to attach, and their times
      procedure, non_overridable :: preview
      !> Write the state to an archive, or read it
      procedure, non_overridable :: exchange
      procedure, non_overridable, private :: sift_up, sift_down, heap_count, push_heap, &
         & push_sorted, sort_next, heap_all
   end type detached_contacts_type

contains

   !> Set up without contacts.
   subroutine new_detached_contacts(self, capacity, attach, in_order, error)
      type(detached_contacts_type), intent(out) :: self
      !> Number of all contacts
      integer, intent(in) :: capacity
      !> Whether detached contacts attach again, and whether all have the same delay
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

   !> Add a contact, after all others if all have the same delay.
   pure subroutine push(self, contact, due, drag)
      class(detached_contacts_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Time at which it attaches [s], and its drag until then [N s/m]
      real(wp), intent(in) :: due, drag

      integer :: position

      if (self%in_order) then
         position = self%first + self%count
         if (position >= self%capacity) position = position - self%capacity
         self%contact(position + 1) = contact
         self%value(row_due, position + 1) = due
         self%value(row_drag, position + 1) = drag
         self%count = self%count + 1
         if (self%attach) self%next_due = self%value(row_due, self%first + 1)
      else
         if (self%heap_count() == self%count) then
            call self%push_heap(contact, [due, drag])
         else if (due >= self%sorted_value(row_due, self%sorted_last)) then
            call self%push_heap(contact, [due, drag])
         else
            call self%push_sorted(contact, [due, drag])
         end if
         self%count = self%count + 1
         if (self%attach) self%next_due = min(self%next_due, due)
      end if
   end subroutine push

   !> Number of contacts in the heap.
   elemental function heap_count(self) result(number)
      class(detached_contacts_type), intent(in) :: self
      integer :: number

      number = self%count - (self%sorted_last - self%sorted_first + 1)
   end function heap_count

   !> Add a contact to the heap, before it is counted.
   pure subroutine push_heap(self, contact, value)
      class(detached_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: value(length)

      integer :: place

      place = self%heap_count() + 1
      self%contact(place) = contact
      self%value(:, place) = value
      call self%sift_up(place)
   end subroutine push_heap

   !> Insert a contact into the sorted list, before its last one, before it is counted.
   pure subroutine push_sorted(self, contact, value)
      class(detached_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: value(length)

      integer :: place, number, moved
      real(wp) :: last(length)

      if (self%sorted_first > 1) then
         ! The contacts before it move down.
         place = self%sorted_first - 1
         do while (self%sorted_value(row_due, place + 1) <= value(row_due))
            self%sorted_contact(place) = self%sorted_contact(place + 1)
            self%sorted_value(:, place) = self%sorted_value(:, place + 1)
            place = place + 1
         end do
         self%sorted_first = self%sorted_first - 1
      else
         if (self%sorted_last == max_sorted) then
            ! The last one moves to the heap.
            moved = self%sorted_contact(max_sorted)
            last = self%sorted_value(:, max_sorted)
            self%sorted_last = max_sorted - 1
            number = self%count
            self%count = number - 1
            call self%push_heap(moved, last)
            self%count = number
         end if
         place = self%sorted_last + 1
         do while (place > self%sorted_first)
            if (self%sorted_value(row_due, place - 1) <= value(row_due)) exit
            self%sorted_contact(place) = self%sorted_contact(place - 1)
            self%sorted_value(:, place) = self%sorted_value(:, place - 1)
            place = place - 1
         end do
         self%sorted_last = self%sorted_last + 1
      end if
      self%sorted_contact(place) = contact
      self%sorted_value(:, place) = value
   end subroutine push_sorted

   !> Move the next contacts from the heap to the end of the sorted list.
   pure subroutine sort_next(self)
      class(detached_contacts_type), intent(inout) :: self

      integer :: number, left, moved

      number = self%sorted_last - self%sorted_first + 1
      if (self%sorted_first > 1) then
         self%sorted_contact(:number) = self%sorted_contact(self%sorted_first:self%sorted_last)
         self%sorted_value(:, :number) = self%sorted_value(:, self%sorted_first:self%sorted_last)
         self%sorted_first = 1
         self%sorted_last = number
      end if
      left = self%heap_count()
      do moved = 1, min(moved_together, left, max_sorted - number)
         self%sorted_last = self%sorted_last + 1
         self%sorted_contact(self%sorted_last) = self%contact(1)
         self%sorted_value(:, self%sorted_last) = self%value(:, 1)
         self%contact(1) = self%contact(left)
         self%value(:, 1) = self%value(:, left)
         left = left - 1
         if (left > 0) call self%sift_down(left)
      end do
   end subroutine sort_next

   !> Move all contacts to the heap.
   pure subroutine heap_all(self)
      class(detached_contacts_type), intent(inout) :: self

      integer :: position, number

      if (self%in_order) return
      number = self%count
      do position = self%sorted_last, self%sorted_first, -1
         self%sorted_last = position - 1
         self%count = self%count - 1
         call self%push_heap(self%sorted_contact(position), self%sorted_value(:, position))
         self%count = number
      end do
      self%sorted_first = 1
      self%sorted_last = 0
   end subroutine heap_all

   !> The contact that attaches next; there is at least one.
   pure subroutine find_next(self, contact)
      class(detached_contacts_type), intent(inout) :: self
      integer, intent(out) :: contact

      if (self%in_order) then
         contact = self%contact(self%first + 1)
      else
         if (self%sorted_last < self%sorted_first) call self%sort_next()
         contact = self%sorted_contact(self%sorted_first)
      end if
   end subroutine find_next

   !> Remove the contact that attaches next; there is at least one.
   pure subroutine pop(self, contact, drag)
      class(detached_contacts_type), intent(inout) :: self
      !> Its number, and its drag while it was detached [N s/m]
      integer, intent(out) :: contact
      real(wp), intent(out) :: drag

      call self%find_next(contact)
      if (self%in_order) then
         drag = self%value(row_drag, self%first + 1)
         self%count = self%count - 1
         self%first = self%first + 1
         if (self%first == self%capacity) self%first = 0
         self%next_due = huge(1.0_wp)
         if (self%count > 0) self%next_due = self%value(row_due, self%first + 1)
      else
         drag = self%sorted_value(row_drag, self%sorted_first)
         self%count = self%count - 1
         self%sorted_first = self%sorted_first + 1
         self%next_due = huge(1.0_wp)
         if (self%count == 0) return
         if (self%sorted_last < self%sorted_first) call self%sort_next()
         self%next_due = self%sorted_value(row_due, self%sorted_first)
      end if
   end subroutine pop

   !> Remove a contact that will not attach.
   pure subroutine remove(self, contact, drag)
      class(detached_contacts_type), intent(inout) :: self
      !> Its number, which is in the list
      integer, intent(in) :: contact
      !> Its drag [N s/m]
      real(wp), intent(out) :: drag

      integer :: place, last, next, steps

      if (self%in_order) then
         place = self%first + 1
         do steps = 1, self%count - 1
            if (self%contact(place) == contact) exit
            place = next_place(place)
         end do
         drag = self%value(row_drag, place)
         do steps = steps + 1, self%count
            next = next_place(place)
            self%contact(place) = self%contact(next)
            self%value(:, place) = self%value(:, next)
            place = next
         end do
      else
         do place = self%sorted_first, self%sorted_last
            if (self%sorted_contact(place) == contact) exit
         end do
         if (place <= self%sorted_last) then
            drag = self%sorted_value(row_drag, place)
            self%sorted_contact(place:self%sorted_last - 1) = &
               & self%sorted_contact(place + 1:self%sorted_last)
            self%sorted_value(:, place:self%sorted_last - 1) = &
               & self%sorted_value(:, place + 1:self%sorted_last)
            self%sorted_last = self%sorted_last - 1
         else
            last = self%heap_count()
            do place = 1, last - 1
               if (self%contact(place) == contact) exit
            end do
            drag = self%value(row_drag, place)
            ! The first one of the heap is easy to remove.
            self%value(row_due, place) = -huge(1.0_wp)
            call self%sift_up(place)
            self%contact(1) = self%contact(last)
            self%value(:, 1) = self%value(:, last)
            if (last > 1) call self%sift_down(last - 1)
         end if
      end if
      self%count = self%count - 1
      self%next_due = huge(1.0_wp)
      if (self%count == 0 .or. .not. self%attach) return
      if (self%in_order) then
         self%next_due = self%value(row_due, self%first + 1)
      else
         if (self%sorted_last < self%sorted_first) call self%sort_next()
         self%next_due = self%sorted_value(row_due, self%sorted_first)
      end if

   contains

      !> The place after one in the ring.
      pure integer function next_place(place)
         integer, intent(in) :: place

         next_place = merge(1, place + 1, place == self%capacity)
      end function next_place

   end subroutine remove

   !> Move the last contact of the heap up.
   pure subroutine sift_up(self, last)
      class(detached_contacts_type), intent(inout) :: self
      !> Its position
      integer, intent(in) :: last

      integer :: place, above, contact
      real(wp) :: kept(length)

      place = last
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

   !> Move the first contact of the heap down.
   pure subroutine sift_down(self, number)
      class(detached_contacts_type), intent(inout) :: self
      !> Number of contacts in the heap
      integer, intent(in) :: number

      integer :: place, below, contact
      real(wp) :: kept(length)

      place = 1
      contact = self%contact(place)
      kept = self%value(:, place)
      do
         below = 2 * place
         if (below > number) exit
         if (below < number) then
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
      class(detached_contacts_type), intent(inout) :: self
      !> Maximum number
      integer, intent(in) :: limit
      !> Their number, and the contacts, shape (limit)
      integer, intent(out) :: number, contact(:)
      !> Times at which they attach, followed by that of the next contact, huge without one [s];
      !> their drags until then [N s/m]
      real(wp), intent(inout) :: due(:), drag(:)

      integer :: event, position

      number = 0
      if (self%attach) number = min(limit, self%count)
      due(number + 1) = huge(1.0_wp)
      if (.not. self%in_order) then
         if (number == 0) return
         position = self%sorted_last - self%sorted_first + 1
         if (position <= number .and. self%heap_count() > 0) call self%sort_next()
         do event = 1, number
            position = self%sorted_first + event - 1
            contact(event) = self%sorted_contact(position)
            due(event) = self%sorted_value(row_due, position)
            drag(event) = self%sorted_value(row_drag, position)
         end do
         if (self%count > number) due(number + 1) = &
            & self%sorted_value(row_due, self%sorted_first + number)
         return
      end if
      position = self%first
      do event = 1, number
         contact(event) = self%contact(position + 1)
         due(event) = self%value(row_due, position + 1)
         drag(event) = self%value(row_drag, position + 1)
         position = position + 1
         if (position == self%capacity) position = 0
      end do
      if (self%attach .and. self%count > number) due(number + 1) = self%value(row_due, position + 1)
   end subroutine preview

   !> Write the state to an archive, or read it.
   subroutine exchange(self, archive)
      class(detached_contacts_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call self%heap_all()
      call archive%exchange("detached", self%value)
      call archive%exchange("detached_contact", self%contact)
      call archive%exchange("detached_contacts", self%count)
      call archive%exchange("first_detached", self%first)
      call archive%exchange("next_due", self%next_due)
   end subroutine exchange

end module mesoslip_contacts_individual_detached
