!> Readings of the clocks of thermally activated breaking, and the keys at which contacts break.
!>
!> A clock is the time integral of omega_0 exp(s k (X - R)/f_T), s being the sign of the forces of
!> its contacts and R a reference displacement near the slider's, so that exponents do not overflow.
!> A contact of origin Y and threshold f_s, with the remainder E of an exponential deviate, breaks
!> when its clock has advanced by E exp((f_s + s k (Y - R))/f_T).
module mesoslip_hazard
   use mesoslip_interface_law, only: clocks, hazard_clock_type, window_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: hazard_type, force_sign, never, max_clock_exponent

   !> Sign of the force of the contacts of each clock
   real(wp), parameter :: force_sign(clocks) = [1.0_wp, -1.0_wp]
   !> Key of a contact that does not break
   real(wp), parameter :: never = huge(1.0_wp)
   !> Maximum exponents: of a key, and of a clock before its reference moves
   real(wp), parameter :: max_key_exponent = 690.0_wp, max_clock_exponent = 300.0_wp
   !> Maximum decrease of an exponent of a clock before its reference moves: increments of the
   !> reading lose digits accordingly
   real(wp), parameter :: max_fall = 8.0_wp

   !> Rate of breaking that is negligible [1/s], one in 300 000 years, and the minimum of the rate
   !> at the threshold over it: for slower contacts less is negligible
   real(wp), parameter :: negligible_rate = 1.0e-13_wp, min_ratio = 1.0e14_wp
   !> Stretch over the mean breaking stretch at which the sign of a force changes: negligible, but
   !> larger than rounding errors; and maximum stretch at which it may count as changed, over that
   !> at breaking
   real(wp), parameter :: tiny_stretch = 1.0e-12_wp, max_turn_ratio = 0.9_wp
   !> Hazard that is negligible: it is below the rounding of a deviate
   real(wp), parameter :: negligible = 1.0e-16_wp
   !> Maximum exponent of the rate of a contact whose force changed its sign, over that without a
   !> force; minimum threshold of such a contact over the mean one; maximum force of such a contact
   !> over that minimum; and maximum exponent of the duration for which its hazard is negligible
   real(wp), parameter :: max_turn_exponent = 1.0_wp, min_turn_threshold = 0.9_wp, &
      & max_turn_force = 0.5_wp, max_duration_exponent = 300.0_wp

   !> The clocks.
   type :: hazard_type
      !> Rate at the threshold, omega_0 [1/s], and k/f_T [1/m]
      real(wp) :: rate = 0.0_wp, slope = 0.0_wp
      !> Whether each clock has contacts
      logical :: is_used(clocks) = .false.
      !> Reading of each clock since its reference was set [s], the reference [m], and the maximum
      !> exponent of its rate since then
      real(wp) :: reading(clocks) = 0.0_wp, reference(clocks) = 0.0_wp, &
         & max_exponent(clocks) = 0.0_wp
      !> Reading at which the next contact breaks [s]
      real(wp) :: next(clocks) = never
      !> Stretch against its clock at which a contact moves to the other one: its minimum [m], and
      !> the distance from there to breaking, where rates are negligible [m]
      real(wp) :: min_turn = 0.0_wp, quiet_distance = huge(1.0_wp)
      !> For forces that change their sign: maximum distance from there to where they are changed
      !> [m], minimum stretch at the threshold of such contacts [m], and maximum duration of the
      !> motion [s]
      real(wp) :: turn_distance = 0.0_wp, turn_limit = 0.0_wp, turn_duration = 0.0_wp
   contains
      !> Clocks for a slider, and their readings after it has advanced them
      procedure, non_overridable :: offer, advance
      !> End a window before an exponent overflows
      procedure, non_overridable :: limit_window
      !> Exponent of the rate of a clock, and whether its reference must move
      procedure, non_overridable :: rate_exponent, is_far
      !> Exponent of the factor between a deviate and the increase of the clock, the key of a
      !> contact, and its remaining deviate
      procedure, non_overridable :: life_exponent, key, left
      !> For forces that change their sign: stretch at which a contact moves to the other clock,
      !> which may be larger where its rate is negligible
      procedure, non_overridable :: turn_stretch, delay_turns
      !> Where and how long their hazard is negligible, and whether a motion is so fast that they
      !> need no step of their own
      procedure, non_overridable :: limit_turns, lets_turn_later
   end type hazard_type

contains

   !> Clocks for a slider.
   pure subroutine offer(self, displacement, clock)
      class(hazard_type), intent(in) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> The part that the slider advances
      type(hazard_clock_type), intent(inout) :: clock(clocks)

      integer :: number

      do number = 1, clocks
         clock(number)%slope = force_sign(number) * self%slope
         clock(number)%is_used = self%is_used(number)
         clock(number)%elapsed = 0.0_wp
         clock(number)%is_due = .false.
         clock(number)%left = huge(1.0_wp)
         if (.not. self%is_used(number)) cycle
         clock(number)%rate = self%rate * exp(self%rate_exponent(number, displacement))
         if (self%next(number) < never) then
            clock(number)%left = self%next(number) - self%reading(number)
         end if
      end do
   end subroutine offer

   !> Add the increase in an advance of the slider to the readings, and clear it.
   pure subroutine advance(self, clock)
      class(hazard_type), intent(inout) :: self
      !> The clocks after the advance
      type(hazard_clock_type), intent(inout) :: clock(clocks)

      integer :: number

      do number = 1, clocks
         if (clock(number)%is_due) then
            ! Exactly, so that the contact breaks.
            self%reading(number) = self%next(number)
         else
            self%reading(number) = self%reading(number) + clock(number)%elapsed
         end if
         clock(number)%elapsed = 0.0_wp
         clock(number)%is_due = .false.
      end do
   end subroutine advance

   !> End a window before an exponent overflows.
   pure subroutine limit_window(self, window)
      class(hazard_type), intent(in) :: self
      type(window_type), intent(inout) :: window

      if (self%is_used(1)) window%upper = min(window%upper, &
         & self%reference(1) + max_clock_exponent / self%slope)
      if (self%is_used(2)) window%lower = max(window%lower, &
         & self%reference(2) - max_clock_exponent / self%slope)
   end subroutine limit_window

   !> Exponent of the rate of a clock.
   pure function rate_exponent(self, number, displacement) result(exponent)
      class(hazard_type), intent(in) :: self
      integer, intent(in) :: number
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      real(wp) :: exponent

      exponent = force_sign(number) * self%slope * (displacement - self%reference(number))
   end function rate_exponent

   !> Whether the reference of a clock must move to the slider; keeps the maximum exponent.
   subroutine is_far(self, number, displacement, far)
      class(hazard_type), intent(inout) :: self
      integer, intent(in) :: number
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      logical, intent(out) :: far

      real(wp) :: exponent

      exponent = self%rate_exponent(number, displacement)
      self%max_exponent(number) = max(self%max_exponent(number), exponent)
      ! Rounding may leave the slider slightly before the bound of its window.
      far = exponent >= 0.999_wp * max_clock_exponent &
         & .or. exponent <= self%max_exponent(number) - max_fall
   end subroutine is_far

   !> Exponent of the factor between a contact's deviate and the increase of its clock.
   pure function life_exponent(self, number, limit, origin) result(exponent)
      class(hazard_type), intent(in) :: self
      !> Number of the contact's clock
      integer, intent(in) :: number
      !> Stretch at the threshold, and origin [m]
      real(wp), intent(in) :: limit, origin
      real(wp) :: exponent

      exponent = self%slope * (limit + force_sign(number) * (origin - self%reference(number)))
   end function life_exponent

   !> Stretch at which a contact whose force has changed its sign moves to the other clock [m].
   pure function turn_stretch(self, limit) result(stretch)
      class(hazard_type), intent(in) :: self
      !> Stretch at the threshold [m]
      real(wp), intent(in) :: limit
      real(wp) :: stretch

      stretch = max(self%min_turn, min(limit - self%quiet_distance, max_turn_ratio * limit))
   end function turn_stretch

   !> Let contacts stay in their clocks as long as their rates are negligible in both. A slider that
   !> rings moves most of them back and forth in this range.
   pure subroutine delay_turns(self)
      class(hazard_type), intent(inout) :: self

      self%quiet_distance = log(max(min_ratio, self%rate / negligible_rate)) / self%slope
   end subroutine delay_turns

   !> Set where and how long it makes no difference when a force changes its sign: the contact does
   !> not reach its threshold, and its hazard until then is negligible.
   pure subroutine limit_turns(self, stretch)
      class(hazard_type), intent(inout) :: self
      !> Mean stretch at the threshold [m]
      real(wp), intent(in) :: stretch

      self%min_turn = tiny_stretch * stretch
      self%turn_limit = min_turn_threshold * stretch
      ! Less than the distance to their thresholds.
      self%turn_distance = min(max_turn_exponent / self%slope, max_turn_force * self%turn_limit)
      self%turn_duration = negligible / self%rate * exp(min(max_duration_exponent, &
         & self%slope * self%turn_limit - max_turn_exponent))
   end subroutine limit_turns

   !> Whether the slider moves by the maximum distance in the maximum duration.
   pure function lets_turn_later(self, velocity)
      class(hazard_type), intent(in) :: self
      !> Velocity of the slider [m/s]
      real(wp), intent(in) :: velocity
      logical :: lets_turn_later

      lets_turn_later = abs(velocity) * self%turn_duration >= self%turn_distance
   end function lets_turn_later

   !> Reading at which a contact breaks; never if it overflows: it is computed again after the
   !> reference has moved.
   pure function key(self, number, left, limit, origin)
      class(hazard_type), intent(in) :: self
      !> Number of the contact's clock
      integer, intent(in) :: number
      !> Remaining deviate of the contact
      real(wp), intent(in) :: left
      !> Stretch at the threshold, and origin [m]
      real(wp), intent(in) :: limit, origin
      real(wp) :: key

      real(wp) :: exponent

      exponent = self%life_exponent(number, limit, origin)
      key = never
      if (exponent <= max_key_exponent) key = self%reading(number) + left * exp(exponent)
   end function key

   !> Remaining deviate of a contact now.
   pure function left(self, number, key, deviate, limit, origin)
      class(hazard_type), intent(in) :: self
      !> Number of the contact's clock
      integer, intent(in) :: number
      !> Reading at which it breaks [s], and the remaining deviate when that was computed
      real(wp), intent(in) :: key, deviate
      !> Stretch at the threshold, and origin [m]
      real(wp), intent(in) :: limit, origin
      real(wp) :: left

      left = deviate
      if (key < never) left = max(0.0_wp, key - self%reading(number)) &
         & * exp(-self%life_exponent(number, limit, origin))
   end function left

end module mesoslip_hazard
