!> State of a row of blocks: a published motion of each, and motions of their own.
!>
!> See mesoslip_sliders_interface_row for what they are.
module mesoslip_sliders_interface_state
   use mesoslip_interface_law, only: clocks, hazard_clock_type, interface_law_type, pose_type, &
      & window_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_base, only: slider_type
   use mesoslip_sliders_interface_polynomials, only: max_order, max_points, min_points, &
      & new_rules, reach_of, rule_type
   use mesoslip_sliders_interface_queue, only: event_queue_type
   implicit none
   private

   public :: row_state_type, excess_type
   public :: block_values, busy_pace, quiet_pace, min_pace, min_order, rounding
   public :: add_exactly, load_motion, motion_of_damper, neighbour_motion

   !> Message where memory has run out
   character(len=*), parameter :: no_memory = "not enough memory for the blocks"
   !> Numbers of each block in the record: displacement, velocity, contact force, detached contacts
   integer, parameter :: block_values = 4
   !> Duration of a step in units of one over the fastest rate, while contacts break, and at most
   real(wp), parameter :: busy_pace = 0.2_wp, quiet_pace = 2.5_wp, min_pace = 0.02_wp
   !> Minimum order of a motion
   integer, parameter :: min_order = 4
   !> Forces and displacements that are equal up to rounding
   real(wp), parameter :: rounding = 64.0_wp * epsilon(1.0_wp)

   !> A block in its step.
   type :: block_type
      !> Force of its contacts, where it holds, and their clocks
      type(interface_law_type) :: law
      type(window_type) :: window
      type(hazard_clock_type) :: clock(clocks)
      !> What ends its motion, an event_ code
      integer :: kind = 0
      !> Whether it has a motion of its own, of which order, and whether that exceeds the published
      !> one
      logical :: is_own = .false., exceeds = .false.
      integer :: own_order = min_order
   end type block_type

   !> An excess over published motions, and its integrals since the start of the step or the
   !> last publication.
   type :: excess_type
      real(wp) :: value = 0.0_wp, once = 0.0_wp, twice = 0.0_wp, thrice = 0.0_wp
   end type excess_type

   !> Blocks in a row, joined by springs, with a spring to the drive at the first, or at all.
   type, abstract, extends(slider_type) :: row_state_type
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
      !> Displacement of a block by its neighbours, beyond their published motions, up to which it
      !> goes on without [m]
      real(wp) :: max_unknown = 0.0_wp
      !> Stiffness of the contacts of a block when all are pinned [N/m]
      real(wp) :: pinned_stiffness = 0.0_wp
      type(block_type), allocatable :: block(:)
      !> Displacement [m], velocity [m/s], half the acceleration [m/s2], and deceleration by the
      !> damper [m/s2] of each block, at its own time after the start of the step [s]
      real(wp), allocatable :: place(:), speed(:), bend(:), damper(:), moment(:)
      !> Part of the displacement below its rounding [m]; without it equal steps would be rounded
      !> equally
      real(wp), allocatable :: place_remainder(:)
      !> Sign of the last velocity that was not zero
      real(wp), allocatable :: sense(:)
      !> Time at which the law of its contacts was offered, after the start of the step [s], and
      !> increase of their clocks since then
      real(wp), allocatable :: offer_moment(:), elapsed(:, :)
      !> Number of detached contacts of each block, for the record
      real(wp), allocatable :: detached(:)
      !> Duration of the next step in units of one over the fastest rate
      real(wp) :: pace = busy_pace
      !> The same after steps with contact events, and how often in the step blocks had to know of a
      !> neighbour before its end
      real(wp) :: event_pace = busy_pace
      integer :: publications = 0
      !> Whether no contact broke or attached in the last step; whether all blocks rest
      logical :: is_quiet = .false., rests = .false.
      !> Time from which the blocks' own times count: the start of a step, then its end [s]
      real(wp) :: base_time = 0.0_wp
      !> Length of the step [s]
      real(wp) :: length = 0.0_wp

      !> Spring and damping between neighbours, spring to the drive, over the mass of a block
      real(wp) :: bond = 0.0_wp, viscosity = 0.0_wp
      real(wp), allocatable :: pull(:)
      real(wp) :: max_pull = 0.0_wp
      !> Number of neighbours of each block; of one inside the row, which the poses of all blocks
      !> have, so that the contacts of blocks that move alike take the same steps
      real(wp), allocatable :: neighbours(:)
      real(wp) :: max_neighbours = 0.0_wp
      !> Published motion of each block and its damper's, shape (blocks, 0:max_order), and its order
      real(wp), allocatable :: published(:, :), published_damper(:, :)
      integer :: order = min_order
      !> Own motion of each block since its own time, the damper's, and the excess over the
      !> published motion, shape (0:max_order, blocks); motion of both neighbours together
      real(wp), allocatable :: own(:, :), own_damper(:, :), excess(:, :), around(:, :)
      !> Integral of the excess since it was last published, the integral of that, and once more
      real(wp), allocatable :: excess_once(:), excess_twice(:), excess_thrice(:)
      !> Excess of both neighbours together that a block knows, and up to when [s]
      type(excess_type), allocatable :: known(:)
      real(wp), allocatable :: known_moment(:)
      !> Third and fourth derivatives of the motion of each block at its own time
      real(wp), allocatable :: jerk(:), snap(:)
      !> Laws of the blocks' contacts side by side: stiffness [N/m] and drag [N s/m]
      real(wp), allocatable :: law_stiffness(:), law_drag(:)
      !> Time after the start of the step up to which its motion is exact [s]
      real(wp), allocatable :: horizon(:)
      !> Time until its next event [s]
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
      procedure, non_overridable :: set_up_row, block_pose, block_force, sum_motion
   end type row_state_type

contains

   !> Allocate the row, whose parameters are set.
   subroutine set_up_row(self, error)
      class(row_state_type), intent(inout) :: self
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: block_mass
      integer :: order, stat

      associate (n => self%blocks)
         call reserve(self%place, n, 0.0_wp, error)
         call reserve(self%place_remainder, n, 0.0_wp, error)
         call reserve(self%speed, n, 0.0_wp, error)
         call reserve(self%bend, n, 0.0_wp, error)
         call reserve(self%damper, n, 0.0_wp, error)
         call reserve(self%moment, n, 0.0_wp, error)
         call reserve(self%offer_moment, n, 0.0_wp, error)
         call reserve(self%detached, n, 0.0_wp, error)
         call reserve(self%excess_once, n, 0.0_wp, error)
         call reserve(self%excess_twice, n, 0.0_wp, error)
         call reserve(self%excess_thrice, n, 0.0_wp, error)
         call reserve(self%known_moment, n, 0.0_wp, error)
         call reserve(self%jerk, n, 0.0_wp, error)
         call reserve(self%snap, n, 0.0_wp, error)
         call reserve(self%law_stiffness, n, 0.0_wp, error)
         call reserve(self%law_drag, n, 0.0_wp, error)
         call reserve(self%horizon, n, 0.0_wp, error)
         call reserve(self%span, n, 0.0_wp, error)
         call reserve(self%pull, n, 0.0_wp, error)
         call reserve(self%sense, n, 1.0_wp, error)
         call reserve(self%neighbours, n, 1.0_wp, error)
         call reserve_table(self%published, [1, 0], [n, max_order], error)
         call reserve_table(self%published_damper, [1, 0], [n, max_order], error)
         call reserve_table(self%own, [0, 1], [max_order, n], error)
         call reserve_table(self%own_damper, [0, 1], [max_order, n], error)
         call reserve_table(self%excess, [0, 1], [max_order, n], error)
         call reserve_table(self%around, [0, 1], [max_order, n], error)
         call reserve_table(self%elapsed, [1, 1], [clocks, n], error)
         if (.not. allocated(error)) call self%queue%open(n, error)
         if (allocated(error)) return
         allocate (self%known(n), stat=stat)
         if (stat == 0) then
            allocate (self%block(n), stat=stat)
         end if
         if (stat /= 0) then
            call raise(error, status_memory, no_memory)
            return
         end if
         block_mass = self%mass / n
         self%neighbours = 2.0_wp
         self%neighbours(1) = self%neighbours(1) - 1.0_wp
         self%neighbours(n) = self%neighbours(n) - 1.0_wp
         self%max_neighbours = maxval(self%neighbours)
         self%bond = self%neighbour_spring / block_mass
         self%viscosity = self%neighbour_damping
         self%pull = self%top_stiffness / self%mass
         self%pull(1) = self%pull(1) + self%edge_stiffness / block_mass
         self%max_pull = maxval(self%pull)
         self%inverse_mass = 1.0_wp / block_mass
      end associate
      self%cost = 1.0_wp + 0.25_wp * self%blocks
      do order = 1, max_order
         self%reach(order) = reach_of(order)
      end do
      call new_rules(self%rule)
   end subroutine set_up_row

   !> Allocate a list of numbers, unless memory has run out before.
   subroutine reserve(list, length, value, error)
      real(wp), allocatable, intent(inout) :: list(:)
      integer, intent(in) :: length
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      if (allocated(error)) return
      allocate (list(length), source=value, stat=stat)
      if (stat /= 0) call raise(error, status_memory, no_memory)
   end subroutine reserve

   !> The same for a table of numbers, by the bounds of its indices.
   subroutine reserve_table(table, first, last, error)
      real(wp), allocatable, intent(inout) :: table(:, :)
      integer, intent(in) :: first(2), last(2)
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      if (allocated(error)) return
      allocate (table(first(1):last(1), first(2):last(2)), source=0.0_wp, stat=stat)
      if (stat /= 0) call raise(error, status_memory, no_memory)
   end subroutine reserve_table

   !> Motion of a block since its own time.
   pure subroutine load_motion(self, block, series, order)
      class(row_state_type), intent(in) :: self
      integer, intent(in) :: block
      real(wp), intent(out) :: series(0:max_order)
      integer, intent(out) :: order

      if (self%block(block)%is_own) then
         order = self%block(block)%own_order
         series(:order) = self%own(:order, block)
      else
         order = self%order
         series(:order) = self%published(block, :order)
      end if
   end subroutine load_motion

   !> Series of the deceleration by a block's damper since its own time.
   pure function motion_of_damper(self, block, order) result(damper)
      class(row_state_type), intent(in) :: self
      integer, intent(in) :: block, order
      real(wp) :: damper(0:max_order)

      if (self%block(block)%is_own) then
         damper(:order - 1) = self%own_damper(:order - 1, block)
      else
         damper(:order - 1) = self%published_damper(block, :order - 1)
      end if
   end function motion_of_damper

   !> Move a block, and keep the rounding error of its displacement.
   elemental subroutine add_exactly(place, remainder, displacement)
      !> Displacement [m], and its part below rounding
      real(wp), intent(inout) :: place
      real(wp), intent(out) :: remainder
      !> Increase, with the remainder before [m]
      real(wp), intent(in) :: displacement

      real(wp) :: before

      before = place
      place = before + displacement
      remainder = displacement - (place - before)
   end subroutine add_exactly

   !> Published motion of both neighbours of a block together.
   pure function neighbour_motion(self, block, order) result(around)
      class(row_state_type), intent(in) :: self
      integer, intent(in) :: block, order
      real(wp) :: around(0:order)

      around = 0.0_wp
      if (block > 1) around = self%published(block - 1, :order)
      if (block < self%blocks) around = around + self%published(block + 1, :order)
   end function neighbour_motion

   !> Pose of a block.
   pure function block_pose(self, block) result(pose)
      class(row_state_type), intent(in) :: self
      integer, intent(in) :: block
      type(pose_type) :: pose

      pose = pose_type(self%base_time + self%moment(block), self%place(block), self%speed(block), &
         & 2.0_wp * self%bend(block), self%sense(block), self%inverse_mass, &
         & sqrt(self%max_neighbours * self%bond + self%pull(block)), .false.)
   end function block_pose

   !> Force of a block on its contacts [N].
   pure function block_force(self, block) result(force)
      class(row_state_type), intent(in) :: self
      integer, intent(in) :: block
      real(wp) :: force

      associate (law => self%block(block)%law)
         force = law%stiffness * self%place(block) - law%offset + law%drag * self%speed(block) &
            & + law%rate * (self%moment(block) - self%offer_moment(block))
      end associate
   end function block_force

   !> Sum up the motion of all blocks at the start or the end of a step.
   subroutine sum_motion(self, which)
      class(row_state_type), intent(inout) :: self
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

end module mesoslip_sliders_interface_state
