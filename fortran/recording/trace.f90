!> Samples of the motion at fixed intervals.
!>
!> They are taken from the motion between events, so that the interval does not change a run.
module mesoslip_recording_trace
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   implicit none
   private

   public :: trace_type, sample_of, trace_columns, trace_length
   public :: pausing_samples, max_samples_in_step, initial_room

   !> Columns of a trace
   character(len=*), parameter :: trace_columns(*) = [character(len=name_length) :: "time", &
      & "drive_displacement", "displacement", "velocity", "spring_force", "contact_force", &
      & "detached_contacts", "elastic_force", "base_displacement"]
   integer, parameter :: trace_length = size(trace_columns)
   !> Maximum number of samples in a step
   integer, parameter :: max_samples_in_step = 1000
   !> Number of samples at which the run pauses so that they are drained
   integer, parameter :: pausing_samples = 20000
   !> Initial room for samples
   integer, parameter :: initial_room = 64

   !> Share of an interval within which two times are equal
   real(wp), parameter :: time_tolerance = 1.0e-6_wp

   !> A trace of a run.
   type :: trace_type
      !> Samples, and displacements of the layers at the samples
      type(buffer_type) :: rows, layer_rows
      !> Time of the next sample [s]
      real(wp) :: next_time = 0.0_wp
      !> Interval of the samples, and time at which the run ends [s]
      real(wp), private :: interval = 1.0_wp, duration = 0.0_wp
      !> Time of the first sample, from which others are counted [s]
      real(wp), private :: first_time = 0.0_wp
      !> Layers whose displacements are sampled
      integer, private :: layers = 0
      !> Samples so far
      integer(i8), private :: samples = 0
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: begin
      procedure, non_overridable :: is_full
      procedure, non_overridable :: take_samples
      procedure, non_overridable :: exchange
   end type trace_type

contains

   !> Set up empty tables.
   subroutine open(self, interval, duration, layers)
      class(trace_type), intent(inout) :: self
      !> Interval of the samples, and time at which the run ends [s]
      real(wp), intent(in) :: interval, duration
      !> Layers whose displacements are sampled
      integer, intent(in) :: layers

      self%interval = interval
      self%duration = duration
      self%layers = layers
      call self%rows%open(trace_length, initial_room)
      call self%layer_rows%open(layers, initial_room)
   end subroutine open

   !> Begin another run with a sample. Samples of the earlier run continue if this is one of them.
   pure subroutine begin(self, time)
      class(trace_type), intent(inout) :: self
      !> Time of the sample [s]
      real(wp), intent(in) :: time

      self%first_time = 0.0_wp
      self%samples = nint(time / self%interval, i8)
      if (abs(real(self%samples, wp) * self%interval - time) > self%interval * time_tolerance) then
         self%first_time = time
         self%samples = 0
      end if
      self%next_time = time
   end subroutine begin

   !> Whether the table should be drained.
   pure function is_full(self)
      class(trace_type), intent(in) :: self
      logical :: is_full

      is_full = self%rows%count >= pausing_samples
   end function is_full

   !> Take the samples within the last advance of a slider.
   subroutine take_samples(self, slider, detached)
      class(trace_type), intent(inout) :: self
      !> The slider after its advance
      class(slider_type), intent(in) :: slider
      !> Detached contacts during the advance
      real(wp), intent(in) :: detached

      do while (self%next_time <= slider%time)
         call self%rows%add(sample_of(slider%observe(self%next_time), detached))
         if (self%layers > 0) then
            associate (layers => self%layer_rows)
               call layers%reserve()
               if (.not. layers%has_room()) exit
               layers%count = layers%count + 1
               call slider%observe_layers(self%next_time, layers%row(:, layers%count))
            end associate
         end if
         self%samples = self%samples + 1
         self%next_time = self%first_time + real(self%samples, wp) * self%interval
         ! The end of the run is a sample, but for rounding.
         if (abs(self%next_time - self%duration) <= self%interval * time_tolerance) then
            self%next_time = self%duration
         end if
      end do
   end subroutine take_samples

   !> A sample of the motion.
   pure function sample_of(motion, detached) result(sample)
      type(motion_type), intent(in) :: motion
      !> Detached contacts
      real(wp), intent(in) :: detached
      real(wp) :: sample(trace_length)

      sample = [motion%time, motion%drive_displacement, motion%displacement, motion%velocity, &
         & motion%spring_force, motion%contact_force, detached, &
         & motion%elastic_force, motion%base_displacement]
   end function sample_of

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(trace_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("trace")
      call archive%exchange("samples", self%samples)
      call archive%exchange("next_time", self%next_time)
      call archive%exchange("first_time", self%first_time)
      call self%rows%exchange("rows", archive)
      call self%layer_rows%exchange("layer_rows", archive)
   end subroutine exchange

end module mesoslip_recording_trace
