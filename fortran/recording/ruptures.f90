!> The catalogue of ruptures: slips of the blocks of an interface in which most contacts break.
!>
!> A block slips while it is faster than the drive by the slip velocity, and until it has been
!> slower for the quiet time. It ruptures when half of the contacts break that were pinned when it
!> was slow and most of them were: in the slip, or just before it, as contacts that break together
!> do before the block gets fast.
module mesoslip_recording_ruptures
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
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

   !> The slip of a block.
   type :: block_slip_type
      logical :: is_open = .false.
      !> When it began, when the block was fast last, and when it ruptured, or never [s]
      real(wp) :: start_time = 0.0_wp, last_time = 0.0_wp, rupture_time = never
      !> End of the first step after which most contacts were not pinned; never if they are, 0 if
      !> no rupture is pending [s]
      real(wp) :: detached_time = 0.0_wp
      !> Force [N], displacement [m] and breaks when the block was slow last with most contacts
      !> pinned, and breaks at which it ruptures
      real(wp) :: start_force = 0.0_wp, start_place = 0.0_wp, start_breaks = 0.0_wp, limit = never
      !> Force [N] and displacement [m] when it was fast last, and maximum of its velocity [m/s]
      real(wp) :: last_force = 0.0_wp, last_place = 0.0_wp, peak_velocity = 0.0_wp
   end type block_slip_type

   !> Records ruptures.
   type :: rupture_recorder_type
      !> Ruptures that are over
      type(buffer_type) :: catalogue
      !> Velocity above the drive's that is a slip [m/s], and time after which one is over [s]
      real(wp), private :: slip_velocity = 0.0_wp, quiet_time = 0.0_wp
      integer :: blocks = 0
      type(block_slip_type), allocatable, private :: slip(:)
   contains
      procedure, non_overridable :: open, is_full, note_breaks, note_motion, finish, exchange
      procedure, non_overridable, private :: close_slip
   end type rupture_recorder_type

contains

   !> Set up an empty catalogue.
   subroutine open(self, blocks, slip_velocity, quiet_time, error)
      class(rupture_recorder_type), intent(inout) :: self
      !> Number of blocks; 0: nothing is recorded
      integer, intent(in) :: blocks
      !> Velocity above the drive's that is a slip [m/s], and time after which one is over [s]
      real(wp), intent(in) :: slip_velocity, quiet_time
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      self%blocks = blocks
      self%slip_velocity = slip_velocity
      self%quiet_time = quiet_time
      call self%catalogue%open(rupture_length, merge(blocks + 1, 0, blocks > 0))
      allocate (self%slip(blocks), stat=stat)
      if (stat /= 0) call raise(error, status_memory, "not enough memory for the ruptures")
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

      if (breaks >= self%slip(block)%limit) then
         self%slip(block)%rupture_time = time
         self%slip(block)%limit = never
      end if
   end subroutine note_breaks

   !> A block moves: its slip begins, continues or ends.
   subroutine note_motion(self, block, time, excess, place, force, breaks, pinned, pinned_part)
      class(rupture_recorder_type), intent(inout) :: self
      integer, intent(in) :: block
      !> Time [s], velocity above the drive's along its direction [m/s], displacement [m]
      real(wp), intent(in) :: time, excess, place
      !> Force on the contacts [N], breaks so far, pinned contacts, and their part of all contacts
      real(wp), intent(in) :: force, breaks, pinned, pinned_part

      associate (slip => self%slip(block))
         if (excess > self%slip_velocity) then
            if (.not. slip%is_open) then
               slip%is_open = .true.
               slip%start_time = min(time, slip%rupture_time)
            end if
            slip%last_time = time
            slip%last_force = force
            slip%last_place = place
            slip%peak_velocity = max(slip%peak_velocity, excess)
            return
         end if
         if (slip%is_open .and. time > slip%last_time + self%quiet_time) then
            call self%close_slip(block, breaks)
         end if
         if (slip%is_open) return
         if (pinned_part >= broken_part) then
            slip = block_slip_type(detached_time=never, start_force=force, start_place=place, &
               & start_breaks=breaks, limit=breaks + max(1.0_wp, broken_part * pinned))
            return
         end if
         ! A row at rest may have been pinned all along a step that its break ends.
         slip%detached_time = min(slip%detached_time, time)
         ! It slides without a slip.
         if (time > slip%detached_time + self%quiet_time) slip = block_slip_type()
      end associate
   end subroutine note_motion

   !> The slip of a block is over: it may have been a rupture.
   subroutine close_slip(self, block, breaks)
      class(rupture_recorder_type), intent(inout) :: self
      integer, intent(in) :: block
      real(wp), intent(in) :: breaks

      associate (slip => self%slip(block))
         if (slip%rupture_time < never) then
            call self%catalogue%add([real(block, wp), slip%start_time, slip%rupture_time, &
               & max(slip%last_time, slip%rupture_time), slip%start_force, slip%last_force, &
               & slip%last_place - slip%start_place, slip%peak_velocity, &
               & breaks - slip%start_breaks])
         end if
         slip = block_slip_type()
      end associate
   end subroutine close_slip

   !> The run is over: so are all slips.
   subroutine finish(self, breaks)
      class(rupture_recorder_type), intent(inout) :: self
      !> Breaks so far of each block
      real(wp), intent(in) :: breaks(:)

      integer :: block

      do block = 1, self%blocks
         if (self%slip(block)%is_open) call self%close_slip(block, breaks(block))
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
         associate (slip => self%slip(block))
            call archive%exchange("is_open", slip%is_open)
            call archive%exchange("start_time", slip%start_time)
            call archive%exchange("last_time", slip%last_time)
            call archive%exchange("rupture_time", slip%rupture_time)
            call archive%exchange("detached_time", slip%detached_time)
            call archive%exchange("start_force", slip%start_force)
            call archive%exchange("start_place", slip%start_place)
            call archive%exchange("start_breaks", slip%start_breaks)
            call archive%exchange("limit", slip%limit)
            call archive%exchange("last_force", slip%last_force)
            call archive%exchange("last_place", slip%last_place)
            call archive%exchange("peak_velocity", slip%peak_velocity)
         end associate
      end do
      call self%catalogue%exchange("catalogue", archive)
   end subroutine exchange

end module mesoslip_recording_ruptures
