!> Why a run is over, and what stops it before its drive ends.
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

   !> Why a run is over: it is not; the drive came to its end; there were as many avalanches as
   !> wanted; no contact is left to break; contacts break under a force without end; there were as
   !> many slips as wanted; the slider came to its displacement; the state is steady
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
      !> Whether a slider has come to the displacement
      procedure, non_overridable :: is_reached
      !> Let a window, or a schedule, end there
      procedure, non_overridable :: limit_window
      procedure, non_overridable :: limit_schedule
   end type stop_type

contains

   !> Whether a slider has come to the displacement.
   pure function is_reached(self, slider)
      !> Conditions that end the run
      class(stop_type), intent(in) :: self
      !> The slider
      class(slider_type), intent(in) :: slider
      !> Whether it has
      logical :: is_reached

      is_reached = abs(self%displacement) > 0.0_wp .and. sign(1.0_wp, self%displacement) &
         & * (slider%displacement - (self%displacement - slider%origin)) >= 0.0_wp
   end function is_reached

   !> Let a window end at the displacement.
   pure subroutine limit_window(self, window, origin)
      !> Conditions that end the run
      class(stop_type), intent(in) :: self
      !> The window
      type(window_type), intent(inout) :: window
      !> Origin of its displacements [m]
      real(wp), intent(in) :: origin

      if (self%displacement > 0.0_wp) then
         window%upper = min(window%upper, self%displacement - origin)
      else if (self%displacement < 0.0_wp) then
         window%lower = max(window%lower, self%displacement - origin)
      end if
   end subroutine limit_window

   !> Let a schedule end before the displacement.
   pure subroutine limit_schedule(self, schedule, origin)
      !> Conditions that end the run
      class(stop_type), intent(in) :: self
      !> The schedule
      type(schedule_type), intent(inout) :: schedule
      !> Origin of its displacements [m]
      real(wp), intent(in) :: origin

      real(wp) :: displacement, direction

      if (schedule%is_over .or. .not. abs(self%displacement) > 0.0_wp) return
      displacement = self%displacement - origin
      direction = sign(1.0_wp, self%displacement)
      if (direction * schedule%direction > 0.0_wp) then
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
