!> The next event of each block of a row, and the first of them: a tournament.
module mesoslip_sliders_interface_queue
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: event_queue_type

   !> Times of events, one for each block.
   type :: event_queue_type
      !> Time of each block's event
      real(wp), allocatable, private :: time(:)
      !> Winner of each match, the final being the first; blocks follow from `leaves` on
      integer, allocatable, private :: winner(:)
      integer, private :: leaves = 1
   contains
      procedure, non_overridable :: open, put, rebuild, update, first, first_time
   end type event_queue_type

contains

   !> Set up a queue without events.
   subroutine open(self, blocks, error)
      class(event_queue_type), intent(inout) :: self
      integer, intent(in) :: blocks
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: block, stat

      self%leaves = 1
      do while (self%leaves < blocks)
         self%leaves = 2 * self%leaves
      end do
      allocate (self%time(self%leaves), source=huge(1.0_wp), stat=stat)
      if (stat == 0) then
         allocate (self%winner(2 * self%leaves - 1), source=1, stat=stat)
      end if
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the events of the blocks")
         return
      end if
      do block = 1, self%leaves
         self%winner(self%leaves - 1 + block) = block
      end do
      call self%rebuild()
   end subroutine open

   !> Set the time of an event, before the queue is rebuilt.
   pure subroutine put(self, block, time)
      class(event_queue_type), intent(inout) :: self
      integer, intent(in) :: block
      real(wp), intent(in) :: time

      self%time(block) = time
   end subroutine put

   !> Play all matches.
   pure subroutine rebuild(self)
      class(event_queue_type), intent(inout) :: self

      integer :: match

      do match = self%leaves - 1, 1, -1
         call play(self, match)
      end do
   end subroutine rebuild

   !> Set the time of an event, and play the matches of its block.
   pure subroutine update(self, block, time)
      class(event_queue_type), intent(inout) :: self
      integer, intent(in) :: block
      real(wp), intent(in) :: time

      integer :: match

      self%time(block) = time
      match = (self%leaves - 1 + block) / 2
      do while (match > 0)
         call play(self, match)
         match = match / 2
      end do
   end subroutine update

   !> Play a match; of equal times the first block's wins.
   pure subroutine play(self, match)
      type(event_queue_type), intent(inout) :: self
      integer, intent(in) :: match

      associate (left => self%winner(2 * match), right => self%winner(2 * match + 1))
         if (self%time(right) < self%time(left)) then
            self%winner(match) = right
         else
            self%winner(match) = left
         end if
      end associate
   end subroutine play

   !> The block with the first event.
   pure function first(self) result(block)
      class(event_queue_type), intent(in) :: self
      integer :: block

      block = self%winner(1)
   end function first

   !> Time of the first event.
   pure function first_time(self) result(time)
      class(event_queue_type), intent(in) :: self
      real(wp) :: time

      time = self%time(self%winner(1))
   end function first_time

end module mesoslip_sliders_interface_queue
