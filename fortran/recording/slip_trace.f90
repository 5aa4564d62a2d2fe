!> Finer samples of the motion around slips.
!>
!> They are taken from the start of a fall of the force, and dropped if it does not become a slip.
!> They continue until the block has been slow for half a period, or another slip starts.
module mesoslip_recording_slip_trace
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_recording_trace, only: initial_room, sample_of, trace_columns
   use mesoslip_sliders_base, only: slider_type
   implicit none
   private

   public :: slip_trace_type, slip_trace_columns

   !> Columns of a sample: those of a trace, and the number of the slip
   character(len=*), parameter :: slip_trace_columns(*) = [character(len=name_length) :: &
      & trace_columns, "slip"]
   integer, parameter :: slip_trace_length = size(slip_trace_columns)

   !> Traces of slips.
   type :: slip_trace_type
      type(buffer_type) :: rows
      !> Time of the next sample [s]
      real(wp) :: next_time = huge(1.0_wp)
      !> Whether a trace is taken
      logical :: is_active = .false.
      !> Interval of the samples [s]; 0: no samples
      real(wp), private :: interval = 0.0_wp
      !> Samples that will not be dropped
      integer, private :: kept_count = 0
      !> Time of the first sample of the present fall [s], and its samples so far
      real(wp), private :: start_time = 0.0_wp
      integer(i8), private :: samples = 0
      !> Time of the last sample, and of the last one that will not be dropped [s]
      real(wp), private :: last_time = -huge(1.0_wp), kept_time = -huge(1.0_wp)
      !> Number of the slip whose trace is taken
      integer(i8), private :: slip = 0
      !> Whether the present trace has been of a slip
      logical, private :: has_slip = .false.
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: final_samples
      procedure, non_overridable :: drain
      procedure, non_overridable :: take_samples
      procedure, non_overridable :: begin
      procedure, non_overridable :: confirm
      procedure, non_overridable :: drop
      procedure, non_overridable :: drop_or_stop
      procedure, non_overridable :: keep
      procedure, non_overridable :: stop
      procedure, non_overridable :: exchange
   end type slip_trace_type

contains

   !> Set up an empty table.
   subroutine open(self, interval)
      class(slip_trace_type), intent(inout) :: self
      !> Interval of the samples [s]; 0: no samples
      real(wp), intent(in) :: interval

      self%interval = interval
      call self%rows%open(slip_trace_length, initial_room)
   end subroutine open

   !> Number of samples that can be drained: not those of a fall that may not become a slip.
   pure function final_samples(self, is_undecided) result(number)
      class(slip_trace_type), intent(in) :: self
      !> Whether there is such a fall
      logical, intent(in) :: is_undecided
      integer :: number

      number = self%rows%count
      if (is_undecided) number = self%kept_count
   end function final_samples

   !> Remove the first samples and return them.
   subroutine drain(self, values)
      class(slip_trace_type), intent(inout) :: self
      !> The samples, no more than can be drained, shape (slip_trace_length, samples)
      real(wp), intent(out) :: values(:, :)

      call self%rows%drain(values)
      self%kept_count = max(0, self%kept_count - size(values, 2))
   end subroutine drain

   !> Take the samples up to a time within the last advance of a slider.
   subroutine take_samples(self, slider, detached, end_time)
      class(slip_trace_type), intent(inout) :: self
      !> The slider after its advance
      class(slider_type), intent(in) :: slider
      !> Detached contacts during the advance; the time [s]
      real(wp), intent(in) :: detached, end_time

      real(wp) :: sample(slip_trace_length)

      sample(slip_trace_length) = real(self%slip, wp)
      do while (self%next_time <= end_time)
         sample(:slip_trace_length - 1) = sample_of(slider%observe(self%next_time), detached)
         call self%rows%add(sample)
         self%last_time = self%next_time
         self%samples = self%samples + 1
         self%next_time = self%start_time + real(self%samples, wp) * self%interval
         ! Late in a run the interval may be below the rounding error of the time.
         if (.not. self%next_time > self%last_time) self%next_time = nearest(self%last_time, 1.0_wp)
      end do
   end subroutine take_samples

   !> A fall of the force starts; a trace of the slip before continues in the samples of the fall.
   subroutine begin(self, time, slip)
      class(slip_trace_type), intent(inout) :: self
      !> Time of the start [s]
      real(wp), intent(in) :: time
      !> Number of the slip that it may become
      integer(i8), intent(in) :: slip

      if (.not. self%is_active) then
         self%is_active = .true.
         self%slip = slip
      end if
      self%start_time = time
      self%samples = 0
      ! A fall may begin where the one before did, after one within rounding.
      if (.not. self%last_time < time) self%samples = 1
      self%next_time = huge(1.0_wp)
      if (self%interval > 0.0_wp) then
         self%next_time = time + real(self%samples, wp) * self%interval
      end if
      call self%keep()
   end subroutine begin

   !> The fall is a slip, to which its samples belong.
   subroutine confirm(self, slip)
      class(slip_trace_type), intent(inout) :: self
      !> Number of the slip
      integer(i8), intent(in) :: slip

      self%slip = slip
      self%has_slip = .true.
      self%rows%row(slip_trace_length, self%kept_count + 1:self%rows%count) = real(slip, wp)
   end subroutine confirm

   !> The fall is not a slip: its samples belong to the slip before, if any.
   subroutine drop(self)
      class(slip_trace_type), intent(inout) :: self

      if (self%has_slip) return
      self%rows%count = min(self%rows%count, self%kept_count)
      self%last_time = self%kept_time
   end subroutine drop

   !> The fall is not a slip: the trace continues only after a slip.
   subroutine drop_or_stop(self)
      class(slip_trace_type), intent(inout) :: self

      call self%drop()
      if (.not. self%has_slip) call self%stop()
   end subroutine drop_or_stop

   !> A slip is over; the trace continues.
   subroutine keep(self)
      class(slip_trace_type), intent(inout) :: self

      self%kept_count = self%rows%count
      self%kept_time = self%last_time
   end subroutine keep

   !> End the trace: no samples until the next fall.
   subroutine stop(self)
      class(slip_trace_type), intent(inout) :: self

      self%is_active = .false.
      self%has_slip = .false.
      self%next_time = huge(1.0_wp)
   end subroutine stop

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(slip_trace_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("slip trace")
      call archive%exchange("next_time", self%next_time)
      call archive%exchange("is_active", self%is_active)
      call archive%exchange("kept_count", self%kept_count)
      call archive%exchange("start_time", self%start_time)
      call archive%exchange("samples", self%samples)
      call archive%exchange("last_time", self%last_time)
      call archive%exchange("kept_time", self%kept_time)
      call archive%exchange("slip", self%slip)
      call archive%exchange("has_slip", self%has_slip)
      call self%rows%exchange("rows", archive)
   end subroutine exchange

end module mesoslip_recording_slip_trace
