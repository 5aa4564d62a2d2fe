!> N contacts that know nothing of each other, which break by thermal activation.
!>
!> A contact under the force f breaks at the rate omega_0 exp((abs(f) - f_s)/f_T), and at once where
!> abs(f) = f_s (Bell's law). Contacts whose forces have one sign share a clock, the integral of
!> omega_0 exp(s k (X - R)/f_T) over the time, s being the sign and R a displacement near the
!> slider's. Each draws an exponential deviate once in a life; it breaks where its clock has gone on
!> by the deviate times exp((f_s + s k (Y - R))/f_T), a key known when it attaches. Where its force
!> changes its sign, what is left of the deviate goes on with the other clock. There is no time
!> step.
module mesoslip_contacts_activated_contacts
   use mesoslip_contacts_activated_keys, only: activated_keys_type, exchange_activated, &
      & life_clock, max_clock_exponent, never, set_up_activated
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_base, only: total_law
   use mesoslip_contacts_individual_record, only: row_origin, row_renewal
   use mesoslip_interface_law, only: clocks, interface_law_type, pose_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_random, only: uniform_pair
   implicit none
   private

   public :: contact_activated_type, make_contact_activated
   ! For kinds that extend this one: a call by a component would lose their own procedures.
   public :: initialize_activated, offer_activated, respond_activated

   !> Time over that in which a clock is expected to come to its reading after which a window ends
   real(wp), parameter :: window_ratio = 1.25_wp

   !> Contacts that break by thermal activation.
   type, extends(activated_keys_type) :: contact_activated_type
   contains
      procedure :: initialize => initialize_activated
      procedure :: offer => offer_activated
      procedure :: respond => respond_activated
      procedure :: join
      procedure :: exchange
      !> Prepare the life of a contact that has attached
      procedure :: prepare
      !> Whether a contact breaks that has come to its threshold, or its clock to its key
      procedure :: confirms
      !> Take note of what has changed with the time alone
      procedure :: renew_due
      !> A contact breaks
      procedure, non_overridable :: break_contact
      procedure, non_overridable, private :: advance_clock, pass_up, pass_down, break_activated
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

      allocate (self)
      self%parameters = common
      call set_up_activated(self, parameters, error)
      call move_alloc(self, contacts)
   end subroutine make_contact_activated

   !> Draw all contacts for the start of a run.
   subroutine initialize_activated(self, state)
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
   end subroutine initialize_activated

   !> Contact force as a law, which holds until a contact breaks, attaches or bears no force.
   subroutine offer_activated(self, pose, law, window)
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
   end subroutine offer_activated

   !> Time in which the integral of exp(growth t + bend t**2/2) is expected to have a value; huge
   !> where this estimate does not apply.
   pure function expected_time(growth, bend, wanted) result(time)
      !> Growth of the exponent [1/s] and its change [1/s2], the integral [s]
      real(wp), intent(in) :: growth, bend, wanted
      real(wp) :: time

      real(wp) :: y

      y = growth * wanted
      time = wanted
      if (abs(y) < 0.1_wp) then
         time = wanted * (1.0_wp - y * (0.5_wp - y / 3.0_wp))
      else
         time = huge(1.0_wp)
         if (y > -1.0_wp) time = log(1.0_wp + y) / growth
      end if
      ! Where the velocity changes by much, the slider is to go as far as it can.
      if (abs(bend) * min(time, 1.0e100_wp)**2 > 1.0_wp) time = max(time, 1.0_wp / sqrt(abs(bend)))
   end function expected_time

   !> Break all contacts that are due, then attach those that are, in the order in which they broke.
   subroutine respond_activated(self, before, after)
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
      call self%renew_due(after)
      if (self%breaks > breaks) self%track%generation = self%track%generation + 1
      do number = 1, clocks
         call self%move_reference(number, after%displacement)
      end do
      call self%attach_due(after)
   end subroutine respond_activated

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
         if (self%confirms(contact, pose, .true.)) call self%break_contact(contact, pose)
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
         if (int(self%life(life_clock, contact)) == 2) then
            call self%change_sign(contact)
         else if (self%confirms(contact, pose, .false.)) then
            call self%break_contact(contact, pose)
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
         if (int(self%life(life_clock, contact)) == 1) then
            call self%change_sign(contact)
         else if (self%confirms(contact, pose, .false.)) then
            call self%break_contact(contact, pose)
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
      call self%prepare(contact, pose)
      call self%move_reference(number, pose%displacement)
      call self%put(contact)
   end subroutine join

   !> Prepare the life of a contact that has attached: nothing unless a kind has more to know.
   subroutine prepare(self, contact, pose)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Where the slider is
      type(pose_type), intent(in) :: pose

   end subroutine prepare

   !> Whether a contact breaks that has come to its threshold, or its clock to its key: it does
   !> unless these were bounds.
   function confirms(self, contact, pose, by_clock)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Where the slider is
      type(pose_type), intent(in) :: pose
      !> Whether it is the clock
      logical, intent(in) :: by_clock
      !> Whether it breaks
      logical :: confirms

      confirms = .true.
   end function confirms

   !> Take note of what has changed with the time alone: nothing unless thresholds do.
   subroutine renew_due(self, pose)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> Where the slider is
      type(pose_type), intent(in) :: pose

   end subroutine renew_due

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The contacts
      class(contact_activated_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call exchange_activated(self, archive)
   end subroutine exchange

end module mesoslip_contacts_activated_contacts
