!> Contacts that break by thermal activation, whose thresholds change with their age.
!>
!> The rate of breaking then depends on the age of a contact, so that contacts cannot share a clock.
!> A contact has the key of a lower bound on its threshold, for which the rate is too high. Where it
!> reaches that key, it breaks with a probability, the ratio of its rate to that of the bound;
!> otherwise it draws another deviate (P. Lewis and G. Shedler, Naval Research Logistics Quarterly
!> 26 (1979) 403). This is exact and has no time step. The bound of a growing threshold is its last
!> value; that of a falling one is its value at a later time, when the bound is renewed.
module mesoslip_contacts_thermal_ageing
   use mesoslip_contacts_ageing_law, only: ageing_law_type, take_ageing_law
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_break_tree, only: break_tree_type, new_break_tree
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, row_stiffness
   use mesoslip_contacts_thermal_contacts, only: thermal_contacts_type, initialize_thermal, &
      & offer_by_clocks
   use mesoslip_contacts_thermal_keys, only: exchange_thermal, life_left, set_up_keys
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
   !> Number of deviates of a life, after which they repeat
   integer(i8), parameter :: max_attempts = 65535_i8

   !> Numbers of the age of a contact: time of attaching [s], configured breaking stretch [m], time
   !> at which its bound is renewed [s], and deviates drawn in its life
   integer, parameter :: age_length = 4
   integer, parameter :: age_birth = 1, age_limit = 2, age_renewal = 3, age_attempts = 4

   !> Thermally activated contacts that age. The limit in a record is a lower bound on the breaking
   !> stretch.
   type, extends(thermal_contacts_type) :: thermal_ageing_contacts_type
      !> How thresholds change
      type(ageing_law_type), private :: ageing
      !> Numbers of the ages, shape (age_length, count)
      real(wp), allocatable, private :: age(:, :)
      !> Contacts by the times at which their bounds are renewed
      type(break_tree_type), private :: order_renewal
      !> Whether contacts are those of the start
      logical, private :: is_start = .false.
   contains
      procedure :: initialize, offer, plan, leave, begin_life, accepts_break, update_bounds, &
         & rebuild, records, exchange, limit_at_birth
      procedure, non_overridable, private :: set_bound, renew_bound, threshold, mean_of
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
      call set_up_keys(self, parameters, error)
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

      call offer_by_clocks(self, pose, law, window)
      window%end_time = min(window%end_time, self%order_renewal%first())
   end subroutine offer

   !> There are no schedules, as bounds change with the time.
   subroutine plan(self, pose, limit, schedule)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      schedule%is_over = .true.
   end subroutine plan

   subroutine leave(self, contact)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%order_renewal%remove(contact)
      call self%thermal_contacts_type%leave(contact)
   end subroutine leave

   subroutine begin_life(self, contact, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      self%age(:, contact) = [pose%time, self%record(row_limit, contact), never, 1.0_wp]
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
      call self%order_renewal%set(contact, self%age(age_renewal, contact))
   end subroutine set_bound

   !> Renew the bound of a contact.
   subroutine renew_bound(self, contact, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      call self%update_deviate(contact)
      call self%take_out(contact)
      call self%set_bound(contact, pose)
      call self%put(contact)
   end subroutine renew_bound

   function accepts_break(self, contact, pose, by_clock)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      logical, intent(in) :: by_clock
      logical :: accepts_break

      real(wp) :: here, uniform(2)
      integer(i8) :: attempt

      here = self%threshold(contact, pose%time)
      accepts_break = here - abs(pose%displacement - self%record(row_origin, contact)) &
         & <= tiny_gap * self%stretch
      if (by_clock .and. .not. accepts_break) then
         attempt = int(self%age(age_attempts, contact), i8)
         call draw(attempt)
         accepts_break = uniform(2) &
            & <= exp(-self%hazard%slope * (here - self%record(row_limit, contact)))
      end if
      if (accepts_break) then
         call self%order_renewal%remove(contact)
         return
      end if
      call self%renew_bound(contact, pose)
      if (.not. by_clock) return
      attempt = mod(attempt, max_attempts) + 1_i8
      self%age(age_attempts, contact) = real(attempt, wp)
      call draw(attempt)
      call self%take_out(contact)
      self%life(life_left, contact) = -log(uniform(1))
      call self%put(contact)

   contains

      !> Draw uniform numbers of an attempt, for its deviate and for its acceptance.
      subroutine draw(attempt)
         integer(i8), intent(in) :: attempt

         call uniform_pair(self%parameters%seed, self%parameters%realization, &
            & int(contact - 1, i8), int(self%record(row_renewal, contact), i8), attempt, uniform)
      end subroutine draw

   end function accepts_break

   !> Renew the bounds that are due, and break contacts whose thresholds have fallen to their
   !> forces.
   subroutine update_bounds(self, pose)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do
         contact = self%order_renewal%due(pose%time)
         if (contact == 0) return
         if (self%accepts_break(contact, pose, .false.)) call self%break_contact(contact, pose)
      end do
   end subroutine update_bounds

   subroutine rebuild(self, displacement)
      class(thermal_ageing_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      integer :: contact

      call self%thermal_contacts_type%rebuild(displacement)
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

      call exchange_thermal(self, archive)
      call archive%section("ages of thermal contacts")
      call archive%exchange("age", self%age)
   end subroutine exchange

end module mesoslip_contacts_thermal_ageing
