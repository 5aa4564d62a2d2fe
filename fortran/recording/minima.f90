!> Minima of the spring force, and how much of its rise since then is ringing.
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
   integer, parameter :: row_time = 1, row_force = 2, row_length = 2

   !> Minima of the force, each above the one before: those that a later one went below are of no
   !> more use.
   type :: minima_type
      !> Time, and force times the direction of the drive
      type(buffer_type), private :: rows
   contains
      !> Make room
      procedure, non_overridable :: open
      !> Forget all minima
      procedure, non_overridable :: clear
      !> Add a minimum
      procedure, non_overridable :: add
      !> Force that ringing has regained since a time
      procedure, non_overridable :: regained_force
      !> Put the state into an archive or take it out
      procedure, non_overridable :: exchange
   end type minima_type

contains

   !> Make room.
   subroutine open(self)
      !> The minima
      class(minima_type), intent(inout) :: self

      call self%rows%open(row_length, initial_room)
   end subroutine open

   !> Forget all minima.
   subroutine clear(self)
      !> The minima
      class(minima_type), intent(inout) :: self

      self%rows%count = 0
   end subroutine clear

   !> Add a minimum.
   subroutine add(self, motion, direction)
      !> The minima
      class(minima_type), intent(inout) :: self
      !> The motion at the minimum
      type(motion_type), intent(in) :: motion
      !> Sign of the velocity of the drive
      real(wp), intent(in) :: direction

      real(wp) :: force

      force = direction * motion%elastic_force
      do while (self%rows%count > 0)
         if (self%rows%row(row_force, self%rows%count) < force) exit
         self%rows%count = self%rows%count - 1
      end do
      call self%rows%add([motion%time, force])
   end subroutine add

   !> Force that ringing has regained since a time; forget the minima before it.
   function regained_force(self, motion, direction, since) result(regained)
      !> The minima
      class(minima_type), intent(inout) :: self
      !> The motion at a maximum of the force
      type(motion_type), intent(in) :: motion
      !> Sign of the velocity of the drive
      real(wp), intent(in) :: direction
      !> The time [s]
      real(wp), intent(in) :: since
      !> The force [N]
      real(wp) :: regained

      integer :: old, minimum

      old = 0
      do while (old < self%rows%count)
         if (self%rows%row(row_time, old + 1) >= since) exit
         old = old + 1
      end do
      self%rows%count = self%rows%count - old
      do minimum = 1, self%rows%count
         self%rows%row(:, minimum) = self%rows%row(:, minimum + old)
      end do
      regained = 0.0_wp
      if (self%rows%count > 0) then
         regained = direction * motion%elastic_force - self%rows%row(row_force, 1)
      end if
   end function regained_force

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The minima
      class(minima_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call self%rows%exchange("minima", archive)
   end subroutine exchange

end module mesoslip_recording_minima
