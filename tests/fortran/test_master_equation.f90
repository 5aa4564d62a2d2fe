!> Quadrature, partial moments, lives of contacts, their renewal, and populations under a slider.
program test_master_equation
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_theory_lives, only: contact_lives_type, make_contact_lives
   use mesoslip_contacts_mechanics, only: breaking_distance, broken_threshold, &
      & broken_threshold_slope, coupling_equal, coupling_scaled, initial_relaxed, initial_steady, &
      & initial_uniform
   use mesoslip_contacts_populations, only: contact_populations_type, new_contact_populations
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_contacts_partial_moments, only: new_partial_moments, partial_moments_type
   use mesoslip_numerics_parameters, only: new_parameters, parameters_type
   use mesoslip_numerics_quadrature, only: barycentric_weights, gauss_legendre, &
      & integration_matrix, lagrange_basis
   use mesoslip_theory_renewal, only: renewal_solution_type, solve_renewal
   use mesoslip_contacts_threshold_laws, only: new_threshold_law
   use mesoslip_contacts_threshold_laws_base, only: threshold_law_type
   use testing, only: check, check_close, finish
   implicit none

   real(wp) :: rough, fine

   call rules()
   call moments("gaussian", 0.3_wp, 0.0_wp)
   call moments("gaussian", 0.01_wp, 0.1_wp)
   call moments("lognormal", 0.5_wp, 0.1_wp)
   call moments("uniform", 0.2_wp, 0.1_wp)
   call breaking()
   call renewal()
   call sliding(coupling_scaled, initial_relaxed, 0.1_wp, rough)
   call sliding(coupling_scaled, initial_relaxed, 0.05_wp, fine)
   call check(fine < 0.4_wp * rough, "the work of steps falls as their error does")
   call check(fine > 0.0_wp .and. rough < 2.0e-3_wp, "the work of steps")
   call sliding(coupling_equal, initial_uniform, 0.1_wp, rough)
   call sliding(coupling_scaled, initial_steady, 0.1_wp, rough)
   call finish()

contains

   !> Gauss's rule is exact up to its degree, interpolation and integration up to theirs.
   subroutine rules()
      real(wp) :: point(7), weight(7), matrix(7, 7), basis(7)

      call gauss_legendre(point, weight)
      call check_close(sum(weight * point**13), 1.0_wp / 14.0_wp, 1.0e-16_wp, "degree 13")
      call check(abs(sum(weight * point**14) - 1.0_wp / 15.0_wp) > 1.0e-12_wp, "degree 14")
      basis = lagrange_basis(point, barycentric_weights(point), 0.3_wp)
      call check_close(sum(basis * point**6), 0.3_wp**6, 1.0e-15_wp, "interpolation")
      basis = lagrange_basis(point, barycentric_weights(point), point(3))
      call check_close(sum(basis * point**6), point(3)**6, 1.0e-16_wp, "interpolation at a point")
      matrix = integration_matrix(point)
      call check_close(maxval(abs(matmul(matrix, point**6) - point**7 / 7.0_wp)), 0.0_wp, &
         & 1.0e-15_wp, "integration")
   end subroutine rules

   !> Moments of order 0 are the survival function; others by a fine sum over quantiles.
   subroutine moments(kind, width, minimum)
      character(len=*), intent(in) :: kind
      real(wp), intent(in) :: width, minimum

      integer, parameter :: parts = 200000
      class(threshold_law_type), allocatable :: law
      type(partial_moments_type) :: partial
      type(error_type), allocatable :: error
      real(wp) :: exact(3), quick(3), threshold, u
      type(accumulator_type) :: sums(3)
      integer :: part

      call new_threshold_law(law, kind, width, minimum, error)
      call new_partial_moments(partial, law, [0.0_wp, 0.5_wp, -0.5_wp])
      threshold = 1.0_wp + 0.3_wp * width
      exact = partial%above(threshold)
      call partial%interpolate(threshold, quick)
      do part = 1, parts
         u = law%quantile(law%survival(threshold) * (part - 0.5_wp) / parts)
         call sums(1)%add(law%survival(threshold) / parts)
         call sums(2)%add(law%survival(threshold) / parts * sqrt(u))
         call sums(3)%add(law%survival(threshold) / parts / sqrt(u))
      end do
      call check_close(exact(1), law%survival(threshold), 1.0e-12_wp, "moment 0 is the survival")
      call check_close(exact(2), sums(2)%total(), 1.0e-6_wp, "moment 1/2")
      call check_close(exact(3), sums(3)%total(), 1.0e-6_wp, "moment -1/2")
      call check_close(maxval(abs(quick - exact)), 0.0_wp, 1.0e-11_wp, "interpolated moments")
      exact = partial%above(0.0_wp)
      call check_close(exact(1), 1.0_wp, 1.0e-12_wp, "all thresholds are above 0")
      exact = partial%above(partial%max_threshold)
      call check(all(exact <= 0.0_wp), "no threshold is above the maximum")
   end subroutine moments

   !> Breaking distance and threshold are inverse to each other, in both directions.
   subroutine breaking()
      real(wp) :: distance, force, slope
      integer :: coupling, sign_of_force

      do coupling = coupling_scaled, coupling_equal
         do sign_of_force = -1, 1
            force = 0.1_wp * sign_of_force
            distance = breaking_distance(coupling, force, 0.8_wp)
            call check_close(broken_threshold(coupling, force, distance), 0.8_wp, 1.0e-15_wp, &
               & "threshold broken at the breaking distance")
            call check(broken_threshold(coupling, -0.1_wp, 0.05_wp) <= 0.1_wp, &
               & "nothing breaks on a short distance back")
            if (sign_of_force < 0) cycle
            slope = (broken_threshold(coupling, force, distance + 1.0e-6_wp) &
               & - broken_threshold(coupling, force, distance - 1.0e-6_wp)) / 2.0e-6_wp
            call check_close(broken_threshold_slope(coupling, force, distance), slope, 1.0e-8_wp, &
               & "slope of the broken threshold")
         end do
      end do
   end subroutine breaking

   !> Exponential lives from the start: breaks are a Poisson process, Gamma = 1/mean life.
   subroutine renewal()
      type(contact_lives_type) :: lives
      type(renewal_solution_type) :: solution
      type(parameters_type) :: parameters
      type(error_type), allocatable :: error

      call new_parameters(parameters, [character(len=16) :: "relative_width", "back_force_ratio", &
         & "newborn_width", "reattach"], [1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp])
      call parameters%add_word("threshold_law", "exponential")
      call parameters%add_word("coupling", "equal")
      call parameters%add_word("initial", "relaxed")
      call make_contact_lives(lives, parameters, error)
      call check(.not. allocated(error), "exponential lives")
      call solve_renewal(lives, 0.0_wp, 0.25_wp, 80, 10, solution, error)
      call check(.not. allocated(error), "memory for the renewal equation")
      call check_close(maxval(abs(solution%breaks - 1.0_wp)), 0.0_wp, 1.0e-12_wp, "Poisson process")
      call check_close(maxval(abs(solution%pinned - 1.0_wp)), 0.0_wp, 1.0e-12_wp, "conservation")
      ! The force of a contact is its age, whose mean is 1 - exp(-X).
      call check_close(solution%force(10, 80), &
         & 1.0_wp - exp(-(79.0_wp + solution%point(10)) * 0.25_wp), 1.0e-12_wp, "force")
      call check_close(lives%steady_force, 1.0_wp, 1.0e-12_wp, "stationary force")
   end subroutine renewal

   !> Populations under a slider that moves forward, rests, and moves back: contacts are conserved,
   !> and their energy and losses are the work done on them.
   subroutine sliding(coupling, initial, resolution, step_work)
      integer, intent(in) :: coupling, initial
      real(wp), intent(in) :: resolution
      !> Estimate of the error of the force
      real(wp), intent(out) :: step_work

      type(contact_populations_type) :: contacts
      type(contact_parameters_type) :: parameters
      type(error_type), allocatable :: error
      type(interface_law_type) :: law
      type(window_type) :: window
      type(pose_type) :: before, after
      real(wp) :: work, start, distance, velocity
      integer :: step

      call new_threshold_law(parameters%law, "gaussian", 0.1_wp, 0.1_wp, error)
      parameters%count = 1
      parameters%static_force = 1.0_wp
      parameters%stiffness = 1.0_wp
      parameters%delay = 0.1_wp
      parameters%back_force_ratio = 0.1_wp
      parameters%coupling = coupling
      call new_contact_populations(contacts, parameters, resolution, error)
      call check(.not. allocated(error), "populations")
      call contacts%initialize(initial)
      start = contacts%elastic_energy(0.0_wp)
      before = pose_type(velocity=1.0_wp)
      work = 0.0_wp
      do step = 1, 20000
         if (before%time > 6.0_wp) exit
         velocity = 1.0_wp
         if (before%time > 2.0_wp) velocity = 0.0_wp
         if (before%time > 3.0_wp) velocity = -1.0_wp
         before%velocity = velocity
         if (abs(velocity) > 0.0_wp) before%direction = velocity
         call contacts%offer(before, law, window)
         after = before
         distance = min(window%upper - before%displacement, 0.05_wp)
         if (velocity < 0.0_wp) distance = max(window%lower - before%displacement, -0.05_wp)
         after%time = before%time + min(abs(distance), window%end_time - before%time, 0.05_wp)
         after%displacement = before%displacement + velocity * (after%time - before%time)
         distance = after%displacement - before%displacement
         work = work + distance * (law%stiffness * (before%displacement + 0.5_wp * distance) &
            & - law%offset + 0.5_wp * law%rate * (after%time - before%time))
         call contacts%respond(before, after)
         before = after
      end do
      call check(step < 20000, "the run ends")
      call check_close(contacts%pinned%number_of_contacts() + contacts%detached_count, &
         & 1.0_wp, 1.0e-12_wp, "contacts are conserved")
      call check(contacts%breaks > 2.5_wp, "contacts break")
      call check_close(contacts%elastic_energy(before%displacement) - start, &
         & work - contacts%break_loss%total() + contacts%birth_gain%total() &
         & - contacts%step_work%total(), 1.0e-12_wp, "energy of the contacts")
      step_work = abs(contacts%step_work%total())
      start = contacts%elastic_energy(before%displacement)
      call contacts%shift_origin(2.0_wp, before%displacement - 2.0_wp)
      call check_close(contacts%elastic_energy(before%displacement - 2.0_wp), start, 1.0e-12_wp, &
         & "energy does not depend on the origin")
   end subroutine sliding

end program test_master_equation
