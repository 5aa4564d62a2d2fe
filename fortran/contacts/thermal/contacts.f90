!> N independent contacts, which break by thermal activation.
!>
!> A contact under the force f breaks at the rate omega_0 exp((abs(f) - f_s)/f_T), and at once where
!> abs(f) = f_s (Bell's law). Contacts whose forces have one sign share a clock, the integral of
!> omega_0 exp(s k (X - R)/f_T) over the time, where s is the sign and R a displacement near the
!> slider's. Each contact draws an exponential deviate E once in a life. It breaks when its clock
!> has advanced by E exp((f_s + s k (Y - R))/f_T), a key that is known when it attaches. Once its
!> force has changed its sign, the remaining deviate continues with the other clock, from where its
!> rate ceases to be negligible. There is no time step.
module mesoslip_contacts_thermal_contacts
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_base, only: total_law
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_stiffness
   use mesoslip_contacts_thermal_keys, only: life_clock, life_key, life_left, life_next, motions
   use mesoslip_contacts_thermal_steady, only: thermal_steady_type, set_up_steady
   use mesoslip_hazard, only: force_sign, never
   use mesoslip_interface_law, only: clocks, interface_law_type, pose_type, window_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_schedule, only: schedule_type
   implicit none
   private

   public :: thermal_contacts_type, make_thermal_contacts
   ! For kinds that extend this one: a call by a component would lose their own procedures.
   public :: initialize_thermal, offer_thermal, respond_thermal

   !> Contacts that break by thermal activation.
   type, extends(thermal_steady_type) :: thermal_contacts_type
   contains
      procedure :: initialize => initialize_thermal
      procedure :: offer => offer_thermal
      procedure :: respond => respond_thermal
      procedure :: plan, settle, join, leave, begin_life, accepts_break, update_bounds, find_ahead
      procedure, non_overridable :: break_contact, turns_ahead, may_turn_later
      procedure, non_overridable, private :: break_and_attach, pass_ahead, break_by_clock, &
         & respond_steadily
   end type thermal_contacts_type

contains

   !> Set up contacts from named numbers.
   subroutine make_thermal_contacts(contacts, common, parameters, error)
      class(contacts_type), allocatable, intent(out) :: contacts
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: columns and rows, rate and force of activation
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(thermal_contacts_type), allocatable :: self

      allocate (self)
      self%parameters = common
      call set_up_steady(self, parameters, error)
      if (.not. allocated(error)) call self%hazard%delay_turns()
      call move_alloc(self, contacts)
   end subroutine make_thermal_contacts

   !> Draw all contacts, and insert them.
   subroutine initialize_thermal(self, state)
      class(thermal_contacts_type), intent(inout) :: self
      integer, intent(in) :: state

      type(pose_type) :: pose
      integer :: contact

      call self%draw(state)
      do contact = 1, self%parameters%count
         if (self%record(row_stiffness, contact) > 0.0_wp) call self%join(contact, pose)
      end do
   end subroutine initialize_thermal

   !> The law holds until a contact breaks, attaches, or moves to the other clock.
   subroutine offer_thermal(self, pose, law, window)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      real(wp) :: ahead

      call self%follow_motion(pose)
      if (.not. self%is_steady) then
         call offer_by_clocks(self, pose, law, window)
         return
      end if
      law = total_law(self)
      call self%order(self%ahead)%first(ahead)
      window = self%window_between(-huge(1.0_wp), ahead, self%detached%next_due)
      self%clock%is_used = .false.
   end subroutine offer_thermal

   subroutine plan(self, pose, limit, schedule)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      call self%follow_motion(pose)
      if (self%is_steady) then
         call self%plan_steadily(pose, limit, schedule)
      else
         call self%plan_by_clocks(pose, limit, schedule)
      end if
   end subroutine plan

   !> Offer the law of a motion with clocks.
   subroutine offer_by_clocks(self, pose, law, window)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      real(wp) :: ahead, end_time

      law = total_law(self)
      end_time = self%detached%next_due
      call self%find_ahead(pose, law, ahead, end_time)
      window = self%window_between(self%behind, ahead, end_time)
      call self%set_next()
      call self%hazard%offer(pose%displacement, self%clock)
      call self%hazard%limit_window(window)
   end subroutine offer_by_clocks

   !> Break all contacts that are due, then attach those that are, in the order in which they broke.
   subroutine respond_thermal(self, before, after)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      if (self%is_steady) then
         call self%respond_steadily(after)
      else
         call self%hazard%advance(self%clock)
         call self%break_and_attach(after)
      end if
   end subroutine respond_thermal

   !> Break and attach contacts in a uniform motion.
   subroutine respond_steadily(self, pose)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks
      integer :: contact

      breaks = self%breaks
      do
         call self%order(self%ahead)%due(self%direction * pose%displacement, contact)
         if (contact == 0) exit
         call self%break_contact(contact, pose)
      end do
      if (self%breaks > breaks) self%track%generation = self%track%generation + 1
      call self%attach_due(pose)
   end subroutine respond_steadily

   !> Break and attach all contacts that are due where the slider is.
   subroutine break_and_attach(self, pose)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks
      integer :: number

      breaks = self%breaks
      do number = 1, clocks
         call self%break_by_clock(number, pose)
      end do
      call self%reverse_if_due(pose%displacement)
      call self%pass_ahead(pose)
      call self%update_bounds(pose)
      if (self%breaks > breaks) self%track%generation = self%track%generation + 1
      do number = 1, clocks
         call self%move_reference(number, pose%displacement)
      end do
      call self%attach_due(pose)
   end subroutine break_and_attach

   !> Break the contacts whose keys a clock has reached.
   subroutine break_by_clock(self, number, pose)
      class(thermal_contacts_type), intent(inout) :: self
      integer, intent(in) :: number
      type(pose_type), intent(in) :: pose

      integer :: contact

      if (self%members(number) == 0) return
      do
         call self%order(motions + number)%due(self%hazard%reading(number), contact)
         if (contact == 0) return
         if (self%accepts_break(contact, pose, .true.)) call self%break_contact(contact, pose)
      end do
   end subroutine break_by_clock

   !> Let all events ahead happen: contacts break at their thresholds, or their forces change sign.
   subroutine pass_ahead(self, pose)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      do
         call self%order(self%ahead)%due(self%direction * pose%displacement, contact)
         if (contact == 0) return
         if (self%turns_ahead(contact)) then
            call self%change_clock(contact)
         else if (self%accepts_break(contact, pose, .false.)) then
            call self%break_contact(contact, pose)
         end if
      end do
   end subroutine pass_ahead

   subroutine break_contact(self, contact, pose)
      class(thermal_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      call self%take_out(contact)
      call self%detach(contact, pose%displacement, pose%time)
      self%life(:life_key, contact) = 0.0_wp
   end subroutine break_contact

   !> Draw the deviate of a contact that has attached, and insert it.
   subroutine join(self, contact, pose)
      class(thermal_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: stretch
      integer :: number

      call self%draw_deviates([contact], 0_i8)
      self%life(life_left, contact) = self%life(life_next, contact)
      self%life(life_next, contact) = 0.0_wp
      if (self%is_steady) then
         call self%join_steadily(contact, pose)
         return
      end if
      stretch = pose%displacement - self%record(row_origin, contact)
      if (.not. abs(stretch) > 0.0_wp) stretch = pose%direction
      number = merge(1, 2, stretch > 0.0_wp)
      self%life(life_clock, contact) = real(number, wp)
      self%life(life_key, contact) = never
      call self%begin_life(contact, pose)
      call self%move_reference(number, pose%displacement)
      call self%put(contact)
   end subroutine join

   subroutine leave(self, contact)
      class(thermal_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%take_out(contact)
      self%life(:life_key, contact) = 0.0_wp
   end subroutine leave

   subroutine settle(self, schedule, pose)
      class(thermal_contacts_type), intent(inout) :: self
      type(schedule_type), intent(inout) :: schedule
      type(pose_type), intent(in) :: pose

      real(wp) :: breaks
      integer :: number

      if (self%is_steady) then
         call self%settle_steadily(schedule)
         if (schedule%is_over) call self%attach_due(pose)
      else
         call self%settle_lists(schedule)
         if (schedule%is_over) then
            breaks = self%breaks
            call self%break_and_attach(pose)
            if (self%breaks > breaks .and. .not. schedule%breaks_now) then
               schedule%moments = schedule%moments + 1
            end if
         else
            number = clocks + 1 - schedule%number
            if (self%members(number) == 0) call self%move_reference(number, pose%displacement)
         end if
      end if
      self%detached_count = real(self%detached%count, wp)
   end subroutine settle

   !> What a kind adds to the life of a contact that has attached: nothing here.
   subroutine begin_life(self, contact, pose)
      class(thermal_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

   end subroutine begin_life

   !> Whether a contact breaks that has reached its limit, or its key: always, unless these are
   !> bounds.
   function accepts_break(self, contact, pose, by_clock)
      class(thermal_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose
      logical, intent(in) :: by_clock
      logical :: accepts_break

      accepts_break = .true.
   end function accepts_break

   !> Coordinate before which no contact breaks at its threshold, or moves to the other clock.
   subroutine find_ahead(self, pose, law, ahead, end_time)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(in) :: law
      !> The coordinate along the direction of motion [m]
      real(wp), intent(out) :: ahead
      !> Time before which it is used [s]
      real(wp), intent(inout) :: end_time

      call self%order(self%ahead)%first(ahead)
   end subroutine find_ahead

   !> Whether a contact moves to the other clock ahead.
   pure function turns_ahead(self, contact)
      class(thermal_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      logical :: turns_ahead

      turns_ahead = force_sign(int(self%life(life_clock, contact))) * self%direction < 0.0_wp
   end function turns_ahead

   !> Whether it does, and its hazard is negligible there.
   pure function may_turn_later(self, contact)
      class(thermal_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      logical :: may_turn_later

      may_turn_later = self%turns_ahead(contact) &
         & .and. self%record(row_limit, contact) >= self%hazard%turn_limit
   end function may_turn_later

   !> Update limits that have changed with the time: none here.
   subroutine update_bounds(self, pose)
      class(thermal_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

   end subroutine update_bounds

end module mesoslip_contacts_thermal_contacts
