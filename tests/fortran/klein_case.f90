!> Klein's case with few contacts and a fast drive forward and back, for tests of whole runs.
module klein_case
   use mesoslip_contacts, only: make_contacts
   use mesoslip_contacts_mechanics, only: coupling_equal, coupling_names, coupling_scaled
   use mesoslip_loop_simulation, only: simulation_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length, new_parameters, parameters_type
   use mesoslip_recording_avalanches, only: avalanche_parameters_type
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_recording_recorder, only: recorder_parameters_type
   use mesoslip_sliders, only: make_slider
   use testing, only: check
   implicit none
   private

   public :: any_work, build, count, forever, prepare, same, set_drive

   !> Number of contacts
   integer, parameter :: count = 200
   !> A number of advances and an amount of work that no run reaches
   integer(i8), parameter :: forever = 1000000000_i8
   real(wp), parameter :: any_work = 1.0e18_wp

   integer, parameter :: columns = 20, layers = 6

contains

   subroutine build(simulation, contacts, slider, law, width, coupling, solver)
      type(simulation_type), intent(out) :: simulation
      character(len=*), intent(in) :: contacts, slider, law, solver
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
      type(parameters_type) :: parameters
      type(error_type), allocatable :: error
      type(recorder_parameters_type) :: recorder
      real(wp) :: values(9), bell(4), delay
      character(len=:), allocatable :: kind, law_of_delay

      delay = 5.0e-4_wp
      if (slider == "quasistatic") delay = 0.0_wp
      ! Scattered delays, and forces with which contacts attach.
      values = [real(count, wp), 18.0e-6_wp / count, 2000.0_wp / count, 6.7e-5_wp / count, delay, &
         & 0.1_wp, 1.0_wp, width, merge(0.05_wp, 0.0_wp, index(contacts, "scattered") > 0)]
      ! Without a back force contacts of any threshold may touch.
      if (index(contacts, "loaded") > 0) values(6) = 0.0_wp
      ! Where it is cold, forces change their sign without a step of their own.
      bell = [0.0_wp, 0.0_wp, 1.0e3_wp, merge(0.01_wp, 0.05_wp, index(contacts, "cold") > 0) &
         & * 18.0e-6_wp / count]
      select case (contacts)
      case ("lattice")
         call new_parameters(parameters, [character(len=name_length) :: common, "columns", "rows", &
            & "bond"], [values, real(columns, wp), real(count / columns, wp), 100.0_wp / count])
         call parameters%add_word("lattice", "triangular")
      case ("ageing")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & "slider_jumps"], [values, relax, merge(1.0_wp, 0.0_wp, slider == "quasistatic")])
      case ("ageing loaded")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & "slider_jumps", "load_mean", "load_amplitude", "load_rate", "load_phase"], &
            & [values, relax, 0.0_wp, 0.7_wp, 0.3_wp, 600.0_wp, 0.0_wp])
      case ("ageing populations")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & "resolution"], [values, relax, 0.5_wp])
      case ("thermal populations")
         call new_parameters(parameters, [character(len=name_length) :: common, activation(3:), &
            & "resolution"], [values, bell(3:), 0.5_wp])
      case ("thermal ageing populations")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & activation(3:), "resolution"], [values, relax, bell(3:), 0.5_wp])
      case ("thermal", "thermal scattered", "thermal cold")
         call new_parameters(parameters, [character(len=name_length) :: common, activation], &
            & [values, bell])
      case ("thermal ageing", "thermal ageing cold")
         call new_parameters(parameters, [character(len=name_length) :: common, ageing, &
            & activation, "slider_jumps"], [values, relax, bell, &
            & merge(1.0_wp, 0.0_wp, slider == "quasistatic")])
      case ("loaded", "loaded scattered")
         ! The normal load swings some 15 times in a run.
         call new_parameters(parameters, [character(len=name_length) :: common, "columns", &
            & "rows", "load_mean", "load_amplitude", "load_rate", "load_phase"], &
            & [values, 0.0_wp, 0.0_wp, 0.7_wp, 0.3_wp, 600.0_wp, 0.0_wp])
      case ("populations")
         call new_parameters(parameters, [character(len=name_length) :: common, "resolution"], &
            & [values, 0.5_wp])
      case default
         call new_parameters(parameters, [character(len=name_length) :: common, "columns", &
            & "rows"], [values, 0.0_wp, 0.0_wp])
      end select
      call parameters%add_word("threshold_law", law)
      kind = contacts
      if (contacts == "loaded") kind = "ensemble"
      if (contacts == "ageing loaded") kind = "ageing"
      law_of_delay = "fixed"
      if (index(contacts, "scattered") > 0) then
         kind = merge("thermal ", "ensemble", contacts(:1) == "t")
         law_of_delay = "exponential"
      end if
      if (index(contacts, " cold") > 0) kind = contacts(:index(contacts, " cold") - 1)
      call parameters%add_word("delay_law", law_of_delay)
      call parameters%add_word("coupling", trim(coupling_names(merge(coupling_equal, coupling, &
         & any(contacts(:1) == ["a", "t"])))))
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

   !> Klein's case with schedules of a length; no record needs each event.
   subroutine prepare(simulation, contacts, slider, law, width, delay, longest)
      type(simulation_type), intent(out) :: simulation
      character(len=*), intent(in) :: contacts, slider, law
      integer, intent(in) :: longest
      real(wp), intent(in) :: width, delay

      call build(simulation, contacts, slider, law, width, coupling_scaled, "series")
      simulation%contacts%parameters%delay = delay
      call simulation%avalanches%open(avalanche_parameters_type(), [real(wp) ::], count)
      simulation%max_schedule = longest
   end subroutine prepare

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

   !> Whether two tables are the same to the bit.
   function same(one, other)
      type(buffer_type), intent(in) :: one, other
      logical :: same

      same = one%count == other%count
      if (same) same = all(abs(one%row(:, :one%count) - other%row(:, :other%count)) <= 0.0_wp)
   end function same

end module klein_case
