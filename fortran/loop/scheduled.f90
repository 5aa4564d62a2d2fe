!> The loop for sliders that run through a schedule of events, where nothing needs each of them.
module mesoslip_loop_scheduled
   use mesoslip_interface_law, only: pose_type
   use mesoslip_loop_events, only: advance_to_event, respond
   use mesoslip_loop_segment, only: segment_type
   use mesoslip_loop_state, only: state_type
   use mesoslip_loop_transitions, only: change_drive, end_at_displacement, end_at_slips, &
      & end_if_steady, shift_stretches
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_sliders_scheduled, only: scheduled_slider_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: advance_through_schedule

   !> Length of a schedule from which it costs less than its events one by one
   integer, parameter :: min_length = 4

contains

   !> Some advances of the slider through a schedule, or one without a schedule.
   subroutine advance_through_schedule(state, segment)
      !> The state; its slider can run through schedules
      class(state_type), intent(inout) :: state
      type(segment_type), intent(in) :: segment

      call plan(state)
      if (state%schedule%is_over) then
         call advance_to_event(state)
      else
         call run_ahead(state, segment%last_advance(state%advances, &
            & state%slider%cost + state%contacts%cost))
      end if
   end subroutine advance_through_schedule

   !> Let the contacts write a schedule, if nothing needs each event.
   subroutine plan(state)
      class(state_type), intent(inout) :: state

      type(pose_type) :: pose

      state%schedule%is_over = .true.
      if (state%max_schedule == 0 .or. state%avalanches%needs_each() &
         & .or. abs(state%slider%drive%acceleration) > 0.0_wp &
         & .or. state%contacts%schedule_length < min_length) return
      pose = state%slider%pose()
      call state%slider%complete_pose(pose)
      call state%contacts%plan(pose, min(state%max_schedule, state%contacts%schedule_length), &
         & state%schedule)
      call state%stop%limit_schedule(state%schedule, state%slider%origin)
      state%schedule%end_time = min(state%slider%drive%end_of_part(), state%steady%block_end, &
         & state%schedule%site_time(state%schedule%sites + 1))
      state%schedule%max_step = state%recorder%max_step()
      state%schedule%mean_stiffness = state%contacts%parameters%stiffness
      state%schedule%max_force = shift_stretches * state%contacts%parameters%static_force
      if (.not. state%schedule%is_over) call state%schedule%look_ahead(pose)
   end subroutine plan

   !> The slider runs ahead through the schedule, and contacts keep their books afterwards.
   subroutine run_ahead(state, last)
      class(state_type), intent(inout) :: state
      !> The advance after which to stop
      integer(i8), intent(in) :: last

      type(pose_type) :: before
      logical :: turns

      before = state%slider%pose()
      do
         call take_steps(state, last)
         turns = state%slider%direction * state%schedule%direction < 0.0_wp
         if (turns .or. state%schedule%is_over .or. state%advances >= last) exit
         if (state%recorder%is_full()) exit
         if (state%recorder%slips%count >= state%stop%max_slips) exit
      end do
      call state%contacts%settle(state%schedule, state%slider%pose())
      call state%avalanches%count_others(state%schedule%moments, state%contacts%breaks)
      ! The schedule was for the other direction: the contacts decide what is due at the turn, and
      ! what breaks on the way back.
      if (turns .or. state%schedule%at_bound) call respond(state, before, state%contacts%law())
      call end_at_slips(state)
      call end_at_displacement(state)
      call end_if_steady(state)
      call change_drive(state)
   end subroutine run_ahead

   !> Steps up to one that is of interest, which is recorded.
   subroutine take_steps(state, last)
      class(state_type), intent(inout) :: state
      !> The advance after which to stop
      integer(i8), intent(in) :: last

      type(step_filter_type) :: filter
      type(pose_type) :: pose

      filter = state%recorder%step_filter(state%slider)
      call state%slider%select_extremes(filter)
      filter%max_steps = last - state%advances
      select type (slider => state%slider)
      class is (scheduled_slider_type)
         call slider%run_ahead(state%schedule, filter)
      end select
      state%advances = state%advances + filter%steps
      call state%recorder%slips%skip_steps(filter)
      if (.not. filter%is_selected) return
      call state%recorder%record(state%slider, real(state%schedule%detached, wp), &
         & state%contacts%breaks + state%schedule%break_count())
      call state%slider%note_extreme()
      if (state%slider%direction * state%schedule%direction < 0.0_wp) return
      call state%schedule%pass(state%slider%time, state%slider%displacement)
      if (state%schedule%is_over) return
      pose = state%slider%pose()
      call state%slider%complete_pose(pose)
      call state%schedule%look_ahead(pose)
   end subroutine take_steps

end module mesoslip_loop_scheduled
