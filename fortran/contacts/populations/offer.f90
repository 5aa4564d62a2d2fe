!> The steps of populations: their duration, and the force that the slider is offered in each.
!>
!> A step is so short that its populations are points of a smooth density of origins, and that an
!> inertial slider hardly changes its acceleration. In a step the contact force changes with the
!> displacement by breaks, and with the time by attachments: a chord of the true force, shifted so
!> that it does the true work. Chords of successive steps meet, so that the slider is not shaken.
!> The steps are of second order, and the longer the less the force bends in them.
module mesoslip_contacts_populations_offer
   use mesoslip_contacts_populations_breaking, only: tiny_gap
   use mesoslip_contacts_populations_loading, only: add_load_changes, end_of_load_step, &
      & expected_change
   use mesoslip_contacts_populations_motion, only: distance_in, max_time, patience, time_after, &
      & time_to_move
   use mesoslip_contacts_populations_packets, only: expected_births_type
   use mesoslip_contacts_populations_state, only: population_state_type
   use mesoslip_contacts_populations_thermal_step, only: expect_motion, look_ahead_thermal, &
      & max_growth, min_part, smooth_excess
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: offer_step

   !> Displacement over the length of a step up to which a slider creeps
   real(wp), parameter :: creeping_part = 0.01_wp
   !> Duration of a step in which a slider may settle, over the time in which it oscillates by a
   !> radian
   real(wp), parameter :: settling_time = 8.0_wp
   !> Displacement over the length of a step by which a slider that hardly oscillates may go back
   real(wp), parameter :: back_part = 0.1_wp
   !> Part of the force that drives a slider by which a chord may lie above the true force
   real(wp), parameter :: driving_part = 0.5_wp
   !> Relative difference of forces up to which they are equal except for rounding
   real(wp), parameter :: rounding = 16.0_wp * epsilon(1.0_wp)
   !> Duration of a step of resolution 1 over the time in which an inertial slider oscillates by a
   !> radian or is damped
   real(wp), parameter :: rate_part = 1.0_wp
   !> Duration of an advance over that of a step: the chord of a step is wrong if the slider ends it
   !> before it was expected to
   real(wp), parameter :: phase_part = 1.25_wp
   !> Breaks of populations that start to break together, beyond which a step ends where they do,
   !> over those of populations that start anywhere in it
   real(wp), parameter :: together_part = 1.0e-4_wp
   !> Maximum of the next step over the last one, and ratio of the lengths among which it is
   real(wp), parameter :: max_growth_of_step = 2.0_wp, ratio = 2.0_wp**0.25_wp
   !> Bend over that of the tolerance beyond which a step is shortened, and how often it may be
   real(wp), parameter :: max_excess = 1.5_wp
   integer, parameter :: max_attempts = 2

contains

   !> Contact force as a law, which holds until contacts break, or for a step.
   subroutine offer_step(self, pose, law, window)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      real(wp) :: direction, max_span, span, distance, reach, limit, max_births, slack, growing
      real(wp) :: load_end, load_change
      logical :: breaks, moves, is_quiet, rests
      type(expected_births_type) :: births
      type(pose_type) :: expected

      expected = pose
      is_quiet = .false.
      if (self%pinned%is_thermal) call expect_motion(self, pose, expected, is_quiet)
      direction = expected%direction
      if (.not. abs(expected%velocity) > 0.0_wp .and. abs(expected%acceleration) > 0.0_wp) then
         direction = sign(1.0_wp, expected%acceleration)
      end if
      slack = tiny_gap * self%pinned%step
      if (is_quiet) slack = back_part * self%pinned%step
      if (self%pinned%is_thermal) then
         breaks = self%pinned%count > 0
      else
         breaks = self%pinned%gap_ahead(pose%displacement, direction) <= max(slack, &
            & self%pinned%near_gap())
      end if
      rests = is_in_balance(self, pose, slack)
      breaks = breaks .and. .not. rests
      call self%pinned%forget_trial()

      self%next_step = max(self%pinned%step, min(self%next_step, self%pinned%max_step))
      span = time_to_move(expected, direction, self%next_step)
      max_span = huge(1.0_wp)
      if (.not. is_quiet) max_span = max_duration(self, pose)
      max_births = self%max_attached
      if (max_span >= max_time .and. .not. distance_in(expected, direction, span) > 0.0_wp) then
         max_births = self%max_attached_at_rest
      end if
      self%max_fall_time = huge(1.0_wp)
      if (self%pinned%some_fall) self%max_fall_time = time_to_fall(self, pose, span)
      load_end = end_of_load_step(self)
      max_span = min(max_span, self%max_fall_time, load_end - pose%time)
      if (self%pinned%is_thermal .and. breaks) then
         ! Long enough for a slider that hardly oscillates to settle.
         growing = max_growth * min(self%last_duration, max_time)
         if (is_quiet) growing = max(growing, settling_time / self%oscillation_rate(pose))
         max_span = min(max_span, growing)
      end if
      span = min(span, max_span)
      call self%detached%expect(pose%time, span, max_births, breaks .and. &
         & (self%pinned%is_thermal .or. distance_in(expected, direction, span) > 0.0_wp), births)
      span = min(span, births%end_time - pose%time)
      distance = distance_in(expected, direction, span)
      reach = max(distance, min_part * self%pinned%step)
      limit = self%next_step
      if (breaks .and. self%pinned%is_thermal) then
         call look_ahead_thermal(self, expected, direction, max_births, span, distance, reach, &
            & limit, births)
         max_span = span
      else if (breaks) then
         call find_step(self, pose, direction, max_births, span, distance, reach, limit, births)
      end if
      breaks = self%pinned%trial%count > 0
      if (.not. breaks) self%next_step = max_growth_of_step * self%next_step

      load_change = expected_change(self, min(time_after(pose%time, span), load_end))
      moves = breaks .or. births%number > 0.0_wp .or. abs(load_change) > 0.0_wp
      window%end_time = min(births%end_time, load_end)
      if (moves .and. max_span < max_time) then
         window%end_time = min(window%end_time, time_after(pose%time, max_span))
      end if
      ! Contacts may break at rest later on.
      if (self%max_fall_time < max_time) window%end_time = min(window%end_time, &
         & time_after(pose%time, self%max_fall_time))
      window%max_phase = max(window%max_phase, phase_part * rate_part * self%resolution)
      window%upper = max(self%pinned%ahead, pose%displacement)
      window%lower = min(self%pinned%behind, pose%displacement)
      if (moves) then
         ! Contacts break in one direction and attach with a force against it: the step ends where
         ! the slider turns round.
         reach = min(limit, max(reach, patience * distance))
         if (.not. distance > 0.0_wp) reach = limit
         call end_at_reach(pose, direction, reach, slack, breaks, is_quiet, window)
      end if
      if (rests) then
         window%upper = max(window%upper, pose%displacement + slack)
         window%lower = min(window%lower, pose%displacement - slack)
      end if

      law = self%law()
      self%detached_count = self%detached%number%total()
      if (moves) then
         call add_changes(self, expected, direction, span, distance, births, law)
         call add_load_changes(self, expected, load_change, span, direction * distance, law)
      end if
      if (self%pinned%is_thermal) call smooth_excess(self, window%end_time - pose%time, law)
      self%offered = law
      self%offers = .true.
   end subroutine offer_step

   !> End a window with the step: ahead, and where the slider turns round.
   pure subroutine end_at_reach(pose, direction, reach, slack, breaks, is_quiet, window)
      type(pose_type), intent(in) :: pose
      !> Direction, maximum displacement of the step, and distance by which a slider that rests or
      !> hardly oscillates may go back [m]
      real(wp), intent(in) :: direction, reach, slack
      !> Whether contacts break in the step, and whether the slider hardly oscillates
      logical, intent(in) :: breaks, is_quiet
      type(window_type), intent(inout) :: window

      if (direction > 0.0_wp) then
         if (breaks) window%upper = pose%displacement + reach
         window%upper = min(window%upper, pose%displacement + reach)
         window%lower = pose%displacement
         if (is_quiet .or. .not. pose%velocity > 0.0_wp) window%lower = window%lower - slack
      else
         if (breaks) window%lower = pose%displacement - reach
         window%lower = max(window%lower, pose%displacement - reach)
         window%upper = pose%displacement
         if (is_quiet .or. .not. pose%velocity < 0.0_wp) window%upper = window%upper + slack
      end if
   end subroutine end_at_reach

   !> Find what breaks in a step, and which part of it attaches; the step may become shorter.
   subroutine look_ahead(self, pose, direction, max_births, span, distance, reach, limit, births)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Direction of the motion, and maximum number of contacts that attach
      real(wp), intent(in) :: direction, max_births
      !> Duration of the step [s], expected displacement in it, displacement until which breaks are
      !> found, and maximum displacement of the step [m]
      real(wp), intent(inout) :: span, distance, reach, limit
      type(expected_births_type), intent(inout) :: births

      real(wp) :: part

      call try(self, pose, direction, reach, limit)
      if (reach < distance) then
         call self%detached%shorten_step(pose, direction, time_to_move(pose, direction, reach), &
            & max_births, span, distance, births)
      end if
      call find_own()
      if (births%own > 0.0_wp .and. births%number + births%own > max_births) then
         part = max_births / (births%number + births%own)
         births%end_time = min(births%end_time, time_after(pose%time, part * span))
         call self%detached%shorten_step(pose, direction, part * span, max_births, span, distance, &
            & births)
         reach = max(distance, min_part * self%pinned%step)
         call try(self, pose, direction, reach, limit)
         call find_own()
      end if

   contains

      !> Find what breaks and attaches in the step.
      subroutine find_own()
         real(wp) :: own, growth

         births%own = 0.0_wp
         if (.not. distance > 0.0_wp) return
         growth = 0.5_wp * direction * pose%acceleration * span**2 / distance
         growth = max(-1.0_wp, min(1.0_wp, growth))
         own = self%detached%own_part(span, growth)
         if (.not. own > 0.0_wp) return
         births%own = self%pinned%trial%breaks * distance / reach * own
         births%own_place = births%own * self%detached%own_place(span, growth)
         births%own_mass = 0.0_wp
         if (births%own > 0.0_wp) births%own_mass = births%own * self%pinned%trial%mass &
            & / self%pinned%trial%breaks
      end subroutine find_own

   end subroutine look_ahead

   !> Look ahead, shorten a step in which the force bends too much, and find the displacement of the
   !> next one.
   subroutine find_step(self, pose, direction, max_births, span, distance, reach, limit, &
      & births)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> As for look_ahead
      real(wp), intent(in) :: direction, max_births
      real(wp), intent(inout) :: span, distance, reach, limit
      type(expected_births_type), intent(inout) :: births

      real(wp) :: bend, length
      integer :: attempt

      call look_ahead(self, pose, direction, max_births, span, distance, reach, limit, births)
      if (.not. self%pinned%adapts) return
      do attempt = 0, max_attempts
         length = max_growth_of_step * self%next_step
         if (self%pinned%trial%count == 0) exit
         bend = abs(self%pinned%trial%bend())
         ! The bend grows with the square of the displacement.
         if (reach**2 * self%tolerance < length**2 * bend) then
            length = reach * sqrt(self%tolerance / bend)
         end if
         if (bend < max_excess * self%tolerance .or. reach <= self%pinned%step &
            & .or. attempt == max_attempts) exit
         reach = max(self%pinned%step, length)
         limit = min(limit, reach)
         if (reach < distance) then
            call self%detached%shorten_step(pose, direction, time_to_move(pose, direction, reach), &
               & max_births, span, distance, births)
            reach = max(distance, min_part * self%pinned%step)
         end if
         call look_ahead(self, pose, direction, max_births, span, distance, reach, limit, births)
      end do
      ! One of some lengths: rounding errors would grow from step to step.
      self%next_step = self%pinned%step * ratio**floor(log(length / self%pinned%step) / log(ratio))
   end subroutine find_step

   !> Maximum duration of a step in which the motion hardly changes [s].
   pure function max_duration(self, pose) result(duration)
      class(population_state_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      real(wp) :: duration

      real(wp) :: rate

      rate = self%oscillation_rate(pose) + 2.0_wp * pose%damping
      duration = huge(1.0_wp)
      if (rate > 1.0_wp / max_time) duration = self%resolution * rate_part / rate
   end function max_duration

   !> Add to a law the changes of the force by breaks and attachments in a step.
   pure subroutine add_changes(self, pose, direction, span, distance, births, law)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Direction, duration of the step [s] and displacement in it [m]
      real(wp), intent(in) :: direction, span, distance
      type(expected_births_type), intent(in) :: births
      type(interface_law_type), intent(inout) :: law

      real(wp) :: slope, rate, middle, mass, number, velocity, heat

      associate (trial => self%pinned%trial, parameters => self%parameters)
         slope = 0.0_wp
         rate = 0.0_wp
         heat = 0.0_wp
         middle = 0.0_wp
         mass = -births%mass - births%own_mass
         number = -births%number - births%own
         if (trial%count > 0) then
            ! By activation contacts break evenly in time, at thresholds with the displacement.
            heat = trial%drop - trial%cut_drop
            slope = -trial%cut_drop / trial%reach
            ! The true force lies between those of the start and of the end. Contacts that attached
            ! in the step before may be due at once, at no distance.
            middle = max(-0.5_wp * abs(trial%cut_drop), &
               & min(0.5_wp * abs(trial%cut_drop), trial%bend()))
            mass = mass + (trial%mass - (trial%breaks - trial%cut_breaks)) &
               & * distance / trial%reach + (trial%breaks - trial%cut_breaks)
            number = number + trial%cut_breaks * distance / trial%reach &
               & + (trial%breaks - trial%cut_breaks)
         end if
         slope = slope + 0.5_wp * self%pinned%newborn_stiffness * (births%number + births%own)
         middle = middle - self%pinned%newborn_stiffness * (births%number + births%own) * distance &
            & / 8.0_wp
         if (births%own > 0.0_wp) slope = slope + births%own * parameters%static_force &
            & * self%pinned%newborn_force / distance
         if (span > 0.0_wp .and. span < max_time .and. .not. self%pinned%is_thermal) then
            middle = middle + parameters%static_force * self%pinned%newborn_force &
               & * (0.5_wp * (births%number + births%own) - births%wait / span - births%own_place)
         end if
         middle = min(middle, max_shift(pose, direction, distance))
         if (span > 0.0_wp .and. span < max_time) then
            velocity = max(0.0_wp, direction * (pose%velocity + span * pose%acceleration))
            rate = (births%number * parameters%static_force * self%pinned%newborn_force &
               & + parameters%drag * mass * velocity - heat) / span
         end if
         law%stiffness = law%stiffness + slope
         law%offset = law%offset + slope * pose%displacement - direction * middle
         law%rate = direction * rate
         self%detached_count = max(0.0_wp, self%detached_count + 0.5_wp * number)
      end associate
   end subroutine add_changes

   !> Whether a slider that can stop within a distance [m] is in balance except for rounding
   !> errors: these must not decide in which direction contacts break.
   pure function is_in_balance(self, pose, slack) result(is_balanced)
      class(population_state_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: slack
      logical :: is_balanced

      real(wp) :: noise

      is_balanced = .false.
      if (self%pinned%is_thermal .or. self%pinned%some_fall) return
      noise = rounding * pose%inverse_mass * (abs(self%pinned%offset%total()) &
         & + abs(self%pinned%stiffness%total() * pose%displacement))
      is_balanced = noise > 0.0_wp .and. abs(pose%acceleration) <= noise &
         & .and. pose%velocity**2 <= 2.0_wp * noise * slack
   end function is_in_balance

   !> Maximum height of a chord above the true force at its start [N], in a step with a displacement
   !> [m]: a slider that begins to move must not turn round at once.
   pure function max_shift(pose, direction, distance) result(force)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: direction, distance
      real(wp) :: force

      real(wp) :: driving

      force = huge(1.0_wp)
      driving = direction * pose%acceleration
      if (.not. (driving > 0.0_wp .and. pose%inverse_mass > 0.0_wp)) return
      if (pose%velocity**2 >= 2.0_wp * driving * distance) return
      force = driving_part * driving / pose%inverse_mass
   end function max_shift

   !> Maximum duration of a step while thresholds fall [s], so that contacts break in time that do
   !> so at rest, given the duration of a step by the motion of the slider [s].
   pure function time_to_fall(self, pose, duration) result(time)
      class(population_state_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: duration
      real(wp) :: time

      real(wp) :: age

      time = huge(1.0_wp)
      age = pose%time - self%pinned%last_birth
      if (self%pinned%ageing%is_old(age)) return
      time = self%resolution * max(self%pinned%ageing%time, age, self%parameters%delay)
      if (duration < max_time) time = max(time, creeping_part * duration)
      time = max(time, nearest(pose%time, huge(1.0_wp)) - pose%time)
   end function time_to_fall

   !> Find what breaks in a displacement of the slider [m].
   !>
   !> Where populations start to break together, as they do where the slider turned before, or many
   !> start to break, the force has a kink: the displacement ends there, which is then the limit of
   !> the step [m]. Errors of steps with a kink would depend on where in them it happens to be.
   subroutine try(self, pose, direction, distance, limit)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: direction
      real(wp), intent(inout) :: distance, limit

      real(wp) :: late, onset, displacement, wanted

      call self%pinned%try(pose, pose%displacement + direction * distance, &
         & expected_time(distance), direction, late, onset, self%failure)
      if (late > self%max_late &
         & .or. self%pinned%trial%together > together_part * self%max_late) then
         wanted = distance
         displacement = onset
         distance = abs(displacement - pose%displacement)
         if (distance < wanted) limit = distance
         call self%pinned%try(pose, displacement, expected_time(distance), direction, late, &
            & onset, self%failure)
      end if

   contains

      !> Expected time at which the slider has moved by a distance [s].
      pure function expected_time(distance) result(time)
         real(wp), intent(in) :: distance
         real(wp) :: time

         time = pose%time
         if (self%pinned%ages) time = pose%time &
            & + min(time_to_move(pose, direction, distance), self%max_fall_time, max_time)
      end function expected_time

   end subroutine try

end module mesoslip_contacts_populations_offer
