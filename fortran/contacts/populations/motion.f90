!> Motion of a slider in a step: predicted before it, interpolated afterwards.
module mesoslip_contacts_populations_motion
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: time_to_move, time_after, distance_in, excess_of_mean, position_at, max_time, patience

   !> Time beyond which no event is expected [s]
   real(wp), parameter :: max_time = 1.0e30_wp
   !> Maximum duration of a step over the expected one
   real(wp), parameter :: patience = 1.5_wp

contains

   !> Time in which the slider moves by a distance [m] in a direction, or until it turns round [s];
   !> huge if it does not move.
   pure function time_to_move(pose, direction, distance) result(time)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: direction, distance
      real(wp) :: time

      real(wp) :: speed, square

      speed = abs(pose%velocity)
      square = speed**2 + 2.0_wp * direction * pose%acceleration * distance
      time = huge(1.0_wp)
      if (square > 0.0_wp) then
         speed = speed + sqrt(square)
         if (speed > distance / time) time = 2.0_wp * distance / speed
      else if (speed > 0.0_wp) then
         time = speed / abs(pose%acceleration)
      end if
   end function time_to_move

   !> Time later by a duration, and at least the next number [s].
   elemental function time_after(time, duration)
      real(wp), intent(in) :: time, duration
      real(wp) :: time_after

      time_after = max(time + duration, nearest(time, 1.0_wp))
   end function time_after

   !> Distance that the slider moves in a direction, its own, in a time [s].
   pure function distance_in(pose, direction, time) result(distance)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: direction, time
      real(wp) :: distance

      distance = 0.0_wp
      if (time < max_time) then
         distance = time * (abs(pose%velocity) + 0.5_wp * direction * pose%acceleration * time)
      end if
   end function distance_in

   !> Mean displacement in a step minus the mean of those at its ends [m].
   pure function excess_of_mean(before, after) result(excess)
      type(pose_type), intent(in) :: before, after
      real(wp) :: excess

      real(wp) :: distance, duration

      distance = after%displacement - before%displacement
      duration = after%time - before%time
      if (before%inverse_mass > 0.0_wp) then
         ! By the polynomial of fourth order in time with the displacements, the velocities and the
         ! last acceleration.
         excess = duration * (before%velocity - after%velocity) / 12.0_wp &
            & + (after%acceleration * duration**2 + 6.0_wp * distance &
            & - duration * (2.0_wp * before%velocity + 4.0_wp * after%velocity)) / 60.0_wp
      else
         ! The acceleration of a prescribed motion is constant in a step.
         excess = (distance - after%velocity * duration) / 6.0_wp
      end if
   end function excess_of_mean

   !> Displacement of the slider at a time of its last motion, by Hermite's interpolation [m].
   elemental function position_at(before, after, time) result(displacement)
      type(pose_type), intent(in) :: before, after
      real(wp), intent(in) :: time
      real(wp) :: displacement

      real(wp) :: length, t, s

      length = after%time - before%time
      displacement = after%displacement
      if (.not. length > 0.0_wp) return
      t = min(1.0_wp, max(0.0_wp, (time - before%time) / length))
      s = 1.0_wp - t
      displacement = s**2 * ((1.0_wp + 2.0_wp * t) * before%displacement &
         & + t * length * before%velocity) &
         & + t**2 * ((1.0_wp + 2.0_wp * s) * after%displacement - s * length * after%velocity)
   end function position_at

end module mesoslip_contacts_populations_motion
