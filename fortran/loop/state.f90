!> The state of a run: a slider on contacts, with recorders.
module mesoslip_loop_state
   use mesoslip_contacts_base, only: contacts_type
   use mesoslip_loop_endings, only: ending_none, stop_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_recording_avalanches, only: avalanche_recorder_type
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_recording_recorder, only: recorder_type
   use mesoslip_recording_ruptures, only: rupture_recorder_type
   use mesoslip_recording_stages, only: stage_recorder_type
   use mesoslip_recording_steady, only: steady_recorder_type
   use mesoslip_schedule, only: max_events, schedule_type
   use mesoslip_sliders_base, only: slider_type
   implicit none
   private

   public :: state_type, max_idle_advances, no_progress
   public :: energy_columns, energy_length, table_names

   !> Terms of the energy balance: work of the drive; energy of the slider and its spring; of the
   !> contacts; losses by damping, by drag, by breaking; gain by attaching; work of steps beyond
   !> that of the contacts; loss by separating as the normal load falls; work of the drive, the
   !> sizes of its parts; residual
   character(len=*), parameter :: energy_columns(*) = [character(len=name_length) :: &
      & "drive_work", "slider_energy", "contact_energy", "damping_loss", "drag_loss", &
      & "break_loss", "birth_gain", "step_work", "separation_loss", "gross_work", "residual"]
   integer, parameter :: energy_length = size(energy_columns)
   !> Maximum number of advances in a row that change neither time nor displacement, and the message
   integer, parameter :: max_idle_advances = 1000000
   character(len=*), parameter :: no_progress = "the motion makes no progress: very many steps " &
      & // "change neither time nor displacement, as where contacts break and attach again " &
      & // "without end"
   !> Names of the tables
   character(len=*), parameter :: table_names(*) = [character(len=name_length) :: "trace", &
      & "slip_trace", "slips", "stages", "layers", "blocks", "ruptures", "avalanches", &
      & "snapshot_events", "snapshots"]

   !> A slider with its drive, on contacts, and recorders.
   type :: state_type
      class(slider_type), allocatable :: slider
      class(contacts_type), allocatable :: contacts
      type(recorder_type) :: recorder
      !> The recorder of avalanches and snapshots
      type(avalanche_recorder_type) :: avalanches
      !> The recorder of ruptures of the blocks of a row
      type(rupture_recorder_type) :: ruptures
      !> The recorder of stages of the drive
      type(stage_recorder_type) :: stages
      !> Whether the state is steady, in the last part of the drive
      type(steady_recorder_type) :: steady
      !> Conditions that end the run before its drive does
      type(stop_type) :: stop
      !> Advances of the slider so far
      integer(i8) :: advances = 0
      !> Reason for the end of the run, an ending_ code
      integer :: ending = ending_none
      logical :: is_started = .false.
      !> Maximum number of breaks, and of attachments, in a schedule; 0 for no schedules. The
      !> numbers of a run do not depend on it
      integer :: max_schedule = max_events
      !> The next events; between two segments it is empty
      type(schedule_type) :: schedule
      !> Advances since time or displacement changed; time [s], origin and displacement [m] then
      integer :: idle = 0
      real(wp) :: idle_since(3) = 0.0_wp
      !> Energy of slider and contacts at the start [J]
      real(wp) :: start_energy = 0.0_wp

      !> A state that was saved and has not been fetched
      type(archive_type), private :: kept
   contains
      procedure, non_overridable :: is_whole
      procedure, non_overridable :: take_settings
      procedure, non_overridable :: energy_balance
      procedure, non_overridable :: table
      procedure, non_overridable :: rows_to_drain
      procedure, non_overridable :: drain
      procedure, non_overridable :: report_failure
      procedure, non_overridable :: displace_drive
      procedure, non_overridable :: exchange
      procedure, non_overridable :: save
      procedure, non_overridable :: fetch
      procedure, non_overridable :: restore
   end type state_type

contains

   !> Whether all parts are there: a slider with its drive, contacts, and recorders.
   pure function is_whole(self)
      class(state_type), intent(in) :: self
      logical :: is_whole

      is_whole = allocated(self%slider) .and. allocated(self%contacts) &
         & .and. allocated(self%recorder%trace%rows%row) &
         & .and. allocated(self%recorder%slips%catalogue%row) &
         & .and. allocated(self%avalanches%catalogue%row) .and. allocated(self%stages%rows%row)
      if (is_whole) is_whole = self%slider%drive%is_open() .and. self%steady%is_open()
   end function is_whole

   !> Take what another state, which is not started, has beside its contacts and its slider.
   subroutine take_settings(self, other)
      class(state_type), intent(inout) :: self
      class(state_type), intent(in) :: other

      self%slider%drive = other%slider%drive
      self%recorder = other%recorder
      self%avalanches = other%avalanches
      self%ruptures = other%ruptures
      self%stages = other%stages
      self%steady = other%steady
      self%stop = other%stop
      self%max_schedule = other%max_schedule
   end subroutine take_settings

   !> Terms of the energy balance, in the order of energy_columns [J].
   function energy_balance(self) result(energy)
      class(state_type), intent(in) :: self
      real(wp) :: energy(energy_length)

      energy(1) = self%slider%drive%work()
      energy(2) = self%slider%energy()
      energy(3) = self%contacts%elastic_energy(self%slider%displacement)
      energy(4) = self%slider%damping_loss%total()
      energy(5) = self%slider%drag_loss%total()
      energy(6) = self%contacts%break_loss%total()
      energy(7) = self%contacts%birth_gain%total()
      energy(8) = self%contacts%step_work%total()
      energy(9) = self%contacts%separation_loss%total()
      energy(10) = self%slider%drive%gross_work()
      energy(11) = energy(1) - (energy(2) + energy(3) - self%start_energy) &
         & - energy(4) - energy(5) - energy(6) + energy(7) - energy(8) - energy(9)
   end function energy_balance

   !> A table of recorded rows; null if there is no table of this name.
   function table(self, name) result(buffer)
      class(state_type), intent(inout), target :: self
      character(len=*), intent(in) :: name
      type(buffer_type), pointer :: buffer

      select case (name)
      case ("trace")
         buffer => self%recorder%trace%rows
      case ("slip_trace")
         buffer => self%recorder%slips%trace%rows
      case ("slips")
         buffer => self%recorder%slips%catalogue
      case ("stages")
         buffer => self%stages%rows
      case ("layers", "blocks")
         buffer => self%recorder%trace%layer_rows
      case ("ruptures")
         buffer => self%ruptures%catalogue
      case ("avalanches")
         buffer => self%avalanches%catalogue
      case ("snapshot_events")
         buffer => self%avalanches%events
      case ("snapshots")
         buffer => self%avalanches%snapshots
      case default
         buffer => null()
      end select
   end function table

   !> Number of rows of a table that can be drained.
   function rows_to_drain(self, name) result(rows)
      class(state_type), intent(inout), target :: self
      character(len=*), intent(in) :: name
      integer :: rows

      type(buffer_type), pointer :: buffer

      buffer => self%table(name)
      rows = 0
      if (associated(buffer)) rows = buffer%count
      if (name == "slip_trace") rows = self%recorder%slips%final_samples()
   end function rows_to_drain

   !> Remove the first rows of a table and return them.
   subroutine drain(self, name, values, error)
      class(state_type), intent(inout), target :: self
      character(len=*), intent(in) :: name
      !> The rows, shape (numbers in a row, rows)
      real(wp), intent(inout) :: values(:, :)
      !> Set if there is no such table, or it has fewer or other rows
      type(error_type), allocatable, intent(out) :: error

      type(buffer_type), pointer :: buffer
      integer :: rows

      buffer => self%table(name)
      rows = self%rows_to_drain(name)
      if (.not. associated(buffer)) then
         call raise(error, status_invalid, "unknown table '" // name // "'")
      else if (size(values, 1) /= size(buffer%row, 1) .or. size(values, 2) > rows) then
         call raise(error, status_invalid, "the table '" // name // "' has other rows")
      else if (name == "slip_trace") then
         call self%recorder%slips%trace%drain(values)
      else
         call buffer%drain(values)
      end if
   end subroutine drain

   !> Report that not all could be recorded.
   subroutine report_failure(self, error)
      class(state_type), intent(inout), target :: self
      !> Set if there was not enough memory for a row
      type(error_type), allocatable, intent(inout) :: error

      type(buffer_type), pointer :: buffer
      integer :: i

      if (allocated(self%recorder%slips%minima%rows%failure)) then
         error = self%recorder%slips%minima%rows%failure
      end if
      do i = 1, size(table_names)
         buffer => self%table(table_names(i))
         if (allocated(buffer%failure)) error = buffer%failure
      end do
   end subroutine report_failure

   !> Displace the drive at once: the motion continues with another length of the spring.
   subroutine displace_drive(self, distance)
      class(state_type), intent(inout) :: self
      !> Displacement [m]
      real(wp), intent(in) :: distance

      real(wp) :: energy

      energy = self%slider%energy()
      self%slider%drive%value = self%slider%drive%value + distance
      ! The energy balance starts from the displaced state.
      self%start_energy = self%start_energy + (self%slider%energy() - energy)
   end subroutine displace_drive

   !> Put the state into an archive or take it out; a queue taken out is rebuilt.
   subroutine exchange(self, archive)
      class(state_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("simulation")
      call archive%exchange("idle", self%idle)
      call archive%exchange("idle_since_time", self%idle_since(1))
      call archive%exchange("idle_since_origin", self%idle_since(2))
      call archive%exchange("idle_since_displacement", self%idle_since(3))
      call archive%exchange("start_energy", self%start_energy)
      call archive%exchange("advances", self%advances)
      call archive%exchange("ending", self%ending)
      call archive%exchange("is_started", self%is_started)
      call self%slider%exchange(archive)
      call self%contacts%exchange(archive)
      call self%recorder%exchange(archive)
      call self%stages%exchange(archive)
      call self%steady%exchange(archive)
      call self%avalanches%exchange(archive)
      call self%ruptures%exchange(archive)
      call archive%finish()
      if (archive%saving .or. allocated(archive%failure)) return
      call self%contacts%rebuild(self%slider%displacement)
   end subroutine exchange

   !> Save the state, to be fetched.
   subroutine save(self, length, error)
      class(state_type), intent(inout) :: self
      !> Length of the state in words
      integer(i8), intent(out) :: length
      !> Set if the state cannot be saved
      type(error_type), allocatable, intent(out) :: error

      self%kept = archive_type(saving=.true.)
      call self%exchange(self%kept)
      length = self%kept%length
      if (allocated(self%kept%failure)) error = self%kept%failure
   end subroutine save

   !> Fetch the state that was saved; the copy here is deleted.
   subroutine fetch(self, words, error)
      class(state_type), intent(inout) :: self
      integer(i8), intent(inout) :: words(:)
      !> Set if no state of this length was saved
      type(error_type), allocatable, intent(out) :: error

      if (size(words, kind=i8) == self%kept%length .and. self%kept%length > 0) then
         words = self%kept%word(:self%kept%length)
         self%kept = archive_type()
      else
         call raise(error, status_invalid, "no state of this length was put away")
      end if
   end subroutine fetch

   !> Continue from a state that was saved.
   subroutine restore(self, words, error)
      class(state_type), intent(inout) :: self
      integer(i8), intent(in) :: words(:)
      !> Set if the state is of another simulation, or damaged
      type(error_type), allocatable, intent(out) :: error

      type(archive_type) :: archive
      integer :: stat

      if (self%is_started) then
         call raise(error, status_invalid, "the simulation has been started already")
         return
      end if
      allocate (archive%word(size(words, kind=i8)), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for a checkpoint")
         return
      end if
      archive%word = words
      archive%length = size(words, kind=i8)
      call self%exchange(archive)
      if (allocated(archive%failure)) error = archive%failure
   end subroutine restore

end module mesoslip_loop_state
