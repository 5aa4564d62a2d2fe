! What Python calls of the theory: flat subroutines with explicit shapes, wrapped by f2py.
!
! Each has a status and a message as its last arguments; status 0 means success. None keeps state.

!> Scales of the lives of contacts under a slider that moves forward, dimensionless.
subroutine contact_scales(length, names, values, scales, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_theory_lives, only: contact_lives_type, make_contact_lives
   implicit none
   !> What the contacts are made of, each number by its name
   integer, intent(in) :: length
   character(len=32), intent(in) :: names(length)
   real(8), intent(in) :: values(length)
   !> Shortest, longest and mean life of newborns; their stiffness and force at attaching; shortest
   !> and longest life of a relaxed first generation; mean force of stationary sliding; mean mass
   real(8), intent(out) :: scales(9)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(parameters_type) :: parameters
   type(contact_lives_type) :: lives
   type(error_type), allocatable :: error

   scales = 0.0d0
   call new_parameters(parameters, names, values)
   call make_contact_lives(lives, parameters, error)
   if (.not. allocated(error)) then
      scales = [lives%shortest, lives%longest, lives%mean_life, lives%newborn_stiffness, &
         & lives%newborn_force, lives%first_shortest, lives%first_longest, &
         & lives%steady_force, lives%mean_mass]
   end if
   call report(error, status, message)
end subroutine contact_scales

!> Force curve of the master equation, dimensionless, on panels of the displacement.
subroutine force_curve(length, names, values, start, width, panels, points, point, solution, &
   & pinned_part, mismatch, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_theory_lives, only: contact_lives_type, make_contact_lives
   use mesoslip_theory_renewal, only: renewal_solution_type, solve_renewal
   implicit none
   !> What the contacts are made of, each number by its name
   integer, intent(in) :: length
   character(len=32), intent(in) :: names(length)
   real(8), intent(in) :: values(length)
   !> Start of the first panel, at or below 0, and width of the panels
   real(8), intent(in) :: start, width
   !> Number of panels, and of points in each
   integer, intent(in) :: panels, points
   !> Points within a panel, from 0 to 1
   real(8), intent(out) :: point(points)
   !> Breaks over displacement, slope of the force, force, stiffness of the pinned contacts
   real(8), intent(out) :: solution(points, panels, 4)
   !> Part of the contacts that is pinned, at the edges of the panels
   real(8), intent(out) :: pinned_part(panels + 1)
   !> Largest difference between two ways to the force
   real(8), intent(out) :: mismatch
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(parameters_type) :: parameters
   type(contact_lives_type) :: lives
   type(renewal_solution_type) :: renewal
   type(error_type), allocatable :: error

   point = 0.0d0
   solution = 0.0d0
   mismatch = 0.0d0
   pinned_part = 0.0d0
   call new_parameters(parameters, names, values)
   call make_contact_lives(lives, parameters, error)
   if (.not. allocated(error)) then
      call solve_renewal(lives, start, width, panels, points, renewal)
      point = renewal%point
      solution(:, :, 1) = renewal%breaks
      solution(:, :, 2) = renewal%slope
      solution(:, :, 3) = renewal%force
      solution(:, :, 4) = renewal%stiffness
      pinned_part = renewal%pinned
      mismatch = renewal%mismatch
   end if
   call report(error, status, message)
end subroutine force_curve

!> Onset of slip, dimensionless, by Eq. S46 or S47.
subroutine onset(equation, coefficients, damping, drag, end_displacement, interval, tolerance, &
   & capacity, samples, length, ended, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: report
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_theory_onset, only: integrate_onset, onset_type
   implicit none
   !> 1 for S46, 2 for S47
   integer, intent(in) :: equation
   !> D0 to D3; eta_S/Omega_S, eta/Omega_S; displacement at which S46 ends
   real(8), intent(in) :: coefficients(4), damping, drag, end_displacement
   !> Interval of samples, and relative tolerance of the integration
   real(8), intent(in) :: interval, tolerance
   !> Samples of time, displacement, velocity and its running mean, and how many were filled
   integer, intent(in) :: capacity
   real(8), intent(inout) :: samples(4, capacity)
   integer, intent(out) :: length
   !> Whether the equation came to its end
   integer, intent(out) :: ended
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(onset_type), target :: equations
   type(error_type), allocatable :: error
   logical :: is_over

   equations%equation = equation
   equations%D = coefficients
   equations%damping = damping
   equations%drag = drag
   equations%end_displacement = end_displacement
   call integrate_onset(equations, interval, tolerance, samples, length, is_over, error)
   ended = merge(1, 0, is_over .and. .not. allocated(error))
   call report(error, status, message)
end subroutine onset

!> Thresholds, densities or survival probabilities of a threshold law.
subroutine evaluate_threshold_law(law, relative_width, minimum, what, length, argument, value, &
   & acceptance, status, message)
   !f2py threadsafe
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_boundary_handles, only: report
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_contacts_threshold_laws, only: new_threshold_law
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   !> Name of the law
   character(len=*), intent(in) :: law
   real(8), intent(in) :: relative_width, minimum
   !> "quantile", of exceedance probabilities, "density" or "survival"
   character(len=*), intent(in) :: what
   integer, intent(in) :: length
   real(8), intent(in) :: argument(length)
   real(8), intent(out) :: value(length)
   !> Probability that a draw is not rejected
   real(8), intent(out) :: acceptance
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   class(threshold_law_type), allocatable :: threshold_law
   type(error_type), allocatable :: error

   value = 0.0_wp
   acceptance = 0.0_wp
   call new_threshold_law(threshold_law, law, relative_width, minimum, error)
   if (.not. allocated(error)) then
      acceptance = threshold_law%acceptance
      select case (what)
      case ("quantile")
         value = threshold_law%quantile(argument)
      case ("density")
         value = threshold_law%density(argument)
      case ("survival")
         value = threshold_law%survival(argument)
      case default
         call raise(error, status_invalid, &
            & "a threshold law has thresholds, densities and survival probabilities")
      end select
   end if
   call report(error, status, message)
end subroutine evaluate_threshold_law
