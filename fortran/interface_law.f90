!> What contacts offer a slider: a linear law of the contact force, and where it ends.
module mesoslip_interface_law
   use mesoslip_kinds, only: wp
   implicit none
   private

   public :: interface_law_type, window_type

   !> Force of the contacts on the slider, F = stiffness x - offset + drag v.
   type :: interface_law_type
      !> Total stiffness of the pinned contacts, K_c [N/m]
      real(wp) :: stiffness = 0.0_wp
      !> Sum of stiffness times origin of the pinned contacts, S [N]
      real(wp) :: offset = 0.0_wp
      !> Total drag of the detached contacts, C [N s/m]
      real(wp) :: drag = 0.0_wp
   end type interface_law_type

   !> The law holds while the slider is between two displacements, until a time.
   type :: window_type
      !> Displacement above the slider's at which a contact breaks [m]
      real(wp) :: upper = huge(1.0_wp)
      !> Displacement below the slider's at which a contact may break [m]
      real(wp) :: lower = -huge(1.0_wp)
      !> Time at which the law ends [s]
      real(wp) :: end_time = huge(1.0_wp)
   end type window_type

end module mesoslip_interface_law
