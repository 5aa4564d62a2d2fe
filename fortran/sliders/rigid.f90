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
   use mesoslip_step_filter, only: step_filter_type
   use mesoslip_sliders_base, only: motion_type, slider_type, exchange_slider, exchange_law
   use mesoslip_sliders_scheduled, only: scheduled_slider_type
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
   integer, parameter :: most_nodes = 6
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

   !> Coefficients of the equation of motion, per mass of the slider:
   !> V' = spring gap - (K_c X - S)/M - drag V - D and D' = eta_S (V' - D), with D = eta_S (V - W).
   type :: system_type
      !> One over the mass [1/kg], and K/M [1/s2]
      real(wp) :: inverse_mass, spring
      !> (K + K_c)/M [1/s2], C/M [1/s], and K/M times the drive's velocity at the start of a step
      !> [m/s3] and times its acceleration [m/s4]
      real(wp) :: stiffness, drag, driving, driving_rate
      !> How far the drive is ahead of the slider at the start of a step [m], and its velocity [m/s]
      real(wp) :: drive_gap, drive_velocity
   end type system_type

   !> Velocity and acceleration of the slider, and the same of the damper.
   type :: motion_rates_type
      !> Velocity [m/s] and acceleration [m/s2]
      real(wp) :: velocity, acceleration
      !> D = eta_S (V - W) [m/s2] and its rate [m/s3]
      real(wp) :: damper, damper_rate
   end type motion_rates_type

   !> A rigid slider on a spring.
   type, extends(scheduled_slider_type) :: slider_rigid_type
      !> Mass M [kg], stiffness of the drive's spring K [N/m], damping rate eta_S [1/s]
      real(wp) :: mass = 1.0_wp, stiffness = 1.0_wp, damping = 0.0_wp
      !> Deceleration by the damper, D = eta_S (V - W), W being the mean velocity [m/s2]
      real(wp) :: damper = 0.0_wp
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
      self%damper = 0.0_wp
      self%start_displacement = self%displacement
      self%drive%value = (law%stiffness * self%displacement - law%offset) / self%stiffness
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

      self%law = law
      call step_on(self, constants(self), window)
   end subroutine advance

   !> Move through a schedule until it ends, or until a step is of interest.
   subroutine run_ahead(self, schedule, filter)
      !> The slider
      class(slider_rigid_type), intent(inout) :: self
      !> What happens on the way
      type(schedule_type), intent(inout) :: schedule
      !> Which steps are of interest; the slider stops after one
      type(step_filter_type), intent(inout) :: filter

      type(system_type) :: system

      system = constants(self)
      do
         self%law = schedule%law()
         call step_on(self, system, schedule%window(self%time))
         call filter%examine(self%time, self%velocity, self%start_acceleration, self%acceleration)
         if (filter%is_selected .or. self%direction * schedule%direction < 0.0_wp) return
         call schedule%pass(self%time, self%displacement)
         if (schedule%is_over .or. filter%steps >= filter%max_steps) return
      end do
   end subroutine run_ahead

   !> What in the equation of motion does not change with the contacts.
   pure function constants(self) result(system)
      type(slider_rigid_type), intent(in) :: self
      type(system_type) :: system

      system%inverse_mass = 1.0_wp / self%mass
      system%spring = self%stiffness * system%inverse_mass
      system%drive_velocity = self%drive%rate
      system%driving = system%spring * self%drive%rate
      system%driving_rate = 0.0_wp
      system%stiffness = 0.0_wp
      system%drag = 0.0_wp
      system%drive_gap = 0.0_wp
   end function constants

   !> One step: by the short way, which nearly all steps between two events can take, or by any.
   subroutine step_on(self, constant, window)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: constant
      type(window_type), intent(in) :: window

      type(system_type) :: system
      type(motion_rates_type) :: early
      logical :: is_done

      self%step_time = self%time
      self%start_displacement = self%displacement

      system = constant
      system%stiffness = system%spring + self%law%stiffness * system%inverse_mass
      system%drag = self%law%drag * system%inverse_mass
      is_done = .false.
      if (abs(self%drive%acceleration) > 0.0_wp) then
         system%drive_velocity = self%drive%rate_at(self%time)
         system%driving = system%spring * system%drive_velocity
         system%driving_rate = system%spring * self%drive%acceleration
         system%drive_gap = self%drive%at(self%time) - self%displacement
         early = rates(self, system, system%drive_gap)
      else
         system%drive_gap = uniform_gap(self)
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
   !> rounding or nearly so. Other steps, one in eight in Klein's case, are left to move_on, as are
   !> those under a drive that speeds up or slows down.
   subroutine glide(self, system, window, early, is_done)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Whether the step was made; if not, nothing has changed
      logical, intent(out) :: is_done

      real(wp) :: target, way, pace, rest, passage, longest, step, change, square
      real(wp) :: inverse_pace, a_2, a_3, a_4, a_5, velocity_loss, damper_loss
      real(wp) :: jerk, snap, crackle, pop, damper_2, damper_3, damper_4
      type(motion_rates_type) :: late
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

      ! Derivatives of acceleration and damper, each from the equation of motion, the damper put in.
      associate (loss => system%drag + self%damping)
         jerk = (system%driving - system%stiffness * early%velocity &
            & + self%damping * early%damper) - loss * early%acceleration
         damper_2 = self%damping * (jerk - early%damper_rate)
         snap = (self%damping * early%damper_rate - system%stiffness * early%acceleration) &
            & - loss * jerk
         damper_3 = self%damping * (snap - damper_2)
         crackle = (self%damping * damper_2 - system%stiffness * jerk) - loss * snap
         damper_4 = self%damping * (crackle - damper_3)
         pop = (self%damping * damper_3 - system%stiffness * snap) - loss * crackle
      end associate
      self%series(0) = early%velocity
      self%series(1) = early%acceleration
      self%series(2) = inverse(2) * jerk
      self%series(3) = inverse(6) * snap
      self%series(4) = (1.0_wp / 24.0_wp) * crackle
      self%series(5) = (1.0_wp / 120.0_wp) * pop

      if (nears) then
         change = passage * inverse_pace
         a_2 = early%acceleration * (inverse(2) * change)
         a_3 = jerk * (inverse(6) * change * passage)
         a_4 = snap * ((1.0_wp / 24.0_wp) * change * passage**2)
         a_5 = crackle * ((1.0_wp / 120.0_wp) * change * passage * passage**2)
         if (abs(a_2) > fair_a_2 .or. abs(a_3) > fair_a_3) return
         step = passage - passage * (a_2 - (2.0_wp * a_2**2 - a_3) &
            & + (a_2 * (5.0_wp * a_2**2 - 5.0_wp * a_3) + a_4) &
            & - (7.0_wp * a_2**2 * (2.0_wp * a_2**2 - 3.0_wp * a_3) + 6.0_wp * a_2 * a_4 &
            & + 3.0_wp * a_3**2 - a_5))
         if (abs(a_2) > most_a_2 .or. abs(a_3) > most_a_3 .or. abs(a_4) > most_a_4 &
            & .or. abs(a_5) > most_a_5) step = nearer(self%series, way, step)
         crosses = step <= rest
         if (.not. crosses) step = rest
      else
         ! Too far from any break to come to it in the time that is left.
         change = 0.0_wp
         do term = few_terms - 1, 1, -1
            change = (change + abs(self%series(term))) * rest
         end do
         if (.not. change < 0.5_wp * pace) return
         crosses = .false.
         step = rest
      end if

      is_done = .true.
      self%terms = few_terms
      square = step**2
      if (crosses) then
         self%displacement = target
         self%time = self%time + step
      else
         self%displacement = self%displacement + step * (early%velocity &
            & + inverse(2) * step * (early%acceleration + inverse(3) * step * jerk) &
            & + (1.0_wp / 24.0_wp) * step * square * (snap + inverse(5) * step * crackle &
            & + (1.0_wp / 30.0_wp) * square * pop))
         self%time = window%end_time
      end if
      self%velocity = early%velocity + (step * early%acceleration + inverse(2) * square &
         & * ((jerk + inverse(3) * step * snap) + inverse(12) * square &
         & * (crackle + inverse(5) * step * pop)))
      self%damper = early%damper + (step * early%damper_rate + inverse(2) * square &
         & * ((damper_2 + inverse(3) * step * damper_3) + inverse(12) * square * damper_4))
      ! A share of (rate times step)**2 of the balance: four terms do.
      call pull(self, system, step, inverse(2) * square * (early%velocity &
         & + inverse(3) * step * (early%acceleration + inverse(4) * step * (jerk &
         & + inverse(5) * step * snap))))
      call arrive(self, system, early, uniform_gap(self), late)
      ! From values and slopes at both ends: the error is (2 step)**4/720, in units of the
      ! fastest rate, of terms that are a small part of the balance.
      velocity_loss = step * (0.5_wp * (early%velocity**2 + late%velocity**2) &
         & + inverse(6) * step * (early%velocity * early%acceleration &
         & - late%velocity * late%acceleration))
      damper_loss = step * (0.5_wp * (early%damper * early%velocity + late%damper * late%velocity) &
         & + inverse(12) * step * (early%damper_rate * early%velocity &
         & + early%damper * early%acceleration - late%damper_rate * late%velocity &
         & - late%damper * late%acceleration))
      call self%drag_loss%add(self%law%drag * velocity_loss)
      call self%damping_loss%add(self%mass * damper_loss)
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

      real(wp) :: step, change, reach, target, direction
      real(wp) :: series(0:most_terms - 1), damper(0:most_terms - 1)
      type(motion_rates_type) :: late
      logical :: crosses, turns
      integer :: term

      call expand(system, self%damping, early, terms, series, damper)
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
            & window%lower - self%displacement, change, step, crosses, turns, direction)
         target = merge(window%upper, window%lower, direction > 0.0_wp)
      end if

      if (crosses) then
         self%displacement = target
      else
         self%displacement = self%displacement + integral(series, terms, step)
      end if
      if (ends .and. .not. (crosses .or. turns) .and. step >= longest) then
         self%time = window%end_time
      else
         self%time = self%time + step
      end if
      self%velocity = horner(series, terms, step)
      if (turns) self%velocity = 0.0_wp
      self%damper = horner(damper, terms, step)
      if (abs(self%drive%acceleration) > 0.0_wp) then
         call pull_unevenly(self, system, step, second_integral(series, terms, step), &
            & lever(series, terms, step))
         call arrive(self, system, early, self%drive%at(self%time) - self%displacement, late)
      else
         call pull(self, system, step, second_integral(series, terms, step))
         call arrive(self, system, early, uniform_gap(self), late)
      end if
      select case (terms)
      case (some_terms)
         call add_losses(self, damper, step, terms, point_3, weight_3)
      case (many_terms)
         call add_losses(self, damper, step, terms, point_4, weight_4)
      case default
         call add_losses(self, damper, step, terms, point_6, weight_6)
      end select
   end subroutine move

   !> Add the drive's impulse of a step to the balance, its velocity being constant.
   subroutine pull(self, system, step, swept)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      !> Length of the step [s], and integral of the way over the time [m s]
      real(wp), intent(in) :: step, swept

      call self%drive%impulse%add(self%stiffness &
         & * (step * (system%drive_gap + 0.5_wp * self%drive%rate * step) - swept))
   end subroutine pull

   !> Add the drive's impulse and work of a step to the balance, under an acceleration.
   subroutine pull_unevenly(self, system, step, swept, moment)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      !> Length of the step [s], integrals of the way [m s] and of the way times the time [m s2]
      real(wp), intent(in) :: step, swept, moment

      real(wp) :: extension

      associate (velocity => system%drive_velocity, acceleration => self%drive%acceleration)
         extension = step * (system%drive_gap + step * (0.5_wp * velocity &
            & + inverse(6) * acceleration * step)) - swept
         call self%drive%earlier_impulse%add(self%stiffness * extension)
         call self%drive%earlier_work%add(self%stiffness * (velocity * extension + acceleration &
            & * (step**2 * (0.5_wp * system%drive_gap + step &
            & * (inverse(3) * velocity + 0.125_wp * acceleration * step)) - moment)))
      end associate
   end subroutine pull_unevenly

   !> What there is to note at the end of any step.
   subroutine arrive(self, system, early, drive_gap, late)
      !> The slider, where it is at the end of the step
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> How far the drive is ahead of the slider at the end of the step [m]
      real(wp), intent(in) :: drive_gap
      !> The motion at the end of the step
      type(motion_rates_type), intent(out) :: late

      if (abs(self%velocity) > 0.0_wp) self%direction = sign(1.0_wp, self%velocity)
      late = rates(self, system, drive_gap)
      self%acceleration = late%acceleration
      self%start_acceleration = early%acceleration
   end subroutine arrive

   !> How far a drive of constant velocity is ahead of the slider.
   pure function uniform_gap(self) result(drive_gap)
      type(slider_rigid_type), intent(in) :: self
      !> The gap [m]
      real(wp) :: drive_gap

      drive_gap = self%drive%value - self%displacement &
         & + self%drive%rate * (self%time - self%drive%time)
   end function uniform_gap

   !> Velocity and damper with their rates, from the equation of motion.
   pure function rates(self, system, drive_gap) result(motion)
      type(slider_rigid_type), intent(in) :: self
      type(system_type), intent(in) :: system
      !> How far the drive is ahead of the slider [m]
      real(wp), intent(in) :: drive_gap
      type(motion_rates_type) :: motion

      motion%velocity = self%velocity
      motion%damper = self%damper
      motion%acceleration = ((system%spring * drive_gap - system%inverse_mass &
         & * (self%law%stiffness * self%displacement - self%law%offset)) &
         & - system%drag * self%velocity) - self%damper
      motion%damper_rate = self%damping * (motion%acceleration - motion%damper)
   end function rates

   !> Taylor coefficients of the velocity and of the damper, from the equation of motion.
   pure subroutine expand(system, damping, early, terms, series, damper)
      type(system_type), intent(in) :: system
      !> Damping rate [1/s]
      real(wp), intent(in) :: damping
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      integer, intent(in) :: terms
      !> The coefficients
      real(wp), intent(out) :: series(0:terms - 1), damper(0:terms - 1)

      real(wp) :: driving
      integer :: term

      driving = system%driving
      series(0) = early%velocity
      series(1) = early%acceleration
      damper(0) = early%damper
      damper(1) = early%damper_rate
      do term = 2, terms - 1
         series(term) = inverse(term) * (inverse(term - 1) * (driving &
            & - system%stiffness * series(term - 2)) - system%drag * series(term - 1) &
            & - damper(term - 1))
         damper(term) = damping * (series(term) - inverse(term) * damper(term - 1))
         driving = 0.0_wp
         if (term == 2) driving = system%driving_rate
      end do
   end subroutine expand

   !> Add the losses of a step to the energy balance, the integrals of C V**2 and M D V, by a Gauss
   !> rule.
   subroutine add_losses(self, damper, step, terms, point, weight)
      type(slider_rigid_type), intent(inout) :: self
      !> Coefficients of the damper
      real(wp), intent(in) :: damper(0:)
      !> Length of the step [s]
      real(wp), intent(in) :: step
      integer, intent(in) :: terms
      real(wp), intent(in), contiguous :: point(:), weight(:)

      real(wp) :: velocity(most_nodes), deceleration(most_nodes), velocity_loss, damper_loss
      integer :: term, node

      ! Node by node in the inner loop: they do not wait for each other.
      velocity = 0.0_wp
      deceleration = 0.0_wp
      do term = terms - 1, 0, -1
         do node = 1, size(point)
            velocity(node) = velocity(node) * (point(node) * step) + self%series(term)
            deceleration(node) = deceleration(node) * (point(node) * step) + damper(term)
         end do
      end do
      velocity_loss = 0.0_wp
      damper_loss = 0.0_wp
      do node = 1, size(point)
         velocity_loss = velocity_loss + weight(node) * velocity(node)**2
         damper_loss = damper_loss + weight(node) * velocity(node) * deceleration(node)
      end do
      call self%drag_loss%add(self%law%drag * (step * velocity_loss))
      call self%damping_loss%add(self%mass * (step * damper_loss))
   end subroutine add_losses

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
      drive = self%drive%at(time)
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
         & + 0.5_wp * self%stiffness * (self%drive%at(self%time) - self%displacement)**2
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
      call archive%exchange("damper", self%damper)
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
