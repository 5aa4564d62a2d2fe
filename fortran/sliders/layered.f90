!> An elastic slider: layers joined by springs, on an optional base (section 8 of the model, S24).
!>
!> Layer 1 bears the contacts; a spring joins layer N_l to the drive. Damping acts between layers,
!> not on that spring, so that one layer is the rigid slider. Displacement and velocity are those of
!> layer 1 relative to the base, by which contacts stretch.
!>
!> Under a linear law of the contact force the motion is that of a linear system. By default it is
!> advanced by its Taylor series, exact to rounding, over steps in units of the fastest rate; most
!> end at an event long before. CVODE is there as the reference, and for systems so stiff that the
!> fastest rate has no part in the motion: it starts anew after each event, and events are found in
!> the polynomial of each of its steps.
module mesoslip_sliders_layered
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_funloc, c_int, c_loc, c_ptr
   use fsundials_core_mod, only: FN_VGetArrayPointer, N_Vector, SUNMatrix
   use fsunmatrix_band_mod, only: FSUNBandMatrix_Data, FSUNBandMatrix_LDim, &
      & FSUNBandMatrix_StoredUpperBandwidth
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_quadrature, only: gauss_legendre
   use mesoslip_sliders_base, only: motion_type, slider_type, exchange_slider, &
      & exchange_law, shift_slider
   use mesoslip_numerics_sundials_cvode, only: cvode_type, method_adams, method_bdf
   implicit none
   private

   public :: slider_layered_type, layered_parameters_type, new_slider_layered, make_slider_layered
   public :: solver_series, solver_adams, solver_bdf

   !> Taylor series, and CVODE with either family of formulas
   integer, parameter :: solver_series = 0, solver_adams = method_adams, solver_bdf = method_bdf

   !> For the procedures of motion_series.inc
   integer, parameter :: longest_series = 28
   integer :: i
   real(wp), parameter :: inverse(longest_series + 2) = [(1.0_wp / i, i=1, longest_series + 2)]
   !> Longest step in units of the fastest rate
   real(wp), parameter :: longest_step = 2.5_wp

   !> Half the bandwidth of the Jacobian, with displacements and velocities in turn.
   integer, parameter :: half_bandwidth = 3
   !> Layers whose series take as long as an advance of a rigid slider
   real(wp), parameter :: layers_per_cost = 4.0_wp
   !> Steps of CVODE without an event after which it starts anew, so that a run can be put away: as
   !> many as take about a second with very many layers, from fewest to most
   integer, parameter :: fewest_steps = 200, most_steps = 2000, most_layer_steps = 1000000
   !> Points of the rule by which losses are integrated
   integer, parameter :: points = 12

   !> What the slider is made of.
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

   !> An elastic slider.
   type, extends(slider_type) :: slider_layered_type
      !> What it is made of
      type(layered_parameters_type) :: parameters
      !> The system during the last advance
      type(system_type), pointer, private :: system => null()
      !> Displacement and velocity of the base, then of each layer, shape (0:layers, 2)
      real(wp), allocatable, private :: state(:, :)
      !> Taylor coefficients of both, shape (0:layers, 2, 0:longest_series)
      real(wp), allocatable, private :: series(:, :, :)
      !> The same of the velocity of layer 1 relative to the base
      real(wp), private :: sliding(0:longest_series) = 0.0_wp
      integer, private :: terms = 1
      real(wp), private :: start_displacement = 0.0_wp
      real(wp), private :: point(points) = 0.0_wp, weight(points) = 0.0_wp
      !> Longest step of a number of terms, in units of the fastest rate
      real(wp), private :: reach(longest_series) = 0.0_wp

      type(cvode_type), private :: cvode
      !> State in CVODE's order, and the time from which its time counts
      real(wp), pointer, contiguous, private :: vector(:) => null()
      real(wp), private :: start_time = 0.0_wp
      !> CVODE's time, which has more digits than the time of the run
      real(wp), private :: local_time = 0.0_wp
      !> Whether CVODE has to start anew, and its steps since it did
      logical, private :: is_stale = .true.
      integer, private :: steps = 0
      !> What CVODE did before the run was put away
      integer(i8), private :: counts_before(3) = 0_i8
   contains
      procedure :: adapt_to_drive
      procedure :: can_pause
      procedure :: pulled_velocity
      procedure :: start
      procedure :: advance
      procedure :: observe
      procedure :: observe_layers
      procedure :: energy
      procedure :: shift_origin
      procedure :: exchange
      procedure, non_overridable, private :: expand, step_cvode, restart, take_back, add_work, &
         & copy_drive
      final :: close
   end type slider_layered_type

contains

   !> Set up an elastic slider from named numbers.
   subroutine make_slider_layered(slider, parameters, error)
      !> The slider
      class(slider_type), allocatable, intent(out) :: slider
      !> What it is made of; no mass of the base for none
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or superfluous
      type(error_type), allocatable, intent(inout) :: error

      type(slider_layered_type), allocatable :: self
      type(layered_parameters_type) :: values

      call parameters%take("layers", values%layers, error)
      call parameters%take("mass", values%mass, error)
      call parameters%take("stiffness", values%stiffness, error)
      call parameters%take("damping", values%damping, error)
      call parameters%take("base_mass", values%base_mass, error)
      call parameters%take("base_stiffness", values%base_stiffness, error)
      call parameters%take("base_damping", values%base_damping, error)
      call parameters%take("solver", values%solver, error)
      call parameters%take("relative_tolerance", values%relative, error)
      call parameters%take("absolute_tolerance", values%absolute, error)
      call parameters%finish(error)
      if (allocated(error)) return
      allocate (self)
      call new_slider_layered(self, values)
      call move_alloc(self, slider)
   end subroutine make_slider_layered

   !> Set up an elastic slider.
   subroutine new_slider_layered(self, parameters)
      !> The slider
      type(slider_layered_type), intent(inout) :: self
      !> What it is made of
      type(layered_parameters_type), intent(in) :: parameters

      integer :: term

      self%parameters = parameters
      self%cost = 1.0_wp + parameters%layers / layers_per_cost
      allocate (self%state(0:parameters%layers, 2), source=0.0_wp)
      allocate (self%series(0:parameters%layers, 2, 0:longest_series), source=0.0_wp)
      call gauss_legendre(self%point, self%weight)
      ! The first term left out is below 1e-17 of what a free motion has.
      do term = 1, longest_series
         self%reach(term) = exp((log(1.0e-17_wp) + log_gamma(term + 1.0_wp)) / term)
      end do
      allocate (self%system)
      self%system%parameters = parameters
      self%system%layer_mass = parameters%mass / parameters%layers
      self%system%spring = parameters%stiffness * parameters%layers
      if (parameters%layers > 1) self%system%dashpot = parameters%damping * self%system%layer_mass
   end subroutine new_slider_layered

   !> Put the slider at rest in balance with the contacts.
   subroutine start(self, law)
      !> The slider, its displacement zero
      class(slider_layered_type), intent(inout) :: self
      !> Contact force at the start
      type(interface_law_type), intent(in) :: law

      real(wp) :: force
      integer :: layer

      force = law%stiffness * self%displacement - law%offset
      self%state = 0.0_wp
      if (self%parameters%base_mass > 0.0_wp) then
         self%state(0, 1) = force / self%parameters%base_stiffness
      end if
      do layer = 1, self%parameters%layers
         self%state(layer, 1) = self%state(0, 1) + self%displacement &
            & + (layer - 1) * force / self%system%spring
      end do
      self%drive%value = self%state(self%parameters%layers, 1) + force / self%system%spring
      self%velocity = 0.0_wp
      self%series(:, :, 0) = self%state
      self%system%law = law
   end subroutine start

   !> Take note that the drive has changed: CVODE starts anew.
   subroutine adapt_to_drive(self)
      !> The slider
      class(slider_layered_type), intent(inout) :: self

      self%is_stale = .true.
   end subroutine adapt_to_drive

   !> Whether a run that is put away now goes on to the bit: the history of CVODE cannot be put
   !> away, so only where it starts anew.
   pure function can_pause(self)
      !> The slider
      class(slider_layered_type), intent(in) :: self
      !> Whether it does
      logical :: can_pause

      can_pause = self%is_stale .or. self%parameters%solver == solver_series
   end function can_pause

   !> Velocity, at the end of the last advance, of the layer that the drive's spring pulls.
   pure function pulled_velocity(self) result(velocity)
      !> The slider
      class(slider_layered_type), intent(in) :: self
      !> Velocity [m/s]
      real(wp) :: velocity

      velocity = self%state(self%parameters%layers, 2)
   end function pulled_velocity

   !> Copy the drive as it is now into the system.
   subroutine copy_drive(self)
      class(slider_layered_type), intent(inout) :: self

      self%system%drive = self%drive%at(self%time)
      self%system%drive_velocity = self%drive%rate_at(self%time)
      self%system%drive_acceleration = self%drive%acceleration
   end subroutine copy_drive

   !> Move until the first end of a window, or less far.
   subroutine advance(self, law, window)
      !> The slider
      class(slider_layered_type), intent(inout) :: self
      !> Contact force
      type(interface_law_type), intent(in) :: law
      !> Where the law holds
      type(window_type), intent(in) :: window

      real(wp) :: rate, step, gap, longest, change, direction
      logical :: ends, crosses, turns
      integer :: term

      if (self%parameters%solver /= solver_series .and. .not. self%is_stale) then
         self%is_stale = abs(law%stiffness - self%system%law%stiffness) > 0.0_wp .or. &
            & abs(law%offset - self%system%law%offset) > 0.0_wp .or. &
            & abs(law%drag - self%system%law%drag) > 0.0_wp
      end if
      self%step_time = self%time
      self%start_displacement = self%displacement
      self%system%law = law
      step = window%end_time - self%time
      if (.not. step > 0.0_wp) then
         self%series(:, :, 1:) = 0.0_wp
         self%series(:, :, 0) = self%state
         return
      end if

      if (self%parameters%solver == solver_series) then
         call self%copy_drive()
         rate = fastest_rate(self%system)
         ends = step * rate <= longest_step
         if (.not. ends) step = longest_step / rate
         ! Most steps end at a break: no need for a series that reaches farther.
         if (self%velocity > 0.0_wp) then
            gap = window%upper - self%displacement
         else
            gap = self%displacement - window%lower
         end if
         if (gap < 0.5_wp * abs(self%velocity) * step) then
            step = 2.0_wp * gap / abs(self%velocity)
            ends = .false.
            if (.not. step > 0.0_wp) step = longest_step / rate
         end if
         self%terms = longest_series
         do term = 4, longest_series
            if (rate * step <= self%reach(term)) then
               self%terms = term
               exit
            end if
         end do
         call self%expand()
      else
         call self%step_cvode(window%end_time, step, ends)
         if (allocated(self%failure)) return
      end if

      do term = 0, self%terms - 1
         self%sliding(term) = (term + 1) &
            & * (self%series(1, 1, term + 1) - self%series(0, 1, term + 1))
      end do
      longest = step
      crosses = .false.
      turns = .false.
      change = 0.0_wp
      do term = self%terms - 1, 1, -1
         change = (change + abs(self%sliding(term))) * step
      end do
      if (.not. (abs(self%sliding(0)) + change) * step < min(window%upper - self%displacement, &
         & self%displacement - window%lower)) then
         call first_end(self%sliding, self%terms, window%upper - self%displacement, &
            & window%lower - self%displacement, change, step, crosses, turns, direction)
      end if

      call take_back(self, step)
      if (crosses) then
         self%displacement = merge(window%upper, window%lower, direction > 0.0_wp)
         self%state(1, 1) = self%state(0, 1) + self%displacement
         self%is_stale = .true.
      else
         self%displacement = self%state(1, 1) - self%state(0, 1)
      end if
      if (turns) then
         self%state(1, 2) = self%state(0, 2)
         self%is_stale = .true.
      end if
      self%base_velocity = self%state(0, 2)
      self%velocity = self%state(1, 2) - self%base_velocity
      if (step < longest) self%is_stale = .true.
      if (ends .and. .not. (crosses .or. turns) .and. step >= longest) then
         self%time = window%end_time
      else
         self%time = self%time + step
      end if
      if (abs(self%velocity) > 0.0_wp) self%direction = sign(1.0_wp, self%velocity)
      self%acceleration = slope(self%sliding, self%terms, step)
      self%start_acceleration = self%sliding(1)
      call self%add_work(step)
      if (self%parameters%solver /= solver_series) then
         self%steps = self%steps + 1
         if (self%steps >= max(fewest_steps, min(most_steps, &
            & most_layer_steps / self%parameters%layers))) self%is_stale = .true.
         self%integrator_counts = self%counts_before + int(self%cvode%counts(), i8)
      end if
   end subroutine advance

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

   !> Accelerations of base and layers, times a factor, without what acts from outside.
   pure subroutine accelerate(system, factor, pull, displacement, velocity, acceleration)
      type(system_type), intent(in) :: system
      !> The factor, and an acceleration that the last layer has besides [m/s2]
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

      integer :: last

      last = system%parameters%layers
      acceleration(last) = acceleration(last) + system%spring * (system%drive &
         & + (system%drive_velocity + 0.5_wp * system%drive_acceleration * time) * time) &
         & / system%layer_mass
      acceleration(1) = acceleration(1) + system%law%offset / system%layer_mass
      if (system%parameters%base_mass > 0.0_wp) then
         acceleration(0) = acceleration(0) - system%law%offset / system%parameters%base_mass
      end if
   end subroutine push

   !> Taylor coefficients of the motion.
   subroutine expand(self)
      class(slider_layered_type), intent(inout) :: self

      real(wp) :: pull
      integer :: term

      self%series(:, :, 0) = self%state
      do term = 0, self%terms - 1
         pull = 0.0_wp
         if (term == 1) pull = self%system%spring * self%system%drive_velocity &
            & / self%system%layer_mass
         if (term == 2) pull = 0.5_wp * self%system%spring * self%system%drive_acceleration &
            & / self%system%layer_mass
         call accelerate(self%system, inverse(term + 1), pull, self%series(:, 1, term), &
            & self%series(:, 2, term), self%series(:, 2, term + 1))
         if (term == 0) call push(self%system, 0.0_wp, self%series(:, 2, 1))
         self%series(:, 1, term + 1) = self%series(:, 2, term) * inverse(term + 1)
      end do
   end subroutine expand

   !> The state at a time after the start of the step.
   subroutine take_back(self, time)
      class(slider_layered_type), intent(inout) :: self
      real(wp), intent(in) :: time

      call sum_series(size(self%state), self%terms, self%series, time, self%state)
   end subroutine take_back

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

   !> A step of CVODE, as a series from its start.
   subroutine step_cvode(self, end_time, step, ends)
      class(slider_layered_type), intent(inout) :: self
      !> Time that must not be passed
      real(wp), intent(in) :: end_time
      !> Length of the step
      real(wp), intent(out) :: step
      !> Whether it comes to that time
      logical, intent(out) :: ends

      real(wp), target :: values(2 * (self%parameters%layers + 1))
      real(wp) :: reached, factor
      integer :: order

      step = 0.0_wp
      ends = .false.
      if (self%is_stale) call self%restart()
      if (allocated(self%failure)) return
      call self%cvode%step(end_time - self%start_time, reached, step, self%terms, self%failure)
      if (allocated(self%failure)) then
         self%failure%message = self%failure%message // "; a looser slider.solver." &
            & // "relative_tolerance, or another slider.solver.method, may help"
         return
      end if
      ends = reached >= end_time - self%start_time
      step = reached - self%local_time
      factor = 1.0_wp
      self%series(:, :, self%terms + 1:) = 0.0_wp
      do order = 0, self%terms
         factor = factor / max(1, order)
         call self%cvode%derivative(self%local_time, order, values, self%failure)
         if (allocated(self%failure)) return
         self%series(:, 1, order) = factor * values(1::2)
         self%series(:, 2, order) = factor * values(2::2)
      end do
      self%local_time = reached
   end subroutine step_cvode

   !> Start CVODE anew from the state.
   subroutine restart(self)
      class(slider_layered_type), intent(inout) :: self

      self%start_time = self%time
      self%local_time = 0.0_wp
      call self%copy_drive()
      if (.not. associated(self%vector)) allocate (self%vector(size(self%state)))
      self%vector(1::2) = self%state(:, 1)
      self%vector(2::2) = self%state(:, 2)
      if (self%cvode%is_open()) then
         call self%cvode%restart(0.0_wp, self%failure)
      else
         call self%cvode%open(c_funloc(rates), c_loc(self%system), self%parameters%solver, &
            & half_bandwidth, 0.0_wp, self%vector, self%parameters%relative, &
            & self%parameters%absolute, self%failure)
         if (.not. allocated(self%failure) .and. self%parameters%solver == solver_bdf) then
            call self%cvode%set_jacobian(c_funloc(jacobian), self%failure)
         end if
      end if
      self%is_stale = .false.
      self%steps = 0
   end subroutine restart

   !> Rates of the state in CVODE's order.
   function rates(time, state, rate, user_data) bind(c, name="mesoslip_layers_rates") &
      & result(status)
      real(c_double), value :: time
      type(N_Vector) :: state, rate
      type(c_ptr), value :: user_data
      integer(c_int) :: status

      type(system_type), pointer :: system
      real(c_double), pointer :: y(:), dy(:)
      real(wp), allocatable :: acceleration(:)

      call c_f_pointer(user_data, system)
      y => FN_VGetArrayPointer(state)
      dy => FN_VGetArrayPointer(rate)
      allocate (acceleration(0:system%parameters%layers))
      call accelerate(system, 1.0_wp, 0.0_wp, y(1::2), y(2::2), acceleration)
      call push(system, time, acceleration)
      dy(1::2) = y(2::2)
      dy(2::2) = acceleration
      status = 0
   end function rates

   !> The Jacobian of rates, a banded matrix.
   function jacobian(time, state, rate, matrix, user_data, first, second, third) &
      & bind(c, name="mesoslip_layers_jacobian") result(status)
      real(c_double), value :: time
      type(N_Vector) :: state, rate, first, second, third
      type(SUNMatrix) :: matrix
      type(c_ptr), value :: user_data
      integer(c_int) :: status

      type(system_type), pointer :: system
      real(c_double), pointer :: start(:), entries(:)
      real(wp) :: spring, dashpot, base
      integer :: stride, upper, layer, last

      call c_f_pointer(user_data, system)
      stride = int(FSUNBandMatrix_LDim(matrix))
      upper = int(FSUNBandMatrix_StoredUpperBandwidth(matrix))
      last = system%parameters%layers
      ! What SUNDIALS returns is a pointer to the first entry.
      start => FSUNBandMatrix_Data(matrix)
      call c_f_pointer(c_loc(start), entries, [stride * 2 * (last + 1)])
      entries = 0.0_c_double
      spring = system%spring / system%layer_mass
      dashpot = system%dashpot / system%layer_mass
      do layer = 0, last
         call add(2 * layer + 1, 2 * layer + 2, 1.0_wp)
      end do
      do layer = 1, last - 1
         call couple(layer, layer, -spring, -dashpot)
         call couple(layer, layer + 1, spring, dashpot)
         call couple(layer + 1, layer + 1, -spring, -dashpot)
         call couple(layer + 1, layer, spring, dashpot)
      end do
      ! The spring to the drive.
      call couple(last, last, -spring, 0.0_wp)
      associate (law => system%law, parameters => system%parameters)
         call couple(1, 1, -law%stiffness / system%layer_mass, -law%drag / system%layer_mass)
         call couple(1, 0, law%stiffness / system%layer_mass, law%drag / system%layer_mass)
         if (parameters%base_mass > 0.0_wp) then
            base = 1.0_wp / parameters%base_mass
            call couple(0, 1, law%stiffness * base, law%drag * base)
            call couple(0, 0, -(law%stiffness + parameters%base_stiffness) * base, &
               & -law%drag * base - parameters%base_damping)
         end if
      end associate
      status = 0

   contains

      !> Derivatives of the acceleration of one by displacement and velocity of another.
      subroutine couple(of, by, by_displacement, by_velocity)
         integer, intent(in) :: of, by
         real(wp), intent(in) :: by_displacement, by_velocity

         call add(2 * of + 2, 2 * by + 1, by_displacement)
         call add(2 * of + 2, 2 * by + 2, by_velocity)
      end subroutine couple

      !> Add to an entry.
      subroutine add(row, column, value)
         integer, intent(in) :: row, column
         real(wp), intent(in) :: value

         integer :: place

         place = (column - 1) * stride + upper + row - column + 1
         entries(place) = entries(place) + value
      end subroutine add

   end function jacobian

   !> Add work and losses of a step to the energy balance.
   subroutine add_work(self, step)
      class(slider_layered_type), intent(inout) :: self
      real(wp), intent(in) :: step

      real(wp) :: way, extension, sliding, drag, damped, velocity(0:self%parameters%layers)
      real(wp) :: drive_velocity, drive_acceleration, drive, lever
      integer :: last, node, term

      last = self%parameters%layers
      drive_velocity = self%drive%rate_at(self%step_time)
      drive_acceleration = self%drive%acceleration
      drive = self%drive%at(self%step_time)
      way = 0.0_wp
      do term = self%terms, 0, -1
         way = way * step + self%series(last, 1, term) * inverse(term + 1)
      end do
      way = way * step
      extension = step * (drive + step * (0.5_wp * drive_velocity &
         & + drive_acceleration * step / 6.0_wp)) - way
      if (abs(drive_acceleration) > 0.0_wp) then
         lever = 0.0_wp
         do term = self%terms, 0, -1
            lever = lever * step + self%series(last, 1, term) * inverse(term + 2)
         end do
         lever = step**2 * (0.5_wp * drive + step * (drive_velocity / 3.0_wp &
            & + 0.125_wp * drive_acceleration * step) - lever)
         call self%drive%earlier_impulse%add(self%system%spring * extension)
         call self%drive%earlier_work%add(self%system%spring &
            & * (drive_velocity * extension + drive_acceleration * lever))
      else
         call self%drive%impulse%add(self%system%spring * extension)
      end if

      drag = 0.0_wp
      damped = 0.0_wp
      do node = 1, points
         sliding = horner(self%sliding, self%terms, self%point(node) * step)
         drag = drag + self%weight(node) * sliding**2
      end do
      call self%drag_loss%add(step * drag * self%system%law%drag)
      if (self%system%dashpot + self%parameters%base_damping <= 0.0_wp) return
      do node = 1, points
         velocity = self%series(:, 2, self%terms)
         do term = self%terms - 1, 0, -1
            velocity = velocity * (self%point(node) * step) + self%series(:, 2, term)
         end do
         damped = damped + step * self%weight(node) * (self%system%dashpot &
            & * sum((velocity(2:) - velocity(1:last - 1))**2) &
            & + self%parameters%base_mass * self%parameters%base_damping * velocity(0)**2)
      end do
      call self%damping_loss%add(damped)
   end subroutine add_work

   !> The motion at a time of the last advance.
   pure function observe(self, time) result(motion)
      !> The slider
      class(slider_layered_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> The motion, that of layer 1 relative to the base
      type(motion_type) :: motion

      real(wp) :: step, drive, first, last, base, first_velocity
      integer :: layers, term

      layers = self%parameters%layers
      step = time - self%step_time
      drive = self%drive%at(time)
      ! All of them term by term: they do not wait for each other.
      base = 0.0_wp
      first = 0.0_wp
      last = 0.0_wp
      motion%base_velocity = 0.0_wp
      first_velocity = 0.0_wp
      motion%pulled_velocity = 0.0_wp
      do term = self%terms, 0, -1
         base = base * step + self%series(0, 1, term)
         first = first * step + self%series(1, 1, term)
         last = last * step + self%series(layers, 1, term)
         motion%base_velocity = motion%base_velocity * step + self%series(0, 2, term)
         first_velocity = first_velocity * step + self%series(1, 2, term)
         motion%pulled_velocity = motion%pulled_velocity * step + self%series(layers, 2, term)
      end do
      motion%time = time
      motion%velocity = first_velocity - motion%base_velocity
      motion%drive_displacement = self%origin + drive
      motion%displacement = self%origin + first - base
      motion%spring_force = self%system%spring * (drive - last)
      motion%elastic_force = self%parameters%stiffness * (drive - first)
      motion%base_displacement = base
      motion%contact_force = self%system%law%stiffness * (first - base) - self%system%law%offset &
         & + self%system%law%drag * motion%velocity
   end function observe

   !> Displacements of the layers at a time of the last advance.
   pure subroutine observe_layers(self, time, displacement)
      !> The slider
      class(slider_layered_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> Absolute displacements, shape (layers) [m]
      real(wp), intent(out) :: displacement(:)

      integer :: term

      displacement = self%series(1:, 1, self%terms)
      do term = self%terms - 1, 0, -1
         displacement = displacement * (time - self%step_time) + self%series(1:, 1, term)
      end do
      displacement = self%origin + displacement
   end subroutine observe_layers

   !> Kinetic energy and that of all springs.
   pure function energy(self)
      !> The slider
      class(slider_layered_type), intent(in) :: self
      !> Energy [J]
      real(wp) :: energy

      integer :: last

      last = self%parameters%layers
      associate (x => self%state(:, 1), v => self%state(:, 2))
         energy = 0.5_wp * self%system%layer_mass * sum(v(2:)**2) &
            & + 0.5_wp * self%system%spring * (sum((x(3:) - x(2:last))**2) &
            & + (self%drive%at(self%time) - x(last + 1))**2) &
            & + 0.5_wp * self%parameters%base_mass * v(1)**2 &
            & + 0.5_wp * self%parameters%base_stiffness * x(1)**2
      end associate
   end function energy

   !> Move the origin of displacements; the base keeps its own.
   subroutine shift_origin(self, shift)
      !> The slider
      class(slider_layered_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      call shift_slider(self, shift)
      self%state(1:, 1) = self%state(1:, 1) - shift
      self%is_stale = .true.
   end subroutine shift_origin

   !> Free what the slider holds.
   subroutine close(self)
      !> The slider
      type(slider_layered_type), intent(inout) :: self

      call self%cvode%close()
      if (associated(self%vector)) deallocate (self%vector)
      if (associated(self%system)) deallocate (self%system)
   end subroutine close

   !> Put the state into an archive or take it out; CVODE starts anew.
   subroutine exchange(self, archive)
      !> The slider
      class(slider_layered_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      real(wp), allocatable :: state(:, :)

      call archive%section("layered slider")
      call exchange_slider(self, archive)
      call exchange_law(self%system%law, archive)
      call archive%exchange("drive", self%system%drive)
      call archive%exchange("drive_velocity", self%system%drive_velocity)
      call archive%exchange("drive_acceleration", self%system%drive_acceleration)
      state = self%state
      call archive%exchange("state", state)
      if (all(shape(state) == shape(self%state))) self%state = state
      call archive%exchange("series", self%series)
      call archive%exchange("start_displacement", self%start_displacement)
      call archive%exchange("terms", self%terms)
      call archive%exchange("steps", self%integrator_counts(1))
      call archive%exchange("evaluations", self%integrator_counts(2))
      call archive%exchange("failed_steps", self%integrator_counts(3))
      if (archive%saving) return
      self%counts_before = self%integrator_counts
      call self%cvode%close()
      self%is_stale = .true.
   end subroutine exchange

   !> Derivative of a series.
   pure function slope(series, terms, time)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp) :: slope

      integer :: term

      slope = 0.0_wp
      do term = terms - 1, 1, -1
         slope = slope * time + term * series(term)
      end do
   end function slope

   include "motion_series.inc"

end module mesoslip_sliders_layered
