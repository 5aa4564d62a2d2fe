!> Short steps of a rigid slider, in which it keeps its pace: seven in eight, in Klein's case.
!>
!> With p the time in which the distance to the next break would be made at the present velocity,
!> the series of the displacement is distance/V = t + A_2 t**2/p + A_3 t**3/p**2 + ..., and its
!> reversion gives the time of the break without iteration, p (1 - A_2 + (2 A_2**2 - A_3) + ...),
!> exact to rounding or nearly so. Other steps are for the module of long steps, as are those under
!> a drive that accelerates.
module mesoslip_sliders_rigid_short_step
   use mesoslip_interface_law, only: window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_hazard_clock, only: advance_clocks
   use mesoslip_sliders_motion_series, only: horner, integral, inverse
   use mesoslip_sliders_rigid_state, only: arrive, few_terms, motion_rates_type, pull, &
      & rigid_state_type, system_type, uniform_gap
   implicit none
   private

   public :: try_short_step

   !> Maximum duration of a short step in units of the fastest rate
   real(wp), parameter :: max_step = 3.0e-3_wp

   !> Maximum terms of a series that is reverted: what the reversion leaves out, 42 A_2**5,
   !> 28 A_2 A_3**2, 7 A_3 A_4 and the like, is below 1e-16.
   real(wp), parameter :: max_a_2 = 3.0e-4_wp, max_a_3 = 1.0e-7_wp, max_a_4 = 1.0e-10_wp, &
      & max_a_5 = 3.0e-14_wp
   !> Maximum terms with which the reversion is still right to some 1e-6
   real(wp), parameter :: fair_a_2 = 2.0e-2_wp, fair_a_3 = 1.0e-3_wp

   !> Derivatives of the acceleration, from the first to the fourth, and of the damper, from the
   !> second to the fourth.
   type :: derivatives_type
      real(wp) :: jerk, snap, crackle, pop, damper_2, damper_3, damper_4
   end type derivatives_type

contains

   !> Make a short step, if a short series covers it and the slider keeps its pace in it.
   subroutine try_short_step(self, system, window, early, is_done)
      !> The slider
      class(rigid_state_type), intent(inout) :: self
      !> Its equation of motion
      type(system_type), intent(in) :: system
      !> Where the contact force holds
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Whether the step was made; if not, the motion has not changed
      logical, intent(out) :: is_done

      real(wp) :: target, distance, pace, rest, passage, longest, step, change, inverse_pace, &
         & end_time
      type(derivatives_type) :: derivatives
      logical :: crosses, nears, is_due
      integer :: term

      is_done = .false.
      target = merge(window%upper, window%lower, early%velocity > 0.0_wp)
      pace = abs(early%velocity)
      distance = sign(1.0_wp, early%velocity) * (target - self%displacement)
      rest = window%end_time - self%time
      if (.not. (pace > 0.0_wp .and. distance > 0.0_wp .and. rest > 0.0_wp)) return

      nears = distance < 2.0_wp * pace * rest
      inverse_pace = 1.0_wp / early%velocity
      longest = rest
      passage = rest
      if (nears) then
         passage = distance * abs(inverse_pace)
         longest = min(rest, passage)
      end if
      ! Twice the sum of squares exceeds the square of the fastest rate.
      if (longest**2 * (2.0_wp * abs(system%stiffness) &
         & + 2.0_wp * (system%drag + 2.0_wp * self%damping)**2) > max_step**2) return

      call derive(self, system, early, derivatives)
      if (nears) then
         call revert(self%series, early, derivatives, distance, passage, inverse_pace, step, &
            & is_done)
         if (.not. is_done) return
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
      end_time = window%end_time
      if (self%has_clocks) then
         call advance_clocks(self%clock, self%series, few_terms, step, is_due)
         if (is_due) then
            crosses = .false.
            end_time = self%time + step
         end if
      end if
      call move(self, system, end_time, early, derivatives, step, crosses, target)
   end subroutine try_short_step

   !> Derivatives of acceleration and damper, each from the equation of motion, the damper put in,
   !> and the series of the velocity.
   subroutine derive(self, system, early, derivatives)
      class(rigid_state_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      type(derivatives_type), intent(out) :: derivatives

      associate (loss => system%drag + self%damping, d => derivatives)
         d%jerk = (system%driving - system%stiffness * early%velocity &
            & + self%damping * early%damper) - loss * early%acceleration
         d%damper_2 = self%damping * (d%jerk - early%damper_rate)
         d%snap = (self%damping * early%damper_rate - system%stiffness * early%acceleration) &
            & - loss * d%jerk
         d%damper_3 = self%damping * (d%snap - d%damper_2)
         d%crackle = (self%damping * d%damper_2 - system%stiffness * d%jerk) - loss * d%snap
         d%damper_4 = self%damping * (d%crackle - d%damper_3)
         d%pop = (self%damping * d%damper_3 - system%stiffness * d%snap) - loss * d%crackle
         self%series(0) = early%velocity
         self%series(1) = early%acceleration
         self%series(2) = inverse(2) * d%jerk
         self%series(3) = inverse(6) * d%snap
         self%series(4) = (1.0_wp / 24.0_wp) * d%crackle
         self%series(5) = (1.0_wp / 120.0_wp) * d%pop
      end associate
   end subroutine derive

   !> Time in which a distance is made, by reversion of the series of the displacement.
   subroutine revert(series, early, derivatives, distance, passage, inverse_pace, time, is_right)
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      !> The motion at the start
      type(motion_rates_type), intent(in) :: early
      type(derivatives_type), intent(in) :: derivatives
      !> The distance, the time at the present velocity, and one over that velocity
      real(wp), intent(in) :: distance, passage, inverse_pace
      !> The time; whether it is right
      real(wp), intent(out) :: time
      logical, intent(out) :: is_right

      real(wp) :: change, a_2, a_3, a_4, a_5

      change = passage * inverse_pace
      a_2 = early%acceleration * (inverse(2) * change)
      a_3 = derivatives%jerk * (inverse(6) * change * passage)
      a_4 = derivatives%snap * ((1.0_wp / 24.0_wp) * change * passage**2)
      a_5 = derivatives%crackle * ((1.0_wp / 120.0_wp) * change * passage * passage**2)
      time = passage
      is_right = .not. (abs(a_2) > fair_a_2 .or. abs(a_3) > fair_a_3)
      if (.not. is_right) return
      time = passage - passage * (a_2 - (2.0_wp * a_2**2 - a_3) &
         & + (a_2 * (5.0_wp * a_2**2 - 5.0_wp * a_3) + a_4) &
         & - (7.0_wp * a_2**2 * (2.0_wp * a_2**2 - 3.0_wp * a_3) + 6.0_wp * a_2 * a_4 &
         & + 3.0_wp * a_3**2 - a_5))
      if (abs(a_2) > max_a_2 .or. abs(a_3) > max_a_3 .or. abs(a_4) > max_a_4 &
         & .or. abs(a_5) > max_a_5) time = nearer(series, distance, time)
   end subroutine revert

   !> A time of a crossing made exact by one step of Halley's method, the error of which is cubic.
   pure function nearer(series, distance, time) result(better)
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
      !> The distance
      real(wp), intent(in) :: distance
      !> Time of the crossing, right to some 1e-6
      real(wp), intent(in) :: time
      real(wp) :: better

      real(wp) :: velocity, change

      velocity = horner(series, few_terms, time)
      change = (integral(series, few_terms, time) - sign(distance, velocity)) / velocity
      better = time - change &
         & * (1.0_wp + change * (0.5_wp * series(1) + series(2) * time) / velocity)
   end function nearer

   !> Move, and add work and losses to the energy balance.
   subroutine move(self, system, end_time, early, derivatives, step, crosses, target)
      class(rigid_state_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      !> Time at which it ends, if that is not at a break [s]
      real(wp), intent(in) :: end_time
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      type(derivatives_type), intent(in) :: derivatives
      !> Length of the step [s]
      real(wp), intent(in) :: step
      !> Whether it ends at a break, and where that is [m]
      logical, intent(in) :: crosses
      real(wp), intent(in) :: target

      real(wp) :: square, velocity_loss, damper_loss
      type(motion_rates_type) :: late

      self%terms = few_terms
      square = step**2
      associate (d => derivatives)
         if (crosses) then
            self%displacement = target
            self%time = self%time + step
         else
            self%displacement = self%displacement + step * (early%velocity &
               & + inverse(2) * step * (early%acceleration + inverse(3) * step * d%jerk) &
               & + (1.0_wp / 24.0_wp) * step * square * (d%snap + inverse(5) * step * d%crackle &
               & + (1.0_wp / 30.0_wp) * square * d%pop))
            self%time = end_time
         end if
         self%velocity = early%velocity + (step * early%acceleration + inverse(2) * square &
            & * ((d%jerk + inverse(3) * step * d%snap) + inverse(12) * square &
            & * (d%crackle + inverse(5) * step * d%pop)))
         self%damper = early%damper + (step * early%damper_rate + inverse(2) * square &
            & * ((d%damper_2 + inverse(3) * step * d%damper_3) + inverse(12) * square * d%damper_4))
         ! A share of (rate times step)**2 of the balance: four terms do.
         call pull(self, system, step, inverse(2) * square * (early%velocity &
            & + inverse(3) * step * (early%acceleration + inverse(4) * step * (d%jerk &
            & + inverse(5) * step * d%snap))))
      end associate
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
   end subroutine move

end module mesoslip_sliders_rigid_short_step
