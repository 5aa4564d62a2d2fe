!> Selects the steps of a slider that recorders need while it runs through a schedule.
module mesoslip_step_filter
   use mesoslip_numerics_kinds, only: i8, wp
   implicit none
   private

   public :: step_filter_type

   !> A step is skipped if it ends before a time, with the excess of the velocity over a reference
   !> in an interval.
   type :: step_filter_type
      !> Time from which steps are selected [s]
      real(wp) :: time = huge(1.0_wp)
      !> Reference velocity of the excess [m/s], and direction in which it counts, +1 or -1
      real(wp) :: reference = 0.0_wp, direction = 1.0_wp
      !> Interval of the excess, min_excess < excess <= max_excess [m/s]
      real(wp) :: min_excess = -huge(1.0_wp), max_excess = huge(1.0_wp)
      !> Whether steps with a maximum of the velocity are selected
      logical :: selects_peaks = .false.
      !> Maximum number of steps
      integer(i8) :: max_steps = huge(1_i8)

      !> Number of steps made, and whether the last one is selected
      integer(i8) :: steps = 0
      logical :: is_selected = .false.
      !> Whether steps were skipped; time and excess at the end of the last of them, maximum of the
      !> velocity along the direction at the ends of all
      logical :: has_skipped = .false.
      real(wp) :: skipped_time = 0.0_wp, skipped_excess = 0.0_wp, max_velocity = -huge(1.0_wp)
   contains
      !> Select or skip a step
      procedure, non_overridable :: examine
   end type step_filter_type

contains

   !> Select a step, or skip it.
   pure subroutine examine(self, time, velocity, start_acceleration, acceleration)
      class(step_filter_type), intent(inout) :: self
      !> Time [s] and velocity [m/s] at the end of the step, accelerations at its start and at its
      !> end [m/s2]
      real(wp), intent(in) :: time, velocity, start_acceleration, acceleration

      real(wp) :: excess

      self%steps = self%steps + 1
      excess = self%direction * (velocity - self%reference)
      self%is_selected = time >= self%time &
         & .or. .not. (excess > self%min_excess .and. excess <= self%max_excess)
      if (self%selects_peaks) then
         self%is_selected = self%is_selected .or. (self%direction * start_acceleration > 0.0_wp &
            & .and. self%direction * acceleration < 0.0_wp)
      end if
      if (self%is_selected) return
      self%has_skipped = .true.
      self%skipped_time = time
      self%skipped_excess = excess
      self%max_velocity = max(self%max_velocity, self%direction * velocity)
   end subroutine examine

end module mesoslip_step_filter
