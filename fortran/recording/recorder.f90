!> What is kept of a run: a trace at fixed intervals, a catalogue of slips, finer traces of them.
!>
!> Samples are taken from the motion between events, so how often one looks does not change a run.
!>
!> The spring force of a slip is the mean elastic force of a slider of layers, K (X_d - X_1): the
!> force at the drive has the waves in the slider as well.
!>
!> A slip starts where the spring force is greatest, that is where the slider becomes faster than
!> the drive, if it goes on to exceed the drive's velocity by the slip velocity. It ends where the
!> spring force is least, before the slider has been slow again for half a period of the setup.
!> While the slider is still ringing, a new slip starts if the spring force has regained half its
!> drop and most contacts are pinned.
module mesoslip_recording_recorder
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   implicit none
   private

   public :: recorder_type, recorder_parameters_type
   public :: trace_length, slip_trace_length, slip_length, most_samples_in_step

   !> Numbers in a sample: time, displacement of the drive, displacement, velocity, spring force,
   !> contact force, detached contacts, elastic force, displacement of the base
   integer, parameter :: trace_length = 9
   !> A sample of a slip trace has the number of the slip as well
   integer, parameter :: slip_trace_length = trace_length + 1
   !> Numbers of a slip: its number, start time, end time, spring force before and after, peak
   !> velocity, contacts broken
   integer, parameter :: slip_length = 7
   !> Steps must be shorter than this many samples of either trace.
   integer, parameter :: most_samples_in_step = 1000

   !> A part of an interval that counts as nothing.
   real(wp), parameter :: tiny_part = 1.0e-6_wp

   integer, parameter :: phase_slow = 0, phase_fast = 1, phase_slip = 2

   !> What to record.
   type :: recorder_parameters_type
      !> Interval of the trace [s]
      real(wp) :: interval = 1.0_wp
      !> Interval of the finer traces [s]; zero for none
      real(wp) :: slip_interval = 0.0_wp
      !> Velocity above the drive's that makes a slip [m/s]; zero for no slips
      real(wp) :: slip_velocity = 0.0_wp
      !> Half a period of the setup [s]
      real(wp) :: quiet_time = 0.0_wp
      !> Time at which the run ends [s]
      real(wp) :: duration = 0.0_wp
      !> Contacts in all
      integer :: contacts = 0
   end type recorder_parameters_type

   !> Records a run into arrays of the caller.
   type :: recorder_type
      !> What to record
      type(recorder_parameters_type) :: parameters
      !> Samples and slips in the caller's arrays so far
      integer :: trace_count = 0, slip_trace_count = 0, slip_count = 0
      !> Samples of slip traces that will not be taken back
      integer, private :: kept_count = 0

      !> Samples of the trace so far
      integer(i8), private :: samples = 0
      !> Time of the next one [s]
      real(wp), private :: next_sample = 0.0_wp
      integer, private :: phase = phase_slow
      !> Number of the present slip, or of the next
      integer(i8), private :: slip = 0
      !> Samples of the present slip's trace so far
      integer(i8), private :: slip_samples = 0
      !> Time of the next one [s]
      real(wp), private :: next_slip_sample = huge(1.0_wp)
      real(wp), private :: sense = 1.0_wp, last_excess = 0.0_wp, last_fast = 0.0_wp
      real(wp), private :: start_time = 0.0_wp, end_time = 0.0_wp, force_before = 0.0_wp
      real(wp), private :: force_after = 0.0_wp, peak_velocity = 0.0_wp
      real(wp), private :: breaks_before = 0.0_wp, breaks_after = 0.0_wp
      logical, private :: has_least = .false.

      real(wp), pointer, contiguous, private :: trace(:, :) => null()
      real(wp), pointer, contiguous, private :: slip_trace(:, :) => null()
      real(wp), pointer, contiguous, private :: slips(:, :) => null()
      real(wp), pointer, contiguous, private :: layers(:, :) => null()
   contains
      !> Use arrays of the caller
      procedure :: attach
      !> Whether the caller's arrays have room for one more step
      procedure :: has_room
      !> Record the last advance of a slider
      procedure :: record
      !> Close a slip at the end of the run
      procedure :: finish
      !> Put the state into an archive or take it out
      procedure :: exchange
      procedure, private :: begin_fast, follow_slip, close_slip, take_samples, take_slip_samples
   end type recorder_type

contains

   !> Use arrays of the caller, empty.
   subroutine attach(self, trace, slip_trace, slips, layers)
      !> The recorder
      class(recorder_type), intent(inout) :: self
      !> Samples, shape (trace_length, capacity)
      real(wp), intent(inout), target, contiguous :: trace(:, :)
      !> Samples of slip traces, shape (slip_trace_length, capacity)
      real(wp), intent(inout), target, contiguous :: slip_trace(:, :)
      !> Slips, shape (slip_length, capacity)
      real(wp), intent(inout), target, contiguous :: slips(:, :)
      !> Displacements of the layers at the samples of the trace, shape (layers, capacity); without
      !> layers none are recorded
      real(wp), intent(inout), target, contiguous :: layers(:, :)

      self%layers => layers
      self%trace => trace
      self%slip_trace => slip_trace
      self%slips => slips
   end subroutine attach

   !> Whether the caller's arrays have room for one more step.
   pure function has_room(self)
      !> The recorder
      class(recorder_type), intent(in) :: self
      !> Whether the next advance can be recorded
      logical :: has_room

      has_room = self%trace_count + most_samples_in_step < size(self%trace, 2) &
         & .and. self%slip_trace_count + most_samples_in_step < size(self%slip_trace, 2) &
         & .and. self%slip_count < size(self%slips, 2)
   end function has_room

   !> Record the last advance of a slider, before the events at its end.
   subroutine record(self, slider, detached, breaks)
      !> The recorder
      class(recorder_type), intent(inout) :: self
      !> The slider after its advance
      class(slider_type), intent(in) :: slider
      !> Detached contacts during the advance
      real(wp), intent(in) :: detached
      !> Breaks before and during the advance
      real(wp), intent(in) :: breaks

      real(wp) :: excess, start_excess

      if (self%next_sample <= slider%time) call self%take_samples(slider, detached)
      if (self%parameters%slip_velocity <= 0.0_wp) return

      if (self%phase == phase_slow .and. abs(slider%drive_velocity) > 0.0_wp) then
         self%sense = sign(1.0_wp, slider%drive_velocity)
      end if
      start_excess = self%last_excess
      excess = self%sense * (slider%velocity - slider%drive_velocity)
      self%last_excess = excess
      if (self%phase == phase_slow) then
         if (excess <= 0.0_wp) return
         call self%begin_fast(slider, start_excess, breaks)
      end if

      if (self%next_slip_sample <= slider%time) call self%take_slip_samples(slider, detached)
      if (self%phase == phase_fast) then
         if (excess > self%parameters%slip_velocity) then
            self%phase = phase_slip
         else if (excess <= 0.0_wp) then
            self%phase = phase_slow
            self%slip_trace_count = min(self%slip_trace_count, self%kept_count)
            return
         end if
      end if
      if (self%phase == phase_slip) then
         call self%follow_slip(slider, start_excess, excess, detached, breaks)
      end if
   end subroutine record

   !> Take the samples of the trace that the last advance of a slider came past.
   subroutine take_samples(self, slider, detached)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: detached

      do while (self%next_sample <= slider%time)
         self%trace_count = self%trace_count + 1
         self%trace(:, self%trace_count) = sample(slider%observe(self%next_sample), detached)
         if (size(self%layers, 1) > 0) call slider%observe_layers(self%next_sample, &
            & self%layers(:, self%trace_count))
         self%samples = self%samples + 1
         self%next_sample = real(self%samples, wp) * self%parameters%interval
         ! The end of the run is a sample if rounding alone keeps it from being one.
         if (abs(self%next_sample - self%parameters%duration) &
            & <= self%parameters%interval * tiny_part) self%next_sample = self%parameters%duration
      end do
   end subroutine take_samples

   !> The slider has become faster than the drive: a slip may start here.
   subroutine begin_fast(self, slider, start_excess, breaks)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: start_excess
      real(wp), intent(in) :: breaks

      type(motion_type) :: motion

      motion = slider%observe(slider%step_time)
      if (start_excess < 0.0_wp) motion = pace(slider)
      self%phase = phase_fast
      self%start_time = motion%time
      self%force_before = motion%elastic_force
      self%breaks_before = breaks
      self%peak_velocity = 0.0_wp
      self%has_least = .false.
      self%slip_samples = 0
      self%next_slip_sample = huge(1.0_wp)
      if (self%parameters%slip_interval > 0.0_wp) self%next_slip_sample = self%start_time
      self%kept_count = self%slip_trace_count
   end subroutine begin_fast

   !> Follow a slip through the last advance of a slider.
   subroutine follow_slip(self, slider, start_excess, excess, detached, breaks)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: start_excess, excess
      real(wp), intent(in) :: detached
      real(wp), intent(in) :: breaks

      type(motion_type) :: motion

      self%peak_velocity = max(self%peak_velocity, self%sense * slider%velocity)
      if (self%sense * slider%start_acceleration > 0.0_wp &
         & .and. self%sense * slider%acceleration < 0.0_wp) then
         self%peak_velocity = max(self%peak_velocity, self%sense * fastest(slider, self%sense))
      end if

      if (abs(excess) > self%parameters%slip_velocity) then
         self%last_fast = slider%time
      else if (slider%time - self%last_fast > self%parameters%quiet_time) then
         call self%close_slip(slider%observe(slider%time), breaks)
         self%phase = phase_slow
         return
      end if

      if (start_excess > 0.0_wp .and. excess <= 0.0_wp) then
         motion = pace(slider)
         if (.not. self%has_least .or. &
            & self%sense * (motion%elastic_force - self%force_after) < 0.0_wp) then
            self%has_least = .true.
            self%end_time = motion%time
            self%force_after = motion%elastic_force
            self%breaks_after = breaks
         end if
      else if (start_excess <= 0.0_wp .and. excess > 0.0_wp .and. self%has_least) then
         motion = pace(slider)
         if (self%sense * (motion%elastic_force - self%force_after) &
            & >= 0.5_wp * self%sense * (self%force_before - self%force_after) &
            & .and. 2.0_wp * detached < self%parameters%contacts) then
            call self%close_slip(motion, breaks)
            call self%begin_fast(slider, start_excess, breaks)
         end if
      end if
   end subroutine follow_slip

   !> Put a slip into the catalogue.
   subroutine close_slip(self, motion, breaks)
      class(recorder_type), intent(inout) :: self
      !> Motion at the time of closing, the end of a slip without a least spring force
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: breaks

      if (.not. self%has_least) then
         self%end_time = motion%time
         self%force_after = motion%elastic_force
         self%breaks_after = breaks
      end if
      self%slip_count = self%slip_count + 1
      self%slips(:, self%slip_count) = [real(self%slip, wp), self%start_time, self%end_time, &
         & self%force_before, self%force_after, self%sense * self%peak_velocity, &
         & self%breaks_after - self%breaks_before]
      self%slip = self%slip + 1
      self%kept_count = self%slip_trace_count
   end subroutine close_slip

   !> Close a slip at the end of the run, if its spring force has passed the least.
   subroutine finish(self, slider, breaks)
      !> The recorder, with room for one slip
      class(recorder_type), intent(inout) :: self
      !> The slider at the end of the run
      class(slider_type), intent(in) :: slider
      !> Breaks in the run
      real(wp), intent(in) :: breaks

      if (self%phase == phase_slip .and. self%has_least) then
         call self%close_slip(slider%observe(slider%time), breaks)
      else
         self%slip_trace_count = min(self%slip_trace_count, self%kept_count)
      end if
      self%phase = phase_slow
   end subroutine finish

   !> Take the finer samples that the last advance of a slider came past.
   subroutine take_slip_samples(self, slider, detached)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: detached

      do while (self%next_slip_sample <= slider%time)
         self%slip_trace_count = self%slip_trace_count + 1
         self%slip_trace(:trace_length, self%slip_trace_count) &
            & = sample(slider%observe(self%next_slip_sample), detached)
         self%slip_trace(slip_trace_length, self%slip_trace_count) = real(self%slip, wp)
         self%slip_samples = self%slip_samples + 1
         self%next_slip_sample = self%start_time &
            & + real(self%slip_samples, wp) * self%parameters%slip_interval
      end do
   end subroutine take_slip_samples

   !> A sample of the trace.
   pure function sample(motion, detached)
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: detached
      real(wp) :: sample(trace_length)

      sample = [motion%time, motion%drive_displacement, motion%displacement, motion%velocity, &
         & motion%spring_force, motion%contact_force, detached, &
         & motion%elastic_force, motion%base_displacement]
   end function sample

   !> Motion where the velocity passed that of the drive during the last advance.
   pure function pace(slider) result(motion)
      class(slider_type), intent(in) :: slider
      type(motion_type) :: motion

      integer, parameter :: bisections = 50
      real(wp) :: early, late, start
      integer :: bisection

      early = slider%step_time
      late = slider%time
      motion = slider%observe(early)
      start = motion%velocity - slider%drive_velocity
      do bisection = 1, bisections
         motion = slider%observe(0.5_wp * (early + late))
         if ((motion%velocity - slider%drive_velocity) * start > 0.0_wp) then
            early = motion%time
         else
            late = motion%time
         end if
         if (late - early <= spacing(late)) exit
      end do
   end function pace

   !> Greatest velocity, in a sense, during the last advance, by golden section.
   pure function fastest(slider, sense) result(velocity)
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: sense
      real(wp) :: velocity

      integer, parameter :: sections = 40
      real(wp), parameter :: golden = 0.5_wp * (sqrt(5.0_wp) - 1.0_wp)
      real(wp) :: early, late
      type(motion_type) :: left, right
      integer :: section

      early = slider%step_time
      late = slider%time
      left = slider%observe(late - golden * (late - early))
      right = slider%observe(early + golden * (late - early))
      do section = 1, sections
         if (sense * left%velocity > sense * right%velocity) then
            late = right%time
            right = left
            left = slider%observe(late - golden * (late - early))
         else
            early = left%time
            left = right
            right = slider%observe(early + golden * (late - early))
         end if
      end do
      velocity = left%velocity
   end function fastest

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The recorder
      class(recorder_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%exchange(self%samples)
      call archive%exchange(self%next_sample)
      call archive%exchange(self%phase)
      call archive%exchange(self%slip)
      call archive%exchange(self%slip_samples)
      call archive%exchange(self%next_slip_sample)
      call archive%exchange(self%sense)
      call archive%exchange(self%last_excess)
      call archive%exchange(self%last_fast)
      call archive%exchange(self%start_time)
      call archive%exchange(self%end_time)
      call archive%exchange(self%force_before)
      call archive%exchange(self%force_after)
      call archive%exchange(self%peak_velocity)
      call archive%exchange(self%breaks_before)
      call archive%exchange(self%breaks_after)
      call archive%exchange(self%has_least)
   end subroutine exchange

end module mesoslip_recording_recorder
