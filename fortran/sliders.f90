!> The kinds of sliders by name: the only place that knows them all.
module mesoslip_sliders
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_sliders_base, only: slider_type
   use mesoslip_sliders_layered, only: make_slider_layered
   use mesoslip_sliders_prescribed, only: make_slider_prescribed
   use mesoslip_sliders_quasistatic, only: make_slider_quasistatic
   use mesoslip_sliders_quasistatic_force, only: make_slider_quasistatic_force
   use mesoslip_sliders_rigid, only: make_slider_rigid
   implicit none
   private

   public :: make_slider

contains

   !> Set up a slider of a kind.
   subroutine make_slider(slider, kind, parameters, error)
      !> The slider
      class(slider_type), allocatable, intent(out) :: slider
      !> Its kind
      character(len=*), intent(in) :: kind
      !> What it is made of, each number by its name
      type(parameters_type), intent(inout) :: parameters
      !> Set if there is no such kind, or a number is missing, superfluous or wrong
      type(error_type), allocatable, intent(out) :: error

      select case (kind)
      case ("rigid")
         call make_slider_rigid(slider, parameters, error)
      case ("layered")
         call make_slider_layered(slider, parameters, error)
      case ("prescribed")
         call make_slider_prescribed(slider, parameters, error)
      case ("quasistatic")
         call make_slider_quasistatic(slider, parameters, error)
      case ("quasistatic_force")
         call make_slider_quasistatic_force(slider, parameters, error)
      case default
         call raise(error, status_invalid, "unknown kind of slider '" // kind // "'")
      end select
   end subroutine make_slider

end module mesoslip_sliders
