!> A rigid slider in a schedule of contacts without clocks, under a drive of constant velocity.
!>
!> Nearly all steps are short ones. The end of a step is known only after a chain of operations,
!> each of which waits for the one before, and the processor cannot predict whether a contact breaks
!> or attaches then. Meanwhile work and losses of the step before are added up.
module mesoslip_sliders_rigid_run_through
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_schedule, only: schedule_type
   use mesoslip_sliders_rigid_long_step, only: take_long_step
   use mesoslip_sliders_rigid_short_step, only: audit, books_of, derive, find_end, keep_series, &
      & look_ahead, move, short_step_type, step_books_type
   use mesoslip_sliders_rigid_state, only: constants, drive_gap_at, motion_rates, &
      & rigid_motion_type, rigid_state_type, system_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: run_through

contains

   !> The procedure run_ahead of such a slider.
   subroutine run_through(self, schedule, filter)
      class(rigid_state_type), intent(inout) :: self
      type(schedule_type), intent(inout) :: schedule
      type(step_filter_type), intent(inout) :: filter

      type(system_type) :: system
      type(interface_law_type) :: law
      type(window_type) :: window
      type(rigid_motion_type) :: motion
      type(short_step_type) :: step
      type(step_books_type) :: books
      real(wp) :: step_time, start_displacement
      logical :: is_short, is_pending

      system = constants(self)
      motion = self%motion()
      is_pending = .false.
      do
         step_time = motion%time
         start_displacement = motion%displacement
         law = schedule%law()
         window = schedule%window(motion%time)
         system%stiffness = system%spring + law%stiffness * system%inverse_mass
         system%drag = law%drag * system%inverse_mass
         step%drive_gap = drive_gap_at(self, motion)
         step%early = motion_rates(system, self%damping, motion, step%drive_gap, &
            & law%stiffness * motion%displacement - law%offset)
         call look_ahead(motion, window, step)
         call derive(system, self%damping, step)
         if (is_pending) call audit(self, books, motion)
         call find_end(system, self%damping, step, is_short)
         if (is_short) then
            call move(self, system, law, step, motion)
            books = books_of(step, law%drag)
         else
            call self%take_motion(motion)
            self%law = law
            self%step_time = step_time
            self%start_displacement = start_displacement
            system%drive_gap = step%drive_gap
            call take_long_step(self, system, window, step%early)
            motion = self%motion()
            step%acceleration = self%acceleration
         end if
         is_pending = is_short

         call filter%examine(motion%time, motion%velocity, step%early%acceleration, &
            & step%acceleration)
         if (filter%is_selected .or. motion%direction * schedule%direction < 0.0_wp) exit
         call schedule%pass(motion%time, motion%displacement)
         if (schedule%is_over .or. filter%steps >= filter%max_steps) exit
      end do
      if (.not. is_pending) return
      call audit(self, books, motion)
      call keep_series(self, step)
      call self%take_motion(motion)
      self%law = law
      self%step_time = step_time
      self%start_displacement = start_displacement
      self%start_acceleration = step%early%acceleration
      self%acceleration = step%acceleration
   end subroutine run_through

end module mesoslip_sliders_rigid_run_through
