!> Whether a motion is steady, from means of the drive's force over blocks.
!>
!> Each block is an equal distance of the drive at a constant velocity. Two means are compared, over
!> the last n blocks and the n blocks before. The state is steady as soon as they agree within the
!> standard error of their difference, by the scatter of the last blocks, or within a tolerance, and
!> the blocks before do not scatter twice as much. A force that drifts is not steady: where it
!> changes evenly over twice n blocks, the difference is some sqrt(6 n) standard errors. Nor is a
!> change that decays fast.
module mesoslip_recording_steady
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: steady_recorder_type

   !> Means over the latest blocks.
   type :: steady_recorder_type
      !> Distance of the drive in a block [m]; 0: no steady state is looked for
      real(wp) :: distance = 0.0_wp
      !> Number of blocks in a mean, at least 2
      integer :: blocks = 2
      !> Difference of means that is ignored [N]
      real(wp) :: tolerance = 0.0_wp
      !> Time at which the present block ends [s]; huge if no steady state is looked for
      real(wp) :: block_end = huge(1.0_wp)

      !> Time at which the first block began [s], blocks that are over, and time of one [s]
      real(wp), private :: start_time = 0.0_wp, duration = 0.0_wp
      integer, private :: number = 0
      !> Impulse of the drive up to the last of them [N s]
      real(wp), private :: impulse = 0.0_wp
      !> Means over the latest blocks, each at its number modulo their number, shape (2 blocks) [N]
      real(wp), allocatable, private :: mean(:)
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: is_open
      procedure, non_overridable :: begin
      procedure, non_overridable :: end_block
      procedure, non_overridable :: exchange
   end type steady_recorder_type

contains

   !> Set the parameters, as in the type.
   subroutine open(self, distance, blocks, tolerance)
      class(steady_recorder_type), intent(inout) :: self
      real(wp), intent(in) :: distance
      integer, intent(in) :: blocks
      real(wp), intent(in) :: tolerance

      self%distance = distance
      self%blocks = max(2, blocks)
      self%tolerance = tolerance
      self%mean = [real(wp) ::]
      if (distance > 0.0_wp) then
         deallocate (self%mean)
         allocate (self%mean(0:2 * self%blocks - 1), source=0.0_wp)
      end if
   end subroutine open

   !> Whether the parameters are set.
   pure function is_open(self)
      class(steady_recorder_type), intent(in) :: self
      logical :: is_open

      is_open = allocated(self%mean)
   end function is_open

   !> Begin with the first block.
   subroutine begin(self, time, velocity, impulse)
      class(steady_recorder_type), intent(inout) :: self
      !> Time now [s], constant velocity of the drive [m/s], its impulse in the stage so far [N s]
      real(wp), intent(in) :: time, velocity, impulse

      self%block_end = huge(1.0_wp)
      self%number = 0
      self%impulse = impulse
      if (.not. (self%distance > 0.0_wp .and. abs(velocity) > 0.0_wp)) return
      self%start_time = time
      self%duration = self%distance / abs(velocity)
      self%block_end = self%start_time + self%duration
   end subroutine begin

   !> A block is over: is the state steady?
   subroutine end_block(self, impulse, is_steady)
      class(steady_recorder_type), intent(inout) :: self
      !> Impulse of the drive in the stage so far [N s]
      real(wp), intent(in) :: impulse
      logical, intent(out) :: is_steady

      real(wp) :: late, early, scatter, scatter_before
      logical :: is_late(0:2 * self%blocks - 1)
      integer :: age, blocks

      blocks = self%blocks
      self%mean(modulo(self%number, 2 * blocks)) = (impulse - self%impulse) / self%duration
      self%impulse = impulse
      self%number = self%number + 1
      self%block_end = self%start_time + (self%number + 1) * self%duration
      is_steady = .false.
      if (self%number < 2 * blocks) return

      is_late = .false.
      do age = 1, blocks
         is_late(modulo(self%number - age, 2 * blocks)) = .true.
      end do
      late = sum(self%mean, is_late) / blocks
      early = sum(self%mean, .not. is_late) / blocks
      scatter = sqrt(sum((self%mean - late)**2, is_late) / (blocks - 1))
      scatter_before = sqrt(sum((self%mean - early)**2, .not. is_late) / (blocks - 1))
      is_steady = abs(late - early) <= max(sqrt(2.0_wp / blocks) * scatter, self%tolerance) &
         & .and. scatter_before <= max(2.0_wp * scatter, self%tolerance)
   end subroutine end_block

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(steady_recorder_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("steady state")
      call archive%exchange("block_end", self%block_end)
      call archive%exchange("start_time", self%start_time)
      call archive%exchange("duration", self%duration)
      call archive%exchange("number", self%number)
      call archive%exchange("impulse", self%impulse)
      call archive%exchange_fixed("mean", [size(self%mean), 1], self%mean)
   end subroutine exchange

end module mesoslip_recording_steady
