!> Motion of a row of blocks from event to event, with a clock for each block (section 16).
!>
!> A step of the row is so short that the motion of each block in it is a polynomial, exact to
!> rounding, if no contact breaks or attaches: the published motion, by which its neighbours feel it.
!> A block whose contacts change continues from there on a motion of its own. What it has done
!> since to its neighbours, beyond the published motion, grows with the fourth power of time: it is
!> integrated, and given to them before it exceeds rounding. They continue from there on motions of
!> their own in turn. So an event costs the work of one block and seldom of two or four more,
!> however long the row.
module mesoslip_sliders_interface_row
   use mesoslip_interface_law, only: clocks, hazard_clock_type, interface_law_type, pose_type, &
      & window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_base, only: slider_type
   use mesoslip_sliders_hazard_clock, only: advance_clocks, limit_window
   use mesoslip_sliders_interface_polynomials, only: bound, evaluate, integrals, max_order, &
      & max_points, min_points, move, new_rules, points_for, reach_of, rule_type
   use mesoslip_sliders_interface_queue, only: event_queue_type
   use mesoslip_sliders_motion_series, only: first_end, inverse
   implicit none
   private

   public :: row_slider_type, block_values
   public :: event_none, event_time, event_upper, event_lower, event_turn, event_clock

   !> What ends the motion of a block: nothing in this step; the end of the window's time; its
   !> upper and lower ends; a turning point; a clock; the end of its polynomial; its neighbours have
   !> to know of it
   integer, parameter :: event_none = 0, event_time = 1, event_upper = 2, event_lower = 3, &
      & event_turn = 4, event_clock = 5, event_again = 6, event_publish = 7

   !> Numbers of each block in the record: displacement, velocity, contact force, detached contacts
   integer, parameter :: block_values = 4
   !> Duration of a step in units of one over the fastest rate, while contacts break, and at most
   real(wp), parameter :: busy_pace = 0.2_wp, quiet_pace = 2.5_wp
   !> Minimum order of a motion
   integer, parameter :: min_order = 4
   !> Forces and displacements that are equal up to rounding
   real(wp), parameter :: rounding = 64.0_wp * epsilon(1.0_wp)

   !> Blocks in a row, joined by springs, with a spring to the drive at the first, or at all.
   type, abstract, extends(slider_type) :: row_slider_type
      !> Number of blocks
      integer :: blocks = 1
      !> Mass of all blocks [kg], spring between neighbours [N/m], rate of the damping between them,
      !> of the damping of each block relative to its mean velocity [1/s]
      real(wp) :: mass = 1.0_wp, neighbour_spring = 0.0_wp, neighbour_damping = 0.0_wp, &
         & damping = 0.0_wp
      !> Springs to the drive, of the first block and of all together [N/m]
      real(wp) :: edge_stiffness = 0.0_wp, top_stiffness = 0.0_wp
      !> Displacement that is rounding [m]
      real(wp) :: tiny_displacement = 0.0_wp
      !> Stiffness of the contacts of a block when all are pinned [N/m]
      real(wp) :: pinned_stiffness = 0.0_wp
      !> Displacement [m], velocity [m/s], half the acceleration [m/s2], and deceleration by the
      !> damper [m/s2] of each block, at its own time after the start of the step [s]
      real(wp), allocatable :: place(:), speed(:), bend(:), damper(:), moment(:)
      !> Sign of the last velocity that was not zero
      real(wp), allocatable :: sense(:)
      !> Contact force on each block, and where it holds; time at which it was offered, after the
      !> start of the step [s]
      type(interface_law_type), allocatable :: law(:)
      type(window_type), allocatable :: window(:)
      real(wp), allocatable :: offer_moment(:)
      !> Clocks of the contacts, and their increase since they were offered
      type(hazard_clock_type), allocatable :: block_clock(:, :)
      real(wp), allocatable :: elapsed(:, :)
      !> Number of detached contacts of each block, for the record
      real(wp), allocatable :: detached(:)
      !> Duration of the next step in units of one over the fastest rate
      real(wp) :: pace = busy_pace
      !> Whether no contact broke or attached in the last step; whether all blocks rest
      logical :: is_quiet = .false., rests = .false.
      !> Time from which the blocks' own times count: the start of a step, then its end [s]
      real(wp) :: base_time = 0.0_wp
      !> Length of the step [s]
      real(wp) :: length = 0.0_wp

      !> Spring and damping between neighbours, spring to the drive, over the mass of a block
      real(wp) :: bond = 0.0_wp, viscosity = 0.0_wp
      real(wp), allocatable :: pull(:)
      !> Number of neighbours of each block
      real(wp), allocatable :: neighbours(:)
      !> Published motion of each block and its damper's, shape (blocks, 0:max_order), and its order
      real(wp), allocatable :: published(:, :), published_damper(:, :)
      integer :: order = min_order
      !> Own motion of each block since its own time, the damper's, and the excess over the published
      !> motion, shape (0:max_order, blocks); motion of both neighbours together
      real(wp), allocatable :: own(:, :), own_damper(:, :), excess(:, :), around(:, :)
      integer, allocatable :: own_order(:)
      !> Integral of the excess since it was last published, and the integral of that
      real(wp), allocatable :: excess_once(:), excess_twice(:)
      !> Whether it has a motion of its own; whether that exceeds the published one
      logical, allocatable :: is_own(:), exceeds(:)
      !> Time after the start of the step up to which its motion is exact [s]
      real(wp), allocatable :: horizon(:)
      !> What ends its motion, and the time until then [s]
      integer, allocatable :: kind(:)
      real(wp), allocatable :: span(:)
      type(event_queue_type) :: queue
      !> Number of contact events in the step; whether the step ends with the first of them
      integer :: events = 0
      logical :: ends_at_event = .false.
      !> Time at which the step should end [s], and whether it does
      real(wp) :: end_time = 0.0_wp
      logical :: reaches_end = .false.
      !> Integrals of the pulled displacements in the step, and with the time as a weight
      real(wp) :: pulled_once = 0.0_wp, pulled_lever = 0.0_wp
      !> Losses in the step [J/kg]
      real(wp) :: drag_part = 0.0_wp, damping_part = 0.0_wp
      !> Fastest rate [1/s], and the reach of each order
      real(wp) :: rate = 1.0_wp
      real(wp) :: reach(max_order) = 0.0_wp
      !> Rules for the losses, by their numbers of points
      type(rule_type) :: rule(min_points:max_points)
      !> Mean displacement, velocity and half the acceleration at the start and at the end of the
      !> step, the same of the pulled blocks; contact force; shape (start or end)
      real(wp) :: mean(3, 2) = 0.0_wp, pulled(3, 2) = 0.0_wp, total_force(2) = 0.0_wp
   contains
      procedure, non_overridable :: set_up_row
      procedure, non_overridable :: begin_step, next_event, stop_block, renew, take_law, end_step
      procedure, non_overridable :: block_pose, block_force, solve_static, sum_motion
      procedure, non_overridable, private :: expand_all, expand, predict, predict_all, carry, &
         & publish, try_rest, load_motion, add_losses, limit_by_excess, motion_of_damper, &
         & carry_published, add_published_losses
   end type row_slider_type

contains

   !> Allocate the row, whose parameters are set.
   subroutine set_up_row(self, stat)
      class(row_slider_type), intent(inout) :: self
      !> 0 if there is enough memory
      integer, intent(out) :: stat

      real(wp) :: block_mass
      integer :: order

      associate (n => self%blocks)
         allocate (self%place(n), self%speed(n), self%bend(n), self%damper(n), self%moment(n), &
            & self%offer_moment(n), self%detached(n), self%excess_once(n), self%excess_twice(n), &
            & self%horizon(n), self%span(n), self%pull(n), source=0.0_wp, stat=stat)
         if (stat == 0) allocate (self%sense(n), self%neighbours(n), source=1.0_wp, stat=stat)
         if (stat == 0) allocate (self%law(n), self%window(n), self%block_clock(clocks, n), stat=stat)
         if (stat == 0) allocate (self%elapsed(clocks, n), self%published(n, 0:max_order), &
            & self%published_damper(n, 0:max_order), self%own(0:max_order, n), self%own_damper(0:max_order, n), &
            & self%excess(0:max_order, n), self%around(0:max_order, n), source=0.0_wp, stat=stat)
         if (stat == 0) allocate (self%own_order(n), self%kind(n), source=0, stat=stat)
         if (stat == 0) allocate (self%is_own(n), self%exceeds(n), source=.false., stat=stat)
         if (stat == 0) call self%queue%open(n, stat)
         if (stat /= 0) return
         block_mass = self%mass / n
         self%neighbours = 2.0_wp
         self%neighbours(1) = self%neighbours(1) - 1.0_wp
         self%neighbours(n) = self%neighbours(n) - 1.0_wp
         self%bond = self%neighbour_spring / block_mass
         self%viscosity = self%neighbour_damping
         self%pull = self%top_stiffness / self%mass
         self%pull(1) = self%pull(1) + self%edge_stiffness / block_mass
         self%inverse_mass = 1.0_wp / block_mass
      end associate
      self%cost = 1.0_wp + 0.25_wp * self%blocks
      do order = 1, max_order
         self%reach(order) = reach_of(order)
      end do
      call new_rules(self%rule)
   end subroutine set_up_row

   !> Begin a step that ends at a time or before: the motion of all blocks if nothing happens.
   subroutine begin_step(self, end_time)
      class(row_slider_type), intent(inout) :: self
      !> Time [s]
      real(wp), intent(in) :: end_time

      integer :: order

      self%step_time = self%time
      self%base_time = self%time
      self%end_time = end_time
      self%moment = 0.0_wp
      self%excess_once = 0.0_wp
      self%excess_twice = 0.0_wp
      self%is_own = .false.
      self%exceeds = .false.
      self%events = 0
      self%pulled_once = 0.0_wp
      self%pulled_lever = 0.0_wp
      self%drag_part = 0.0_wp
      self%damping_part = 0.0_wp
      call self%sum_motion(1)

      self%length = end_time - self%time
      self%reaches_end = .true.
      self%rests = .false.
      if (self%is_quiet) call self%try_rest()
      if (.not. self%rests) then
         self%rate = fastest_rate(self)
         if (self%length * self%rate > self%pace) then
            self%length = self%pace / self%rate
            self%reaches_end = .false.
         end if
         self%order = max_order
         do order = min_order, max_order
            if (self%rate * self%length <= self%reach(order)) then
               self%order = order
               exit
            end if
         end do
         call self%expand_all()
      end if
      call self%predict_all()
      ! A long step ends with its first event: in a short one more of them cost less.
      self%ends_at_event = self%queue%first_time() < self%length &
         & .and. (self%rests .or. self%pace > 2.0_wp * busy_pace)
      if (self%ends_at_event) then
         self%length = self%queue%first_time()
         self%reaches_end = .false.
      end if
   end subroutine begin_step

   !> Bound on the rates of the row.
   pure function fastest_rate(self) result(rate)
      class(row_slider_type), intent(in) :: self
      real(wp) :: rate

      real(wp) :: stiffness, drag
      integer :: block

      stiffness = self%pinned_stiffness
      drag = 0.0_wp
      do block = 1, self%blocks
         stiffness = max(stiffness, abs(self%law(block)%stiffness))
         drag = max(drag, self%law(block)%drag)
      end do
      rate = 2.0_wp * maxval(self%neighbours) * self%bond + maxval(self%pull) &
         & + stiffness * self%inverse_mass
      rate = sqrt(rate) + drag * self%inverse_mass + self%damping &
         & + 2.0_wp * maxval(self%neighbours) * self%viscosity
   end function fastest_rate

   !> Coefficients of the drive's displacement since a moment of the step.
   pure function drive_at(self, moment) result(drive)
      class(row_slider_type), intent(in) :: self
      real(wp), intent(in) :: moment
      real(wp) :: drive(0:2)

      real(wp) :: rate, acceleration

      rate = self%drive%rate_at(self%base_time)
      acceleration = self%drive%acceleration
      drive(0) = self%drive%at(self%base_time) + (rate + 0.5_wp * acceleration * moment) * moment
      drive(1) = rate + acceleration * moment
      drive(2) = 0.5_wp * acceleration
   end function drive_at

   !> Motion of all blocks, by the equation of motion term by term.
   subroutine expand_all(self)
      class(row_slider_type), intent(inout) :: self

      real(wp), dimension(self%blocks) :: stiffness, drag, force, offset
      real(wp) :: drive(0:2), push
      integer :: term, n

      n = self%blocks
      drive = drive_at(self, 0.0_wp)
      stiffness = self%neighbours * self%bond + self%pull &
         & + self%law%stiffness * self%inverse_mass
      drag = self%law%drag * self%inverse_mass + self%neighbours * self%viscosity
      offset = (self%law%offset + self%law%rate * self%offer_moment) * self%inverse_mass
      associate (series => self%published, damper => self%published_damper)
         damper(:, :1) = 0.0_wp
         damper(:, 0) = self%damper
         series(:, 0) = self%place
         series(:, 1) = self%speed
         do term = 0, self%order - 2
            force = -stiffness * series(:, term) - (term + 1) * drag * series(:, term + 1)
            if (self%damping > 0.0_wp) force = force - damper(:, term)
            if (term <= 2) force = force + self%pull * drive(term)
            if (term == 0) force = force + offset
            if (term == 1) force = force - self%law%rate * self%inverse_mass
            force(2:) = force(2:) + self%bond * series(:n - 1, term)
            force(:n - 1) = force(:n - 1) + self%bond * series(2:, term)
            if (self%viscosity > 0.0_wp) then
               push = self%viscosity * (term + 1)
               force(2:) = force(2:) + push * series(:n - 1, term + 1)
               force(:n - 1) = force(:n - 1) + push * series(2:, term + 1)
            end if
            series(:, term + 2) = force * (inverse(term + 1) * inverse(term + 2))
            if (self%damping > 0.0_wp) damper(:, term + 1) = self%damping * inverse(term + 1) &
               & * (force - damper(:, term))
         end do
      end associate
      self%bend = self%published(:, 2)
   end subroutine expand_all

   !> Find what ends the motion of each block, unless all goes on as published.
   subroutine predict_all(self)
      class(row_slider_type), intent(inout) :: self

      real(wp) :: way(self%blocks)
      integer :: block, term

      way = abs(self%published(:, self%order))
      do term = self%order - 1, 1, -1
         way = way * self%length + abs(self%published(:, term))
      end do
      way = way * self%length
      do block = 1, self%blocks
         self%kind(block) = event_none
         self%span(block) = huge(1.0_wp)
         self%horizon(block) = self%length
         associate (window => self%window(block))
            if (.not. (way(block) < min(window%upper - self%place(block), self%place(block) &
               & - window%lower) .and. window%end_time - self%base_time > self%length) &
               & .or. self%has_clocks) call self%predict(block)
         end associate
         call self%queue%put(block, self%span(block))
      end do
      call self%queue%rebuild()
   end subroutine predict_all

   !> Motion of a block since its own time.
   pure subroutine load_motion(self, block, series, order)
      class(row_slider_type), intent(in) :: self
      integer, intent(in) :: block
      real(wp), intent(out) :: series(0:max_order)
      integer, intent(out) :: order

      if (self%is_own(block)) then
         order = self%own_order(block)
         series(:order) = self%own(:order, block)
      else
         order = self%order
         series(:order) = self%published(block, :order)
      end if
   end subroutine load_motion

   !> Find what ends the motion of a block, and when.
   subroutine predict(self, block)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block

      type(window_type) :: window
      type(hazard_clock_type) :: clock(clocks)
      real(wp) :: series(0:max_order), velocity(0:max_order), step, longest, change
      real(wp) :: above, below, direction
      integer :: order, term
      logical :: crosses, turns, is_due

      call self%load_motion(block, series, order)
      window = self%window(block)
      if (self%has_clocks) call limit_window(self%block_clock(:, block), self%base_time &
         & + self%moment(block), self%speed(block), 2.0_wp * self%bend(block), window)
      associate (kind => self%kind(block))
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
            clock = self%block_clock(:, block)
            call advance_clocks(clock, velocity, order, step, is_due)
            if (is_due) kind = event_clock
         end if
         if (self%exceeds(block)) call self%limit_by_excess(block, order, step)
         self%span(block) = step
         if (kind == event_none) self%span(block) = huge(1.0_wp)
      end associate
   end subroutine predict

   !> Shorten a step until what its neighbours do not know of a block moves them by no more than
   !> rounding.
   subroutine limit_by_excess(self, block, order, step)
      class(row_slider_type), intent(inout) :: self
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
         if (effect <= self%tiny_displacement) exit
         self%kind(block) = event_publish
         step = step * max(0.1_wp, min(0.9_wp, (0.5_wp * self%tiny_displacement / effect)**0.25_wp))
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

      call self%carry(block, self%span(block))
      asks = .true.
      select case (self%kind(block))
      case (event_upper)
         self%place(block) = self%window(block)%upper
      case (event_lower)
         self%place(block) = self%window(block)%lower
      case (event_turn)
         self%speed(block) = 0.0_wp
      case (event_again, event_publish)
         asks = .false.
      case default
         continue
      end select
      pose = self%block_pose(block)
      ! Nor may rounding keep it before the end of its window.
      if (self%window(block)%end_time - self%base_time <= self%moment(block) &
         & * (1.0_wp + 4.0_wp * epsilon(1.0_wp))) then
         pose%time = max(pose%time, self%window(block)%end_time)
      end if
      if (asks) self%events = self%events + 1
   end subroutine stop_block

   !> Pose of a block.
   pure function block_pose(self, block) result(pose)
      class(row_slider_type), intent(in) :: self
      integer, intent(in) :: block
      type(pose_type) :: pose

      pose = pose_type(self%base_time + self%moment(block), self%place(block), self%speed(block), &
         & 2.0_wp * self%bend(block), self%sense(block), self%inverse_mass, &
         & sqrt(self%neighbours(block) * self%bond + self%pull(block)), .false.)
   end function block_pose

   !> Move a block along its motion, with the books of its work and losses.
   subroutine carry(self, block, step)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block
      !> Time from its own [s]
      real(wp), intent(in) :: step

      real(wp) :: series(0:max_order), velocity(0:max_order), damper(0:max_order), once, twice
      real(wp) :: first_once, start
      integer :: order, term
      logical :: is_due

      if (.not. step > 0.0_wp) return
      call self%load_motion(block, series, order)
      if (self%has_clocks) then
         do term = 0, order - 1
            velocity(term) = (term + 1) * series(term + 1)
         end do
         start = step
         call advance_clocks(self%block_clock(:, block), velocity, order, start, is_due)
         self%elapsed(:, block) = self%elapsed(:, block) + self%block_clock(:, block)%elapsed
      end if
      if (self%pull(block) > 0.0_wp) then
         call integrals(series, order, step, once, twice)
         self%pulled_once = self%pulled_once + self%pull(block) * once
         ! The weight is the time since the start of the step.
         self%pulled_lever = self%pulled_lever + self%pull(block) &
            & * ((self%moment(block) + step) * once - twice)
      end if
      call self%add_losses(block, series, order, step)
      if (self%exceeds(block)) then
         call integrals(self%excess(:, block), order, step, once, twice)
         first_once = self%excess_once(block)
         self%excess_once(block) = first_once + once
         self%excess_twice(block) = self%excess_twice(block) + first_once * step + twice
      end if
      if (self%damping > 0.0_wp) then
         once = 0.0_wp
         damper = self%motion_of_damper(block, order)
         do term = order - 1, 0, -1
            once = once * step + damper(term)
         end do
         self%damper(block) = once
      end if
      start = self%place(block)
      call evaluate(series, order, step, self%place(block), self%speed(block), self%bend(block))
      if (abs(self%speed(block)) > 0.0_wp) self%sense(block) = sign(1.0_wp, self%speed(block))
      self%moment(block) = self%moment(block) + step
      if (self%has_clocks) then
         associate (clock => self%block_clock(:, block))
            where (clock%is_used)
               clock%left = clock%left - clock%elapsed
               clock%rate = clock%rate * exp(clock%slope * (self%place(block) - start))
            end where
         end associate
      end if
   end subroutine carry

   !> Series of the deceleration by a block's damper since its own time.
   pure function motion_of_damper(self, block, order) result(damper)
      class(row_slider_type), intent(in) :: self
      integer, intent(in) :: block, order
      real(wp) :: damper(0:max_order)

      if (self%is_own(block)) then
         damper(:order - 1) = self%own_damper(:order - 1, block)
      else
         damper(:order - 1) = self%published_damper(block, :order - 1)
      end if
   end function motion_of_damper

   !> Add the losses of a block in a part of the step.
   subroutine add_losses(self, block, series, order, step)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block, order
      real(wp), intent(in) :: series(0:max_order), step

      real(wp) :: drag, time, speed, deceleration, pull, square, damped
      real(wp) :: damper(0:max_order), around(0:max_order)
      integer :: points, node, term

      drag = self%law(block)%drag * self%inverse_mass
      if (.not. (drag > 0.0_wp .or. self%damping > 0.0_wp .or. self%viscosity > 0.0_wp)) return
      if (self%damping > 0.0_wp) damper = self%motion_of_damper(block, order)
      if (self%viscosity > 0.0_wp) then
         if (self%is_own(block)) then
            around(:order) = self%around(:order, block)
         else
            around(:order) = neighbour_motion(self, block, order)
         end if
      end if
      points = points_for(self%rate * step)
      square = 0.0_wp
      damped = 0.0_wp
      do node = 1, points
         time = self%rule(points)%point(node) * step
         speed = 0.0_wp
         do term = order, 1, -1
            speed = speed * time + term * series(term)
         end do
         associate (weight => self%rule(points)%weight(node))
            square = square + weight * speed**2
            if (self%damping > 0.0_wp) then
               deceleration = 0.0_wp
               do term = order - 1, 0, -1
                  deceleration = deceleration * time + damper(term)
               end do
               damped = damped + weight * deceleration * speed
            end if
            if (self%viscosity > 0.0_wp) then
               pull = 0.0_wp
               do term = order, 1, -1
                  pull = pull * time + term * around(term)
               end do
               damped = damped + weight * self%viscosity &
                  & * (self%neighbours(block) * speed - pull) * speed
            end if
         end associate
      end do
      self%drag_part = self%drag_part + drag * square * step
      self%damping_part = self%damping_part + damped * step
   end subroutine add_losses

   !> Move all blocks that go on as published to the end of the step, with their books.
   subroutine carry_published(self)
      class(row_slider_type), intent(inout) :: self

      real(wp), dimension(self%blocks) :: share, once, twice, part
      integer :: term

      ! 1 for a block that goes on as published.
      share = merge(0.0_wp, 1.0_wp, self%is_own)
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
         call self%add_published_losses(share)
         once = 0.0_wp
         twice = 0.0_wp
         part = 0.0_wp
         do term = self%order, 0, -1
            part = part * step + twice
            twice = twice * step + once
            once = once * step + series(:, term)
         end do
         where (.not. self%is_own)
            self%place = once
            self%speed = twice
            self%bend = part
         end where
         if (self%damping > 0.0_wp) then
            once = 0.0_wp
            do term = self%order - 1, 0, -1
               once = once * step + self%published_damper(:, term)
            end do
            where (.not. self%is_own) self%damper = once
         end if
         where (.not. self%is_own .and. abs(self%speed) > 0.0_wp) self%sense = sign(1.0_wp, self%speed)
         where (.not. self%is_own) self%moment = step
      end associate
   end subroutine carry_published

   !> Add the losses of all blocks that go on as published in the step.
   subroutine add_published_losses(self, share)
      class(row_slider_type), intent(inout) :: self
      !> 1 for a block that goes on as published, else 0
      real(wp), intent(in) :: share(:)

      real(wp), dimension(self%blocks) :: drag, speed, deceleration
      real(wp) :: time, square, damped
      integer :: points, node, term, n

      n = self%blocks
      drag = share * self%law%drag * self%inverse_mass
      if (.not. (any(drag > 0.0_wp) .or. self%damping > 0.0_wp .or. self%viscosity > 0.0_wp)) return
      points = points_for(self%rate * self%length)
      square = 0.0_wp
      damped = 0.0_wp
      do node = 1, points
         time = self%rule(points)%point(node) * self%length
         speed = 0.0_wp
         do term = self%order, 1, -1
            speed = speed * time + term * self%published(:, term)
         end do
         associate (weight => self%rule(points)%weight(node))
            square = square + weight * sum(drag * speed**2)
            deceleration = 0.0_wp
            if (self%damping > 0.0_wp) then
               do term = self%order - 1, 0, -1
                  deceleration = deceleration * time + self%published_damper(:, term)
               end do
            end if
            if (self%viscosity > 0.0_wp) then
               deceleration = deceleration + self%viscosity * self%neighbours * speed
               deceleration(2:) = deceleration(2:) - self%viscosity * speed(:n - 1)
               deceleration(:n - 1) = deceleration(:n - 1) - self%viscosity * speed(2:)
            end if
            damped = damped + weight * sum(share * deceleration * speed)
         end associate
      end do
      self%drag_part = self%drag_part + square * self%length
      self%damping_part = self%damping_part + damped * self%length
   end subroutine add_published_losses

   !> Published motion of both neighbours of a block together.
   pure function neighbour_motion(self, block, order) result(around)
      class(row_slider_type), intent(in) :: self
      integer, intent(in) :: block, order
      real(wp) :: around(0:order)

      around = 0.0_wp
      if (block > 1) around = self%published(block - 1, :order)
      if (block < self%blocks) around = around + self%published(block + 1, :order)
   end function neighbour_motion

   !> Take the law that the contacts of a block offer.
   subroutine take_law(self, block, law, window, clock)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window
      type(hazard_clock_type), intent(in) :: clock(clocks)

      self%law(block) = law
      self%window(block) = window
      self%block_clock(:, block) = clock
      self%elapsed(:, block) = 0.0_wp
      self%offer_moment(block) = self%moment(block)
   end subroutine take_law

   !> Continue the motion of a block after its event.
   subroutine renew(self, block)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block

      integer :: neighbour

      if (self%kind(block) == event_publish) then
         call self%publish(block)
         do neighbour = block - 1, block + 1, 2
            if (neighbour < 1 .or. neighbour > self%blocks) cycle
            call continue_motion(self, neighbour)
         end do
      end if
      call continue_motion(self, block)
   end subroutine renew

   !> Expand the motion of a block, and find its next event.
   subroutine continue_motion(self, block)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block

      call self%expand(block, is_whole=.false.)
      call self%predict(block)
      call self%queue%update(block, self%moment(block) + self%span(block))
   end subroutine continue_motion

   !> Motion of a block since its own time, under the published motion of its neighbours.
   subroutine expand(self, block, is_whole)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block
      !> Whether up to the end of the step; else until about its next event
      logical, intent(in) :: is_whole

      real(wp) :: around(0:max_order), shown(0:max_order), damper, stiffness, drag, force
      real(wp) :: drive(0:2), series(0:max_order), offset, step, gap
      integer :: order, term, kept

      step = self%length - self%moment(block)
      self%horizon(block) = self%length
      kept = self%order
      if (.not. is_whole) then
         if (self%speed(block) > 0.0_wp) then
            gap = self%window(block)%upper - self%place(block)
         else
            gap = self%place(block) - self%window(block)%lower
         end if
         if (gap < 0.5_wp * abs(self%speed(block)) * step .and. gap > 0.0_wp) then
            ! Not so short that time would stand still.
            step = max(2.0_wp * gap / abs(self%speed(block)), rounding * self%length)
            self%horizon(block) = self%moment(block) + step
         end if
         do order = min_order, self%order
            if (self%rate * step <= self%reach(order)) then
               kept = order
               exit
            end if
         end do
      end if

      order = self%order
      around(:order) = neighbour_motion(self, block, order)
      shown(:order) = self%published(block, :order)
      call move(around, order, self%moment(block), kept)
      call move(shown, order, self%moment(block), kept)
      drive = drive_at(self, self%moment(block))
      associate (law => self%law(block))
         stiffness = self%neighbours(block) * self%bond + self%pull(block) &
            & + law%stiffness * self%inverse_mass
         drag = law%drag * self%inverse_mass + self%neighbours(block) * self%viscosity
         offset = (law%offset - law%rate * (self%moment(block) - self%offer_moment(block))) &
            & * self%inverse_mass
         series(0) = self%place(block)
         series(1) = self%speed(block)
         damper = self%damper(block)
         self%own_damper(0, block) = damper
         do term = 0, kept - 2
            force = self%bond * around(term) - stiffness * series(term) &
               & - (term + 1) * drag * series(term + 1) - damper
            if (self%viscosity > 0.0_wp) force = force &
               & + self%viscosity * (term + 1) * around(term + 1)
            if (term <= 2) force = force + self%pull(block) * drive(term)
            if (term == 0) force = force + offset
            if (term == 1) force = force - law%rate * self%inverse_mass
            series(term + 2) = force * (inverse(term + 1) * inverse(term + 2))
            damper = self%damping * (force - damper) * inverse(term + 1)
            self%own_damper(term + 1, block) = damper
         end do
         self%own(:kept, block) = series(:kept)
         self%excess(:kept, block) = series(:kept) - shown(:kept)
         self%bend(block) = series(2)
      end associate
      if (self%viscosity > 0.0_wp) self%around(:kept, block) = around(:kept)
      self%own_order(block) = kept
      self%is_own(block) = .true.
      self%exceeds(block) = self%blocks > 1
   end subroutine expand

   !> Let the neighbours of a block know its motion.
   subroutine publish(self, block)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block

      real(wp) :: shown(0:max_order), value, slope, bend, excess
      integer :: neighbour

      shown(:self%order) = self%published(block, :self%order)
      call evaluate(shown, self%order, self%moment(block), value, slope, bend)
      excess = self%place(block) - value
      call self%expand(block, is_whole=.true.)
      do neighbour = block - 1, block + 1, 2
         if (neighbour < 1 .or. neighbour > self%blocks) cycle
         call self%carry(neighbour, self%moment(block) - self%moment(neighbour))
         call give_excess(self, block, neighbour, excess)
      end do
      self%excess_once(block) = 0.0_wp
      self%excess_twice(block) = 0.0_wp
      shown(:self%order) = self%own(:self%order, block)
      call move(shown, self%order, -self%moment(block), self%order)
      self%published(block, :self%order) = shown(:self%order)
   end subroutine publish

   !> Give a neighbour what a block has done to it beyond its published motion.
   subroutine give_excess(self, block, neighbour, excess)
      class(row_slider_type), intent(inout) :: self
      integer, intent(in) :: block, neighbour
      !> Displacement of the block beyond the published one [m]
      real(wp), intent(in) :: excess

      real(wp) :: kick

      kick = self%bond * self%excess_once(block) + self%viscosity * excess
      ! The work of the damping between them along the neighbour's motion, by parts.
      self%damping_part = self%damping_part - self%viscosity * (excess * self%speed(neighbour) &
         & - 2.0_wp * self%bend(neighbour) * self%excess_once(block))
      self%place(neighbour) = self%place(neighbour) + self%bond * self%excess_twice(block) &
         & + self%viscosity * self%excess_once(block)
      self%speed(neighbour) = self%speed(neighbour) + kick
      self%damper(neighbour) = self%damper(neighbour) + self%damping * kick
      associate (window => self%window(neighbour))
         self%place(neighbour) = max(window%lower, min(window%upper, self%place(neighbour)))
      end associate
   end subroutine give_excess

   !> End the step: all blocks move to its end, and to their neighbours goes what they do not know.
   subroutine end_step(self)
      class(row_slider_type), intent(inout) :: self

      real(wp) :: excess(self%blocks), shown(0:max_order), value, slope, bend, drive(0:2), pulled
      real(wp) :: stiffness
      integer :: block

      excess = 0.0_wp
      if (.not. self%has_clocks) call self%carry_published()
      do block = 1, self%blocks
         call self%carry(block, self%length - self%moment(block))
         if (.not. self%exceeds(block)) cycle
         shown(:self%order) = self%published(block, :self%order)
         call evaluate(shown, self%order, self%length, value, slope, bend)
         excess(block) = self%place(block) - value
      end do
      do block = 1, self%blocks
         if (.not. self%exceeds(block)) cycle
         if (block > 1) call give_excess(self, block, block - 1, excess(block))
         if (block < self%blocks) call give_excess(self, block, block + 1, excess(block))
      end do

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
         self%pace = busy_pace
      else
         self%pace = min(quiet_pace, 2.0_wp * self%pace)
      end if
      self%is_quiet = self%events == 0
      call self%sum_motion(2)
   end subroutine end_step

   !> Sum up the motion of all blocks at the start or the end of a step.
   subroutine sum_motion(self, which)
      class(row_slider_type), intent(inout) :: self
      !> 1 at the start, 2 at the end
      integer, intent(in) :: which

      real(wp) :: weight
      integer :: block

      self%mean(:, which) = [sum(self%place), sum(self%speed), sum(self%bend)] / self%blocks
      weight = sum(self%pull)
      self%pulled(:, which) = [sum(self%pull * self%place), sum(self%pull * self%speed), &
         & sum(self%pull * self%bend)] / weight
      self%total_force(which) = 0.0_wp
      do block = 1, self%blocks
         self%total_force(which) = self%total_force(which) + self%block_force(block)
      end do
      if (which == 1) then
         self%start_acceleration = 2.0_wp * self%mean(3, 1)
         return
      end if
      self%displacement = self%mean(1, 2)
      self%velocity = self%mean(2, 2)
      self%acceleration = 2.0_wp * self%mean(3, 2)
      if (abs(self%velocity) > 0.0_wp) self%direction = sign(1.0_wp, self%velocity)
   end subroutine sum_motion

   !> Force of a block on its contacts [N].
   pure function block_force(self, block) result(force)
      class(row_slider_type), intent(in) :: self
      integer, intent(in) :: block
      real(wp) :: force

      associate (law => self%law(block))
         force = law%stiffness * self%place(block) - law%offset + law%drag * self%speed(block) &
            & + law%rate * (self%moment(block) - self%offer_moment(block))
      end associate
   end function block_force

   !> Where the blocks rest, and the velocities with which the drive takes them along, in balance of
   !> all forces but inertia and damping between neighbours.
   subroutine solve_static(self, drive, place, speed)
      class(row_slider_type), intent(in) :: self
      !> Displacement and velocity of the drive
      real(wp), intent(in) :: drive(0:1)
      real(wp), intent(out) :: place(:), speed(:)

      real(wp), dimension(self%blocks) :: diagonal, drag
      integer :: n

      n = self%blocks
      diagonal = self%neighbours * self%bond + self%pull + self%law%stiffness * self%inverse_mass
      drag = self%law%drag * self%inverse_mass + self%neighbours * self%viscosity
      speed = self%pull * drive(1) - self%law%rate * self%inverse_mass
      call solve_bonds(self%bond, diagonal, speed)
      place = self%pull * drive(0) + (self%law%offset + self%law%rate * self%offer_moment) &
         & * self%inverse_mass - drag * speed
      place(2:) = place(2:) + self%viscosity * speed(:n - 1)
      place(:n - 1) = place(:n - 1) + self%viscosity * speed(2:)
      call solve_bonds(self%bond, diagonal, place)
   end subroutine solve_static

   !> Solve a system of a diagonal and equal bonds between neighbours.
   pure subroutine solve_bonds(bond, diagonal, values)
      real(wp), intent(in) :: bond, diagonal(:)
      !> Right-hand side, then the solution
      real(wp), intent(inout) :: values(:)

      real(wp) :: ratio(size(values)), pivot
      integer :: row

      pivot = diagonal(1)
      values(1) = values(1) / pivot
      do row = 2, size(values)
         ratio(row) = bond / pivot
         pivot = diagonal(row) - bond * ratio(row)
         values(row) = (values(row) + bond * values(row - 1)) / pivot
      end do
      do row = size(values) - 1, 1, -1
         values(row) = values(row) + ratio(row + 1) * values(row + 1)
      end do
   end subroutine solve_bonds

   !> Let the row rest if its ringing is below rounding: then all blocks move with the drive.
   subroutine try_rest(self)
      class(row_slider_type), intent(inout) :: self

      real(wp) :: place(self%blocks), speed(self%blocks), drive(0:2), limit, tolerance
      integer :: block

      if (abs(self%drive%acceleration) > 0.0_wp) return
      drive = drive_at(self, 0.0_wp)
      call self%solve_static(drive(0:1), place, speed)
      limit = rounding * maxval(abs(place)) + self%tiny_displacement
      tolerance = maxval(self%law%tolerance)
      if (tolerance > 0.0_wp) limit = max(limit, tolerance / self%pinned_stiffness)
      if (any(abs(self%place - place) > limit)) return
      if (any(abs(self%speed - speed) > limit * sqrt(self%bond + self%pull(1) &
         & + self%pinned_stiffness * self%inverse_mass))) return
      do block = 1, self%blocks
         associate (window => self%window(block))
            if (place(block) > window%upper .or. place(block) < window%lower) return
         end associate
      end do
      self%rests = .true.
      self%place = place
      self%speed = speed
      self%bend = 0.0_wp
      self%damper = 0.0_wp
      self%order = 2
      self%published(:, 0) = place
      self%published(:, 1) = speed
      self%published(:, 2) = 0.0_wp
   end subroutine try_rest

end module mesoslip_sliders_interface_row
