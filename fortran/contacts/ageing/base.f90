!> State of contacts that age, and where one of them breaks.
module mesoslip_contacts_ageing_base
   use mesoslip_contacts_ageing_law, only: ageing_law_type
   use mesoslip_contacts_ageing_lists, only: list_type
   use mesoslip_contacts_ageing_meeting, only: meet, meet_bound
   use mesoslip_contacts_individual_base, only: individual_contacts_type
   use mesoslip_contacts_individual_queue, only: contact_queue_type
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, &
      & row_stiffness, ahead_coordinate
   use mesoslip_interface_law, only: interface_law_type, pose_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_schedule, only: max_events
   implicit none
   private

   public :: ageing_contacts_type
   public :: tiny_gap, safety, few
   public :: in_queue, in_leaders, in_falling
   public :: leaders, falling, near
   public :: life_length, life_birth, life_limit, life_motion, no_motion, any_motion
   public :: next_length, next_limit, next_speed, next_configured, solved_together

   !> Gap to its threshold over the mean breaking stretch at which a contact breaks that ages.
   real(wp), parameter :: tiny_gap = 1.0e-12_wp
   !> Factor by which the motion may be foreseen worse than it was last time.
   real(wp), parameter :: safety = 4.0_wp
   !> Number of contacts whose thresholds fall that are all near.
   integer, parameter :: few = 32

   !> Visits of contacts that take as long as an advance of a rigid slider
   real(wp), parameter :: visits_per_cost = 5.0_wp

   !> Where a contact is kept: in the queue, among the leaders, among those that fall
   integer, parameter :: in_queue = 0, in_leaders = 1, in_falling = 2

   !> The lists of contacts
   integer, parameter :: lists = 3
   integer, parameter :: leaders = 1, falling = 2, near = 3

   !> Numbers of the life of a contact: when it was born [s], its configured breaking stretch [m],
   !> and the steady motion under which it breaks where it is queued: none, one, or any
   integer, parameter :: life_length = 3
   integer, parameter :: life_birth = 1, life_limit = 2, life_motion = 3
   real(wp), parameter :: no_motion = -1.0_wp, any_motion = huge(1.0_wp)

   !> Numbers of the next life of a contact
   integer, parameter :: next_length = 3
   integer, parameter :: next_limit = 1, next_speed = 2, next_configured = 3
   !> Next lives that are solved together, of which some are not drawn
   integer, parameter :: solved_together = 64

   !> Contacts that age. The limit in a record is a bound from below on the stretch at which the
   !> contact breaks in the direction of motion.
   type, abstract, extends(individual_contacts_type) :: ageing_contacts_type
      !> How thresholds change
      type(ageing_law_type) :: ageing
      !> Whether the slider may jump while time stands still, when the law changes
      logical :: jumps = .false.
      !> Whether it matters if the slider becomes faster than the speed of the queue
      logical :: may_outrun = .true.
      !> Mean configured breaking stretch [m]
      real(wp) :: stretch = 1.0_wp
      !> Numbers of their lives, shape (life_length, count)
      real(wp), allocatable :: life(:, :)
      type(contact_queue_type) :: queue
      !> Limit of the next life of each contact if it is born at a speed in the direction of motion
      !> [m], and that speed [m/s], known ahead or not; its configured breaking stretch, if it is
      !> listed in a schedule [m]; shape (next_length, count)
      real(wp), allocatable :: next(:, :)
      !> Contacts for which it is still to be found
      integer :: unsolved_count = 0, unsolved(solved_together) = 0
      !> Contacts that lead, whose thresholds fall, and those of them that are near. In one array,
      !> as of several components of this type gfortran 12 frees only one
      type(list_type) :: list(lists)
      !> Keys of the leaders, from the last to the first of them [m]; shape (count)
      real(wp), allocatable :: leader_key(:)
      !> Where each contact is kept, shape (count)
      integer, allocatable :: kept(:)
      !> Coordinates between which [m], and time until which [s], no other contacts whose thresholds
      !> fall break than those that are near
      real(wp) :: scan_upper = huge(1.0_wp), scan_lower = -huge(1.0_wp)
      real(wp) :: scan_time = huge(1.0_wp)
      !> Time of the last response [s]
      real(wp) :: now = 0.0_wp
      !> Law that was offered last; acceleration of the slider under it [m/s2], and jerk, as far as
      !> it follows from the law; error of the jerk in the last motions, and its bound [m/s3]
      type(interface_law_type) :: law_offered
      real(wp) :: acceleration = 0.0_wp, jerk = 0.0_wp, jerk_error = 0.0_wp, jerk_doubt = 0.0_wp
      !> Whether the slider moves steadily in the direction of the queue, number of its motion, and
      !> the speed for which the queue is ordered [m/s]; births and solutions since that was set
      logical :: is_steady = .false.
      real(wp) :: motion = 0.0_wp, speed = 0.0_wp
      integer :: solved = 0
      !> Whether the law stayed as it was in the last response
      logical :: is_unchanged = .false.
      !> Contacts of the breaks in the schedule
      integer :: listed(max_events) = 0
   contains
      procedure :: rebuild
      procedure :: behind_of
      procedure :: records
      !> Solve where a contact breaks, and where all do
      procedure, non_overridable :: order
      procedure, non_overridable :: order_all
      !> Put a contact into the queue
      procedure, non_overridable :: put
      !> Make the bound of a contact's breaking stretch that of a time
      procedure, non_overridable :: refresh
      !> Coordinate before which a contact does not break on the way back
      procedure, non_overridable :: behind_at
      !> Whether a contact breaks, and how late it does
      procedure, non_overridable :: is_due
      procedure, non_overridable :: record_lateness
      !> Add the work of visiting contacts in an advance
      procedure, non_overridable :: count_visits
   end type ageing_contacts_type

contains

   !> Solve where a contact breaks at the speed of the queue, or a bound on it.
   subroutine order(self, contact, displacement, time)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Displacement of the slider [m], and time [s]
      real(wp), intent(in) :: displacement, time

      real(wp) :: age, stretch

      self%solved = self%solved + 1
      associate (life => self%life(:, contact), limit => self%record(row_limit, contact))
         age = time - life(life_birth)
         if (self%ageing%is_old(age) .or. self%ageing%is_constant(life(life_limit), &
            & self%stretch)) then
            limit = life(life_limit)
            life(life_motion) = any_motion
            return
         end if
         stretch = self%direction * (displacement - self%record(row_origin, contact))
         if (self%is_steady) then
            life(life_motion) = self%motion
            limit = meet(self%ageing, life(life_limit), self%stretch, age, stretch, self%speed)
         else
            life(life_motion) = no_motion
            limit = meet_bound(self%ageing, life(life_limit), self%stretch, age, stretch, &
               & self%speed)
         end if
      end associate
   end subroutine order

   !> Solve again where contacts break, of all that are not in the list of those that fall.
   subroutine order_all(self, pose)
      class(ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      self%list(leaders)%count = 0
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         if (self%kept(contact) == in_falling .and. .not. self%is_steady) cycle
         self%kept(contact) = in_queue
         if (self%life(life_motion, contact) >= any_motion) cycle
         call self%order(contact, pose%displacement, pose%time)
      end do
      self%solved = 0
      call self%rebuild(pose%displacement)
      call self%count_visits(self%parameters%count)
   end subroutine order_all

   !> Put a contact into the queue.
   subroutine put(self, contact)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%kept(contact) = in_queue
      call self%queue%insert(contact, &
         & ahead_coordinate(self%record(:, contact), self%direction))
   end subroutine put

   !> Make the bound of a contact's breaking stretch that of a time, or of the end of its scan.
   subroutine refresh(self, contact, time)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: time

      self%record(row_limit, contact) = self%ageing%threshold(self%life(life_limit, contact), &
         & self%stretch, time - self%life(life_birth, contact))
   end subroutine refresh

   subroutine rebuild(self, displacement)
      class(ageing_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      integer :: contact, position

      call self%queue%clear(self%direction, self%direction * displacement)
      do contact = 1, self%parameters%count
         if (self%kept(contact) /= in_queue) cycle
         if (self%record(row_stiffness, contact) > 0.0_wp) then
            call self%queue%insert(contact, &
               & ahead_coordinate(self%record(:, contact), self%direction))
         end if
      end do
      do position = 1, self%list(leaders)%count
         self%leader_key(position) = ahead_coordinate(self%record(:, &
            & self%list(leaders)%contact(position)), self%direction)
      end do
   end subroutine rebuild

   !> Greatest coordinate at which a pinned contact may break on the way back; of those whose
   !> thresholds fall it is known otherwise.
   pure function behind_of(self, contact) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: coordinate

      coordinate = -huge(1.0_wp)
      if (self%kept(contact) /= in_falling) coordinate = self%behind_at(contact, self%now)
   end function behind_of

   !> Coordinate before which a contact does not break on the way back, from now on.
   pure function behind_at(self, contact, time) result(coordinate)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      !> Time of now [s]
      real(wp), intent(in) :: time
      real(wp) :: coordinate

      real(wp) :: limit

      associate (configured => self%life(life_limit, contact))
         limit = configured
         if (.not. self%ageing%falls(configured, self%stretch)) then
            limit = self%ageing%threshold(configured, self%stretch, &
               & time - self%life(life_birth, contact))
         end if
      end associate
      coordinate = self%direction * self%record(row_origin, contact) - limit
   end function behind_at

   !> Whether a contact breaks, now that its bound is that of now.
   pure function is_due(self, contact, pose)
      class(ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      logical :: is_due

      real(wp) :: gap

      gap = ahead_coordinate(self%record(:, contact), self%direction) &
         & - self%direction * pose%displacement
      ! One whose threshold moves is never met to the last digit.
      is_due = gap <= 0.0_wp .or. (gap <= tiny_gap * self%stretch &
         & .and. self%life(life_motion, contact) < any_motion)
   end function is_due

   !> Remember it as an error of the force if a contact breaks later than it should have.
   pure subroutine record_lateness(self, contact, pose)
      class(ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: late

      late = self%direction * pose%displacement &
         & - ahead_coordinate(self%record(:, contact), self%direction)
      if (late > tiny_gap * self%stretch .and. self%life(life_motion, contact) < any_motion) then
         self%error_estimate = max(self%error_estimate, late * self%parameters%stiffness)
      end if
   end subroutine record_lateness

   !> Add the work of visiting contacts: a segment of a run must not last long, however many of them
   !> an advance visits.
   pure subroutine count_visits(self, visits)
      class(ageing_contacts_type), intent(inout) :: self
      !> Number of visits
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
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         values(3, place) = self%ageing%threshold(self%life(life_limit, contact), self%stretch, &
            & time - self%life(life_birth, contact))
      end do
   end subroutine records

end module mesoslip_contacts_ageing_base
