! A simulation as Python calls it: flat subroutines with explicit shapes, wrapped by f2py.
!
! A simulation lives here; Python holds its handle, two numbers that only these procedures read.
! Each has a status and a message as its last arguments; status 0 means success. None keeps state.

!> Set up a simulation without parts.
subroutine open_simulation(handle)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: open_handle
   implicit none
   !> The handle
   integer(8), intent(inout) :: handle(2)

   call open_handle(handle)
end subroutine open_simulation

!> Free a simulation; its handle is of no use afterwards.
subroutine close_simulation(handle)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: close_handle
   implicit none
   !> The handle; closing it again does nothing
   integer(8), intent(inout) :: handle(2)

   call close_handle(handle)
end subroutine close_simulation

!> Give a simulation its contacts.
subroutine set_contacts(handle, kind, length, names, values, words, seed, realization, status, &
   & message)
   !f2py threadsafe
   use mesoslip_contacts, only: make_contacts
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Kind of the contacts, and their parameters by name, numbers or words
   character(len=*), intent(in) :: kind
   integer, intent(in) :: length
   character(len=32), intent(in) :: names(length), words(length)
   real(8), intent(in) :: values(length)
   !> Key of the random numbers
   integer(8), intent(in) :: seed, realization
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(parameters_type) :: parameters
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      call new_parameters(parameters, names, values, words)
      call make_contacts(simulation%contacts, kind, parameters, seed, realization, error)
   end if
   call report(error, status, message)
end subroutine set_contacts

!> Give a simulation its slider.
subroutine set_slider(handle, kind, length, names, values, words, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_loop_simulation, only: simulation_type
   use mesoslip_sliders, only: make_slider
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Kind of the slider, and its parameters by name, numbers or words
   character(len=*), intent(in) :: kind
   integer, intent(in) :: length
   character(len=32), intent(in) :: names(length), words(length)
   real(8), intent(in) :: values(length)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(parameters_type) :: parameters
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      call new_parameters(parameters, names, values, words)
      call make_slider(simulation%slider, kind, parameters, error)
   end if
   call report(error, status, message)
end subroutine set_slider

!> Give a simulation, which has its slider, a drive of constant acceleration in each of its parts.
subroutine set_drive(handle, parts, part_end, start_rate, end_rate, stage, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of parts; when each ends [s], rates of the drive at its start and at its end, [m/s], or
   !> [N/s] if it is a force, and the number of the stage that it is of
   integer, intent(in) :: parts
   real(8), intent(in) :: part_end(parts), start_rate(parts), end_rate(parts)
   integer, intent(in) :: stage(parts)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      call simulation%stages%open()
      if (allocated(simulation%slider)) then
         call simulation%slider%drive%open(part_end, start_rate, end_rate, stage, error)
      else
         call raise(error, status_invalid, "the slider comes before its drive")
      end if
   end if
   call report(error, status, message)
end subroutine set_drive

!> Give a simulation, which has its drive, the values at which the parts of the drive start.
subroutine set_drive_values(handle, parts, start_value, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of parts; value at the start of each, a force [N]
   integer, intent(in) :: parts
   real(8), intent(in) :: start_value(parts)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      if (allocated(simulation%slider)) then
         call simulation%slider%drive%set_values(start_value, error)
      else
         call raise(error, status_invalid, "the slider comes before its drive")
      end if
   end if
   call report(error, status, message)
end subroutine set_drive_values

!> Set when a simulation stops before its drive ends.
subroutine set_stop(handle, slips, displacement, block_distance, blocks, tolerance, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of slips, 0 for any
   integer(8), intent(in) :: slips
   !> Displacement of the slider to come to [m], 0 for any
   real(8), intent(in) :: displacement
   !> Distance of the drive in a block [m], 0 for not to stop at a steady state; blocks that
   !> are compared with as many before; difference of the mean forces that counts as none [N]
   real(8), intent(in) :: block_distance
   integer, intent(in) :: blocks
   real(8), intent(in) :: tolerance
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      if (slips > 0) simulation%stop%max_slips = slips
      simulation%stop%displacement = displacement
      call simulation%steady%open(block_distance, blocks, tolerance)
   end if
   call report(error, status, message)
end subroutine set_stop

!> Set what a simulation, which has its contacts, records of the motion.
subroutine set_recorder(handle, interval, slip_interval, slip_velocity, quiet_time, duration, &
   & layers, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_recording_recorder, only: recorder_parameters_type
   use mesoslip_recording_slips, only: slip_parameters_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Interval of the trace, and of the finer traces, 0 for none [s]
   real(8), intent(in) :: interval, slip_interval
   !> Velocity above the drive's that makes a slip [m/s], 0 for none; half a period of the setup,
   !> duration of the run [s]
   real(8), intent(in) :: slip_velocity, quiet_time, duration
   !> Layers whose displacements go with the trace
   integer, intent(in) :: layers
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      if (allocated(simulation%contacts)) then
         call simulation%recorder%open(recorder_parameters_type(interval, duration, layers, &
            & slip_parameters_type(slip_velocity=slip_velocity, quiet_time=quiet_time, &
            & interval=slip_interval, contacts=simulation%contacts%parameters%count)))
      else
         call raise(error, status_invalid, "contacts come before what is recorded of them")
      end if
   end if
   call report(error, status, message)
end subroutine set_recorder

!> Set what a simulation, which has its contacts, records of avalanches.
subroutine set_avalanches(handle, min_size, snapshot_size, max_avalanches, snapshots, &
   & snapshot_time, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_recording_avalanches, only: avalanche_parameters_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Minimum sizes of avalanches in the catalogue and with a snapshot, 0 for none
   real(8), intent(in) :: min_size, snapshot_size
   !> Avalanches after which the run is over, 0 for any number
   integer(8), intent(in) :: max_avalanches
   !> Times of snapshots [s]
   integer, intent(in) :: snapshots
   real(8), intent(in) :: snapshot_time(snapshots)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(avalanche_parameters_type) :: parameters
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      parameters%min_size = min_size
      parameters%snapshot_size = snapshot_size
      if (max_avalanches > 0) parameters%max_avalanches = max_avalanches
      if (allocated(simulation%contacts)) then
         call simulation%avalanches%open(parameters, snapshot_time, &
            & simulation%contacts%individual_count())
      else
         call raise(error, status_invalid, "contacts come before what is recorded of them")
      end if
   end if
   call report(error, status, message)
end subroutine set_avalanches

!> Start a simulation that has all its parts.
subroutine start_simulation(handle, initial, status, message)
   !f2py threadsafe
   use mesoslip_contacts_mechanics, only: initial_names
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_parameters, only: choose
   use mesoslip_loop_simulation, only: simulation_type
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

!> Go on for some advances or some work, or until much waits to be drained, or until the end.
subroutine advance_simulation(handle, max_advances, max_work, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Largest number of advances; work in units of an advance of a rigid slider
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

!> How far a simulation has come.
subroutine ask_simulation(handle, ending, time, displacement, breaks, detached, avalanche_slip, &
   & error_estimate, advances, avalanches, integrator, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_endings, only: ending_names
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Why the run is over, blank if it is not
   character(len=32), intent(out) :: ending
   !> Time [s], displacement of the slider [m], breaks so far, contacts that are detached, slip in
   !> avalanches [m], estimated error of the contact force [N]
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
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Work of the drive; energy of the slider and its spring, of the contacts; losses by damping, by
   !> drag, by breaking; gain by attaching; work of steps beyond that of the contacts; what the
   !> balance lacks [J]
   real(8), intent(out) :: energy(9)
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
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_loop_simulation, only: simulation_type
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

!> Rows of a table that wait to be drained.
subroutine count_rows(handle, table, columns, rows, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Name of the table
   character(len=*), intent(in) :: table
   !> Numbers in a row, and rows
   integer, intent(out) :: columns, rows
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(buffer_type), pointer :: buffer
   type(error_type), allocatable :: error

   columns = 0
   rows = 0
   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) then
      buffer => simulation%table(table)
      if (associated(buffer)) then
         columns = size(buffer%row, 1)
         rows = simulation%rows_to_drain(table)
      else
         call raise(error, status_invalid, "unknown table '" // table // "'")
      end if
   end if
   call report(error, status, message)
end subroutine count_rows

!> Take the first rows of a table away.
subroutine drain_rows(handle, table, columns, rows, values, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Name of the table
   character(len=*), intent(in) :: table
   !> Numbers in a row, and rows: as many as wait or fewer
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
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> How far [m]
   real(8), intent(in) :: distance
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .true., simulation, error)
   if (.not. allocated(error)) call simulation%displace_drive(distance)
   call report(error, status, message)
end subroutine displace_drive

!> Go on from the end of another run, whose state was restored: the first part of the drive is over.
subroutine follow_simulation(handle, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
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
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
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

!> Fetch the archive that a simulation has kept.
subroutine fetch_state(handle, length, words, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
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

!> Go on from an archive, in a simulation that has all its parts and was not started.
subroutine restore_simulation(handle, length, words, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: find_simulation, report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_loop_simulation, only: simulation_type
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

!> A list of names that both sides share: columns of a table, or kinds of something.
subroutine list_names(which, room, names, count, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: report
   use mesoslip_boundary_names, only: find_names
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_parameters, only: name_length
   implicit none
   !> Which list
   character(len=*), intent(in) :: which
   !> Names for which there is room
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
