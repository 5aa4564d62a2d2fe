! The boundary to Python: flat subroutines with explicit shapes, wrapped by f2py.
!
! Each has a status and a message as its last arguments; status 0 means success. None keeps state.

!> Run N contacts, or infinitely many, for some advances of the slider.
subroutine run_segment(engine, count, static_force, stiffness, drag, delay, back_force_ratio, &
   & coupling, reattach, law, relative_width, initial, seed, realization, bond, lattice, columns, &
   & lattice_rows, slider_kind, mass, spring, damping, layers, layer_damping, base, solver, &
   & tolerances, stages, stage_end, stage_velocity, interval, slip_interval, slip_velocity, &
   & quiet_time, least_avalanche, snapshot_size, most_avalanches, snapshot_times, snapshot_time, &
   & started, reals, integers, &
   & state_real, state_integer, records, record, detached, detached_contact, &
   & tracked, track, &
   & resolution, &
   & populations, population, packets, packet, layer_state, trace_capacity, trace, &
   & slip_trace_capacity, slip_trace, layers_recorded, layer_trace, slip_capacity, slips, &
   & avalanche_capacity, avalanches, snapshot_capacity, snapshot_contacts, snapshot_place, &
   & snapshot, most_advances, rows, ending, full, time, breaks, detached_count, advances, &
   & integrator, energy, avalanche_total, avalanche_slip, displacement, status, message)
   !f2py threadsafe
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_contacts_threshold_law, only: new_threshold_law
   use mesoslip_contacts_ensemble, only: contact_ensemble_type, new_contact_ensemble
   use mesoslip_contacts_lattice, only: contact_lattice_type, interaction_type, new_contact_lattice
   use mesoslip_contacts_populations, only: contact_populations_type, new_contact_populations
   use mesoslip_contacts_set, only: contact_arrays_type
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_sliders_layered, only: layered_parameters_type, slider_layered_type
   use mesoslip_sliders_prescribed, only: slider_prescribed_type
   use mesoslip_sliders_quasistatic, only: slider_quasistatic_type
   use mesoslip_sliders_rigid, only: slider_rigid_type
   use mesoslip_recording_recorder, only: recorder_parameters_type
   use mesoslip_simulation, only: simulation_type
   implicit none
   !> 1 for N contacts, 2 for infinitely many
   integer, intent(in) :: engine
   !> Number of contacts, mean threshold, stiffness and drag of one, delay, backward force
   integer, intent(in) :: count
   real(8), intent(in) :: static_force, stiffness, drag, delay, back_force_ratio
   !> Codes of coupling, threshold law and initial state; whether contacts attach again
   integer, intent(in) :: coupling, reattach, law, initial
   real(8), intent(in) :: relative_width
   !> Key of the random numbers
   integer(8), intent(in) :: seed, realization
   !> Stiffness of the bond between neighbours; code of their lattice, its columns and rows, all 0
   !> for contacts without a place
   real(8), intent(in) :: bond
   integer, intent(in) :: lattice, columns, lattice_rows
   !> Kind of the slider, its mass, spring constant and damping rate
   integer, intent(in) :: slider_kind
   real(8), intent(in) :: mass, spring, damping
   !> Number of layers, their damping rate; mass, stiffness and damping rate of the base; solver,
   !> and its tolerances, relative and absolute
   integer, intent(in) :: layers, solver
   real(8), intent(in) :: layer_damping, base(3), tolerances(2)
   !> Stages of the drive
   integer, intent(in) :: stages
   real(8), intent(in) :: stage_end(stages), stage_velocity(stages)
   !> What to record
   real(8), intent(in) :: interval, slip_interval, slip_velocity, quiet_time
   !> Least sizes of avalanches in the catalogue and with a snapshot, 0 for none; avalanches after
   !> which the run is over, 0 for any number; times of snapshots
   real(8), intent(in) :: least_avalanche, snapshot_size
   integer(8), intent(in) :: most_avalanches
   integer, intent(in) :: snapshot_times
   real(8), intent(in) :: snapshot_time(snapshot_times)
   !> Whether the state is that of a run under way, rather than to be made
   integer, intent(in) :: started
   !> State of the run
   integer, intent(in) :: reals, integers
   real(8), intent(inout) :: state_real(reals)
   integer(8), intent(inout) :: state_integer(integers)
   !> Contacts, for engine 1: as many records as contacts
   integer, intent(in) :: records
   real(8), intent(inout), target :: record(5, records), detached(2, records)
   integer, intent(inout), target :: detached_contact(records)
   !> Contacts of the present avalanche: as many as contacts when they are on a lattice, or none
   integer, intent(in) :: tracked
   integer, intent(inout), target :: track(2, tracked)
   !> Populations and packets of detached contacts, for engine 2, and their resolution
   real(8), intent(in) :: resolution
   integer, intent(in) :: populations, packets
   real(8), intent(inout), target :: population(populations, 12), packet(4, packets)
   !> Displacements and velocities of base and layers
   real(8), intent(inout), target :: layer_state(layers + 1, 2)
   !> Arrays to record into
   integer, intent(in) :: trace_capacity, slip_trace_capacity, slip_capacity
   real(8), intent(inout), target :: trace(9, trace_capacity)
   real(8), intent(inout), target :: slip_trace(10, slip_trace_capacity)
   !> Layers whose displacements go with the trace: none or all of them
   integer, intent(in) :: layers_recorded
   real(8), intent(inout), target :: layer_trace(layers_recorded, trace_capacity)
   real(8), intent(inout), target :: slips(7, slip_capacity)
   integer, intent(in) :: avalanche_capacity, snapshot_capacity, snapshot_contacts
   real(8), intent(inout), target :: avalanches(10, avalanche_capacity)
   real(8), intent(inout), target :: snapshot_place(3, snapshot_capacity)
   real(8), intent(inout), target :: snapshot(3, snapshot_contacts, snapshot_capacity)
   !> Largest number of advances
   integer(8), intent(in) :: most_advances
   !> Rows of trace, slip_trace, slips, avalanches and snapshots that were filled
   integer, intent(out) :: rows(5)
   !> Why the run is over, 0 if it is not; whether there is no room for more populations; the time
   !> it has come to
   integer, intent(out) :: ending, full
   real(8), intent(out) :: time
   !> Terms of the energy balance; breaks and advances so far, contacts that are detached
   real(8), intent(out) :: energy(8), breaks, detached_count
   integer(8), intent(out) :: advances
   !> Steps, evaluations and failed steps of the slider's integrator in this call
   integer(8), intent(out) :: integrator(3)
   !> Avalanches so far, and the slip in them; displacement of the slider
   integer(8), intent(out) :: avalanche_total
   real(8), intent(out) :: avalanche_slip, displacement
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   integer, parameter :: engine_contacts = 1, engine_master_equation = 2
   integer, parameter :: kind_rigid = 1, kind_prescribed = 2, kind_layered = 3, &
      & kind_quasistatic = 4, kind_force = 5
   type(simulation_type) :: simulation
   type(contact_ensemble_type), allocatable :: ensemble
   type(contact_lattice_type), allocatable :: neighbours
   type(contact_arrays_type) :: arrays
   type(contact_populations_type), allocatable :: all
   type(slider_layered_type), allocatable :: elastic
   type(contact_parameters_type) :: parameters
   type(recorder_parameters_type) :: recorder_parameters
   type(archive_type) :: archive
   type(error_type), allocatable :: error

   rows = 0
   ending = 0
   avalanche_total = 0
   avalanche_slip = 0.0_wp
   displacement = 0.0_wp
   full = 0
   time = 0.0_wp
   breaks = 0.0_wp
   detached_count = 0.0_wp
   advances = 0
   integrator = 0
   energy = 0.0_wp
   status = 0
   message = ""

   call new_threshold_law(parameters%law, law, relative_width, back_force_ratio, error)
   if (allocated(error)) then
      status = error%status
      message = error%message
      return
   end if
   parameters%count = count
   parameters%static_force = static_force
   parameters%stiffness = stiffness
   parameters%drag = drag
   parameters%delay = delay
   parameters%back_force_ratio = back_force_ratio
   parameters%coupling = coupling
   parameters%reattach = reattach /= 0
   parameters%seed = seed
   parameters%realization = realization
   select case (engine)
   case (engine_contacts)
      arrays%record => record
      arrays%detached => detached
      arrays%detached_contact => detached_contact
      ! Without a bond contacts know nothing of each other, wherever they are.
      if (bond > 0.0_wp) then
         allocate (neighbours)
         call new_contact_lattice(neighbours, parameters, &
            & interaction_type(bond, lattice, columns, lattice_rows), arrays, error)
         neighbours%track%columns = columns
         neighbours%track%rows = lattice_rows
         neighbours%track%contact => track
         call move_alloc(neighbours, simulation%contacts)
      else
         allocate (ensemble)
         call new_contact_ensemble(ensemble, parameters, arrays, error)
         ensemble%track%columns = columns
         ensemble%track%rows = lattice_rows
         ensemble%track%contact => track
         call move_alloc(ensemble, simulation%contacts)
      end if
   case (engine_master_equation)
      allocate (all)
      call new_contact_populations(all, parameters, resolution, population, packet, error)
      call move_alloc(all, simulation%contacts)
   case default
      call raise(error, status_invalid, "unknown engine")
   end select
   if (allocated(error)) then
      status = error%status
      message = error%message
      return
   end if

   select case (slider_kind)
   case (kind_rigid)
      allocate (simulation%slider, source=slider_rigid_type(mass=mass, stiffness=spring, &
         & damping=damping))
   case (kind_prescribed)
      allocate (simulation%slider, source=slider_prescribed_type())
   case (kind_layered)
      allocate (elastic)
      elastic%parameters = layered_parameters_type(layers=layers, mass=mass, stiffness=spring, &
         & damping=layer_damping, base_mass=base(1), base_stiffness=base(2), &
         & base_damping=base(3), solver=solver, relative=tolerances(1), absolute=tolerances(2))
      call elastic%attach(layer_state)
      call move_alloc(elastic, simulation%slider)
   case (kind_quasistatic)
      allocate (simulation%slider, source=slider_quasistatic_type(stiffness=spring))
   case (kind_force)
      allocate (simulation%slider, source=slider_quasistatic_type())
      simulation%under_force = .true.
   case default
      status = status_invalid
      message = "unknown kind of slider"
      return
   end select
   simulation%stage_end = stage_end
   simulation%stage_velocity = stage_velocity
   recorder_parameters%interval = interval
   recorder_parameters%slip_interval = slip_interval
   recorder_parameters%slip_velocity = slip_velocity
   recorder_parameters%quiet_time = quiet_time
   recorder_parameters%duration = stage_end(stages)
   recorder_parameters%contacts = count
   simulation%recorder%parameters = recorder_parameters
   call simulation%recorder%attach(trace, slip_trace, slips, layer_trace)

   simulation%avalanches%parameters%least_size = least_avalanche
   simulation%avalanches%parameters%snapshot_size = snapshot_size
   if (most_avalanches > 0) simulation%avalanches%parameters%most_avalanches = most_avalanches
   call simulation%avalanches%attach(avalanches, snapshot_place, snapshot, snapshot_time)

   archive%reals = state_real
   archive%integers = state_integer
   if (started /= 0) then
      call simulation%exchange(archive)
   else
      call simulation%start(initial)
   end if

   call simulation%run(most_advances, error)
   if (allocated(error)) then
      status = error%status
      message = error%message
   end if

   time = simulation%slider%time
   breaks = simulation%contacts%breaks
   detached_count = simulation%contacts%detached_count
   advances = simulation%advances
   energy = simulation%energy_balance()
   ending = simulation%ending
   avalanche_total = simulation%avalanches%avalanches
   avalanche_slip = simulation%avalanches%slip
   displacement = simulation%slider%origin + simulation%slider%displacement
   if (.not. simulation%contacts%has_room()) full = 1
   rows = [simulation%recorder%trace_count, simulation%recorder%slip_trace_count, &
      & simulation%recorder%slip_count, simulation%avalanches%avalanche_count, &
      & simulation%avalanches%snapshot_count]
   archive = archive_type(reals=state_real, integers=state_integer, saving=.true.)
   call simulation%exchange(archive)
   state_real = archive%reals
   state_integer = archive%integers
   integrator = simulation%slider%integrator_counts()
   call simulation%slider%close()
end subroutine run_segment

!> Sizes of the state of a run.
subroutine state_sizes(reals, integers)
   !f2py threadsafe
   implicit none
   integer, intent(out) :: reals, integers

   reals = 96
   integers = 48
end subroutine state_sizes

!> Thresholds, densities or survival probabilities of a threshold law.
subroutine evaluate_threshold_law(law, relative_width, minimum, what, length, argument, value, &
   & acceptance, status, message)
   !f2py threadsafe
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, status_invalid
   use mesoslip_contacts_threshold_law, only: new_threshold_law, threshold_law_type
   implicit none
   integer, intent(in) :: law
   real(8), intent(in) :: relative_width, minimum
   !> 1 for thresholds of exceedance probabilities, 2 for densities, 3 for survival probabilities
   integer, intent(in) :: what
   integer, intent(in) :: length
   real(8), intent(in) :: argument(length)
   real(8), intent(out) :: value(length)
   !> Probability that a draw is not rejected
   real(8), intent(out) :: acceptance
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(threshold_law_type) :: threshold_law
   type(error_type), allocatable :: error

   value = 0.0_wp
   acceptance = 0.0_wp
   status = 0
   message = ""
   call new_threshold_law(threshold_law, law, relative_width, minimum, error)
   if (allocated(error)) then
      status = error%status
      message = error%message
      return
   end if
   acceptance = threshold_law%acceptance
   select case (what)
   case (1)
      value = threshold_law%quantile(argument)
   case (2)
      value = threshold_law%density(argument)
   case (3)
      value = threshold_law%survival(argument)
   case default
      status = status_invalid
      message = "a threshold law has thresholds, densities and survival probabilities"
   end select
end subroutine evaluate_threshold_law

!> Philox 4x32-10, for its tests and for whoever wants the same numbers elsewhere.
subroutine philox(length, counter, key, word)
   !f2py threadsafe
   use mesoslip_numerics_random, only: philox4x32
   implicit none
   integer, intent(in) :: length
   !> 32-bit words in 64-bit integers, shapes (4, length), (2, length)
   integer(8), intent(in) :: counter(4, length), key(2, length)
   integer(8), intent(out) :: word(4, length)

   integer :: draw

   do draw = 1, length
      call philox4x32(counter(:, draw), key(:, draw), word(:, draw))
   end do
end subroutine philox

!> Version of the SUNDIALS library in use.
subroutine sundials(version)
   !f2py threadsafe
   use mesoslip_numerics_sundials_cvode, only: sundials_version
   implicit none
   character(len=32), intent(out) :: version

   version = sundials_version()
end subroutine sundials

!> Scales of the lives of contacts under a slider that moves forward, dimensionless.
subroutine contact_scales(law, relative_width, coupling, back_force_ratio, newborn_width, &
   & reattach, initial, scales, status, message)
   !f2py threadsafe
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_theory_lives, only: contact_lives_type, new_contact_lives
   implicit none
   !> Codes of threshold law, coupling and initial state; whether contacts attach again
   integer, intent(in) :: law, coupling, initial, reattach
   real(8), intent(in) :: relative_width, back_force_ratio
   !> Standard deviation of the stretch of newborn contacts
   real(8), intent(in) :: newborn_width
   !> Shortest, longest and mean life of newborns; their stiffness and force at attaching; shortest
   !> and longest life of a relaxed first generation; mean force of stationary sliding; mean mass
   real(8), intent(out) :: scales(9)
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(contact_lives_type) :: lives
   type(error_type), allocatable :: error

   scales = 0.0_wp
   status = 0
   message = ""
   call new_contact_lives(lives, law, relative_width, coupling, back_force_ratio, newborn_width, &
      & reattach /= 0, initial, error)
   if (allocated(error)) then
      status = error%status
      message = error%message
      return
   end if
   scales = [lives%shortest, lives%longest, lives%mean_life, lives%newborn_stiffness, &
      & lives%newborn_force, lives%first_shortest, lives%first_longest, &
      & lives%steady_force, lives%mean_mass]
end subroutine contact_scales

!> Force curve of the master equation, dimensionless, on panels of the displacement.
subroutine force_curve(law, relative_width, coupling, back_force_ratio, newborn_width, &
   & reattach, initial, start, width, panels, points, point, breaks, slope, force, stiffness, &
   & pinned_part, mismatch, status, message)
   !f2py threadsafe
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_theory_lives, only: contact_lives_type, new_contact_lives
   use mesoslip_theory_renewal, only: renewal_solution_type, solve_renewal
   implicit none
   !> Codes of threshold law, coupling and initial state; whether contacts attach again
   integer, intent(in) :: law, coupling, initial, reattach
   real(8), intent(in) :: relative_width, back_force_ratio
   !> Standard deviation of the stretch of newborn contacts
   real(8), intent(in) :: newborn_width
   !> Start of the first panel, at or below 0, and width of the panels
   real(8), intent(in) :: start, width
   !> Number of panels, and of points in each
   integer, intent(in) :: panels, points
   !> Points within a panel, from 0 to 1
   real(8), intent(out) :: point(points)
   !> Breaks over displacement, slope of the force, force, stiffness of the pinned contacts
   real(8), intent(out) :: breaks(points, panels), slope(points, panels)
   real(8), intent(out) :: force(points, panels), stiffness(points, panels)
   !> Part of the contacts that is pinned, at the edges of the panels
   real(8), intent(out) :: pinned_part(panels + 1)
   !> Largest difference between two ways to the force
   real(8), intent(out) :: mismatch
   integer, intent(out) :: status
   character(len=200), intent(out) :: message

   type(contact_lives_type) :: lives
   type(renewal_solution_type) :: solution
   type(error_type), allocatable :: error

   point = 0.0_wp
   breaks = 0.0_wp
   slope = 0.0_wp
   force = 0.0_wp
   stiffness = 0.0_wp
   mismatch = 0.0_wp
   pinned_part = 0.0_wp
   status = 0
   message = ""
   call new_contact_lives(lives, law, relative_width, coupling, back_force_ratio, newborn_width, &
      & reattach /= 0, initial, error)
   if (allocated(error)) then
      status = error%status
      message = error%message
      return
   end if
   call solve_renewal(lives, start, width, panels, points, solution)
   point = solution%point
   breaks = solution%breaks
   slope = solution%slope
   force = solution%force
   stiffness = solution%stiffness
   pinned_part = solution%pinned
   mismatch = solution%mismatch
end subroutine force_curve

!> Onset of slip, dimensionless, by Eq. S46 or S47.
subroutine onset(equation, coefficients, damping, drag, end_displacement, interval, tolerance, &
   & capacity, samples, length, ended, status, message)
   !f2py threadsafe
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

   status = 0
   message = ""
   equations%equation = equation
   equations%D = coefficients
   equations%damping = damping
   equations%drag = drag
   equations%end_displacement = end_displacement
   call integrate_onset(equations, interval, tolerance, samples, length, is_over, error)
   ended = merge(1, 0, is_over .and. .not. allocated(error))
   if (allocated(error)) then
      status = error%status
      message = error%message
   end if
end subroutine onset
