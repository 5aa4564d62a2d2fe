!> Sorting contacts by key, then by number, and a binary heap of them.
module mesoslip_contacts_individual_sorting
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: before, push, remove_first, sort, sort_in_place

   !> Maximum length that is sorted by counting; longer runs are merged
   integer, parameter :: short_run = 32

contains

   !> Whether one contact comes before another.
   pure function before(key_a, contact_a, key_b, contact_b)
      real(wp), intent(in) :: key_a, key_b
      integer, intent(in) :: contact_a, contact_b
      logical :: before

      before = key_a < key_b .or. (key_a <= key_b .and. contact_a < contact_b)
   end function before

   !> Insert a contact into a binary heap, the last position of which is free.
   pure subroutine push(heap_key, heap_contact, count, key, contact)
      real(wp), intent(inout), contiguous :: heap_key(:)
      integer, intent(inout), contiguous :: heap_contact(:)
      integer, intent(in) :: count, contact
      real(wp), intent(in) :: key

      integer :: child, parent

      child = count
      do while (child > 1)
         parent = child / 2
         if (.not. before(key, contact, heap_key(parent), heap_contact(parent))) exit
         heap_key(child) = heap_key(parent)
         heap_contact(child) = heap_contact(parent)
         child = parent
      end do
      heap_key(child) = key
      heap_contact(child) = contact
   end subroutine push

   !> Remove the first contact of a binary heap.
   pure subroutine remove_first(heap_key, heap_contact, count)
      real(wp), intent(inout), contiguous :: heap_key(:)
      integer, intent(inout), contiguous :: heap_contact(:)
      integer, intent(in) :: count

      integer :: parent, child, contact
      real(wp) :: key

      key = heap_key(count)
      contact = heap_contact(count)
      parent = 1
      do
         child = 2 * parent
         if (child >= count) exit
         if (child + 1 < count) then
            if (before(heap_key(child + 1), heap_contact(child + 1), &
               & heap_key(child), heap_contact(child))) child = child + 1
         end if
         if (.not. before(heap_key(child), heap_contact(child), key, contact)) exit
         heap_key(parent) = heap_key(child)
         heap_contact(parent) = heap_contact(child)
         parent = child
      end do
      heap_key(parent) = key
      heap_contact(parent) = contact
   end subroutine remove_first

   !> Sort contacts by key, then by number: short runs by counting, longer ones by merging, or in
   !> place without enough memory.
   pure subroutine sort(key, contact, count)
      real(wp), intent(inout), contiguous :: key(:)
      integer, intent(inout), contiguous :: contact(:)
      integer, intent(in) :: count

      real(wp), allocatable :: left_key(:)
      integer, allocatable :: left_contact(:)
      integer :: first, middle, last, run, stat

      do first = 1, count, short_run
         last = min(first + short_run - 1, count)
         call sort_run(key(first:last), contact(first:last), last - first + 1)
      end do
      if (count <= short_run) return

      allocate (left_key(count), stat=stat)
      if (stat == 0) allocate (left_contact(count), stat=stat)
      if (stat /= 0) then
         call sort_in_place(key, contact, count)
         return
      end if
      run = short_run
      do while (run < count)
         do first = 1, count - run, 2 * run
            middle = first + run - 1
            last = min(middle + run, count)
            call merge_runs(key, contact, first, middle, last, left_key, left_contact)
         end do
         run = 2 * run
      end do
   end subroutine sort

   !> Sort contacts by key, then by number, in place: by a heap.
   pure subroutine sort_in_place(key, contact, count)
      real(wp), intent(inout), contiguous :: key(:)
      integer, intent(inout), contiguous :: contact(:)
      integer, intent(in) :: count

      integer :: first, last, first_contact
      real(wp) :: first_key

      do last = 2, count
         first_key = key(last)
         first_contact = contact(last)
         call push(key, contact, last, first_key, first_contact)
      end do
      do last = count, 2, -1
         first_key = key(1)
         first_contact = contact(1)
         call remove_first(key, contact, last)
         key(last) = first_key
         contact(last) = first_contact
      end do
      do first = 1, count / 2
         last = count + 1 - first
         first_key = key(first)
         first_contact = contact(first)
         key(first) = key(last)
         contact(first) = contact(last)
         key(last) = first_key
         contact(last) = first_contact
      end do
   end subroutine sort_in_place

   !> Sort one run by counting the smaller keys for each, without a branch that depends on keys, or
   !> by insertion if keys are equal.
   pure subroutine sort_run(key, contact, count)
      integer, intent(in) :: count
      real(wp), intent(inout) :: key(count)
      integer, intent(inout) :: contact(count)

      ! Places are reals like the keys, so that two are compared and counted at once.
      real(wp) :: unsorted_key(short_run), place(short_run)
      integer :: unsorted_contact(short_run), one

      do one = 1, count
         unsorted_key(one) = key(one)
         unsorted_contact(one) = contact(one)
      end do
      place(:count) = 1.0_wp
      do one = 1, count
         place(:count) = place(:count) &
            & + merge(1.0_wp, 0.0_wp, unsorted_key(one) < unsorted_key(:count))
      end do
      if (nint(sum(place(:count))) /= (count * (count + 1)) / 2) then
         ! Equal keys share a place.
         call insertion_sort(key, contact, count)
         return
      end if
      do one = 1, count
         key(int(place(one))) = unsorted_key(one)
         contact(int(place(one))) = unsorted_contact(one)
      end do
   end subroutine sort_run

   !> Sort one run by insertion.
   pure subroutine insertion_sort(key, contact, count)
      integer, intent(in) :: count
      real(wp), intent(inout) :: key(count)
      integer, intent(inout) :: contact(count)

      integer :: next, position, moved_contact
      real(wp) :: moved_key

      do next = 2, count
         moved_key = key(next)
         moved_contact = contact(next)
         position = next
         do while (position > 1)
            if (.not. before(moved_key, moved_contact, key(position - 1), &
               & contact(position - 1))) exit
            key(position) = key(position - 1)
            contact(position) = contact(position - 1)
            position = position - 1
         end do
         key(position) = moved_key
         contact(position) = moved_contact
      end do
   end subroutine insertion_sort

   !> Merge two neighbouring sorted runs.
   pure subroutine merge_runs(key, contact, first, middle, last, left_key, left_contact)
      real(wp), intent(inout), contiguous :: key(:), left_key(:)
      integer, intent(inout), contiguous :: contact(:), left_contact(:)
      integer, intent(in) :: first, middle, last

      integer :: left, left_count, right, position

      left_count = middle - first + 1
      left_key(:left_count) = key(first:middle)
      left_contact(:left_count) = contact(first:middle)
      left = 1
      right = middle + 1
      position = first
      do while (left <= left_count)
         if (right <= last) then
            if (before(key(right), contact(right), left_key(left), left_contact(left))) then
               key(position) = key(right)
               contact(position) = contact(right)
               right = right + 1
               position = position + 1
               cycle
            end if
         end if
         key(position) = left_key(left)
         contact(position) = left_contact(left)
         left = left + 1
         position = position + 1
      end do
   end subroutine merge_runs

end module mesoslip_contacts_individual_sorting
