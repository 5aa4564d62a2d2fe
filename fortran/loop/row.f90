!> The loop for a row of blocks: a step of the row, in which each block goes from event to event.
module mesoslip_loop_row
   use mesoslip_contacts_row, only: contact_row_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_loop_endings, only: ending_none
   use mesoslip_loop_state, only: max_idle_advances, no_progress, state_type
   use mesoslip_loop_transitions, only: change_drive, end_at_displacement, end_at_slips, &
      & end_if_steady
   use mesoslip_numerics_errors, only: raise, status_invalid, status_stalled
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_sliders_interface_row, only: row_slider_type
   implicit none
   private

   public :: advance_row, start_row

   !> Displacement that is rounding, over the breaking stretch of a contact, and over that of a
   !> block by its static force under all its springs, if contacts are much softer than these
   real(wp), parameter :: tiny_stretch = 4.0e-15_wp, tiny_bend = 4.0e-13_wp
   !> Maximum displacement of a block by what its neighbours do beyond their published motions, over
   !> that: what first order leaves out is then at most some ten times it
   real(wp), parameter :: unknown = 3.0e4_wp

contains

   !> Let the contacts of all blocks offer their laws at the start, and the slider balance them.
   subroutine start_row(state, slider, contacts)
      class(state_type), intent(inout) :: state
      !> Slider and contacts of the state
      class(row_slider_type), intent(inout) :: slider
      class(contact_row_type), intent(inout) :: contacts

      real(wp) :: springs, softest
      integer :: block

      if (size(contacts%block) /= slider%blocks) then
         call raise(contacts%failure, status_invalid, "contacts of another number of blocks")
         return
      end if
      associate (parameters => contacts%parameters)
         slider%pinned_stiffness = parameters%stiffness * maxval(contacts%counts())
         softest = parameters%stiffness * minval(contacts%counts())
         springs = softest + 2.0_wp * slider%neighbour_spring &
            & + slider%edge_stiffness + slider%top_stiffness / slider%blocks
         slider%tiny_displacement = parameters%static_force / parameters%stiffness &
            & * min(tiny_stretch, tiny_bend * softest / springs)
         slider%max_unknown = unknown * slider%tiny_displacement
      end associate
      slider%has_clocks = contacts%has_clocks
      do block = 1, slider%blocks
         slider%block(block)%law = contacts%block(block)%contacts%law()
      end do
      call slider%start(contacts%law())
      slider%sense = slider%drive%direction
      do block = 1, slider%blocks
         contacts%block(block)%pose = slider%block_pose(block)
      end do
      state%start_energy = slider%energy() + contacts%elastic_energy(slider%displacement)
      do block = 1, slider%blocks
         call respond(state, slider, contacts, block, slider%block_pose(block))
         call offer(slider, contacts, block)
      end do
      call note_blocks(state, slider, contacts)
      call contacts%gather()
   end subroutine start_row

   !> A step of the row, with all events in it.
   subroutine advance_row(state, slider, contacts)
      class(state_type), intent(inout) :: state
      !> Slider and contacts of the state
      class(row_slider_type), intent(inout) :: slider
      class(contact_row_type), intent(inout) :: contacts

      type(pose_type) :: pose
      real(wp) :: last_time
      integer :: block, idle
      logical :: asks

      slider%has_clocks = contacts%has_clocks
      if (.not. contacts%keeps_offers) then
         do block = 1, slider%blocks
            call offer(slider, contacts, block)
         end do
      end if
      call slider%begin_step(next_stop(state, slider))
      idle = 0
      last_time = slider%time
      do
         block = slider%next_event()
         if (block == 0) exit
         call slider%stop_block(block, pose, asks)
         if (asks) then
            call respond(state, slider, contacts, block, pose)
            call offer(slider, contacts, block)
            state%advances = state%advances + 1_i8
            if (allocated(contacts%failure)) return
         end if
         call slider%renew(block)
         idle = merge(0, idle + 1, pose%time > last_time)
         last_time = max(last_time, pose%time)
         if (idle > max_idle_advances) then
            call raise(contacts%failure, status_stalled, no_progress)
            return
         end if
      end do
      call slider%end_step()
      state%advances = state%advances + 1_i8
      if (.not. contacts%keeps_offers) then
         do block = 1, slider%blocks
            call respond(state, slider, contacts, block, slider%block_pose(block))
         end do
      end if
      call note_blocks(state, slider, contacts)
      call state%recorder%record(slider, contacts%detached_count, contacts%breaks)
      call slider%note_extreme()
      call state%avalanches%take_due_snapshots(slider, contacts)
      call end_at_slips(state)
      call end_at_displacement(state)
      call end_if_steady(state)
      call change_drive(state)
      if (state%ending /= ending_none) call state%ruptures%finish(block_breaks(contacts))
   end subroutine advance_row

   !> Time at which a step has to end: the drive changes, or a sample is due.
   pure function next_stop(state, slider) result(time)
      class(state_type), intent(in) :: state
      class(row_slider_type), intent(in) :: slider
      real(wp) :: time

      time = min(slider%drive%next_change(), state%steady%block_end, &
         & slider%time + state%recorder%max_step())
      if (state%recorder%trace%next_time > slider%time) then
         time = min(time, state%recorder%trace%next_time)
      end if
      if (state%recorder%slips%trace%next_time > slider%time) then
         time = min(time, state%recorder%slips%trace%next_time)
      end if
   end function next_stop

   !> Let the contacts of a block respond to its motion.
   subroutine respond(state, slider, contacts, block, pose)
      class(state_type), intent(inout) :: state
      class(row_slider_type), intent(inout) :: slider
      class(contact_row_type), intent(inout) :: contacts
      integer, intent(in) :: block
      !> Pose of the block now
      type(pose_type), intent(in) :: pose

      real(wp) :: detached, breaks

      associate (own => contacts%block(block))
         detached = own%contacts%detached_count
         breaks = own%contacts%breaks
         if (slider%has_clocks) then
            own%contacts%clock = slider%block(block)%clock
            own%contacts%clock%elapsed = slider%elapsed(:, block)
         end if
         call own%contacts%respond(own%pose, pose)
         own%pose = pose
         call contacts%add_counts(own%contacts%detached_count - detached, &
            & own%contacts%breaks - breaks)
         slider%detached(block) = own%contacts%detached_count
         if (own%contacts%breaks > breaks) then
            call state%ruptures%note_breaks(block, pose%time, own%contacts%breaks)
         end if
         if (allocated(own%contacts%failure)) contacts%failure = own%contacts%failure
      end associate
   end subroutine respond

   !> Let the contacts of a block offer their law.
   subroutine offer(slider, contacts, block)
      class(row_slider_type), intent(inout) :: slider
      class(contact_row_type), intent(inout) :: contacts
      integer, intent(in) :: block

      type(interface_law_type) :: law
      type(window_type) :: window

      associate (own => contacts%block(block))
         own%pose = slider%block_pose(block)
         call own%contacts%offer(own%pose, law, window)
         call slider%take_law(block, law, window, own%contacts%clock)
      end associate
   end subroutine offer

   !> Keep the places of the blocks for the energy of their contacts, and follow their slips.
   subroutine note_blocks(state, slider, contacts)
      class(state_type), intent(inout) :: state
      class(row_slider_type), intent(in) :: slider
      class(contact_row_type), intent(inout) :: contacts

      real(wp) :: drive_velocity, count
      integer :: block

      drive_velocity = slider%drive%rate_at(slider%time)
      do block = 1, slider%blocks
         associate (own => contacts%block(block))
            count = real(own%contacts%parameters%count, wp)
            if (contacts%keeps_offers) own%pose = slider%block_pose(block)
            call state%ruptures%note_motion(block, slider%time, slider%drive%direction &
               & * (own%pose%velocity - drive_velocity), slider%origin + own%pose%displacement, &
               & slider%block_force(block), own%contacts%breaks, &
               & count - own%contacts%detached_count, &
               & 1.0_wp - own%contacts%detached_count / count)
         end associate
      end do
   end subroutine note_blocks

   !> Breaks so far of each block.
   pure function block_breaks(contacts) result(breaks)
      class(contact_row_type), intent(in) :: contacts
      real(wp) :: breaks(size(contacts%block))

      integer :: block

      do block = 1, size(breaks)
         breaks(block) = contacts%block(block)%contacts%breaks
      end do
   end function block_breaks

end module mesoslip_loop_row
