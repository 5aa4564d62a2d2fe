!> The record of a run: a trace at fixed intervals, and slips with finer traces.
module mesoslip_recording_recorder
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_recording_slips, only: slip_parameters_type, slip_recorder_type
   use mesoslip_recording_trace, only: max_samples_in_step, trace_type
   use mesoslip_sliders_base, only: slider_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: recorder_type, recorder_parameters_type

   !> Settings of the record.
   type :: recorder_parameters_type
      !> Interval of the trace, and time at which the run ends [s]
      real(wp) :: interval = 1.0_wp, duration = 0.0_wp
      !> Number of layers whose displacements are recorded with the trace
      integer :: layers = 0
      type(slip_parameters_type) :: slips
   end type recorder_parameters_type

   !> Records a run into tables that the caller drains.
   type :: recorder_type
      type(recorder_parameters_type) :: parameters
      type(trace_type) :: trace
      type(slip_recorder_type) :: slips
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: is_full
      procedure, non_overridable :: max_step
      procedure, non_overridable :: record
      procedure, non_overridable :: step_filter
      procedure, non_overridable :: exchange
   end type recorder_type

contains

   !> Set up empty tables.
   subroutine open(self, parameters)
      class(recorder_type), intent(inout) :: self
      type(recorder_parameters_type), intent(in) :: parameters

      self%parameters = parameters
      call self%trace%open(parameters%interval, parameters%duration, parameters%layers)
      call self%slips%open(parameters%slips)
   end subroutine open

   !> Whether a table should be drained.
   pure function is_full(self)
      class(recorder_type), intent(in) :: self
      logical :: is_full

      is_full = self%trace%is_full() .or. self%slips%is_full()
   end function is_full

   !> Maximum duration of an advance [s], which bounds its samples in either trace.
   pure function max_step(self) result(time)
      class(recorder_type), intent(in) :: self
      real(wp) :: time

      time = self%parameters%interval
      if (self%parameters%slips%interval > 0.0_wp) then
         time = min(time, self%parameters%slips%interval)
      end if
      time = 0.5_wp * max_samples_in_step * time
   end function max_step

   !> Record the last advance of a slider, before the events at its end.
   subroutine record(self, slider, detached, breaks)
      class(recorder_type), intent(inout) :: self
      !> The slider after its advance
      class(slider_type), intent(in) :: slider
      !> Detached contacts during the advance
      real(wp), intent(in) :: detached
      !> Breaks before and during the advance
      real(wp), intent(in) :: breaks

      if (self%trace%next_time <= slider%time) call self%trace%take_samples(slider, detached)
      call self%slips%record(slider, detached, breaks)
   end subroutine record

   !> Filter for the first step after which record would do more than update the velocity.
   pure function step_filter(self, slider) result(filter)
      class(recorder_type), intent(in) :: self
      class(slider_type), intent(in) :: slider
      type(step_filter_type) :: filter

      filter%time = self%trace%next_time
      filter%reference = slider%drive%rate
      call self%slips%narrow(slider, filter)
   end function step_filter

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(recorder_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call self%trace%exchange(archive)
      call self%slips%exchange(archive)
   end subroutine exchange

end module mesoslip_recording_recorder
