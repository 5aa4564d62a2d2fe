!> What the stages of a drive came to: where each started and ended, and the extremes and the mean
!> of the drive's force in it.
!>
!> All of it is exact from the motion. The force of a spring has an extreme where the slider passes
!> the drive's velocity, which is looked for in the step in which it does; sliders whose force jumps
!> note its extremes themselves. The mean follows from the impulse of the drive. Of two passages
!> within one step, between which the force hardly changes, nothing is seen.
module mesoslip_recording_stages
   use mesoslip_extremes, only: extremes_type
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: stage_recorder_type, stage_length

   !> Numbers of a stage: its number, start time, end time, velocity of the drive at both, spring
   !> force at both, displacement at both, displacement of the drive at the start; greatest spring
   !> force, its time, displacement then; the same of the least; mean spring force
   integer, parameter :: stage_length = 17
   !> Stages that wait before the run pauses to have them taken away
   integer, parameter :: many_stages = 2000

   !> Records the stages of a drive.
   type :: stage_recorder_type
      !> The stages that are over
      type(buffer_type) :: rows
      !> Number of the present stage
      integer, private :: number = 0
      !> The motion at its start, and the velocity of the drive [m/s]
      real(wp), private :: start_time = 0.0_wp, start_velocity = 0.0_wp, start_force = 0.0_wp, &
         & start_displacement = 0.0_wp, drive_start_displacement = 0.0_wp
      !> Whether the slider, where it is pulled, is faster than the drive: the force falls
      logical, private :: is_faster = .false.
   contains
      !> Make room
      procedure, non_overridable :: open
      !> Whether so much waits that it should be taken away
      procedure, non_overridable :: is_full
      !> A stage begins, and is over
      procedure, non_overridable :: begin
      procedure, non_overridable :: finish
      !> The drive takes another velocity within a stage
      procedure, non_overridable :: mark
      !> What is of interest in a motion that is recorded here and there only
      procedure, non_overridable :: narrow
      !> Record the last advance of a slider
      procedure, non_overridable :: record
      !> Put the state into an archive or take it out
      procedure, non_overridable :: exchange
   end type stage_recorder_type

contains

   !> Make room.
   subroutine open(self)
      !> The recorder
      class(stage_recorder_type), intent(inout) :: self

      call self%rows%open(stage_length, 1)
   end subroutine open

   !> Whether so much waits that it should be taken away.
   pure function is_full(self)
      !> The recorder
      class(stage_recorder_type), intent(in) :: self
      !> Whether it does
      logical :: is_full

      is_full = self%rows%count >= many_stages
   end function is_full

   !> A stage begins: the drive has taken its velocity.
   subroutine begin(self, slider, number)
      !> The recorder
      class(stage_recorder_type), intent(inout) :: self
      !> The slider
      class(slider_type), intent(inout) :: slider
      !> Number of the stage
      integer, intent(in) :: number

      type(motion_type) :: motion

      motion = slider%observe(slider%time)
      self%number = number
      self%start_time = motion%time
      self%start_velocity = slider%drive_velocity
      self%start_force = motion%spring_force
      self%start_displacement = slider%origin + slider%displacement
      self%drive_start_displacement = motion%drive_displacement
      slider%extremes = extremes_type()
      slider%stage_impulse = accumulator_type()
      call self%mark(slider)
   end subroutine begin

   !> The drive takes another velocity within a stage: the force may have an extreme there.
   subroutine mark(self, slider)
      !> The recorder
      class(stage_recorder_type), intent(inout) :: self
      !> The slider
      class(slider_type), intent(inout) :: slider

      call note(slider, slider%time)
      self%is_faster = slider%pulled_velocity() > slider%drive_velocity
   end subroutine mark

   !> Take the force at a time of the last advance into account.
   subroutine note(slider, time)
      class(slider_type), intent(inout) :: slider
      real(wp), intent(in) :: time

      type(motion_type) :: motion

      motion = slider%observe(time)
      call slider%extremes%note(motion%spring_force, motion%time, motion%displacement)
   end subroutine note

   !> Let a filter select the steps in which the slider passes the velocity of the drive, which is
   !> constant.
   pure subroutine narrow(self, filter, slider)
      !> The recorder
      class(stage_recorder_type), intent(in) :: self
      !> The filter
      type(step_filter_type), intent(inout) :: filter
      !> The slider
      class(slider_type), intent(in) :: slider

      if (slider%notes_extremes) return
      if (self%is_faster .eqv. filter%direction > 0.0_wp) then
         filter%min_excess = max(filter%min_excess, merge(0.0_wp, -tiny(1.0_wp), self%is_faster))
      else
         filter%max_excess = min(filter%max_excess, merge(-tiny(1.0_wp), 0.0_wp, self%is_faster))
      end if
   end subroutine narrow

   !> Record the last advance of a slider.
   subroutine record(self, slider)
      !> The recorder
      class(stage_recorder_type), intent(inout) :: self
      !> The slider after its advance
      class(slider_type), intent(inout) :: slider

      logical :: is_faster

      if (slider%notes_extremes) return
      is_faster = slider%pulled_velocity() > slider%drive_velocity_at(slider%time)
      if (is_faster .eqv. self%is_faster) return
      self%is_faster = is_faster
      call note(slider, passage(slider))
   end subroutine record

   !> Time at which the slider passed the drive's velocity in the last advance, by the rule of
   !> Illinois.
   pure function passage(slider) result(time)
      class(slider_type), intent(in) :: slider
      real(wp) :: time

      integer, parameter :: most_iterations = 60
      real(wp) :: early, late, early_excess, late_excess, excess
      integer :: iteration

      early = slider%step_time
      late = slider%time
      early_excess = excess_at(early)
      late_excess = excess_at(late)
      time = merge(late, early, abs(early_excess) > 0.0_wp)
      if (.not. early_excess * late_excess < 0.0_wp) return
      do iteration = 1, most_iterations
         time = late - late_excess * ((late - early) / (late_excess - early_excess))
         if (.not. (time > min(early, late) .and. time < max(early, late))) exit
         excess = excess_at(time)
         if (excess * late_excess < 0.0_wp) then
            early = late
            early_excess = late_excess
         else
            early_excess = 0.5_wp * early_excess
         end if
         late = time
         late_excess = excess
         if (.not. abs(excess) > 0.0_wp) exit
      end do
      time = min(max(time, slider%step_time), slider%time)

   contains

      !> Velocity of the slider, where it is pulled, above that of the drive.
      pure real(wp) function excess_at(time)
         real(wp), intent(in) :: time

         type(motion_type) :: motion

         motion = slider%observe(time)
         excess_at = motion%pulled_velocity - slider%drive_velocity_at(time)
      end function excess_at

   end function passage

   !> A stage is over.
   subroutine finish(self, slider)
      !> The recorder
      class(stage_recorder_type), intent(inout) :: self
      !> The slider at the end of the stage
      class(slider_type), intent(inout) :: slider

      type(motion_type) :: motion
      real(wp) :: mean

      motion = slider%observe(slider%time)
      call note(slider, slider%time)
      mean = motion%spring_force
      if (slider%time > self%start_time) then
         mean = (slider%stage_impulse%total() + slider%impulse%total()) &
            & / (slider%time - self%start_time)
      end if
      associate (extremes => slider%extremes)
         call self%rows%add([real(self%number, wp), self%start_time, slider%time, &
            & self%start_velocity, slider%drive_velocity_at(slider%time), self%start_force, &
            & motion%spring_force, self%start_displacement, slider%origin + slider%displacement, &
            & self%drive_start_displacement, extremes%max_force, extremes%max_time, &
            & extremes%max_displacement, extremes%min_force, extremes%min_time, &
            & extremes%min_displacement, mean])
      end associate
   end subroutine finish

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The recorder
      class(stage_recorder_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%section("stages")
      call archive%exchange("number", self%number)
      call archive%exchange("start_time", self%start_time)
      call archive%exchange("start_velocity", self%start_velocity)
      call archive%exchange("start_force", self%start_force)
      call archive%exchange("start_displacement", self%start_displacement)
      call archive%exchange("drive_start_displacement", self%drive_start_displacement)
      call archive%exchange("is_faster", self%is_faster)
      call self%rows%exchange("rows", archive)
   end subroutine exchange

end module mesoslip_recording_stages
