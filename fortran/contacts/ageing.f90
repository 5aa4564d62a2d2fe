!> N contacts that know nothing of each other, whose thresholds change with their age.
!>
!> A contact breaks at the first time at which its force is its threshold, while both move. Contacts
!> are queued by where that happens if the slider keeps to a speed, which is solved once, at birth:
!>
!> - under a slider that moves steadily they break there, whether thresholds grow or fall;
!> - where its velocity changes, that of twice its speed: a slower slider takes longer, and a
!>   threshold that grows is then higher, so a contact does not break before. The first of the queue
!>   are solved anew, until it is known which of them break next. These lead: where they do is
!>   foreseen from the motion of the slider, and held back by what is not known of it. A slider that
!>   comes to where a leader was to break finds it there, or a little ahead of it and foresees
!>   again. When the slider becomes faster than the speed of the queue, all are solved anew;
!> - a threshold that falls is bounded by what it will be at the end of the window, which is where
!>   and when the contact is foreseen to break, whether the slider moves or not. Few contacts do so
!>   in most cases; of many, those are near that may break before the next scan.
!>
!> A contact that does not age breaks as in the ensemble without ageing, to the bit.
module mesoslip_contacts_ageing
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_contacts_ageing_law, only: ageing_law_type, take_ageing_law
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_queue, only: contact_queue_type, new_contact_queue
   use mesoslip_contacts_record, only: row_limit, row_next, row_origin, row_renewal, &
      & row_stiffness, ahead_coordinate, behind_coordinate
   use mesoslip_contacts_set, only: contact_set_type, exchange_set, law_set
   implicit none
   private

   public :: contact_ageing_type, make_contact_ageing

   !> A probability too small to meet among the keys of a ring of buckets.
   real(wp), parameter :: rare = 1.0e-4_wp
   !> Gap to its threshold over the mean breaking stretch at which a contact breaks that ages.
   real(wp), parameter :: tiny_gap = 1.0e-12_wp
   !> How much worse the motion is foreseen than it was last time, at most.
   real(wp), parameter :: caution = 4.0_wp
   !> How much of the jolt of the slider is remembered at its next motion.
   real(wp), parameter :: memory = 0.99_wp
   !> Change of the speed of approach, relative, over which the time of a break is a short series.
   real(wp), parameter :: most_excess = 1.0e-5_wp
   !> How near behind the slider, over the mean breaking stretch, the queue is turned round: a bound
   !> that recedes is not to be met in ever smaller steps.
   real(wp), parameter :: near_behind = 1.0e-2_wp
   !> Steps of Newton's method: it converges from one side, and what is left is only foreseen worse.
   integer, parameter :: most_steps = 8, most_steps_falling = 32
   !> Speed of the queue over that of the slider, when it is set and when it comes to be too little
   !> or too much; speed over that of ageing below which contacts are old where they break.
   real(wp), parameter :: ample = 2.0_wp, scant = 1.3_wp, lavish = 8.0_wp, least_ratio = 0.05_wp
   !> Time within which a slider becomes faster, if it does at all [s]
   real(wp), parameter :: longest_time = 1.0e9_wp
   !> Number of contacts whose thresholds fall that are all near.
   integer, parameter :: few = 32

   !> Where a contact is kept: in the queue, among the leaders, among those that fall
   integer, parameter :: seat_queue = 0, seat_lead = 1, seat_falling = 2

   !> Numbers of the life of a contact: when it was born [s], its configured breaking stretch [m],
   !> and the steady motion under which it breaks where it is queued: none, one, or any
   integer, parameter :: life_length = 3
   integer, parameter :: life_birth = 1, life_limit = 2, life_motion = 3
   real(wp), parameter :: no_motion = -1.0_wp, any_motion = huge(1.0_wp)

   !> Numbers of the next life of a contact
   integer, parameter :: next_length = 2
   integer, parameter :: next_limit = 1, next_speed = 2
   !> Next lives that are solved together, of which some are not drawn
   integer, parameter :: solved_together = 64

   !> A list of contacts.
   type :: list_type
      integer :: count = 0
      !> Their numbers, the first of them, shape (number of contacts)
      integer, allocatable :: contact(:)
   end type list_type

   !> Contacts that age. The limit in a record is a bound from below on the stretch at which the
   !> contact breaks in the direction of motion.
   type, extends(contact_set_type) :: contact_ageing_type
      !> How thresholds change
      type(ageing_law_type) :: ageing
      !> Whether the slider may jump while time stands still, when the law changes
      logical :: jumps = .false.
      !> Whether it matters if the slider becomes faster than the speed of the queue
      logical, private :: may_outrun = .true.
      !> Bound on the coordinates at which contacts of the queue break on the way back [m]
      real(wp) :: behind = -huge(1.0_wp)
      !> Direction of motion for which the queue is kept, +1 or -1
      real(wp) :: direction = 1.0_wp

      !> Mean configured breaking stretch [m]
      real(wp), private :: stretch = 1.0_wp
      !> Numbers of their lives, shape (life_length, count)
      real(wp), allocatable, private :: life(:, :)
      type(contact_queue_type), private :: queue
      !> Limit of the next life of each contact if it is born at a speed in the direction of motion
      !> [m], and that speed [m/s]; shape (next_length, count). It is known ahead, or not
      real(wp), allocatable, private :: next(:, :)
      !> Contacts for which it is still to be found
      integer, private :: unsolved_count = 0, unsolved(solved_together) = 0
      !> Contacts that lead, whose thresholds fall, and those of them that are near
      type(list_type), private :: lead, falling, near
      !> Where each contact is kept, shape (count)
      integer, allocatable, private :: seat(:)
      !> Coordinates between which [m], and time until which [s], no other contacts whose thresholds
      !> fall break than those that are near
      real(wp), private :: scan_upper = huge(1.0_wp), scan_lower = -huge(1.0_wp)
      real(wp), private :: scan_time = huge(1.0_wp)
      !> Time of the last response [s], duration of the last motion, and by how much lately
      !> the acceleration was another at the end of a motion [m/s2]
      real(wp), private :: now = 0.0_wp, duration = 0.0_wp, jolt = 0.0_wp
      !> Whether the slider moves steadily in the direction of the queue, number of its motion, and
      !> the speed for which the queue is ordered [m/s]; births and solutions since that was set
      logical, private :: is_steady = .false.
      real(wp), private :: motion = 0.0_wp, speed = 0.0_wp
      integer, private :: solved = 0
      !> Whether the law stayed as it was in the last response
      logical, private :: calm = .false.
   contains
      procedure :: initialize
      procedure :: offer
      procedure :: respond
      procedure :: shift_origin
      procedure :: records
      procedure :: exchange
      procedure :: rebuild
      procedure, private, non_overridable :: see_motion, begin_steady, end_steady, keep_faster, &
         & order, order_all, is_due, refresh, break_due, break_steady, break_near, break_leaders, &
         & attach_due, enter, bear_newborn, solve_next, &
         & face, foresee, foresee_fall, lead_on, watch_near, keep_slower, &
         & scan, scan_if_due, farthest_behind, behind_of, note_late
   end type contact_ageing_type

contains

   !> Set up contacts that age from named numbers.
   subroutine make_contact_ageing(contacts, common, parameters, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> What all kinds of contacts are made of
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: the law of ageing, and whether the slider jumps
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong, or there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      type(contact_ageing_type), allocatable :: self
      real(wp) :: longest, rate
      integer :: stat

      allocate (self)
      self%parameters = common
      call take_ageing_law(self%ageing, self%parameters%law, parameters, error)
      call parameters%take("slider_jumps", self%jumps, error)
      call parameters%finish(error)
      if (allocated(error)) return
      self%stretch = common%static_force / common%stiffness
      self%speed = least_ratio * self%stretch / self%ageing%time
      self%may_outrun = self%ageing%acts() .and. .not. self%jumps
      if (self%jumps) self%speed = huge(1.0_wp)
      call self%allocate_records(0, 0, error)
      if (allocated(error)) return
      associate (count => common%count)
         allocate (self%life(life_length, count), source=0.0_wp, stat=stat)
         if (stat == 0) allocate (self%next(next_length, count), source=0.0_wp, stat=stat)
         if (stat == 0) allocate (self%seat(count), source=seat_queue, stat=stat)
         if (stat == 0) allocate (self%lead%contact(count), source=0, stat=stat)
         if (stat == 0) allocate (self%falling%contact(count), source=0, stat=stat)
         if (stat == 0) allocate (self%near%contact(count), source=0, stat=stat)
      end associate
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the ages of contacts")
         return
      end if
      ! As for contacts that do not age: keys that grow with time are farther along the ring.
      call self%ageing%follow(max(self%parameters%law%quantile(rare), 1.0_wp), 1.0_wp, &
         & self%ageing%time, longest, rate)
      longest = max(longest, self%parameters%law%quantile(rare), 1.0_wp)
      call new_contact_queue(self%queue, common%count, &
         & 1.1_wp * self%stretch * longest * (1.0_wp + common%back_force_ratio), error)
      call move_alloc(self, contacts)
   end subroutine make_contact_ageing

   !> Draw all contacts for the start of a run.
   subroutine initialize(self, state)
      !> The contacts
      class(contact_ageing_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      integer :: contact

      call self%draw(state)
      do contact = 1, self%parameters%count
         self%life(life_birth, contact) = -self%ageing%initial_age
         self%life(life_limit, contact) = self%record(row_limit, contact)
         call self%enter(contact, 0.0_wp, 0.0_wp)
      end do
      call self%rebuild(0.0_wp)
      self%behind = self%farthest_behind()
   end subroutine initialize

   !> Contact force as a law, which holds until a contact breaks or attaches.
   subroutine offer(self, pose, law, window)
      !> The contacts
      class(contact_ageing_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> The law
      type(interface_law_type), intent(out) :: law
      !> Where it holds; a contact may break at its lower end if the motion is forward
      type(window_type), intent(out) :: window

      real(wp) :: upper, lower

      law = law_set(self)
      upper = huge(1.0_wp)
      lower = self%behind
      window%end_time = self%next_attachment
      call self%see_motion(pose)
      if (self%is_steady) then
         upper = self%queue%first_key
      else
         if (self%may_outrun) call self%keep_slower(pose, window%end_time)
         call self%scan_if_due(pose)
         call self%lead_on(pose, upper)
         call self%watch_near(pose, upper, lower, window%end_time)
      end if
      if (self%direction > 0.0_wp) then
         window%upper = upper
         window%lower = lower
      else
         window%upper = -lower
         window%lower = -upper
      end if
   end subroutine offer

   !> See how the slider moves now, and to it that the queue is ordered for that.
   subroutine see_motion(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      logical :: is_steady

      is_steady = self%direction * pose%velocity > 0.0_wp .and. .not. self%jumps &
         & .and. .not. abs(pose%acceleration) > 0.0_wp
      if (self%is_steady) then
         if (is_steady .and. .not. abs(abs(pose%velocity) - self%speed) > 0.0_wp) return
         call self%end_steady(pose)
      end if
      if (is_steady) then
         call self%begin_steady(pose)
      else if (self%may_outrun) then
         call self%keep_faster(pose)
      end if
   end subroutine see_motion

   !> Order all for a steady motion, whether their thresholds grow or fall.
   subroutine begin_steady(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: place
      logical :: was_slower

      self%is_steady = .true.
      self%motion = self%motion + 1.0_wp
      was_slower = abs(pose%velocity) > self%speed
      self%speed = abs(pose%velocity)
      if (was_slower) then
         call self%order_all(pose)
      else
         do place = 1, self%lead%count
            call self%order(self%lead%contact(place), pose%displacement, pose%time)
            call put(self, self%lead%contact(place))
         end do
         do place = 1, self%falling%count
            call self%order(self%falling%contact(place), pose%displacement, pose%time)
            call put(self, self%falling%contact(place))
         end do
         self%lead%count = 0
      end if
      if (self%falling%count > 0) self%behind = self%farthest_behind()
      self%falling%count = 0
      self%near%count = 0
   end subroutine begin_steady

   !> Take those out of the queue that may break earlier when the motion is another.
   subroutine end_steady(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      self%is_steady = .false.
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         if (self%life(life_motion, contact) >= any_motion) cycle
         if (.not. self%ageing%falls(self%life(life_limit, contact), self%stretch)) cycle
         call append(self%falling, contact)
         self%seat(contact) = seat_falling
      end do
      if (self%falling%count == 0) return
      call self%queue%clear(self%direction, self%direction * pose%displacement)
      call self%scan(pose)
      call self%rebuild(pose%displacement)
   end subroutine end_steady

   !> See to it that the slider is slower than the speed of the queue, but not by far.
   subroutine keep_faster(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: least

      least = least_ratio * self%stretch / self%ageing%time
      if (scant * abs(pose%velocity) > self%speed) then
         self%speed = max(ample * abs(pose%velocity), least)
         call self%order_all(pose)
      else if (self%solved > self%parameters%count &
         & .and. lavish * max(abs(pose%velocity), least) < self%speed) then
         ! What is queued for a higher speed is so for a lower one as well.
         self%speed = max(ample * abs(pose%velocity), least)
         self%solved = 0
      end if
   end subroutine keep_faster

   !> End a window before the slider may become faster than the speed of the queue, by what is known
   !> of its motion.
   pure subroutine keep_slower(self, pose, end_time)
      class(contact_ageing_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      real(wp), intent(inout) :: end_time

      real(wp) :: room, pull, jolt, time

      room = self%speed - abs(pose%velocity)
      pull = abs(pose%acceleration)
      jolt = caution * self%jolt
      time = min(end_time - pose%time, longest_time)
      if (2.0_wp * (pull + jolt) * time <= room) return
      time = 0.5_wp * room / (pull + jolt)
      if (time > self%duration .and. self%duration > 0.0_wp) then
         ! Over a longer time than the last one, the acceleration may change by more.
         time = longest_time
         if (2.0_wp * pull * time > 0.5_wp * room) time = 0.25_wp * room / pull
         if (2.0_wp * jolt * time**2 > 0.5_wp * room * self%duration) then
            time = sqrt(0.25_wp * room * self%duration / jolt)
         end if
         time = max(time, self%duration)
      end if
      end_time = min(end_time, max(pose%time + time, nearest(pose%time, 1.0_wp)))
   end subroutine keep_slower

   !> Solve where a contact breaks at the speed of the queue, or a bound on it.
   subroutine order(self, contact, displacement, time)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Where the slider is [m], and when that is [s]
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
            limit = self%ageing%meet(life(life_limit), self%stretch, age, stretch, self%speed)
         else
            life(life_motion) = no_motion
            limit = self%ageing%meet_least(life(life_limit), self%stretch, age, stretch, &
               & self%speed)
         end if
      end associate
   end subroutine order

   !> Solve anew where contacts break, of all that are not in the list of those that fall.
   subroutine order_all(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      self%lead%count = 0
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         if (self%seat(contact) == seat_falling .and. .not. self%is_steady) cycle
         self%seat(contact) = seat_queue
         if (self%life(life_motion, contact) >= any_motion) cycle
         call self%order(contact, pose%displacement, pose%time)
      end do
      self%solved = 0
      call self%rebuild(pose%displacement)
   end subroutine order_all

   !> Put a contact into the queue.
   subroutine put(self, contact)
      type(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%seat(contact) = seat_queue
      call self%queue%insert(contact, &
         & ahead_coordinate(self%record(:, contact), self%direction))
   end subroutine put

   !> Bring those to the lead that may break next, and find until where the slider may go.
   subroutine lead_on(self, pose, upper)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Coordinate until which no contact breaks [m]
      real(wp), intent(inout) :: upper

      integer :: place, contact
      real(wp) :: key

      do place = 1, self%lead%count
         upper = min(upper, self%foresee(self%lead%contact(place), pose))
      end do
      do while (self%queue%first_key < upper)
         call self%queue%pop(self%record, contact)
         if (self%life(life_motion, contact) < any_motion) then
            call self%order(contact, pose%displacement, pose%time)
            key = ahead_coordinate(self%record(:, contact), self%direction)
            if (key > min(upper, self%queue%first_key)) then
               call self%queue%insert(contact, key)
               cycle
            end if
         end if
         call append(self%lead, contact)
         self%seat(contact) = seat_lead
         upper = min(upper, self%foresee(contact, pose))
      end do
      do place = self%lead%count, 1, -1
         contact = self%lead%contact(place)
         if (ahead_coordinate(self%record(:, contact), self%direction) > upper) then
            call put(self, contact)
            call remove(self%lead, place)
         end if
      end do
   end subroutine lead_on

   !> Where a leader is foreseen to break.
   pure function foresee(self, contact, pose) result(coordinate)
      class(contact_ageing_type), intent(in) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      !> Coordinate along the direction of motion, not beyond where it breaks [m]
      real(wp) :: coordinate

      real(wp) :: age, limit, rate, bend, here, gap, speed, pull, grown, step, excess, slope, doubt
      real(wp) :: held
      integer :: number

      coordinate = ahead_coordinate(self%record(:, contact), self%direction)
      if (self%life(life_motion, contact) >= any_motion) return
      if (self%jumps .and. .not. self%calm) return
      age = pose%time - self%life(life_birth, contact)
      call self%ageing%follow(self%life(life_limit, contact), self%stretch, age, limit, rate)
      speed = self%direction * pose%velocity
      if (.not. speed > rate) return
      here = self%direction * self%record(row_origin, contact) + limit
      gap = here - self%direction * pose%displacement
      slope = 1.0_wp / (speed - rate)
      step = gap * slope
      if (.not. step > 0.0_wp) return
      pull = 0.5_wp * self%direction * pose%acceleration
      doubt = 0.5_wp * caution * self%jolt * step
      if (step > self%duration .and. self%duration > 0.0_wp) doubt = doubt * step / self%duration
      if (.not. (doubt < 0.5_wp * speed .and. abs(pull) * step < 0.25_wp * speed)) return

      held = max(0.0_wp, 1.0_wp - doubt * slope)
      bend = 0.5_wp * self%ageing%bend(rate, age)
      excess = (pull - bend) * step * slope
      if (abs(excess) <= most_excess .and. abs(bend) * step**3 &
         & <= 0.1_wp * tiny_gap * self%stretch * self%ageing%time) then
         ! So close that the threshold grows along a parabola.
         step = step * (1.0_wp - excess * (1.0_wp - 2.0_wp * excess))
         grown = (rate + bend * step) * step
      else
         grown = 0.0_wp
         do number = 1, most_steps
            call self%ageing%follow(self%life(life_limit, contact), self%stretch, age + step, &
               & grown, rate)
            grown = grown - limit
            excess = gap + grown - step * (speed + pull * step)
            slope = speed + 2.0_wp * pull * step - rate
            if (.not. slope > 0.0_wp) return
            step = max(0.0_wp, step + excess / slope)
            if (abs(excess) <= 0.1_wp * tiny_gap * self%stretch) exit
         end do
         grown = max(grown, 0.0_wp)
      end if
      coordinate = max(coordinate, here + held * grown)
   end function foresee

   !> Find until where and when the slider may go before a contact breaks whose threshold falls.
   subroutine watch_near(self, pose, upper, lower, end_time)
      class(contact_ageing_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
      !> Coordinates between which [m], and time until which [s], no contact breaks
      real(wp), intent(inout) :: upper, lower, end_time

      integer :: place

      upper = min(upper, self%scan_upper)
      lower = max(lower, self%scan_lower)
      end_time = min(end_time, self%scan_time)
      do place = 1, self%near%count
         associate (contact => self%near%contact(place))
            if (ahead_coordinate(self%record(:, contact), self%direction) < upper &
               & .or. behind_coordinate(self%record(:, contact), self%direction) > lower) then
               call self%foresee_fall(contact, pose, upper, lower, end_time)
            end if
         end associate
      end do
   end subroutine watch_near

   !> Where and when a contact is foreseen to break whose threshold falls: before that, it cannot.
   pure subroutine foresee_fall(self, contact, pose, upper, lower, end_time)
      class(contact_ageing_type), intent(in) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      real(wp), intent(inout) :: upper, lower, end_time

      real(wp) :: age, limit, rate, stretch, speed, step, gap, longest
      integer :: number

      age = pose%time - self%life(life_birth, contact)
      stretch = pose%displacement - self%record(row_origin, contact)
      speed = max(0.0_wp, sign(1.0_wp, stretch) * pose%velocity)
      stretch = abs(stretch)
      longest = end_time - pose%time
      step = 0.0_wp
      do number = 1, most_steps_falling
         call self%ageing%follow(self%life(life_limit, contact), self%stretch, age + step, limit, &
            & rate)
         gap = limit - stretch - speed * step
         if (gap <= 0.1_wp * tiny_gap * self%stretch) exit
         if (speed - rate > 0.0_wp) then
            step = step + gap / (speed - rate)
         else
            step = longest
         end if
         if (.not. step < longest) exit
      end do
      ! A slider that jumps comes closer while time stands still: both have to have room.
      if (self%jumps .and. .not. speed > 0.0_wp) step = 0.5_wp * step
      if (step < longest) end_time = max(pose%time + step, nearest(pose%time, 1.0_wp))
      limit = max(stretch, self%ageing%threshold(self%life(life_limit, contact), self%stretch, &
         & end_time - self%life(life_birth, contact)))
      upper = min(upper, self%direction * self%record(row_origin, contact) + limit)
      lower = max(lower, self%direction * self%record(row_origin, contact) - limit)
   end subroutine foresee_fall

   !> Break all contacts that are due, then attach those that are, in the order in which they broke.
   subroutine respond(self, before, after)
      !> The contacts
      class(contact_ageing_type), intent(inout) :: self
      !> Where the slider was, and where it is
      type(pose_type), intent(in) :: before, after

      real(wp) :: breaks

      self%now = after%time
      self%duration = after%time - before%time
      self%jolt = max(abs(after%acceleration - before%acceleration), memory * self%jolt)
      breaks = self%breaks
      self%calm = self%next_attachment > after%time
      if (self%is_steady) then
         if (abs(after%velocity - before%velocity) + abs(after%acceleration) > 0.0_wp) then
            call self%end_steady(after)
         end if
      end if
      call self%break_due(after)
      if (self%breaks > breaks) self%calm = .false.
      call self%attach_due(after)
      self%detached_count = real(self%waiting, wp)
   end subroutine respond

   !> Whether a contact breaks, now that its bound is that of now.
   pure function is_due(self, contact, pose)
      class(contact_ageing_type), intent(in) :: self
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

   !> Break all contacts that are due.
   subroutine break_due(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks, margin
      integer :: contact

      if (self%direction * pose%displacement <= self%behind) then
         ! The bound may be that of a contact which has broken since.
         self%behind = self%farthest_behind()
         margin = 0.0_wp
         if (self%ageing%acts()) margin = near_behind * self%stretch
         if (self%direction * pose%displacement <= self%behind + margin) call self%face(pose)
      end if
      breaks = self%breaks
      if (self%is_steady) then
         call self%break_steady(pose)
      else
         call self%break_near(pose)
         call self%break_leaders(pose)
         do while (self%queue%first_key <= self%direction * pose%displacement)
            call self%queue%pop(self%record, contact)
            call self%refresh(contact, pose%time)
            if (self%is_due(contact, pose)) then
               call self%note_late(contact, pose)
               call self%let_go(contact, pose%displacement, pose%time)
            else
               call append(self%lead, contact)
               self%seat(contact) = seat_lead
            end if
         end do
      end if
      if (self%breaks > breaks) self%track%generation = self%track%generation + 1
   end subroutine break_due

   !> Break the contacts that are due under a steady motion; others were queued for a faster one.
   subroutine break_steady(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do while (self%queue%first_key <= self%direction * pose%displacement)
         call self%queue%pop(self%record, contact)
         if (self%life(life_motion, contact) < self%motion) then
            call self%order(contact, pose%displacement, pose%time)
            if (ahead_coordinate(self%record(:, contact), self%direction) &
               & > self%direction * pose%displacement) then
               call put(self, contact)
               cycle
            end if
            call self%note_late(contact, pose)
         end if
         call self%let_go(contact, pose%displacement, pose%time)
      end do
   end subroutine break_steady

   !> Remember it as an error of the force if a contact breaks later than it should have.
   pure subroutine note_late(self, contact, pose)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: late

      late = self%direction * pose%displacement &
         & - ahead_coordinate(self%record(:, contact), self%direction)
      if (late > tiny_gap * self%stretch .and. self%life(life_motion, contact) < any_motion) then
         self%error_estimate = max(self%error_estimate, late * self%parameters%stiffness)
      end if
   end subroutine note_late

   !> Break the leaders that are due, in the order of their places.
   subroutine break_leaders(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: place, first, contact
      real(wp) :: key, least

      do
         first = 0
         least = self%direction * pose%displacement + 2.0_wp * tiny_gap * self%stretch
         do place = 1, self%lead%count
            contact = self%lead%contact(place)
            key = ahead_coordinate(self%record(:, contact), self%direction)
            if (.not. key < least) cycle
            call self%refresh(contact, pose%time)
            key = ahead_coordinate(self%record(:, contact), self%direction)
            if (key < least .and. self%is_due(contact, pose)) then
               least = key
               first = place
            end if
         end do
         if (first == 0) return
         contact = self%lead%contact(first)
         call self%note_late(contact, pose)
         call remove(self%lead, first)
         self%seat(contact) = seat_queue
         call self%let_go(contact, pose%displacement, pose%time)
      end do
   end subroutine break_leaders

   !> Break the contacts that are due of those whose thresholds fall, in either direction.
   subroutine break_near(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: stretch, limit
      integer :: place, contact

      do place = self%near%count, 1, -1
         contact = self%near%contact(place)
         stretch = abs(pose%displacement - self%record(row_origin, contact)) &
            & + tiny_gap * self%stretch
         if (self%record(row_limit, contact) > stretch) cycle
         limit = self%ageing%threshold(self%life(life_limit, contact), self%stretch, &
            & pose%time - self%life(life_birth, contact))
         if (limit > stretch) cycle
         call self%let_go(contact, pose%displacement, pose%time)
         call remove(self%near, place)
         call remove(self%falling, position(self%falling, contact))
         self%seat(contact) = seat_queue
      end do
   end subroutine break_near

   !> Attach all contacts that are due, in the order in which they broke.
   subroutine attach_due(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact
      real(wp) :: back_force

      back_force = pose%direction * self%parameters%back_force_ratio * self%parameters%static_force
      do while (self%next_attachment <= pose%time)
         call self%take_hold(pose%displacement, back_force, 0.0_wp, contact)
         self%life(life_birth, contact) = pose%time
         self%life(life_limit, contact) = self%record(row_limit, contact)
         if (self%is_steady) then
            call self%bear_newborn(contact)
         else
            self%next(next_speed, contact) = 0.0_wp
            call self%enter(contact, pose%displacement, pose%time)
         end if
         if (self%seat(contact) == seat_queue) then
            call put(self, contact)
            self%behind = max(self%behind, self%behind_of(contact, pose%time))
         end if
      end do
   end subroutine attach_due

   !> Queue a contact that is born in a steady motion.
   subroutine bear_newborn(self, contact)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact

      real(wp) :: stretch, solved(next_length)

      stretch = self%parameters%back_force_ratio * self%stretch
      solved = self%next(:, contact)
      self%next(next_speed, contact) = 0.0_wp
      associate (life => self%life(:, contact))
         if (self%ageing%is_constant(life(life_limit), self%stretch)) then
            self%seat(contact) = seat_queue
            life(life_motion) = any_motion
            return
         end if
         self%seat(contact) = seat_queue
         life(life_motion) = self%motion
         if (abs(solved(next_speed) - self%speed) > 0.0_wp) then
            self%record(row_limit, contact) = self%ageing%meet(life(life_limit), self%stretch, &
               & 0.0_wp, stretch, self%speed)
         else
            self%record(row_limit, contact) = solved(next_limit)
         end if
      end associate
      self%solved = self%solved + 1
      self%unsolved_count = self%unsolved_count + 1
      self%unsolved(self%unsolved_count) = contact
      if (self%unsolved_count == solved_together) call self%solve_next(stretch)
   end subroutine bear_newborn

   !> Solve ahead where contacts will break in their next lives, if their thresholds are drawn.
   subroutine solve_next(self, stretch)
      class(contact_ageing_type), intent(inout) :: self
      !> Stretch at birth [m]
      real(wp), intent(in) :: stretch

      real(wp), dimension(solved_together) :: configured, limit
      integer :: contact(solved_together), place, number, left

      number = 0
      left = 0
      do place = 1, self%unsolved_count
         associate (one => self%unsolved(place))
            if (self%record(row_next, one) > 0.0_wp) then
               number = number + 1
               contact(number) = one
               configured(number) = self%record(row_next, one) * self%parameters%static_force &
                  & / self%parameters%stiffness
            else
               left = left + 1
               self%unsolved(left) = one
            end if
         end associate
      end do
      self%unsolved_count = left
      call self%ageing%meet_newborn(configured(:number), self%stretch, stretch, self%speed, &
         & limit(:number))
      do place = 1, number
         self%next(:, contact(place)) = [limit(place), self%speed]
      end do
   end subroutine solve_next

   !> Find the place of a contact that is born or drawn.
   subroutine enter(self, contact, displacement, time)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Where the slider is [m], and when that is [s]
      real(wp), intent(in) :: displacement, time

      self%seat(contact) = seat_queue
      if (self%is_steady) then
         call self%order(contact, displacement, time)
      else if (self%ageing%falls(self%life(life_limit, contact), self%stretch) &
         & .and. .not. self%ageing%is_old(time - self%life(life_birth, contact))) then
         self%seat(contact) = seat_falling
         call append(self%falling, contact)
         call append(self%near, contact)
         call self%refresh(contact, self%scan_time)
         self%life(life_motion, contact) = no_motion
      else
         call self%order(contact, displacement, time)
      end if
   end subroutine enter

   !> Make the bound of a contact's breaking stretch that of a time, or of the end of its scan.
   subroutine refresh(self, contact, time)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: time

      self%record(row_limit, contact) = self%ageing%threshold(self%life(life_limit, contact), &
         & self%stretch, time - self%life(life_birth, contact))
   end subroutine refresh

   !> Turn round: keep the queue for the other direction of motion, with the thresholds of now.
   subroutine face(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      if (self%is_steady) call self%end_steady(pose)
      self%direction = -self%direction
      if (self%falling%count > 0) call self%scan(pose)
      call self%order_all(pose)
      self%behind = self%farthest_behind()
   end subroutine face

   !> Scan the contacts whose thresholds fall if that is due; those that are old do so no more.
   subroutine scan_if_due(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: place

      if (self%falling%count == 0) return
      do place = self%near%count, 1, -1
         call retire(self, self%near%contact(place), pose%time)
      end do
      if (pose%time >= self%scan_time &
         & .or. self%direction * pose%displacement >= self%scan_upper &
         & .or. self%direction * pose%displacement <= self%scan_lower &
         & .or. self%near%count > max(few, self%falling%count / 2)) call self%scan(pose)
   end subroutine scan_if_due

   !> Put a contact whose threshold has fallen into the queue.
   subroutine retire(self, contact, time)
      class(contact_ageing_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: time

      integer :: place

      if (.not. self%ageing%is_old(time - self%life(life_birth, contact))) return
      place = position(self%near, contact)
      if (place > 0) call remove(self%near, place)
      call remove(self%falling, position(self%falling, contact))
      self%record(row_limit, contact) = self%life(life_limit, contact)
      self%life(life_motion, contact) = any_motion
      call put(self, contact)
      self%behind = max(self%behind, self%behind_of(contact, time))
   end subroutine retire

   !> Find the contacts near breaking of those whose thresholds fall, and for how long they are.
   subroutine scan(self, pose)
      class(contact_ageing_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: place, contact
      real(wp) :: fastest, limit, rate, reach

      do place = self%falling%count, 1, -1
         call retire(self, self%falling%contact(place), pose%time)
      end do
      self%scan_upper = huge(1.0_wp)
      self%scan_lower = -huge(1.0_wp)
      self%scan_time = huge(1.0_wp)
      if (self%falling%count > few) then
         fastest = 0.0_wp
         do place = 1, self%falling%count
            contact = self%falling%contact(place)
            call self%ageing%follow(self%life(life_limit, contact), self%stretch, &
               & pose%time - self%life(life_birth, contact), limit, rate)
            fastest = max(fastest, -rate)
         end do
         ! About as many scans while the slider moves by a stretch as contacts that are near.
         reach = 0.5_wp * self%stretch / sqrt(real(self%falling%count, wp))
         self%scan_upper = self%direction * pose%displacement + reach
         self%scan_lower = self%direction * pose%displacement - reach
         if (fastest > 0.0_wp) then
            self%scan_time = max(pose%time + reach / fastest, nearest(pose%time, 1.0_wp))
         end if
      end if
      self%near%count = 0
      do place = 1, self%falling%count
         contact = self%falling%contact(place)
         call self%refresh(contact, self%scan_time)
         if (ahead_coordinate(self%record(:, contact), self%direction) < self%scan_upper .or. &
            & behind_coordinate(self%record(:, contact), self%direction) > self%scan_lower) then
            call append(self%near, contact)
         end if
      end do
   end subroutine scan

   !> Move the origin of displacements.
   subroutine shift_origin(self, shift, displacement)
      !> The contacts
      class(contact_ageing_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift
      !> Displacement of the slider from the new origin [m]
      real(wp), intent(in) :: displacement

      call self%shift_records(shift)
      if (self%scan_upper < huge(1.0_wp)) then
         self%scan_upper = self%scan_upper - self%direction * shift
         self%scan_lower = self%scan_lower - self%direction * shift
      end if
      call self%rebuild(displacement)
      self%behind = self%farthest_behind()
   end subroutine shift_origin

   !> Order the queue anew, from the records.
   subroutine rebuild(self, displacement)
      !> The contacts
      class(contact_ageing_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      integer :: contact

      call self%queue%clear(self%direction, self%direction * displacement)
      do contact = 1, self%parameters%count
         if (self%seat(contact) /= seat_queue) cycle
         if (self%record(row_stiffness, contact) > 0.0_wp) then
            call self%queue%insert(contact, &
               & ahead_coordinate(self%record(:, contact), self%direction))
         end if
      end do
   end subroutine rebuild

   !> Greatest coordinate at which a contact of the queue may break on the way back.
   pure function farthest_behind(self) result(coordinate)
      class(contact_ageing_type), intent(in) :: self
      real(wp) :: coordinate

      integer :: contact

      coordinate = -huge(1.0_wp)
      do contact = 1, self%parameters%count
         if (self%seat(contact) == seat_falling) cycle
         if (self%record(row_stiffness, contact) > 0.0_wp) then
            coordinate = max(coordinate, self%behind_of(contact, self%now))
         end if
      end do
   end function farthest_behind

   !> Coordinate before which a contact does not break on the way back, from now on.
   pure function behind_of(self, contact, time) result(coordinate)
      class(contact_ageing_type), intent(in) :: self
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
   end function behind_of

   !> What each contact is.
   pure subroutine records(self, values)
      !> The contacts
      class(contact_ageing_type), intent(in) :: self
      !> Origin [m], stiffness [N/m], 0 while it is detached, breaking stretch of now [m], number of
      !> renewals of each contact, shape (contact_record_length, count)
      real(wp), intent(out) :: values(:, :)

      integer :: contact

      do contact = 1, self%parameters%count
         values(:, contact) = self%record([row_origin, row_stiffness, row_limit, row_renewal], &
            & contact)
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         values(3, contact) = self%ageing%threshold(self%life(life_limit, contact), self%stretch, &
            & self%now - self%life(life_birth, contact))
      end do
   end subroutine records

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The contacts
      class(contact_ageing_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%section("contacts that age")
      call exchange_set(self, archive)
      call archive%exchange("behind", self%behind)
      call archive%exchange("direction", self%direction)
      call archive%exchange("life", self%life)
      call archive%exchange("seat", self%seat)
      call archive%exchange("lead", self%lead%contact)
      call archive%exchange("leaders", self%lead%count)
      call archive%exchange("falling", self%falling%contact)
      call archive%exchange("falling_count", self%falling%count)
      call archive%exchange("near", self%near%contact)
      call archive%exchange("near_count", self%near%count)
      call archive%exchange("scan_upper", self%scan_upper)
      call archive%exchange("scan_lower", self%scan_lower)
      call archive%exchange("scan_time", self%scan_time)
      call archive%exchange("now", self%now)
      call archive%exchange("duration", self%duration)
      call archive%exchange("jolt", self%jolt)
      call archive%exchange("calm", self%calm)
      call archive%exchange("is_steady", self%is_steady)
      call archive%exchange("motion", self%motion)
      call archive%exchange("speed", self%speed)
      call archive%exchange("solved", self%solved)
   end subroutine exchange

   !> Add a contact to a list.
   pure subroutine append(list, contact)
      type(list_type), intent(inout) :: list
      integer, intent(in) :: contact

      list%count = list%count + 1
      list%contact(list%count) = contact
   end subroutine append

   !> Remove a contact from a list; the last one takes its place.
   pure subroutine remove(list, place)
      type(list_type), intent(inout) :: list
      integer, intent(in) :: place

      list%contact(place) = list%contact(list%count)
      list%count = list%count - 1
   end subroutine remove

   !> Place of a contact in a list; 0 if it is not in it.
   pure function position(list, contact) result(place)
      type(list_type), intent(in) :: list
      integer, intent(in) :: contact
      integer :: place

      do place = list%count, 1, -1
         if (list%contact(place) == contact) return
      end do
      place = 0
   end function position

end module mesoslip_contacts_ageing
