!> A rigid slider on a spring, Eqs. S40 and S41, followed exactly.
!>
!> Under a linear law of the contact force the motion is that of a linear system with constant
!> coefficients. It is advanced by its Taylor series over steps so short that the series is exact to
!> rounding; nothing is a matter of step size. Events are short compared with any period of the
!> system, so a few terms do.
module mesoslip_sliders_rigid
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_schedule, only: schedule_type
   use mesoslip_watch, only: watch_type
   use mesoslip_sliders_base, only: motion_type, slider_type, exchange_slider, &
      & exchange_law
   implicit none
   private

   public :: slider_rigid_type, make_slider_rigid

   !> Terms of the series for shorter and longer steps, and the lengths of these in units of the
   !> fastest rate. What the series leaves out is less than 1e-16 of its two leading terms.
   integer, parameter :: few_terms = 6, some_terms = 8, many_terms = 10, most_terms = 17
   real(wp), parameter :: short_step = 3.0e-3_wp, middling_step = 3.5e-2_wp, &
      & long_step = 8.0e-2_wp, longest_step = 0.5_wp

   !> For the procedures of motion_series.inc
   integer, parameter :: longest_series = most_terms
   integer :: i
   real(wp), parameter :: inverse(longest_series + 2) = [(1.0_wp / i, i=1, longest_series + 2)]

   !> Greatest terms of a series that is reverted: what the reversion leaves out, 42 A_2**5,
   !> 28 A_2 A_3**2, 7 A_3 A_4 and the like, is below 1e-16.
   real(wp), parameter :: most_a_2 = 3.0e-4_wp, most_a_3 = 1.0e-7_wp, most_a_4 = 1.0e-10_wp, &
      & most_a_5 = 3.0e-14_wp
   !> Greatest terms with which the reversion is still right to some 1e-6
   real(wp), parameter :: fair_a_2 = 2.0e-2_wp, fair_a_3 = 1.0e-3_wp

   !> Gauss-Legendre points and weights on [0, 1], for the losses in middling and long steps.
   real(wp), parameter :: point_3(3) = [0.11270166537925831148_wp, 0.5_wp, &
      & 0.88729833462074168852_wp]
   real(wp), parameter :: weight_3(3) = [5.0_wp / 18.0_wp, 4.0_wp / 9.0_wp, 5.0_wp / 18.0_wp]
   real(wp), parameter :: point_4(4) = [0.069431844202973712388_wp, 0.33000947820757186760_wp, &
      & 0.66999052179242813240_wp, 0.93056815579702628761_wp]
   real(wp), parameter :: weight_4(4) = [0.17392742256872692869_wp, 0.32607257743127307131_wp, &
      & 0.32607257743127307131_wp, 0.17392742256872692869_wp]
   real(wp), parameter :: point_6(6) = [0.033765242898423986094_wp, 0.16939530676686774317_wp, &
      & 0.38069040695840154568_wp, 0.61930959304159845432_wp, 0.83060469323313225683_wp, &
      & 0.96623475710157601391_wp]
   real(wp), parameter :: weight_6(6) = [0.085662246189585172520_wp, 0.18038078652406930378_wp, &
      & 0.23395696728634552369_wp, 0.23395696728634552369_wp, 0.18038078652406930378_wp, &
      & 0.085662246189585172520_wp]

   !> Coefficients of the equation of motion, per mass of the slider.
   type :: system_type
      !> One over the mass [1/kg], (K + K_c)/M [1/s2], C/M [1/s], K/M [1/s2]
      real(wp) :: inverse_mass, stiffness, drag, spring
      !> Coefficients of the equation of the third order: 2 eta_S + C/M [1/s], (K + K_c)/M
      !> + eta_S C/M [1/s2], eta_S (K + K_c)/M [1/s3], and eta_S K/M times the drive's velocity
      !> with K/M times its acceleration; eta_S K/M times its acceleration
      real(wp) :: first, second, third, driving, driving_rate
      !> How far the drive is ahead of the slider at the start of a step [m], and its velocity [m/s]
      real(wp) :: drive_gap, drive_velocity
   end type system_type

   !> Velocity of the slider with derivatives, and the same of the damper.
   type :: motion_rates_type
      !> Velocity, acceleration and jerk of the slider
      real(wp) :: velocity, acceleration, jerk
      !> eta_S (V - W) [m/s2] and its rate [m/s3]
      real(wp) :: damper, damper_rate
   end type motion_rates_type

   !> A rigid slider on a spring.
   type, extends(slider_type) :: slider_rigid_type
      !> Mass M [kg], stiffness of the drive's spring K [N/m], damping rate eta_S [1/s]
      real(wp) :: mass = 1.0_wp, stiffness = 1.0_wp, damping = 0.0_wp
      !> Running mean of the velocity, W [m/s]
      real(wp) :: mean_velocity = 0.0_wp
      !> Contact force during the last advance, and displacement at its start [m]
      type(interface_law_type), private :: law
      real(wp), private :: start_displacement = 0.0_wp
      !> Taylor coefficients of the velocity in the time since then
      integer, private :: terms = few_terms
      real(wp), private :: series(0:most_terms - 1) = 0.0_wp
   contains
      procedure :: start
      procedure :: advance
      procedure :: run_ahead
      procedure :: observe
      procedure :: energy
      procedure :: exchange
   end type slider_rigid_type

contains

   !> Set up a rigid slider from named numbers.
   subroutine make_slider_rigid(slider, parameters, error)
      !> The slider
      class(slider_type), allocatable, intent(out) :: slider
      !> Mass, stiffness and damping
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or superfluous
      type(error_type), allocatable, intent(inout) :: error

      type(slider_rigid_type), allocatable :: self

      allocate (self)
      call parameters%take("mass", self%mass, error)
      call parameters%take("stiffness", self%stiffness, error)
      call parameters%take("damping", self%damping, error)
      call parameters%finish(error)
      if (allocated(error)) return
      self%runs_ahead = .true.
      call move_alloc(self, slider)
   end subroutine make_slider_rigid

   !> Put the slider at rest in balance with the contacts.
   subroutine start(self, law)
      !> The slider, its displacement zero
      class(slider_rigid_type), intent(inout) :: self
      !> Contact force at the start
      type(interface_law_type), intent(in) :: law

      self%law = law
      self%velocity = 0.0_wp
      self%mean_velocity = 0.0_wp
      self%start_displacement = self%displacement
      self%drive_displacement = (law%stiffness * self%displacement - law%offset) / self%stiffness
      self%series = 0.0_wp
   end subroutine start

   !> Move until the first end of a window, or less far.
   subroutine advance(self, law, window)
      !> The slider
      class(slider_rigid_type), intent(inout) :: self
      !> Contact force
      type(interface_law_type), intent(in) :: law
      !> Where the law holds
      type(window_type), intent(in) :: window

      call step_on(self, law, window)
   end subroutine advance

   !> Move through a schedule until it ends, or until a step is of interest.
   subroutine run_ahead(self, schedule, watch)
      !> The slider
      class(slider_rigid_type), intent(inout) :: self
      !> What happens on the way
      type(schedule_type), intent(inout) :: schedule
      !> What to stop at
      type(watch_type), intent(inout) :: watch

      do
         call step_on(self, schedule%law(), schedule%window(self%time))
         call watch%look(self%time, self%velocity, self%start_acceleration, self%acceleration)
         if (watch%is_caught .or. self%sense * schedule%direction < 0.0_wp) return
         call schedule%pass(self%time, self%displacement)
         if (schedule%is_over .or. watch%steps >= watch%most_steps) return
      end do
   end subroutine run_ahead

   !> One step: by the short way, which nearly all steps between two events can take, or by any.
   subroutine step_on(self, law, window)
      type(slider_rigid_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      type(system_type) :: system
      type(motion_rates_type) :: early
      logical :: is_done

      self%law = law
      self%step_time = self%time
      self%start_displacement = self%displacement

      system%inverse_mass = 1.0_wp / self%mass
      system%stiffness = (self%stiffness + law%stiffness) * system%inverse_mass
      system%drag = law%drag * system%inverse_mass
      system%spring = self%stiffness * system%inverse_mass
      system%first = 2.0_wp * self%damping + system%drag
      system%second = system%stiffness + system%drag * self%damping
      system%third = system%stiffness * self%damping
      system%drive_velocity = self%drive_velocity
      system%driving = self%damping * system%spring * self%drive_velocity
      system%driving_rate = 0.0_wp
      system%drive_gap = self%drive_displacement - self%displacement &
         & + self%drive_velocity * (self%time - self%drive_time)
      is_done = .false.
      if (abs(self%drive_acceleration) > 0.0_wp) then
         system%drive_velocity = self%drive_velocity_at(self%time)
         system%driving = system%spring * (self%damping * system%drive_velocity &
            & + self%drive_acceleration)
         system%driving_rate = self%damping * system%spring * self%drive_acceleration
         system%drive_gap = self%drive_at(self%time) - self%displacement
         early = rates(self, system, system%drive_gap)
      else
         early = rates(self, system, system%drive_gap)
         call glide(self, system, window, early, is_done)
      end if
      if (.not. is_done) call move_on(self, system, window, early)
   end subroutine step_on

   !> The short way: a step that a short series covers and in which the slider keeps its pace.
   !>
   !> With p the time in which the way to the next break would be made at the present velocity, the
   !> series of the displacement is way/V = t + A_2 t**2/p + A_3 t**3/p**2 + ..., and its reversion
   !> gives the time of the break without iteration, p (1 - A_2 + (2 A_2**2 - A_3) + ...), exact to
   !> rounding or nearly so. Other steps, one in eight in Klein's case, are left to move_on.
   subroutine glide(self, system, window, early, is_done)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Whether the step was made; if not, nothing has changed but the series
      logical, intent(out) :: is_done

      real(wp) :: target, way, pace, rest, passage, longest, step, change
      real(wp) :: a_2, a_3, a_4, a_5, inverse_pace, series(0:few_terms - 1)
      logical :: crosses, nears
      integer :: term

      is_done = .false.
      target = merge(window%upper, window%lower, early%velocity > 0.0_wp)
      pace = abs(early%velocity)
      way = sign(1.0_wp, early%velocity) * (target - self%displacement)
      rest = window%end_time - self%time
      if (.not. (pace > 0.0_wp .and. way > 0.0_wp .and. rest > 0.0_wp)) return

      nears = way < 2.0_wp * pace * rest
      inverse_pace = 1.0_wp / early%velocity
      longest = rest
      passage = rest
      if (nears) then
         passage = way * abs(inverse_pace)
         longest = min(rest, passage)
      end if
      ! Twice the sum of squares exceeds the square of the fastest rate.
      if (longest**2 * (2.0_wp * abs(system%stiffness) &
         & + 2.0_wp * (system%drag + 2.0_wp * self%damping)**2) > short_step**2) return

      call expand(system, early, few_terms, series)
      if (nears) then
         change = passage * inverse_pace
         a_2 = inverse(2) * series(1) * change
         change = change * passage
         a_3 = inverse(3) * series(2) * change
         change = change * passage
         a_4 = inverse(4) * series(3) * change
         a_5 = inverse(5) * series(4) * (change * passage)
         if (abs(a_2) > fair_a_2 .or. abs(a_3) > fair_a_3) return
         step = passage - passage * (a_2 - (2.0_wp * a_2**2 - a_3) &
            & + (a_2 * (5.0_wp * a_2**2 - 5.0_wp * a_3) + a_4) &
            & - (7.0_wp * a_2**2 * (2.0_wp * a_2**2 - 3.0_wp * a_3) + 6.0_wp * a_2 * a_4 &
            & + 3.0_wp * a_3**2 - a_5))
         if (abs(a_2) > most_a_2 .or. abs(a_3) > most_a_3 .or. abs(a_4) > most_a_4 &
            & .or. abs(a_5) > most_a_5) step = nearer(series, way, step)
         crosses = step <= rest
         if (.not. crosses) step = rest
      else
         ! Too far from any break to come to it in the time that is left.
         change = 0.0_wp
         do term = few_terms - 1, 1, -1
            change = (change + abs(series(term))) * rest
         end do
         if (.not. change < 0.5_wp * pace) return
         crosses = .false.
         step = rest
      end if

      is_done = .true.
      self%terms = few_terms
      self%series(:few_terms - 1) = series
      if (crosses) then
         way = target - self%displacement
         self%displacement = target
         self%time = self%time + step
      else
         way = integral(series, few_terms, step)
         self%displacement = self%displacement + way
         self%time = window%end_time
      end if
      self%velocity = horner(series, few_terms, step)
      ! A share of (rate times step)**2 of the balance of momentum: four terms do.
      call balance(self, system, early, step, way, second_integral(series, 4, step), few_terms)
   end subroutine glide

   !> A time of a crossing made exact by one step of Halley's method, the error of which is cubic.
   pure function nearer(series, way, time) result(better)
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      !> Size of the way
      real(wp), intent(in) :: way
      !> Time of the crossing, right to some 1e-6
      real(wp), intent(in) :: time
      real(wp) :: better

      real(wp) :: velocity, change

      velocity = horner(series, few_terms, time)
      change = (integral(series, few_terms, time) - sign(way, velocity)) / velocity
      better = time - change &
         & * (1.0_wp + change * (0.5_wp * series(1) + series(2) * time) / velocity)
   end function nearer

   !> Any way: a step as long as a series reaches, or shorter.
   subroutine move_on(self, system, window, early)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early

      real(wp) :: rate, step, gap
      logical :: ends

      rate = sqrt(abs(system%stiffness)) + system%drag + 2.0_wp * self%damping
      step = window%end_time - self%time
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
      end if

      if (.not. step > 0.0_wp) return
      ! The number of terms is a constant in each call: the compiler makes a copy for each.
      if (rate * step <= middling_step) then
         call move(self, system, window, early, step, ends, some_terms)
      else if (rate * step <= long_step) then
         call move(self, system, window, early, step, ends, many_terms)
      else
         call move(self, system, window, early, step, ends, most_terms)
      end if
   end subroutine move_on

   !> Any way: move for a step, or to the first end of the window or turning point within it.
   subroutine move(self, system, window, early, longest, ends, terms)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Length of the step [s]
      real(wp), intent(in) :: longest
      !> Whether the step comes to the end of the window's time
      logical, intent(in) :: ends
      !> Terms of the series
      integer, intent(in) :: terms

      real(wp) :: step, way, change, reach, target, sense, series(0:most_terms - 1)
      logical :: crosses, turns
      integer :: term

      call expand(system, early, terms, series)
      self%terms = terms
      self%series(:terms - 1) = series(:terms - 1)

      step = longest
      crosses = .false.
      turns = .false.
      target = 0.0_wp
      change = 0.0_wp
      do term = terms - 1, 1, -1
         change = (change + abs(series(term))) * step
      end do
      reach = (abs(series(0)) + change) * step
      if (.not. reach < min(window%upper - self%displacement, &
         & self%displacement - window%lower)) then
         call first_end(series, terms, window%upper - self%displacement, &
            & window%lower - self%displacement, change, step, crosses, turns, sense)
         target = merge(window%upper, window%lower, sense > 0.0_wp)
      end if

      way = integral(series, terms, step)
      if (crosses) then
         self%displacement = target
      else
         self%displacement = self%displacement + way
      end if
      if (ends .and. .not. (crosses .or. turns) .and. step >= longest) then
         self%time = window%end_time
      else
         self%time = self%time + step
      end if
      self%velocity = horner(series, terms, step)
      if (turns) self%velocity = 0.0_wp
      call balance(self, system, early, step, way, second_integral(series, terms, step), terms)
   end subroutine move

   !> The mean velocity after a step, and the balance of energy.
   subroutine balance(self, system, early, step, way, swept, terms)
      !> The slider, where it is at the end of the step
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Length of the step [s], way in it [m], and the integral of the way over the time [m s]
      real(wp), intent(in) :: step, way, swept
      !> Terms of the series
      integer, intent(in) :: terms

      real(wp) :: drive_gap, extension
      type(motion_rates_type) :: late

      if (abs(self%velocity) > 0.0_wp) self%sense = sign(1.0_wp, self%velocity)

      extension = step * (system%drive_gap + 0.5_wp * system%drive_velocity * step) - swept
      if (abs(self%drive_acceleration) > 0.0_wp) then
         extension = extension + self%drive_acceleration * step**3 / 6.0_wp
         call self%stage_impulse%add(self%stiffness * extension)
         call self%earlier_work%add(self%stiffness * (system%drive_velocity * extension &
            & + self%drive_acceleration * (step**2 * (0.5_wp * system%drive_gap + step &
            & * (system%drive_velocity / 3.0_wp + 0.125_wp * self%drive_acceleration * step)) &
            & - lever(self%series, terms, step))))
         drive_gap = self%drive_at(self%time) - self%displacement
      else
         call self%impulse%add(self%stiffness * extension)
         drive_gap = self%drive_displacement - self%displacement &
            & + self%drive_velocity * (self%time - self%drive_time)
      end if
      ! From the balance of momentum, M dV + M dW = the impulse of spring and contacts.
      if (self%damping > 0.0_wp) then
         self%mean_velocity = self%mean_velocity - (self%velocity - early%velocity) &
            & + system%spring * extension - system%drag * way + system%inverse_mass * (step &
            & * (self%law%offset - self%law%stiffness * self%start_displacement) &
            & - self%law%stiffness * swept)
      end if

      late = rates(self, system, drive_gap)
      self%acceleration = late%acceleration
      self%start_acceleration = early%acceleration
      call add_losses(self, early, late, step, terms)
   end subroutine balance

   !> Velocity and its derivatives, from the equation of motion.
   pure function rates(self, system, drive_gap) result(motion)
      type(slider_rigid_type), intent(in) :: self
      type(system_type), intent(in) :: system
      !> How far the drive is ahead of the slider [m]
      real(wp), intent(in) :: drive_gap
      type(motion_rates_type) :: motion

      motion%velocity = self%velocity
      motion%damper = self%damping * (self%velocity - self%mean_velocity)
      motion%acceleration = system%spring * drive_gap - system%inverse_mass &
         & * (self%law%stiffness * self%displacement - self%law%offset) &
         & - system%drag * self%velocity - motion%damper
      motion%damper_rate = self%damping * (motion%acceleration - motion%damper)
      motion%jerk = system%spring * system%drive_velocity - system%stiffness * self%velocity &
         & - system%drag * motion%acceleration - motion%damper_rate
   end function rates

   !> Taylor coefficients of the velocity.
   !>
   !> Without its running mean, S40 with S41 is an equation of the third order for the velocity.
   pure subroutine expand(system, early, terms, series)
      type(system_type), intent(in) :: system
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      integer, intent(in) :: terms
      !> The coefficients
      real(wp), intent(out) :: series(0:terms - 1)

      real(wp) :: driving
      integer :: term

      driving = system%driving
      series(0) = early%velocity
      series(1) = early%acceleration
      series(2) = 0.5_wp * early%jerk
      do term = 3, terms - 1
         series(term) = inverse(term) * ((driving - system%third * series(term - 3)) &
            & * (inverse(term - 1) * inverse(term - 2)) &
            & - (system%second * inverse(term - 1)) * series(term - 2) &
            & - system%first * series(term - 1))
         driving = 0.0_wp
         if (term == 3) driving = system%driving_rate
      end do
   end subroutine expand

   !> Add the losses of a step to the energy balance: the integrals of C V**2 and M eta_S (V - W) V.
   subroutine add_losses(self, early, late, step, terms)
      type(slider_rigid_type), intent(inout) :: self
      !> The motion at both ends
      type(motion_rates_type), intent(in) :: early, late
      !> Length of the step [s]
      real(wp), intent(in) :: step
      integer, intent(in) :: terms

      real(wp) :: square, damped

      select case (terms)
      case (few_terms)
         ! From values and slopes at both ends: the error is (2 step)**4/720, in units of the
         ! fastest rate, of terms that are a small part of the balance.
         square = step * (0.5_wp * (early%velocity**2 + late%velocity**2) &
            & + step * (1.0_wp / 6.0_wp) * (early%velocity * early%acceleration &
            & - late%velocity * late%acceleration))
         damped = step * (0.5_wp * (early%damper * early%velocity + late%damper * late%velocity) &
            & + step * (1.0_wp / 12.0_wp) * (early%damper_rate * early%velocity &
            & + early%damper * early%acceleration - late%damper_rate * late%velocity &
            & - late%damper * late%acceleration))
      case (some_terms)
         call integrate_losses(self, early%damper, step, terms, point_3, weight_3, square, damped)
      case (many_terms)
         call integrate_losses(self, early%damper, step, terms, point_4, weight_4, square, damped)
      case default
         call integrate_losses(self, early%damper, step, terms, point_6, weight_6, square, damped)
      end select
      call self%drag_loss%add(self%law%drag * square)
      call self%damping_loss%add(self%mass * damped)
   end subroutine add_losses

   !> Integrals of V**2 and eta_S (V - W) V over a step by a Gauss rule.
   pure subroutine integrate_losses(self, damper, step, terms, point, weight, square, damped)
      type(slider_rigid_type), intent(in) :: self
      !> eta_S (V - W) at the start [m/s2], length of the step [s]
      real(wp), intent(in) :: damper, step
      integer, intent(in) :: terms
      real(wp), intent(in), contiguous :: point(:), weight(:)
      real(wp), intent(out) :: square, damped

      real(wp) :: velocity, series(0:most_terms - 1)
      integer :: node, term

      series(0) = damper
      do term = 1, terms - 1
         series(term) = self%damping * (self%series(term) - series(term - 1) * inverse(term))
      end do
      square = 0.0_wp
      damped = 0.0_wp
      do node = 1, size(point)
         velocity = horner(self%series, terms, point(node) * step)
         square = square + step * weight(node) * velocity**2
         damped = damped + step * weight(node) * velocity &
            & * horner(series, terms, point(node) * step)
      end do
   end subroutine integrate_losses

   !> The motion at a time of the last advance.
   pure function observe(self, time) result(motion)
      !> The slider
      class(slider_rigid_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> The motion
      type(motion_type) :: motion

      real(wp) :: displacement, drive, step

      step = time - self%step_time
      drive = self%drive_at(time)
      ! As in advance, the number of terms is a constant in each call.
      select case (self%terms)
      case (few_terms)
         call evaluate(self%series, few_terms, step, displacement, motion%velocity)
      case (some_terms)
         call evaluate(self%series, some_terms, step, displacement, motion%velocity)
      case (many_terms)
         call evaluate(self%series, many_terms, step, displacement, motion%velocity)
      case default
         call evaluate(self%series, most_terms, step, displacement, motion%velocity)
      end select
      displacement = self%start_displacement + displacement
      motion%time = time
      motion%drive_displacement = self%origin + drive
      motion%displacement = self%origin + displacement
      motion%spring_force = self%stiffness * (drive - displacement)
      motion%elastic_force = motion%spring_force
      motion%pulled_velocity = motion%velocity
      motion%contact_force = self%law%stiffness * displacement - self%law%offset &
         & + self%law%drag * motion%velocity
   end function observe

   !> Way and velocity from the series of the velocity.
   pure subroutine evaluate(series, terms, time, way, velocity)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp), intent(out) :: way, velocity

      way = integral(series, terms, time)
      velocity = horner(series, terms, time)
   end subroutine evaluate

   !> Kinetic energy and that of the drive's spring.
   pure function energy(self)
      !> The slider
      class(slider_rigid_type), intent(in) :: self
      !> Energy [J]
      real(wp) :: energy

      energy = 0.5_wp * self%mass * self%velocity**2 &
         & + 0.5_wp * self%stiffness * (self%drive_at(self%time) - self%displacement)**2
   end function energy

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The slider
      class(slider_rigid_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      real(wp), allocatable :: series(:)

      call archive%section("rigid slider")
      call exchange_slider(self, archive)
      call archive%exchange("mean_velocity", self%mean_velocity)
      call exchange_law(self%law, archive)
      call archive%exchange("start_displacement", self%start_displacement)
      call archive%exchange("terms", self%terms)
      series = self%series
      call archive%exchange("series", series)
      if (size(series) == size(self%series)) self%series = series
   end subroutine exchange

   !> Integral of the integral of a series from zero.
   pure function second_integral(series, terms, time) result(value)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp) :: value

      integer :: term
      real(wp) :: twice(0:longest_series - 1)

      do term = 0, terms - 1
         twice(term) = series(term) * (inverse(term + 1) * inverse(term + 2))
      end do
      value = time**2 * horner(twice, terms, time)
   end function second_integral

   !> Integral of the way, the integral of a series from zero, times the time.
   pure function lever(series, terms, time) result(value)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp) :: value

      integer :: term

      value = 0.0_wp
      do term = terms - 1, 0, -1
         value = value * time + series(term) * (inverse(term + 1) / (term + 3))
      end do
      value = value * time**3
   end function lever

   include "motion_series.inc"

end module mesoslip_sliders_rigid
