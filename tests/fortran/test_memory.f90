!> Refused memory is an error; sorting in place needs none.
program test_memory
   use mesoslip_contacts_individual_sorting, only: sort, sort_in_place
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: uniform_pair
   use mesoslip_recording_buffer, only: buffer_type
   use testing, only: check, finish
   implicit none

   !> Numbers whose product is too long for any array
   integer, parameter :: half_huge = 2**30

   call table()
   call checkpoint()
   call sorting(0)
   call sorting(1)
   call sorting(2)
   call sorting(1000)
   call finish()

contains

   !> A table that cannot grow keeps its rows, and reports that one is lost.
   subroutine table()
      type(buffer_type) :: buffer

      call buffer%open(2, 1)
      call buffer%add([1.0_wp, 2.0_wp])
      call buffer%add([3.0_wp, 4.0_wp])
      call check(buffer%count == 2 .and. .not. allocated(buffer%failure), "a table grows")
      call buffer%open(half_huge, 0)
      buffer%count = half_huge / 2
      call buffer%reserve()
      call check(.not. buffer%has_room() .and. has_status(buffer%failure), "a row is refused")
   end subroutine table

   !> A checkpoint whose shapes are damaged asks for more memory than there is.
   subroutine checkpoint()
      type(archive_type) :: archive
      real(wp), allocatable :: values(:, :)
      integer, allocatable :: numbers(:, :)
      integer(i8) :: shape_word

      allocate (values(3, 2), source=1.0_wp)
      allocate (numbers(3, 2), source=7)
      archive%saving = .true.
      call archive%exchange("values", values)
      shape_word = findloc(archive%word(:archive%length), 3_i8, 1, kind=i8)
      call check(shape_word > 0_i8, "the shape is in the archive")
      call archive%exchange("numbers", numbers)

      call read_again(archive, values, numbers)
      call check(all(shape(values) == [3, 2]) .and. all(numbers == 7), "arrays come back")
      archive%word(shape_word:shape_word + 1_i8) = int(half_huge, i8)
      call read_again(archive, values, numbers)
      call check(size(values) == 0, "an array that has no room is empty")
   end subroutine checkpoint

   !> Take the arrays out of an archive.
   subroutine read_again(saved, values, numbers)
      type(archive_type), intent(in) :: saved
      real(wp), allocatable, intent(inout) :: values(:, :)
      integer, allocatable, intent(inout) :: numbers(:, :)

      type(archive_type) :: archive

      archive%word = saved%word
      archive%length = saved%length
      call archive%exchange("values", values)
      call check(size(values) > 0 .or. has_status(archive%failure), "memory is refused")
      call archive%exchange("numbers", numbers)
      call archive%finish()
   end subroutine read_again

   !> Sorting without memory gives the same order.
   subroutine sorting(count)
      integer, intent(in) :: count

      real(wp) :: key(count), other_key(count), uniform(2)
      integer :: contact(count), other_contact(count), one

      do one = 1, count
         call uniform_pair(1_i8, 0_i8, int(one, i8), 0_i8, 0_i8, uniform)
         ! Few different keys: equal ones are in the order of the contacts' numbers.
         key(one) = anint(50.0_wp * uniform(1))
         contact(one) = 1 + modulo(7 * one, max(1, count))
      end do
      other_key = key
      other_contact = contact
      call sort(key, contact, count)
      call sort_in_place(other_key, other_contact, count)
      call check(all(contact == other_contact) .and. .not. any(abs(key - other_key) > 0.0_wp), &
         & "sorting in place")
   end subroutine sorting

   !> Whether an error is that memory was refused.
   pure function has_status(error)
      type(error_type), allocatable, intent(in) :: error
      logical :: has_status

      has_status = .false.
      if (allocated(error)) has_status = error%status == status_memory
   end function has_status

end program test_memory
