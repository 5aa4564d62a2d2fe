!> What is kept of a run: a trace at fixed intervals, a catalogue of slips, finer traces of them.
!>
!> Samples are taken from the motion between events, so how often one looks does not change a run.
!>
!> The spring force of a slip is the mean elastic force of a slider of layers, K (X_d - X_1): the
!> force at the drive has the waves in the slider as well.
!>
!> A slip is a time in which contacts break and the block travels by more than it rings.
!>
!> While the block is faster than the drive, the spring force falls, from a maximum to a minimum. Of
!> a slip is such a fall, or several that lead lower and lower, if
!>
!> - the block exceeds the drive's velocity by the slip velocity,
!> - at least one contact breaks, and
!> - the force falls by more than twice what it had regained by ringing, so that the block travels
!>   farther beyond what ringing gives back than it rings. Regained is the height above the least
!>   minimum of the last three quarters of a period of the setup: contacts only make the block ring
!>   faster, so that ringing takes half a period, with damping a little more; what takes longer is
!>   loading.
!>
!> A slip starts at the maximum. It ends at the least minimum, after which no lower one comes within
!> half a period, or before the force has regained half its drop and most contacts are pinned. A
!> stage of the drive ends it too: the fall that a slower drive starts is none of the block's own.
!>
!> A finer trace goes on until the block has been slow for half a period, or another slip starts.
module mesoslip_recording_recorder
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: recorder_type, recorder_parameters_type
   public :: trace_columns, slip_trace_columns, slip_columns, most_samples_in_step

   !> Columns of a trace
   character(len=*), parameter :: trace_columns(*) = [character(len=name_length) :: "time", &
      & "drive_displacement", "displacement", "velocity", "spring_force", "contact_force", &
      & "detached_contacts", "elastic_force", "base_displacement"]
   !> A sample of a slip trace has the number of the slip as well
   character(len=*), parameter :: slip_trace_columns(*) = [character(len=name_length) :: &
      & trace_columns, "slip"]
   !> Columns of the catalogue of slips; forces are those of the spring
   character(len=*), parameter :: slip_columns(*) = [character(len=name_length) :: "slip", &
      & "start_time", "end_time", "force_before", "force_after", "peak_velocity", &
      & "contacts_broken"]
   integer, parameter :: trace_length = size(trace_columns)
   integer, parameter :: slip_trace_length = size(slip_trace_columns)
   integer, parameter :: slip_length = size(slip_columns)
   !> Steps must be shorter than this many samples of either trace.
   integer, parameter :: most_samples_in_step = 1000
   !> Samples of either trace, and slips, that wait before the run pauses to have them taken away
   integer, parameter :: many_samples = 20000, many_slips = 2000
   !> Minima for which there is room at first
   integer, parameter :: many_minima = 16

   !> A part of an interval that counts as nothing.
   real(wp), parameter :: tiny_part = 1.0e-6_wp

   !> A fall of the force makes a slip if it is more than this many times what ringing regained.
   real(wp), parameter :: least_fall = 2.0_wp
   !> Time in which ringing comes from a minimum to a maximum, in half periods of the undamped setup
   real(wp), parameter :: longest_rise = 1.5_wp
   !> What is being followed: nothing, a fall that may come to be a slip, a slip
   integer, parameter :: phase_slow = 0, phase_fall = 1, phase_slip = 2

   !> What to record.
   type :: recorder_parameters_type
      !> Interval of the trace [s]
      real(wp) :: interval = 1.0_wp
      !> Interval of the finer traces [s]; zero for none
      real(wp) :: slip_interval = 0.0_wp
      !> Velocity above the drive's that makes a slip [m/s]; zero for no slips
      real(wp) :: slip_velocity = 0.0_wp
      !> Half a period of the setup, or of what rings more slowly [s]
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
      !> Number of the slip whose trace is taken
      integer(i8), private :: traced = 0
      !> Whether a finer trace is taken, and whether it has been of a slip
      logical, private :: is_tracing = .false., has_traced = .false.
      !> Whether another stage of the drive begins where it has another velocity, or direction
      logical :: drive_changes = .false.
      !> Sign of the velocity of the drive
      real(wp), private :: sense = 1.0_wp
      !> Velocity of the block above the drive's [m/s], and when it was last fast
      real(wp), private :: last_excess = 0.0_wp, last_fast = 0.0_wp
      !> Time, force and breaks at the start of a fall or slip, and at its least force so far
      real(wp), private :: start_time = 0.0_wp, force_before = 0.0_wp, breaks_before = 0.0_wp
      real(wp), private :: end_time = 0.0_wp, force_after = 0.0_wp, breaks_after = 0.0_wp
      !> Force that ringing had regained at its start [N]
      real(wp), private :: regained = 0.0_wp
      !> Greatest velocity up to the least force, and since then [m/s]
      real(wp), private :: peak_velocity = 0.0_wp, later_peak = 0.0_wp
      !> Whether the block has been fast in the present fall, and a least force is known
      logical, private :: is_quick = .false., has_least = .false.
      !> Minima of the force: time and force, times the sense, each above the one before; those
      !> that a later one went below are not needed any more
      type(buffer_type), private :: minima
   contains
      !> Make room for what will be recorded
      procedure, non_overridable :: open
      !> Whether so much waits that it should be taken away
      procedure, non_overridable :: is_full
      !> Slips that are over
      procedure, non_overridable :: slips_so_far
      !> Samples of slip traces that can be taken away
      procedure, non_overridable :: final_slip_samples
      !> Take samples of slip traces away
      procedure, non_overridable :: drain_slip_trace
      !> Record the last advance of a slider
      procedure, non_overridable :: record
      !> Which steps of a slider need record, and take note of those that did not
      procedure, non_overridable :: step_filter
      procedure, non_overridable :: skip_steps
      !> Close a slip at the end of the run
      procedure, non_overridable :: finish
      !> Put the state into an archive or take it out
      procedure, non_overridable :: exchange
      procedure, non_overridable, private :: change_stage, pass_maximum, see_minimum
      procedure, non_overridable, private :: begin_fall, drop_fall, follow, close_slip, stop_trace
      procedure, non_overridable, private :: add_minimum, height
      procedure, non_overridable, private :: take_samples, take_slip_samples
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
      call self%minima%open(2, many_minima)
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

   !> Slips that are over.
   pure function slips_so_far(self) result(number)
      !> The recorder
      class(recorder_type), intent(in) :: self
      !> Their number
      integer(i8) :: number

      number = self%slip
   end function slips_so_far

   !> Samples of slip traces that can be taken away: not those of what may come to no slip.
   pure function final_slip_samples(self) result(number)
      !> The recorder
      class(recorder_type), intent(in) :: self
      !> Their number
      integer :: number

      number = self%slip_trace%count
      if (self%phase == phase_fall) number = self%kept_count
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

      real(wp) :: excess
      logical :: turns

      if (self%next_sample <= slider%time) call self%take_samples(slider, detached)
      if (self%parameters%slip_velocity <= 0.0_wp) return

      if (self%drive_changes .or. slider%time <= 0.0_wp) call self%change_stage(slider, breaks)
      excess = self%sense * (slider%velocity + slider%base_velocity &
         & - slider%drive%rate_at(slider%time))
      turns = excess > 0.0_wp .neqv. self%last_excess > 0.0_wp
      self%last_excess = excess
      if (turns) then
         if (excess > 0.0_wp) then
            call self%pass_maximum(slider, detached, breaks)
         else
            call self%see_minimum(pace(slider, self%sense), breaks)
         end if
      end if
      if (self%is_tracing) call self%follow(slider, excess, detached)
   end subroutine record

   !> The first step of a slider after which record would do more than take note of the velocity.
   !>
   !> It is where the excess over the velocity of the drive leaves the interval, between 0 and the
   !> slip velocity, in which it is, or where something is due.
   pure function step_filter(self, slider) result(filter)
      !> The recorder
      class(recorder_type), intent(in) :: self
      !> The slider
      class(slider_type), intent(in) :: slider
      !> The filter
      type(step_filter_type) :: filter

      real(wp) :: fast

      filter%time = self%next_sample
      filter%reference = slider%drive%rate
      filter%direction = self%sense
      if (self%parameters%slip_velocity <= 0.0_wp) return
      if (self%drive_changes .or. slider%time <= 0.0_wp) then
         ! The start of a stage is of interest in itself.
         filter%time = -huge(1.0_wp)
         return
      end if

      if (self%last_excess > 0.0_wp) then
         filter%min_excess = 0.0_wp
      else
         filter%max_excess = 0.0_wp
      end if
      if (.not. self%is_tracing) return

      filter%time = min(filter%time, self%next_slip_sample)
      filter%selects_peaks = self%is_quick
      fast = self%parameters%slip_velocity
      if (self%last_excess > fast) then
         filter%min_excess = fast
      else if (self%last_excess < -fast) then
         filter%max_excess = nearest(-fast, -1.0_wp)
      else
         if (self%last_excess > 0.0_wp) then
            filter%max_excess = fast
         else
            filter%min_excess = nearest(-fast, -1.0_wp)
         end if
         ! A step or two too early does no harm.
         filter%time = min(filter%time, self%last_fast + self%parameters%quiet_time &
            & - 4.0_wp * spacing(self%last_fast + self%parameters%quiet_time))
      end if
   end function step_filter

   !> Take note of steps of a slider that were of no interest.
   subroutine skip_steps(self, filter)
      !> The recorder
      class(recorder_type), intent(inout) :: self
      !> The filter after these steps
      type(step_filter_type), intent(in) :: filter

      if (self%parameters%slip_velocity <= 0.0_wp .or. .not. filter%has_skipped) return
      self%last_excess = filter%skipped_excess
      if (.not. self%is_tracing) return
      if (abs(filter%skipped_excess) > self%parameters%slip_velocity) then
         self%last_fast = filter%skipped_time
      end if
      if (self%is_quick) self%later_peak = max(self%later_peak, filter%max_velocity)
   end subroutine skip_steps

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

   !> The drive took another velocity or direction at the start of the last advance, or the run
   !> started there.
   subroutine change_stage(self, slider, breaks)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: breaks

      type(motion_type) :: motion

      motion = slider%observe(slider%step_time)
      if (self%last_excess > 0.0_wp) call self%see_minimum(motion, breaks)
      if (self%phase == phase_slip) call self%close_slip()
      if (self%phase == phase_fall) call self%drop_fall()
      call self%stop_trace()
      self%drive_changes = .false.
      self%sense = slider%drive%direction
      self%last_excess = self%sense * (motion%velocity + motion%base_velocity &
         & - slider%drive%rate_at(slider%step_time))
      ! What a faster drive stretches before the block has its velocity is regained too.
      self%minima%count = 0
      call self%add_minimum(motion)
   end subroutine change_stage

   !> The slider has become faster than the drive: the force was at a maximum.
   subroutine pass_maximum(self, slider, detached, breaks)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: detached, breaks

      type(motion_type) :: motion
      logical :: is_late

      motion = pace(slider, self%sense)
      is_late = motion%time > self%end_time + self%parameters%quiet_time
      select case (self%phase)
      case (phase_slip)
         if (.not. is_late) then
            if (self%sense * (motion%elastic_force - self%force_after) &
               & < 0.5_wp * self%sense * (self%force_before - self%force_after) &
               & .or. 2.0_wp * detached >= self%parameters%contacts) return
         end if
         call self%close_slip()
      case (phase_fall)
         ! Falls that lead lower and lower are one.
         if (.not. is_late &
            & .and. self%sense * (motion%elastic_force - self%force_before) < 0.0_wp) return
         call self%drop_fall()
      case default
         continue
      end select
      if (self%is_tracing) call self%take_slip_samples(slider, detached, motion%time)
      call self%begin_fall(motion, breaks)
   end subroutine pass_maximum

   !> A fall of the force is over: it may make a slip.
   subroutine see_minimum(self, motion, breaks)
      class(recorder_type), intent(inout) :: self
      !> The motion where the force is least
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: breaks

      call self%add_minimum(motion)
      if (self%phase == phase_slow) return
      if (.not. self%has_least) then
         call note_least(self, motion, breaks)
      else if (self%sense * (motion%elastic_force - self%force_after) < 0.0_wp) then
         call note_least(self, motion, breaks)
      end if
      if (self%phase == phase_slip) return

      if (.not. self%is_quick) then
         call self%drop_fall()
         if (.not. self%has_traced) call self%stop_trace()
      else if (self%breaks_after - self%breaks_before >= 1.0_wp .and. self%sense &
         & * (self%force_before - self%force_after) > least_fall * self%regained) then
         self%phase = phase_slip
         self%traced = self%slip
         self%has_traced = .true.
         self%slip_trace%row(slip_trace_length, self%kept_count + 1:self%slip_trace%count) &
            & = real(self%slip, wp)
      end if
   end subroutine see_minimum

   !> The force is lower than it has been since the start of a fall.
   subroutine note_least(self, motion, breaks)
      type(recorder_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: breaks

      self%has_least = .true.
      self%end_time = motion%time
      self%force_after = motion%elastic_force
      self%breaks_after = breaks
      self%peak_velocity = max(self%peak_velocity, self%later_peak)
   end subroutine note_least

   !> A fall of the force starts: it may come to be a slip.
   subroutine begin_fall(self, motion, breaks)
      class(recorder_type), intent(inout) :: self
      !> The motion where the force is greatest
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: breaks

      self%phase = phase_fall
      self%start_time = motion%time
      self%end_time = motion%time
      self%force_before = motion%elastic_force
      self%force_after = motion%elastic_force
      self%breaks_before = breaks
      self%regained = self%height(motion)
      self%peak_velocity = 0.0_wp
      self%later_peak = 0.0_wp
      self%is_quick = .false.
      self%has_least = .false.
      if (.not. self%is_tracing) then
         self%is_tracing = .true.
         self%traced = self%slip
         self%last_fast = motion%time
      end if
      self%slip_samples = 0
      self%next_slip_sample = huge(1.0_wp)
      if (self%parameters%slip_interval > 0.0_wp) self%next_slip_sample = self%start_time
      self%kept_count = self%slip_trace%count
   end subroutine begin_fall

   !> A fall of the force has come to no slip; its samples are those of the slip before, if any.
   subroutine drop_fall(self)
      class(recorder_type), intent(inout) :: self

      self%phase = phase_slow
      if (.not. self%has_traced) then
         self%slip_trace%count = min(self%slip_trace%count, self%kept_count)
      end if
   end subroutine drop_fall

   !> Follow a fall, a slip or the ringing after it through the last advance of a slider.
   subroutine follow(self, slider, excess, detached)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: excess, detached

      if (self%next_slip_sample <= slider%time) then
         call self%take_slip_samples(slider, detached, slider%time)
      end if
      if (abs(excess) > self%parameters%slip_velocity) then
         self%last_fast = slider%time
         if (excess > 0.0_wp) self%is_quick = .true.
      else if (slider%time - self%last_fast > self%parameters%quiet_time) then
         if (self%phase == phase_slip) call self%close_slip()
         if (self%phase == phase_fall .and. excess <= 0.0_wp) call self%drop_fall()
         if (self%phase == phase_slow) call self%stop_trace()
         return
      end if
      if (self%is_quick) then
         self%later_peak = max(self%later_peak, self%sense * slider%velocity)
         if (self%sense * slider%start_acceleration > 0.0_wp &
            & .and. self%sense * slider%acceleration < 0.0_wp) then
            self%later_peak = max(self%later_peak, self%sense * fastest(slider, self%sense))
         end if
      end if
   end subroutine follow

   !> Take no finer samples until the next fall.
   subroutine stop_trace(self)
      class(recorder_type), intent(inout) :: self

      self%is_tracing = .false.
      self%has_traced = .false.
      self%next_slip_sample = huge(1.0_wp)
   end subroutine stop_trace

   !> Remember a minimum of the force.
   subroutine add_minimum(self, motion)
      class(recorder_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion

      real(wp) :: force

      force = self%sense * motion%elastic_force
      do while (self%minima%count > 0)
         if (self%minima%row(2, self%minima%count) < force) exit
         self%minima%count = self%minima%count - 1
      end do
      call self%minima%add([motion%time, force])
   end subroutine add_minimum

   !> Height of the force above its least minimum so long ago as ringing lasts; forget earlier ones.
   function height(self, motion)
      class(recorder_type), intent(inout) :: self
      type(motion_type), intent(in) :: motion
      real(wp) :: height

      integer :: old, minimum

      old = 0
      do while (old < self%minima%count)
         if (self%minima%row(1, old + 1) &
            & >= motion%time - longest_rise * self%parameters%quiet_time) exit
         old = old + 1
      end do
      self%minima%count = self%minima%count - old
      do minimum = 1, self%minima%count
         self%minima%row(:, minimum) = self%minima%row(:, minimum + old)
      end do
      height = 0.0_wp
      if (self%minima%count > 0) then
         height = self%sense * motion%elastic_force - self%minima%row(2, 1)
      end if
   end function height

   !> Put a slip into the catalogue.
   subroutine close_slip(self)
      class(recorder_type), intent(inout) :: self

      call self%slips%add([real(self%slip, wp), self%start_time, self%end_time, &
         & self%force_before, self%force_after, self%sense * self%peak_velocity, &
         & self%breaks_after - self%breaks_before])
      self%slip = self%slip + 1
      self%kept_count = self%slip_trace%count
      self%phase = phase_slow
   end subroutine close_slip

   !> Close a slip at the end of the run, if its spring force has passed the least.
   subroutine finish(self)
      !> The recorder
      class(recorder_type), intent(inout) :: self

      if (self%phase == phase_slip) call self%close_slip()
      if (self%phase == phase_fall) call self%drop_fall()
      call self%stop_trace()
   end subroutine finish

   !> Take the finer samples up to a time of the last advance of a slider.
   subroutine take_slip_samples(self, slider, detached, end_time)
      class(recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: detached, end_time

      do while (self%next_slip_sample <= end_time)
         call self%slip_trace%add([sample(slider%observe(self%next_slip_sample), detached), &
            & real(self%traced, wp)])
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
   pure function pace(slider, sense) result(motion)
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: sense
      type(motion_type) :: motion

      integer, parameter :: bisections = 50
      real(wp) :: early, late
      logical :: was_faster
      integer :: bisection

      early = slider%step_time
      late = slider%time
      was_faster = .not. is_faster(slider%velocity + slider%base_velocity, slider%time)
      motion = slider%observe(early)
      do bisection = 1, bisections
         motion = slider%observe(0.5_wp * (early + late))
         if (is_faster(motion%velocity + motion%base_velocity, motion%time) .eqv. was_faster) then
            early = motion%time
         else
            late = motion%time
         end if
         if (late - early <= spacing(late)) exit
      end do

   contains

      !> Whether a velocity at a time is that of a fall of the force.
      pure logical function is_faster(velocity, time)
         real(wp), intent(in) :: velocity, time

         is_faster = sense * (velocity - slider%drive%rate_at(time)) > 0.0_wp
      end function is_faster

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
      call archive%exchange("kept_count", self%kept_count)
      call archive%exchange("traced", self%traced)
      call archive%exchange("is_tracing", self%is_tracing)
      call archive%exchange("has_traced", self%has_traced)
      call archive%exchange("drive_changes", self%drive_changes)
      call archive%exchange("sense", self%sense)
      call archive%exchange("last_excess", self%last_excess)
      call archive%exchange("last_fast", self%last_fast)
      call archive%exchange("start_time", self%start_time)
      call archive%exchange("end_time", self%end_time)
      call archive%exchange("force_before", self%force_before)
      call archive%exchange("force_after", self%force_after)
      call archive%exchange("breaks_before", self%breaks_before)
      call archive%exchange("breaks_after", self%breaks_after)
      call archive%exchange("regained", self%regained)
      call archive%exchange("peak_velocity", self%peak_velocity)
      call archive%exchange("later_peak", self%later_peak)
      call archive%exchange("is_quick", self%is_quick)
      call archive%exchange("has_least", self%has_least)
      call self%minima%exchange("minima", archive)
      call self%trace%exchange("trace", archive)
      call self%slip_trace%exchange("slip_trace", archive)
      call self%slips%exchange("slips", archive)
      call self%layers%exchange("layers", archive)
   end subroutine exchange

end module mesoslip_recording_recorder
