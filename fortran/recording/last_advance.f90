!> Extremes and events within the last advance of a slider.
module mesoslip_recording_last_advance
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_base, only: motion_type, slider_type
   implicit none
   private

   public :: passage_of_drive, max_velocity

contains

   !> Motion where the velocity passed that of the drive, by bisection.
   pure function passage_of_drive(slider, direction) result(motion)
      class(slider_type), intent(in) :: slider
      !> Sign of the velocity of the drive
      real(wp), intent(in) :: direction
      type(motion_type) :: motion

      integer, parameter :: max_bisections = 50
      real(wp) :: early, late
      logical :: was_faster
      integer :: bisection

      early = slider%step_time
      late = slider%time
      was_faster = .not. is_faster(slider%velocity + slider%base_velocity, slider%time)
      motion = slider%observe(early)
      do bisection = 1, max_bisections
         motion = slider%observe(0.5_wp * (early + late))
         if (is_faster(motion%velocity + motion%base_velocity, motion%time) .eqv. was_faster) then
            early = motion%time
         else
            late = motion%time
         end if
         if (late - early <= spacing(late)) exit
      end do

   contains

      !> Whether the force falls at a velocity.
      pure logical function is_faster(velocity, time)
         real(wp), intent(in) :: velocity, time

         is_faster = direction * (velocity - slider%drive%rate_at(time)) > 0.0_wp
      end function is_faster

   end function passage_of_drive

   !> Maximum of the velocity in a direction, +1 or -1, by golden section [m/s].
   pure function max_velocity(slider, direction) result(velocity)
      class(slider_type), intent(in) :: slider
      real(wp), intent(in) :: direction
      real(wp) :: velocity

      integer, parameter :: sections = 40
      real(wp), parameter :: golden = 0.5_wp * (sqrt(5.0_wp) - 1.0_wp)
      real(wp) :: early, late
      type(motion_type) :: left, right
      integer :: section

      early = slider%step_time
      late = slider%time
      left = slider%observe(late - golden * (late - early))
      right = slider%observe(early + golden * (late - early))
      do section = 1, sections
         if (direction * left%velocity > direction * right%velocity) then
            late = right%time
            right = left
            left = slider%observe(late - golden * (late - early))
         else
            early = left%time
            left = right
            right = slider%observe(early + golden * (late - early))
         end if
      end do
      velocity = left%velocity
   end function max_velocity

end module mesoslip_recording_last_advance
