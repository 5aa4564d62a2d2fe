!> Whole runs under all run-time checks: energy, conservation, reversal, bounded work; handles.
program test_simulation
   use klein_case, only: any_work, build, count, forever, prepare, set_drive
   use mesoslip_boundary_handles, only: close_handle, find_simulation, open_handle
   use mesoslip_contacts_base, only: contact_record_length
   use mesoslip_contacts_mechanics, only: coupling_equal, coupling_scaled, initial_relaxed, &
      & initial_steady
   use mesoslip_loop_endings, only: ending_drive
   use mesoslip_loop_simulation, only: simulation_type
   use mesoslip_loop_state, only: energy_length
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length, new_parameters, parameters_type
   use mesoslip_numerics_sundials_cvode, only: sundials_version
   use mesoslip_recording_trace, only: trace_columns
   use mesoslip_schedule, only: max_events
   use mesoslip_sliders, only: make_slider
   use testing, only: check, check_close, finish
   implicit none

   call closes("ensemble", "rigid", "gaussian", 0.01_wp, coupling_scaled, initial_relaxed)
   call closes("ensemble", "rigid", "exponential", 1.0_wp, coupling_equal, initial_steady)
   call closes("ensemble", "prescribed", "exponential", 1.0_wp, coupling_scaled, initial_steady)
   call closes("thermal", "rigid", "gaussian", 0.1_wp, coupling_equal, initial_relaxed)
   call closes("thermal", "rigid", "exponential", 1.0_wp, coupling_equal, initial_steady)
   call closes("thermal", "prescribed", "gaussian", 0.1_wp, coupling_equal, initial_steady)
   call closes("thermal ageing", "rigid", "gaussian", 0.1_wp, coupling_equal, initial_relaxed)
   call closes("thermal ageing", "prescribed", "gaussian", 0.1_wp, coupling_equal, &
      & initial_relaxed)
   call closes_without_contacts("populations", "rigid", "gaussian", initial_relaxed)
   call closes_without_contacts("thermal populations", "rigid", "gaussian", initial_relaxed)
   call closes_without_contacts("thermal populations", "prescribed", "uniform", initial_steady)
   call closes_without_contacts("thermal ageing populations", "rigid", "gaussian", &
      & initial_relaxed)
   call elastic("series", "series", 1.0e-11_wp)
   call is_bounded()
   call holds()
   if (len(sundials_version()) > 0) then
      call elastic("Adams", "adams", 1.0e-4_wp)
      call elastic("BDF", "bdf", 1.0e-3_wp)
   else
      print "(a)", "skipped: solvers of CVODE, as this is a build without SUNDIALS"
   end if
   call finish()

contains

   !> Energy is balanced and contacts are conserved, forward, in a hold, and back.
   subroutine closes(contacts, slider, law, width, coupling, initial)
      character(len=*), intent(in) :: contacts, slider, law
      integer, intent(in) :: coupling, initial
      real(wp), intent(in) :: width

      type(simulation_type) :: simulation
      real(wp) :: record(contact_record_length, count)
      character(len=:), allocatable :: name

      name = contacts // ", " // slider // ", " // law
      call build(simulation, contacts, slider, law, width, coupling, "series")
      call check_energy(simulation, initial, 1.0e-11_wp, name)
      call simulation%contacts%records(simulation%slider%time, 1, record)
      call check(size(pack(record(2, :), record(2, :) > 0.0_wp)) &
         & + nint(simulation%contacts%detached_count) == count, "contacts are conserved: " // name)
   end subroutine closes

   !> Energy of populations is balanced, forward, in a hold, and back.
   subroutine closes_without_contacts(contacts, slider, law, initial)
      character(len=*), intent(in) :: contacts, slider, law
      integer, intent(in) :: initial

      type(simulation_type) :: simulation

      call build(simulation, contacts, slider, law, 0.1_wp, coupling_equal, "series")
      ! The survival of populations is interpolated in tables.
      call check_energy(simulation, initial, 1.0e-9_wp, contacts // ", " // slider // ", " // law)
   end subroutine closes_without_contacts

   !> A run to the end of the drive, in which most contacts break, has its energy balanced.
   subroutine check_energy(simulation, initial, tolerance, name)
      type(simulation_type), intent(inout) :: simulation
      integer, intent(in) :: initial
      !> Maximum residual over the maximum term
      real(wp), intent(in) :: tolerance
      character(len=*), intent(in) :: name

      type(error_type), allocatable :: error
      real(wp) :: energy(energy_length)

      call simulation%start(initial)
      call simulation%run(forever, any_work, error)
      energy = simulation%energy_balance()
      call check(.not. allocated(error) .and. simulation%ending == ending_drive, &
         & "a run ends: " // name)
      call check_close(energy(energy_length) / maxval(abs(energy)), 0.0_wp, tolerance, &
         & "energy balance: " // name)
      call check(simulation%contacts%breaks > count, "contacts break: " // name)
      call check(simulation%slider%origin + simulation%slider%displacement < 0.0_wp, &
         & "the slider returns beyond its start: " // name)
   end subroutine check_energy

   !> The energy balance of damped layers on a base closes within the error of their solver.
   subroutine elastic(name, solver, tolerance)
      character(len=*), intent(in) :: name, solver
      real(wp), intent(in) :: tolerance

      type(simulation_type) :: simulation
      type(error_type), allocatable :: error
      real(wp) :: energy(energy_length)
      integer :: block_column, base_column

      call build(simulation, "ensemble", "layered", "gaussian", 0.1_wp, coupling_scaled, solver)
      call simulation%start(initial_relaxed)
      call simulation%run(forever, any_work, error)
      call check(.not. allocated(error) .and. simulation%ending == ending_drive, &
         & "a run with layers ends: " // name)
      energy = simulation%energy_balance()
      call check_close(energy(energy_length) / maxval(abs(energy)), 0.0_wp, tolerance, &
         & "energy balance of layers: " // name)
      call check(simulation%contacts%breaks > count, "contacts break under layers: " // name)
      call check(all(simulation%slider%integrator_counts > 0) .neqv. solver == "series", &
         & "CVODE counts its steps: " // name)
      block_column = findloc(trace_columns, "displacement", dim=1)
      base_column = findloc(trace_columns, "base_displacement", dim=1)
      associate (trace => simulation%recorder%trace)
         associate (last => trace%rows%row(:, trace%rows%count), rows => trace%layer_rows)
            call check(rows%count == trace%rows%count .and. abs(rows%row(1, rows%count) &
               & - last(base_column) - last(block_column)) < 1.0e-15_wp, &
               & "displacement is that of layer 1 relative to the base: " // name)
         end associate
      end associate
   end subroutine elastic

   !> A slider so light that it needs very many steps between two samples keeps to the work of a
   !> segment, and segments do not change its motion.
   subroutine is_bounded()
      real(wp), parameter :: work = 1000.0_wp
      integer, parameter :: segments = 20
      type(simulation_type) :: whole, cut
      type(error_type), allocatable :: error
      integer(i8) :: advances
      integer :: segment

      call lighten(cut)
      call cut%start(initial_relaxed)
      do segment = 1, segments
         advances = cut%advances
         call cut%run(forever, work, error)
         call check(.not. allocated(error) .and. cut%advances > advances &
            & .and. cut%advances - advances <= work, "work bounds a segment")
      end do
      call lighten(whole)
      call whole%start(initial_relaxed)
      call whole%run(cut%advances, any_work, error)
      call check(whole%advances == cut%advances .and. .not. (whole%slider%time &
         & > cut%slider%time .or. whole%slider%time < cut%slider%time) &
         & .and. abs(whole%slider%displacement - cut%slider%displacement) <= 0.0_wp &
         & .and. all(abs(whole%energy_balance() - cut%energy_balance()) <= 0.0_wp), &
         & "segments do not change a motion of very many steps")
   end subroutine is_bounded

   !> Klein's case with a light slider.
   subroutine lighten(simulation)
      type(simulation_type), intent(out) :: simulation

      type(parameters_type) :: parameters
      type(error_type), allocatable :: error

      call prepare(simulation, "ensemble", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp, max_events)
      call new_parameters(parameters, [character(len=name_length) :: "mass", "stiffness", &
         & "damping"], [1.0e-16_wp, 97.0_wp, 0.0_wp])
      call make_slider(simulation%slider, "rigid", parameters, error)
      call check(.not. allocated(error), "a light slider")
      call set_drive(simulation, [0.03_wp, 0.05_wp, 0.15_wp])
   end subroutine lighten

   !> A closed handle is an error.
   subroutine holds()
      type(simulation_type), pointer :: simulation
      type(error_type), allocatable :: error
      integer(i8) :: handle(2), stale(2)

      call open_handle(handle)
      call find_simulation(handle, .false., simulation, error)
      call check(.not. allocated(error) .and. associated(simulation), "a handle is found")
      call find_simulation(handle, .true., simulation, error)
      call check(allocated(error), "a simulation without parts is reported")
      stale = handle + [16_i8, 0_i8]
      call find_simulation(stale, .false., simulation, error)
      call check(allocated(error), "a handle of nothing is an error")
      call close_handle(handle)
      call find_simulation(handle, .false., simulation, error)
      call check(allocated(error), "a handle that was closed is an error")
      call close_handle(handle)
   end subroutine holds

end program test_simulation
