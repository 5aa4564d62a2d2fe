!> The catalogue of avalanches of a run, and snapshots of its contacts.
!>
!> An avalanche is all contacts that break at one time and displacement, as they push each other
!> over their thresholds; under a slider without inertia, at one displacement of the drive.
module mesoslip_recording_avalanches
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_contacts_base, only: contacts_type, extent_columns, extent_length, &
      & snapshot_length
   use mesoslip_interface_law, only: interface_law_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   implicit none
   private

   public :: avalanche_recorder_type, avalanche_parameters_type
   public :: avalanche_columns, snapshot_event_columns

   !> Columns of the catalogue of avalanches: time and displacement of the start, forces of the
   !> contacts; the size is the number of breaks
   character(len=*), parameter :: avalanche_columns(*) = [character(len=name_length) :: "time", &
      & "displacement", "size", "force_before", "force_drop", "slip", extent_columns]
   !> Columns of the list of snapshots; size 0: not after an avalanche
   character(len=*), parameter :: snapshot_event_columns(*) = [character(len=name_length) :: &
      & "time", "displacement", "size"]
   integer, parameter :: avalanche_length = size(avalanche_columns)
   integer, parameter :: snapshot_event_length = size(snapshot_event_columns)

   !> Initial room for avalanches
   integer, parameter :: initial_room = 64
   !> Numbers of avalanches, and of numbers in snapshots, at which the run pauses so that they are
   !> drained
   integer, parameter :: pausing_avalanches = 100000, pausing_numbers = 6000000

   !> Settings of the record.
   type :: avalanche_parameters_type
      !> Minimum size of an avalanche in the catalogue; 0: no catalogue
      real(wp) :: min_size = 0.0_wp
      !> Minimum size of an avalanche after which a snapshot is taken; 0: no such snapshots
      real(wp) :: snapshot_size = 0.0_wp
      !> Number of avalanches after which the run ends
      integer(i8) :: max_avalanches = huge(1_i8)
   end type avalanche_parameters_type

   !> Records avalanches and snapshots into tables that the caller drains.
   type :: avalanche_recorder_type
      type(avalanche_parameters_type) :: parameters
      !> Avalanches, list of snapshots, and the snapshots, all contacts of one in a row
      type(buffer_type) :: catalogue, events, snapshots
      !> Avalanches so far
      integer(i8) :: avalanches = 0
      !> Breaks in the present avalanche
      real(wp) :: size = 0.0_wp

      !> Slip in avalanches so far [m]
      real(wp) :: slip = 0.0_wp
      !> Times at which snapshots are taken [s], and number of those taken
      real(wp), allocatable, private :: snapshot_time(:)
      integer, private :: taken = 0
      !> Number of snapshots at which the run pauses
      integer, private :: pausing_snapshots = 1
      !> Breaks so far
      real(wp), private :: breaks = 0.0_wp
      !> Time, displacement and contact force at the start of the present avalanche
      real(wp), private :: time = 0.0_wp, displacement = 0.0_wp, force = 0.0_wp
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: is_full
      procedure, non_overridable :: take_due_snapshots
      procedure, non_overridable :: count_breaks
      procedure, non_overridable :: needs_each
      procedure, non_overridable :: count_others
      procedure, non_overridable :: close
      procedure, non_overridable :: begin_run
      procedure, non_overridable :: exchange
      procedure, non_overridable, private :: begin, take_snapshot
   end type avalanche_recorder_type

contains

   !> Set up empty tables.
   subroutine open(self, parameters, snapshot_time, contacts)
      class(avalanche_recorder_type), intent(inout) :: self
      type(avalanche_parameters_type), intent(in) :: parameters
      !> Times at which snapshots are taken, increasing [s]
      real(wp), intent(in) :: snapshot_time(:)
      !> Number of contacts in a snapshot
      integer, intent(in) :: contacts

      integer :: room

      self%parameters = parameters
      if (allocated(self%snapshot_time)) deallocate (self%snapshot_time)
      allocate (self%snapshot_time, source=snapshot_time)
      room = 0
      if (parameters%min_size > 0.0_wp) room = initial_room
      call self%catalogue%open(avalanche_length, room)
      room = 0
      if (parameters%snapshot_size > 0.0_wp .or. size(snapshot_time) > 0) room = 1
      call self%events%open(snapshot_event_length, room)
      call self%snapshots%open(snapshot_length * contacts, room)
      self%pausing_snapshots = max(1, pausing_numbers / max(1, snapshot_length * contacts))
   end subroutine open

   !> Whether a table should be drained.
   pure function is_full(self)
      class(avalanche_recorder_type), intent(in) :: self
      logical :: is_full

      is_full = self%catalogue%count >= pausing_avalanches &
         & .or. self%snapshots%count >= self%pausing_snapshots
   end function is_full

   !> Take the snapshots that are due after an advance of the slider, before the contacts respond.
   subroutine take_due_snapshots(self, slider, contacts)
      class(avalanche_recorder_type), intent(inout) :: self
      !> The slider after its advance
      class(slider_type), intent(in) :: slider
      !> The contacts before their response
      class(contacts_type), intent(in) :: contacts

      type(motion_type) :: motion

      do while (self%taken < size(self%snapshot_time))
         if (self%snapshot_time(self%taken + 1) > slider%time) exit
         self%taken = self%taken + 1
         motion = slider%observe(self%snapshot_time(self%taken))
         call self%take_snapshot(contacts, motion%time, motion%displacement, &
            & motion%displacement - slider%origin)
      end do
   end subroutine take_due_snapshots

   !> Count the breaks of a response of the contacts; an avalanche begins unless one has begun.
   subroutine count_breaks(self, slider, contacts, law)
      class(avalanche_recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      !> The contacts after their response
      class(contacts_type), intent(in) :: contacts
      !> Contact force before
      type(interface_law_type), intent(in) :: law

      if (.not. contacts%breaks > self%breaks) return
      if (.not. self%size > 0.0_wp) call self%begin(slider, law)
      self%size = self%size + (contacts%breaks - self%breaks)
      self%breaks = contacts%breaks
   end subroutine count_breaks

   !> Whether more is recorded than the number of avalanches.
   pure function needs_each(self)
      class(avalanche_recorder_type), intent(in) :: self
      logical :: needs_each

      needs_each = self%parameters%min_size > 0.0_wp .or. self%parameters%snapshot_size > 0.0_wp &
         & .or. self%parameters%max_avalanches < huge(1_i8) &
         & .or. self%taken < size(self%snapshot_time)
   end function needs_each

   !> Count avalanches of which nothing else is recorded.
   subroutine count_others(self, number, breaks)
      class(avalanche_recorder_type), intent(inout) :: self
      integer, intent(in) :: number
      !> Breaks so far
      real(wp), intent(in) :: breaks

      self%avalanches = self%avalanches + number
      self%breaks = breaks
   end subroutine count_others

   !> Begin another run, with its own snapshots.
   pure subroutine begin_run(self)
      class(avalanche_recorder_type), intent(inout) :: self

      self%taken = 0
   end subroutine begin_run

   subroutine begin(self, slider, law)
      class(avalanche_recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      type(interface_law_type), intent(in) :: law

      self%time = slider%time
      self%displacement = slider%origin + slider%displacement
      self%force = law%stiffness * slider%displacement - law%offset
   end subroutine begin

   !> Close the present avalanche.
   subroutine close(self, slider, contacts, displacement)
      class(avalanche_recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      !> The contacts after the avalanche
      class(contacts_type), intent(inout) :: contacts
      !> Displacement of the slider at the end of the avalanche [m]
      real(wp), intent(in) :: displacement

      type(interface_law_type) :: law
      real(wp) :: slip
      integer :: extent(extent_length)

      if (.not. self%size > 0.0_wp) return
      slip = slider%origin + displacement - self%displacement
      self%slip = self%slip + slip
      self%avalanches = self%avalanches + 1
      if (self%parameters%snapshot_size > 0.0_wp &
         & .and. self%size >= self%parameters%snapshot_size) then
         call self%take_snapshot(contacts, self%time, slider%origin + displacement, displacement)
      end if
      call contacts%take_extent(extent)
      if (self%parameters%min_size > 0.0_wp .and. self%size >= self%parameters%min_size) then
         law = contacts%law()
         call self%catalogue%add([self%time, self%displacement, self%size, &
            & self%force, self%force - (law%stiffness * displacement - law%offset), slip, &
            & real(extent, wp)])
      end if
      self%size = 0.0_wp
   end subroutine close

   !> Take a snapshot of the contacts.
   subroutine take_snapshot(self, contacts, time, displacement, relative)
      class(avalanche_recorder_type), intent(inout) :: self
      class(contacts_type), intent(in) :: contacts
      !> Time [s], displacement, and displacement from the moving origin [m]
      real(wp), intent(in) :: time, displacement, relative

      call self%snapshots%reserve()
      if (.not. self%snapshots%has_room()) return
      self%snapshots%count = self%snapshots%count + 1
      call write_snapshot(contacts%individual_count(), &
         & self%snapshots%row(:, self%snapshots%count))
      call self%events%add([time, displacement, self%size])

   contains

      !> Write a snapshot, which may be long, into its row.
      subroutine write_snapshot(number, values)
         !> Number of contacts
         integer, intent(in) :: number
         !> Their numbers
         real(wp), intent(out) :: values(snapshot_length, number)

         call contacts%snapshot(time, relative, values)
      end subroutine write_snapshot

   end subroutine take_snapshot

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(avalanche_recorder_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("avalanches")
      call archive%exchange("avalanches", self%avalanches)
      call archive%exchange("size", self%size)
      call archive%exchange("slip", self%slip)
      call archive%exchange("taken", self%taken)
      call archive%exchange("breaks", self%breaks)
      call archive%exchange("time", self%time)
      call archive%exchange("displacement", self%displacement)
      call archive%exchange("force", self%force)
      call self%catalogue%exchange("catalogue", archive)
      call self%events%exchange("events", archive)
      call self%snapshots%exchange("snapshots", archive)
   end subroutine exchange

end module mesoslip_recording_avalanches
