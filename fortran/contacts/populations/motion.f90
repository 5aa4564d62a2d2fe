!> Motion of a slider in a step, from where it is and, afterwards, where it was.
module mesoslip_contacts_populations_motion
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: time_to_move, distance_in, excess_of_mean, position_at, max_time, patience

   !> Times beyond which nothing is expected [s]
   real(wp), parameter :: max_time = 1.0e30_wp
   !> A step may last so many times as long as expected
   real(wp), parameter :: patience = 1.5_wp

contains

   !> Time in which the slider will move by a distance, or turn round; huge if it does not move.
   pure function time_to_move(pose, direction, distance) result(time)
      !> Pose of the slider
      type(pose_type), intent(in) :: pose
      !> The direction and the distance [m]
      real(wp), intent(in) :: direction, distance
      !> The time [s]
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

   !> Distance that the slider will move in a time, in its direction.
   pure function distance_in(pose, direction, time) result(distance)
      !> Pose of the slider
      type(pose_type), intent(in) :: pose
      !> The direction and the time [s]
      real(wp), intent(in) :: direction, time
      !> The distance [m]
      real(wp) :: distance

      distance = 0.0_wp
      if (time < max_time) then
         distance = time * (abs(pose%velocity) + 0.5_wp * direction * pose%acceleration * time)
      end if
   end function distance_in

   !> Mean displacement in a step above that of its ends [m].
   pure function excess_of_mean(before, after) result(excess)
      !> Pose of the slider before the motion, and after it
      type(pose_type), intent(in) :: before, after
      real(wp) :: excess

      real(wp) :: distance, duration

      distance = after%displacement - before%displacement
      duration = after%time - before%time
      if (before%inverse_mass > 0.0_wp) then
         ! By the polynomial of fourth order in the time that has the displacements, the velocities
         ! and the last acceleration.
         excess = duration * (before%velocity - after%velocity) / 12.0_wp &
            & + (after%acceleration * duration**2 + 6.0_wp * distance &
            & - duration * (2.0_wp * before%velocity + 4.0_wp * after%velocity)) / 60.0_wp
      else
         ! The acceleration of a motion that is prescribed is constant in a step.
         excess = (distance - after%velocity * duration) / 6.0_wp
      end if
   end function excess_of_mean

   !> Where the slider was at a time of its last motion, by Hermite's interpolation [m].
   pure function position_at(before, after, time) result(displacement)
      !> Pose of the slider before the motion, and after it
      type(pose_type), intent(in) :: before, after
      !> The time [s]
      real(wp), intent(in) :: time
      !> Displacement [m]
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
