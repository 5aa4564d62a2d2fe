!> The catalogue of ruptures: slips of the blocks of an interface in which most contacts break.
!>
!> A block slips while it is faster than the drive by the slip velocity, and until it has been slower
!> for the quiet time. It ruptures if half of the contacts that were pinned at the start break.
module mesoslip_recording_ruptures
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_buffer, only: buffer_type
   implicit none
   private

   public :: rupture_recorder_type, rupture_columns

   !> Columns of the catalogue; forces are those on the contacts of the block
   character(len=*), parameter :: rupture_columns(*) = [character(len=name_length) :: "block", &
      & "start_time", "rupture_time", "end_time", "force_before", "force_after", "slip", &
      & "peak_velocity", "breaks"]
   integer, parameter :: rupture_length = size(rupture_columns)
   !> Number of ruptures at which the run pauses so that they are drained
   integer, parameter :: pausing_ruptures = 5000
   !> Part of the pinned contacts that breaks in a rupture
   real(wp), parameter :: broken_part = 0.5_wp
   !> Time at which nothing has happened
   real(wp), parameter :: never = huge(1.0_wp)

   !> Records ruptures.
   type :: rupture_recorder_type
      !> Ruptures that are over
      type(buffer_type) :: catalogue
      !> Velocity above the drive's that is a slip [m/s], and time after which one is over [s]
      real(wp), private :: slip_velocity = 0.0_wp, quiet_time = 0.0_wp
      integer :: blocks = 0
      !> Whether a block slips; when it did so first and last [s]; when it ruptured, or never
      logical, allocatable, private :: slips(:)
      real(wp), allocatable, private :: start_time(:), last_time(:), rupture_time(:)
      !> Force [N], displacement [m] and breaks at the start, breaks at which it ruptures
      real(wp), allocatable, private :: start_force(:), start_place(:), start_breaks(:), limit(:)
      !> Force when it was fast last [N], and maximum of its velocity [m/s]
      real(wp), allocatable, private :: last_force(:), last_place(:), peak_velocity(:)
   contains
      procedure, non_overridable :: open, is_full, note_breaks, note_motion, finish, exchange
      procedure, non_overridable, private :: close_slip
   end type rupture_recorder_type

contains

   !> Set up an empty catalogue.
   subroutine open(self, blocks, slip_velocity, quiet_time, stat)
      class(rupture_recorder_type), intent(inout) :: self
      !> Number of blocks; 0: nothing is recorded
      integer, intent(in) :: blocks
      !> Velocity above the drive's that is a slip [m/s], and time after which one is over [s]
      real(wp), intent(in) :: slip_velocity, quiet_time
      !> 0 if there is enough memory
      integer, intent(out) :: stat

      self%blocks = blocks
      self%slip_velocity = slip_velocity
      self%quiet_time = quiet_time
      call self%catalogue%open(rupture_length, merge(blocks + 1, 0, blocks > 0))
      allocate (self%slips(blocks), source=.false., stat=stat)
      if (stat /= 0) return
      allocate (self%start_time(blocks), self%last_time(blocks), self%start_force(blocks), &
         & self%start_place(blocks), self%start_breaks(blocks), self%last_force(blocks), &
         & self%last_place(blocks), self%peak_velocity(blocks), source=0.0_wp, stat=stat)
      if (stat /= 0) return
      allocate (self%rupture_time(blocks), self%limit(blocks), source=never, stat=stat)
   end subroutine open

   !> Whether the catalogue should be drained.
   pure function is_full(self)
      class(rupture_recorder_type), intent(in) :: self
      logical :: is_full

      is_full = self%catalogue%count >= pausing_ruptures
   end function is_full

   !> Contacts of a block have broken.
   pure subroutine note_breaks(self, block, time, breaks)
      class(rupture_recorder_type), intent(inout) :: self
      integer, intent(in) :: block
      !> Time [s], and breaks so far
      real(wp), intent(in) :: time, breaks

      if (breaks >= self%limit(block)) then
         self%rupture_time(block) = time
         self%limit(block) = never
      end if
   end subroutine note_breaks

   !> A block moves: its slip begins, continues or ends.
   subroutine note_motion(self, block, time, excess, place, force, breaks, pinned)
      class(rupture_recorder_type), intent(inout) :: self
      integer, intent(in) :: block
      !> Time [s], velocity above the drive's along its direction [m/s], displacement [m]
      real(wp), intent(in) :: time, excess, place
      !> Force on the contacts [N], breaks so far, and contacts that are pinned
      real(wp), intent(in) :: force, breaks, pinned

      if (excess > self%slip_velocity) then
         if (.not. self%slips(block)) then
            self%slips(block) = .true.
            self%start_time(block) = time
            self%start_force(block) = force
            self%start_place(block) = place
            self%start_breaks(block) = breaks
            self%limit(block) = breaks + max(1.0_wp, broken_part * pinned)
            self%rupture_time(block) = never
            self%peak_velocity(block) = 0.0_wp
         end if
         self%last_time(block) = time
         self%last_force(block) = force
         self%last_place(block) = place
         self%peak_velocity(block) = max(self%peak_velocity(block), excess)
      else if (self%slips(block) .and. time > self%last_time(block) + self%quiet_time) then
         call self%close_slip(block, breaks)
      end if
   end subroutine note_motion

   !> The slip of a block is over: it may have been a rupture.
   subroutine close_slip(self, block, breaks)
      class(rupture_recorder_type), intent(inout) :: self
      integer, intent(in) :: block
      real(wp), intent(in) :: breaks

      self%slips(block) = .false.
      self%limit(block) = never
      if (.not. self%rupture_time(block) < never) return
      call self%catalogue%add([real(block, wp), self%start_time(block), self%rupture_time(block), &
         & self%last_time(block), self%start_force(block), self%last_force(block), &
         & self%last_place(block) - self%start_place(block), self%peak_velocity(block), &
         & breaks - self%start_breaks(block)])
   end subroutine close_slip

   !> The run is over: so are all slips.
   subroutine finish(self, breaks)
      class(rupture_recorder_type), intent(inout) :: self
      !> Breaks so far of each block
      real(wp), intent(in) :: breaks(:)

      integer :: block

      do block = 1, self%blocks
         if (self%slips(block)) call self%close_slip(block, breaks(block))
      end do
   end subroutine finish

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(rupture_recorder_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      integer :: block

      if (self%blocks == 0) return
      call archive%section("ruptures")
      do block = 1, self%blocks
         call archive%exchange("slips", self%slips(block))
      end do
      associate (n => [self%blocks, 1])
         call archive%exchange_fixed("start_time", n, self%start_time)
         call archive%exchange_fixed("last_time", n, self%last_time)
         call archive%exchange_fixed("rupture_time", n, self%rupture_time)
         call archive%exchange_fixed("start_force", n, self%start_force)
         call archive%exchange_fixed("start_place", n, self%start_place)
         call archive%exchange_fixed("start_breaks", n, self%start_breaks)
         call archive%exchange_fixed("limit", n, self%limit)
         call archive%exchange_fixed("last_force", n, self%last_force)
         call archive%exchange_fixed("last_place", n, self%last_place)
         call archive%exchange_fixed("peak_velocity", n, self%peak_velocity)
      end associate
      call self%catalogue%exchange("catalogue", archive)
   end subroutine exchange

end module mesoslip_recording_ruptures
