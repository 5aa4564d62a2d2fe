!> The catalogue of slips.
!>
!> The spring force of a slip is the mean elastic force of a slider of layers, K (X_d - X_1): the
!> force at the drive has the waves in the slider as well.
!>
!> A slip is a time in which contacts break and the block travels by more than it rings.
!>
!> While the block is faster than the drive, the spring force falls, from a maximum to a minimum. A
!> slip is such a fall, or several that lead lower and lower, if
!>
!> - the block exceeds the drive's velocity by the slip velocity,
!> - at least one contact breaks in it, or most are detached when it starts and have not broken in
!>   the slip before: a film that breaks as a whole breaks just before the maximum, and
!> - the force falls by more than twice the force regained by ringing: the part of the preceding
!>   rise that is ringing (mesoslip_recording_minima), from a minimum in the last three quarters of
!>   a period of the setup. Contacts only make the block ring faster, so that ringing takes half a
!>   period, with damping a little more; a longer rise is loading.
!>
!> A slip starts at the maximum. It ends at the lowest minimum, if no lower one follows within half
!> a period, or before the force has regained half its drop and most contacts are pinned. A stage of
!> the drive ends it too: a fall of the force that a slower drive causes is not a slip.
module mesoslip_recording_slips
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_recording_last_advance, only: max_velocity, passage_of_drive
   use mesoslip_recording_minima, only: minima_type
   use mesoslip_recording_slip_trace, only: slip_trace_type
   use mesoslip_recording_trace, only: pausing_samples
   use mesoslip_sliders_base, only: motion_type, slider_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: slip_recorder_type, slip_parameters_type, slip_columns

   !> Columns of the catalogue; forces are those of the spring
   character(len=*), parameter :: slip_columns(*) = [character(len=name_length) :: "slip", &
      & "start_time", "end_time", "force_before", "force_after", "peak_velocity", &
      & "contacts_broken"]
   integer, parameter :: slip_length = size(slip_columns)
   !> Number of slips at which the run pauses so that they are drained
   integer, parameter :: pausing_slips = 2000
   !> Initial room for slips
   integer, parameter :: initial_room = 16

   !> Minimum fall of the force in a slip, over the force regained by ringing
   real(wp), parameter :: min_fall_ratio = 2.0_wp
   !> Present state: neither fall nor slip, a fall that may become a slip, a slip
   integer, parameter :: phase_slow = 0, phase_fall = 1, phase_slip = 2

   !> Settings of the record.
   type :: slip_parameters_type
      !> Velocity above the drive's that makes a slip [m/s]; 0: no slips
      real(wp) :: slip_velocity = 0.0_wp
      !> Half a period of the slowest ringing [s]
      real(wp) :: quiet_time = 0.0_wp
      !> Interval of the traces of slips [s]; 0: no traces
      real(wp) :: interval = 0.0_wp
      !> Number of contacts
      integer :: contacts = 0
   end type slip_parameters_type

   !> Records slips and their traces.
   type :: slip_recorder_type
      !> Slips that are over
      type(buffer_type) :: catalogue
      !> Their finer traces
      type(slip_trace_type) :: trace
      !> Number of slips that are over: that of the present slip, or of the next
      integer(i8) :: count = 0
      !> Whether the drive has taken another velocity or direction since the last advance
      logical :: drive_changes = .false.

      type(slip_parameters_type), private :: parameters
      integer, private :: phase = phase_slow
      !> Sign of the velocity of the drive
      real(wp), private :: direction = 1.0_wp
      !> Velocity of the block above the drive's [m/s], and time at which it was last fast [s]
      real(wp), private :: last_excess = 0.0_wp, last_fast_time = 0.0_wp
      !> Time, force and breaks at the start of a fall or slip, and at its minimum so far
      real(wp), private :: start_time = 0.0_wp, force_before = 0.0_wp, breaks_before = 0.0_wp
      real(wp), private :: end_time = 0.0_wp, force_after = 0.0_wp, breaks_after = 0.0_wp
      !> Contacts that were detached at its start, and breaks up to the end of the last slip
      real(wp), private :: detached_before = 0.0_wp, breaks_counted = 0.0_wp
      !> Force that ringing had regained at its start [N]
      real(wp), private :: regained_force = 0.0_wp
      !> Maximum of the velocity up to the minimum of the force, and since then [m/s]
      real(wp), private :: peak_velocity = 0.0_wp, later_peak_velocity = 0.0_wp
      !> Whether the block has been fast in the present fall, and the fall has had a minimum
      logical, private :: was_fast = .false., has_minimum = .false.
      !> Latest minima of the force
      type(minima_type) :: minima
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: is_full
      procedure, non_overridable :: final_samples
      procedure, non_overridable :: record
      procedure, non_overridable :: narrow
      procedure, non_overridable :: skip_steps
      procedure, non_overridable :: finish
      procedure, non_overridable :: exchange
      procedure, non_overridable, private :: change_stage, pass_maximum, pass_minimum
      procedure, non_overridable, private :: begin_fall, drop_fall, close_slip, update, update_peak
      procedure, non_overridable, private :: broken_contacts
   end type slip_recorder_type

contains

   !> Set up empty tables.
   subroutine open(self, parameters)
      class(slip_recorder_type), intent(inout) :: self
      type(slip_parameters_type), intent(in) :: parameters

      self%parameters = parameters
      call self%catalogue%open(slip_length, initial_room)
      call self%trace%open(parameters%interval)
      call self%minima%open()
   end subroutine open

   !> Whether a table should be drained.
   pure function is_full(self)
      class(slip_recorder_type), intent(in) :: self
      logical :: is_full

      is_full = self%catalogue%count >= pausing_slips .or. self%final_samples() >= pausing_samples
   end function is_full

   !> Number of samples that can be drained: not those of a fall that may not become a slip.
   pure function final_samples(self) result(number)
      class(slip_recorder_type), intent(in) :: self
      integer :: number

      number = self%trace%final_samples(self%phase == phase_fall)
   end function final_samples

   !> Record the last advance of a slider, before the events at its end.
   subroutine record(self, slider, detached, breaks)
      class(slip_recorder_type), intent(inout) :: self
      !> The slider after its advance
      class(slider_type), intent(in) :: slider
      !> Detached contacts during the advance
      real(wp), intent(in) :: detached
      !> Breaks before and during the advance
      real(wp), intent(in) :: breaks

      real(wp) :: excess
      logical :: turns

      if (self%parameters%slip_velocity <= 0.0_wp) return
      if (self%drive_changes .or. slider%time <= 0.0_wp) call self%change_stage(slider, breaks)
      excess = self%direction * (slider%velocity + slider%base_velocity &
         & - slider%drive%rate_at(slider%time))
      turns = excess > 0.0_wp .neqv. self%last_excess > 0.0_wp
      self%last_excess = excess
      if (turns) then
         if (excess > 0.0_wp) then
            call self%pass_maximum(slider, detached, breaks)
         else
            call self%pass_minimum(passage_of_drive(slider, self%direction), breaks)
         end if
      end if
      if (self%trace%is_active) call self%update(slider, excess, detached)
   end subroutine record

   !> Let a filter select the first step of a slider after which record would do more than update
   !> the velocity: the excess over the velocity of the drive passes 0 or the slip velocity, or a
   !> sample or the end of a trace is due.
   pure subroutine narrow(self, slider, filter)
      class(slip_recorder_type), intent(in) :: self
      class(slider_type), intent(in) :: slider
      type(step_filter_type), intent(inout) :: filter

      real(wp) :: fast

      filter%direction = self%direction
      if (self%parameters%slip_velocity <= 0.0_wp) return
      if (self%drive_changes .or. slider%time <= 0.0_wp) then
         ! The start of a stage is recorded in any case.
         filter%time = -huge(1.0_wp)
         return
      end if

      if (self%last_excess > 0.0_wp) then
         filter%min_excess = 0.0_wp
      else
         filter%max_excess = 0.0_wp
      end if
      if (.not. self%trace%is_active) return

      filter%time = min(filter%time, self%trace%next_time)
      filter%selects_peaks = self%was_fast
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
         filter%time = min(filter%time, self%last_fast_time + self%parameters%quiet_time &
            & - 4.0_wp * spacing(self%last_fast_time + self%parameters%quiet_time))
      end if
   end subroutine narrow

   !> Account for steps of a slider that were of no interest.
   subroutine skip_steps(self, filter)
      class(slip_recorder_type), intent(inout) :: self
      !> The filter after these steps
      type(step_filter_type), intent(in) :: filter

      if (self%parameters%slip_velocity <= 0.0_wp .or. .not. filter%has_skipped) return
      self%last_excess = filter%skipped_excess
      if (.not. self%trace%is_active) return
      if (abs(filter%skipped_excess) > self%parameters%slip_velocity) then
         self%last_fast_time = filter%skipped_time
      end if
      if (self%was_fast) then
         self%later_peak_velocity = max(self%later_peak_velocity, filter%max_velocity)
      end if
   end subroutine skip_steps

   !> The drive took another velocity or direction at the start of the last advance, or the run
   !> started there.
   subroutine change_stage(self, slider, breaks)
      class(slip_recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: breaks

      type(motion_type) :: motion

      motion = slider%observe(slider%step_time)
      if (self%last_excess > 0.0_wp) call self%pass_minimum(motion, breaks)
      if (self%phase == phase_slip) call self%close_slip()
      if (self%phase == phase_fall) call self%drop_fall()
      call self%trace%stop()
      self%drive_changes = .false.
      self%direction = slider%drive%direction
      self%last_excess = self%direction * (motion%velocity + motion%base_velocity &
         & - slider%drive%rate_at(slider%step_time))
      call self%minima%clear()
      call self%minima%add(motion, self%direction, max(0.0_wp, -self%last_excess))
   end subroutine change_stage

   !> The slider has become faster than the drive: the force was at a maximum.
   subroutine pass_maximum(self, slider, detached, breaks)
      class(slip_recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: detached, breaks

      type(motion_type) :: motion
      logical :: is_late

      motion = passage_of_drive(slider, self%direction)
      is_late = motion%time > self%end_time + self%parameters%quiet_time
      select case (self%phase)
      case (phase_slip)
         if (.not. is_late) then
            if (self%direction * (motion%elastic_force - self%force_after) &
               & < 0.5_wp * self%direction * (self%force_before - self%force_after) &
               & .or. 2.0_wp * detached >= self%parameters%contacts) return
         end if
         call self%close_slip()
      case (phase_fall)
         ! Falls that lead lower and lower are one.
         if (.not. is_late &
            & .and. self%direction * (motion%elastic_force - self%force_before) < 0.0_wp) return
         call self%drop_fall()
      case default
         continue
      end select
      if (self%trace%is_active) call self%trace%take_samples(slider, detached, motion%time)
      call self%begin_fall(motion, detached, breaks)
   end subroutine pass_maximum

   !> A fall of the force is over: it may make a slip.
   subroutine pass_minimum(self, motion, breaks)
      class(slip_recorder_type), intent(inout) :: self
      !> The motion at the minimum of the force
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: breaks

      logical :: is_lower

      call self%minima%add(motion, self%direction, 0.0_wp)
      if (self%phase == phase_slow) return
      is_lower = .not. self%has_minimum &
         & .or. self%direction * (motion%elastic_force - self%force_after) < 0.0_wp
      if (is_lower) then
         self%has_minimum = .true.
         self%end_time = motion%time
         self%force_after = motion%elastic_force
         self%breaks_after = breaks
         self%peak_velocity = max(self%peak_velocity, self%later_peak_velocity)
      end if
      if (self%phase == phase_slip) return

      if (.not. self%was_fast) then
         self%phase = phase_slow
         call self%trace%drop_or_stop()
      else if (self%broken_contacts() >= 1.0_wp .and. self%direction &
         & * (self%force_before - self%force_after) > min_fall_ratio * self%regained_force) then
         self%phase = phase_slip
         call self%trace%confirm(self%count)
      end if
   end subroutine pass_minimum

   !> A fall of the force starts: it may become a slip.
   subroutine begin_fall(self, motion, detached, breaks)
      class(slip_recorder_type), intent(inout) :: self
      !> The motion at the maximum of the force
      type(motion_type), intent(in) :: motion
      real(wp), intent(in) :: detached, breaks

      self%phase = phase_fall
      self%start_time = motion%time
      self%end_time = motion%time
      self%force_before = motion%elastic_force
      self%force_after = motion%elastic_force
      self%breaks_before = breaks
      self%detached_before = detached
      self%regained_force = self%minima%regained_force(motion, self%direction, &
         & self%parameters%quiet_time)
      self%peak_velocity = 0.0_wp
      self%later_peak_velocity = 0.0_wp
      self%was_fast = .false.
      self%has_minimum = .false.
      if (.not. self%trace%is_active) self%last_fast_time = motion%time
      call self%trace%begin(motion%time, self%count)
   end subroutine begin_fall

   !> A fall of the force did not become a slip.
   subroutine drop_fall(self)
      class(slip_recorder_type), intent(inout) :: self

      self%phase = phase_slow
      call self%trace%drop()
   end subroutine drop_fall

   !> Number of contacts that broke up to the minimum: in the fall, or just before it, if none broke
   !> in it and most were detached when it started; without contacts of the slip before.
   pure function broken_contacts(self) result(number)
      class(slip_recorder_type), intent(in) :: self
      real(wp) :: number

      number = self%breaks_after - self%breaks_before
      if (number < 1.0_wp .and. 2.0_wp * self%detached_before >= self%parameters%contacts) then
         number = min(self%detached_before, self%breaks_before - self%breaks_counted)
      end if
   end function broken_contacts

   !> Put a slip into the catalogue.
   subroutine close_slip(self)
      class(slip_recorder_type), intent(inout) :: self

      call self%catalogue%add([real(self%count, wp), self%start_time, self%end_time, &
         & self%force_before, self%force_after, self%direction * self%peak_velocity, &
         & self%broken_contacts()])
      self%count = self%count + 1
      self%breaks_counted = self%breaks_after
      self%phase = phase_slow
      call self%trace%keep()
   end subroutine close_slip

   !> Continue a fall, a slip or the ringing after it to the end of the last advance of a slider.
   subroutine update(self, slider, excess, detached)
      class(slip_recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: excess, detached

      if (self%trace%next_time <= slider%time) then
         call self%trace%take_samples(slider, detached, slider%time)
      end if
      if (abs(excess) > self%parameters%slip_velocity) then
         self%last_fast_time = slider%time
         if (excess > 0.0_wp) self%was_fast = .true.
      else if (slider%time - self%last_fast_time > self%parameters%quiet_time) then
         if (self%phase == phase_slip) call self%close_slip()
         if (self%phase == phase_fall .and. excess <= 0.0_wp) call self%drop_fall()
         if (self%phase == phase_slow) call self%trace%stop()
         return
      end if
      if (self%was_fast) call self%update_peak(slider)
   end subroutine update

   !> Update the maximum of the velocity by the last advance of a slider.
   subroutine update_peak(self, slider)
      class(slip_recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider

      self%later_peak_velocity = max(self%later_peak_velocity, self%direction * slider%velocity)
      if (self%direction * slider%start_acceleration > 0.0_wp &
         & .and. self%direction * slider%acceleration < 0.0_wp) then
         self%later_peak_velocity = max(self%later_peak_velocity, &
            & self%direction * max_velocity(slider, self%direction))
      end if
   end subroutine update_peak

   !> Close a slip at the end of the run, if its spring force has passed the minimum.
   subroutine finish(self)
      class(slip_recorder_type), intent(inout) :: self

      if (self%phase == phase_slip) call self%close_slip()
      if (self%phase == phase_fall) call self%drop_fall()
      call self%trace%stop()
   end subroutine finish

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(slip_recorder_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("slips")
      call archive%exchange("phase", self%phase)
      call archive%exchange("slip_count", self%count)
      call archive%exchange("drive_changes", self%drive_changes)
      call archive%exchange("direction", self%direction)
      call archive%exchange("last_excess", self%last_excess)
      call archive%exchange("last_fast_time", self%last_fast_time)
      call archive%exchange("start_time", self%start_time)
      call archive%exchange("end_time", self%end_time)
      call archive%exchange("force_before", self%force_before)
      call archive%exchange("force_after", self%force_after)
      call archive%exchange("breaks_before", self%breaks_before)
      call archive%exchange("breaks_after", self%breaks_after)
      call archive%exchange("breaks_counted", self%breaks_counted)
      call archive%exchange("detached_before", self%detached_before)
      call archive%exchange("regained_force", self%regained_force)
      call archive%exchange("peak_velocity", self%peak_velocity)
      call archive%exchange("later_peak_velocity", self%later_peak_velocity)
      call archive%exchange("was_fast", self%was_fast)
      call archive%exchange("has_minimum", self%has_minimum)
      call self%minima%exchange(archive)
      call self%catalogue%exchange("catalogue", archive)
      call self%trace%exchange(archive)
   end subroutine exchange

end module mesoslip_recording_slips
