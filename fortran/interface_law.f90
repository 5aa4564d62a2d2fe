!> The force law that contacts offer a slider, linear in displacement and velocity, with clocks; the
!> pose of the slider that contacts are given.
module mesoslip_interface_law
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: hazard_clock_type, interface_law_type, pose_type, window_type
   public :: clocks

   !> Number of clocks: of contacts under positive and under negative force
   integer, parameter :: clocks = 2

   !> Force of the contacts on the slider, F = stiffness x - offset + drag v + rate (t - t_0), t_0
   !> being the time of the offer.
   type :: interface_law_type
      !> Total stiffness of the pinned contacts, K_c [N/m]
      real(wp) :: stiffness = 0.0_wp
      !> Sum of stiffness times origin of the pinned contacts, S [N]
      real(wp) :: offset = 0.0_wp
      !> Total drag of the detached contacts, C [N s/m]
      real(wp) :: drag = 0.0_wp
      !> Rate of the force due to attaching contacts [N/s]; 0 for individual contacts
      real(wp) :: rate = 0.0_wp
      !> Force below which oscillation is not distinguished from rest [N]
      real(wp) :: tolerance = 0.0_wp
   end type interface_law_type

   !> Displacements between which a law holds, until a time.
   type :: window_type
      !> Displacement above the slider's at which a contact breaks [m]
      real(wp) :: upper = huge(1.0_wp)
      !> Displacement below the slider's at which a contact may break [m]
      real(wp) :: lower = -huge(1.0_wp)
      !> Time at which the law ends [s]
      real(wp) :: end_time = huge(1.0_wp)
      !> Maximum duration of an advance by a series, over the time in which the slider oscillates by
      !> a radian or is damped
      real(wp) :: max_phase = 0.5_wp
      !> Whether most steps end in time, so that a short one may turn round
      logical :: may_turn = .false.
   end type window_type

   !> Time and motion of a slider.
   type :: pose_type
      !> Time [s], displacement [m], velocity [m/s], acceleration [m/s2]
      real(wp) :: time = 0.0_wp, displacement = 0.0_wp, velocity = 0.0_wp, acceleration = 0.0_wp
      !> Sign of the last velocity that was not zero, +1 or -1
      real(wp) :: direction = 1.0_wp
      !> One over the mass that the contact force moves [1/kg], and the angular frequency of the
      !> slider's own oscillation [1/s]; 0 for a slider of prescribed motion
      real(wp) :: inverse_mass = 0.0_wp, own_rate = 0.0_wp
      !> Whether the slider keeps its velocity until the drive changes
      logical :: is_uniform = .false.
      !> Whether all that changes its acceleration is known, as follows
      logical :: is_known = .false.
      !> Velocity [m/s3] and acceleration [m/s4] of the drive, times the square of the own rate
      real(wp) :: driving = 0.0_wp, driving_rate = 0.0_wp
      !> Damping rate [1/s], and deceleration by the damper [m/s2]
      real(wp) :: damping = 0.0_wp, damper = 0.0_wp
   end type pose_type

   !> A clock of thermally activated breaking. The rate of a contact that bears the force f is
   !> omega_0 exp((abs(f) - f_s)/f_T) (Bell's law). For contacts of one stiffness whose forces have
   !> one sign it is proportional to one function of the displacement, exp(slope X). A contact
   !> breaks when the time integral of that function has increased by an amount of its own.
   type :: hazard_clock_type
      !> Whether it has contacts
      logical :: is_used = .false.
      !> Change of the exponent with the displacement of the slider [1/m]
      real(wp) :: slope = 0.0_wp
      !> Rate of the clock at the displacement of the slider [1/s]
      real(wp) :: rate = 0.0_wp
      !> Remaining increase until the next contact breaks; huge if no contact does
      real(wp) :: left = huge(1.0_wp)
      !> Increase in the last advance
      real(wp) :: elapsed = 0.0_wp
      !> Whether the last advance ended where a contact breaks
      logical :: is_due = .false.
   end type hazard_clock_type

end module mesoslip_interface_law
