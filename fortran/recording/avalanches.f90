!> The catalogue of avalanches of a run, and snapshots of its contacts.
!>
!> An avalanche is all contacts that break at one time and displacement, one pushing over the next;
!> under a slider without inertia, all that break at one place of the drive.
module mesoslip_recording_avalanches
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_contacts_base, only: contacts_type, extent_length
   use mesoslip_interface_law, only: interface_law_type
   use mesoslip_sliders_base, only: motion_type, slider_type
   implicit none
   private

   public :: avalanche_recorder_type, avalanche_parameters_type
   public :: avalanche_length, snapshot_place_length

   !> Numbers of an avalanche: time, displacement at its start, breaks, contact force before it and
   !> its drop, slip, and extent
   integer, parameter :: avalanche_length = 6 + extent_length
   !> Numbers that tell where a snapshot was taken: time, displacement, size of the avalanche or 0
   integer, parameter :: snapshot_place_length = 3

   !> What to record.
   type :: avalanche_parameters_type
      !> Least size of an avalanche in the catalogue; 0 for no catalogue
      real(wp) :: least_size = 0.0_wp
      !> Least size of an avalanche after which a snapshot is taken; 0 for none
      real(wp) :: snapshot_size = 0.0_wp
      !> Avalanches after which the run is over
      integer(i8) :: most_avalanches = huge(1_i8)
   end type avalanche_parameters_type

   !> Records avalanches and snapshots into arrays of the caller.
   type :: avalanche_recorder_type
      !> What to record
      type(avalanche_parameters_type) :: parameters
      !> Avalanches and snapshots in the caller's arrays so far
      integer :: avalanche_count = 0, snapshot_count = 0
      !> Avalanches so far, and breaks in all of them
      integer(i8) :: avalanches = 0
      !> Breaks in the present avalanche
      real(wp) :: size = 0.0_wp

      !> Slip in avalanches so far [m]
      real(wp) :: slip = 0.0_wp
      !> Times at which snapshots are taken [s], and how many of them have been
      real(wp), allocatable, private :: snapshot_time(:)
      integer, private :: taken = 0
      !> Breaks up to now
      real(wp), private :: breaks = 0.0_wp
      !> Time, displacement and contact force at the start of the present avalanche
      real(wp), private :: time = 0.0_wp, displacement = 0.0_wp, force = 0.0_wp
      real(wp), pointer, contiguous, private :: avalanche(:, :) => null()
      real(wp), pointer, contiguous, private :: place(:, :) => null()
      real(wp), pointer, contiguous, private :: snapshot(:, :, :) => null()
   contains
      !> Use arrays of the caller
      procedure :: attach
      !> Whether the caller's arrays have room for one more step
      procedure :: has_room
      !> Look at an advance of the slider, before the contacts respond
      procedure :: see_advance
      !> Look at the response of the contacts
      procedure :: see_response
      !> Close the present avalanche
      procedure :: close
      !> Put the state into an archive or take it out
      procedure :: exchange
      procedure, private :: open, take_snapshot
   end type avalanche_recorder_type

contains

   !> Use arrays of the caller, empty.
   subroutine attach(self, avalanche, place, snapshot, snapshot_time)
      !> The recorder
      class(avalanche_recorder_type), intent(inout) :: self
      !> Avalanches, shape (avalanche_length, capacity)
      real(wp), intent(inout), target, contiguous :: avalanche(:, :)
      !> Where snapshots were taken, shape (snapshot_place_length, capacity)
      real(wp), intent(inout), target, contiguous :: place(:, :)
      !> Snapshots, shape (snapshot_length, contacts, capacity)
      real(wp), intent(inout), target, contiguous :: snapshot(:, :, :)
      !> Times at which snapshots are taken, growing [s]
      real(wp), intent(in) :: snapshot_time(:)

      self%snapshot_time = snapshot_time
      self%avalanche => avalanche
      self%place => place
      self%snapshot => snapshot
   end subroutine attach

   !> Whether the caller's arrays have room for one more step.
   pure function has_room(self)
      !> The recorder
      class(avalanche_recorder_type), intent(in) :: self
      !> Whether the next advance and its response can be recorded
      logical :: has_room

      integer :: snapshots

      has_room = .true.
      if (self%parameters%least_size > 0.0_wp) then
         has_room = self%avalanche_count < size(self%avalanche, 2)
      end if
      ! One advance may come past many times, but ends one avalanche at most.
      snapshots = size(self%snapshot_time) - self%taken
      if (self%parameters%snapshot_size > 0.0_wp) snapshots = snapshots + 1
      has_room = has_room .and. self%snapshot_count + snapshots <= size(self%place, 2)
   end function has_room

   !> Look at an advance of the slider, before the contacts respond.
   subroutine see_advance(self, slider, contacts)
      !> The recorder
      class(avalanche_recorder_type), intent(inout) :: self
      !> The slider after its advance
      class(slider_type), intent(in) :: slider
      !> The contacts as they were during the advance
      class(contacts_type), intent(inout) :: contacts

      type(motion_type) :: motion

      if (self%size > 0.0_wp .and. slider%settled) then
         call self%close(slider, contacts, slider%rest_displacement)
      end if
      do while (self%taken < size(self%snapshot_time))
         if (self%snapshot_time(self%taken + 1) > slider%time) exit
         self%taken = self%taken + 1
         motion = slider%observe(self%snapshot_time(self%taken))
         call self%take_snapshot(contacts, motion%time, motion%displacement, &
            & motion%displacement - slider%origin)
      end do
   end subroutine see_advance

   !> Look at the response of the contacts.
   subroutine see_response(self, slider, contacts, law)
      !> The recorder
      class(avalanche_recorder_type), intent(inout) :: self
      !> The slider
      class(slider_type), intent(in) :: slider
      !> The contacts after their response
      class(contacts_type), intent(inout) :: contacts
      !> Contact force before
      type(interface_law_type), intent(in) :: law

      if (.not. contacts%breaks > self%breaks) return
      if (.not. self%size > 0.0_wp) call self%open(slider, law)
      self%size = self%size + (contacts%breaks - self%breaks)
      self%breaks = contacts%breaks
      if (.not. slider%instant) call self%close(slider, contacts, slider%displacement)
   end subroutine see_response

   !> An avalanche begins.
   subroutine open(self, slider, law)
      class(avalanche_recorder_type), intent(inout) :: self
      class(slider_type), intent(in) :: slider
      type(interface_law_type), intent(in) :: law

      self%time = slider%time
      self%displacement = slider%origin + slider%displacement
      self%force = law%stiffness * slider%displacement - law%offset
   end subroutine open

   !> Close the present avalanche.
   subroutine close(self, slider, contacts, displacement)
      !> The recorder
      class(avalanche_recorder_type), intent(inout) :: self
      !> The slider
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
      if (self%parameters%least_size > 0.0_wp .and. self%size >= self%parameters%least_size) then
         law = contacts%law()
         self%avalanche_count = self%avalanche_count + 1
         self%avalanche(:, self%avalanche_count) = [self%time, self%displacement, self%size, &
            & self%force, self%force - (law%stiffness * displacement - law%offset), slip, &
            & real(extent, wp)]
      end if
      self%size = 0.0_wp
   end subroutine close

   !> Take a snapshot of the contacts.
   subroutine take_snapshot(self, contacts, time, displacement, relative)
      class(avalanche_recorder_type), intent(inout) :: self
      class(contacts_type), intent(in) :: contacts
      !> Time [s], displacement, and displacement from the moving origin [m]
      real(wp), intent(in) :: time, displacement, relative

      self%snapshot_count = self%snapshot_count + 1
      self%place(:, self%snapshot_count) = [time, displacement, self%size]
      call contacts%snapshot(relative, self%snapshot(:, :, self%snapshot_count))
   end subroutine take_snapshot

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The recorder
      class(avalanche_recorder_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%exchange(self%avalanches)
      call archive%exchange(self%size)
      call archive%exchange(self%slip)
      call archive%exchange(self%taken)
      call archive%exchange(self%breaks)
      call archive%exchange(self%time)
      call archive%exchange(self%displacement)
      call archive%exchange(self%force)
   end subroutine exchange

end module mesoslip_recording_avalanches
