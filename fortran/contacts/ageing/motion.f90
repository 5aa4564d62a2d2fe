!> The motion of the slider for which contacts that age are queued: steady, or a maximum speed.
module mesoslip_contacts_ageing_motion
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type
   use mesoslip_contacts_ageing_steady, only: begin_steady, end_steady
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: follow_motion, bound_speed, min_ratio

   !> Speed of the queue over that of the slider: when it is set, and when it is too low or too high
   real(wp), parameter :: set_ratio = 2.0_wp, min_speed_ratio = 1.3_wp, max_speed_ratio = 8.0_wp
   !> Speed over that of ageing below which contacts are old where they break
   real(wp), parameter :: min_ratio = 0.05_wp
   !> Maximum duration for which a bound on the velocity is extrapolated [s]
   real(wp), parameter :: max_time = 1.0e9_wp

contains

   !> Prepare the queue for the present motion of the slider, steady or not.
   subroutine follow_motion(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      logical :: is_steady

      is_steady = self%direction * pose%velocity > 0.0_wp .and. .not. self%jumps &
         & .and. .not. abs(pose%acceleration) > 0.0_wp
      if (self%is_steady) then
         if (is_steady .and. .not. abs(abs(pose%velocity) - self%speed) > 0.0_wp) return
         call end_steady(self, pose)
      end if
      if (is_steady) then
         call begin_steady(self, pose)
      else if (self%may_outrun) then
         call set_speed(self, pose)
      end if
   end subroutine follow_motion

   !> Keep the speed of the queue above that of the slider, but not far above.
   subroutine set_speed(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: min_speed

      min_speed = min_ratio * self%stretch * self%ageing%inverse_time
      if (min_speed_ratio * abs(pose%velocity) > self%speed) then
         self%speed = max(set_ratio * abs(pose%velocity), min_speed)
         call self%solve_all(pose)
      else if (self%solved > self%parameters%count &
         & .and. max_speed_ratio * max(abs(pose%velocity), min_speed) < self%speed) then
         ! Limits for a higher speed are lower bounds for a lower one, too.
         self%speed = max(set_ratio * abs(pose%velocity), min_speed)
         self%solved = 0
      end if
   end subroutine set_speed

   !> End a window before the slider may become faster than the speed of the queue.
   pure subroutine bound_speed(self, pose, end_time)
      class(ageing_contacts_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      real(wp), intent(inout) :: end_time

      real(wp) :: room, pull, bend, time

      room = self%speed - abs(pose%velocity)
      pull = abs(self%prediction%acceleration)
      bend = 0.5_wp * (abs(self%prediction%jerk) + self%prediction%jerk_bound)
      time = min(end_time - pose%time, max_time)
      if (2.0_wp * (pull + bend * time) * time <= room) return
      if (4.0_wp * pull * time > room) time = 0.25_wp * room / pull
      if (4.0_wp * bend * time**2 > room) time = sqrt(0.25_wp * room / bend)
      end_time = min(end_time, max(pose%time + time, nearest(pose%time, 1.0_wp)))
   end subroutine bound_speed

end module mesoslip_contacts_ageing_motion
