!> A slider without inertia on a spring, with rate-and-state friction of one or two states.
!>
!> Friction is F = F_0 + a u + sum_i b_i psi_i + c X, with u = ln(V/V_0), psi = ln(V_0 theta/D), and
!> a linear trend c over the displacement X of the slider. The force of the spring gives
!> a du/dt = k V_lp - (k + c) V - sum_i b_i dpsi_i/dt, which is stiff. A Rosenbrock method of fourth
!> order integrates it: RODAS of E. Hairer and G. Wanner, Solving Ordinary Differential Equations II
!> (1996). The matrix of its linear equations is an arrowhead, solved by hand.
module mesoslip_theory_rate_and_state
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: friction_type, load_type, move_slider
   public :: evolution_ageing, evolution_slip, evolution_names, max_states

   !> dtheta/dt = 1 - V theta/D
   integer, parameter :: evolution_ageing = 1
   !> dtheta/dt = -(V theta/D) ln(V theta/D)
   integer, parameter :: evolution_slip = 2
   !> Names of the evolution_ codes
   character(len=*), parameter :: evolution_names(2) = [character(len=6) :: "ageing", "slip"]

   !> Maximum number of state variables
   integer, parameter :: max_states = 2
   !> Logarithm of V/V_0 that only an unstable motion reaches
   real(wp), parameter :: runaway = 40.0_wp
   !> Maximum exponent, so that nothing overflows
   real(wp), parameter :: max_exponent = 100.0_wp
   !> Maximum number of steps of a motion
   integer, parameter :: max_steps = 200000

   !> Stages of the method, and its coefficients in the form without products of matrices
   integer, parameter :: stages = 6
   real(wp), parameter :: gamma = 0.25_wp
   real(wp), parameter :: alpha(stages) = [0.0_wp, 0.386_wp, 0.21_wp, 0.63_wp, 1.0_wp, 1.0_wp]
   real(wp), parameter :: gammas(stages) = [0.25_wp, -0.1043_wp, 0.1035_wp, -0.0362_wp, 0.0_wp, &
      & 0.0_wp]
   real(wp), parameter :: A(stages, stages) = reshape([ &
      & 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      & 1.544_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      & 0.9466785280815826_wp, 0.2557011698983284_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      & 3.314825187068521_wp, 2.896124015972201_wp, 0.9986419139977817_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      & 1.221224509226641_wp, 6.019134481288629_wp, 12.53708332932087_wp, -0.6878860361058950_wp, &
      & 0.0_wp, 0.0_wp, &
      & 1.221224509226641_wp, 6.019134481288629_wp, 12.53708332932087_wp, -0.6878860361058950_wp, &
      & 1.0_wp, 0.0_wp], [stages, stages])
   real(wp), parameter :: C(stages, stages) = reshape([ &
      & 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      & -5.6688_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      & -2.430093356833875_wp, -0.2063599157091915_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      & -0.1073529058151375_wp, -9.594562251023355_wp, -20.47028614809616_wp, 0.0_wp, 0.0_wp, &
      & 0.0_wp, &
      & 7.496443313967647_wp, -10.24680431464352_wp, -33.99990352819905_wp, 11.70890893206160_wp, &
      & 0.0_wp, 0.0_wp, &
      & 8.083246795921522_wp, -7.981132988064893_wp, -31.52159432874371_wp, 16.31930543123136_wp, &
      & -6.058818238834054_wp, 0.0_wp], [stages, stages])

   !> Coefficients of the motion within a step, a polynomial of third degree
   real(wp), parameter :: D(stages, 2) = reshape([ &
      & 10.12623508344586_wp, -7.487995877610167_wp, -34.80091861555747_wp, &
      & -7.992771707568823_wp, 1.025137723295662_wp, 0.0_wp, &
      & -0.6762803392801253_wp, 6.087714651680015_wp, 16.43084320892478_wp, &
      & 24.76722511418386_wp, -6.594389125716872_wp, 0.0_wp], [stages, 2])

   !> Friction, its spring, and the trend.
   type :: friction_type
      !> One of the evolution_ codes, and number of state variables
      integer :: evolution = evolution_ageing, states = 1
      !> V_0, and a
      real(wp) :: reference_velocity = 1.0_wp, a = 1.0_wp
      !> b and D of each state variable
      real(wp) :: b(max_states) = 0.0_wp, distance(max_states) = 1.0_wp
      !> k and c, force over displacement
      real(wp) :: stiffness = 1.0_wp, trend = 0.0_wp
   end type friction_type

   !> Stages of the load point, of constant acceleration; the last one goes on.
   type :: load_type
      !> Duration, and velocities at start and end, not negative; the first one slides
      real(wp), allocatable :: duration(:), start_velocity(:), end_velocity(:)
   end type load_type

   !> A motion in a stage of the load point.
   type :: motion_type
      !> The slider
      type(friction_type) :: friction
      !> 1/a, and 1/D of each state variable
      real(wp) :: per_a = 1.0_wp, per_distance(max_states) = 1.0_wp
      !> Velocity of the load point at time 0, and its acceleration
      real(wp) :: velocity = 0.0_wp, acceleration = 0.0_wp
      !> Time in the stage
      real(wp) :: time = 0.0_wp
      !> u and psi
      real(wp) :: state(0:max_states) = 0.0_wp
      !> Time and state before the last step, and the terms of its polynomial
      real(wp) :: time_before = 0.0_wp, state_before(0:max_states) = 0.0_wp
      real(wp) :: terms(0:max_states, 2) = 0.0_wp
      !> Length of the next step, and steps so far
      real(wp) :: step = 0.0_wp
      integer :: steps = 0
      !> Whether it is unstable, or has too many steps
      logical :: failed = .false.
   contains
      procedure :: advance
      procedure, private :: rates
      procedure, private :: derivatives
      procedure, private :: try_step
   end type motion_type

contains

   !> Force and displacement of a slider at some times, from steady sliding on.
   subroutine move_slider(friction, load, times, tolerance, force, displacement, failed)
      !> The friction
      type(friction_type), intent(in) :: friction
      !> The load point
      type(load_type), intent(in) :: load
      !> Times in ascending order, and tolerance of u and psi
      real(wp), intent(in) :: times(:), tolerance
      !> Force without F_0, displacement
      real(wp), intent(out) :: force(:), displacement(:)
      !> Whether the motion is unstable
      logical, intent(out) :: failed

      type(motion_type) :: motion
      real(wp) :: begin, load_start, moved, since, first, friction_part, finish
      real(wp) :: share, ends(2), terms(2)
      integer :: stage, point, last

      force = 0.0_wp
      displacement = 0.0_wp
      motion%friction = friction
      motion%per_a = 1.0_wp / friction%a
      motion%per_distance = 1.0_wp / friction%distance
      associate (k => friction%stiffness, trend => friction%trend)
         motion%state(0) = log(load%start_velocity(1) * k / (k + trend) &
            & / friction%reference_velocity)
         motion%state(1:) = -motion%state(0)
         first = variable_part(friction, motion%state)
         begin = 0.0_wp
         load_start = 0.0_wp
         point = 1
         last = size(load%duration)
         do stage = 1, last
            motion%time = 0.0_wp
            motion%velocity = load%start_velocity(stage)
            motion%acceleration = (load%end_velocity(stage) - load%start_velocity(stage)) &
               & / load%duration(stage)
            motion%step = first_step(motion, load%duration(stage))
            finish = load%duration(stage)
            if (stage == last) finish = max(finish, maxval(times) - begin)
            do while (motion%time < finish .and. point <= size(times))
               call motion%advance(finish, tolerance)
               if (motion%failed) exit
               ! The friction within the step is the polynomial of the state.
               ends = [variable_part(friction, motion%state_before), &
                  & variable_part(friction, motion%state)]
               terms = [variable_part(friction, motion%terms(:, 1)), &
                  & variable_part(friction, motion%terms(:, 2))]
               do while (point <= size(times))
                  since = times(point) - begin
                  if (since > motion%time) exit
                  ! The force of the spring and that of friction are equal: this gives X.
                  share = (since - motion%time_before) / (motion%time - motion%time_before)
                  friction_part = (1.0_wp - share) * ends(1) + share * (ends(2) &
                     & + (1.0_wp - share) * (terms(1) + share * terms(2)))
                  moved = load_start &
                     & + (motion%velocity + 0.5_wp * motion%acceleration * since) * since
                  displacement(point) = (k * moved - friction_part + first) / (k + trend)
                  force(point) = friction_part + trend * displacement(point)
                  point = point + 1
               end do
            end do
            if (motion%failed .or. point > size(times)) exit
            load_start = load_start + 0.5_wp * (load%start_velocity(stage) &
               & + load%end_velocity(stage)) * load%duration(stage)
            begin = begin + load%duration(stage)
         end do
      end associate
      failed = motion%failed
   end subroutine move_slider

   !> a u + sum b psi
   pure function variable_part(friction, state) result(force)
      !> The friction
      type(friction_type), intent(in) :: friction
      !> u and psi
      real(wp), intent(in) :: state(0:)
      real(wp) :: force

      force = friction%a * state(0) + sum(friction%b(:friction%states) * state(1:friction%states))
   end function variable_part

   !> A first step, short against every time of the motion
   pure function first_step(motion, duration) result(step)
      !> At the start of a stage
      class(motion_type), intent(in) :: motion
      !> Duration of the stage
      real(wp), intent(in) :: duration
      real(wp) :: step

      real(wp) :: velocity

      associate (friction => motion%friction)
         velocity = max(motion%velocity, friction%reference_velocity * exp(motion%state(0)))
         step = 1.0e-3_wp * min(duration, &
            & minval(friction%distance(:friction%states)) / velocity, &
            & friction%a / (friction%stiffness * velocity))
      end associate
   end function first_step

   !> Move by a step, at most to a time in the stage
   subroutine advance(self, time, tolerance)
      class(motion_type), intent(inout) :: self
      !> Time in the stage
      real(wp), intent(in) :: time
      !> Tolerance of u and psi
      real(wp), intent(in) :: tolerance

      real(wp) :: step, next(0:max_states), terms(0:max_states, 2), error, factor

      do
         step = min(self%step, time - self%time)
         call self%try_step(step, next, terms, error)
         self%steps = self%steps + 1
         if (.not. error <= huge(1.0_wp) .or. maxval(abs(next)) > max_exponent) error = huge(1.0_wp)
         error = error / tolerance
         factor = min(5.0_wp, max(0.2_wp, 0.9_wp / sqrt(sqrt(max(error, 1.0e-12_wp)))))
         if (error <= 1.0_wp) then
            self%time_before = self%time
            self%state_before = self%state
            self%terms = terms
            self%time = merge(time, self%time + step, step >= time - self%time)
            self%state = next
         end if
         self%step = step * factor
         self%failed = self%time < time .and. (self%state(0) > runaway &
            & .or. self%steps > max_steps .or. self%time + 0.01_wp * self%step <= self%time)
         if (error <= 1.0_wp .or. self%failed) return
      end do
   end subroutine advance

   !> A step, the motion within it, and the estimate of its error
   pure subroutine try_step(self, step, next, terms, error)
      class(motion_type), intent(in) :: self
      !> Length of the step
      real(wp), intent(in) :: step
      !> u and psi after it
      real(wp), intent(out) :: next(0:max_states)
      !> Terms of its polynomial
      real(wp), intent(out) :: terms(0:max_states, 2)
      !> Maximum error of one of them
      real(wp), intent(out) :: error

      real(wp) :: k(0:max_states, stages), right(0:max_states), rate(0:max_states)
      real(wp) :: inner(0:max_states), up(max_states), down(max_states), diagonal(max_states)
      real(wp) :: corner, inverse, per_step, pull
      integer :: stage, before, one, n

      n = self%friction%states
      per_step = 1.0_wp / step
      inverse = per_step / gamma
      call self%derivatives(corner, up, down, diagonal)
      corner = inverse - corner
      k = 0.0_wp
      do one = 1, n
         diagonal(one) = 1.0_wp / (inverse - diagonal(one))
         up(one) = up(one) * diagonal(one)
         corner = corner - up(one) * down(one)
      end do
      corner = 1.0_wp / corner
      pull = step * self%friction%stiffness * self%acceleration * self%per_a
      do stage = 1, stages
         inner = self%state
         right = 0.0_wp
         do before = 1, stage - 1
            inner = inner + A(before, stage) * k(:, before)
            right = right + C(before, stage) * k(:, before)
         end do
         call self%rates(self%time + alpha(stage) * step, inner, rate)
         right = rate + per_step * right
         right(0) = right(0) + gammas(stage) * pull
         do one = 1, n
            right(0) = right(0) + up(one) * right(one)
         end do
         k(0, stage) = right(0) * corner
         do one = 1, n
            k(one, stage) = (right(one) + down(one) * k(0, stage)) * diagonal(one)
         end do
      end do
      next = inner + k(:, stages)
      terms = matmul(k, D)
      error = maxval(abs(k(:, stages)))
   end subroutine try_step

   !> du/dt and dpsi/dt
   pure subroutine rates(self, time, state, rate)
      class(motion_type), intent(in) :: self
      !> Time in the stage; u and psi
      real(wp), intent(in) :: time, state(0:max_states)
      !> Their derivatives
      real(wp), intent(out) :: rate(0:max_states)

      real(wp) :: velocity
      integer :: one

      rate = 0.0_wp
      associate (friction => self%friction)
         velocity = friction%reference_velocity * exp(min(state(0), max_exponent))
         do one = 1, friction%states
            if (friction%evolution == evolution_ageing) then
               rate(one) = (friction%reference_velocity * exp(min(-state(one), max_exponent)) &
                  & - velocity) * self%per_distance(one)
            else
               rate(one) = -velocity * (state(0) + state(one)) * self%per_distance(one)
            end if
         end do
         rate(0) = (friction%stiffness * (self%velocity + self%acceleration * time) &
            & - (friction%stiffness + friction%trend) * velocity &
            & - sum(friction%b(:friction%states) * rate(1:friction%states))) * self%per_a
      end associate
   end subroutine rates

   !> The matrix of derivatives of the rates, an arrowhead
   pure subroutine derivatives(self, corner, up, down, diagonal)
      class(motion_type), intent(in) :: self
      !> Of du/dt by u; of it by psi; of dpsi/dt by u; of it by psi
      real(wp), intent(out) :: corner, up(max_states), down(max_states), diagonal(max_states)

      real(wp) :: velocity
      integer :: one

      up = 0.0_wp
      down = 0.0_wp
      diagonal = 0.0_wp
      associate (friction => self%friction, n => self%friction%states)
         velocity = friction%reference_velocity * exp(self%state(0))
         do one = 1, n
            if (friction%evolution == evolution_ageing) then
               down(one) = -velocity * self%per_distance(one)
               diagonal(one) = -friction%reference_velocity * exp(-self%state(one)) &
                  & * self%per_distance(one)
            else
               down(one) = -velocity * (self%state(0) + self%state(one) + 1.0_wp) &
                  & * self%per_distance(one)
               diagonal(one) = -velocity * self%per_distance(one)
            end if
         end do
         up(:n) = -friction%b(:n) * diagonal(:n) * self%per_a
         corner = (-(friction%stiffness + friction%trend) * velocity &
            & - sum(friction%b(:n) * down(:n))) * self%per_a
      end associate
   end subroutine derivatives

end module mesoslip_theory_rate_and_state
