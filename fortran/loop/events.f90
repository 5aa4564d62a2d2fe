!> The loop for sliders that move continuously: one advance, and the events at its end.
module mesoslip_loop_events
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_loop_endings, only: ending_broken, ending_none
   use mesoslip_loop_state, only: state_type
   use mesoslip_loop_transitions, only: change_drive, end_at_avalanches, end_at_displacement, &
      & end_at_slips, end_if_steady, finish, is_broken
   implicit none
   private

   public :: advance_to_event, advance_slider, respond

contains

   !> One advance of the slider, and the events at its end.
   subroutine advance_to_event(state)
      class(state_type), intent(inout) :: state

      type(pose_type) :: before
      type(interface_law_type) :: law
      type(window_type) :: window

      before = state%slider%pose()
      call state%slider%complete_pose(before)
      call state%contacts%offer(before, law, window)
      if (is_broken(state, law, window)) then
         call finish(state, ending_broken)
         return
      end if
      window%end_time = min(window%end_time, state%slider%drive%next_change(), &
         & state%steady%block_end, state%slider%time + state%recorder%max_step())
      call state%stop%limit_window(window, state%slider%origin)

      call advance_slider(state, law, window)
      state%advances = state%advances + 1
      if (allocated(state%slider%failure) .or. allocated(state%contacts%failure)) return
      call state%recorder%record(state%slider, state%contacts%detached_count, &
         & state%contacts%breaks)
      call state%slider%note_extreme()
      call state%avalanches%take_due_snapshots(state%slider, state%contacts)
      call end_at_avalanches(state)
      if (state%ending /= ending_none) return

      call respond(state, before, law)
      call end_at_slips(state)
      call end_at_displacement(state)
      call end_if_steady(state)
      call change_drive(state)
   end subroutine advance_to_event

   !> Advance the slider with the clocks of the contacts.
   subroutine advance_slider(state, law, window)
      class(state_type), intent(inout) :: state
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      if (state%contacts%has_clocks) then
         state%slider%clock = state%contacts%clock
         state%slider%has_clocks = .true.
      end if
      call state%slider%advance(law, window)
      if (state%contacts%has_clocks) state%contacts%clock = state%slider%clock
   end subroutine advance_slider

   !> Contacts respond to a motion; those that break at one displacement are an avalanche.
   subroutine respond(state, before, law)
      class(state_type), intent(inout) :: state
      !> Pose before the motion, and the contact force until now
      type(pose_type), intent(in) :: before
      type(interface_law_type), intent(in) :: law

      call state%contacts%respond(before, state%slider%pose())
      call state%avalanches%count_breaks(state%slider, state%contacts, law)
      call state%avalanches%close(state%slider, state%contacts, state%slider%displacement)
   end subroutine respond

end module mesoslip_loop_events
