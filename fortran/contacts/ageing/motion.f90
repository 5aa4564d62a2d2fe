!> The motion of the slider for which contacts that age are queued: steady, or any.
module mesoslip_contacts_ageing_motion
   use mesoslip_contacts_ageing_base, only: ageing_contacts_type
   use mesoslip_contacts_ageing_steady, only: begin_steady
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: follow_motion

contains

   !> Prepare the queue for the present motion of the slider, steady or not.
   subroutine follow_motion(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      logical :: is_steady

      ! A slider with inertia that does not accelerate for a moment is not steady.
      is_steady = pose%is_uniform .and. self%direction * pose%velocity > 0.0_wp &
         & .and. .not. self%jumps
      if (self%is_steady) then
         if (is_steady .and. .not. abs(abs(pose%velocity) - self%speed) > 0.0_wp) return
         self%is_steady = .false.
      end if
      if (is_steady) then
         call begin_steady(self, pose)
      else if (self%speed < huge(1.0_wp)) then
         self%speed = huge(1.0_wp)
         call self%solve_all(pose)
      end if
   end subroutine follow_motion

end module mesoslip_contacts_ageing_motion
