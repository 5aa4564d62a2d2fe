!> The steps after an advance: the next part of the drive, the end of the run, another origin.
module mesoslip_loop_transitions
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_loop_endings, only: ending_avalanches, ending_displacement, ending_drive, &
      & ending_none, ending_slides, ending_slips, ending_steady
   use mesoslip_loop_state, only: state_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: finish, is_broken, look_for_steady, change_drive, take_next_part, shift_origin, &
      & shift_stretches
   public :: end_at_avalanches, end_at_slips, end_at_displacement, end_if_steady

   !> Time at which nothing happens
   real(wp), parameter :: never = huge(1.0_wp)
   !> The origin of displacements moves when the slider is this many breaking stretches ahead
   real(wp), parameter :: shift_stretches = 64.0_wp
   !> Relative difference from which velocities of the drive are different
   real(wp), parameter :: tiny_part = 1.0e-9_wp

contains

   !> End the run.
   subroutine finish(state, ending)
      class(state_type), intent(inout) :: state
      !> An ending_ code
      integer, intent(in) :: ending

      ! A slide without end is no avalanche.
      if (ending /= ending_slides) then
         call state%avalanches%close(state%slider, state%contacts, state%slider%displacement)
      end if
      call state%recorder%slips%finish()
      call state%stages%finish(state%slider)
      state%ending = ending
   end subroutine finish

   !> Whether all contacts are broken, in a run that would continue until one breaks.
   pure function is_broken(state, law, window)
      class(state_type), intent(in) :: state
      !> The law that the contacts offer
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window
      logical :: is_broken

      is_broken = .not. (abs(law%stiffness) > 0.0_wp .or. window%end_time < never &
         & .or. state%slider%drive%end_of_part() < never .or. state%avalanches%size > 0.0_wp)
   end function is_broken

   !> End the run at the requested number of avalanches.
   subroutine end_at_avalanches(state)
      class(state_type), intent(inout) :: state

      if (state%avalanches%avalanches >= state%avalanches%parameters%max_avalanches) then
         call finish(state, ending_avalanches)
      end if
   end subroutine end_at_avalanches

   !> End the run at the requested number of slips.
   subroutine end_at_slips(state)
      class(state_type), intent(inout) :: state

      if (state%recorder%slips%count >= state%stop%max_slips) call finish(state, ending_slips)
   end subroutine end_at_slips

   !> End the run if the slider has reached the requested displacement.
   subroutine end_at_displacement(state)
      class(state_type), intent(inout) :: state

      if (state%ending /= ending_none) return
      if (state%stop%is_reached(state%slider)) call finish(state, ending_displacement)
   end subroutine end_at_displacement

   !> End the run if a block of the drive is over and the state is steady.
   subroutine end_if_steady(state)
      class(state_type), intent(inout) :: state

      logical :: is_steady

      if (state%ending /= ending_none .or. state%slider%time < state%steady%block_end) return
      call state%steady%end_block(state%slider%drive%stage_impulse(), is_steady)
      if (is_steady) call finish(state, ending_steady)
   end subroutine end_if_steady

   !> In the last part of the drive, at a constant velocity, look for a steady state.
   subroutine look_for_steady(state)
      class(state_type), intent(inout) :: state

      associate (drive => state%slider%drive)
         if (.not. drive%is_last_part() .or. abs(drive%acceleration) > 0.0_wp) return
         call state%steady%begin(state%slider%time, drive%rate, drive%stage_impulse())
      end associate
   end subroutine look_for_steady

   !> Begin the next part of the drive, or end the run; move the origin along.
   subroutine change_drive(state)
      class(state_type), intent(inout) :: state

      if (state%ending /= ending_none) return
      ! An avalanche under a slider without inertia has to end before a part of the drive does.
      if (state%slider%time >= state%slider%drive%next_change() &
         & .and. .not. state%avalanches%size > 0.0_wp) then
         if (state%slider%time < state%slider%drive%end_of_part()) then
            call state%slider%drive%turn_round(state%slider%time)
            call state%slider%adapt_to_drive()
            call state%slider%mark_extreme()
            state%recorder%slips%drive_changes = .true.
         else if (state%slider%drive%is_last_part()) then
            call finish(state, ending_drive)
            return
         else
            if (state%slider%drive%is_stage_over()) call state%stages%finish(state%slider)
            call take_next_part(state)
         end if
      end if
      call shift_origin(state)
   end subroutine change_drive

   !> Begin the next part of the drive, perhaps of another stage.
   subroutine take_next_part(state)
      class(state_type), intent(inout) :: state

      real(wp) :: rate, direction
      logical :: is_new

      is_new = state%slider%drive%is_stage_over()
      rate = state%slider%drive%rate_at(state%slider%time)
      direction = state%slider%drive%direction
      call state%slider%drive%take_next_part(state%slider%time)
      call state%slider%adapt_to_drive()
      if (is_new) then
         call state%stages%begin(state%slider, state%slider%drive%stage())
      else
         call state%slider%mark_extreme()
      end if
      call look_for_steady(state)
      associate (drive => state%slider%drive)
         is_new = is_new .and. abs(drive%rate - rate) > tiny_part * max(abs(rate), abs(drive%rate))
         if (is_new .or. abs(drive%direction - direction) > 0.0_wp) then
            state%recorder%slips%drive_changes = .true.
         end if
      end associate
   end subroutine take_next_part

   !> Move the origin of displacements along with the slider.
   subroutine shift_origin(state)
      class(state_type), intent(inout) :: state

      real(wp) :: grid, shift

      associate (parameters => state%contacts%parameters)
         if (abs(state%slider%displacement) * parameters%stiffness &
            & < shift_stretches * parameters%static_force) return
         ! On a grid of powers of two the origin and the new displacement have no rounding error.
         grid = scale(1.0_wp, exponent(parameters%static_force / parameters%stiffness))
      end associate
      shift = grid * anint(state%slider%displacement / grid)
      call state%slider%shift_origin(shift)
      call state%contacts%shift_origin(shift, state%slider%displacement)
   end subroutine shift_origin

end module mesoslip_loop_transitions
