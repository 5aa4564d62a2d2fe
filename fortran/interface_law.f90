!> What contacts offer a slider, a linear law of the contact force, and what they learn of it.
module mesoslip_interface_law
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: interface_law_type, pose_type, window_type

   !> Force of the contacts on the slider, F = stiffness x - offset + drag v + rate (t - t_0), t_0
   !> being the time at which the slider is offered it.
   type :: interface_law_type
      !> Total stiffness of the pinned contacts, K_c [N/m]
      real(wp) :: stiffness = 0.0_wp
      !> Sum of stiffness times origin of the pinned contacts, S [N]
      real(wp) :: offset = 0.0_wp
      !> Total drag of the detached contacts, C [N s/m]
      real(wp) :: drag = 0.0_wp
      !> Rate of the force by what attaches, none where contacts are counted one by one [N/s]
      real(wp) :: rate = 0.0_wp
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

   !> Where a slider is.
   type :: pose_type
      !> Time [s], displacement [m], velocity [m/s], acceleration [m/s2]
      real(wp) :: time = 0.0_wp, displacement = 0.0_wp, velocity = 0.0_wp, acceleration = 0.0_wp
      !> Sign of the last velocity that was not zero, +1 or -1
      real(wp) :: direction = 1.0_wp
      !> One over the mass that the contact force moves [1/kg], and the rate of the slider's own
      !> oscillation [1/s]; 0 for a slider of which the motion is prescribed
      real(wp) :: inverse_mass = 0.0_wp, own_rate = 0.0_wp
   end type pose_type

end module mesoslip_interface_law
