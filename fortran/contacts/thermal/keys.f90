!> Contacts that break by thermal activation: their clocks, keys and order.
!>
!> A contact belongs to the clock of the sign of its force; as long as its rate is negligible, of
!> that which the force had. Its key is the reading at which it
!> breaks, relative to a reference displacement that is moved along with the slider. The direction
!> ahead is kept until an event on the way back. Ahead, the next event of a contact is its break at
!> the threshold or its move to the other clock; on the way back events are bounded.
module mesoslip_contacts_thermal_keys
   use mesoslip_contacts_individual_base, only: exchange_individual, individual_contacts_type
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_stiffness
   use mesoslip_contacts_individual_scan_order, only: new_scan_order, scan_order_type
   use mesoslip_contacts_mechanics, only: coupling_equal
   use mesoslip_hazard, only: force_sign, hazard_type, never
   use mesoslip_interface_law, only: clocks
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   implicit none
   private

   public :: thermal_keys_type, set_up_keys, exchange_thermal, rebuild_thermal
   public :: life_clock, life_left, life_key, life_next, motions

   !> Maximum change of the exponents up to which keys are rescaled rather than solved again
   real(wp), parameter :: max_rescaling = 310.0_wp
   !> Numbers of the life of a contact: its clock, 0 while it is detached; the remaining deviate
   !> when its key was solved; the key; and the deviate of its next life, 0 until it is drawn
   integer, parameter :: life_length = 4
   integer, parameter :: life_clock = 1, life_left = 2, life_key = 3, life_next = 4

   !> Directions of motion, the orders of which come before those of the clocks
   integer, parameter :: motions = 2

   !> Contacts that break by thermal activation, in order.
   type, abstract, extends(individual_contacts_type) :: thermal_keys_type
      type(hazard_type) :: hazard
      !> Mean breaking stretch [m]
      real(wp) :: stretch = 1.0_wp
      !> Numbers of the lives, shape (life_length, count)
      real(wp), allocatable :: life(:, :)
      !> Contacts by their next event in a motion up and down, a break at the threshold or a move
      !> to the other clock, then by their keys of each clock. One array, because gfortran 12 frees
      !> only one of two components of this type
      type(scan_order_type) :: order(motions + clocks)
      !> The order of the direction ahead
      integer :: ahead = 1
      !> Number of contacts of each clock
      integer :: members(clocks) = 0
      !> Whether the slider moves uniformly, and its velocity then [m/s]. Then the key of a contact
      !> is its stretch along the motion where its deviate is used up, and only the order ahead is
      !> kept
      logical :: is_steady = .false.
      real(wp) :: velocity = 0.0_wp
   contains
      procedure :: rebuild => rebuild_thermal, shift_order, behind_of, exchange => exchange_thermal
      !> Bound on the breaking stretch of a contact, and contacts put back that are not in the order
      !> ahead
      procedure :: bound, gather_ahead
      procedure, non_overridable :: put, insert, take_out, change_clock, clear_orders
      procedure, non_overridable :: update_deviate, raise_limit, distance, move_reference, &
         & reverse_if_due
      procedure, non_overridable, private :: set_key
   end type thermal_keys_type

contains

   !> Set up contacts with common parameters from the other numbers.
   subroutine set_up_keys(self, parameters, error)
      class(thermal_keys_type), intent(inout) :: self
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: force
      integer :: columns, rows, number, stat

      call parameters%take("columns", columns, error)
      call parameters%take("rows", rows, error)
      call parameters%take("activation_rate", self%hazard%rate, error)
      call parameters%take("activation_force", force, error)
      call parameters%finish(error)
      if (allocated(error)) return
      associate (common => self%parameters)
         if (.not. (self%hazard%rate > 0.0_wp .and. force > 0.0_wp) &
            & .or. common%coupling /= coupling_equal) then
            call raise(error, status_invalid, "rate and force of activation must be positive, " &
               & // "and contacts of one stiffness")
            return
         end if
         self%stretch = common%static_force / common%stiffness
         self%hazard%slope = common%stiffness / force
         call self%hazard%limit_turns(self%stretch)
      end associate
      self%has_clocks = .true.
      self%clock%slope = force_sign * self%hazard%slope
      call self%allocate_records(columns, rows, error)
      if (allocated(error)) return
      allocate (self%life(life_length, self%parameters%count), source=0.0_wp, stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the lives of contacts")
         return
      end if
      do number = 1, size(self%order)
         if (allocated(error)) return
         call new_scan_order(self%order(number), self%parameters%count, error)
      end do
   end subroutine set_up_keys

   !> Move a contact to the other clock.
   subroutine change_clock(self, contact)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: old

      old = int(self%life(life_clock, contact))
      call self%update_deviate(contact)
      call self%take_out(contact)
      self%life(life_clock, contact) = real(clocks + 1 - old, wp)
      call self%put(contact)
   end subroutine change_clock

   !> Solve the key of a contact, and insert the contact into all orders.
   subroutine put(self, contact)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%set_key(contact)
      call self%insert(contact)
      self%behind = max(self%behind, self%behind_of(contact))
   end subroutine put

   !> Insert a contact with a key into all orders.
   subroutine insert(self, contact)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: number

      if (self%is_steady) then
         call self%order(self%ahead)%put(contact, &
            & self%direction * self%record(row_origin, contact) &
            & + min(self%life(life_key, contact), self%record(row_limit, contact)))
         return
      end if
      number = int(self%life(life_clock, contact))
      call self%order(motions + number)%put(contact, self%life(life_key, contact))
      associate (origin => self%record(row_origin, contact), bound => self%bound(contact))
         call self%order(self%ahead)%put(contact, self%direction * origin &
            & + self%distance(number, bound, self%direction))
         call self%order(3 - self%ahead)%put(contact, -(self%direction * origin &
            & - self%distance(number, bound, -self%direction)))
      end associate
      self%members(number) = self%members(number) + 1
   end subroutine insert

   !> Take a contact out of all orders.
   subroutine take_out(self, contact)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: number

      if (self%is_steady) then
         call self%order(self%ahead)%remove(contact)
         return
      end if
      number = int(self%life(life_clock, contact))
      call self%order(motions + number)%remove(contact)
      call self%order(1)%remove(contact)
      call self%order(2)%remove(contact)
      self%members(number) = self%members(number) - 1
   end subroutine take_out

   !> Distance from the origin of a contact [m] to its next event in a direction, given its clock
   !> and its breaking stretch [m]: a break at the threshold, or a move to the other clock.
   pure function distance(self, number, limit, direction)
      class(thermal_keys_type), intent(in) :: self
      integer, intent(in) :: number
      real(wp), intent(in) :: limit, direction
      real(wp) :: distance

      distance = merge(limit, self%hazard%turn_stretch(limit), &
         & force_sign(number) * direction > 0.0_wp)
   end function distance

   !> Bound on the stretch at which a contact breaks [m]: its limit, but for kinds whose limits are
   !> older.
   pure function bound(self, contact)
      class(thermal_keys_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: bound

      bound = self%record(row_limit, contact)
   end function bound

   !> Put contacts that are not in the order ahead back into it: none here.
   subroutine gather_ahead(self)
      class(thermal_keys_type), intent(inout) :: self

   end subroutine gather_ahead

   !> Also where it moves to the other clock.
   pure function behind_of(self, contact) result(coordinate)
      class(thermal_keys_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: coordinate

      coordinate = self%direction * self%record(row_origin, contact) &
         & - self%distance(int(self%life(life_clock, contact)), self%bound(contact), &
         & -self%direction)
   end function behind_of

   !> Solve the key of a contact from its remaining deviate.
   subroutine set_key(self, contact)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%life(life_key, contact) = self%hazard%key(int(self%life(life_clock, contact)), &
         & self%life(life_left, contact), self%record(row_limit, contact), &
         & self%record(row_origin, contact))
   end subroutine set_key

   !> Set the remaining deviate of a contact to the present one.
   subroutine update_deviate(self, contact)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%life(life_left, contact) = self%hazard%left(int(self%life(life_clock, contact)), &
         & self%life(life_key, contact), self%life(life_left, contact), &
         & self%record(row_limit, contact), self%record(row_origin, contact))
   end subroutine update_deviate

   !> Raise the limit of a contact whose force is along the motion [m], and solve its key again. In
   !> the order of the way back it stays where it was: there it moves to the other clock. The caller
   !> updates the order ahead.
   subroutine raise_limit(self, contact, limit)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: limit

      call self%update_deviate(contact)
      self%record(row_limit, contact) = limit
      call self%set_key(contact)
      call self%order(motions + int(self%life(life_clock, contact)))%put(contact, &
         & self%life(life_key, contact))
   end subroutine raise_limit

   !> Move the reference of a clock to the slider [m], if it is far or no contact belongs to the
   !> clock.
   subroutine move_reference(self, number, displacement)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: number
      real(wp), intent(in) :: displacement

      real(wp) :: exponent, reading
      logical :: far, has_keys
      integer :: contact

      has_keys = self%members(number) == 0
      exponent = self%hazard%rate_exponent(number, displacement)
      reading = self%hazard%reading(number)
      if (.not. has_keys) then
         call self%hazard%is_far(number, displacement, far)
         if (.not. far) return
         ! The part of a key beyond the reading changes by one factor for all.
         if (abs(exponent) < max_rescaling) call self%order(motions + number)%rescale(reading, &
            & exp(-exponent), self%members(number), has_keys)
         if (has_keys) then
            call rescale_lives(self, number, reading, exp(-exponent))
         else
            do contact = 1, self%parameters%count
               if (int(self%life(life_clock, contact)) == number) call self%update_deviate(contact)
            end do
         end if
      end if
      self%hazard%reference(number) = displacement
      self%hazard%reading(number) = 0.0_wp
      self%hazard%max_exponent(number) = 0.0_wp
      if (.not. has_keys) call set_keys(self, number)
   end subroutine move_reference

   !> Rescale the keys in the lives of the contacts of a clock as those in its order.
   subroutine rescale_lives(self, number, reading, factor)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: number
      real(wp), intent(in) :: reading, factor

      integer :: contact

      do contact = 1, self%parameters%count
         associate (life => self%life(:, contact))
            if (int(life(life_clock)) /= number .or. .not. life(life_key) < never) cycle
            life(life_key) = (life(life_key) - reading) * factor
         end associate
      end do
   end subroutine rescale_lives

   !> Solve the keys of the contacts of a clock.
   subroutine set_keys(self, number)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: number

      integer :: contact

      call self%order(motions + number)%clear()
      do contact = 1, self%parameters%count
         if (int(self%life(life_clock, contact)) /= number) cycle
         call self%set_key(contact)
         call self%order(motions + number)%put(contact, self%life(life_key, contact))
      end do
   end subroutine set_keys

   !> Reverse the direction ahead if the slider at a displacement [m] has reached an event on the
   !> way back.
   subroutine reverse_if_due(self, displacement)
      class(thermal_keys_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      if (self%direction * displacement > self%behind) return
      ! The bound may be that of a contact that has broken since.
      self%behind = -self%order(3 - self%ahead)%lowest()
      if (self%direction * displacement > self%behind) return
      call self%gather_ahead()
      self%ahead = 3 - self%ahead
      self%direction = -self%direction
      self%behind = -self%order(3 - self%ahead)%lowest()
      if (self%direction > 0.0_wp) call self%order(2)%rest()
   end subroutine reverse_if_due

   !> Make all orders again from the records. A kind calls this for its own type, not that of its
   !> parent, whose bounds are others.
   subroutine rebuild_thermal(self, displacement)
      class(thermal_keys_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      integer :: contact

      call self%clear_orders()
      do contact = 1, self%parameters%count
         if (self%record(row_stiffness, contact) > 0.0_wp) call self%insert(contact)
      end do
   end subroutine rebuild_thermal

   !> Clear all orders, for the present direction of motion.
   subroutine clear_orders(self)
      class(thermal_keys_type), intent(inout) :: self

      integer :: number

      self%ahead = merge(1, 2, self%direction > 0.0_wp)
      self%members = 0
      do number = 1, size(self%order)
         call self%order(number)%clear()
      end do
   end subroutine clear_orders

   !> Shift the references of the clocks.
   subroutine shift_order(self, shift)
      class(thermal_keys_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      self%hazard%reference = self%hazard%reference - shift
   end subroutine shift_order

   !> Exchange what all thermal contacts keep.
   subroutine exchange_thermal(self, archive)
      class(thermal_keys_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      integer :: number

      call archive%section("thermal contacts")
      call exchange_individual(self, archive)
      call archive%exchange("life", self%life)
      call archive%exchange("is_steady", self%is_steady)
      call archive%exchange("velocity", self%velocity)
      do number = 1, clocks
         call archive%exchange("reading", self%hazard%reading(number))
         call archive%exchange("reference", self%hazard%reference(number))
         call archive%exchange("max_exponent", self%hazard%max_exponent(number))
      end do
   end subroutine exchange_thermal

end module mesoslip_contacts_thermal_keys
