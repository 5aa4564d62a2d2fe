!> N contacts that know nothing of each other, which break by thermal activation.
!>
!> A contact under the force f breaks at the rate omega_0 exp((abs(f) - f_s)/f_T), and at once where
!> abs(f) = f_s (Bell's law). Contacts whose forces have one sign share a clock, the integral of
!> omega_0 exp(s k (X - R)/f_T) over the time, s being the sign and R a displacement near the
!> slider's. Each draws an exponential deviate once in a life; it breaks where its clock has gone on
!> by the deviate times exp((f_s + s k (Y - R))/f_T), a key known when it attaches. Where its force
!> changes its sign, what is left of the deviate goes on with the other clock. There is no time
!> step.
module mesoslip_contacts_activated
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_base, only: exchange_individual, individual_contacts_type, &
      & total_law
   use mesoslip_contacts_individual_break_tree, only: break_tree_type, new_break_tree
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, row_stiffness
   use mesoslip_contacts_mechanics, only: coupling_equal
   use mesoslip_interface_law, only: clocks, interface_law_type, pose_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_random, only: uniform_pair
   implicit none
   private

   public :: contact_activated_type, make_contact_activated

   !> Sign of the force of the contacts that go by each clock
   real(wp), parameter :: force_sign(clocks) = [1.0_wp, -1.0_wp]
   !> Key of a contact that does not break; no other contact has it
   real(wp), parameter :: never = huge(1.0_wp)
   !> Maximum exponents: of a key, and of a clock before its reference moves
   real(wp), parameter :: max_key_exponent = 690.0_wp, max_clock_exponent = 300.0_wp
   !> By how much an exponent of a clock may fall before its reference moves: what is added to a
   !> reading loses as many digits
   real(wp), parameter :: max_fall = 8.0_wp
   !> Stretch over the mean breaking stretch beyond zero at which the sign of a force changes: less
   !> than matters, and more than rounding
   real(wp), parameter :: tiny_stretch = 1.0e-12_wp
   !> Time over that in which a clock is expected to come to its reading after which a window ends
   real(wp), parameter :: window_ratio = 1.25_wp

   !> Numbers of the life of a contact: the clock it goes by, what was left of its deviate when its
   !> key was made, and the key
   integer, parameter :: life_length = 3
   integer, parameter :: life_clock = 1, life_left = 2, life_key = 3

   !> Contacts that break by thermal activation.
   type, extends(individual_contacts_type) :: contact_activated_type
      !> Rate at the threshold, omega_0 [1/s], and k/f_T [1/m]
      real(wp), private :: rate = 0.0_wp, slope = 0.0_wp
      !> Mean breaking stretch [m]
      real(wp), private :: stretch = 1.0_wp
      !> Numbers of their lives, shape (life_length, count)
      real(wp), allocatable, private :: life(:, :)
      !> Reading of each clock since its reference was set [s], the reference [m], and the maximum
      !> exponent of its rate since then
      real(wp), private :: reading(clocks) = 0.0_wp, reference(clocks) = 0.0_wp, &
         & max_exponent(clocks) = 0.0_wp
      !> Contacts in the order of what comes next in a motion up and down, a break at the threshold
      !> or a change of the force's sign, and in that of their keys
      type(break_tree_type), private :: order_up, order_down, order_clock(clocks)
      !> Number of contacts that go by each clock
      integer, private :: members(clocks) = 0
   contains
      procedure :: initialize
      procedure :: offer
      procedure :: respond
      procedure :: join
      procedure :: rebuild
      procedure :: shift_order
      procedure :: exchange
      procedure, non_overridable, private :: put, take_out, change_sign, break_contact, exponent, &
         & set_key, move_reference, advance_clock, pass_up, pass_down, break_activated
   end type contact_activated_type

contains

   !> Set up contacts from named numbers.
   subroutine make_contact_activated(contacts, common, parameters, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> What all kinds of contacts are made of
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: columns and rows, rate and force of activation
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong, or there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      type(contact_activated_type), allocatable :: self
      real(wp) :: force
      integer :: columns, rows, number, stat

      allocate (self)
      self%parameters = common
      call parameters%take("columns", columns, error)
      call parameters%take("rows", rows, error)
      call parameters%take("activation_rate", self%rate, error)
      call parameters%take("activation_force", force, error)
      call parameters%finish(error)
      if (allocated(error)) return
      if (.not. (self%rate > 0.0_wp .and. force > 0.0_wp) &
         & .or. common%coupling /= coupling_equal) then
         call raise(error, status_invalid, "rate and force of activation must be positive, and " &
            & // "contacts of one stiffness")
         return
      end if
      self%stretch = common%static_force / common%stiffness
      self%slope = common%stiffness / force
      self%has_clocks = .true.
      self%clock%slope = force_sign * self%slope
      call self%allocate_records(columns, rows, error)
      if (allocated(error)) return
      allocate (self%life(life_length, common%count), source=0.0_wp, stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the lives of contacts")
         return
      end if
      call new_break_tree(self%order_up, common%count, error)
      if (.not. allocated(error)) call new_break_tree(self%order_down, common%count, error)
      do number = 1, clocks
         if (.not. allocated(error)) then
            call new_break_tree(self%order_clock(number), common%count, error)
         end if
      end do
      call move_alloc(self, contacts)
   end subroutine make_contact_activated

   !> Draw all contacts for the start of a run.
   subroutine initialize(self, state)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      type(pose_type) :: pose
      integer :: contact

      call self%draw(state)
      do contact = 1, self%parameters%count
         call self%join(contact, pose)
      end do
   end subroutine initialize

   !> Contact force as a law, which holds until a contact breaks, attaches or bears no force.
   subroutine offer(self, pose, law, window)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> The law
      type(interface_law_type), intent(out) :: law
      !> Where it holds
      type(window_type), intent(out) :: window

      real(wp) :: time
      integer :: number

      law = total_law(self)
      window%upper = self%order_up%first()
      window%lower = -self%order_down%first()
      window%end_time = self%detached%next_due
      time = huge(1.0_wp)
      do number = 1, clocks
         associate (clock => self%clock(number))
            clock%is_used = self%members(number) > 0
            clock%elapsed = 0.0_wp
            clock%is_due = .false.
            if (.not. clock%is_used) cycle
            clock%rate = self%rate * exp(self%exponent(number, pose%displacement))
            clock%left = huge(1.0_wp)
            if (self%order_clock(number)%first() < never) then
               clock%left = self%order_clock(number)%first() - self%reading(number)
               time = min(time, expected_time(clock%slope * pose%velocity, &
                  & clock%slope * pose%acceleration, clock%left / clock%rate))
            end if
         end associate
      end do
      ! A clock must not go through more exponents than numbers have.
      if (self%members(1) > 0) window%upper = min(window%upper, &
         & self%reference(1) + max_clock_exponent / self%slope)
      if (self%members(2) > 0) window%lower = max(window%lower, &
         & self%reference(2) - max_clock_exponent / self%slope)
      ! A step that is not much longer than needed takes less time.
      if (time < huge(1.0_wp)) window%end_time = min(window%end_time, &
         & max(pose%time + window_ratio * time, nearest(pose%time, 1.0_wp)))
   end subroutine offer

   !> Time in which the integral of exp(growth t + bend t**2/2) is expected to have a value; huge
   !> where that is not to be told so simply.
   pure function expected_time(growth, bend, wanted) result(time)
      !> Growth of the exponent [1/s] and its change [1/s2], the integral [s]
      real(wp), intent(in) :: growth, bend, wanted
      real(wp) :: time

      real(wp) :: y

      y = growth * wanted
      time = wanted
      if (abs(y) > 1.0e-3_wp) then
         time = huge(1.0_wp)
         if (y > -1.0_wp) time = log(1.0_wp + y) / growth
      end if
      ! Where the velocity changes by much, the slider is to go as far as it can.
      if (abs(bend) * min(time, 1.0e100_wp)**2 > 1.0_wp) time = max(time, 1.0_wp / sqrt(abs(bend)))
   end function expected_time

   !> Break all contacts that are due, then attach those that are, in the order in which they broke.
   subroutine respond(self, before, after)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Where the slider was, and where it is
      type(pose_type), intent(in) :: before, after

      real(wp) :: breaks
      integer :: number

      breaks = self%breaks
      do number = 1, clocks
         call self%advance_clock(number)
         call self%break_activated(number, after)
      end do
      call self%pass_up(after)
      call self%pass_down(after)
      if (self%breaks > breaks) self%track%generation = self%track%generation + 1
      do number = 1, clocks
         call self%move_reference(number, after%displacement)
      end do
      call self%attach_due(after)
   end subroutine respond

   !> Let a clock go on by what was added in the last advance.
   subroutine advance_clock(self, number)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: number

      associate (clock => self%clock(number))
         if (clock%is_due) then
            ! To the last digit, so that the contact does break.
            self%reading(number) = self%order_clock(number)%first()
         else
            self%reading(number) = self%reading(number) + clock%elapsed
         end if
         clock%elapsed = 0.0_wp
         clock%is_due = .false.
      end associate
   end subroutine advance_clock

   !> Break the contacts whose keys a clock has come to.
   subroutine break_activated(self, number, pose)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: number
      type(pose_type), intent(in) :: pose

      integer :: contact

      if (self%members(number) == 0) return
      do
         contact = self%order_clock(number)%due(self%reading(number))
         if (contact == 0) return
         call self%break_contact(contact, pose)
      end do
   end subroutine break_activated

   !> Let contacts respond to a motion up: they break at their thresholds, or become stretched.
   subroutine pass_up(self, pose)
      class(contact_activated_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do
         contact = self%order_up%due(pose%displacement)
         if (contact == 0) return
         if (nint(self%life(life_clock, contact)) == 1) then
            call self%break_contact(contact, pose)
         else
            call self%change_sign(contact)
         end if
      end do
   end subroutine pass_up

   !> Let contacts respond to a motion down.
   subroutine pass_down(self, pose)
      class(contact_activated_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do
         contact = self%order_down%due(-pose%displacement)
         if (contact == 0) return
         if (nint(self%life(life_clock, contact)) == 2) then
            call self%break_contact(contact, pose)
         else
            call self%change_sign(contact)
         end if
      end do
   end subroutine pass_down

   !> A contact breaks.
   subroutine break_contact(self, contact, pose)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      call self%take_out(contact)
      call self%detach(contact, pose%displacement, pose%time)
   end subroutine break_contact

   !> The force of a contact changes its sign: what is left of its deviate goes by the other clock.
   subroutine change_sign(self, contact)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: old

      old = nint(self%life(life_clock, contact))
      call settle_deviate(self, contact)
      call self%take_out(contact)
      self%life(life_clock, contact) = real(clocks + 1 - old, wp)
      call self%put(contact)
   end subroutine change_sign

   !> Give a contact that has attached a deviate and a place in each order.
   subroutine join(self, contact, pose)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Where the slider is
      type(pose_type), intent(in) :: pose

      real(wp) :: uniform(2), stretch
      integer :: number

      call uniform_pair(self%parameters%seed, self%parameters%realization, int(contact - 1, i8), &
         & int(self%record(row_renewal, contact), i8), 1_i8, uniform)
      stretch = pose%displacement - self%record(row_origin, contact)
      if (.not. abs(stretch) > 0.0_wp) stretch = pose%direction
      number = merge(1, 2, stretch > 0.0_wp)
      self%life(:, contact) = [real(number, wp), -log(uniform(1)), never]
      call self%move_reference(number, pose%displacement)
      call self%put(contact)
   end subroutine join

   !> Put a contact into all orders.
   subroutine put(self, contact)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: number

      number = nint(self%life(life_clock, contact))
      call self%set_key(contact)
      call self%order_clock(number)%set(contact, self%life(life_key, contact))
      call self%order_up%set(contact, next_up(self, contact))
      call self%order_down%set(contact, -next_down(self, contact))
      self%members(number) = self%members(number) + 1
   end subroutine put

   !> Take a contact out of all orders.
   subroutine take_out(self, contact)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: number

      number = nint(self%life(life_clock, contact))
      call self%order_clock(number)%remove(contact)
      call self%order_up%remove(contact)
      call self%order_down%remove(contact)
      self%members(number) = self%members(number) - 1
   end subroutine take_out

   !> Displacement at which a contact breaks at its threshold, or its force becomes positive, in a
   !> motion up.
   pure function next_up(self, contact) result(displacement)
      class(contact_activated_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: displacement

      displacement = self%record(row_origin, contact) + merge(self%record(row_limit, contact), &
         & tiny_stretch * self%stretch, nint(self%life(life_clock, contact)) == 1)
   end function next_up

   !> The same in a motion down.
   pure function next_down(self, contact) result(displacement)
      class(contact_activated_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: displacement

      displacement = self%record(row_origin, contact) - merge(self%record(row_limit, contact), &
         & tiny_stretch * self%stretch, nint(self%life(life_clock, contact)) == 2)
   end function next_down

   !> Exponent of the rate of a clock.
   pure function exponent(self, number, displacement)
      class(contact_activated_type), intent(in) :: self
      integer, intent(in) :: number
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      real(wp) :: exponent

      exponent = force_sign(number) * self%slope * (displacement - self%reference(number))
   end function exponent

   !> Exponent of the factor between a contact's deviate and what its clock goes on by.
   pure function life_exponent(self, contact) result(exponent)
      class(contact_activated_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: exponent

      integer :: number

      number = nint(self%life(life_clock, contact))
      exponent = self%slope * (self%record(row_limit, contact) + force_sign(number) &
         & * (self%record(row_origin, contact) - self%reference(number)))
   end function life_exponent

   !> Set the key of a contact from what is left of its deviate; never if it is beyond all numbers:
   !> it is set again when the reference has moved.
   subroutine set_key(self, contact)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: contact

      real(wp) :: exponent

      exponent = life_exponent(self, contact)
      self%life(life_key, contact) = never
      if (exponent > max_key_exponent) return
      self%life(life_key, contact) = self%reading(nint(self%life(life_clock, contact))) &
         & + self%life(life_left, contact) * exp(exponent)
   end subroutine set_key

   !> Find what is left of the deviate of a contact now.
   subroutine settle_deviate(self, contact)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: contact

      if (.not. self%life(life_key, contact) < never) return
      self%life(life_left, contact) = max(0.0_wp, self%life(life_key, contact) &
         & - self%reading(nint(self%life(life_clock, contact)))) &
         & * exp(-life_exponent(self, contact))
   end subroutine settle_deviate

   !> Move the reference of a clock to the slider, if that is far from it.
   subroutine move_reference(self, number, displacement)
      class(contact_activated_type), intent(inout) :: self
      integer, intent(in) :: number
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      real(wp) :: exponent
      integer :: contact

      exponent = self%exponent(number, displacement)
      self%max_exponent(number) = max(self%max_exponent(number), exponent)
      if (self%members(number) > 0) then
         ! Rounding may leave the slider a little before the bound of its window.
         if (exponent < 0.999_wp * max_clock_exponent &
            & .and. exponent > self%max_exponent(number) - max_fall) return
         do contact = 1, self%parameters%count
            if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
            if (nint(self%life(life_clock, contact)) == number) then
               call settle_deviate(self, contact)
            end if
         end do
      end if
      self%reference(number) = displacement
      self%reading(number) = 0.0_wp
      self%max_exponent(number) = 0.0_wp
      if (self%members(number) == 0) return
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         if (nint(self%life(life_clock, contact)) /= number) cycle
         call self%set_key(contact)
         call self%order_clock(number)%put(contact, self%life(life_key, contact))
      end do
      call self%order_clock(number)%arrange()
   end subroutine move_reference

   !> Order all contacts anew, from the records and lives.
   subroutine rebuild(self, displacement)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      integer :: contact, number

      call self%order_up%clear()
      call self%order_down%clear()
      do number = 1, clocks
         call self%order_clock(number)%clear()
      end do
      self%members = 0
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         number = nint(self%life(life_clock, contact))
         call self%order_up%put(contact, next_up(self, contact))
         call self%order_down%put(contact, -next_down(self, contact))
         call self%order_clock(number)%put(contact, self%life(life_key, contact))
         self%members(number) = self%members(number) + 1
      end do
      call self%order_up%arrange()
      call self%order_down%arrange()
      do number = 1, clocks
         call self%order_clock(number)%arrange()
      end do
   end subroutine rebuild

   !> Move the references of the clocks.
   subroutine shift_order(self, shift)
      !> The contacts, their records moved
      class(contact_activated_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      self%reference = self%reference - shift
   end subroutine shift_order

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      integer :: number

      call archive%section("activated contacts")
      call exchange_individual(self, archive)
      call archive%exchange("life", self%life)
      do number = 1, clocks
         call archive%exchange("reading", self%reading(number))
         call archive%exchange("reference", self%reference(number))
         call archive%exchange("max_exponent", self%max_exponent(number))
      end do
   end subroutine exchange

end module mesoslip_contacts_activated
