!> Steps of a rigid slider that has settled to rest, or to uniform creep with its drive.
!>
!> Pinned contacts, and a damper or drag, lead to this. In a long hold a contact that breaks by
!> thermal activation shakes the slider, and then nothing happens for a long time.
module mesoslip_sliders_rigid_settled_step
   use mesoslip_interface_law, only: window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_hazard_clock, only: advance_clocks
   use mesoslip_sliders_motion_series, only: long_time, rounding
   use mesoslip_sliders_rigid_state, only: arrive, few_terms, motion_rates_type, pull, &
      & rigid_state_type, system_type, uniform_gap
   implicit none
   private

   public :: try_settled_step

contains

   !> Move uniformly to the first end of a window or until a clock is due, if the motion differs
   !> from this by less than rounding or the resolution of the contact force.
   subroutine try_settled_step(self, system, window, early, is_done)
      class(rigid_state_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Whether the step was made; if not, the motion has not changed
      logical, intent(out) :: is_done

      real(wp) :: velocity, noise, step, target, end_time
      logical :: crosses, is_due
      type(motion_rates_type) :: late

      is_done = .false.
      if (.not. (self%law%stiffness > 0.0_wp .and. system%drag + self%damping > 0.0_wp)) return
      velocity = system%driving / system%stiffness
      noise = rounding * self%stiffness * abs(system%drive_gap) + rounding &
         & * (abs(self%law%stiffness * self%displacement) + abs(self%law%offset))
      step = window%end_time - self%time
      if (self%law%tolerance > noise .and. step * sqrt(system%stiffness) > long_time) then
         ! The slider is in balance at the end of the step.
         noise = self%law%tolerance
         velocity = velocity + early%acceleration / (system%stiffness * step)
      end if
      is_done = step > 0.0_wp &
         & .and. self%mass * max(abs(early%acceleration), abs(early%damper)) <= noise &
         & .and. self%mass * sqrt(system%stiffness) * abs(early%velocity - velocity) <= noise
      if (.not. is_done) return

      end_time = window%end_time
      target = merge(window%upper, window%lower, velocity > 0.0_wp)
      crosses = abs(velocity) > 0.0_wp &
         & .and. abs(velocity) * step >= abs(target - self%displacement)
      if (crosses) step = abs(target - self%displacement) / abs(velocity)
      self%terms = few_terms
      self%series(:few_terms - 1) = 0.0_wp
      self%series(0) = velocity
      is_due = .false.
      if (self%has_clocks) call advance_clocks(self%clock, self%series, 1, step, is_due)
      crosses = crosses .and. .not. is_due
      if (crosses .or. is_due) end_time = self%time + step

      self%time = end_time
      self%displacement = self%displacement + velocity * step
      if (crosses) self%displacement = target
      self%velocity = velocity
      self%damper = 0.0_wp
      call pull(self, system%drive_gap, step, 0.5_wp * velocity * step**2)
      call arrive(self, system, early, uniform_gap(self), late)
      call self%drag_loss%add(self%law%drag * velocity**2 * step)
   end subroutine try_settled_step

end module mesoslip_sliders_rigid_settled_step
