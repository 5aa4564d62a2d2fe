!> Motion of a slider as contacts whose thresholds grow predict it, and where they meet it.
!>
!> Acceleration and jerk of the slider follow from the law that it is offered; a bound on the error
!> of the jerk from recent motions, with a margin. Of a slider whose drive and damper are known, so
!> does the rate of the jerk. Contacts and schedules share this: results agree to the bit.
module mesoslip_motion_prediction
   use mesoslip_ageing_law, only: ageing_law_type
   use mesoslip_interface_law, only: interface_law_type, pose_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: prediction_type

   !> Factor of the last error of the jerk in a bound on the next, factor by which errors decay from
   !> motion to motion, and minimum relative error
   real(wp), parameter :: safety = 4.0_wp, memory = 0.99_wp, min_jerk_error = 1.0e-3_wp
   !> Relative change of the speed of approach up to which the time of a break is a short series
   real(wp), parameter :: max_excess = 1.0e-5_wp
   !> The same up to which one step of Newton's method follows that series
   real(wp), parameter :: max_fair_excess = 5.0e-3_wp
   !> The same up to which that series starts Newton's method, and relative change of the time after
   !> which it ends: the error is the square of that
   real(wp), parameter :: max_start_excess = 0.2_wp, max_change = 1.0e-6_wp
   !> Steps of Newton's method: without convergence nothing is extrapolated
   integer, parameter :: max_steps = 8
   !> Maximum phase of the oscillation of the slider in a window: more than it makes in one step
   real(wp), parameter :: max_phase = 0.6_wp
   !> Maximum duration for which a bound on the displacement is extrapolated [s], and its
   !> margin, with which bounds beyond it do not change how the slider takes its step
   real(wp), parameter :: max_duration = 1.0e9_wp, margin = 2.5_wp

   !> The predicted motion.
   type :: prediction_type
      !> Law of the last motion, and that which was offered last
      type(interface_law_type) :: law, offered
      !> Acceleration [m/s2] and jerk under it, the error of the jerk in recent motions, and a bound
      !> on its error [m/s3]
      real(wp) :: acceleration = 0.0_wp, jerk = 0.0_wp, jerk_error = 0.0_wp, jerk_bound = 0.0_wp
      !> Square of the angular frequency under the law [1/s2]
      real(wp) :: stiffness = 0.0_wp
      !> Whether the motion is known: then its next derivative [m/s4], and bounds on the two after
      !> it [m/s5, m/s6]
      logical :: is_known = .false.
      real(wp) :: snap = 0.0_wp, crackle_bound = 0.0_wp, pop_bound = 0.0_wp
   contains
      procedure, non_overridable :: predict, complete, compare, limit_time, reach, meet, &
         & extrapolate, shift, exchange
      procedure, non_overridable, private :: displacement_error
   end type prediction_type

contains

   !> Predict acceleration and jerk of the slider under a law, from its pose with the acceleration
   !> under the law before.
   pure subroutine predict(self, pose, law)
      class(prediction_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(in) :: law

      real(wp) :: change, stiffness, loss, damper_rate

      change = (law%stiffness - self%law%stiffness) * pose%displacement &
         & - (law%offset - self%law%offset) + (law%drag - self%law%drag) * pose%velocity
      self%offered = law
      self%acceleration = pose%acceleration - pose%inverse_mass * change
      stiffness = pose%own_rate**2 + pose%inverse_mass * law%stiffness
      loss = pose%inverse_mass * law%drag + pose%damping
      self%jerk = (pose%driving - stiffness * pose%velocity + pose%damping * pose%damper) &
         & - loss * self%acceleration
      ! Unless they are known, drive and damper may change as fast as the slider itself.
      self%jerk_bound = merge(0.0_wp, safety * self%jerk_error, pose%is_known) &
         & + min_jerk_error * abs(self%jerk) &
         & + pose%own_rate * (pose%own_rate * abs(pose%velocity) + abs(self%acceleration))
      self%is_known = pose%is_known
      self%stiffness = stiffness
      damper_rate = pose%damping * (self%acceleration - pose%damper)
      self%snap = pose%driving_rate + pose%damping * damper_rate &
         & - stiffness * self%acceleration - loss * self%jerk
      self%crackle_bound = safety * (pose%damping**2 * (abs(self%jerk) + abs(damper_rate)) &
         & + stiffness * abs(self%jerk) + loss * abs(self%snap))
      ! Where the jerk passes 0, so does most of the bound above.
      self%pop_bound = safety * stiffness * abs(self%snap)
   end subroutine predict

   !> A motion under the law that was offered last is over.
   pure subroutine complete(self)
      class(prediction_type), intent(inout) :: self

      self%law = self%offered
   end subroutine complete

   !> Compare a motion with its prediction, unless that was known.
   pure subroutine compare(self, before, after)
      class(prediction_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: duration

      call self%complete()
      duration = after%time - before%time
      if (self%is_known .or. .not. duration > 0.0_wp) return
      self%jerk_error = max(abs(after%acceleration - self%acceleration - self%jerk * duration) &
         & / duration, memory * self%jerk_error)
   end subroutine compare

   !> End a window of a motion that is known, which is no shorter than the steps of the slider.
   pure subroutine limit_time(self, pose, time)
      class(prediction_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      !> The time at which it ends [s]
      real(wp), intent(inout) :: time

      if (.not. self%is_known) return
      if (self%stiffness * min(time - pose%time, max_duration)**2 > max_phase**2) then
         time = pose%time + max_phase / sqrt(self%stiffness)
      end if
   end subroutine limit_time

   !> Coordinate along a direction that the slider does not reach before a time.
   pure function reach(self, pose, direction, time) result(coordinate)
      class(prediction_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      !> The direction, +1 or -1, and the time [s]
      real(wp), intent(in) :: direction, time
      real(wp) :: coordinate

      real(wp) :: duration, speed

      coordinate = huge(1.0_wp)
      duration = time - pose%time
      if (duration > max_duration) return
      speed = abs(pose%velocity) &
         & + (abs(self%acceleration) + (abs(self%jerk) + self%jerk_bound) * duration) &
         & * duration
      coordinate = direction * pose%displacement + margin * speed * duration
   end function reach

   !> Where the slider meets the threshold of a contact, or before.
   pure subroutine meet(self, ageing, configured, mean, age, origin, pose, direction, resolution, &
      & limit, coordinate)
      class(prediction_type), intent(in) :: self
      type(ageing_law_type), intent(in) :: ageing
      !> Configured breaking stretch of the contact, and the mean one [m]; its age [s], and its
      !> origin as a coordinate along the direction [m]
      real(wp), intent(in) :: configured, mean, age, origin
      type(pose_type), intent(in) :: pose
      !> The direction, +1 or -1; distance below which the slider has met the threshold [m]
      real(wp), intent(in) :: direction, resolution
      !> Present threshold, as a stretch, and the coordinate of the meeting [m]
      real(wp), intent(out) :: limit, coordinate

      real(wp) :: rate, growth
      logical :: is_known

      call ageing%evaluate(configured, mean, age, limit, rate)
      coordinate = origin + limit
      call self%extrapolate(ageing, rate, age, coordinate - direction * pose%displacement, &
         & direction * pose%velocity, direction, resolution, growth, is_known)
      if (is_known) coordinate = coordinate + growth
   end subroutine meet

   !> Growth of a threshold until the slider meets it, not more than it is.
   !>
   !> In a time t the slider moves by speed t + pull t^2 + third t^3 + fourth t^4, with an error
   !> that grows as t^3 or, if the motion is known, as t^5; the threshold grows by about
   !> rate t + bend t^2.
   pure subroutine extrapolate(self, ageing, rate, age, gap, speed, direction, resolution, growth, &
      & is_known)
      class(prediction_type), intent(in) :: self
      type(ageing_law_type), intent(in) :: ageing
      !> Rate of the threshold [m/s] and age of the contact [s]
      real(wp), intent(in) :: rate, age
      !> Distance to the threshold [m]; speed of the slider along a direction [m/s], +1 or -1
      real(wp), intent(in) :: gap, speed, direction
      !> Distance below which the slider has met it [m]
      real(wp), intent(in) :: resolution
      !> The growth [m], if it can be extrapolated
      real(wp), intent(inout) :: growth
      logical, intent(out) :: is_known

      real(wp) :: bend, twist, pull, third, fourth, error, later_rate, step, excess, largest, &
         & slope, change
      integer :: number

      is_known = .false.
      if (.not. speed > rate) return
      slope = 1.0_wp / (speed - rate)
      step = gap * slope
      if (.not. step > 0.0_wp) return
      pull = 0.5_wp * direction * self%acceleration
      third = (1.0_wp / 6.0_wp) * direction * self%jerk
      fourth = 0.0_wp
      if (self%is_known) fourth = (1.0_wp / 24.0_wp) * direction * self%snap
      error = self%displacement_error(step)
      if (.not. (error < 0.5_wp * speed .and. (abs(pull) + (abs(third) + abs(fourth) * step) &
         & * step) * step < 0.25_wp * speed)) return

      bend = 0.5_wp * ageing%curvature(rate, age)
      excess = (pull + (third + fourth * step) * step - bend) * step * slope
      ! Terms that cancel in the sum do not in its derivative.
      largest = (abs(pull) + (abs(third) + abs(fourth) * step) * step + abs(bend)) * step * slope
      if (largest <= max_excess .and. abs(bend) * step**3 &
         & <= 0.1_wp * resolution * ageing%time) then
         step = step * (1.0_wp - excess * (1.0_wp - 2.0_wp * excess))
         growth = (rate + bend * step) * step
      else if (largest <= max_fair_excess .and. ageing%is_cubic(rate, age, step, &
         & 0.1_wp * resolution)) then
         step = step * (1.0_wp - excess * (1.0_wp - 2.0_wp * excess))
         twist = ageing%twist(bend, age)
         later_rate = rate + (2.0_wp * bend + 3.0_wp * twist * step) * step
         growth = (rate + (bend + twist * step) * step) * step
         change = (gap + growth - step * (speed + (pull + (third + fourth * step) * step) &
            & * step)) / (speed + (2.0_wp * pull + (3.0_wp * third + 4.0_wp * fourth * step) &
            & * step) * step - later_rate)
         growth = growth + later_rate * change
      else
         if (abs(excess) < max_start_excess) then
            step = step * (1.0_wp - excess * (1.0_wp - 2.0_wp * excess))
         end if
         do number = 1, max_steps
            call ageing%grow(rate, age, step, growth, later_rate)
            slope = speed + (2.0_wp * pull + (3.0_wp * third + 4.0_wp * fourth * step) * step) &
               & * step - later_rate
            if (.not. slope > 0.0_wp) return
            change = (gap + growth - step * (speed + (pull + (third + fourth * step) * step) &
               & * step)) / slope
            step = max(0.0_wp, step + change)
            growth = growth + later_rate * change
            if (abs(change) <= max_change * step) exit
         end do
         if (number > max_steps) return
         growth = max(growth, 0.0_wp)
         ! A slider that slows down arrives later than one at the present speed.
         slope = 1.0_wp / min(speed - rate, slope)
         error = self%displacement_error(step)
      end if
      growth = max(0.0_wp, 1.0_wp - error * slope) * growth
      is_known = .true.
   end subroutine extrapolate

   !> Bound on the error of the displacement that is predicted for a time [s], over that time [m/s].
   pure function displacement_error(self, time) result(error)
      class(prediction_type), intent(in) :: self
      real(wp), intent(in) :: time
      real(wp) :: error

      if (self%is_known) then
         error = (self%crackle_bound / 120.0_wp + self%pop_bound / 720.0_wp * time) * time**4
      else
         error = (1.0_wp / 6.0_wp) * self%jerk_bound * time**2
      end if
   end function displacement_error

   !> Let the laws count displacements from another origin.
   pure subroutine shift(self, distance)
      class(prediction_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: distance

      self%law%offset = self%law%offset - self%law%stiffness * distance
      self%offered%offset = self%offered%offset - self%offered%stiffness * distance
   end subroutine shift

   !> Write the state to an archive, or read it.
   subroutine exchange(self, archive)
      class(prediction_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%exchange("law_stiffness", self%law%stiffness)
      call archive%exchange("law_offset", self%law%offset)
      call archive%exchange("law_drag", self%law%drag)
      call archive%exchange("stiffness_offered", self%offered%stiffness)
      call archive%exchange("offset_offered", self%offered%offset)
      call archive%exchange("drag_offered", self%offered%drag)
      call archive%exchange("acceleration", self%acceleration)
      call archive%exchange("jerk", self%jerk)
      call archive%exchange("jerk_error", self%jerk_error)
      call archive%exchange("jerk_bound", self%jerk_bound)
   end subroutine exchange

end module mesoslip_motion_prediction
