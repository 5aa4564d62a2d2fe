!> Stiffness of a contact and the displacement that breaks it, by its relative threshold.
!>
!> Dimensionless: forces in units of the mean threshold f_s, stiffness in units of k, displacements
!> in units of f_s/k. A contact of threshold u that attached with the force beta bears the force
!> k(u) d + beta after a displacement d.
module mesoslip_contacts_mechanics
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: coupling_scaled, coupling_equal, coupling_table, coupling_names
   public :: delay_fixed, delay_exponential, delay_names
   public :: initial_relaxed, initial_steady, initial_uniform, initial_names
   public :: stiffness_of, breaking_distance, broken_threshold, broken_threshold_slope

   !> k_i = k u^(1/2), m_i = m u
   integer, parameter :: coupling_scaled = 1
   !> k_i = k, m_i = m
   integer, parameter :: coupling_equal = 2
   !> k_i from the table of thresholds, m_i = m k_i^2/<k^2>; not supported by the functions below
   integer, parameter :: coupling_table = 3
   !> Names of the coupling_ codes
   character(len=*), parameter :: coupling_names(3) = [character(len=6) :: "scaled", "equal", &
      & "table"]

   !> All contacts have the same delay
   integer, parameter :: delay_fixed = 1
   !> Each delay is drawn from the exponential law
   integer, parameter :: delay_exponential = 2
   !> Names of the delay_ codes
   character(len=*), parameter :: delay_names(2) = [character(len=11) :: "fixed", "exponential"]

   !> All stretches are zero
   integer, parameter :: initial_relaxed = 1
   !> The stationary state of slow sliding
   integer, parameter :: initial_steady = 2
   !> Stretches are uniform between zero and the breaking stretch
   integer, parameter :: initial_uniform = 3
   !> Names of the initial_ codes
   character(len=*), parameter :: initial_names(3) = [character(len=7) :: "relaxed", "steady", &
      & "uniform"]

contains

   !> Stiffness of a contact.
   elemental function stiffness_of(coupling, threshold) result(stiffness)
      !> One of the coupling_ codes
      integer, intent(in) :: coupling
      !> Relative threshold
      real(wp), intent(in) :: threshold
      !> Relative stiffness
      real(wp) :: stiffness

      stiffness = 1.0_wp
      if (coupling == coupling_scaled) stiffness = sqrt(threshold)
   end function stiffness_of

   !> Displacement after which a contact breaks.
   elemental function breaking_distance(coupling, start_force, threshold) result(distance)
      !> One of the coupling_ codes
      integer, intent(in) :: coupling
      !> Force at attaching, in the direction of the displacement
      real(wp), intent(in) :: start_force
      !> Relative threshold
      real(wp), intent(in) :: threshold
      real(wp) :: distance

      distance = (threshold - start_force) / stiffness_of(coupling, threshold)
   end function breaking_distance

   !> Threshold below which contacts have broken after a displacement; 0 if no contact has.
   elemental function broken_threshold(coupling, start_force, distance) result(threshold)
      !> One of the coupling_ codes
      integer, intent(in) :: coupling
      !> Force at attaching, in the direction of the displacement
      real(wp), intent(in) :: start_force
      real(wp), intent(in) :: distance
      !> Relative threshold
      real(wp) :: threshold

      real(wp) :: discriminant

      if (coupling == coupling_equal) then
         threshold = max(0.0_wp, distance + start_force)
         return
      end if
      ! u = u^(1/2) d + beta; with negative beta contacts break only beyond 2 |beta|^(1/2).
      discriminant = distance**2 + 4.0_wp * start_force
      threshold = 0.0_wp
      if (start_force < 0.0_wp .and. (distance < 0.0_wp .or. discriminant < 0.0_wp)) return
      threshold = 0.25_wp * (distance + sqrt(discriminant))**2
   end function broken_threshold

   !> Derivative of broken_threshold with respect to the displacement.
   elemental function broken_threshold_slope(coupling, start_force, distance) result(slope)
      !> One of the coupling_ codes
      integer, intent(in) :: coupling
      !> Force at attaching, in the direction of the displacement; not negative
      real(wp), intent(in) :: start_force
      real(wp), intent(in) :: distance
      !> Relative threshold over displacement
      real(wp) :: slope

      slope = 1.0_wp
      if (coupling == coupling_equal) return
      slope = 2.0_wp * distance
      if (start_force > 0.0_wp) then
         slope = 2.0_wp * broken_threshold(coupling, start_force, distance) &
            & / sqrt(distance**2 + 4.0_wp * start_force)
      end if
   end function broken_threshold_slope

end module mesoslip_contacts_mechanics
