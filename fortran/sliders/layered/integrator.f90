!> CVODE for a chain of layers: a check of the series, and for systems so stiff that the fastest
!> rate does not matter for the motion.
!>
!> It restarts after each event, and events are found in the polynomial of each of its steps.
module mesoslip_sliders_layered_integrator
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_loc, c_ptr
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_sundials_cvode, only: cvode_type
   use mesoslip_sliders_layered_system, only: accelerate, push, system_type
   implicit none
   private

   public :: integrator_type

   !> Half the bandwidth of the Jacobian, with displacements and velocities in turn
   integer, parameter :: half_bandwidth = 3
   !> Steps without an event after which it restarts, so that a run can be saved: about a second
   !> with very many layers, within bounds
   integer, parameter :: min_steps = 200, max_steps = 2000, max_layer_steps = 1000000

   !> CVODE with a state of its own.
   type :: integrator_type
      !> Whether CVODE has to restart
      logical :: is_stale = .true.
      type(cvode_type), private :: cvode
      !> State in CVODE's order, and the time from which its time counts
      real(wp), pointer, contiguous, private :: vector(:) => null()
      real(wp), private :: start_time = 0.0_wp
      !> CVODE's time, which has more digits than the time of the run
      real(wp), private :: local_time = 0.0_wp
      !> Steps since the last restart
      integer, private :: steps = 0
      !> Steps, evaluations and failed steps before the run was saved
      integer(i8), private :: counts_before(3) = 0_i8
   contains
      procedure, non_overridable :: step
      procedure, non_overridable :: end_step
      procedure, non_overridable :: reset
      procedure, non_overridable :: close
      procedure, non_overridable, private :: restart
   end type integrator_type

contains

   !> A step of CVODE, as a series from its start.
   subroutine step(self, system, state, time, end_time, terms, series, length, ends, error)
      class(integrator_type), intent(inout) :: self
      type(system_type), intent(in), target :: system
      !> Displacement and velocity of the base, then of each layer, shape (0:layers, 2)
      real(wp), intent(in), contiguous :: state(0:, :)
      !> Time now, and time that must not be passed [s]
      real(wp), intent(in) :: time, end_time
      !> Terms beyond the first, and Taylor coefficients of both, shape (0:layers, 2, 0:)
      integer, intent(inout) :: terms
      real(wp), intent(inout), contiguous :: series(0:, :, 0:)
      !> Length of the step
      real(wp), intent(out) :: length
      !> Whether it reaches that time
      logical, intent(out) :: ends
      !> Set if CVODE fails
      type(error_type), allocatable, intent(inout) :: error

      real(wp), target :: values(size(state))
      real(wp) :: reached, factor
      integer :: order

      length = 0.0_wp
      ends = .false.
      if (self%is_stale) call self%restart(system, state, time, error)
      if (allocated(error)) return
      call self%cvode%step(end_time - self%start_time, reached, length, terms, error)
      if (allocated(error)) then
         error%message = error%message // "; a looser slider.solver." &
            & // "relative_tolerance, or another slider.solver.method, may help"
         return
      end if
      ends = reached >= end_time - self%start_time
      length = reached - self%local_time
      factor = 1.0_wp
      series(:, :, terms + 1:) = 0.0_wp
      do order = 0, terms
         factor = factor / max(1, order)
         call self%cvode%derivative(self%local_time, order, values, error)
         if (allocated(error)) return
         series(:, 1, order) = factor * values(1::2)
         series(:, 2, order) = factor * values(2::2)
      end do
      self%local_time = reached
   end subroutine step

   !> Restart CVODE from the state.
   subroutine restart(self, system, state, time, error)
      class(integrator_type), intent(inout) :: self
      type(system_type), intent(in), target :: system
      real(wp), intent(in), contiguous :: state(0:, :)
      !> Time now [s]
      real(wp), intent(in) :: time
      type(error_type), allocatable, intent(inout) :: error

      self%start_time = time
      self%local_time = 0.0_wp
      if (.not. associated(self%vector)) allocate (self%vector(size(state)))
      self%vector(1::2) = state(:, 1)
      self%vector(2::2) = state(:, 2)
      if (self%cvode%is_open()) then
         call self%cvode%restart(0.0_wp, error)
      else
         call self%cvode%open(rates, c_loc(system), system%parameters%solver, half_bandwidth, &
            & 0.0_wp, self%vector, system%parameters%relative, system%parameters%absolute, &
            & jacobian=jacobian, error=error)
      end if
      self%is_stale = .false.
      self%steps = 0
   end subroutine restart

   !> Count a step that was used.
   subroutine end_step(self, layers, counts)
      class(integrator_type), intent(inout) :: self
      !> Number of layers
      integer, intent(in) :: layers
      !> Steps, evaluations and failed steps so far
      integer(i8), intent(out) :: counts(3)

      self%steps = self%steps + 1
      if (self%steps >= max(min_steps, min(max_steps, max_layer_steps / layers))) then
         self%is_stale = .true.
      end if
      counts = self%counts_before + int(self%cvode%counts(), i8)
   end subroutine end_step

   !> Restart at the next step, with counts of an earlier run.
   subroutine reset(self, counts)
      class(integrator_type), intent(inout) :: self
      !> Steps, evaluations and failed steps so far
      integer(i8), intent(in) :: counts(3)

      self%counts_before = counts
      call self%cvode%close()
      self%is_stale = .true.
   end subroutine reset

   subroutine close(self)
      class(integrator_type), intent(inout) :: self

      call self%cvode%close()
      if (associated(self%vector)) deallocate (self%vector)
   end subroutine close

   !> Rates of the state in CVODE's order.
   function rates(time, size, state, rate, data) bind(c, name="mesoslip_layers_rates") &
      & result(status)
      real(c_double), value :: time
      integer(c_int), value :: size
      real(c_double), intent(in) :: state(size)
      real(c_double), intent(inout) :: rate(size)
      type(c_ptr), value :: data
      integer(c_int) :: status

      type(system_type), pointer :: system
      real(wp), allocatable :: acceleration(:)

      call c_f_pointer(data, system)
      allocate (acceleration(0:system%parameters%layers))
      call accelerate(system, 1.0_wp, 0.0_wp, state(1::2), state(2::2), acceleration)
      call push(system, time, acceleration)
      rate(1::2) = state(2::2)
      rate(2::2) = acceleration
      status = 0
   end function rates

   !> The Jacobian of rates, a banded matrix.
   subroutine jacobian(rows, size, upper, entries, data) bind(c, name="mesoslip_layers_jacobian")
      integer(c_int), value :: rows, size, upper
      real(c_double), intent(inout) :: entries(rows, size)
      type(c_ptr), value :: data

      type(system_type), pointer :: system
      real(wp) :: spring, dashpot, base
      integer :: layer, last

      call c_f_pointer(data, system)
      last = system%parameters%layers
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

         place = upper + 1 + row - column
         entries(place, column) = entries(place, column) + value
      end subroutine add

   end subroutine jacobian

end module mesoslip_sliders_layered_integrator
