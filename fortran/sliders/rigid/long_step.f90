!> Steps of a rigid slider of any length: by a series as long as the step needs.
module mesoslip_sliders_rigid_long_step
   use mesoslip_interface_law, only: window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_hazard_clock, only: advance_clocks
   use mesoslip_sliders_motion_series, only: first_end, horner, integral, inverse, lever, point_6, &
      & second_integral, weight_6
   use mesoslip_sliders_rigid_state, only: arrive, long_terms, many_terms, motion_rates_type, &
      & pull, pull_unevenly, rigid_state_type, some_terms, system_type, uniform_gap
   implicit none
   private

   public :: take_long_step

   !> Lengths of middling and long steps in units of the fastest rate
   real(wp), parameter :: middling_step = 3.5e-2_wp, long_step = 8.0e-2_wp

   !> Gauss-Legendre points and weights on [0, 1], for the losses in middling steps.
   integer, parameter :: max_nodes = 6
   real(wp), parameter :: point_3(3) = [0.11270166537925831148_wp, 0.5_wp, &
      & 0.88729833462074168852_wp]
   real(wp), parameter :: weight_3(3) = [5.0_wp / 18.0_wp, 4.0_wp / 9.0_wp, 5.0_wp / 18.0_wp]
   real(wp), parameter :: point_4(4) = [0.069431844202973712388_wp, 0.33000947820757186760_wp, &
      & 0.66999052179242813240_wp, 0.93056815579702628761_wp]
   real(wp), parameter :: weight_4(4) = [0.17392742256872692869_wp, 0.32607257743127307131_wp, &
      & 0.32607257743127307131_wp, 0.17392742256872692869_wp]

contains

   !> A step as long as a series reaches, or shorter.
   subroutine take_long_step(self, system, window, early)
      class(rigid_state_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early

      real(wp) :: rate, step, gap
      logical :: ends

      rate = sqrt(abs(system%stiffness)) + system%drag + 2.0_wp * self%damping
      step = window%end_time - self%time
      ends = step * rate <= window%max_phase
      if (.not. ends) step = window%max_phase / rate
      ! Most steps end at a break: a longer series is not needed.
      if (self%velocity > 0.0_wp) then
         gap = window%upper - self%displacement
      else
         gap = self%displacement - window%lower
      end if
      if (gap < 0.5_wp * abs(self%velocity) * step) then
         step = 2.0_wp * gap / abs(self%velocity)
         ends = .false.
      end if

      if (.not. step > 0.0_wp) then
         ! A step without length is observed at its start.
         self%series = 0.0_wp
         self%series(:1) = [early%velocity, early%acceleration]
         self%start_acceleration = early%acceleration
         self%acceleration = early%acceleration
         return
      end if
      ! The number of terms is a constant in each call: the compiler makes a copy for each.
      if (rate * step <= middling_step) then
         call move(self, system, window, early, step, ends, some_terms)
      else if (rate * step <= long_step) then
         call move(self, system, window, early, step, ends, many_terms)
      else
         call move(self, system, window, early, step, ends, long_terms)
      end if
   end subroutine take_long_step

   !> Move for a step, or to the first end of the window or turning point within it.
   subroutine move(self, system, window, early, longest, ends, terms)
      class(rigid_state_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Length of the step [s]
      real(wp), intent(in) :: longest
      !> Whether the step reaches the end of the window's time
      logical, intent(in) :: ends
      !> Terms of the series
      integer, intent(in) :: terms

      real(wp) :: step, change, reach, target, direction, tick
      real(wp) :: series(0:long_terms - 1), damper(0:long_terms - 1)
      type(motion_rates_type) :: late
      logical :: crosses, turns, is_due
      integer :: term

      call expand(system, self%damping, early, terms, series, damper)
      ! Twice the spacing of times at most, and that without a call.
      if (abs(series(0)) <= (epsilon(tick) * self%time)**2 * abs(series(2))) then
         tick = spacing(self%time)
         if (abs(series(0)) + tick * abs(series(1)) <= tick**2 * abs(series(2))) then
            ! The drive turns the slider before the time can grow: it is at rest and in balance.
            series(:1) = 0.0_wp
         end if
      end if
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
      if (self%has_clocks) then
         call advance_clocks(self%clock, series, terms, step, is_due)
         crosses = crosses .and. .not. is_due
         turns = turns .and. .not. is_due
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
         call pull(self, system%drive_gap, step, second_integral(series, terms, step))
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

   !> Add the losses of a step to the energy balance, the integrals of C V**2 and M D V.
   subroutine add_losses(self, damper, step, terms, point, weight)
      class(rigid_state_type), intent(inout) :: self
      !> Coefficients of the damper
      real(wp), intent(in) :: damper(0:)
      !> Length of the step [s]
      real(wp), intent(in) :: step
      integer, intent(in) :: terms
      real(wp), intent(in), contiguous :: point(:), weight(:)

      real(wp) :: velocity(max_nodes), deceleration(max_nodes), velocity_loss, damper_loss
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

end module mesoslip_sliders_rigid_long_step
