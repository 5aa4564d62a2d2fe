!> The queue of pinned contacts, in the order in which they break.
!>
!> Keys are coordinates along the direction of motion. They lie in a narrow window ahead of the
!> slider, whose width is known: contacts go into a ring of buckets by key, and only the front
!> bucket is sorted. The cost of a contact does not grow with the number of contacts, and records
!> are fetched a bucket at a time, which hides the latency of memory.
module mesoslip_contacts_individual_queue
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_contacts_individual_record, only: ahead_coordinate
   use mesoslip_contacts_individual_sorting, only: before, push, remove_first, sort
   implicit none
   private

   public :: contact_queue_type, new_contact_queue, no_key

   !> First key of an empty queue
   real(wp), parameter :: no_key = huge(1.0_wp)

   !> Contacts in a chunk of a bucket: 16 numbers of 4 bytes fill a cache line
   integer, parameter :: chunk_length = 16
   !> Mean number of contacts in a bucket if keys are uniform
   integer, parameter :: bucket_load = 16
   integer, parameter :: min_buckets = 64
   !> Maximum number of contacts that are sorted again for each late one
   integer, parameter :: max_left = 2 * bucket_load
   !> Upper bound of bucket numbers, for keys far beyond any motion
   real(wp), parameter :: max_bucket = 1.0e15_wp

   !> A priority queue of contacts by key, then by number.
   type :: contact_queue_type
      private
      !> Smallest key in the queue; no_key when it is empty
      real(wp), public :: first_key = no_key
      !> Contacts in the queue
      integer, public :: count = 0

      !> Direction of motion, +1 or -1, and coordinate of the edge of bucket 0
      real(wp) :: direction = 1.0_wp, edge = 0.0_wp
      real(wp) :: inverse_width = 1.0_wp
      !> The front: contacts with a bucket number up to this one. Those there when it advanced are
      !> sorted before the first of them is needed, late ones are in a heap.
      integer(i8) :: front_bucket = -1
      logical :: is_sorted = .true.
      integer :: front_next = 1, front_count = 0, late_count = 0
      real(wp), allocatable :: front_key(:), late_key(:)
      integer, allocatable :: front_contact(:), late_contact(:)
      !> The ring of buckets, each a chain of chunks with the last one first, then one bucket for
      !> contacts beyond the ring
      integer(i8) :: ring_length = 0
      integer :: ring_count = 0, overflow = 0
      integer(i8) :: overflow_first = huge(1_i8)
      integer, allocatable :: bucket_chunk(:), bucket_count(:)
      integer, allocatable :: chunk_contact(:, :), chunk_next(:)
      integer :: free_chunk = 0
   contains
      !> Insert a contact, remove the first one, any one, or all
      procedure, non_overridable :: insert, pop, remove, clear
      !> The first contacts, and removal of some of them
      procedure, non_overridable :: preview, remove_previewed
      !> Removal of the first contacts up to a key
      procedure, non_overridable :: take
      procedure, non_overridable, private :: advance_front, take_overflow, bucket_of, append, &
         & place, find_first, sort_front, absorb_late, take_from_bucket, first_overflow
   end type contact_queue_type

contains

   !> Set up an empty queue.
   subroutine new_contact_queue(self, capacity, span, error)
      type(contact_queue_type), intent(out) :: self
      !> Maximum number of contacts
      integer, intent(in) :: capacity
      !> Distance ahead of the slider within which nearly all keys lie, positive [m]
      real(wp), intent(in) :: span
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      integer :: buckets, chunks, stat

      buckets = min_buckets
      do while (buckets < capacity / bucket_load)
         buckets = 2 * buckets
      end do
      chunks = capacity / chunk_length + buckets + 2
      self%ring_length = int(buckets, i8)
      self%overflow = buckets
      self%inverse_width = real(buckets, wp) / span

      allocate (self%front_key(capacity), self%front_contact(capacity), &
         & self%late_key(capacity), self%late_contact(capacity), &
         & self%bucket_chunk(0:buckets), self%bucket_count(0:buckets), &
         & self%chunk_contact(chunk_length, chunks), self%chunk_next(chunks), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the queue of contacts")
         return
      end if
      call self%clear(1.0_wp, 0.0_wp)
   end subroutine new_contact_queue

   !> Remove all contacts.
   pure subroutine clear(self, direction, coordinate)
      class(contact_queue_type), intent(inout) :: self
      !> Direction of motion, +1 or -1
      real(wp), intent(in) :: direction
      !> Coordinate of the slider, direction times displacement [m]
      real(wp), intent(in) :: coordinate

      integer :: chunk

      self%first_key = no_key
      self%count = 0
      self%direction = direction
      self%edge = coordinate
      self%front_bucket = -1
      self%is_sorted = .true.
      self%front_next = 1
      self%front_count = 0
      self%late_count = 0
      self%ring_count = 0
      self%overflow_first = huge(1_i8)
      self%bucket_chunk = 0
      self%bucket_count = 0
      do chunk = 1, size(self%chunk_next)
         self%chunk_next(chunk) = chunk - 1
      end do
      self%free_chunk = size(self%chunk_next)
   end subroutine clear

   !> Insert a contact.
   subroutine insert(self, contact, key)
      class(contact_queue_type), intent(inout) :: self
      !> Number of the contact, not in the queue
      integer, intent(in) :: contact
      !> Coordinate at which it breaks [m]
      real(wp), intent(in) :: key

      integer(i8) :: bucket

      bucket = self%bucket_of(key)
      if (self%count == 0) then
         self%front_bucket = max(self%front_bucket, bucket - self%ring_length / 2)
      end if
      if (bucket <= self%front_bucket) then
         self%late_count = self%late_count + 1
         call push(self%late_key, self%late_contact, self%late_count, key, contact)
      else
         call self%place(contact, bucket)
      end if
      self%count = self%count + 1
      self%first_key = min(self%first_key, key)
   end subroutine insert

   !> Put a contact into its bucket beyond the front.
   pure subroutine place(self, contact, bucket)
      class(contact_queue_type), intent(inout) :: self
      integer, intent(in) :: contact
      integer(i8), intent(in) :: bucket

      if (bucket <= self%front_bucket + self%ring_length) then
         call self%append(int(iand(bucket, self%ring_length - 1)), contact)
         self%ring_count = self%ring_count + 1
      else
         call self%append(self%overflow, contact)
         self%overflow_first = min(self%overflow_first, bucket)
      end if
   end subroutine place

   !> Remove the first contact of a queue that is not empty.
   subroutine pop(self, record, contact)
      class(contact_queue_type), intent(inout) :: self
      !> Records of all contacts, shape (record_length, number of contacts)
      real(wp), intent(in), contiguous :: record(:, :)
      !> Number of the contact with the smallest key
      integer, intent(out) :: contact

      logical :: from_late

      if (self%front_next > self%front_count .and. self%late_count == 0) then
         call self%advance_front(record)
      end if
      call self%sort_front()
      from_late = self%late_count > 0
      if (from_late .and. self%front_next <= self%front_count) then
         from_late = before(self%late_key(1), self%late_contact(1), &
            & self%front_key(self%front_next), self%front_contact(self%front_next))
      end if
      if (from_late) then
         contact = self%late_contact(1)
         call remove_first(self%late_key, self%late_contact, self%late_count)
         self%late_count = self%late_count - 1
      else
         contact = self%front_contact(self%front_next)
         self%front_next = self%front_next + 1
      end if

      self%count = self%count - 1
      call self%find_first(record)
   end subroutine pop

   !> Remove a contact of the queue, whose record is as it was when the contact was inserted.
   subroutine remove(self, record, contact)
      class(contact_queue_type), intent(inout) :: self
      !> Records of all contacts, shape (record_length, number of contacts)
      real(wp), intent(in), contiguous :: record(:, :)
      !> Its number
      integer, intent(in) :: contact

      integer(i8) :: bucket
      integer :: position
      logical :: is_found

      bucket = self%bucket_of(ahead_coordinate(record(:, contact), self%direction))
      is_found = .false.
      if (bucket > self%front_bucket) then
         if (bucket <= self%front_bucket + self%ring_length) then
            call self%take_from_bucket(int(iand(bucket, self%ring_length - 1)), contact, is_found)
            if (is_found) self%ring_count = self%ring_count - 1
         end if
         if (.not. is_found) then
            call self%take_from_bucket(self%overflow, contact, is_found)
            if (is_found .and. bucket == self%overflow_first) then
               self%overflow_first = self%first_overflow(record)
            end if
         end if
      end if
      if (.not. is_found) then
         do position = self%front_next, self%front_count
            if (self%front_contact(position) == contact) exit
         end do
         if (position <= self%front_count) then
            self%front_key(position:self%front_count - 1) = &
               & self%front_key(position + 1:self%front_count)
            self%front_contact(position:self%front_count - 1) = &
               & self%front_contact(position + 1:self%front_count)
            self%front_count = self%front_count - 1
         else
            do position = 1, self%late_count - 1
               if (self%late_contact(position) == contact) exit
            end do
            ! The first of the heap is easy to remove.
            call push(self%late_key, self%late_contact, position, -no_key, contact)
            call remove_first(self%late_key, self%late_contact, self%late_count)
            self%late_count = self%late_count - 1
         end if
      end if
      self%count = self%count - 1
      call self%find_first(record)
   end subroutine remove

   !> Take a contact out of a bucket, if it is there; the last one takes its place.
   pure subroutine take_from_bucket(self, slot, contact, is_found)
      class(contact_queue_type), intent(inout) :: self
      integer, intent(in) :: slot, contact
      logical, intent(out) :: is_found

      integer :: chunk, first, last, length, position

      is_found = .false.
      first = self%bucket_chunk(slot)
      last = iand(self%bucket_count(slot) - 1, chunk_length - 1) + 1
      if (self%bucket_count(slot) == 0) return
      chunk = first
      length = last
      do while (chunk /= 0)
         do position = 1, length
            if (self%chunk_contact(position, chunk) == contact) exit
         end do
         is_found = position <= length
         if (is_found) exit
         length = chunk_length
         chunk = self%chunk_next(chunk)
      end do
      if (.not. is_found) return
      self%chunk_contact(position, chunk) = self%chunk_contact(last, first)
      self%bucket_count(slot) = self%bucket_count(slot) - 1
      if (last > 1) return
      self%bucket_chunk(slot) = self%chunk_next(first)
      self%chunk_next(first) = self%free_chunk
      self%free_chunk = first
   end subroutine take_from_bucket

   !> Number of the first bucket of the contacts beyond the ring; huge without one.
   pure function first_overflow(self, record) result(bucket)
      class(contact_queue_type), intent(in) :: self
      real(wp), intent(in), contiguous :: record(:, :)
      integer(i8) :: bucket

      integer :: chunk, length, position

      bucket = huge(1_i8)
      chunk = self%bucket_chunk(self%overflow)
      length = iand(self%bucket_count(self%overflow) - 1, chunk_length - 1) + 1
      do while (chunk /= 0)
         do position = 1, length
            bucket = min(bucket, self%bucket_of(ahead_coordinate( &
               & record(:, self%chunk_contact(position, chunk)), self%direction)))
         end do
         length = chunk_length
         chunk = self%chunk_next(chunk)
      end do
   end function first_overflow

   !> The first contacts in their order; no other contact has the key of one of them.
   subroutine preview(self, record, limit, contact, key, number)
      class(contact_queue_type), intent(inout) :: self
      !> Records of all contacts, shape (record_length, number of contacts)
      real(wp), intent(in), contiguous :: record(:, :)
      !> Maximum number
      integer, intent(in) :: limit
      !> Numbers of the contacts
      integer, intent(out) :: contact(:)
      !> Coordinates at which they break [m]
      real(wp), intent(out) :: key(:)
      !> Their number; 0 if all contacts would have to be examined
      integer, intent(out) :: number

      number = 0
      if (self%count == 0) return
      if (self%front_next > self%front_count .and. self%late_count == 0) then
         call self%advance_front(record)
      end if
      call self%sort_front()
      call self%absorb_late()
      number = min(limit, self%front_count - self%front_next + 1)
      associate (front => self%front_key(self%front_next:self%front_count))
         if (self%late_count > 0) then
            do while (number > 0)
               if (front(number) < self%late_key(1)) exit
               number = number - 1
            end do
         end if
         do while (number > 0 .and. number < size(front))
            if (front(number) < front(number + 1)) exit
            number = number - 1
         end do
         key(:number) = front(:number)
      end associate
      contact(:number) = self%front_contact(self%front_next:self%front_next + number - 1)
   end subroutine preview

   !> Merge the late contacts into the front, if the first of all is one of them and few have to be
   !> sorted again.
   subroutine absorb_late(self)
      class(contact_queue_type), intent(inout) :: self

      integer :: left

      if (self%late_count == 0) return
      left = self%front_count - self%front_next + 1
      if (left > max_left * self%late_count) return
      if (left > 0) then
         if (self%front_key(self%front_next) < self%late_key(1)) return
      end if
      self%front_key(:left) = self%front_key(self%front_next:self%front_count)
      self%front_contact(:left) = self%front_contact(self%front_next:self%front_count)
      self%front_next = 1
      self%front_count = left + self%late_count
      self%front_key(left + 1:self%front_count) = self%late_key(:self%late_count)
      self%front_contact(left + 1:self%front_count) = self%late_contact(:self%late_count)
      self%late_count = 0
      call sort(self%front_key, self%front_contact, self%front_count)
   end subroutine absorb_late

   !> Remove the first contacts, which a preview returned.
   subroutine remove_previewed(self, record, number)
      class(contact_queue_type), intent(inout) :: self
      !> Records of all contacts, shape (record_length, number of contacts)
      real(wp), intent(in), contiguous :: record(:, :)
      !> Their number
      integer, intent(in) :: number

      self%front_next = self%front_next + number
      self%count = self%count - number
      call self%find_first(record)
   end subroutine remove_previewed

   !> Find the smallest key.
   subroutine find_first(self, record)
      class(contact_queue_type), intent(inout) :: self
      real(wp), intent(in), contiguous :: record(:, :)

      self%first_key = no_key
      if (self%count == 0) return
      if (self%front_next > self%front_count .and. self%late_count == 0) then
         call self%advance_front(record)
      end if
      if (self%front_next <= self%front_count) then
         if (self%is_sorted) then
            self%first_key = self%front_key(self%front_next)
         else
            self%first_key = minval(self%front_key(self%front_next:self%front_count))
         end if
      end if
      if (self%late_count > 0) self%first_key = min(self%first_key, self%late_key(1))
   end subroutine find_first

   !> Number of the bucket of a key.
   pure function bucket_of(self, key) result(bucket)
      class(contact_queue_type), intent(in) :: self
      real(wp), intent(in) :: key
      integer(i8) :: bucket

      real(wp) :: position

      position = (key - self%edge) * self%inverse_width
      ! Keys behind the slider go to the front.
      bucket = int(min(max(position, -1.0_wp), max_bucket), i8)
      if (position < 0.0_wp) bucket = -1
   end function bucket_of

   !> Append a contact to a bucket.
   pure subroutine append(self, slot, contact)
      class(contact_queue_type), intent(inout) :: self
      integer, intent(in) :: slot, contact

      integer :: position, chunk

      position = iand(self%bucket_count(slot), chunk_length - 1)
      if (position == 0) then
         chunk = self%free_chunk
         self%free_chunk = self%chunk_next(chunk)
         self%chunk_next(chunk) = self%bucket_chunk(slot)
         self%bucket_chunk(slot) = chunk
      else
         chunk = self%bucket_chunk(slot)
      end if
      self%chunk_contact(position + 1, chunk) = contact
      self%bucket_count(slot) = self%bucket_count(slot) + 1
   end subroutine append

   !> Move all contacts of a bucket into the front's arrays.
   pure subroutine empty_bucket(self, slot)
      type(contact_queue_type), intent(inout) :: self
      integer, intent(in) :: slot

      integer :: chunk, next, length

      self%front_next = 1
      self%front_count = 0
      chunk = self%bucket_chunk(slot)
      length = self%bucket_count(slot)
      if (length == 0) return
      length = iand(length - 1, chunk_length - 1) + 1
      do while (chunk /= 0)
         self%front_contact(self%front_count + 1:self%front_count + length) = &
            & self%chunk_contact(:length, chunk)
         self%front_count = self%front_count + length
         length = chunk_length
         next = self%chunk_next(chunk)
         self%chunk_next(chunk) = self%free_chunk
         self%free_chunk = chunk
         chunk = next
      end do
      self%bucket_chunk(slot) = 0
      self%bucket_count(slot) = 0
   end subroutine empty_bucket

   !> Sort the front.
   pure subroutine sort_front(self)
      class(contact_queue_type), intent(inout) :: self

      if (self%is_sorted) return
      call sort(self%front_key, self%front_contact, self%front_count)
      self%is_sorted = .true.
   end subroutine sort_front

   !> Remove the first contacts, up to a key. They are not sorted if there are not too many.
   subroutine take(self, record, last, contact, number)
      class(contact_queue_type), intent(inout) :: self
      !> Records of all contacts, shape (record_length, number of contacts)
      real(wp), intent(in), contiguous :: record(:, :)
      !> The key [m]
      real(wp), intent(in) :: last
      !> The contacts, up to the size of the array
      integer, intent(out) :: contact(:)
      integer, intent(out) :: number

      number = 0
      do while (self%first_key <= last .and. number < size(contact))
         if (self%is_sorted .or. number + self%front_count + self%late_count > size(contact)) then
            call self%pop(record, contact(number + 1))
            number = number + 1
         else
            call take_unsorted(self, last, contact, number)
            call self%find_first(record)
         end if
      end do
   end subroutine take

   !> Take the contacts up to a key out of a front that is not sorted, and the late ones.
   pure subroutine take_unsorted(self, last, contact, number)
      type(contact_queue_type), intent(inout) :: self
      real(wp), intent(in) :: last
      integer, intent(inout) :: contact(:), number

      integer :: position, remaining, taken

      taken = number
      remaining = 0
      do position = 1, self%front_count
         if (self%front_key(position) <= last) then
            taken = taken + 1
            contact(taken) = self%front_contact(position)
         else
            remaining = remaining + 1
            self%front_key(remaining) = self%front_key(position)
            self%front_contact(remaining) = self%front_contact(position)
         end if
      end do
      self%front_count = remaining
      do while (self%late_count > 0)
         if (self%late_key(1) > last) exit
         taken = taken + 1
         contact(taken) = self%late_contact(1)
         call remove_first(self%late_key, self%late_contact, self%late_count)
         self%late_count = self%late_count - 1
      end do
      self%count = self%count - (taken - number)
      number = taken
   end subroutine take_unsorted

   !> Make the next nonempty bucket the front.
   subroutine advance_front(self, record)
      class(contact_queue_type), intent(inout) :: self
      real(wp), intent(in), contiguous :: record(:, :)

      integer :: slot, position

      if (self%ring_count == 0) then
         self%front_bucket = max(self%front_bucket, self%overflow_first - self%ring_length / 2 - 1)
      end if
      do
         if (self%overflow_first <= self%front_bucket + self%ring_length / 2 + 1) then
            call self%take_overflow(record)
         end if
         self%front_bucket = self%front_bucket + 1
         slot = int(iand(self%front_bucket, self%ring_length - 1))
         if (self%bucket_count(slot) > 0) exit
      end do

      call empty_bucket(self, slot)
      self%ring_count = self%ring_count - self%front_count
      do position = 1, self%front_count
         self%front_key(position) = &
            & ahead_coordinate(record(:, self%front_contact(position)), self%direction)
      end do
      self%is_sorted = .false.
   end subroutine advance_front

   !> Move contacts from beyond the ring into it, as far as it reaches now. The front is empty.
   subroutine take_overflow(self, record)
      class(contact_queue_type), intent(inout) :: self
      real(wp), intent(in), contiguous :: record(:, :)

      integer :: position, contact
      integer(i8) :: bucket

      call empty_bucket(self, self%overflow)
      self%overflow_first = huge(1_i8)
      do position = 1, self%front_count
         contact = self%front_contact(position)
         bucket = self%bucket_of(ahead_coordinate(record(:, contact), self%direction))
         call self%place(contact, bucket)
      end do
      self%front_count = 0
   end subroutine take_overflow

end module mesoslip_contacts_individual_queue
