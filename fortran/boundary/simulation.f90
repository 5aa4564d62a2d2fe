! A simulation as Python calls it: flat subroutines with explicit shapes, wrapped by f2py.
!
! A simulation lives here; Python holds its handle, two numbers that only these procedures read.
! Each procedure has a status and a message as its last arguments; status 0 means success. No
! procedure keeps state.

!> Set up a simulation without parts.
subroutine open_simulation(handle)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: open_handle
   implicit none
   integer(8), intent(inout) :: handle(2)

   call open_handle(handle)
end subroutine open_simulation

!> Free a simulation; its handle is invalid afterwards.
subroutine close_simulation(handle)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: close_handle
   implicit none
   !> The handle; closing it again does nothing
   integer(8), intent(inout) :: handle(2)

   call close_handle(handle)
end subroutine close_simulation

!> Start a simulation that has all its parts.
subroutine start_simulation(handle, initial, status, message)
   !f2py threadsafe
   use mesoslip_contacts_mechanics, only: initial_names
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_numerics_parameters, only: choose
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Initial state of the contacts
   character(len=*), intent(in) :: initial
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error
   integer :: state

   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call choose("initial state", initial, initial_names, state, error)
   if (.not. allocated(error)) call simulation%start(state)
   call report(error, status, message)
end subroutine start_simulation

!> Continue until the end of the run or of a segment, or until a table should be drained.
subroutine advance_simulation(handle, max_advances, max_work, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Advances and work in the segment: 1 for an advance of a rigid slider or a break
   integer(8), intent(in) :: max_advances
   real(8), intent(in) :: max_work
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call simulation%run(max_advances, max_work, error)
   call report(error, status, message)
end subroutine advance_simulation

!> Progress of a simulation.
subroutine ask_simulation(handle, ending, time, displacement, breaks, detached, avalanche_slip, &
   & error_estimate, advances, avalanches, integrator, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_loop_endings, only: ending_names
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Reason for the end of the run, blank before it
   character(len=32), intent(out) :: ending
   !> Time [s], displacement of the slider [m], breaks so far, detached contacts, slip in avalanches
   !> [m], estimated error of the contact force [N]
   real(8), intent(out) :: time, displacement, breaks, detached, avalanche_slip, error_estimate
   !> Advances and avalanches so far; steps, evaluations and failed steps of the integrator
   integer(8), intent(out) :: advances, avalanches, integrator(3)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   ending = ""
   time = 0.0d0
   displacement = 0.0d0
   breaks = 0.0d0
   detached = 0.0d0
   avalanche_slip = 0.0d0
   error_estimate = 0.0d0
   advances = 0
   avalanches = 0
   integrator = 0
   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) then
      ending = ending_names(simulation%ending)
      time = simulation%slider%time
      displacement = simulation%slider%origin + simulation%slider%displacement
      breaks = simulation%contacts%breaks
      detached = simulation%contacts%detached_count
      avalanche_slip = simulation%avalanches%slip
      error_estimate = simulation%contacts%error_estimate
      advances = simulation%advances
      avalanches = simulation%avalanches%avalanches
      integrator = simulation%slider%integrator_counts
   end if
   call report(error, status, message)
end subroutine ask_simulation

!> Terms of the energy balance of a simulation.
subroutine ask_energy(handle, energy, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Terms in the order of the list of names "energy" [J]
   real(8), intent(out) :: energy(11)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   energy = 0.0d0
   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) energy = simulation%energy_balance()
   call report(error, status, message)
end subroutine ask_energy

!> State of each contact: origin [m], stiffness [N/m], breaking stretch [m], renewals.
subroutine ask_contacts(handle, count, values, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_numerics_errors, only: raise, status_invalid
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of contacts
   integer, intent(in) :: count
   !> Stiffness is 0 while a contact is detached
   real(8), intent(out) :: values(4, count)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   values = 0.0d0
   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) then
      if (simulation%contacts%individual_count() == count) then
         call simulation%contacts%records(simulation%slider%time, 1, values)
      else
         call raise(error, status_invalid, "contacts are not kept one by one, or not as many")
      end if
   end if
   call report(error, status, message)
end subroutine ask_contacts

!> Numbers of rows that can be drained, for all tables in the order of the list of names "tables".
subroutine count_rows(handle, tables, columns, rows, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_loop_state, only: table_names
   use mesoslip_recording_buffer, only: buffer_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of tables; numbers in a row, and rows, of each
   integer, intent(in) :: tables
   integer, intent(out) :: columns(tables), rows(tables)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(buffer_type), pointer :: buffer
   type(error_type), allocatable :: error
   integer :: table

   columns = 0
   rows = 0
   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) then
      do table = 1, min(tables, size(table_names))
         buffer => simulation%table(table_names(table))
         columns(table) = size(buffer%row, 1)
         rows(table) = simulation%rows_to_drain(table_names(table))
      end do
   end if
   call report(error, status, message)
end subroutine count_rows

!> Remove the first rows of a table and return them.
subroutine drain_rows(handle, table, columns, rows, values, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Name of the table
   character(len=*), intent(in) :: table
   !> Numbers in a row, and rows: no more than can be drained
   integer, intent(in) :: columns, rows
   real(8), intent(inout) :: values(columns, rows)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call simulation%drain(table, values, error)
   call report(error, status, message)
end subroutine drain_rows

!> Displace the drive of a simulation at once, as a small perturbation.
subroutine displace_drive(handle, distance, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Displacement [m]
   real(8), intent(in) :: distance
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call simulation%displace_drive(distance)
   call report(error, status, message)
end subroutine displace_drive

!> Continue from the end of another run, whose state was restored: the first part of the drive is
!> over.
subroutine follow_simulation(handle, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call simulation%follow(error)
   call report(error, status, message)
end subroutine follow_simulation

!> Put the state of a simulation into an archive, which the simulation keeps until it is fetched.
subroutine save_simulation(handle, length, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of words of the archive
   integer(8), intent(out) :: length
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   length = 0
   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call simulation%save(length, error)
   call report(error, status, message)
end subroutine save_simulation

!> Fetch the archive of a simulation.
subroutine fetch_state(handle, length, words, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of words of the archive
   integer(8), intent(in) :: length
   integer(8), intent(inout) :: words(length)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call simulation%fetch(words, error)
   call report(error, status, message)
end subroutine fetch_state

!> Continue from an archive, in a simulation that has all its parts and was not started.
subroutine restore_simulation(handle, length, words, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> The archive
   integer(8), intent(in) :: length
   integer(8), intent(in) :: words(length)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call simulation%restore(words, error)
   call report(error, status, message)
end subroutine restore_simulation

!> A list of names that both sides share: columns of a table, or kinds.
subroutine list_names(which, room, names, count, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, report
   use mesoslip_boundary_names, only: find_names
   use mesoslip_numerics_parameters, only: name_length
   implicit none
   character(len=*), intent(in) :: which
   !> Room for names
   integer, intent(in) :: room
   !> The names, and their number
   character(len=32), intent(out) :: names(room)
   integer, intent(out) :: count
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   character(len=name_length), allocatable :: found(:)
   type(error_type), allocatable :: error

   names = ""
   count = 0
   call find_names(which, found, error)
   if (.not. allocated(error)) then
      count = min(room, size(found))
      names(:count) = found(:count)
   end if
   call report(error, status, message)
end subroutine list_names

!> Version of the SUNDIALS library in use.
subroutine sundials(version)
   !f2py threadsafe
   use mesoslip_numerics_sundials_cvode, only: sundials_version
   implicit none
   character(len=32), intent(out) :: version

   version = sundials_version()
end subroutine sundials
