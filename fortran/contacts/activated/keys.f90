!> Contacts that break by thermal activation: their clocks, keys and order.
!>
!> A contact goes by the clock of the sign of its force. Its key is the reading at which it breaks,
!> relative to a reference displacement near the slider's, so that no exponent is beyond all
!> numbers; the reference moves along. In a motion up or down a contact comes to its threshold, or
!> to where its force changes its sign.
module mesoslip_contacts_activated_keys
   use mesoslip_contacts_individual_base, only: exchange_individual, individual_contacts_type
   use mesoslip_contacts_individual_break_tree, only: break_tree_type, new_break_tree
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_stiffness
   use mesoslip_contacts_mechanics, only: coupling_equal
   use mesoslip_interface_law, only: clocks
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   implicit none
   private

   public :: activated_keys_type, set_up_activated, exchange_activated
   public :: life_clock, life_left, life_key, never, max_clock_exponent

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
   !> Numbers of the life of a contact: the clock it goes by, what was left of its deviate when its
   !> key was made, and the key
   integer, parameter :: life_length = 3
   integer, parameter :: life_clock = 1, life_left = 2, life_key = 3

   !> Contacts that break by thermal activation, in order.
   type, abstract, extends(individual_contacts_type) :: activated_keys_type
      !> Rate at the threshold, omega_0 [1/s], and k/f_T [1/m]
      real(wp) :: rate = 0.0_wp, slope = 0.0_wp
      !> Mean breaking stretch [m]
      real(wp) :: stretch = 1.0_wp
      !> Numbers of their lives, shape (life_length, count)
      real(wp), allocatable :: life(:, :)
      !> Reading of each clock since its reference was set [s], the reference [m], and the maximum
      !> exponent of its rate since then
      real(wp) :: reading(clocks) = 0.0_wp, reference(clocks) = 0.0_wp, &
         & max_exponent(clocks) = 0.0_wp
      !> Contacts in the order of what comes next in a motion up and down, a break at the threshold
      !> or a change of the force's sign, and in that of their keys
      type(break_tree_type) :: order_up, order_down, order_clock(clocks)
      !> Number of contacts that go by each clock
      integer :: members(clocks) = 0
   contains
      procedure :: rebuild
      procedure :: shift_order
      !> Find what is left of the deviate of a contact now
      procedure, non_overridable :: settle_deviate
      !> Put a contact into all orders, and take it out
      procedure, non_overridable :: put, take_out
      !> The force of a contact changes its sign
      procedure, non_overridable :: change_sign
      !> Exponent of the rate of a clock, and moving its reference to the slider
      procedure, non_overridable :: exponent, move_reference
      procedure, non_overridable, private :: set_key
   end type activated_keys_type

contains

   !> Set up contacts that break by thermal activation.
   subroutine set_up_activated(self, parameters, error)
      !> The contacts, of which is known what is common to all kinds
      class(activated_keys_type), intent(inout) :: self
      !> The other numbers: columns and rows, rate and force of activation
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong, or there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: force
      integer :: columns, rows, number, stat

      call parameters%take("columns", columns, error)
      call parameters%take("rows", rows, error)
      call parameters%take("activation_rate", self%rate, error)
      call parameters%take("activation_force", force, error)
      call parameters%finish(error)
      if (allocated(error)) return
      associate (common => self%parameters)
         if (.not. (self%rate > 0.0_wp .and. force > 0.0_wp) &
            & .or. common%coupling /= coupling_equal) then
            call raise(error, status_invalid, "rate and force of activation must be positive, " &
               & // "and contacts of one stiffness")
            return
         end if
         self%stretch = common%static_force / common%stiffness
         self%slope = common%stiffness / force
      end associate
      self%has_clocks = .true.
      self%clock%slope = force_sign * self%slope
      call self%allocate_records(columns, rows, error)
      if (allocated(error)) return
      allocate (self%life(life_length, self%parameters%count), source=0.0_wp, stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the lives of contacts")
         return
      end if
      call new_break_tree(self%order_up, self%parameters%count, error)
      if (.not. allocated(error)) then
         call new_break_tree(self%order_down, self%parameters%count, error)
      end if
      do number = 1, clocks
         if (.not. allocated(error)) then
            call new_break_tree(self%order_clock(number), self%parameters%count, error)
         end if
      end do
   end subroutine set_up_activated

   !> The force of a contact changes its sign: what is left of its deviate goes by the other clock.
   subroutine change_sign(self, contact)
      class(activated_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: old

      old = int(self%life(life_clock, contact))
      call self%settle_deviate(contact)
      call self%take_out(contact)
      self%life(life_clock, contact) = real(clocks + 1 - old, wp)
      call self%put(contact)
   end subroutine change_sign

   !> Put a contact into all orders.
   subroutine put(self, contact)
      class(activated_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: number

      number = int(self%life(life_clock, contact))
      call self%set_key(contact)
      call self%order_clock(number)%set(contact, self%life(life_key, contact))
      call self%order_up%set(contact, next_up(self, contact))
      call self%order_down%set(contact, -next_down(self, contact))
      self%members(number) = self%members(number) + 1
   end subroutine put

   !> Take a contact out of all orders.
   subroutine take_out(self, contact)
      class(activated_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: number

      number = int(self%life(life_clock, contact))
      call self%order_clock(number)%remove(contact)
      call self%order_up%remove(contact)
      call self%order_down%remove(contact)
      self%members(number) = self%members(number) - 1
   end subroutine take_out

   !> Displacement at which a contact breaks at its threshold, or its force becomes positive, in a
   !> motion up.
   pure function next_up(self, contact) result(displacement)
      class(activated_keys_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: displacement

      displacement = self%record(row_origin, contact) + merge(self%record(row_limit, contact), &
         & tiny_stretch * self%stretch, int(self%life(life_clock, contact)) == 1)
   end function next_up

   !> The same in a motion down.
   pure function next_down(self, contact) result(displacement)
      class(activated_keys_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: displacement

      displacement = self%record(row_origin, contact) - merge(self%record(row_limit, contact), &
         & tiny_stretch * self%stretch, int(self%life(life_clock, contact)) == 2)
   end function next_down

   !> Exponent of the rate of a clock.
   pure function exponent(self, number, displacement)
      class(activated_keys_type), intent(in) :: self
      integer, intent(in) :: number
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      real(wp) :: exponent

      exponent = force_sign(number) * self%slope * (displacement - self%reference(number))
   end function exponent

   !> Exponent of the factor between a contact's deviate and what its clock goes on by.
   pure function life_exponent(self, contact) result(exponent)
      class(activated_keys_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: exponent

      integer :: number

      number = int(self%life(life_clock, contact))
      exponent = self%slope * (self%record(row_limit, contact) + force_sign(number) &
         & * (self%record(row_origin, contact) - self%reference(number)))
   end function life_exponent

   !> Set the key of a contact from what is left of its deviate; never if it is beyond all numbers:
   !> it is set again when the reference has moved.
   subroutine set_key(self, contact)
      class(activated_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      real(wp) :: exponent

      exponent = life_exponent(self, contact)
      self%life(life_key, contact) = never
      if (exponent > max_key_exponent) return
      self%life(life_key, contact) = self%reading(int(self%life(life_clock, contact))) &
         & + self%life(life_left, contact) * exp(exponent)
   end subroutine set_key

   !> Find what is left of the deviate of a contact now.
   subroutine settle_deviate(self, contact)
      class(activated_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      if (.not. self%life(life_key, contact) < never) return
      self%life(life_left, contact) = max(0.0_wp, self%life(life_key, contact) &
         & - self%reading(int(self%life(life_clock, contact)))) &
         & * exp(-life_exponent(self, contact))
   end subroutine settle_deviate

   !> Move the reference of a clock to the slider, if that is far from it.
   subroutine move_reference(self, number, displacement)
      class(activated_keys_type), intent(inout) :: self
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
            if (int(self%life(life_clock, contact)) == number) then
               call self%settle_deviate(contact)
            end if
         end do
      end if
      self%reference(number) = displacement
      self%reading(number) = 0.0_wp
      self%max_exponent(number) = 0.0_wp
      if (self%members(number) == 0) return
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         if (int(self%life(life_clock, contact)) /= number) cycle
         call self%set_key(contact)
         call self%order_clock(number)%put(contact, self%life(life_key, contact))
      end do
      call self%order_clock(number)%arrange()
   end subroutine move_reference

   !> Order all contacts anew, from the records and lives.
   subroutine rebuild(self, displacement)
      !> The contacts
      class(activated_keys_type), intent(inout) :: self
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
         number = int(self%life(life_clock, contact))
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
      class(activated_keys_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      self%reference = self%reference - shift
   end subroutine shift_order

   !> Put what all activated contacts keep into an archive or take it out.
   subroutine exchange_activated(self, archive)
      !> The contacts
      class(activated_keys_type), intent(inout) :: self
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
   end subroutine exchange_activated

end module mesoslip_contacts_activated_keys
