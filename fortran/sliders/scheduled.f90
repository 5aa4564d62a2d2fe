!> Sliders that run through a schedule of many events at once, recorded at steps of interest only.
module mesoslip_sliders_scheduled
   use mesoslip_schedule, only: schedule_type
   use mesoslip_sliders_base, only: slider_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: scheduled_slider_type

   !> A slider that can run through a schedule while its drive does not accelerate.
   type, abstract, extends(slider_type) :: scheduled_slider_type
   contains
      procedure(run_ahead_interface), deferred :: run_ahead
   end type scheduled_slider_type

   abstract interface
      !> Move through a schedule until it ends, or until a step is of interest. What is due at the
      !> end of a step of interest, or after a turn, has not happened yet.
      subroutine run_ahead_interface(self, schedule, filter)
         import :: scheduled_slider_type, schedule_type, step_filter_type
         implicit none
         class(scheduled_slider_type), intent(inout) :: self
         !> Coming changes of the contact force
         type(schedule_type), intent(inout) :: schedule
         !> Which steps are of interest, and how many to make at most
         type(step_filter_type), intent(inout) :: filter
      end subroutine run_ahead_interface
   end interface

end module mesoslip_sliders_scheduled
