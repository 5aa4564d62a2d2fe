!> What a slider that runs ahead stops at, for the recorder to look at its motion there.
module mesoslip_watch
   use mesoslip_numerics_kinds, only: i8, wp
   implicit none
   private

   public :: watch_type

   !> Steps end with nothing of interest while the excess of the velocity over a reference stays in
   !> an interval, and a time has not come.
   type :: watch_type
      !> Time that is of interest [s]
      real(wp) :: time = huge(1.0_wp)
      !> Velocity from which the excess is counted, in a sense, +1 or -1 [m/s]
      real(wp) :: reference = 0.0_wp, sense = 1.0_wp
      !> Interval of the excess, above < excess <= upto [m/s]
      real(wp) :: above = -huge(1.0_wp), upto = huge(1.0_wp)
      !> Whether a greatest velocity within a step is of interest
      logical :: peaks = .false.
      !> Steps after which to stop in any case
      integer(i8) :: most_steps = huge(1_i8)

      !> Steps made, and whether the last one is of interest
      integer(i8) :: steps = 0
      logical :: is_caught = .false.
      !> Whether steps were passed over; time and excess at the end of the last of them, greatest
      !> velocity in the sense at the ends of all
      logical :: has_passed = .false.
      real(wp) :: passed_time = 0.0_wp, excess = 0.0_wp, fastest = -huge(1.0_wp)
   contains
      !> Look at the end of a step
      procedure, non_overridable :: look
   end type watch_type

contains

   !> Look at the end of a step, and pass over it if it is of no interest.
   pure subroutine look(self, time, velocity, start_acceleration, acceleration)
      !> The watch
      class(watch_type), intent(inout) :: self
      !> Time [s], velocity [m/s], accelerations at the start and at the end of the step [m/s2]
      real(wp), intent(in) :: time, velocity, start_acceleration, acceleration

      real(wp) :: excess

      self%steps = self%steps + 1
      excess = self%sense * (velocity - self%reference)
      self%is_caught = time >= self%time .or. .not. (excess > self%above .and. excess <= self%upto)
      if (self%peaks) then
         self%is_caught = self%is_caught .or. (self%sense * start_acceleration > 0.0_wp &
            & .and. self%sense * acceleration < 0.0_wp)
      end if
      if (self%is_caught) return
      self%has_passed = .true.
      self%passed_time = time
      self%excess = excess
      self%fastest = max(self%fastest, self%sense * velocity)
   end subroutine look

end module mesoslip_watch
