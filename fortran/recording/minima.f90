!> Minima of the spring force, and the part of its rise since then that is ringing.
!>
!> From a minimum to a maximum the drive moves by dX_d, the block by dX, and the force rises by
!> K (dX_d - dX).
!>
!> - Ringing about smooth sliding, x = v t - A sin(w t), leads from a minimum to a maximum in half a
!>   period. If the block never stops, A w < v, then dX > (1 - 2/pi) dX_d: all of the rise is
!>   regained by ringing.
!> - The same holds if the block moves backwards, as at a slow drive: dX < -dX_d/10.
!> - A block in between sticks, and is loaded by the drive. A quarter of the rise counts as ringing,
!>   so that a slip gives back half of it.
!> - A rise of less than a quarter of a period is all ringing, against contacts.
!>
!> Where the drive becomes faster by u there is no minimum of the force. The block follows the drive
!> in a quarter of a wave, in which the force rises by K u/w: this part is ringing.
module mesoslip_recording_minima
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_sliders_base, only: motion_type
   implicit none
   private

   public :: minima_type

   !> Minima for which there is room at first
   integer, parameter :: initial_room = 16
   !> Numbers kept of a minimum
   integer, parameter :: row_time = 1, row_force = 2, row_drive = 3, row_block = 4, &
      & row_lag = 5, row_length = 5

   !> Maximum time in which ringing leads from a minimum to a maximum, in half periods of the setup
   real(wp), parameter :: max_rise_time = 1.5_wp
   real(wp), parameter :: pi = acos(-1.0_wp)
   !> Bounds of the displacement of a block that sticks, over that of the drive
   real(wp), parameter :: max_sticking_ratio = 1.0_wp - 2.0_wp / pi, min_sticking_ratio = -0.1_wp
   !> Part of the rise that counts as ringing if the block sticks
   real(wp), parameter :: min_ringing_part = 0.25_wp
   !> Maximum rise of the force until the block follows the drive, over that without contacts
   real(wp), parameter :: max_start_rise = 1.25_wp

   !> Minima of the force, each above the one before: a lower one makes those before it useless.
   type :: minima_type
      !> Time [s]; force [N], displacements of the drive and of the block [m], velocity of the drive
      !> relative to the block [m/s], all times the direction of the drive
      type(buffer_type) :: rows
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: clear
      procedure, non_overridable :: add
      procedure, non_overridable :: regained_force
      procedure, non_overridable :: exchange
   end type minima_type

contains

   subroutine open(self)
      class(minima_type), intent(inout) :: self

      call self%rows%open(row_length, initial_room)
   end subroutine open

   subroutine clear(self)
      class(minima_type), intent(inout) :: self

      self%rows%count = 0
   end subroutine clear

   !> Add a minimum.
   subroutine add(self, motion, direction, lag)
      class(minima_type), intent(inout) :: self
      !> The motion at the minimum
      type(motion_type), intent(in) :: motion
      !> Sign of the velocity of the drive
      real(wp), intent(in) :: direction
      !> Velocity of the drive relative to the block, times the direction: 0 unless the drive has
      !> become faster here [m/s]
      real(wp), intent(in) :: lag

      real(wp) :: force

      force = direction * motion%elastic_force
      do while (self%rows%count > 0)
         if (self%rows%row(row_force, self%rows%count) < force) exit
         self%rows%count = self%rows%count - 1
      end do
      call self%rows%add([motion%time, force, direction * motion%drive_displacement, &
         & direction * (motion%displacement + motion%base_displacement), lag])
   end subroutine add

   !> Force that ringing has regained [N]; minima that are too old for ringing are deleted.
   function regained_force(self, motion, direction, half_period) result(regained)
      class(minima_type), intent(inout) :: self
      !> The motion at a maximum of the force
      type(motion_type), intent(in) :: motion
      !> Sign of the velocity of the drive
      real(wp), intent(in) :: direction
      !> Half a period of the undamped setup [s]
      real(wp), intent(in) :: half_period
      real(wp) :: regained

      integer :: old, minimum

      old = 0
      do while (old < self%rows%count)
         if (self%rows%row(row_time, old + 1) >= motion%time - max_rise_time * half_period) exit
         old = old + 1
      end do
      self%rows%count = self%rows%count - old
      do minimum = 1, self%rows%count
         self%rows%row(:, minimum) = self%rows%row(:, minimum + old)
      end do
      regained = 0.0_wp
      do minimum = 1, self%rows%count
         regained = max(regained, ringing(self%rows%row(:, minimum), motion, direction, &
            & half_period))
      end do
   end function regained_force

   !> The part of the rise of the force from a minimum to a maximum that is ringing [N].
   pure function ringing(minimum, motion, direction, half_period) result(part)
      real(wp), intent(in) :: minimum(row_length)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: direction, half_period
      real(wp) :: part

      real(wp) :: drive, block, catching_up

      drive = direction * motion%drive_displacement - minimum(row_drive)
      block = direction * (motion%displacement + motion%base_displacement) - minimum(row_block)
      part = direction * motion%elastic_force - minimum(row_force)
      if (motion%time - minimum(row_time) < 0.5_wp * half_period &
         & .or. block >= max_sticking_ratio * drive .or. block <= min_sticking_ratio * drive) return
      catching_up = max_start_rise * minimum(row_lag) * half_period / pi
      part = part * min(1.0_wp, max(min_ringing_part, catching_up / (drive - block)))
   end function ringing

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(minima_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call self%rows%exchange("minima", archive)
   end subroutine exchange

end module mesoslip_recording_minima
