!> Reasons for the end of a run, and conditions that end it before its drive.
module mesoslip_loop_endings
   use mesoslip_interface_law, only: window_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: name_length
   use mesoslip_schedule, only: schedule_type
   use mesoslip_sliders_base, only: slider_type
   implicit none
   private

   public :: stop_type
   public :: ending_none, ending_drive, ending_avalanches, ending_broken, ending_slides, &
      & ending_slips, ending_displacement, ending_steady, ending_names

   !> Reason for the end of a run: not ended; end of the drive; number of avalanches; all contacts
   !> broken; contacts break under a force without end; number of slips; displacement; steady state
   integer, parameter :: ending_none = 0, ending_drive = 1, ending_avalanches = 2, &
      & ending_broken = 3, ending_slides = 4, ending_slips = 5, ending_displacement = 6, &
      & ending_steady = 7
   !> Names of the ending_ codes
   character(len=*), parameter :: ending_names(0:7) = [character(len=name_length) :: "", "drive", &
      & "avalanches", "broken", "slides", "slips", "displacement", "steady"]

   !> Conditions that end a run: a number of slips, a displacement.
   type :: stop_type
      !> Number of slips
      integer(i8) :: max_slips = huge(1_i8)
      !> Displacement of the slider [m]; 0 for none
      real(wp) :: displacement = 0.0_wp
   contains
      procedure, non_overridable :: is_reached
      procedure, non_overridable :: limit_window
      procedure, non_overridable :: limit_schedule
   end type stop_type

contains

   !> Whether a slider has reached the displacement.
   pure function is_reached(self, slider)
      class(stop_type), intent(in) :: self
      class(slider_type), intent(in) :: slider
      logical :: is_reached

      is_reached = abs(self%displacement) > 0.0_wp .and. sign(1.0_wp, self%displacement) &
         & * (slider%displacement - (self%displacement - slider%origin)) >= 0.0_wp
   end function is_reached

   !> End a window at the displacement.
   pure subroutine limit_window(self, window, origin)
      class(stop_type), intent(in) :: self
      type(window_type), intent(inout) :: window
      !> Origin of its displacements [m]
      real(wp), intent(in) :: origin

      if (self%displacement > 0.0_wp) then
         window%upper = min(window%upper, self%displacement - origin)
      else if (self%displacement < 0.0_wp) then
         window%lower = max(window%lower, self%displacement - origin)
      end if
   end subroutine limit_window

   !> End a schedule before the displacement.
   pure subroutine limit_schedule(self, schedule, origin)
      class(stop_type), intent(in) :: self
      type(schedule_type), intent(inout) :: schedule
      !> Origin of its displacements [m]
      real(wp), intent(in) :: origin

      real(wp) :: displacement, direction

      if (schedule%is_over .or. .not. abs(self%displacement) > 0.0_wp) return
      displacement = self%displacement - origin
      direction = sign(1.0_wp, self%displacement)
      if (direction * schedule%direction > 0.0_wp) then
         schedule%unlisted = min(schedule%unlisted, direction * displacement)
         if (schedule%has_candidates .and. direction > 0.0_wp) then
            schedule%upper = min(schedule%upper, displacement)
         else if (schedule%has_candidates) then
            schedule%lower = max(schedule%lower, displacement)
         end if
         ! Those end there, and contacts beyond may break before.
         if (schedule%has_growth .or. schedule%has_candidates .and. .not. schedule%has_entries) then
            return
         end if
         do while (schedule%breaks > 0)
            if (schedule%break_coordinate(schedule%breaks) < direction * displacement) exit
            schedule%breaks = schedule%breaks - 1
         end do
         schedule%is_over = schedule%breaks == 0
      else
         schedule%behind = max(schedule%behind, schedule%direction * displacement)
      end if
   end subroutine limit_schedule

end module mesoslip_loop_endings
