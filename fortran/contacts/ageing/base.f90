!> State of contacts that age, and where each of them breaks.
module mesoslip_contacts_ageing_base
   use mesoslip_contacts_ageing_law, only: ageing_law_type
   use mesoslip_contacts_ageing_meeting, only: meet
   use mesoslip_motion_prediction, only: prediction_type
   use mesoslip_contacts_individual_base, only: individual_contacts_type
   use mesoslip_contacts_individual_queue, only: contact_queue_type
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, &
      & row_stiffness, ahead_coordinate
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_schedule, only: max_events
   implicit none
   private

   public :: ageing_contacts_type, append, rebuild_ageing, remove, position_of
   public :: tiny_gap
   public :: in_queue, in_leaders, in_falling
   public :: leaders, falling, near
   public :: life_length, life_birth, life_limit, life_motion, no_motion, any_motion
   public :: next_length, next_limit, next_speed, next_configured, solved_together

   !> Gap to its threshold over the mean breaking stretch at which an ageing contact breaks
   real(wp), parameter :: tiny_gap = 1.0e-12_wp

   !> Visits of contacts that take as long as an advance of a rigid slider
   real(wp), parameter :: visits_per_cost = 5.0_wp

   !> Where a contact is kept: in the queue, among the leaders, among those whose thresholds fall
   integer, parameter :: in_queue = 0, in_leaders = 1, in_falling = 2

   !> The lists: leaders, contacts whose thresholds fall, and those of them that may break soon
   integer, parameter :: lists = 3
   integer, parameter :: leaders = 1, falling = 2, near = 3

   !> Numbers of the life of a contact: time of birth [s], configured breaking stretch [m], and the
   !> steady motion for which its limit is exact: none, the number of one, or any
   integer, parameter :: life_length = 3
   integer, parameter :: life_birth = 1, life_limit = 2, life_motion = 3
   real(wp), parameter :: no_motion = -1.0_wp, any_motion = huge(1.0_wp)

   !> Numbers of the next life of a contact: its limit [m] if it is born at a speed, that speed
   !> [m/s], and its configured breaking stretch [m], which is set in a schedule
   integer, parameter :: next_length = 3
   integer, parameter :: next_limit = 1, next_speed = 2, next_configured = 3
   !> Next lives that are solved together; the thresholds of some may not be drawn yet
   integer, parameter :: solved_together = 64

   !> An unordered list: the first `count` numbers are in use.
   type :: list_type
      integer :: count = 0
      integer, allocatable :: contact(:)
   end type list_type

   !> Contacts that age. The limit in a record is a lower bound on the stretch at which the contact
   !> breaks in the direction of motion: in a steady motion where it does, otherwise its threshold
   !> when it was evaluated last, or when it is old if the threshold falls.
   type, abstract, extends(individual_contacts_type) :: ageing_contacts_type
      !> How thresholds change
      type(ageing_law_type) :: ageing
      !> Whether the slider may jump at a fixed time when the law changes
      logical :: jumps = .false.
      !> Mean configured breaking stretch [m]
      real(wp) :: stretch = 1.0_wp
      !> Numbers of the lives, shape (life_length, count)
      real(wp), allocatable :: life(:, :)
      type(contact_queue_type) :: queue
      !> Numbers of the next lives, shape (next_length, count)
      real(wp), allocatable :: next(:, :)
      !> Contacts whose next limits are to be solved
      integer :: unsolved_count = 0, unsolved(solved_together) = 0
      !> One array, because gfortran 12 frees only one of several components of this type
      type(list_type) :: list(lists)
      !> Keys of the leaders [m], in decreasing order; shape (count)
      real(wp), allocatable :: leader_key(:)
      !> Where each contact is kept, shape (count)
      integer, allocatable :: kept(:)
      !> Coordinates between which [m], and time until which [s], contacts whose thresholds fall do
      !> not break unless they are near
      real(wp) :: scan_upper = huge(1.0_wp), scan_lower = -huge(1.0_wp)
      real(wp) :: scan_time = huge(1.0_wp)
      !> Time of the last response [s]
      real(wp) :: now = 0.0_wp
      !> Motion of the slider as predicted under the law that was offered last
      type(prediction_type) :: prediction
      !> Whether the slider moves steadily in the direction of the queue, number of that motion, and
      !> the speed up to which limits are bounds [m/s]
      logical :: is_steady = .false.
      real(wp) :: motion = 0.0_wp, speed = huge(1.0_wp)
      !> Whether the last response left the law unchanged
      logical :: is_unchanged = .false.
      !> Contacts of the breaks in the schedule
      integer :: listed(max_events) = 0
   contains
      procedure :: rebuild => rebuild_ageing
      procedure :: behind_of, records, limit_at_birth
      !> For kinds that break by thermal activation, too: a life begins or ends, contacts break
      procedure :: begin_life, end_life, break_activated
      procedure, non_overridable :: solve, solve_all, put, refresh, threshold, mean_of, ahead_of, &
         & behind_at
      procedure, non_overridable :: is_due, is_falling, record_lateness, count_visits
   end type ageing_contacts_type

contains

   !> Add a contact to a list.
   pure subroutine append(list, contact)
      type(list_type), intent(inout) :: list
      integer, intent(in) :: contact

      list%count = list%count + 1
      list%contact(list%count) = contact
   end subroutine append

   !> Remove a contact from a list; the last one takes its position.
   pure subroutine remove(list, position)
      type(list_type), intent(inout) :: list
      integer, intent(in) :: position

      list%contact(position) = list%contact(list%count)
      list%count = list%count - 1
   end subroutine remove

   !> Position of a contact in a list; 0 if it is not in it.
   pure function position_of(list, contact) result(position)
      type(list_type), intent(in) :: list
      integer, intent(in) :: contact
      integer :: position

      do position = list%count, 1, -1
         if (list%contact(position) == contact) return
      end do
      position = 0
   end function position_of

   !> Solve the limit of a contact: exact in a steady motion, else a lower bound at any speed.
   subroutine solve(self, contact, displacement, time)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: displacement, time

      real(wp) :: age, stretch

      associate (life => self%life(:, contact), limit => self%record(row_limit, contact))
         age = time - life(life_birth)
         if (self%ageing%is_old(age) .or. self%ageing%is_constant(life(life_limit), &
            & self%mean_of(contact))) then
            limit = life(life_limit)
            life(life_motion) = any_motion
            return
         end if
         if (self%is_steady) then
            stretch = self%direction * (displacement - self%record(row_origin, contact))
            life(life_motion) = self%motion
            limit = meet(self%ageing, life(life_limit), self%mean_of(contact), age, stretch, &
               & self%speed)
         else
            life(life_motion) = no_motion
            limit = life(life_limit)
            if (.not. self%ageing%falls(limit, self%mean_of(contact))) then
               call self%refresh(contact, time)
            end if
         end if
      end associate
   end subroutine solve

   !> Solve all limits again, but those of falling thresholds unless the motion is steady.
   subroutine solve_all(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      self%list(leaders)%count = 0
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         if (self%kept(contact) == in_falling .and. .not. self%is_steady) cycle
         self%kept(contact) = in_queue
         if (self%life(life_motion, contact) >= any_motion) cycle
         call self%solve(contact, pose%displacement, pose%time)
      end do
      call self%rebuild(pose%displacement)
      call self%count_visits(self%parameters%count)
   end subroutine solve_all

   !> Put a contact into the queue.
   subroutine put(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%kept(contact) = in_queue
      call self%queue%insert(contact, self%ahead_of(contact))
   end subroutine put

   !> Set the limit of a contact to its threshold at a time.
   subroutine refresh(self, contact, time)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: time

      self%record(row_limit, contact) = self%threshold(contact, time)
   end subroutine refresh

   !> Threshold of a contact at a time, as a stretch [m].
   pure function threshold(self, contact, time)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: time
      real(wp) :: threshold

      threshold = self%ageing%threshold(self%life(life_limit, contact), self%mean_of(contact), &
         & time - self%life(life_birth, contact))
   end function threshold

   !> Mean configured breaking stretch at the place on the track where a contact attached [m].
   pure function mean_of(self, contact) result(mean)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: mean

      mean = self%stretch
      if (allocated(self%births%factor)) mean = mean * self%births%factor(contact)
   end function mean_of

   !> A threshold that falls must not detach the contact later.
   pure function limit_at_birth(self, limit) result(newborn)
      class(ageing_contacts_type), intent(in) :: self
      real(wp), intent(in) :: limit
      real(wp) :: newborn

      newborn = self%ageing%newborn_threshold(limit, self%stretch)
   end function limit_at_birth

   !> Coordinate at which a contact with its present limit breaks in the direction of motion.
   pure function ahead_of(self, contact) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: coordinate

      coordinate = ahead_coordinate(self%record(:, contact), self%direction)
   end function ahead_of

   !> Sort all contacts again.
   subroutine rebuild_ageing(self, displacement)
      class(ageing_contacts_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      integer :: contact, position

      call self%queue%clear(self%direction, self%direction * displacement)
      do contact = 1, self%parameters%count
         if (self%kept(contact) /= in_queue) cycle
         if (self%record(row_stiffness, contact) > 0.0_wp) then
            call self%queue%insert(contact, self%ahead_of(contact))
         end if
      end do
      do position = 1, self%list(leaders)%count
         self%leader_key(position) = self%ahead_of(self%list(leaders)%contact(position))
      end do
   end subroutine rebuild_ageing

   !> A contact has attached: nothing more here.
   subroutine begin_life(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

   end subroutine begin_life

   !> A contact breaks or separates: nothing more here.
   subroutine end_life(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

   end subroutine end_life

   !> Break contacts by thermal activation: none here.
   subroutine break_activated(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

   end subroutine break_activated

   !> Falling thresholds have their own bounds (mesoslip_contacts_ageing_falling).
   pure function behind_of(self, contact) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: coordinate

      coordinate = -huge(1.0_wp)
      if (self%kept(contact) /= in_falling) coordinate = self%behind_at(contact, self%now)
   end function behind_of

   !> Maximum coordinate at which a contact may break after a reversal at a time or later.
   pure function behind_at(self, contact, time) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: time
      real(wp) :: coordinate

      real(wp) :: limit

      limit = self%life(life_limit, contact)
      if (.not. self%ageing%falls(limit, self%mean_of(contact))) then
         limit = self%threshold(contact, time)
      end if
      coordinate = self%direction * self%record(row_origin, contact) - limit
   end function behind_at

   !> Whether a contact breaks, given that its limit is its present threshold.
   pure function is_due(self, contact, pose)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      logical :: is_due

      real(wp) :: gap

      gap = self%ahead_of(contact) - self%direction * pose%displacement
      ! A moving threshold is not reached to the last digit.
      is_due = gap <= 0.0_wp .or. (gap <= tiny_gap * self%stretch &
         & .and. self%life(life_motion, contact) < any_motion)
   end function is_due

   !> Whether the threshold of a contact falls, and its limit is that when it is old.
   pure function is_falling(self, contact)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      logical :: is_falling

      is_falling = self%life(life_motion, contact) < any_motion &
         & .and. self%ageing%falls(self%life(life_limit, contact), self%mean_of(contact))
   end function is_falling

   !> Record as an error of the force that a contact breaks too late.
   pure subroutine record_lateness(self, contact, pose)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: late

      late = self%direction * pose%displacement - self%ahead_of(contact)
      if (late > tiny_gap * self%stretch .and. self%life(life_motion, contact) < any_motion) then
         self%error_estimate = max(self%error_estimate, late * self%parameters%stiffness)
      end if
   end subroutine record_lateness

   !> Add the cost of visiting contacts, so that segments of a run stay short.
   pure subroutine count_visits(self, visits)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: visits

      self%cost = self%cost + visits / visits_per_cost
   end subroutine count_visits

   pure subroutine records(self, time, first, values)
      class(ageing_contacts_type), intent(in) :: self
      real(wp), intent(in) :: time
      integer, intent(in) :: first
      real(wp), intent(out) :: values(:, :)

      integer :: contact, place

      do place = 1, size(values, 2)
         contact = first + place - 1
         values(:, place) = self%record([row_origin, row_stiffness, row_limit, row_renewal], &
            & contact)
         if (self%record(row_stiffness, contact) > 0.0_wp) then
            values(3, place) = self%threshold(contact, time)
         end if
      end do
   end subroutine records

end module mesoslip_contacts_ageing_base
