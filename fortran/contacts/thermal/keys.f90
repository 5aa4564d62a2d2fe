!> Contacts that break by thermal activation: their clocks, keys and order.
!>
!> A contact goes by the clock of the sign of its force. Its key is the reading at which it breaks,
!> relative to a reference displacement near the slider's, which moves along. In a motion ahead, the
!> direction that is kept until something happens on the way back, a contact comes to its threshold,
!> or to where its force changes its sign; on the way back that is bounded.
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

   public :: thermal_keys_type, set_up_keys, exchange_thermal
   public :: life_clock, life_left, life_key, life_next, motions

   !> Stretch over the mean breaking stretch beyond zero at which the sign of a force changes: less
   !> than matters, and more than rounding
   real(wp), parameter :: tiny_stretch = 1.0e-12_wp
   !> Maximum change of the exponents up to which keys are rescaled rather than solved again
   real(wp), parameter :: max_rescaling = 310.0_wp
   !> Numbers of the life of a contact: the clock it goes by, none while it is detached, what was
   !> left of its deviate when its key was made, the key, and the deviate of its next life, or 0 if
   !> that has not been drawn
   integer, parameter :: life_length = 4
   integer, parameter :: life_clock = 1, life_left = 2, life_key = 3, life_next = 4

   !> Directions of motion, the orders of which come before those of the clocks
   integer, parameter :: motions = 2

   !> Contacts that break by thermal activation, in order.
   type, abstract, extends(individual_contacts_type) :: thermal_keys_type
      !> The clocks
      type(hazard_type) :: hazard
      !> Mean breaking stretch [m]
      real(wp) :: stretch = 1.0_wp
      !> Numbers of their lives, shape (life_length, count)
      real(wp), allocatable :: life(:, :)
      !> Contacts in the order of what comes next in a motion up and down, a break at the threshold
      !> or a change of the force's sign, then in that of their keys by each clock. In one array, as
      !> of two components of this type gfortran 12 frees only one
      type(scan_order_type) :: order(motions + clocks)
      !> The order of a motion ahead
      integer :: ahead = 1
      !> Number of contacts that go by each clock
      integer :: members(clocks) = 0
      !> Whether the slider moves uniformly, and its velocity then [m/s]. The key of a contact is
      !> the stretch along the motion at which its deviate is used up, and it is in the order of a
      !> motion ahead alone
      logical :: is_steady = .false.
      real(wp) :: velocity = 0.0_wp
   contains
      procedure :: rebuild
      procedure :: shift_order
      procedure :: behind_of
      !> Find what is left of the deviate of a contact now
      procedure, non_overridable :: settle_deviate
      !> Put a contact into all orders, and take it out
      procedure, non_overridable :: put, take_out
      !> Put a contact with a key into all orders
      procedure, non_overridable :: place
      !> The force of a contact changes its sign
      procedure, non_overridable :: change_sign
      !> Distance ahead of its origin at which something happens to a contact
      procedure, non_overridable :: distance_ahead
      !> Coordinate behind which nothing happens to a contact at first
      procedure, non_overridable :: distance_behind
      !> Move the reference of a clock to the slider
      procedure, non_overridable :: move_reference
      !> Turn to the other direction of motion
      procedure, non_overridable :: turn_round
      procedure, non_overridable, private :: set_key
   end type thermal_keys_type

contains

   !> Set up contacts that break by thermal activation.
   subroutine set_up_keys(self, parameters, error)
      class(thermal_keys_type), intent(inout) :: self
      !> The other numbers: columns and rows, rate and force of activation
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong, or there is not enough memory
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
      do number = 1, clocks
         if (.not. allocated(error)) then
            call new_scan_order(self%order(number), self%parameters%count, error)
         end if
         if (.not. allocated(error)) then
            call new_scan_order(self%order(motions + number), self%parameters%count, error)
         end if
      end do
   end subroutine set_up_keys

   !> The force of a contact changes its sign: what is left of its deviate goes by the other clock.
   subroutine change_sign(self, contact)
      class(thermal_keys_type), intent(inout) :: self
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
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%set_key(contact)
      call self%place(contact)
      self%behind = max(self%behind, self%behind_of(contact))
   end subroutine put

   !> Put a contact with a key into all orders.
   subroutine place(self, contact)
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
      associate (origin => self%record(row_origin, contact), &
         & limit => self%record(row_limit, contact))
         call self%order(self%ahead)%put(contact, self%direction * origin &
            & + self%distance_ahead(number, limit))
         call self%order(3 - self%ahead)%put(contact, -(self%direction * origin &
            & - self%distance_behind(number, limit)))
      end associate
      self%members(number) = self%members(number) + 1
   end subroutine place

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

   !> Distance ahead of its origin at which a contact breaks at its threshold, or its force gets the
   !> sign of the motion.
   pure function distance_ahead(self, number, limit) result(distance)
      class(thermal_keys_type), intent(in) :: self
      !> The clock it goes by
      integer, intent(in) :: number
      !> Stretch at which it breaks [m]
      real(wp), intent(in) :: limit
      real(wp) :: distance

      distance = merge(limit, tiny_stretch * self%stretch, &
         & force_sign(number) * self%direction > 0.0_wp)
   end function distance_ahead

   !> The same on the way back.
   pure function distance_behind(self, number, limit) result(distance)
      class(thermal_keys_type), intent(in) :: self
      !> The clock it goes by
      integer, intent(in) :: number
      !> Stretch at which it breaks [m]
      real(wp), intent(in) :: limit
      real(wp) :: distance

      distance = merge(tiny_stretch * self%stretch, limit, &
         & force_sign(number) * self%direction > 0.0_wp)
   end function distance_behind

   !> Coordinate at which a pinned contact breaks on the way back, or its force changes its sign.
   pure function behind_of(self, contact) result(coordinate)
      class(thermal_keys_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: coordinate

      coordinate = self%direction * self%record(row_origin, contact) &
         & - self%distance_behind(int(self%life(life_clock, contact)), &
         & self%record(row_limit, contact))
   end function behind_of

   !> Set the key of a contact from what is left of its deviate.
   subroutine set_key(self, contact)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%life(life_key, contact) = self%hazard%key(int(self%life(life_clock, contact)), &
         & self%life(life_left, contact), self%record(row_limit, contact), &
         & self%record(row_origin, contact))
   end subroutine set_key

   !> Find what is left of the deviate of a contact now.
   subroutine settle_deviate(self, contact)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: contact

      self%life(life_left, contact) = self%hazard%left(int(self%life(life_clock, contact)), &
         & self%life(life_key, contact), self%life(life_left, contact), &
         & self%record(row_limit, contact), self%record(row_origin, contact))
   end subroutine settle_deviate

   !> Move the reference of a clock to the slider, if that is far from it or no contact goes by it.
   subroutine move_reference(self, number, displacement)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: number
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      real(wp) :: exponent, reading
      logical :: far, is_done

      is_done = self%members(number) == 0
      exponent = self%hazard%rate_exponent(number, displacement)
      reading = self%hazard%reading(number)
      if (.not. is_done) then
         call self%hazard%is_far(number, displacement, far)
         if (.not. far) return
         ! The rest of the deviate until a key changes by one factor for all.
         if (abs(exponent) < max_rescaling) call self%order(motions + number)%rescale(reading, &
            & exp(-exponent), self%members(number), is_done)
         if (is_done) then
            call rescale_lives(self, number, reading, exp(-exponent))
         else
            call settle_deviates(self, number)
         end if
      end if
      self%hazard%reference(number) = displacement
      self%hazard%reading(number) = 0.0_wp
      self%hazard%max_exponent(number) = 0.0_wp
      if (.not. is_done) call set_keys(self, number)
   end subroutine move_reference

   !> Count the keys in the lives of the contacts of a clock from its reading, in another unit.
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

   !> Find what is left of the deviates of the contacts of a clock now.
   subroutine settle_deviates(self, number)
      class(thermal_keys_type), intent(inout) :: self
      integer, intent(in) :: number

      integer :: contact

      do contact = 1, self%parameters%count
         if (int(self%life(life_clock, contact)) == number) call self%settle_deviate(contact)
      end do
   end subroutine settle_deviates

   !> Set the keys of the contacts of a clock.
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

   !> Turn to the other direction of motion, if something happens to a contact where the slider is
   !> on the way back: the bound may be that of a contact which has broken since.
   subroutine turn_round(self, displacement)
      class(thermal_keys_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      if (self%direction * displacement > self%behind) return
      self%behind = -self%order(3 - self%ahead)%lowest()
      if (self%direction * displacement > self%behind) return
      self%ahead = 3 - self%ahead
      self%direction = -self%direction
      self%behind = -self%order(3 - self%ahead)%lowest()
      if (self%direction > 0.0_wp) call self%order(2)%rest()
   end subroutine turn_round

   subroutine rebuild(self, displacement)
      class(thermal_keys_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      integer :: contact, number

      self%ahead = merge(1, 2, self%direction > 0.0_wp)
      do number = 1, clocks
         call self%order(number)%clear()
         call self%order(motions + number)%clear()
      end do
      self%members = 0
      do contact = 1, self%parameters%count
         if (self%record(row_stiffness, contact) > 0.0_wp) call self%place(contact)
      end do
   end subroutine rebuild

   !> Move the references of the clocks.
   subroutine shift_order(self, shift)
      class(thermal_keys_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      self%hazard%reference = self%hazard%reference - shift
   end subroutine shift_order

   !> Put what all thermal contacts keep into an archive or take it out.
   subroutine exchange_thermal(self, archive)
      class(thermal_keys_type), intent(inout) :: self
      !> The archive
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
