!> Results of the stages of a drive: start and end of each, with extremes and mean of the drive's
!> force.
!>
!> All are exact. Sliders note the extremes of the force; the mean follows from the impulse of the
!> drive.
module mesoslip_recording_stages
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   implicit none
   private

   public :: stage_recorder_type, stage_columns

   !> Columns of the stages that are over; forces are those of the spring
   character(len=*), parameter :: stage_columns(*) = [character(len=name_length) :: &
      & "stage_number", "stage_start_time", "stage_end_time", "drive_start_velocity", &
      & "drive_end_velocity", "start_force", "end_force", "start_displacement", &
      & "end_displacement", "drive_start_displacement", "max_force", "max_force_time", &
      & "max_force_displacement", "min_force", "min_force_time", &
      & "min_force_displacement", "mean_force"]
   integer, parameter :: stage_length = size(stage_columns)
   !> Number of stages at which the run pauses so that they are drained
   integer, parameter :: pausing_stages = 2000

   !> Records the stages of a drive.
   type :: stage_recorder_type
      !> The stages that are over
      type(buffer_type) :: rows
      !> Number of the present stage
      integer, private :: number = 0
      !> Motion and velocity of the drive at its start
      real(wp), private :: start_time = 0.0_wp, start_velocity = 0.0_wp, start_force = 0.0_wp, &
         & start_displacement = 0.0_wp, drive_start_displacement = 0.0_wp
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: is_full
      procedure, non_overridable :: begin
      procedure, non_overridable :: finish
      procedure, non_overridable :: exchange
   end type stage_recorder_type

contains

   !> Set up an empty table.
   subroutine open(self)
      class(stage_recorder_type), intent(inout) :: self

      call self%rows%open(stage_length, 1)
   end subroutine open

   !> Whether the table should be drained.
   pure function is_full(self)
      class(stage_recorder_type), intent(in) :: self
      logical :: is_full

      is_full = self%rows%count >= pausing_stages
   end function is_full

   !> A stage begins: the drive has taken its velocity.
   subroutine begin(self, slider, number)
      class(stage_recorder_type), intent(inout) :: self
      class(slider_type), intent(inout) :: slider
      !> Number of the stage
      integer, intent(in) :: number

      type(motion_type) :: motion

      motion = slider%observe(slider%time)
      self%number = number
      self%start_time = motion%time
      self%start_velocity = slider%drive%rate
      self%start_force = motion%spring_force
      self%start_displacement = slider%origin + slider%displacement
      self%drive_start_displacement = motion%drive_displacement
      call slider%drive%begin_stage()
      call slider%mark_extreme()
   end subroutine begin

   !> A stage is over.
   subroutine finish(self, slider)
      class(stage_recorder_type), intent(inout) :: self
      !> The slider at the end of the stage
      class(slider_type), intent(inout) :: slider

      type(motion_type) :: motion
      real(wp) :: mean

      motion = slider%observe(slider%time)
      call slider%note_force(slider%time)
      mean = motion%spring_force
      if (slider%time > self%start_time) then
         mean = slider%drive%stage_impulse() / (slider%time - self%start_time)
      end if
      associate (extremes => slider%drive%extremes)
         call self%rows%add([real(self%number, wp), self%start_time, slider%time, &
            & self%start_velocity, slider%drive%rate_at(slider%time), self%start_force, &
            & motion%spring_force, self%start_displacement, slider%origin + slider%displacement, &
            & self%drive_start_displacement, extremes%max_force, extremes%max_time, &
            & extremes%max_displacement, extremes%min_force, extremes%min_time, &
            & extremes%min_displacement, mean])
      end associate
   end subroutine finish

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(stage_recorder_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("stages")
      call archive%exchange("number", self%number)
      call archive%exchange("start_time", self%start_time)
      call archive%exchange("start_velocity", self%start_velocity)
      call archive%exchange("start_force", self%start_force)
      call archive%exchange("start_displacement", self%start_displacement)
      call archive%exchange("drive_start_displacement", self%drive_start_displacement)
      call self%rows%exchange("rows", archive)
   end subroutine exchange

end module mesoslip_recording_stages
