!> Whole runs under all run-time checks: energy, conservation, reversal, and a state put away and
!> taken up again.
program test_simulation
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_recording_avalanches, only: avalanche_length, snapshot_place_length
   use mesoslip_contacts_ensemble, only: contact_ensemble_type, new_contact_ensemble
   use mesoslip_contacts_set, only: contact_arrays_type, detached_length
   use mesoslip_contacts_mechanics, only: coupling_equal, coupling_scaled, initial_relaxed, &
      & initial_steady
   use mesoslip_contacts_record, only: record_length, row_stiffness
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_recording_recorder, only: recorder_parameters_type, slip_length, &
      & slip_trace_length, trace_length
   use mesoslip_simulation, only: ending_drive, energy_length, simulation_type
   use mesoslip_sliders_layered, only: layered_parameters_type, slider_layered_type, &
      & solver_adams, solver_bdf, solver_series
   use mesoslip_sliders_prescribed, only: slider_prescribed_type
   use mesoslip_sliders_rigid, only: slider_rigid_type
   use mesoslip_contacts_threshold_law, only: law_exponential, law_gaussian, new_threshold_law
   use testing, only: check, check_close, finish
   implicit none

   integer, parameter :: count = 200, rows = 30000, reals = 96, integers = 48
   integer(i8), parameter :: forever = 1000000000_i8
   real(wp), target :: record(record_length, count), detached(detached_length, count)
   integer, target :: detached_contact(count)
   real(wp), target :: trace(trace_length, rows), slip_trace(slip_trace_length, rows)
   real(wp), target :: slips(slip_length, rows), layers(0, rows)
   real(wp), target :: avalanches(avalanche_length, 1), place(snapshot_place_length, 1)
   real(wp), target :: snapshot(0, 0, 1)

   call closes("gaussian", law_gaussian, 0.01_wp, coupling_scaled, initial_relaxed, .true.)
   call closes("exponential", law_exponential, 1.0_wp, coupling_equal, initial_steady, .true.)
   call closes("prescribed", law_exponential, 1.0_wp, coupling_scaled, initial_steady, .false.)
   call elastic("series", solver_series, 1.0e-11_wp)
   call elastic("Adams", solver_adams, 1.0e-4_wp)
   call elastic("BDF", solver_bdf, 1.0e-3_wp)
   call goes_on()
   call finish()

contains

   !> Energy is balanced and contacts are conserved, forward, in a hold, and back.
   subroutine closes(name, law, width, coupling, initial, rigid)
      character(len=*), intent(in) :: name
      integer, intent(in) :: law, coupling, initial
      real(wp), intent(in) :: width
      logical, intent(in) :: rigid

      type(simulation_type) :: simulation
      type(error_type), allocatable :: error
      real(wp) :: energy(energy_length)

      call build(simulation, law, width, coupling, rigid)
      call simulation%start(initial)
      call simulation%run(forever, error)
      energy = simulation%energy_balance()
      call check(.not. allocated(error) .and. simulation%ending == ending_drive, &
         & "a run ends: " // name)
      call check_close(energy(energy_length) / maxval(abs(energy)), 0.0_wp, 1.0e-11_wp, &
         & "energy balance: " // name)
      call check(simulation%contacts%breaks > count, "contacts break: " // name)
      call check(size(pack(record(row_stiffness, :), record(row_stiffness, :) > 0.0_wp)) &
         & + nint(simulation%contacts%detached_count) == count, "contacts are conserved: " // name)
      call check(simulation%slider%origin + simulation%slider%displacement < 0.0_wp, &
         & "the slider comes back beyond its start: " // name)
   end subroutine closes

   !> Layers on a base, damped, close the energy balance as well as their solver does.
   subroutine elastic(name, solver, tolerance)
      character(len=*), intent(in) :: name
      integer, intent(in) :: solver
      real(wp), intent(in) :: tolerance

      integer, parameter :: number = 6
      type(simulation_type) :: simulation
      type(slider_layered_type), allocatable :: slider
      type(error_type), allocatable :: error
      real(wp), target :: state(number + 1, 2), layer_trace(number, rows)
      real(wp) :: energy(energy_length)

      call build(simulation, law_gaussian, 0.1_wp, coupling_scaled, .true.)
      call simulation%recorder%attach(trace, slip_trace, slips, layer_trace)
      allocate (slider)
      slider%parameters = layered_parameters_type(layers=number, mass=1.47e-3_wp, &
         & stiffness=97.0_wp, damping=20.0_wp, base_mass=5.0e-3_wp, base_stiffness=1.0e4_wp, &
         & base_damping=10.0_wp, solver=solver, relative=1.0e-8_wp, absolute=1.0e-21_wp)
      call slider%attach(state)
      deallocate (simulation%slider)
      call move_alloc(slider, simulation%slider)
      call simulation%start(initial_relaxed)
      call simulation%run(forever, error)
      call check(.not. allocated(error) .and. simulation%ending == ending_drive, &
         & "layers come to the end: " // name)
      energy = simulation%energy_balance()
      call check_close(energy(energy_length) / maxval(abs(energy)), 0.0_wp, tolerance, &
         & "energy balance of layers: " // name)
      call check(simulation%contacts%breaks > count, "contacts break under layers: " // name)
      call check(all(simulation%slider%integrator_counts() > 0) .neqv. solver == solver_series, &
         & "CVODE counts its steps: " // name)
      call check(abs(layer_trace(1, simulation%recorder%trace_count) &
         & - trace(9, simulation%recorder%trace_count) &
         & - trace(3, simulation%recorder%trace_count)) < 1.0e-15_wp, &
         & "displacement is that of layer 1 relative to the base: " // name)
      call simulation%slider%close()
   end subroutine elastic

   !> A state that is put away after a few advances and taken up again goes on to the same numbers.
   subroutine goes_on()
      type(simulation_type) :: simulation, next
      type(archive_type) :: archive
      type(error_type), allocatable :: error
      real(wp) :: whole(energy_length), pieces(energy_length)
      integer :: segment

      call build(simulation, law_gaussian, 0.1_wp, coupling_scaled, .true.)
      call simulation%start(initial_relaxed)
      call simulation%run(forever, error)
      whole = simulation%energy_balance()

      call build(simulation, law_gaussian, 0.1_wp, coupling_scaled, .true.)
      call simulation%start(initial_relaxed)
      do segment = 1, 100000
         call simulation%run(37_i8, error)
         archive%reals = spread(0.0_wp, 1, reals)
         archive%integers = spread(0_i8, 1, integers)
         archive = archive_type(reals=archive%reals, integers=archive%integers, saving=.true.)
         call simulation%exchange(archive)
         archive = archive_type(reals=archive%reals, integers=archive%integers)
         call build(next, law_gaussian, 0.1_wp, coupling_scaled, .true.)
         call next%exchange(archive)
         simulation = next
         if (simulation%ending == ending_drive) exit
      end do
      pieces = simulation%energy_balance()
      call check(simulation%ending == ending_drive .and. segment > 10, &
         & "the segments come to the end")
      call check(all(abs(pieces - whole) <= 0.0_wp), "a run in segments is the same to the bit")
   end subroutine goes_on

   !> Klein's case with few contacts and a fast drive that comes back.
   subroutine build(simulation, law, width, coupling, rigid)
      type(simulation_type), intent(out) :: simulation
      integer, intent(in) :: law, coupling
      real(wp), intent(in) :: width
      logical, intent(in) :: rigid

      type(contact_arrays_type) :: arrays
      type(contact_ensemble_type), allocatable :: contacts
      type(contact_parameters_type) :: parameters
      type(recorder_parameters_type) :: recorder
      type(error_type), allocatable :: error

      call new_threshold_law(parameters%law, law, width, 0.1_wp, error)
      parameters%count = count
      parameters%static_force = 18.0e-6_wp / count
      parameters%stiffness = 2000.0_wp / count
      parameters%drag = 6.7e-5_wp / count
      parameters%delay = 5.0e-4_wp
      parameters%back_force_ratio = 0.1_wp
      parameters%coupling = coupling
      parameters%seed = 1_i8
      arrays%record => record
      arrays%detached => detached
      arrays%detached_contact => detached_contact
      allocate (contacts)
      call new_contact_ensemble(contacts, parameters, arrays, error)
      call move_alloc(contacts, simulation%contacts)
      simulation%stage_end = [0.03_wp, 0.05_wp, 0.15_wp]
      simulation%stage_velocity = [1.0e-5_wp, 0.0_wp, -1.0e-5_wp]
      recorder = recorder_parameters_type(interval=1.0e-4_wp, slip_interval=1.0e-4_wp, &
         & duration=0.15_wp, contacts=count)
      if (rigid) then
         recorder%slip_velocity = 1.0e-6_wp
         recorder%quiet_time = 0.012_wp
         simulation%slider = slider_rigid_type(mass=1.47e-3_wp, stiffness=97.0_wp, &
            & damping=51.4_wp)
      else
         simulation%slider = slider_prescribed_type()
      end if
      simulation%recorder%parameters = recorder
      call simulation%recorder%attach(trace, slip_trace, slips, layers)
      call simulation%avalanches%attach(avalanches, place, snapshot, [real(wp) ::])
   end subroutine build

end program test_simulation
