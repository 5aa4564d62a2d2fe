!> Contacts that break by thermal activation, whose thresholds change with their age.
!>
!> The rate of breaking then depends on the age of a contact, so that contacts cannot share a clock.
!> A contact has the key of a lower bound on its threshold, for which the rate is too high. Where it
!> reaches that key, it breaks with a probability, the ratio of its rate to that of the bound;
!> otherwise it draws another deviate (P. Lewis and G. Shedler, Naval Research Logistics Quarterly
!> 26 (1979) 403). This is exact and has no time step. The bound of a growing threshold is its last
!> value; that of a falling one is its value at a later time, when the bound is renewed.
!>
!> A contact breaks where the slider meets its threshold, too. The first of those that grow, the
!> leaders, are extrapolated from the motion of the slider, as of contacts without temperature
!> (mesoslip_motion_prediction); the others are ordered by a bound, their thresholds when
!> they were looked at last.
!>
!> In a uniform prescribed motion all this is done at birth, as the time at which a contact has a
!> stretch is known. When the motion changes, a contact that is left draws another deviate: its
!> hazard from then on does not depend on the one before.
module mesoslip_contacts_thermal_ageing
   use mesoslip_contacts_ageing_law, only: ageing_law_type, take_ageing_law
   use mesoslip_motion_prediction, only: prediction_type
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_break_tree, only: break_tree_type, new_break_tree
   use mesoslip_contacts_individual_sorting, only: before
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, row_stiffness
   use mesoslip_contacts_thermal_contacts, only: thermal_contacts_type, initialize_thermal, &
      & offer_thermal, respond_thermal
   use mesoslip_contacts_thermal_keys, only: exchange_thermal, life_key, life_left, &
      & rebuild_thermal
   use mesoslip_contacts_thermal_steady, only: grown, set_up_steady
   use mesoslip_hazard, only: never
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_random, only: uniform_pair
   use mesoslip_schedule, only: schedule_type
   implicit none
   private

   public :: thermal_ageing_contacts_type, make_thermal_ageing_contacts

   !> Gap to its threshold over the mean breaking stretch at which a contact breaks
   real(wp), parameter :: tiny_gap = 1.0e-12_wp
   !> Fall of a threshold until its bound is renewed: over f_T, and over the gap to the force
   real(wp), parameter :: max_drop = 0.5_wp, max_gap_part = 0.9_wp
   !> Growth of a threshold over f_T until a contact is expected to break, above which its bound is
   !> renewed before; in a uniform motion the distance from there to that break over f_T/k
   real(wp), parameter :: max_growth = 0.3_wp, early = 2.0_wp
   !> Maximum number of leaders, and of those whose breaks are extrapolated at once
   integer, parameter :: max_leaders = 64, max_extrapolated = 16
   !> Maximum number of contacts whose forces may change their sign in one motion
   integer, parameter :: max_turning = 64
   !> Number of deviates of a life, after which they repeat
   integer(i8), parameter :: max_attempts = 65535_i8

   !> Numbers of the age of a contact: time of attaching [s], configured breaking stretch [m], time
   !> at which its bound is renewed [s], deviates drawn in its life, and its threshold, or a bound,
   !> when it was looked at last [m]
   integer, parameter :: age_length = 5
   integer, parameter :: age_birth = 1, age_limit = 2, age_renewal = 3, age_attempts = 4, &
      & age_bound = 5

   !> Thermally activated contacts that age. The limit in a record is a lower bound on the breaking
   !> stretch, by which the hazard is bounded.
   type, extends(thermal_contacts_type) :: thermal_ageing_contacts_type
      !> How thresholds change
      type(ageing_law_type), private :: ageing
      !> Numbers of the ages, shape (age_length, count)
      real(wp), allocatable, private :: age(:, :)
      !> Contacts by the times at which their bounds are renewed
      type(break_tree_type), private :: order_renewal
      !> Whether contacts are those of the start
      logical, private :: is_start = .false.
      !> Motion of the slider as predicted under the law that was offered last
      type(prediction_type), private :: prediction
      !> The leaders, and their bounds as coordinates [m], in decreasing order; none of them is in
      !> the order ahead
      integer, private :: leaders = 0, leader(max_leaders) = 0
      real(wp), private :: leader_key(max_leaders) = 0.0_wp
      !> Contacts whose forces may change their sign in the present motion, and the coordinates at
      !> which they do [m]; meanwhile they are missing in the order ahead
      integer, private :: turns = 0, turning(max_turning) = 0
      real(wp), private :: turn_key(max_turning) = 0.0_wp
   contains
      procedure :: initialize, offer, respond, plan, leave, begin_life, accepts_break, &
         & update_bounds, rebuild, records, exchange, limit_at_birth, shift_order
      procedure :: find_ahead, bound, gather_ahead
      procedure :: start_steadily, end_steadily, solve_newborn, begin_solved
      procedure, non_overridable, private :: set_bound, threshold, mean_of, draw_attempt, &
         & solve_break, falling_bound, is_extrapolated, &
         & extrapolate, add_leader, drop_leader, break_leaders, put_turns_back
   end type thermal_ageing_contacts_type

contains

   !> Set up contacts from named numbers.
   subroutine make_thermal_ageing_contacts(contacts, common, parameters, error)
      class(contacts_type), allocatable, intent(out) :: contacts
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: the law of ageing, columns and rows, rate and force of activation
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(thermal_ageing_contacts_type), allocatable :: self
      integer :: stat

      allocate (self)
      self%parameters = common
      call take_ageing_law(self%ageing, self%parameters%law, parameters, error)
      if (allocated(error)) return
      call set_up_steady(self, parameters, error)
      if (allocated(error)) return
      allocate (self%age(age_length, common%count), source=0.0_wp, stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the ages of contacts")
         return
      end if
      call self%births%record_factors(self%parameters, error)
      if (.not. allocated(error)) call new_break_tree(self%order_renewal, common%count, error)
      call move_alloc(self, contacts)
   end subroutine make_thermal_ageing_contacts

   subroutine initialize(self, state)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: state

      self%is_start = .true.
      call initialize_thermal(self, state)
      self%is_start = .false.
   end subroutine initialize

   !> The law holds until a contact breaks or attaches, its force changes its sign, or a bound is
   !> renewed.
   subroutine offer(self, pose, law, window)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      call offer_thermal(self, pose, law, window)
      window%end_time = min(window%end_time, self%order_renewal%first())
   end subroutine offer

   subroutine respond(self, before, after)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      if (self%is_steady) then
         self%prediction%jerk_error = 0.0_wp
      else
         call self%prediction%compare(before, after)
      end if
      call self%put_turns_back()
      call respond_thermal(self, before, after)
   end subroutine respond

   !> Put contacts whose forces might change their sign in the motion back into the order ahead.
   subroutine put_turns_back(self)
      class(thermal_ageing_contacts_type), intent(inout) :: self

      integer :: turn

      do turn = 1, self%turns
         call self%order(self%ahead)%put(self%turning(turn), self%turn_key(turn))
      end do
      self%turns = 0
   end subroutine put_turns_back

   !> The lowest of the leaders' breaks by extrapolation and the bounds of the others. A contact
   !> whose bound comes before becomes a leader, with its present threshold as its bound. A force
   !> may change its sign before that where the hazard until then is negligible. Where the slider
   !> has no inertia, and may jump, there are bounds only.
   subroutine find_ahead(self, pose, law, ahead, end_time)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(in) :: law
      real(wp), intent(out) :: ahead
      real(wp), intent(inout) :: end_time

      real(wp) :: first, latest, key(max_extrapolated)
      integer :: number, contact(max_extrapolated)
      logical :: leads, lets_turn_later

      ! A law may be offered again without a response.
      call self%put_turns_back()
      call self%prediction%predict(pose, law)
      if (.not. pose%inverse_mass > 0.0_wp) then
         call self%order(self%ahead)%first(ahead)
         return
      end if
      latest = self%prediction%reach(pose, self%direction, min(self%detached%next_due, &
         & self%sites%next_time, self%order_renewal%first()))
      lets_turn_later = self%hazard%lets_turn_later(pose%velocity)
      ahead = huge(1.0_wp)
      number = 0
      do
         call self%order(self%ahead)%first(first)
         leads = .false.
         if (self%leaders > 0) leads = self%leader_key(self%leaders) <= first
         if (leads) first = self%leader_key(self%leaders)
         if (.not. first < min(ahead, latest) .or. number == max_extrapolated) exit
         associate (one => contact(number + 1))
            if (leads) then
               one = self%leader(self%leaders)
               self%leaders = self%leaders - 1
            else
               call self%order(self%ahead)%due(first, one)
               if (lets_turn_later .and. self%turns < max_turning &
                  & .and. self%may_turn_later(one)) then
                  call self%order(self%ahead)%remove(one)
                  self%turns = self%turns + 1
                  self%turning(self%turns) = one
                  self%turn_key(self%turns) = first
                  ahead = min(ahead, first + self%hazard%turn_distance)
                  cycle
               end if
               if (.not. self%is_extrapolated(one)) exit
            end if
            number = number + 1
            call self%extrapolate(one, pose, key(number), ahead)
         end associate
      end do
      ahead = min(ahead, first)
      if (self%turns > 0) end_time = min(end_time, pose%time + self%hazard%turn_duration)
      do number = number, 1, -1
         call self%add_leader(contact(number), key(number))
      end do
   end subroutine find_ahead

   !> Whether the break of a contact at its threshold can be extrapolated: its force is along the
   !> motion, and its threshold does not fall.
   pure function is_extrapolated(self, contact)
      class(thermal_ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      logical :: is_extrapolated

      is_extrapolated = .not. (self%turns_ahead(contact) &
         & .or. self%ageing%falls(self%age(age_limit, contact), self%mean_of(contact)))
   end function is_extrapolated

   !> Extrapolate the break of a contact from its present threshold. The bound on its hazard is
   !> renewed where it is far below that.
   subroutine extrapolate(self, contact, pose, key, ahead)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      !> Coordinate of its threshold [m]
      real(wp), intent(out) :: key
      !> Coordinate before which no contact breaks [m]
      real(wp), intent(inout) :: ahead

      real(wp) :: age, here, rate, growth
      logical :: is_known

      age = pose%time - self%age(age_birth, contact)
      call self%ageing%evaluate(self%age(age_limit, contact), self%mean_of(contact), age, here, &
         & rate)
      if (self%hazard%slope * (here - self%record(row_limit, contact)) > max_growth) then
         call self%raise_limit(contact, here)
      end if
      call self%order(self%ahead)%remove(contact)
      self%age(age_bound, contact) = here
      key = self%direction * self%record(row_origin, contact) + here
      call self%prediction%extrapolate(self%ageing, rate, age, key - self%direction &
         & * pose%displacement, self%direction * pose%velocity, self%direction, &
         & tiny_gap * self%stretch, growth, is_known)
      if (is_known) then
         ahead = min(ahead, key + growth)
      else
         ahead = min(ahead, key)
      end if
   end subroutine extrapolate

   !> Add a leader with its bound as a coordinate [m]. Of too many the last is put back.
   subroutine add_leader(self, contact, key)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: key

      integer :: place

      if (self%leaders == max_leaders) then
         if (.not. key < self%leader_key(1)) then
            call self%order(self%ahead)%put(contact, key)
            return
         end if
         call self%order(self%ahead)%put(self%leader(1), self%leader_key(1))
         self%leader(:max_leaders - 1) = self%leader(2:)
         self%leader_key(:max_leaders - 1) = self%leader_key(2:)
         self%leaders = max_leaders - 1
      end if
      self%leaders = self%leaders + 1
      do place = self%leaders, 2, -1
         if (before(key, contact, self%leader_key(place - 1), self%leader(place - 1))) exit
         self%leader(place) = self%leader(place - 1)
         self%leader_key(place) = self%leader_key(place - 1)
      end do
      self%leader(place) = contact
      self%leader_key(place) = key
   end subroutine add_leader

   !> A contact is no leader any more, if it is one.
   subroutine drop_leader(self, contact)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: place

      do place = self%leaders, 1, -1
         if (self%leader(place) == contact) exit
      end do
      if (place == 0) return
      self%leader(place:self%leaders - 1) = self%leader(place + 1:self%leaders)
      self%leader_key(place:self%leaders - 1) = self%leader_key(place + 1:self%leaders)
      self%leaders = self%leaders - 1
   end subroutine drop_leader

   !> Break the leaders whose thresholds the slider has met, in the order of their bounds.
   subroutine break_leaders(self, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: met, late
      integer :: place, contact

      met = self%direction * pose%displacement + tiny_gap * self%stretch
      do place = self%leaders, 1, -1
         if (.not. self%leader_key(place) <= met) exit
         contact = self%leader(place)
         late = self%direction * (pose%displacement - self%record(row_origin, contact)) &
            & - self%threshold(contact, pose%time)
         if (late < -tiny_gap * self%stretch) cycle
         if (late > tiny_gap * self%stretch) self%error_estimate = max(self%error_estimate, &
            & late * self%parameters%stiffness)
         call self%drop_leader(contact)
         call self%order_renewal%remove(contact)
         call self%break_contact(contact, pose)
      end do
   end subroutine break_leaders

   pure function bound(self, contact)
      class(thermal_ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: bound

      bound = self%age(age_bound, contact)
   end function bound

   subroutine gather_ahead(self)
      class(thermal_ageing_contacts_type), intent(inout) :: self

      integer :: place

      do place = 1, self%leaders
         call self%order(self%ahead)%put(self%leader(place), self%leader_key(place))
      end do
      self%leaders = 0
   end subroutine gather_ahead

   !> Only a uniform motion has schedules, as bounds change with the time.
   subroutine plan(self, pose, limit, schedule)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      schedule%is_over = .true.
      call self%follow_motion(pose)
      if (self%is_steady) call self%plan_steadily(pose, limit, schedule)
   end subroutine plan

   subroutine leave(self, contact)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%drop_leader(contact)
      call self%order_renewal%remove(contact)
      call self%thermal_contacts_type%leave(contact)
   end subroutine leave

   subroutine begin_life(self, contact, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      self%age(:, contact) = [pose%time, self%record(row_limit, contact), never, 1.0_wp, 0.0_wp]
      if (self%is_start) self%age(age_birth, contact) = -self%ageing%initial_age
      call self%set_bound(contact, pose)
   end subroutine begin_life

   !> Threshold of a contact at a time, as a stretch [m].
   pure function threshold(self, contact, time)
      class(thermal_ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: time
      real(wp) :: threshold

      threshold = self%ageing%threshold(self%age(age_limit, contact), self%mean_of(contact), &
         & time - self%age(age_birth, contact))
   end function threshold

   !> Mean configured breaking stretch at the place on the track where a contact attached [m].
   pure function mean_of(self, contact) result(mean)
      class(thermal_ageing_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: mean

      mean = self%stretch
      if (allocated(self%births%factor)) mean = mean * self%births%factor(contact)
   end function mean_of

   !> A threshold that falls must not detach the contact later.
   pure function limit_at_birth(self, limit) result(newborn)
      class(thermal_ageing_contacts_type), intent(in) :: self
      real(wp), intent(in) :: limit
      real(wp) :: newborn

      newborn = self%ageing%newborn_threshold(limit, self%stretch)
   end function limit_at_birth

   !> Set the lower bound on the threshold of a contact, and the time of its renewal.
   subroutine set_bound(self, contact, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: here, gap, deficit

      here = self%threshold(contact, pose%time)
      self%record(row_limit, contact) = here
      self%age(age_renewal, contact) = never
      associate (age => self%age(:, contact))
         if (self%ageing%falls(age(age_limit), self%mean_of(contact)) &
            & .and. here > age(age_limit)) then
            gap = here - abs(pose%displacement - self%record(row_origin, contact))
            gap = min(max_drop / self%hazard%slope, &
               & max_gap_part * max(gap, tiny_gap * self%stretch))
            if (here - gap > age(age_limit)) then
               deficit = self%ageing%deficit(age(age_limit), self%mean_of(contact))
               age(age_renewal) = max(nearest(pose%time, huge(1.0_wp)), age(age_birth) &
                  & - self%ageing%time * log((here - gap - age(age_limit)) / (-deficit)))
               self%record(row_limit, contact) = min(here - gap, &
                  & self%threshold(contact, age(age_renewal)))
            else
               self%record(row_limit, contact) = age(age_limit)
            end if
         end if
      end associate
      self%age(age_bound, contact) = self%record(row_limit, contact)
      call self%order_renewal%set(contact, self%age(age_renewal, contact))
   end subroutine set_bound

   function accepts_break(self, contact, pose, by_clock)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      logical, intent(in) :: by_clock
      logical :: accepts_break

      real(wp) :: here, uniform(2)

      here = self%threshold(contact, pose%time)
      accepts_break = here - abs(pose%displacement - self%record(row_origin, contact)) &
         & <= tiny_gap * self%stretch
      if (by_clock .and. .not. accepts_break) then
         call self%draw_attempt(contact, 0, self%age(age_attempts, contact), uniform)
         accepts_break = uniform(2) &
            & <= exp(-self%hazard%slope * (here - self%record(row_limit, contact)))
      end if
      call self%drop_leader(contact)
      if (accepts_break) then
         call self%order_renewal%remove(contact)
         return
      end if
      if (by_clock) then
         self%age(age_attempts, contact) = next_attempt(self%age(age_attempts, contact))
         call self%draw_attempt(contact, 0, self%age(age_attempts, contact), uniform)
         self%life(life_left, contact) = -log(uniform(1))
      else
         call self%update_deviate(contact)
      end if
      call self%take_out(contact)
      call self%set_bound(contact, pose)
      call self%put(contact)
   end function accepts_break

   !> Number of the attempt after one.
   pure function next_attempt(attempt) result(next)
      real(wp), intent(in) :: attempt
      real(wp) :: next

      next = real(mod(int(attempt, i8), max_attempts) + 1_i8, wp)
   end function next_attempt

   !> Draw uniform numbers of an attempt, for its deviate and for its acceptance.
   pure subroutine draw_attempt(self, contact, later, attempt, uniform)
      class(thermal_ageing_contacts_type), intent(in) :: self
      !> Number of the contact, and renewals until the life
      integer, intent(in) :: contact, later
      real(wp), intent(in) :: attempt
      real(wp), intent(out) :: uniform(2)

      call uniform_pair(self%parameters%seed, self%parameters%realization, int(contact - 1, i8), &
         & int(self%record(row_renewal, contact), i8) + later, int(attempt, i8), uniform)
   end subroutine draw_attempt

   !> Solve where a contact breaks in the uniform motion: its stretch along the motion then [m].
   subroutine solve_break(self, contact, later, configured, age, stretch, left, attempts, breaking)
      class(thermal_ageing_contacts_type), intent(in) :: self
      !> Number of the contact, and renewals until the life
      integer, intent(in) :: contact, later
      !> Configured breaking stretch [m], age [s], stretch along the motion [m], remaining deviate
      real(wp), intent(in) :: configured, age, stretch, left
      !> Deviates drawn in its life
      real(wp), intent(inout) :: attempts
      real(wp), intent(out) :: breaking

      real(wp) :: mean, per_time, now, here, x, rest, bound, until, key, next, later_age, then
      real(wp) :: uniform(2)
      logical :: falls, is_renewed

      mean = self%mean_of(contact)
      falls = self%ageing%falls(configured, mean)
      associate (slope => self%hazard%slope, speed => abs(self%velocity))
         per_time = self%hazard%rate / (slope * speed)
         now = age
         x = stretch
         rest = left
         here = self%ageing%threshold(configured, mean, now)
         do
            bound = here
            until = never
            if (falls) call self%falling_bound(configured, mean, here - abs(x), now, bound, until)
            key = self%breaking_stretch(bound, x, rest)
            next = min(key, bound)
            if (until < never) next = min(next, x + speed * (until - now))
            later_age = now + (next - x) / speed
            then = self%ageing%threshold(configured, mean, later_age)
            is_renewed = x >= 0.0_wp .and. slope * (then - here) > max_growth &
               & .and. slope * (next - x) > 2.0_wp * early
            if (is_renewed) then
               next = next - early / slope
               later_age = now + (next - x) / speed
               then = self%ageing%threshold(configured, mean, later_age)
            else
               if (then - abs(next) <= tiny_gap * self%stretch) exit
               if (.not. next < key) then
                  call self%draw_attempt(contact, later, attempts, uniform)
                  if (uniform(2) <= exp(-slope * (then - bound))) exit
                  attempts = next_attempt(attempts)
                  call self%draw_attempt(contact, later, attempts, uniform)
               end if
            end if
            if (next < key) then
               rest = max(0.0_wp, rest - per_time &
                  & * (grown(slope, bound, next) - grown(slope, bound, x)))
            else
               rest = -log(uniform(1))
            end if
            x = next
            now = later_age
            here = then
         end do
      end associate
      breaking = next
   end subroutine solve_break

   !> Lower bound on a falling threshold, and the age until which it holds.
   pure subroutine falling_bound(self, configured, mean, gap, age, bound, until)
      class(thermal_ageing_contacts_type), intent(in) :: self
      !> Configured breaking stretch, mean one, gap from the force to the threshold [m]; age [s]
      real(wp), intent(in) :: configured, mean, gap, age
      !> The bound [m], present threshold before; the age, not changed if it always holds [s]
      real(wp), intent(inout) :: bound, until

      real(wp) :: drop, here

      here = bound
      if (.not. here > configured) return
      drop = min(max_drop / self%hazard%slope, &
         & max_gap_part * max(gap, tiny_gap * self%stretch))
      bound = configured
      if (.not. here - drop > configured) return
      until = max(nearest(age, huge(1.0_wp)), -self%ageing%time &
         & * log((here - drop - configured) / (-self%ageing%deficit(configured, mean))))
      bound = min(here - drop, self%ageing%threshold(configured, mean, until))
   end subroutine falling_bound

   subroutine start_steadily(self, contact, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      call self%update_deviate(contact)
      associate (life => self%life(:, contact), age => self%age(:, contact))
         call self%solve_break(contact, 0, age(age_limit), pose%time - age(age_birth), &
            & self%direction * (pose%displacement - self%record(row_origin, contact)), &
            & life(life_left), age(age_attempts), life(life_key))
         self%record(row_limit, contact) = life(life_key)
         age(age_renewal) = never
      end associate
   end subroutine start_steadily

   subroutine end_steadily(self, contact, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: stretch, uniform(2)

      stretch = pose%displacement - self%record(row_origin, contact)
      if (.not. abs(stretch) > 0.0_wp) stretch = self%direction
      associate (attempts => self%age(age_attempts, contact))
         attempts = next_attempt(attempts)
         call self%draw_attempt(contact, 0, attempts, uniform)
      end associate
      self%life(:life_key, contact) = [merge(1.0_wp, 2.0_wp, stretch > 0.0_wp), &
         & -log(uniform(1)), never]
      call self%set_bound(contact, pose)
   end subroutine end_steadily

   subroutine solve_newborn(self, contact, later, stretch, left, limit, key, attempts)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact, later
      real(wp), intent(in) :: stretch, left
      real(wp), intent(inout) :: limit
      real(wp), intent(out) :: key, attempts

      attempts = 1.0_wp
      call self%solve_break(contact, later, limit, 0.0_wp, stretch, left, attempts, key)
      limit = key
   end subroutine solve_newborn

   subroutine begin_solved(self, contact, time, configured, attempts)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: time, configured, attempts

      self%age(:, contact) = [time, configured, never, attempts, 0.0_wp]
   end subroutine begin_solved

   !> Break the leaders that are due, renew the bounds that are due, and break contacts whose
   !> thresholds have fallen to their forces.
   subroutine update_bounds(self, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      call self%break_leaders(pose)
      do
         contact = self%order_renewal%due(pose%time)
         if (contact == 0) return
         if (self%accepts_break(contact, pose, .false.)) call self%break_contact(contact, pose)
      end do
   end subroutine update_bounds

   subroutine rebuild(self, displacement)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      integer :: contact, place

      self%turns = 0
      call rebuild_thermal(self, displacement)
      do place = 1, self%leaders
         associate (leader => self%leader(place))
            call self%order(self%ahead)%remove(leader)
            self%leader_key(place) = self%direction * self%record(row_origin, leader) &
               & + self%age(age_bound, leader)
         end associate
      end do
      call self%order_renewal%clear()
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         call self%order_renewal%put(contact, self%age(age_renewal, contact))
      end do
      call self%order_renewal%arrange()
   end subroutine rebuild

   pure subroutine records(self, time, first, values)
      class(thermal_ageing_contacts_type), intent(in) :: self
      real(wp), intent(in) :: time
      integer, intent(in) :: first
      real(wp), intent(out) :: values(:, :)

      integer :: contact, place

      call self%thermal_contacts_type%records(time, first, values)
      do place = 1, size(values, 2)
         contact = first + place - 1
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         values(3, place) = self%threshold(contact, time)
      end do
   end subroutine records

   subroutine exchange(self, archive)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      real(wp) :: leader(max_leaders)

      call exchange_thermal(self, archive)
      call archive%section("ages of thermal contacts")
      call archive%exchange("age", self%age)
      call self%prediction%exchange(archive)
      call archive%exchange("leaders", self%leaders)
      leader = real(self%leader, wp)
      call archive%exchange_fixed("leader", [max_leaders, 1], leader)
      self%leader = nint(leader)
   end subroutine exchange

   subroutine shift_order(self, shift)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call self%thermal_contacts_type%shift_order(shift)
      call self%prediction%shift(shift)
   end subroutine shift_order

end module mesoslip_contacts_thermal_ageing
