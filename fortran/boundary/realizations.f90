! Many short runs in one call of Python, wrapped by f2py; see simulation.f90.

!> Run realizations of a simulation that has all its parts and is not started, each to its end, up
!> to one that is long, records much or fails.
subroutine run_realizations(handle, count, realizations, initial, max_work, tables, names, room, &
   & values, done, progress, counts, energy, columns, rows, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, find_recipe, find_simulation, recipe_type, &
      & report, simulation_type
   use mesoslip_boundary_short_runs, only: run_short, take_rows
   use mesoslip_contacts_mechanics, only: initial_names
   use mesoslip_loop_endings, only: ending_none
   use mesoslip_numerics_errors, only: raise, status_invalid
   use mesoslip_numerics_parameters, only: choose
   use mesoslip_recording_buffer, only: buffer_type
   implicit none
   integer(8), intent(in) :: handle(2)
   !> Number of realizations, and their numbers
   integer, intent(in) :: count
   integer(8), intent(in) :: realizations(count)
   !> Initial state of the contacts
   character(len=*), intent(in) :: initial
   !> Maximum work of one, after which no other begins either: 1 for an advance of a rigid slider
   !> or a break
   real(8), intent(in) :: max_work
   !> Number of tables whose rows are wanted, and their names
   integer, intent(in) :: tables
   character(len=32), intent(in) :: names(tables)
   !> Numbers of all rows, table after table of each realization
   integer, intent(in) :: room
   real(8), intent(inout) :: values(room)
   !> Number of realizations, the first ones, that came to their ends
   integer, intent(out) :: done
   !> Of each, as in ask_simulation: time, displacement, breaks, detached contacts, slip in
   !> avalanches, estimated error; number of the ending, advances, avalanches, counts of the
   !> integrator; terms of the energy balance
   real(8), intent(out) :: progress(6, count)
   integer(8), intent(out) :: counts(6, count)
   real(8), intent(out) :: energy(11, count)
   !> Numbers in a row, and rows, of each table
   integer, intent(out) :: columns(tables), rows(tables, count)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(simulation_type), pointer :: template
   type(simulation_type), allocatable :: one
   type(recipe_type), pointer :: recipe
   type(buffer_type), pointer :: buffer
   type(error_type), allocatable :: error, failure
   integer :: state, used, table, next
   real(8) :: work

   done = 0
   progress = 0.0d0
   counts = 0
   energy = 0.0d0
   columns = 0
   rows = 0
   call find_simulation(handle, .true., template, error)
   if (.not. allocated(error)) call choose("initial state", initial, initial_names, state, error)
   if (.not. allocated(error)) then
      call find_recipe(handle, recipe)
      if (template%is_started .or. recipe%contacts == "" .or. recipe%slider == "") then
         call raise(error, status_invalid, "realizations are those of a simulation that was not " &
            & // "started, with contacts of its own")
      end if
   end if
   if (allocated(error)) then
      call report(error, status, message)
      return
   end if
   do table = 1, tables
      buffer => template%table(names(table))
      columns(table) = size(buffer%row, 1)
   end do
   used = 0
   work = 0.0d0
   do next = 1, count
      if (work >= max_work) exit
      ! A failure comes again, and is reported, where the realization runs alone.
      call run_short(one, template, recipe, realizations(next), state, max_work, failure)
      if (allocated(failure)) exit
      if (one%ending == ending_none) exit
      call take_rows(one, names, values, used, rows(:, next), failure)
      if (allocated(failure) .or. any(rows(:, next) < 0)) exit
      progress(:, next) = [one%slider%time, one%slider%origin + one%slider%displacement, &
         & one%contacts%breaks, one%contacts%detached_count, one%avalanches%slip, &
         & one%contacts%error_estimate]
      counts(:, next) = [int(one%ending, 8), one%advances, one%avalanches%avalanches, &
         & int(one%slider%integrator_counts, 8)]
      energy(:, next) = one%energy_balance()
      work = work + real(one%advances, 8) + one%contacts%breaks
      done = next
   end do
   call report(error, status, message)
end subroutine run_realizations
