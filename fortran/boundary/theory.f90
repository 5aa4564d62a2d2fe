! The theory as Python calls it: flat subroutines with explicit shapes, wrapped by f2py.
!
! Each procedure that may fail has a status and a message as its last arguments; status 0 means
! success. No procedure keeps state.

!> Scales of the lives of contacts under a slider that moves forward, dimensionless.
subroutine contact_scales(length, names, values, words, scales, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, report
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_theory_lives, only: contact_lives_type, make_contact_lives
   implicit none
   !> Parameters of the contacts by name, numbers or words
   integer, intent(in) :: length
   character(len=32), intent(in) :: names(length), words(length)
   real(8), intent(in) :: values(length)
   !> Scales in the order of the list of names "scales"
   real(8), intent(out) :: scales(9)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(parameters_type) :: parameters
   type(contact_lives_type) :: lives
   type(error_type), allocatable :: error

   scales = 0.0d0
   call new_parameters(parameters, names, values, words)
   call make_contact_lives(lives, parameters, error)
   if (.not. allocated(error)) scales = lives%scales()
   call report(error, status, message)
end subroutine contact_scales

!> Force curve of the master equation, dimensionless, on panels of the displacement.
subroutine force_curve(length, names, values, words, start, width, panels, points, point, breaks, &
   & slope, force, stiffness, pinned_part, mismatch, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, report
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_theory_lives, only: contact_lives_type, make_contact_lives
   use mesoslip_theory_renewal, only: renewal_solution_type, solve_renewal
   implicit none
   !> Parameters of the contacts by name, numbers or words
   integer, intent(in) :: length
   character(len=32), intent(in) :: names(length), words(length)
   real(8), intent(in) :: values(length)
   !> Start of the first panel, at or below 0, and width of the panels
   real(8), intent(in) :: start, width
   !> Number of panels, and of points in each
   integer, intent(in) :: panels, points
   !> Points within a panel, from 0 to 1
   real(8), intent(out) :: point(points)
   !> Breaks over displacement, slope of the force, force, stiffness of the pinned contacts
   real(8), intent(out) :: breaks(points, panels), slope(points, panels), force(points, panels), &
      & stiffness(points, panels)
   !> Share of pinned contacts at the edges of the panels
   real(8), intent(out) :: pinned_part(panels + 1)
   !> Maximum difference between the force from two integrals
   real(8), intent(out) :: mismatch
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(parameters_type) :: parameters
   type(contact_lives_type) :: lives
   type(renewal_solution_type) :: renewal
   type(error_type), allocatable :: error

   point = 0.0d0
   breaks = 0.0d0
   slope = 0.0d0
   force = 0.0d0
   stiffness = 0.0d0
   mismatch = 0.0d0
   pinned_part = 0.0d0
   call new_parameters(parameters, names, values, words)
   call make_contact_lives(lives, parameters, error)
   if (.not. allocated(error)) then
      call lives%spread_table(width)
      call solve_renewal(lives, start, width, panels, points, renewal, error)
   end if
   if (.not. allocated(error)) then
      point = renewal%point
      breaks = renewal%breaks
      slope = renewal%slope
      force = renewal%force
      stiffness = renewal%stiffness
      pinned_part = renewal%pinned
      mismatch = renewal%mismatch
   end if
   call report(error, status, message)
end subroutine force_curve

!> Onset of slip, dimensionless, by Eq. S46 or S47.
subroutine onset(equation, coefficients, damping, drag, end_displacement, interval, tolerance, &
   & capacity, samples, length, ended, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, report
   use mesoslip_numerics_parameters, only: choose
   use mesoslip_theory_onset, only: equation_names, integrate_onset, onset_type
   implicit none
   !> "sequential", S46, or "melting", S47
   character(len=*), intent(in) :: equation
   !> D0 to D3; eta_S/Omega_S, eta/Omega_S; displacement at which S46 ends
   real(8), intent(in) :: coefficients(4), damping, drag, end_displacement
   !> Interval of samples, and relative tolerance of the integration
   real(8), intent(in) :: interval, tolerance
   !> Samples in the order of the list of names "onset", and their number
   integer, intent(in) :: capacity
   real(8), intent(inout) :: samples(4, capacity)
   integer, intent(out) :: length
   !> Whether the end of the equation was reached
   integer, intent(out) :: ended
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(onset_type), target :: equations
   type(error_type), allocatable :: error
   logical :: is_over

   length = 0
   is_over = .false.
   call choose("equation", equation, equation_names, equations%equation, error)
   equations%D = coefficients
   equations%damping = damping
   equations%drag = drag
   equations%end_displacement = end_displacement
   if (.not. allocated(error)) then
      call integrate_onset(equations, interval, tolerance, samples, length, is_over, error)
   end if
   ended = merge(1, 0, is_over .and. .not. allocated(error))
   call report(error, status, message)
end subroutine onset

!> Thresholds, densities or survival probabilities of a threshold law.
subroutine evaluate_threshold_law(length, names, values, words, minimum, what, points, argument, &
   & value, acceptance, status, message)
   !f2py threadsafe
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_boundary_handles, only: error_type, report
   use mesoslip_numerics_errors, only: raise, status_invalid
   use mesoslip_numerics_parameters, only: name_length, new_parameters, parameters_type
   use mesoslip_contacts_threshold_laws, only: make_threshold_law
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   implicit none
   !> Parameters of the threshold law by name, numbers or words
   integer, intent(in) :: length
   character(len=32), intent(in) :: names(length), words(length)
   real(8), intent(in) :: values(length)
   real(8), intent(in) :: minimum
   !> "quantile", of exceedance probabilities, "density" or "survival"
   character(len=*), intent(in) :: what
   integer, intent(in) :: points
   real(8), intent(in) :: argument(points)
   real(8), intent(out) :: value(points)
   !> Probability that a draw is not rejected
   real(8), intent(out) :: acceptance
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   class(threshold_law_type), allocatable :: threshold_law
   type(parameters_type) :: parameters
   character(len=name_length) :: law
   type(error_type), allocatable :: error

   value = 0.0_wp
   acceptance = 0.0_wp
   call new_parameters(parameters, names, values, words)
   call parameters%take("threshold_law", law, error)
   call make_threshold_law(threshold_law, law, parameters, minimum, error)
   call parameters%finish(error)
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

!> Motions of a slider on a spring with rate-and-state friction, for several sets of parameters.
subroutine rate_and_state_motions(evolution, states, sets, parameters, reference_velocity, &
   & stages, duration, start_velocity, end_velocity, points, times, tolerance, force, &
   & displacement, failed, status, message)
   !f2py threadsafe
   use mesoslip_boundary_handles, only: error_type, report
   use mesoslip_numerics_parameters, only: choose
   use mesoslip_theory_rate_and_state, only: evolution_names, friction_type, load_type, &
      & max_states, move_slider
   implicit none
   !> "ageing" or "slip", and the number of state variables, 1 or 2
   character(len=*), intent(in) :: evolution
   integer, intent(in) :: states
   !> Number of sets, and of each: a, b1, D1, b2, D2, stiffness, trend
   integer, intent(in) :: sets
   real(8), intent(in) :: parameters(7, sets)
   !> V_0
   real(8), intent(in) :: reference_velocity
   !> Stages of the load point: number, durations, velocities at start and end
   integer, intent(in) :: stages
   real(8), intent(in) :: duration(stages), start_velocity(stages), end_velocity(stages)
   !> Times in ascending order
   integer, intent(in) :: points
   real(8), intent(in) :: times(points)
   !> Tolerance of the logarithms of velocity and state
   real(8), intent(in) :: tolerance
   !> Force without F_0, and displacement
   real(8), intent(out) :: force(points, sets), displacement(points, sets)
   !> 1 for each unstable motion
   integer, intent(out) :: failed(sets)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(friction_type) :: friction
   type(load_type) :: load
   type(error_type), allocatable :: error
   integer :: set
   logical :: is_unstable

   force = 0.0d0
   displacement = 0.0d0
   failed = 0
   call choose("evolution", evolution, evolution_names, friction%evolution, error)
   if (.not. allocated(error)) then
      friction%states = min(max(states, 1), max_states)
      friction%reference_velocity = reference_velocity
      load%duration = duration
      load%start_velocity = start_velocity
      load%end_velocity = end_velocity
      do set = 1, sets
         friction%a = parameters(1, set)
         friction%b = parameters([2, 4], set)
         friction%distance = parameters([3, 5], set)
         friction%stiffness = parameters(6, set)
         friction%trend = parameters(7, set)
         call move_slider(friction, load, times, tolerance, force(:, set), displacement(:, set), &
            & is_unstable)
         if (is_unstable) failed(set) = 1
      end do
   end if
   call report(error, status, message)
end subroutine rate_and_state_motions

!> Logarithms of the normal density of residuals under white and correlated noise, up to a constant,
!> -huge where the covariance is not positive.
subroutine noise_log_densities(sets, points, starts, ends, counts, residual, deviation, share, &
   & time, density)
   !f2py threadsafe
   use mesoslip_numerics_correlated_noise, only: log_density
   implicit none
   !> Number of sets of residuals and noise, and of points
   integer, intent(in) :: sets, points
   !> Start and end of each point, and its number of samples
   real(8), intent(in) :: starts(points), ends(points), counts(points)
   real(8), intent(in) :: residual(points, sets)
   !> Of each set: standard deviation of a sample, share of the correlated noise in its variance,
   !> and the correlation time
   real(8), intent(in) :: deviation(sets), share(sets), time(sets)
   real(8), intent(out) :: density(sets)

   integer :: set

   do set = 1, sets
      density(set) = log_density(starts, ends, counts, residual(:, set), deviation(set), &
         & share(set), time(set))
   end do
end subroutine noise_log_densities
