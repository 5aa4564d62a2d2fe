!> Whole runs under all run-time checks: energy, conservation, reversal, and a state put away and
!> taken up again.
program test_simulation
   use mesoslip_contacts, only: make_contacts
   use mesoslip_contacts_base, only: contact_record_length
   use mesoslip_contacts_mechanics, only: coupling_equal, coupling_names, coupling_scaled, &
      & initial_relaxed, initial_steady
   use mesoslip_boundary_handles, only: close_handle, find_simulation, open_handle
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length, new_parameters, parameters_type
   use mesoslip_numerics_sundials_cvode, only: sundials_version
   use mesoslip_recording_avalanches, only: avalanche_parameters_type
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_recording_recorder, only: recorder_parameters_type
   use mesoslip_recording_steady, only: steady_recorder_type
   use mesoslip_recording_trace, only: trace_columns
   use mesoslip_schedule, only: max_events
   use mesoslip_loop_endings, only: ending_drive
   use mesoslip_loop_simulation, only: simulation_type
   use mesoslip_loop_state, only: energy_length
   use mesoslip_sliders, only: make_slider
   use testing, only: check, check_close, finish
   implicit none


   integer, parameter :: count = 200, columns = 20, layers = 6
   integer(i8), parameter :: forever = 1000000000_i8
   real(wp), parameter :: any_work = 1.0e18_wp

   call closes("ensemble", "rigid", "gaussian", 0.01_wp, coupling_scaled, initial_relaxed)
   call closes("ensemble", "rigid", "exponential", 1.0_wp, coupling_equal, initial_steady)
   call closes("ensemble", "prescribed", "exponential", 1.0_wp, coupling_scaled, initial_steady)
   call closes("activated", "rigid", "gaussian", 0.1_wp, coupling_equal, initial_relaxed)
   call closes("activated", "rigid", "exponential", 1.0_wp, coupling_equal, initial_steady)
   call closes("activated", "prescribed", "gaussian", 0.1_wp, coupling_equal, initial_steady)
   call closes("activated ageing", "rigid", "gaussian", 0.1_wp, coupling_equal, initial_relaxed)
   call closes("activated ageing", "prescribed", "gaussian", 0.1_wp, coupling_equal, &
      & initial_relaxed)
   call closes_without_contacts("populations", "rigid", "gaussian", initial_relaxed)
   call closes_without_contacts("activated populations", "rigid", "gaussian", initial_relaxed)
   call closes_without_contacts("activated populations", "prescribed", "uniform", initial_steady)
   call closes_without_contacts("activated ageing populations", "rigid", "gaussian", &
      & initial_relaxed)
   call elastic("series", "series", 1.0e-11_wp)
   call goes_on("ensemble", "rigid", "series")
   call goes_on("ensemble", "prescribed", "series")
   call goes_on("ensemble", "layered", "series")
   call goes_on("ensemble", "quasistatic", "series")
   call goes_on("lattice", "rigid", "series")
   call goes_on("lattice", "quasistatic", "series")
   call goes_on("populations", "rigid", "series")
   call goes_on("populations", "layered", "series")
   call goes_on("ageing", "rigid", "series")
   call goes_on("ageing", "prescribed", "series")
   call goes_on("ageing", "quasistatic", "series")
   call goes_on("ageing populations", "rigid", "series")
   call goes_on("activated", "rigid", "series")
   call goes_on("activated", "prescribed", "series")
   call goes_on("activated ageing", "rigid", "series")
   call goes_on("activated ageing populations", "rigid", "series")
   call runs_ahead("ensemble", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ensemble", "rigid", "exponential", 1.0_wp, 5.0e-4_wp)
   call runs_ahead("ensemble", "rigid", "exponential", 1.0_wp, 0.0_wp)
   call runs_ahead("ensemble", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ensemble", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call runs_ahead("scattered", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("scattered", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call runs_ahead("ageing", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("ageing", "prescribed", "exponential", 1.0_wp, 0.0_wp)
   call runs_ahead("activated", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("activated", "rigid", "exponential", 1.0_wp, 0.0_wp)
   call runs_ahead("activated", "prescribed", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("activated", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call runs_ahead("activated scattered", "rigid", "gaussian", 0.1_wp, 5.0e-4_wp)
   call runs_ahead("activated scattered", "prescribed", "exponential", 1.0_wp, 1.0e-5_wp)
   call is_bounded()
   call refuses()
   call holds()
   if (len(sundials_version()) > 0) then
      call elastic("Adams", "adams", 1.0e-4_wp)
      call elastic("BDF", "bdf", 1.0e-3_wp)
      call goes_on("ensemble", "layered", "adams")
      call goes_on("ensemble", "layered", "bdf")
   else
      print "(a)", "skipped: solvers of CVODE, as this is a build without SUNDIALS"
   end if
   call finish()

contains

   !> Energy is balanced and contacts are conserved, forward, in a hold, and back.
   subroutine closes(contacts, slider, law, width, coupling, initial)
      character(len=*), intent(in) :: contacts, slider
      character(len=*), intent(in) :: law
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
      character(len=*), intent(in) :: contacts, slider
      character(len=*), intent(in) :: law
      integer, intent(in) :: initial

      type(simulation_type) :: simulation

      call build(simulation, contacts, slider, law, 0.1_wp, coupling_equal, "series")
      ! What is left of populations is interpolated in tables.
      call check_energy(simulation, initial, 1.0e-9_wp, contacts // ", " // slider // ", " // law)
   end subroutine closes_without_contacts

   !> A run to the end of the drive, in which most contacts break, has its energy balanced.
   subroutine check_energy(simulation, initial, tolerance, name)
      type(simulation_type), intent(inout) :: simulation
      integer, intent(in) :: initial
      !> Maximum residual over the largest term
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
         & "the slider comes back beyond its start: " // name)
   end subroutine check_energy

   !> Layers on a base, damped, close the energy balance as well as their solver does.
   subroutine elastic(name, solver, tolerance)
      character(len=*), intent(in) :: name
      character(len=*), intent(in) :: solver
      real(wp), intent(in) :: tolerance

      type(simulation_type) :: simulation
      type(error_type), allocatable :: error
      real(wp) :: energy(energy_length)
      integer :: block_column, base_column

      call build(simulation, "ensemble", "layered", "gaussian", 0.1_wp, coupling_scaled, solver)
      call simulation%start(initial_relaxed)
      call simulation%run(forever, any_work, error)
      call check(.not. allocated(error) .and. simulation%ending == ending_drive, &
         & "layers come to the end: " // name)
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

   !> A run that is put away again and again, and taken up by another simulation, is the same to the
   !> bit: its energy, all that it recorded, and what its integrator did.
   subroutine goes_on(contacts, slider, solver)
      character(len=*), intent(in) :: contacts, slider
      character(len=*), intent(in) :: solver

      type(simulation_type) :: whole
      type(simulation_type), allocatable :: now, next
      type(error_type), allocatable :: error
      integer(i8), allocatable :: words(:)
      integer(i8) :: length
      integer :: segment, table
      character(len=:), allocatable :: name
      real(wp), parameter :: short(3) = [0.024_wp, 0.03_wp, 0.05_wp]
      character(len=10), parameter :: tables(7) = [character(len=10) :: &
         & "trace", "slip_trace", "slips", "layers", "avalanches", "snapshots", "stages"]

      name = contacts // ", " // slider // ", solver " // solver
      call build(whole, contacts, slider, "gaussian", 0.1_wp, coupling_scaled, solver)
      call set_drive(whole, short)
      call whole%start(initial_relaxed)
      call whole%run(forever, any_work, error)

      allocate (now)
      call build(now, contacts, slider, "gaussian", 0.1_wp, coupling_scaled, solver)
      call set_drive(now, short)
      call now%start(initial_relaxed)
      do segment = 1, 100000
         ! Longer and longer, so that all phases of a run are cut, and the test ends.
         call now%run(int(1 + segment**3 / 8, i8), any_work, error)
         if (allocated(error) .or. now%ending == ending_drive) exit
         call now%save(length, error)
         allocate (words(length))
         if (.not. allocated(error)) call now%fetch(words, error)
         allocate (next)
         call build(next, contacts, slider, "gaussian", 0.1_wp, coupling_scaled, solver)
         call set_drive(next, short)
         if (.not. allocated(error)) call next%restore(words, error)
         deallocate (words)
         deallocate (now)
         call move_alloc(next, now)
         if (allocated(error)) exit
      end do
      call check(.not. allocated(error), "a state can be put away and taken up: " // name)
      call check(now%ending == ending_drive .and. segment > 10, "it comes to its end: " // name)
      call check(all(abs(now%energy_balance() - whole%energy_balance()) <= 0.0_wp) &
         & .and. now%advances == whole%advances, "a run in segments is the same: " // name)
      call check(all(now%slider%integrator_counts == whole%slider%integrator_counts), &
         & "the integrator does the same: " // name)
      do table = 1, size(tables)
         call check(same(now%table(trim(tables(table))), whole%table(trim(tables(table)))), &
            & "what is recorded is the same: " // name // ", " // trim(tables(table)))
      end do
   end subroutine goes_on

   !> A run is the same to the bit whatever the length of its schedules, none at all included, and
   !> wherever it is cut, put away and taken up again.
   subroutine runs_ahead(contacts, slider, law, width, delay)
      character(len=*), intent(in) :: contacts, slider
      character(len=*), intent(in) :: law
      real(wp), intent(in) :: width, delay

      integer, parameter :: lengths(6) = [1, 2, 7, 32, 64, 64]
      type(simulation_type) :: whole
      type(simulation_type), allocatable :: now, next
      type(error_type), allocatable :: error
      integer(i8), allocatable :: words(:)
      integer(i8) :: length
      integer :: number, segment, table
      character(len=:), allocatable :: name
      character(len=10), parameter :: tables(4) = [character(len=10) :: &
         & "trace", "slip_trace", "slips", "stages"]

      call prepare(whole, contacts, slider, law, width, delay, 0)
      call whole%start(initial_steady)
      call whole%run(forever, any_work, error)
      do number = 1, size(lengths)
         name = contacts // ", " // slider // ", length " &
            & // achar(iachar("0") + lengths(number) / 10) &
            & // achar(iachar("0") + modulo(lengths(number), 10))
         allocate (now)
         call prepare(now, contacts, slider, law, width, delay, lengths(number))
         call now%start(initial_steady)
         if (number < size(lengths)) call now%run(forever, any_work, error)
         do segment = 1, 100000
            if (allocated(error) .or. now%ending == ending_drive) exit
            call now%run(int(1 + segment**3 / 8, i8), any_work, error)
            call now%save(length, error)
            allocate (words(length))
            call now%fetch(words, error)
            allocate (next)
            call prepare(next, contacts, slider, law, width, delay, modulo(segment, max_events))
            call next%restore(words, error)
            deallocate (words)
            deallocate (now)
            call move_alloc(next, now)
         end do
         call check(.not. allocated(error) .and. now%ending == ending_drive, &
            & "a run with schedules ends: " // name)
         call check(all(abs(now%energy_balance() - whole%energy_balance()) <= 0.0_wp) &
            & .and. now%advances == whole%advances &
            & .and. now%avalanches%avalanches == whole%avalanches%avalanches, &
            & "schedules do not change a run: " // name)
         do table = 1, size(tables)
            call check(same(now%table(trim(tables(table))), whole%table(trim(tables(table)))), &
               & "what is recorded is the same: " // name // ", " // trim(tables(table)))
         end do
         deallocate (now)
      end do
      call check(whole%contacts%breaks > 10 * count, "many contacts break: " // slider)
   end subroutine runs_ahead

   !> Klein's case with schedules of a length, and nothing recorded that needs each event.
   subroutine prepare(simulation, contacts, slider, law, width, delay, longest)
      type(simulation_type), intent(out) :: simulation
      character(len=*), intent(in) :: contacts, slider
      character(len=*), intent(in) :: law
      integer, intent(in) :: longest
      real(wp), intent(in) :: width, delay

      call build(simulation, contacts, slider, law, width, coupling_scaled, "series")
      simulation%contacts%parameters%delay = delay
      call simulation%avalanches%open(avalanche_parameters_type(), [real(wp) ::], count)
      simulation%max_schedule = longest
   end subroutine prepare

   !> A slider so light that it needs very many steps between two samples does no more work in a
   !> segment than it may, and the segments do not change its motion.
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

   !> Whether two tables are the same to the bit.
   function same(one, other)
      type(buffer_type), intent(in) :: one, other
      logical :: same

      same = one%count == other%count
      if (same) same = all(abs(one%row(:, :one%count) - other%row(:, :other%count)) <= 0.0_wp)
   end function same

   !> A state of another kind, of another length, or for a run under way, is refused.
   subroutine refuses()
      type(simulation_type) :: rigid, other, shorter, unset
      type(error_type), allocatable :: error
      integer(i8), allocatable :: words(:)
      integer(i8) :: length

      call build(rigid, "ensemble", "rigid", "gaussian", 0.1_wp, coupling_scaled, "series")
      call rigid%start(initial_relaxed)
      call rigid%run(100_i8, any_work, error)
      call rigid%save(length, error)
      allocate (words(length))
      call rigid%fetch(words, error)
      call check(.not. allocated(error), "a state is fetched")
      call rigid%fetch(words, error)
      call check(allocated(error), "a state is fetched once")
      call build(other, "ensemble", "prescribed", "gaussian", 0.1_wp, coupling_scaled, &
         & "series")
      call other%restore(words, error)
      call check(allocated(error), "a state of another slider is refused")
      call build(shorter, "ensemble", "rigid", "gaussian", 0.1_wp, coupling_scaled, &
         & "series")
      call shorter%restore(words(:length - 1), error)
      call check(allocated(error), "a state that is not whole is refused")
      call rigid%restore(words, error)
      call check(allocated(error), "a run under way is not set to another state")
      call build(unset, "ensemble", "rigid", "gaussian", 0.1_wp, coupling_scaled, "series")
      call check(unset%is_whole(), "a simulation that has all its parts is whole")
      unset%steady = steady_recorder_type()
      call check(.not. unset%is_whole(), "one that is not told when to stop is not")
   end subroutine refuses

   !> Handles: what was closed is an error.
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

   !> Klein's case with few contacts and a fast drive that comes back.
   subroutine build(simulation, contacts, slider, law, width, coupling, solver)
      type(simulation_type), intent(out) :: simulation
      character(len=*), intent(in) :: contacts, slider
      character(len=*), intent(in) :: law, solver
      integer, intent(in) :: coupling
      real(wp), intent(in) :: width

      character(len=name_length), parameter :: common(9) = [character(len=name_length) :: &
         & "count", "static_force", "stiffness", "drag", "delay", "back_force_ratio", &
         & "reattach", "relative_width", "newborn_width"]
      character(len=name_length), parameter :: ageing(4) = [character(len=name_length) :: &
         & "ageing_time", "initial_age", "young_force_ratio", "young_relative_width"]
      ! Some thresholds fall, as the young are spread widely.
      real(wp), parameter :: relax(4) = [3.0e-3_wp, 0.0_wp, 0.9_wp, 0.3_wp]
      character(len=name_length), parameter :: activation(4) = [character(len=name_length) :: &
         & "columns", "rows", "activation_rate", "activation_force"]
      real(wp), parameter :: bell(4) = [0.0_wp, 0.0_wp, 1.0e3_wp, 0.05_wp * 18.0e-6_wp / count]
      type(parameters_type) :: parameters
      type(error_type), allocatable :: error
      type(recorder_parameters_type) :: recorder
      real(wp) :: values(9), delay
      character(len=:), allocatable :: kind, law_of_delay

      delay = 5.0e-4_wp
      if (slider == "quasistatic") delay = 0.0_wp
      ! Scattered delays, and forces with which contacts attach.
      values = [real(count, wp), 18.0e-6_wp / count, 2000.0_wp / count, 6.7e-5_wp / count, delay, &
         & 0.1_wp, 1.0_wp, width, merge(0.05_wp, 0.0_wp, index(contacts, "scattered") > 0)]
      select case (contacts)
      case ("lattice")
         call new_parameters(parameters, [character(len=name_length) :: common, "columns", "rows", &
            & "bond"], [values, real(columns, wp), real(count / columns, wp), 100.0_wp / count])
         call parameters%add_word("lattice", "triangular")
      case ("ageing")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & "slider_jumps"], [values, relax, merge(1.0_wp, 0.0_wp, slider == "quasistatic")])
      case ("ageing populations")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & "resolution"], [values, relax, 0.5_wp])
      case ("activated populations")
         call new_parameters(parameters, [character(len=name_length) :: common, activation(3:), &
            & "resolution"], [values, bell(3:), 0.5_wp])
      case ("activated ageing populations")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & activation(3:), "resolution"], [values, relax, bell(3:), 0.5_wp])
      case ("activated", "activated scattered")
         call new_parameters(parameters, [character(len=name_length) :: common, activation], &
            & [values, bell])
      case ("activated ageing")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & activation], [values, relax, bell])
      case ("populations")
         call new_parameters(parameters, [character(len=name_length) :: common, "resolution"], &
            & [values, 0.5_wp])
      case default
         call new_parameters(parameters, [character(len=name_length) :: common, "columns", &
            & "rows"], [values, 0.0_wp, 0.0_wp])
      end select
      call parameters%add_word("threshold_law", law)
      kind = contacts
      law_of_delay = "fixed"
      if (index(contacts, "scattered") > 0) then
         kind = merge("activated", "ensemble ", contacts(:1) == "a")
         law_of_delay = "exponential"
      end if
      call parameters%add_word("delay_law", law_of_delay)
      call parameters%add_word("coupling", trim(coupling_names(merge(coupling_equal, coupling, &
         & contacts(:1) == "a"))))
      if (index(contacts, "ageing") > 0) call parameters%add_word("ageing", "relax")
      call make_contacts(simulation%contacts, trim(kind), parameters, 1_i8, 0_i8, error)
      call check(.not. allocated(error), "contacts: " // contacts)

      recorder = recorder_parameters_type(interval=1.0e-4_wp, duration=0.15_wp)
      recorder%slips%interval = 1.0e-4_wp
      recorder%slips%contacts = count
      select case (slider)
      case ("rigid")
         call new_parameters(parameters, [character(len=name_length) :: "mass", "stiffness", &
            & "damping"], [1.47e-3_wp, 97.0_wp, 51.4_wp])
      case ("layered")
         recorder%layers = layers
         call new_parameters(parameters, [character(len=name_length) :: "layers", "mass", &
            & "stiffness", "damping", "base_mass", "base_stiffness", "base_damping", &
            & "relative_tolerance", "absolute_tolerance"], [real(layers, wp), 1.47e-3_wp, 97.0_wp, &
            & 20.0_wp, 5.0e-3_wp, 1.0e4_wp, 10.0_wp, 1.0e-8_wp, 1.0e-21_wp])
         call parameters%add_word("solver", solver)
      case ("quasistatic")
         call new_parameters(parameters, [character(len=name_length) :: "stiffness"], [97.0_wp])
      case default
         call new_parameters(parameters, [character(len=name_length) ::], [real(wp) ::])
      end select
      if (slider == "rigid" .or. slider == "layered") then
         recorder%slips%slip_velocity = 1.0e-6_wp
         recorder%slips%quiet_time = 0.012_wp
      end if
      call make_slider(simulation%slider, slider, parameters, error)
      call check(.not. allocated(error), "slider: " // slider)
      call set_drive(simulation, [0.03_wp, 0.05_wp, 0.15_wp])
      call simulation%stages%open()
      call simulation%steady%open(0.0_wp, 1, 0.0_wp)
      call simulation%recorder%open(recorder)
      call simulation%avalanches%open(avalanche_parameters_type(min_size=1.0_wp, &
         & snapshot_size=20.0_wp), [0.01_wp, 0.1_wp], simulation%contacts%individual_count())
   end subroutine build

   !> A drive forward, in a hold, and back.
   subroutine set_drive(simulation, part_end)
      type(simulation_type), intent(inout) :: simulation
      !> Ends of the three parts [s]
      real(wp), intent(in) :: part_end(3)

      real(wp), parameter :: velocity(3) = [1.0e-5_wp, 0.0_wp, -1.0e-5_wp]
      type(error_type), allocatable :: error

      call simulation%slider%drive%open(part_end, velocity, velocity, [0, 1, 2], error)
      call check(.not. allocated(error), "drive")
   end subroutine set_drive

end program test_simulation
