!> Short runs made from the recipe of one simulation.
module mesoslip_boundary_short_runs
   use mesoslip_boundary_handles, only: recipe_type
   use mesoslip_contacts, only: make_contacts
   use mesoslip_loop_simulation, only: simulation_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_sliders, only: make_slider
   implicit none
   private

   public :: run_short, take_rows

contains

   !> Run a realization of a simulation, which is not started.
   subroutine run_short(simulation, template, recipe, realization, initial, max_work, error)
      !> The run: at its end, or at a bound
      type(simulation_type), allocatable, intent(out) :: simulation
      !> The simulation, and its recipe
      type(simulation_type), intent(in) :: template
      type(recipe_type), intent(in) :: recipe
      !> Number of the realization
      integer(i8), intent(in) :: realization
      !> Initial state of the contacts, an initial_ code
      integer, intent(in) :: initial
      !> Maximum work: 1 for an advance of a rigid slider or a break
      real(wp), intent(in) :: max_work
      !> Set if the run fails
      type(error_type), allocatable, intent(out) :: error

      type(parameters_type) :: parameters

      allocate (simulation)
      parameters = recipe%contact_parameters
      call make_contacts(simulation%contacts, recipe%contacts, parameters, recipe%seed, &
         & realization, error)
      if (allocated(error)) return
      parameters = recipe%slider_parameters
      call make_slider(simulation%slider, recipe%slider, parameters, error)
      if (allocated(error)) return
      call simulation%take_settings(template)
      call simulation%start(initial)
      call simulation%run(huge(1_i8) / 2_i8, max_work, error)
   end subroutine run_short

   !> Take the rows of some tables of a run, one after another, if there is room for all of them.
   subroutine take_rows(simulation, name, values, used, rows, error)
      type(simulation_type), intent(inout), target :: simulation
      !> Names of the tables
      character(len=*), intent(in) :: name(:)
      !> Numbers of all rows, the first of which are used
      real(wp), intent(inout) :: values(:)
      integer, intent(inout) :: used
      !> Number of rows of each table; -1 if there is no room
      integer, intent(out) :: rows(:)
      type(error_type), allocatable, intent(out) :: error

      type(buffer_type), pointer :: buffer
      integer :: columns(size(name)), table

      do table = 1, size(name)
         buffer => simulation%table(name(table))
         columns(table) = size(buffer%row, 1)
         rows(table) = simulation%rows_to_drain(name(table))
      end do
      if (sum(int(columns, i8) * rows) > size(values) - used) then
         rows = -1
         return
      end if
      do table = 1, size(name)
         if (rows(table) == 0) cycle
         call drain(simulation, name(table), columns(table), rows(table), values(used + 1:), error)
         if (allocated(error)) return
         used = used + columns(table) * rows(table)
      end do
   end subroutine take_rows

   !> Drain rows of a table into numbers.
   subroutine drain(simulation, name, columns, rows, values, error)
      type(simulation_type), intent(inout) :: simulation
      character(len=*), intent(in) :: name
      !> Numbers in a row, and rows
      integer, intent(in) :: columns, rows
      real(wp), intent(inout) :: values(columns, rows)
      type(error_type), allocatable, intent(out) :: error

      call simulation%drain(name, values, error)
   end subroutine drain

end module mesoslip_boundary_short_runs
