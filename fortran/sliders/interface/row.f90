!> Motion of a row of blocks from event to event, with a clock for each block (section 16).
!>
!> A step of the row is so short that the motion of each block in it is a polynomial, exact to
!> rounding, if no contact breaks or attaches: the published motion, which its neighbours feel.
!> A block whose contacts change continues on a motion of its own. What its excess over the
!> published motion does to its neighbours grows with the third or fourth power of time: it is added
!> to their motions at their own events and at the end of the step, exact to first order, or before
!> it is too large for that. So an event costs the work of one block, however long the row, and the
!> step what its blocks cost side by side; steps are shorter while that saves more than it costs.
module mesoslip_sliders_interface_row
   use mesoslip_interface_law, only: clocks, hazard_clock_type, interface_law_type, pose_type, &
      & window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_hazard_clock, only: advance_clocks, limit_window
   use mesoslip_sliders_interface_excess, only: note_excess, receive, receive_all
   use mesoslip_sliders_interface_losses, only: add_losses, add_published_losses
   use mesoslip_sliders_interface_polynomials, only: bound, evaluate, evaluate_all, integrals, &
      & max_order, moments
   use mesoslip_sliders_interface_rest, only: try_rest
   use mesoslip_sliders_interface_series, only: drive_at, expand, expand_all, fastest_rate, &
      & expand_published, shorten_step, whole_length
   use mesoslip_sliders_interface_state, only: add_exactly, busy_pace, excess_type, load_motion, &
      & min_order, min_pace, motion_of_damper, quiet_pace, row_state_type
   use mesoslip_sliders_motion_series, only: first_end, inverse
   implicit none
   private

   public :: row_slider_type

   !> What ends the motion of a block: nothing in this step; the end of the window's time; its
   !> upper and lower ends; a turning point; a clock; the end of its polynomial; its neighbours have
   !> to know of it
   integer, parameter :: event_none = 0, event_time = 1, event_upper = 2, event_lower = 3, &
      & event_turn = 4, event_clock = 5, event_again = 6, event_publish = 7

   !> Blocks in a row that move from event to event.
   type, abstract, extends(row_state_type) :: row_slider_type
   contains
      procedure, non_overridable :: begin_step, next_event, stop_block, take_law, renew, end_step
   end type row_slider_type

contains

   !> Begin a step that ends at a time or before: the motion of all blocks if nothing happens.
   subroutine begin_step(self, end_time)
      class(row_slider_type), intent(inout) :: self
      !> Time [s]
      real(wp), intent(in) :: end_time

      integer :: block, order

      self%step_time = self%time
      self%base_time = self%time
      self%end_time = end_time
      self%moment = 0.0_wp
      self%excess_once = 0.0_wp
      self%excess_twice = 0.0_wp
      self%excess_thrice = 0.0_wp
      self%known = excess_type()
      self%known_moment = 0.0_wp
      self%publications = 0
      do block = 1, self%blocks
         associate (law => self%block(block)%law)
            self%law_stiffness(block) = law%stiffness
            self%law_drag(block) = law%drag
         end associate
      end do
      self%block%is_own = .false.
      self%block%exceeds = .false.
      self%events = 0
      self%pulled_once = 0.0_wp
      self%pulled_lever = 0.0_wp
      self%drag_part = 0.0_wp
      self%damping_part = 0.0_wp
      call self%sum_motion(1)

      self%length = end_time - self%time
      self%reaches_end = .true.
      self%rests = .false.
      self%rate = fastest_rate(self)
      if (self%is_quiet) call try_rest(self)
      if (.not. self%rests) then
         if (self%length * self%rate > self%pace) then
            self%length = whole_length(self, self%pace / self%rate)
            self%reaches_end = .false.
         end if
         self%order = max_order
         do order = min_order, max_order
            if (self%rate * self%length <= self%reach(order)) then
               self%order = order
               exit
            end if
         end do
         call expand_all(self)
      end if
      call predict_all(self)
      ! A long step ends with its first event: in a short one more of them cost less.
      self%ends_at_event = self%queue%first_time() < self%length &
         & .and. (self%rests .or. self%pace > 2.0_wp * busy_pace)
      if (self%ends_at_event) then
         self%length = whole_length(self, self%queue%first_time())
         self%reaches_end = .false.
      end if
   end subroutine begin_step

   !> Find what ends the motion of each block, unless all goes on as published.
   subroutine predict_all(self)
      class(row_state_type), intent(inout) :: self

      real(wp) :: way(self%blocks)
      integer :: block, term

      way = abs(self%published(:, self%order))
      do term = self%order - 1, 1, -1
         way = way * self%length + abs(self%published(:, term))
      end do
      way = way * self%length
      do block = 1, self%blocks
         self%block(block)%kind = event_none
         self%span(block) = huge(1.0_wp)
         self%horizon(block) = self%length
         associate (window => self%block(block)%window)
            if (.not. (way(block) < min(window%upper - self%place(block), self%place(block) &
               & - window%lower) .and. window%end_time - self%base_time > self%length) &
               & .or. self%has_clocks) call predict(self, block)
         end associate
         call self%queue%put(block, self%span(block))
      end do
      call self%queue%rebuild()
   end subroutine predict_all

   !> Find what ends the motion of a block, and when.
   subroutine predict(self, block)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block

      type(window_type) :: window
      type(hazard_clock_type) :: clock(clocks)
      real(wp) :: series(0:max_order), velocity(0:max_order), step, longest, change
      real(wp) :: above, below, direction
      integer :: order, term
      logical :: crosses, turns, is_due

      call load_motion(self, block, series, order)
      window = self%block(block)%window
      if (self%has_clocks) call limit_window(self%block(block)%clock, self%base_time &
         & + self%moment(block), self%speed(block), window)
      associate (kind => self%block(block)%kind)
         kind = event_none
         step = self%length
         if (self%horizon(block) < self%length) then
            kind = event_again
            step = self%horizon(block)
         end if
         if (window%end_time - self%base_time <= step) then
            kind = event_time
            step = window%end_time - self%base_time
         end if
         step = max(0.0_wp, step - self%moment(block))
         do term = 0, order - 1
            velocity(term) = (term + 1) * series(term + 1)
         end do
         change = 0.0_wp
         do term = order - 1, 1, -1
            change = (change + abs(velocity(term))) * step
         end do
         above = window%upper - series(0)
         below = window%lower - series(0)
         if (step > 0.0_wp .and. .not. (abs(velocity(0)) + change) * step < min(above, -below)) then
            longest = step
            call first_end(velocity, order, above, below, change, step, crosses, turns, direction)
            if (crosses) then
               kind = merge(event_upper, event_lower, direction > 0.0_wp)
            else if (turns) then
               kind = event_turn
            else if (step < longest) then
               kind = event_again
            end if
         end if
         if (self%has_clocks) then
            clock = self%block(block)%clock
            call advance_clocks(clock, velocity, order, step, is_due)
            if (is_due) kind = event_clock
         end if
         if (self%block(block)%exceeds) call limit_by_excess(self, block, order, step)
         self%span(block) = step
         if (kind == event_none) self%span(block) = huge(1.0_wp)
      end associate
   end subroutine predict

   !> Shorten a step until what its neighbours do not know of a block moves them by no more than is
   !> exact to first order.
   subroutine limit_by_excess(self, block, order, step)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block, order
      real(wp), intent(inout) :: step

      integer, parameter :: max_trials = 60
      real(wp) :: once, twice, effect
      integer :: trial

      do trial = 1, max_trials
         call bound(self%excess(:, block), order, step, once, twice)
         effect = self%bond * (twice + abs(self%excess_twice(block)) &
            & + abs(self%excess_once(block)) * step) &
            & + self%viscosity * (once + abs(self%excess_once(block)))
         if (effect <= self%max_unknown) exit
         self%block(block)%kind = event_publish
         step = step * max(0.1_wp, min(0.9_wp, &
            & sqrt(sqrt(0.5_wp * self%max_unknown / effect))))
      end do
   end subroutine limit_by_excess

   !> The block with the next event in the step; 0 if there is none.
   pure function next_event(self) result(block)
      class(row_slider_type), intent(in) :: self
      integer :: block

      block = 0
      if (self%queue%first_time() <= self%length) block = self%queue%first()
   end function next_event

   !> Move a block to its event.
   subroutine stop_block(self, block, pose, asks)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block
      !> Its pose then
      type(pose_type), intent(out) :: pose
      !> Whether its contacts have to respond
      logical, intent(out) :: asks

      real(wp) :: start, remainder, sense, moved

      start = self%place(block)
      remainder = self%place_remainder(block)
      sense = self%sense(block)
      call carry(self, block, self%span(block))
      asks = .true.
      select case (self%block(block)%kind)
      case (event_upper)
         self%place(block) = self%block(block)%window%upper
         self%place_remainder(block) = 0.0_wp
         call receive(self, block, .true.)
      case (event_lower)
         self%place(block) = self%block(block)%window%lower
         self%place_remainder(block) = 0.0_wp
         call receive(self, block, .true.)
      case (event_time, event_clock)
         call receive(self, block, .false.)
      case (event_turn)
         ! Its last velocity is that before the turn, not the rounding of zero.
         self%speed(block) = 0.0_wp
         moved = (self%place(block) - start) + (self%place_remainder(block) - remainder)
         if (abs(moved) > 0.0_wp) sense = sign(1.0_wp, moved)
         self%sense(block) = sense
      case (event_again, event_publish)
         asks = .false.
      case default
         continue
      end select
      pose = self%block_pose(block)
      ! Rounding must not leave it just before the end of its window.
      if (self%block(block)%window%end_time - self%base_time <= self%moment(block) &
         & * (1.0_wp + 4.0_wp * epsilon(1.0_wp))) then
         pose%time = max(pose%time, self%block(block)%window%end_time)
      end if
      if (asks) self%events = self%events + 1
   end subroutine stop_block

   !> Move a block along its motion, with the books of its work and losses.
   subroutine carry(self, block, step)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block
      !> Time from its own [s]
      real(wp), intent(in) :: step

      real(wp) :: series(0:max_order), velocity(0:max_order), damper(0:max_order), once, twice
      real(wp) :: part(0:3), start
      integer :: order, term
      logical :: is_due

      if (.not. step > 0.0_wp) return
      call load_motion(self, block, series, order)
      if (self%has_clocks) then
         do term = 0, order - 1
            velocity(term) = (term + 1) * series(term + 1)
         end do
         start = step
         call advance_clocks(self%block(block)%clock, velocity, order, start, is_due)
         self%elapsed(:, block) = self%elapsed(:, block) + self%block(block)%clock%elapsed
      end if
      if (self%pull(block) > 0.0_wp) then
         call integrals(series, order, step, once, twice)
         self%pulled_once = self%pulled_once + self%pull(block) * once
         ! The weight is the time since the start of the step.
         self%pulled_lever = self%pulled_lever + self%pull(block) &
            & * ((self%moment(block) + step) * once - twice)
      end if
      call add_losses(self, block, series, order, step)
      if (self%block(block)%exceeds) then
         call moments(self%excess(:, block), order, step, part)
         self%excess_thrice(block) = self%excess_thrice(block) + step * (self%excess_twice(block) &
            & + 0.5_wp * step * self%excess_once(block)) + part(3)
         self%excess_twice(block) = self%excess_twice(block) + step * self%excess_once(block) &
            & + part(2)
         self%excess_once(block) = self%excess_once(block) + part(1)
      end if
      if (self%damping > 0.0_wp) then
         once = 0.0_wp
         damper = motion_of_damper(self, block, order)
         do term = order - 1, 0, -1
            once = once * step + damper(term)
         end do
         self%damper(block) = once
      end if
      start = self%place(block)
      series(0) = self%place_remainder(block)
      call evaluate_all(series, order, step, once, self%speed(block), self%bend(block), &
         & self%jerk(block), self%snap(block))
      call add_exactly(self%place(block), self%place_remainder(block), once)
      if (abs(self%speed(block)) > 0.0_wp) self%sense(block) = sign(1.0_wp, self%speed(block))
      self%moment(block) = self%moment(block) + step
      if (self%has_clocks) then
         associate (clock => self%block(block)%clock)
            where (clock%is_used)
               clock%left = clock%left - clock%elapsed
               clock%rate = clock%rate * exp(clock%slope * (self%place(block) - start))
            end where
         end associate
      end if
   end subroutine carry

   !> Move all blocks that go on as published to the end of the step, with their books.
   subroutine carry_published(self)
      class(row_state_type), intent(inout) :: self

      real(wp), dimension(self%blocks) :: share, once, twice, part, jerk, snap
      integer :: block, term

      ! 1 for a block that goes on as published.
      share = merge(0.0_wp, 1.0_wp, self%block%is_own)
      once = 0.0_wp
      twice = 0.0_wp
      associate (series => self%published, step => self%length)
         do term = self%order, 0, -1
            part = series(:, term) * inverse(term + 1)
            once = once * step + part
            twice = twice * step + part * inverse(term + 2)
         end do
         self%pulled_once = self%pulled_once + step * sum(share * self%pull * once)
         self%pulled_lever = self%pulled_lever + step**2 * sum(share * self%pull * (once - twice))
         call add_published_losses(self, share)
         once = 0.0_wp
         twice = 0.0_wp
         part = 0.0_wp
         jerk = 0.0_wp
         snap = 0.0_wp
         do term = self%order, 0, -1
            snap = snap * step + jerk
            jerk = jerk * step + part
            part = part * step + twice
            twice = twice * step + once
            if (term > 0) once = once * step + series(:, term)
         end do
         once = once * step + self%place_remainder
         do block = 1, self%blocks
            if (.not. self%block(block)%is_own) call add_exactly(self%place(block), &
               & self%place_remainder(block), once(block))
         end do
         where (.not. self%block%is_own)
            self%speed = twice
            self%bend = part
            self%jerk = 6.0_wp * jerk
            self%snap = 24.0_wp * snap
         end where
         if (self%damping > 0.0_wp) then
            once = 0.0_wp
            do term = self%order - 1, 0, -1
               once = once * step + self%published_damper(:, term)
            end do
            where (.not. self%block%is_own) self%damper = once
         end if
         where (.not. self%block%is_own .and. abs(self%speed) > 0.0_wp)
            self%sense = sign(1.0_wp, self%speed)
         end where
         where (.not. self%block%is_own) self%moment = step
      end associate
   end subroutine carry_published

   !> Take the law that the contacts of a block offer.
   subroutine take_law(self, block, law, window, clock)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window
      type(hazard_clock_type), intent(in) :: clock(clocks)

      self%block(block)%law = law
      self%law_stiffness(block) = law%stiffness
      self%law_drag(block) = law%drag
      self%block(block)%window = window
      self%block(block)%clock = clock
      self%elapsed(:, block) = 0.0_wp
      self%offer_moment(block) = self%moment(block)
   end subroutine take_law

   !> Continue the motion of a block after its event.
   subroutine renew(self, block)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block

      integer :: neighbour

      call shorten_step(self, block)
      if (self%block(block)%kind == event_publish) then
         call publish(self, block)
         do neighbour = block - 1, block + 1, 2
            if (neighbour < 1 .or. neighbour > self%blocks) cycle
            call continue_motion(self, neighbour)
         end do
         call predict_next(self, block)
      else
         call continue_motion(self, block)
      end if
   end subroutine renew

   !> Expand the motion of a block, and find its next event.
   subroutine continue_motion(self, block)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block

      call expand(self, block)
      call predict_next(self, block)
   end subroutine continue_motion

   !> Find the next event of a block in its step.
   subroutine predict_next(self, block)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block

      call predict(self, block)
      call self%queue%update(block, self%moment(block) + self%span(block))
   end subroutine predict_next

   !> Let the neighbours of a block know its motion.
   subroutine publish(self, block)
      class(row_state_type), intent(inout) :: self
      integer, intent(in) :: block

      real(wp) :: shown(0:max_order), value, slope, bend
      integer :: neighbour

      self%publications = self%publications + 1
      shown(:self%order) = self%published(block, :self%order)
      call evaluate(shown, self%order, self%moment(block), value, slope, bend)
      self%excess(0, block) = self%place(block) - value
      do neighbour = block - 1, block + 1, 2
         if (neighbour < 1 .or. neighbour > self%blocks) cycle
         call carry(self, neighbour, self%moment(block) - self%moment(neighbour))
         call receive(self, neighbour, .false.)
      end do
      ! Losses of the neighbours until now are those beside the motion published before.
      call expand_published(self, block)
      self%excess_once(block) = 0.0_wp
      self%excess_twice(block) = 0.0_wp
      self%excess_thrice(block) = 0.0_wp
      do neighbour = block - 1, block + 1, 2
         if (neighbour >= 1 .and. neighbour <= self%blocks) call note_excess(self, neighbour)
      end do
   end subroutine publish

   !> End the step: all blocks move to its end, and to their neighbours goes what they do not know.
   subroutine end_step(self)
      class(row_slider_type), intent(inout) :: self

      real(wp) :: excess(self%blocks), shown(0:max_order), value, slope, bend, drive(0:2), pulled
      real(wp) :: stiffness
      integer :: block

      excess = 0.0_wp
      if (.not. self%has_clocks) call carry_published(self)
      do block = 1, self%blocks
         call carry(self, block, self%length - self%moment(block))
         if (.not. self%block(block)%exceeds) cycle
         shown(:self%order) = self%published(block, :self%order)
         call evaluate(shown, self%order, self%length, value, slope, bend)
         excess(block) = self%place(block) - value
      end do
      if (any(self%block%exceeds)) call receive_all(self, excess)

      associate (length => self%length, block_mass => 1.0_wp / self%inverse_mass)
         drive = drive_at(self, 0.0_wp)
         stiffness = sum(self%pull)
         pulled = block_mass * (stiffness * length * (drive(0) + length * (0.5_wp * drive(1) &
            & + length * drive(2) / 3.0_wp)) - self%pulled_once)
         if (abs(self%drive%acceleration) > 0.0_wp) then
            call self%drive%earlier_impulse%add(pulled)
            call self%drive%add_work(drive(1) * pulled + 2.0_wp * drive(2) * block_mass &
               & * (stiffness * length**2 * (0.5_wp * drive(0) + length * (drive(1) / 3.0_wp &
               & + 0.25_wp * length * drive(2))) - self%pulled_lever))
         else
            call self%drive%impulse%add(pulled)
         end if
         call self%drag_loss%add(block_mass * self%drag_part)
         call self%damping_loss%add(block_mass * self%damping_part)
         self%offer_moment = self%offer_moment - length
      end associate
      if (self%reaches_end) then
         self%time = self%end_time
      else
         self%time = self%time + self%length
      end if
      self%base_time = self%time
      self%moment = 0.0_wp
      if (self%events > 0) then
         ! A neighbour that has to know costs as much as a step of some ten blocks.
         if (32 * self%publications > self%blocks) then
            self%event_pace = max(min_pace, 0.7_wp * self%event_pace)
         else
            self%event_pace = min(busy_pace, 1.2_wp * self%event_pace)
         end if
         self%pace = self%event_pace
      else
         self%pace = min(quiet_pace, 2.0_wp * self%pace)
      end if
      self%is_quiet = self%events == 0
      call self%sum_motion(2)
   end subroutine end_step

end module mesoslip_sliders_interface_row
