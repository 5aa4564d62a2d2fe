!> The loop for sliders without inertia: contacts break in avalanches while time stands still.
module mesoslip_loop_instant
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_loop_endings, only: ending_broken, ending_none, ending_slides
   use mesoslip_loop_events, only: advance_slider
   use mesoslip_loop_segment, only: segment_type
   use mesoslip_loop_state, only: state_type
   use mesoslip_loop_transitions, only: change_drive, end_at_avalanches, end_at_displacement, &
      & end_at_slips, end_if_steady, finish, is_broken, shift_origin
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_sliders_instant, only: instant_slider_type
   implicit none
   private

   public :: advance_in_equilibrium

contains

   !> Some advances of the slider up to its equilibrium, and with the drive from there; or a part of
   !> an avalanche in which a segment ends.
   subroutine advance_in_equilibrium(state, slider, segment)
      class(state_type), intent(inout), target :: state
      !> The slider of the state
      class(instant_slider_type), intent(inout), target :: slider
      type(segment_type), intent(in) :: segment

      type(pose_type) :: before
      type(interface_law_type) :: law

      call jump(state, slider, segment, before, law)
      if (state%ending /= ending_none) return
      if (allocated(slider%failure) .or. allocated(state%contacts%failure)) return
      if (slider%is_unbound) then
         call finish(state, ending_broken)
         return
      end if
      if (state%avalanches%size > max_size(state, slider)) then
         call finish(state, ending_slides)
         return
      end if
      call state%recorder%record(slider, state%contacts%detached_count, state%contacts%breaks)
      if (slider%is_settled) then
         call state%avalanches%close(slider, state%contacts, slider%rest_displacement)
      end if
      call state%avalanches%take_due_snapshots(slider, state%contacts)
      call end_at_avalanches(state)
      ! It jumps past a displacement: the run ends where it rests.
      if (slider%is_settled) call end_at_displacement(state)
      if (state%ending /= ending_none) return

      call state%contacts%respond(before, slider%pose())
      call state%avalanches%count_breaks(slider, state%contacts, law)
      call end_at_slips(state)
      call end_if_steady(state)
      call change_drive(state)
   end subroutine advance_in_equilibrium

   !> Jump from contact to contact until there is an equilibrium, then move with the drive.
   subroutine jump(state, slider, segment, before, law)
      class(state_type), intent(inout), target :: state
      class(instant_slider_type), intent(inout), target :: slider
      type(segment_type), intent(in) :: segment
      !> Pose before the last advance, and the contact force in it
      type(pose_type), intent(out) :: before
      type(interface_law_type), intent(out) :: law

      type(window_type) :: window, motion
      real(wp) :: end_time, max_breaks
      integer(i8) :: last

      last = segment%last_advance(state%advances, slider%cost + state%contacts%cost)
      end_time = min(slider%drive%next_change(), state%steady%block_end, &
         & slider%time + state%recorder%max_step())
      max_breaks = max_size(state, slider)
      before = slider%pose()
      call state%contacts%offer(before, law, window)
      if (is_broken(state, law, window)) then
         call finish(state, ending_broken)
         return
      end if
      do
         window%end_time = min(window%end_time, end_time)
         motion = window_type()
         call state%stop%limit_window(motion, slider%origin)
         slider%stop_upper = motion%upper
         slider%stop_lower = motion%lower
         call advance_slider(state, law, window)
         state%advances = state%advances + 1
         if (state%advances >= last .or. state%contacts%breaks > segment%max_breaks) exit
         if (slider%is_settled .or. slider%is_unbound) exit
         call state%contacts%respond(before, slider%pose())
         call state%avalanches%count_breaks(slider, state%contacts, law)
         if (allocated(state%contacts%failure) .or. state%avalanches%size > max_breaks) exit
         call shift_origin(state)
         before = slider%pose()
         call state%contacts%offer(before, law, window)
      end do
   end subroutine jump

   !> Breaks in an avalanche beyond which contacts break without end.
   pure function max_size(state, slider) result(breaks)
      class(state_type), intent(in), target :: state
      class(instant_slider_type), intent(in), target :: slider
      real(wp) :: breaks

      breaks = slider%max_breaks
      if (breaks < huge(1.0_wp)) breaks = breaks * state%contacts%parameters%count
   end function max_size

end module mesoslip_loop_instant
