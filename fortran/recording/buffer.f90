!> Rows that were recorded, until they are drained.
module mesoslip_recording_buffer
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: buffer_type

   !> A table that grows.
   type :: buffer_type
      !> Rows are columns here, in the order of memory, shape (numbers in a row, room)
      real(wp), allocatable :: row(:, :)
      !> Number of rows
      integer :: count = 0
      !> Set when there is not enough memory for a row, which is then lost
      type(error_type), allocatable :: failure
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: reserve
      procedure, non_overridable :: has_room
      procedure, non_overridable :: add
      procedure, non_overridable :: drain
      procedure, non_overridable :: exchange
   end type buffer_type

contains

   !> Set up an empty table.
   subroutine open(self, length, room)
      class(buffer_type), intent(inout) :: self
      !> Numbers in a row, and initial room for rows
      integer, intent(in) :: length, room

      integer :: stat

      if (allocated(self%row)) deallocate (self%row)
      allocate (self%row(length, room), stat=stat)
      if (stat /= 0) then
         call fail(self)
         allocate (self%row(length, 0))
      end if
      self%count = 0
   end subroutine open

   !> Make room for one more row.
   subroutine reserve(self)
      class(buffer_type), intent(inout) :: self

      real(wp), allocatable :: longer(:, :)
      integer :: stat

      if (self%has_room()) return
      allocate (longer(size(self%row, 1), 2 * self%count + 1), stat=stat)
      if (stat /= 0) then
         call fail(self)
         return
      end if
      longer(:, :self%count) = self%row
      call move_alloc(longer, self%row)
   end subroutine reserve

   !> Whether there is room for one more row.
   pure function has_room(self)
      class(buffer_type), intent(in) :: self
      logical :: has_room

      has_room = self%count < size(self%row, 2)
   end function has_room

   pure subroutine fail(self)
      class(buffer_type), intent(inout) :: self

      call raise(self%failure, status_memory, "not enough memory for what is recorded")
   end subroutine fail

   !> Add a row.
   subroutine add(self, values)
      class(buffer_type), intent(inout) :: self
      !> The row
      real(wp), intent(in) :: values(:)

      call self%reserve()
      if (.not. self%has_room()) return
      self%count = self%count + 1
      self%row(:, self%count) = values
   end subroutine add

   !> Remove the first rows and return them.
   subroutine drain(self, values)
      class(buffer_type), intent(inout) :: self
      !> The rows, shape (numbers in a row, rows)
      real(wp), intent(out) :: values(:, :)

      integer :: row, left

      left = self%count - size(values, 2)
      values = self%row(:, :size(values, 2))
      do row = 1, left
         self%row(:, row) = self%row(:, size(values, 2) + row)
      end do
      self%count = left
   end subroutine drain

   !> Put the rows into an archive or take them out.
   subroutine exchange(self, name, archive)
      class(buffer_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      type(archive_type), intent(inout) :: archive

      real(wp), allocatable :: waiting(:, :)
      integer :: room, stat

      if (archive%saving) then
         allocate (waiting, source=self%row(:, :self%count), stat=stat)
         if (stat /= 0) then
            call fail(self)
            archive%failure = self%failure
            return
         end if
      end if
      call archive%exchange(name, waiting)
      if (archive%saving .or. allocated(archive%failure)) return
      room = max(size(self%row, 2), size(waiting, 2))
      call self%open(size(waiting, 1), room)
      if (allocated(self%failure)) then
         archive%failure = self%failure
         return
      end if
      self%count = size(waiting, 2)
      self%row(:, :self%count) = waiting
   end subroutine exchange

end module mesoslip_recording_buffer
