! The parts of a simulation as Python sets them before the run starts; see simulation.f90.

!> Give a simulation its contacts.
subroutine set_contacts(handle, kind, length, names, values, words, seed, realization, status, &
   & message)
   !f2py threadsafe
   use mesoslip_contacts, only: make_contacts
   use mesoslip_boundary_handles, only: error_type, find_recipe, find_simulation, recipe_type, &
      & report, simulation_type
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
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
   type(recipe_type), pointer :: recipe
   type(parameters_type) :: parameters
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      call new_parameters(parameters, names, values, words)
      call find_recipe(handle, recipe)
      recipe%contacts = kind
      recipe%contact_parameters = parameters
      recipe%seed = seed
      call make_contacts(simulation%contacts, kind, parameters, seed, realization, error)
   end if
   call report(error, status, message)
end subroutine set_contacts

!> Give a simulation the contacts of another one, which has not been started.
subroutine copy_contacts(handle, template, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_numerics_errors, only: raise, status_invalid, status_memory
   implicit none
   integer(8), intent(in) :: handle(2)
   integer(8), intent(in) :: template(2)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation, other
   type(error_type), allocatable :: error
   integer :: stat

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) call find_simulation(template, .false., other, error)
   if (.not. allocated(error)) then
      if (.not. allocated(other%contacts)) then
         call raise(error, status_invalid, "the simulation to copy from has no contacts")
      else if (other%is_started) then
         call raise(error, status_invalid, "the simulation to copy from was started")
      end if
   end if
   if (.not. allocated(error)) then
      if (allocated(simulation%contacts)) deallocate (simulation%contacts)
      allocate (simulation%contacts, source=other%contacts, stat=stat)
      if (stat /= 0) call raise(error, status_memory, "there is not enough memory for the contacts")
   end if
   call report(error, status, message)
end subroutine copy_contacts

!> Give a simulation its slider.
subroutine set_slider(handle, kind, length, names, values, words, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_recipe, find_simulation, recipe_type, &
      & report, simulation_type
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
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
   type(recipe_type), pointer :: recipe
   type(parameters_type) :: parameters
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      call new_parameters(parameters, names, values, words)
      call find_recipe(handle, recipe)
      recipe%slider = kind
      recipe%slider_parameters = parameters
      call make_slider(simulation%slider, kind, parameters, error)
   end if
   call report(error, status, message)
end subroutine set_slider

!> Give a simulation, which has its slider, a drive of constant acceleration in each of its parts.
subroutine set_drive(handle, parts, part_end, start_rate, end_rate, stage, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_numerics_errors, only: raise, status_invalid
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of parts; end of each [s], rates of the drive at its start and at its end, [m/s], or
   !> [N/s] of a force, and number of its stage
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
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_numerics_errors, only: raise, status_invalid
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

!> Set the conditions that end a simulation before its drive.
subroutine set_stop(handle, slips, displacement, block_distance, blocks, tolerance, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of slips; 0: any
   integer(8), intent(in) :: slips
   !> Displacement of the slider to reach [m]; 0: any
   real(8), intent(in) :: displacement
   !> Steady state: distance of the drive in a block [m], 0: not looked for; number of blocks in a
   !> mean; difference of mean forces that is ignored [N]
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

!> Set the record of the motion of a simulation, which has its contacts.
subroutine set_recorder(handle, interval, slip_interval, slip_velocity, quiet_time, duration, &
   & layers, blocks, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_numerics_errors, only: raise, status_invalid
   use mesoslip_recording_recorder, only: recorder_parameters_type
   use mesoslip_recording_slips, only: slip_parameters_type
   use mesoslip_sliders_interface_state, only: block_values
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Interval of the trace, and of the finer traces, 0: no finer traces [s]
   real(8), intent(in) :: interval, slip_interval
   !> Velocity above the drive's that makes a slip [m/s], 0: no slips; half a period of the setup,
   !> duration of the run [s]
   real(8), intent(in) :: slip_velocity, quiet_time, duration
   !> Numbers of layers whose displacements, and of blocks whose motions are recorded with the trace
   integer, intent(in) :: layers, blocks
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: simulation
   type(error_type), allocatable :: error

   call find_simulation(handle, .false., simulation, error)
   if (.not. allocated(error)) then
      if (allocated(simulation%contacts)) then
         call simulation%ruptures%open(blocks, slip_velocity, quiet_time, error)
         call simulation%recorder%open(recorder_parameters_type(interval, duration, &
            & layers + block_values * blocks, &
            & slip_parameters_type(slip_velocity=slip_velocity, quiet_time=quiet_time, &
            & interval=slip_interval, contacts=simulation%contacts%parameters%count)))
      else
         call raise(error, status_invalid, "contacts come before what is recorded of them")
      end if
   end if
   call report(error, status, message)
end subroutine set_recorder

!> Set the record of avalanches of a simulation, which has its contacts.
subroutine set_avalanches(handle, min_size, snapshot_size, max_avalanches, snapshots, &
   & snapshot_time, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_simulation, report, simulation_type
   use mesoslip_numerics_errors, only: raise, status_invalid
   use mesoslip_recording_avalanches, only: avalanche_parameters_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Minimum sizes of avalanches in the catalogue, and with a snapshot; 0: neither
   real(8), intent(in) :: min_size, snapshot_size
   !> Number of avalanches after which the run ends; 0: any
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
