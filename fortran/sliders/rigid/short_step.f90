!> Short steps of a rigid slider, in which its velocity hardly changes: seven in eight, in Klein's
!> case.
!>
!> With p the time to the next break at the present velocity, the series of the displacement is
!> distance/V = t + A_2 t**2/p + A_3 t**3/p**2 + ..., and its reversion gives the time of the break
!> without iteration, p (1 - A_2 + (2 A_2**2 - A_3) + ...), exact to rounding or nearly so. Other
!> steps, and those under a drive that accelerates, are in the module of long steps.
module mesoslip_sliders_rigid_short_step
   use mesoslip_interface_law, only: clocks, hazard_clock_type, interface_law_type, window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_hazard_clock, only: advance_clocks
   use mesoslip_sliders_motion_series, only: horner, integral, inverse
   use mesoslip_sliders_rigid_state, only: drive_gap_at, few_terms, motion_rates, &
      & motion_rates_type, pull, rigid_motion_type, rigid_state_type, system_type
   implicit none
   private

   public :: short_step_type, step_books_type
   public :: try_short_step, books_of, derive, look_ahead, find_end, move, audit, &
      & keep_series

   !> Maximum duration of a short step in units of the fastest rate
   real(wp), parameter :: max_step = 3.0e-3_wp

   !> Maximum terms of a series that is reverted: the terms left out, 42 A_2**5, 28 A_2 A_3**2,
   !> 7 A_3 A_4 and the like, are below 1e-16.
   real(wp), parameter :: max_a_2 = 3.0e-4_wp, max_a_3 = 1.0e-7_wp, max_a_4 = 1.0e-10_wp, &
      & max_a_5 = 3.0e-14_wp
   !> Maximum terms with which the reversion is still right to some 1e-6
   real(wp), parameter :: fair_a_2 = 2.0e-2_wp, fair_a_3 = 1.0e-3_wp

   !> The data of a short step for the energy balance.
   type :: step_books_type
      !> The motion at its start, and the distance to the drive there [m]
      type(motion_rates_type) :: early
      real(wp) :: drive_gap
      !> Drag of the contacts [N s/m]
      real(wp) :: drag
      !> Derivatives of the acceleration at its start
      real(wp) :: jerk, snap
      !> Its duration [s], and the acceleration at its end [m/s2]
      real(wp) :: duration, acceleration
   end type step_books_type

   !> A short step.
   type :: short_step_type
      !> The motion at its start, and the distance to the drive there [m]
      type(motion_rates_type) :: early
      real(wp) :: drive_gap
      !> Derivatives of the acceleration at its start, from the first to the fourth, and of the
      !> damper, from the second to the fourth
      real(wp) :: jerk, snap, crackle, pop, damper_2, damper_3, damper_4
      !> Distance to the next break [m], duration if there is none [s], and one over the velocity
      !> [s/m]
      real(wp) :: distance, rest, inverse_pace
      !> Distance within which the slider may turn round [m]
      real(wp) :: room
      real(wp) :: duration
      !> Whether it ends at a break, and where that is [m]; the time at which it ends otherwise [s]
      logical :: crosses
      real(wp) :: target, end_time
      !> Acceleration at its end [m/s2]
      real(wp) :: acceleration
   end type short_step_type

contains

   !> Make a short step, if a short series is exact and the velocity hardly changes in it.
   subroutine try_short_step(self, system, window, early, is_done)
      class(rigid_state_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Whether the step was made; if not, the motion has not changed
      logical, intent(out) :: is_done

      type(short_step_type) :: step
      type(rigid_motion_type) :: motion

      motion = self%motion()
      step%early = early
      step%drive_gap = system%drive_gap
      call derive(system, self%damping, step)
      call look_ahead(motion, window, step)
      call find_end(system, self%damping, step, is_done)
      if (.not. is_done) return
      call keep_series(self, step)
      if (self%has_clocks) call end_by_clocks(self%clock, self%time, step)
      call move(self, system, self%law, step, motion)
      call self%take_motion(motion)
      self%start_acceleration = early%acceleration
      self%acceleration = step%acceleration
      call audit(self, books_of(step, self%law%drag), motion)
   end subroutine try_short_step

   !> Advance clocks in a short step, and end it where one reaches its reading.
   pure subroutine end_by_clocks(clock, time, step)
      type(hazard_clock_type), intent(inout) :: clock(clocks)
      !> Time at the start of the step [s]
      real(wp), intent(in) :: time
      !> The step, after find_end
      type(short_step_type), intent(inout) :: step

      logical :: is_due

      call advance_clocks(clock, series_of(step), few_terms, step%duration, is_due)
      if (.not. is_due) return
      step%crosses = .false.
      step%end_time = time + step%duration
   end subroutine end_by_clocks

   !> Derivatives of acceleration and damper, each from the equation of motion, the damper put in.
   pure subroutine derive(system, damping, step)
      type(system_type), intent(in) :: system
      !> Damping rate [1/s]
      real(wp), intent(in) :: damping
      !> The step, with the motion at its start
      type(short_step_type), intent(inout) :: step

      associate (loss => system%drag + damping, early => step%early, d => step)
         d%jerk = (system%driving - system%stiffness * early%velocity &
            & + damping * early%damper) - loss * early%acceleration
         d%damper_2 = damping * (d%jerk - early%damper_rate)
         d%snap = (damping * early%damper_rate - system%stiffness * early%acceleration) &
            & - loss * d%jerk
         d%damper_3 = damping * (d%snap - d%damper_2)
         d%crackle = (damping * d%damper_2 - system%stiffness * d%jerk) - loss * d%snap
         d%damper_4 = damping * (d%crackle - d%damper_3)
         d%pop = (damping * d%damper_3 - system%stiffness * d%snap) - loss * d%crackle
      end associate
   end subroutine derive

   !> Taylor coefficients of the velocity in a step.
   pure function series_of(step) result(series)
      type(short_step_type), intent(in) :: step
      real(wp) :: series(0:few_terms - 1)

      series(0) = step%early%velocity
      series(1) = step%early%acceleration
      series(2) = inverse(2) * step%jerk
      series(3) = inverse(6) * step%snap
      series(4) = (1.0_wp / 24.0_wp) * step%crackle
      series(5) = (1.0_wp / 120.0_wp) * step%pop
   end function series_of

   !> Keep the motion in a step for observation.
   pure subroutine keep_series(self, step)
      class(rigid_state_type), intent(inout) :: self
      type(short_step_type), intent(in) :: step

      self%terms = few_terms
      self%series(:few_terms - 1) = series_of(step)
   end subroutine keep_series

   !> Distance to the next break, and duration of a step without one.
   pure subroutine look_ahead(motion, window, step)
      !> The motion at the start
      type(rigid_motion_type), intent(in) :: motion
      type(window_type), intent(in) :: window
      type(short_step_type), intent(inout) :: step

      step%target = merge(window%upper, window%lower, motion%velocity > 0.0_wp)
      step%distance = sign(1.0_wp, motion%velocity) * (step%target - motion%displacement)
      step%end_time = window%end_time
      step%rest = window%end_time - motion%time
      step%room = 0.0_wp
      if (window%may_turn) step%room = min(window%upper - motion%displacement, &
         & motion%displacement - window%lower)
      step%inverse_pace = 0.0_wp
      if (abs(motion%velocity) > 0.0_wp) step%inverse_pace = 1.0_wp / motion%velocity
   end subroutine look_ahead

   !> Find the end of a step, if it is a short one.
   pure subroutine find_end(system, damping, step, is_found)
      type(system_type), intent(in) :: system
      !> Damping rate [1/s]
      real(wp), intent(in) :: damping
      !> The step, after derive and look_ahead
      type(short_step_type), intent(inout) :: step
      !> Whether it is a short one
      logical, intent(out) :: is_found

      real(wp) :: pace

      is_found = .false.
      pace = abs(step%early%velocity)
      if (.not. (pace > 0.0_wp .and. step%distance > 0.0_wp .and. step%rest > 0.0_wp)) return
      ! The processor cannot predict whether a contact breaks. The first condition, on which this
      ! mostly depends, is known long before the time of the break, so its branch has its own call.
      if (step%distance < pace * step%rest) then
         call find_crossing(system, damping, step, is_found)
      else if (step%distance < 2.0_wp * pace * step%rest) then
         call find_crossing(system, damping, step, is_found)
      else
         call find_pause(system, damping, step, is_found)
      end if
   end subroutine find_end

   !> Find the end of a step near a break, if it is a short one.
   pure subroutine find_crossing(system, damping, step, is_found)
      type(system_type), intent(in) :: system
      real(wp), intent(in) :: damping
      type(short_step_type), intent(inout) :: step
      logical, intent(out) :: is_found

      real(wp) :: passage

      is_found = .false.
      passage = step%distance * abs(step%inverse_pace)
      if (is_long(system, damping, min(step%rest, passage))) return
      call revert(step, step%distance, passage, step%inverse_pace, step%duration, is_found)
      if (.not. is_found) return
      step%crosses = step%duration <= step%rest
      if (.not. step%crosses) step%duration = step%rest
   end subroutine find_crossing

   !> Find the end of a step far from any break, if it is a short one.
   pure subroutine find_pause(system, damping, step, is_found)
      type(system_type), intent(in) :: system
      real(wp), intent(in) :: damping
      type(short_step_type), intent(inout) :: step
      logical, intent(out) :: is_found

      real(wp) :: series(0:few_terms - 1), change
      integer :: term

      is_found = .false.
      if (is_long(system, damping, step%rest)) return
      ! A velocity that changes by less than half cannot reach the break.
      series = series_of(step)
      change = 0.0_wp
      do term = few_terms - 1, 1, -1
         change = (change + abs(series(term))) * step%rest
      end do
      is_found = change < 0.5_wp * abs(step%early%velocity) &
         & .or. (abs(step%early%velocity) + change) * step%rest < step%room
      step%crosses = .false.
      step%duration = step%rest
   end subroutine find_pause

   !> Whether a step is too long for a short series.
   pure function is_long(system, damping, duration)
      type(system_type), intent(in) :: system
      real(wp), intent(in) :: damping, duration
      logical :: is_long

      ! Twice the sum of squares exceeds the square of the fastest rate.
      is_long = duration**2 * (2.0_wp * abs(system%stiffness) &
         & + 2.0_wp * (system%drag + 2.0_wp * damping)**2) > max_step**2
   end function is_long

   !> Time in which a distance is covered, by reversion of the series of the displacement.
   pure subroutine revert(step, distance, passage, inverse_pace, time, is_right)
      !> The step, after derive
      type(short_step_type), intent(in) :: step
      !> The distance, the time at the present velocity, and one over that velocity
      real(wp), intent(in) :: distance, passage, inverse_pace
      !> The time, and whether it is right
      real(wp), intent(out) :: time
      logical, intent(out) :: is_right

      real(wp) :: change, a_2, a_3, a_4, a_5

      change = passage * inverse_pace
      a_2 = step%early%acceleration * (inverse(2) * change)
      a_3 = step%jerk * (inverse(6) * change * passage)
      a_4 = step%snap * ((1.0_wp / 24.0_wp) * change * passage**2)
      a_5 = step%crackle * ((1.0_wp / 120.0_wp) * change * passage * passage**2)
      time = passage
      is_right = .not. (abs(a_2) > fair_a_2 .or. abs(a_3) > fair_a_3)
      if (.not. is_right) return
      time = passage - passage * (a_2 - (2.0_wp * a_2**2 - a_3) &
         & + (a_2 * (5.0_wp * a_2**2 - 5.0_wp * a_3) + a_4) &
         & - (7.0_wp * a_2**2 * (2.0_wp * a_2**2 - 3.0_wp * a_3) + 6.0_wp * a_2 * a_4 &
         & + 3.0_wp * a_3**2 - a_5))
      if (abs(a_2) > max_a_2 .or. abs(a_3) > max_a_3 .or. abs(a_4) > max_a_4 &
         & .or. abs(a_5) > max_a_5) time = nearer(series_of(step), distance, time)
   end subroutine revert

   !> A time of a crossing made exact by one step of Halley's method, the error of which is cubic.
   pure function nearer(series, distance, time) result(better)
      !> Coefficients of the velocity
      real(wp), intent(in) :: series(0:)
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

   !> The motion at the end of a step.
   pure subroutine move(self, system, law, step, motion)
      class(rigid_state_type), intent(in) :: self
      type(system_type), intent(in) :: system
      type(interface_law_type), intent(in) :: law
      type(short_step_type), intent(inout) :: step
      type(rigid_motion_type), intent(inout) :: motion

      real(wp) :: square, start_time
      type(motion_rates_type) :: late

      start_time = motion%time
      square = step%duration**2
      associate (early => step%early, d => step, time => step%duration)
         if (step%crosses) then
            motion%displacement = step%target
            motion%time = motion%time + time
         else
            motion%displacement = motion%displacement + time * (early%velocity &
               & + inverse(2) * time * (early%acceleration + inverse(3) * time * d%jerk) &
               & + (1.0_wp / 24.0_wp) * time * square * (d%snap + inverse(5) * time * d%crackle &
               & + (1.0_wp / 30.0_wp) * square * d%pop))
            motion%time = step%end_time
         end if
         motion%velocity = early%velocity + (time * early%acceleration + inverse(2) * square &
            & * ((d%jerk + inverse(3) * time * d%snap) + inverse(12) * square &
            & * (d%crackle + inverse(5) * time * d%pop)))
         motion%damper = early%damper + (time * early%damper_rate + inverse(2) * square &
            & * ((d%damper_2 + inverse(3) * time * d%damper_3) + inverse(12) * square * d%damper_4))
      end associate
      if (abs(motion%velocity) > 0.0_wp) motion%direction = sign(1.0_wp, motion%velocity)
      late = motion_rates(system, self%damping, motion, drive_gap_at(self, motion), &
         & law%stiffness * motion%displacement - law%offset + law%rate * (motion%time - start_time))
      step%acceleration = late%acceleration
   end subroutine move

   !> Parts of a step that enter the energy balance.
   pure function books_of(step, drag) result(books)
      type(short_step_type), intent(in) :: step
      !> Drag of the contacts [N s/m]
      real(wp), intent(in) :: drag
      type(step_books_type) :: books

      books = step_books_type(step%early, step%drive_gap, drag, step%jerk, step%snap, &
         & step%duration, step%acceleration)
   end function books_of

   !> Add work and losses of a step to the energy balance.
   subroutine audit(self, step, motion)
      class(rigid_state_type), intent(inout) :: self
      !> The step, and the motion at its end
      type(step_books_type), intent(in) :: step
      type(rigid_motion_type), intent(in) :: motion

      real(wp) :: square, velocity_loss, damper_loss, damper_rate

      square = step%duration**2
      damper_rate = self%damping * (step%acceleration - motion%damper)
      associate (early => step%early, time => step%duration)
         ! A share of (rate times step)**2 of the balance: four terms are enough.
         call pull(self, step%drive_gap, time, inverse(2) * square * (early%velocity &
            & + inverse(3) * time * (early%acceleration + inverse(4) * time * (step%jerk &
            & + inverse(5) * time * step%snap))))
         ! From values and slopes at both ends: the error is (2 step)**4/720, in units of the
         ! fastest rate, of terms that are a small part of the balance.
         velocity_loss = time * (0.5_wp * (early%velocity**2 + motion%velocity**2) &
            & + inverse(6) * time * (early%velocity * early%acceleration &
            & - motion%velocity * step%acceleration))
         damper_loss = time * (0.5_wp * (early%damper * early%velocity &
            & + motion%damper * motion%velocity) &
            & + inverse(12) * time * (early%damper_rate * early%velocity &
            & + early%damper * early%acceleration - damper_rate * motion%velocity &
            & - motion%damper * step%acceleration))
      end associate
      call self%drag_loss%add(step%drag * velocity_loss)
      call self%damping_loss%add(self%mass * damper_loss)
   end subroutine audit

end module mesoslip_sliders_rigid_short_step
