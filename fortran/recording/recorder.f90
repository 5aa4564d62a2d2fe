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
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   use mesoslip_watch, only: watch_type
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
   !> Samples of either trace, and slips, that wait before the run pauses to have them taken away
   integer, parameter :: many_samples = 20000, many_slips = 2000

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
      !> Layers whose displacements go with the trace
      integer :: layers = 0
   end type recorder_parameters_type

   !> Records a run into tables that the caller empties.
   type :: recorder_type
      !> What to record
      type(recorder_parameters_type) :: parameters
      !> Samples, samples of slip traces, slips, and displacements of the layers at the samples
      type(buffer_type) :: trace, slip_trace, slips, layers
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
   contains
      !> Make room for what will be recorded
      procedure :: open
      !> Whether so much waits that it should be taken away
      procedure :: is_full
      !> Samples of slip traces that can be taken away
      procedure :: final_slip_samples
      !> Take samples of slip traces away
      procedure :: drain_slip_trace
      !> Record the last advance of a slider
      procedure :: record
      !> What to look at in a motion that is recorded here and there only, and what to make of the
      !> rest
      procedure :: watch
      procedure :: pass_over
      !> Close a slip at the end of the run
      procedure :: finish
      !> Put the state into an archive or take it out
      procedure :: exchange
      procedure, private :: begin_fast, follow_slip, close_slip, take_samples, take_slip_samples
   end type recorder_type

contains

   !> Make room for what will be recorded.
   subroutine open(self, parameters)
      !> The recorder
      class(recorder_type), intent(inout) :: self
      !> What to record
      type(recorder_parameters_type), intent(in) :: parameters

      self%parameters = parameters
      call self%trace%open(trace_length, many_samples + most_samples_in_step)
      call self%slip_trace%open(slip_trace_length, many_samples + most_samples_in_step)
      call self%slips%open(slip_length, many_slips)
      call self%layers%open(parameters%layers, many_samples + most_samples_in_step)
   end subroutine open

   !> Whether so much waits that it should be taken away.
   pure function is_full(self)
      !> The recorder
      class(recorder_type), intent(in) :: self
      !> Whether it does
      logical :: is_full

      is_full = self%trace%count >= many_samples .or. self%final_slip_samples() >= many_samples &
         & .or. self%slips%count >= many_slips
   end function is_full

   !> Samples of slip traces that can be taken away: not those of what may come to no slip.
   pure function final_slip_samples(self) result(number)
      !> The recorder
      class(recorder_type), intent(in) :: self
      !> Their number
      integer :: number

      number = self%slip_trace%count
      if (self%phase == phase_fast) number = self%kept_count
   end function final_slip_samples

   !> Take samples of slip traces away.
   subroutine drain_slip_trace(self, values)
      !> The recorder
      class(recorder_type), intent(inout) :: self
      !> As many samples as can be taken or fewer, shape (slip_trace_length, samples)
      real(wp), intent(out) :: values(:, :)

      call self%slip_trace%drain(values)
      self%kept_count = max(0, self%kept_count - size(values, 2))
   end subroutine drain_slip_trace

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
            self%slip_trace%count = min(self%slip_trace%count, self%kept_count)
            return
         end if
      end if
      if (self%phase == phase_slip) then
         call self%follow_slip(slider, start_excess, excess, detached, breaks)
      end if
   end subroutine record

   !> The first steps of a slider after which record would do more than take note of the velocity.
   pure function watch(self, slider)
      !> The recorder
      class(recorder_type), intent(in) :: self
      !> The slider
      class(slider_type), intent(in) :: slider
      !> What is of interest
      type(watch_type) :: watch

      watch%time = self%next_sample
      if (self%parameters%slip_velocity <= 0.0_wp) return

      watch%reference = slider%drive_velocity
      watch%sense = self%sense
      select case (self%phase)
      case (phase_slow)
         if (abs(slider%drive_velocity) > 0.0_wp) watch%sense = sign(1.0_wp, slider%drive_velocity)
         watch%upto = 0.0_wp
         return
      case (phase_fast)
         watch%above = 0.0_wp
         watch%upto = self%parameters%slip_velocity
      case default
         watch%peaks = .true.
         associate (fast => self%parameters%slip_velocity)
            if (self%last_excess > fast) then
               watch%above = fast
            else if (self%last_excess > 0.0_wp) then
               watch%above = 0.0_wp
               watch%upto = fast
            else if (self%last_excess >= -fast) then
               watch%above = nearest(-fast, -1.0_wp)
               watch%upto = 0.0_wp
            else
               watch%upto = nearest(-fast, -1.0_wp)
            end if
            if (abs(self%last_excess) <= fast) then
               ! A step or two too early does no harm.
               watch%time = min(watch%time, self%last_fast + self%parameters%quiet_time &
                  & - 4.0_wp * spacing(self%last_fast + self%parameters%quiet_time))
            end if
         end associate
      end select
      watch%time = min(watch%time, self%next_slip_sample)
   end function watch

   !> Take note of steps of a slider that were of no interest.
   subroutine pass_over(self, watch)
      !> The recorder
      class(recorder_type), intent(inout) :: self
      !> The watch that was kept
      type(watch_type), intent(in) :: watch

      if (self%parameters%slip_velocity <= 0.0_wp .or. .not. watch%has_passed) return
      self%last_excess = watch%excess
      if (self%phase == phase_slow) self%sense = watch%sense
      if (self%phase /= phase_slip) return
      self%peak_velocity = max(self%peak_velocity, watch%fastest)
      if (abs(watch%excess) > self%parameters%slip_velocity) self%last_fast = watch%passed_time
   end subroutine pass_over

   !> Take the samples of the trace that the last advance of a slider came past.
   subroutine take_samples(self, slider, detached)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: detached

      do while (self%next_sample <= slider%time)
         call self%trace%add(sample(slider%observe(self%next_sample), detached))
         if (self%parameters%layers > 0) then
            call self%layers%reserve()
            self%layers%count = self%layers%count + 1
            call slider%observe_layers(self%next_sample, self%layers%row(:, self%layers%count))
         end if
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
      self%kept_count = self%slip_trace%count
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
      call self%slips%add([real(self%slip, wp), self%start_time, self%end_time, &
         & self%force_before, self%force_after, self%sense * self%peak_velocity, &
         & self%breaks_after - self%breaks_before])
      self%slip = self%slip + 1
      self%kept_count = self%slip_trace%count
   end subroutine close_slip

   !> Close a slip at the end of the run, if its spring force has passed the least.
   subroutine finish(self, slider, breaks)
      !> The recorder
      class(recorder_type), intent(inout) :: self
      !> The slider at the end of the run
      class(slider_type), intent(in) :: slider
      !> Breaks in the run
      real(wp), intent(in) :: breaks

      if (self%phase == phase_slip .and. self%has_least) then
         call self%close_slip(slider%observe(slider%time), breaks)
      else
         self%slip_trace%count = min(self%slip_trace%count, self%kept_count)
      end if
      self%phase = phase_slow
   end subroutine finish

   !> Take the finer samples that the last advance of a slider came past.
   subroutine take_slip_samples(self, slider, detached)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: detached

      do while (self%next_slip_sample <= slider%time)
         call self%slip_trace%add([sample(slider%observe(self%next_slip_sample), detached), &
            & real(self%slip, wp)])
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

      call archive%section("recorder")
      call archive%exchange("samples", self%samples)
      call archive%exchange("next_sample", self%next_sample)
      call archive%exchange("phase", self%phase)
      call archive%exchange("slip", self%slip)
      call archive%exchange("slip_samples", self%slip_samples)
      call archive%exchange("next_slip_sample", self%next_slip_sample)
      call archive%exchange("sense", self%sense)
      call archive%exchange("last_excess", self%last_excess)
      call archive%exchange("last_fast", self%last_fast)
      call archive%exchange("start_time", self%start_time)
      call archive%exchange("end_time", self%end_time)
      call archive%exchange("force_before", self%force_before)
      call archive%exchange("force_after", self%force_after)
      call archive%exchange("peak_velocity", self%peak_velocity)
      call archive%exchange("breaks_before", self%breaks_before)
      call archive%exchange("breaks_after", self%breaks_after)
      call archive%exchange("has_least", self%has_least)
      call archive%exchange("kept_count", self%kept_count)
      call self%trace%exchange("trace", archive)
      call self%slip_trace%exchange("slip_trace", archive)
      call self%slips%exchange("slips", archive)
      call self%layers%exchange("layers", archive)
   end subroutine exchange

end module mesoslip_recording_recorder
