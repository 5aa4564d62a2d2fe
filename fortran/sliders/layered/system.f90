!> The equation of motion of a chain of layers, its base and the contacts, and its Taylor series.
module mesoslip_sliders_layered_system
   use mesoslip_interface_law, only: interface_law_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_sundials_cvode, only: method_adams, method_bdf
   use mesoslip_sliders_motion_series, only: inverse
   implicit none
   private

   public :: layered_parameters_type, system_type
   public :: accelerate, expand, fastest_rate, new_system, push, sum_series
   public :: solver_series, solver_adams, solver_bdf, solver_names, solver_codes

   !> Taylor series, and CVODE with either family of formulas
   integer, parameter :: solver_series = 0, solver_adams = method_adams, solver_bdf = method_bdf
   !> Names of the solver_ codes, in the order of solver_codes
   character(len=*), parameter :: solver_names(3) = [character(len=6) :: "series", "adams", "bdf"]
   integer, parameter :: solver_codes(3) = [solver_series, solver_adams, solver_bdf]

   !> Parameters of the slider.
   type :: layered_parameters_type
      !> Number of layers
      integer :: layers = 1
      !> Mass [kg] and static stiffness [N/m] of the whole slider
      real(wp) :: mass = 1.0_wp, stiffness = 1.0_wp
      !> Rate of Kelvin-Voigt damping between layers, not on the drive's spring [1/s]
      real(wp) :: damping = 0.0_wp
      !> Mass of the base [kg], 0 for none, stiffness [N/m] and damping rate [1/s] of its support
      real(wp) :: base_mass = 0.0_wp, base_stiffness = 0.0_wp, base_damping = 0.0_wp
      !> One of the solver_ codes
      integer :: solver = solver_series
      !> Relative tolerance, and absolute one of displacements over 1 m, for CVODE
      real(wp) :: relative = 1.0e-8_wp, absolute = 1.0e-17_wp
   end type layered_parameters_type

   !> A linear system: the chain, the base and the contacts.
   type :: system_type
      type(layered_parameters_type) :: parameters
      type(interface_law_type) :: law
      !> Mass of a layer [kg], stiffness [N/m] and damping [N s/m] between two
      real(wp) :: layer_mass = 1.0_wp, spring = 1.0_wp, dashpot = 0.0_wp
      !> Displacement [m] and velocity [m/s] of the drive at the start, and its acceleration [m/s2]
      real(wp) :: drive = 0.0_wp, drive_velocity = 0.0_wp, drive_acceleration = 0.0_wp
   end type system_type

contains

   !> The system of a slider.
   pure function new_system(parameters) result(system)
      type(layered_parameters_type), intent(in) :: parameters
      type(system_type) :: system

      system%parameters = parameters
      system%layer_mass = parameters%mass / parameters%layers
      system%spring = parameters%stiffness * parameters%layers
      if (parameters%layers > 1) system%dashpot = parameters%damping * system%layer_mass
   end function new_system

   !> Bound on the rates of a system.
   pure function fastest_rate(system) result(rate)
      type(system_type), intent(in) :: system
      real(wp) :: rate

      real(wp) :: base_mass

      base_mass = system%parameters%base_mass
      rate = 4.0_wp * system%spring + abs(system%law%stiffness)
      if (system%parameters%layers == 1) rate = system%spring + abs(system%law%stiffness)
      rate = sqrt(rate / system%layer_mass)
      if (base_mass > 0.0_wp) then
         rate = sqrt(rate**2 + (abs(system%law%stiffness) + system%parameters%base_stiffness) &
            & / base_mass) + system%law%drag / base_mass + system%parameters%base_damping
      end if
      rate = rate + (system%law%drag + 4.0_wp * system%dashpot) / system%layer_mass
   end function fastest_rate

   !> Accelerations of base and layers, times a factor, without drive and origins of contacts.
   pure subroutine accelerate(system, factor, pull, displacement, velocity, acceleration)
      type(system_type), intent(in) :: system
      !> The factor, and a further acceleration of the last layer [m/s2]
      real(wp), intent(in) :: factor, pull
      real(wp), intent(in) :: displacement(0:), velocity(0:)
      real(wp), intent(out) :: acceleration(0:)

      real(wp) :: spring, dashpot, force
      integer :: layer, last

      last = system%parameters%layers
      spring = system%spring / system%layer_mass
      dashpot = system%dashpot / system%layer_mass
      force = system%law%stiffness * (displacement(1) - displacement(0)) &
         & + system%law%drag * (velocity(1) - velocity(0))
      if (dashpot > 0.0_wp) then
         do layer = 2, last - 1
            acceleration(layer) = factor &
               & * (spring * ((displacement(layer + 1) - displacement(layer)) &
               & - (displacement(layer) - displacement(layer - 1))) &
               & + dashpot * ((velocity(layer + 1) - velocity(layer)) &
               & - (velocity(layer) - velocity(layer - 1))))
         end do
      else
         do layer = 2, last - 1
            acceleration(layer) = factor &
               & * (spring * ((displacement(layer + 1) - displacement(layer)) &
               & - (displacement(layer) - displacement(layer - 1))))
         end do
      end if
      acceleration(last) = -spring * displacement(last)
      if (last > 1) then
         acceleration(last) = acceleration(last) &
            & - spring * (displacement(last) - displacement(last - 1)) &
            & - dashpot * (velocity(last) - velocity(last - 1))
         acceleration(1) = spring * (displacement(2) - displacement(1)) &
            & + dashpot * (velocity(2) - velocity(1))
      end if
      acceleration(1) = acceleration(1) - force / system%layer_mass
      acceleration(last) = factor * (acceleration(last) + pull)
      if (last > 1) acceleration(1) = factor * acceleration(1)
      acceleration(0) = 0.0_wp
      if (system%parameters%base_mass > 0.0_wp) then
         acceleration(0) = factor * ((force - system%parameters%base_stiffness * displacement(0)) &
            & / system%parameters%base_mass - system%parameters%base_damping * velocity(0))
      end if
   end subroutine accelerate

   !> Accelerations by the drive and the origins of contacts, at a time after the start.
   pure subroutine push(system, time, acceleration)
      type(system_type), intent(in) :: system
      real(wp), intent(in) :: time
      real(wp), intent(inout) :: acceleration(0:)

      real(wp) :: pull
      integer :: last

      last = system%parameters%layers
      acceleration(last) = acceleration(last) + system%spring * (system%drive &
         & + (system%drive_velocity + 0.5_wp * system%drive_acceleration * time) * time) &
         & / system%layer_mass
      pull = system%law%offset - system%law%rate * time
      acceleration(1) = acceleration(1) + pull / system%layer_mass
      if (system%parameters%base_mass > 0.0_wp) then
         acceleration(0) = acceleration(0) - pull / system%parameters%base_mass
      end if
   end subroutine push

   !> Add the rate of the contact force to the second terms of the velocities.
   pure subroutine push_at_a_rate(system, term)
      type(system_type), intent(in) :: system
      real(wp), intent(inout) :: term(0:)

      term(1) = term(1) - 0.5_wp * system%law%rate / system%layer_mass
      if (system%parameters%base_mass > 0.0_wp) then
         term(0) = term(0) + 0.5_wp * system%law%rate / system%parameters%base_mass
      end if
   end subroutine push_at_a_rate

   !> Taylor coefficients of the motion.
   subroutine expand(system, state, terms, series)
      type(system_type), intent(in) :: system
      !> Displacement and velocity of the base, then of each layer, shape (0:layers, 2)
      real(wp), intent(in), contiguous :: state(0:, :)
      !> Terms beyond the first
      integer, intent(in) :: terms
      !> Taylor coefficients of both, shape (0:layers, 2, 0:terms or more)
      real(wp), intent(inout), contiguous :: series(0:, :, 0:)

      real(wp) :: pull
      integer :: term

      series(:, :, 0) = state
      do term = 0, terms - 1
         pull = 0.0_wp
         if (term == 1) pull = system%spring * system%drive_velocity &
            & / system%layer_mass
         if (term == 2) pull = 0.5_wp * system%spring * system%drive_acceleration &
            & / system%layer_mass
         call accelerate(system, inverse(term + 1), pull, series(:, 1, term), &
            & series(:, 2, term), series(:, 2, term + 1))
         if (term == 0) call push(system, 0.0_wp, series(:, 2, 1))
         if (term == 1) call push_at_a_rate(system, series(:, 2, 2))
         series(:, 1, term + 1) = series(:, 2, term) * inverse(term + 1)
      end do
   end subroutine expand

   !> Values of many series at a time; four terms at once, to go through the values less often.
   pure subroutine sum_series(number, terms, series, time, values)
      !> Number of series, and of terms beyond the first
      integer, intent(in) :: number, terms
      real(wp), intent(in) :: series(number, 0:terms), time
      real(wp), intent(out) :: values(number)

      integer :: term

      values = series(:, terms)
      do term = terms - 1, 3, -4
         values = (((values * time + series(:, term)) * time + series(:, term - 1)) * time &
            & + series(:, term - 2)) * time + series(:, term - 3)
      end do
      do term = modulo(terms, 4) - 1, 0, -1
         values = values * time + series(:, term)
      end do
   end subroutine sum_series

end module mesoslip_sliders_layered_system
