!> The queue against a plain search for the minimum key, for many distributions of keys.
program test_contact_queue
   use mesoslip_contacts_individual_queue, only: contact_queue_type, new_contact_queue, no_key
   use mesoslip_contacts_individual_record, only: ahead_coordinate, record_length, row_limit, &
      & row_origin, row_stiffness
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: uniform_pair
   use testing, only: check, finish
   implicit none

   call exercise(1, 1.0_wp, 0.5_wp, 1.0_wp, 1.0_wp, "one contact")
   call exercise(50, 1.0_wp, 0.5_wp, 1.0_wp, 1.0_wp, "few contacts")
   call exercise(3000, 1.0_wp, 0.5_wp, 1.0_wp, 1.0_wp, "keys spread evenly")
   call exercise(3000, 1.0_wp, 0.999999_wp, 1.0_wp, -1.0_wp, "keys in one bucket")
   call exercise(3000, 1.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, "keys right ahead of the slider")
   call exercise(1000, 1.0_wp, 0.5_wp, 50.0_wp, -1.0_wp, "keys beyond the ring")
   call exercise(1000, 0.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, "equal keys")
   call finish()

contains

   !> Remove contacts and insert them farther ahead, many times.
   subroutine exercise(count, spread, least, stretch, direction, name)
      !> Contacts
      integer, intent(in) :: count
      !> Keys are ahead of the last one by stretch (least + spread times a deviate)
      real(wp), intent(in) :: spread, least, stretch, direction
      character(len=*), intent(in) :: name

      type(contact_queue_type) :: queue
      type(error_type), allocatable :: error
      real(wp) :: record(record_length, count), key, position, uniform(2)
      integer :: contact, expected, event, other, number, previewed, listed(8), length
      real(wp) :: listed_key(8)
      logical :: in_order, in_preview

      call new_contact_queue(queue, count, 1.5_wp, error)
      call queue%clear(direction, 0.0_wp)
      record = 0.0_wp
      do contact = 1, count
         call uniform_pair(1_i8, 0_i8, int(contact, i8), 0_i8, 0_i8, uniform)
         call put(queue, record, direction, contact, stretch * (least + spread * uniform(1)))
      end do

      position = 0.0_wp
      in_order = .true.
      in_preview = .true.
      previewed = 0
      do event = 1, 6 * count
         key = queue%first_key
         expected = 0
         do other = 1, count
            if (record(row_stiffness, other) <= 0.0_wp) cycle
            if (expected == 0) then
               expected = other
            else if (ahead_coordinate(record(:, other), direction) &
               & < ahead_coordinate(record(:, expected), direction)) then
               expected = other
            end if
         end do
         if (modulo(event, 3) == 0) then
            call queue%preview(record, size(listed), listed, listed_key, number)
            do other = 2, number
               in_preview = in_preview .and. listed_key(other) >= listed_key(other - 1)
            end do
            if (number > 0) in_preview = in_preview .and. listed(1) == expected &
               & .and. abs(listed_key(1) - key) <= 0.0_wp
            previewed = previewed + number
         end if
         call queue%pop(record, contact)
         in_order = in_order .and. contact == expected &
            & .and. abs(ahead_coordinate(record(:, contact), direction) - key) <= 0.0_wp
         record(row_stiffness, contact) = 0.0_wp
         call uniform_pair(1_i8, 0_i8, int(contact, i8), int(event, i8), 0_i8, uniform)
         ! Sometimes the slider has moved back before the contact attaches.
         position = key
         if (uniform(2) < 0.02_wp) position = key - 0.4_wp * stretch
         call put(queue, record, direction, contact, &
            & position + stretch * (least + spread * uniform(1)))
      end do
      call check(in_order, "least key first: " // name)
      call check(in_preview .and. (previewed > 0 .or. .not. spread > 0.0_wp), &
         & "the next contacts are listed in their order: " // name)
      call check(queue%count == count, "no contact is lost: " // name)
      do event = 1, 100
         call take_some(queue, record, direction, &
            & queue%first_key + 20.0_wp * stretch / count, min(count, 200), 0.05_wp * stretch, name)
      end do
      do length = count, 1, -max(1, count / 3)
         call take_some(queue, record, direction, queue%first_key + 0.3_wp * stretch, length, &
            & 0.0_wp, name)
      end do
      do event = 1, queue%count
         call queue%pop(record, contact)
      end do
      call check(queue%count == 0 .and. queue%first_key >= no_key, "emptied: " // name)

   end subroutine exercise

   !> Take the first contacts up to a key, as many as have room: no others come before them. They
   !> are inserted again with larger keys if these grow.
   subroutine take_some(queue, record, direction, last, length, growth, name)
      type(contact_queue_type), intent(inout) :: queue
      real(wp), intent(inout) :: record(:, :)
      real(wp), intent(in) :: direction, last, growth
      integer, intent(in) :: length
      character(len=*), intent(in) :: name

      integer :: contact(length), number, other, before
      real(wp) :: key(size(record, 2)), former(length), highest, uniform(2)

      do other = 1, size(key)
         key(other) = no_key
         if (record(row_stiffness, other) > 0.0_wp) then
            key(other) = ahead_coordinate(record(:, other), direction)
         end if
      end do
      before = queue%count
      call queue%take(record, last, contact, number)
      call check(number == min(length, count(key <= last)) &
         & .and. queue%count == before - number, "as many are taken as there are: " // name)
      highest = maxval(key(contact(:number)))
      former(:number) = key(contact(:number))
      record(row_stiffness, contact(:number)) = 0.0_wp
      key(contact(:number)) = no_key
      call check(highest <= min(last, minval(key)) .and. count(key < no_key) == queue%count &
         & .and. abs(queue%first_key - minval(key)) <= 0.0_wp, "the first are taken: " // name)
      if (.not. growth > 0.0_wp) return
      do other = 1, number
         call uniform_pair(2_i8, 0_i8, int(contact(other), i8), int(before, i8), 0_i8, uniform)
         call put(queue, record, direction, contact(other), former(other) + growth * uniform(1)**3)
      end do
   end subroutine take_some

   !> Pin a contact so that it breaks at a coordinate.
   subroutine put(queue, record, direction, contact, coordinate)
      type(contact_queue_type), intent(inout) :: queue
      real(wp), intent(inout) :: record(:, :)
      integer, intent(in) :: contact
      real(wp), intent(in) :: direction, coordinate

      record(row_limit, contact) = 1.0_wp
      record(row_origin, contact) = direction * (coordinate - 1.0_wp)
      record(row_stiffness, contact) = 1.0_wp
      call queue%insert(contact, ahead_coordinate(record(:, contact), direction))
   end subroutine put

end program test_contact_queue
