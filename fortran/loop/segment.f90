!> The bounds of a segment of a run, between two checks for signals.
!>
!> One advance may break very many contacts, and between two events a slider may need very many
!> steps: all work is bounded. The numbers of a run do not depend on where segments end.
module mesoslip_loop_segment
   use mesoslip_numerics_kinds, only: i8, wp
   implicit none
   private

   public :: segment_type, new_segment

   !> Number of advances that no segment reaches
   real(wp), parameter :: any_number = 1.0e18_wp

   !> A segment of a run.
   type :: segment_type
      !> Counts of breaks and of advances at which it ends
      real(wp) :: max_breaks = 0.0_wp
      integer(i8), private :: max_advances = 0
      !> Work at which it ends, and work so far: 1 for an advance of a rigid slider or a break
      real(wp), private :: max_work = 0.0_wp, work = 0.0_wp
   contains
      procedure, non_overridable :: add
      procedure, non_overridable :: is_over
      procedure, non_overridable :: last_advance
   end type segment_type

contains

   !> A segment that begins.
   pure function new_segment(advances, breaks, max_advances, max_work) result(self)
      !> Advances and breaks so far
      integer(i8), intent(in) :: advances
      real(wp), intent(in) :: breaks
      !> Advances and work in the segment
      integer(i8), intent(in) :: max_advances
      real(wp), intent(in) :: max_work
      type(segment_type) :: self

      self%max_advances = advances + max_advances
      self%max_breaks = breaks + max_work
      self%max_work = max_work
   end function new_segment

   !> Add the work of some advances.
   subroutine add(self, advances, cost)
      class(segment_type), intent(inout) :: self
      !> Their number; 0 counts as 1
      integer(i8), intent(in) :: advances
      !> Work of one
      real(wp), intent(in) :: cost

      self%work = self%work + real(max(1_i8, advances), wp) * cost
   end subroutine add

   !> Whether the segment is over.
   pure function is_over(self, advances, breaks)
      class(segment_type), intent(in) :: self
      !> Advances and breaks so far
      integer(i8), intent(in) :: advances
      real(wp), intent(in) :: breaks
      logical :: is_over

      is_over = advances >= self%max_advances .or. self%work >= self%max_work &
         & .or. breaks > self%max_breaks
   end function is_over

   !> Number of the last advance of the segment, one more than so far at least.
   pure function last_advance(self, advances, cost) result(last)
      class(segment_type), intent(in) :: self
      !> Advances so far, and work of one
      integer(i8), intent(in) :: advances
      real(wp), intent(in) :: cost
      integer(i8) :: last

      real(wp) :: number

      number = max(1.0_wp, min(any_number, (self%max_work - self%work) / cost))
      last = max(advances + 1_i8, min(self%max_advances, advances + int(number, i8)))
   end function last_advance

end module mesoslip_loop_segment
