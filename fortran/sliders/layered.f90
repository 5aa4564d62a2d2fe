!> An elastic slider: layers joined by springs, on an optional base (section 8 of the model, S24).
!>
!> Layer 1 bears the contacts; a spring joins layer N_l to the drive. Damping acts between layers,
!> not on that spring, so that one layer is the rigid slider. Displacement and velocity are those of
!> layer 1 relative to the base, by which contacts stretch.
!>
!> Under a linear law of the contact force the motion is that of a linear system. By default it is
!> advanced by its Taylor series, exact to rounding, over steps in units of the fastest rate; most
!> end at an event long before. CVODE is the alternative.
module mesoslip_sliders_layered
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_quadrature, only: gauss_legendre
   use mesoslip_sliders_base, only: exchange_law, exchange_slider, motion_type, shift_slider, &
      & slider_type
   use mesoslip_sliders_hazard_clock, only: advance_clocks, limit_window
   use mesoslip_sliders_layered_integrator, only: integrator_type
   use mesoslip_sliders_layered_system, only: expand, fastest_rate, layered_parameters_type, &
      & new_system, solver_codes, solver_names, solver_series, sum_series, system_type
   use mesoslip_sliders_motion_series, only: first_end, horner, inverse, max_terms, slope
   implicit none
   private

   public :: slider_layered_type, make_slider_layered

   !> Maximum duration of a step in units of the fastest rate
   real(wp), parameter :: max_step = 2.5_wp
   !> Minimum number of terms
   integer, parameter :: min_terms = 4
   !> Number of layers whose series take as long as an advance of a rigid slider
   real(wp), parameter :: layers_per_cost = 4.0_wp
   !> Points of the rule for the losses of a step
   integer, parameter :: points = 12

   !> An elastic slider.
   type, extends(slider_type) :: slider_layered_type
      type(layered_parameters_type) :: parameters
      !> The system during the last advance
      type(system_type), pointer, private :: system => null()
      !> CVODE, if it is the solver
      type(integrator_type), private :: integrator
      !> Displacement and velocity of the base, then of each layer, shape (0:layers, 2)
      real(wp), allocatable, private :: state(:, :)
      !> Taylor coefficients of both, shape (0:layers, 2, 0:max_terms)
      real(wp), allocatable, private :: series(:, :, :)
      !> The same of the velocity of layer 1 relative to the base
      real(wp), private :: sliding(0:max_terms) = 0.0_wp
      integer, private :: terms = 1
      real(wp), private :: point(points) = 0.0_wp, weight(points) = 0.0_wp
      !> Maximum duration of a step of a number of terms, in units of the fastest rate
      real(wp), private :: reach(max_terms) = 0.0_wp
   contains
      procedure :: adapt_to_drive
      procedure :: can_pause
      procedure :: pulled_velocity
      procedure :: start
      procedure :: advance
      procedure :: observe
      procedure :: observe_layers
      procedure :: energy
      procedure :: shift_origin
      procedure :: exchange
      procedure, non_overridable, private :: take_law, expand_motion, find_end, move_to, add_work, &
         & add_losses
      final :: close
   end type slider_layered_type

contains

   !> Set up an elastic slider from named numbers; mass 0 of the base: no base.
   subroutine make_slider_layered(slider, parameters, error)
      class(slider_type), allocatable, intent(out) :: slider
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(slider_layered_type), allocatable :: self
      integer :: solver, term, stat

      allocate (self)
      associate (values => self%parameters)
         call parameters%take("layers", values%layers, error)
         call parameters%take("mass", values%mass, error)
         call parameters%take("stiffness", values%stiffness, error)
         call parameters%take("damping", values%damping, error)
         call parameters%take("base_mass", values%base_mass, error)
         call parameters%take("base_stiffness", values%base_stiffness, error)
         call parameters%take("base_damping", values%base_damping, error)
         call parameters%take("solver", solver_names, solver, error)
         call parameters%take("relative_tolerance", values%relative, error)
         call parameters%take("absolute_tolerance", values%absolute, error)
         call parameters%finish(error)
         if (allocated(error)) return
         values%solver = solver_codes(solver)

         allocate (self%state(0:values%layers, 2), source=0.0_wp, stat=stat)
         if (stat == 0) then
            allocate (self%series(0:values%layers, 2, 0:max_terms), source=0.0_wp, stat=stat)
         end if
         if (stat /= 0) then
            call raise(error, status_memory, "not enough memory for the layers")
            return
         end if
         self%cost = 1.0_wp + values%layers / layers_per_cost
         self%has_passages = .true.
         self%own_rate = sqrt(values%stiffness / values%mass)
         allocate (self%system)
         self%system = new_system(values)
         self%inverse_mass = 1.0_wp / self%system%layer_mass
         if (values%base_mass > 0.0_wp) then
            self%inverse_mass = self%inverse_mass + 1.0_wp / values%base_mass
         end if
      end associate
      call gauss_legendre(self%point, self%weight)
      ! The first term left out is below 1e-17 of a free motion.
      do term = 1, max_terms
         self%reach(term) = exp((log(1.0e-17_wp) + log_gamma(term + 1.0_wp)) / term)
      end do
      call move_alloc(self, slider)
   end subroutine make_slider_layered

   subroutine start(self, law)
      class(slider_layered_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law

      real(wp) :: force
      integer :: layer

      force = law%stiffness * self%displacement - law%offset
      self%state = 0.0_wp
      if (self%parameters%base_mass > 0.0_wp) then
         self%state(0, 1) = force / self%parameters%base_stiffness
      end if
      do layer = 1, self%parameters%layers
         self%state(layer, 1) = self%state(0, 1) + self%displacement &
            & + (layer - 1) * force / self%system%spring
      end do
      self%drive%value = self%state(self%parameters%layers, 1) + force / self%system%spring
      self%velocity = 0.0_wp
      self%series(:, :, 0) = self%state
      self%system%law = law
   end subroutine start

   !> CVODE restarts.
   subroutine adapt_to_drive(self)
      class(slider_layered_type), intent(inout) :: self

      self%integrator%is_stale = .true.
   end subroutine adapt_to_drive

   !> The history of CVODE cannot be saved: only where it restarts.
   pure function can_pause(self)
      class(slider_layered_type), intent(in) :: self
      logical :: can_pause

      can_pause = self%integrator%is_stale .or. self%parameters%solver == solver_series
   end function can_pause

   pure function pulled_velocity(self) result(velocity)
      class(slider_layered_type), intent(in) :: self
      real(wp) :: velocity

      velocity = self%state(self%parameters%layers, 2)
   end function pulled_velocity

   subroutine advance(self, law, window)
      class(slider_layered_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      type(window_type) :: bounds
      real(wp) :: step, longest, direction
      logical :: ends, crosses, turns, is_due

      call self%take_law(law)
      self%step_time = self%time
      bounds = window
      if (self%has_clocks) call limit_window(self%clock, self%time, self%velocity, bounds)
      step = bounds%end_time - self%time
      if (.not. step > 0.0_wp) then
         self%series(:, :, 1:) = 0.0_wp
         self%series(:, :, 0) = self%state
         return
      end if

      if (self%parameters%solver == solver_series .or. self%integrator%is_stale) then
         self%system%drive = self%drive%at(self%time)
         self%system%drive_velocity = self%drive%rate_at(self%time)
         self%system%drive_acceleration = self%drive%acceleration
      end if
      if (self%parameters%solver == solver_series) then
         call self%expand_motion(bounds, step, ends)
      else
         call self%integrator%step(self%system, self%state, self%time, bounds%end_time, &
            & self%terms, self%series, step, ends, self%failure)
         if (allocated(self%failure)) return
      end if
      longest = step
      call self%find_end(bounds, step, crosses, turns, direction)
      if (self%has_clocks) then
         call advance_clocks(self%clock, self%sliding, self%terms, step, is_due)
         crosses = crosses .and. .not. is_due
         turns = turns .and. .not. is_due
      end if
      call self%move_to(step, crosses, turns, merge(bounds%upper, bounds%lower, direction > 0.0_wp))
      if (step < longest) self%integrator%is_stale = .true.
      if (ends .and. .not. (crosses .or. turns) .and. step >= longest) then
         self%time = bounds%end_time
      else
         self%time = self%time + step
      end if
      call self%add_work(step)
      call self%add_losses(step)
      if (self%parameters%solver /= solver_series) then
         call self%integrator%end_step(self%parameters%layers, self%integrator_counts)
      end if
   end subroutine advance

   !> Take the law of the contact force; CVODE restarts if it differs.
   subroutine take_law(self, law)
      class(slider_layered_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law

      if (self%parameters%solver /= solver_series .and. .not. self%integrator%is_stale) then
         self%integrator%is_stale = abs(law%stiffness - self%system%law%stiffness) > 0.0_wp &
            & .or. abs(law%offset - self%system%law%offset) > 0.0_wp &
            & .or. abs(law%drag - self%system%law%drag) > 0.0_wp &
            & .or. abs(law%rate) > 0.0_wp .or. abs(self%system%law%rate) > 0.0_wp
      end if
      self%system%law = law
   end subroutine take_law

   !> The motion as a series, over a step in which it is exact.
   subroutine expand_motion(self, window, step, ends)
      class(slider_layered_type), intent(inout) :: self
      type(window_type), intent(in) :: window
      !> Length of the step, at first up to the end of the window
      real(wp), intent(inout) :: step
      !> Whether it reaches that end
      logical, intent(out) :: ends

      real(wp) :: rate, gap
      integer :: term

      rate = fastest_rate(self%system)
      ends = step * rate <= max_step
      if (.not. ends) step = max_step / rate
      ! Most steps end at a break: a longer series is not needed.
      if (self%velocity > 0.0_wp) then
         gap = window%upper - self%displacement
      else
         gap = self%displacement - window%lower
      end if
      if (gap < 0.5_wp * abs(self%velocity) * step) then
         step = 2.0_wp * gap / abs(self%velocity)
         ends = .false.
         if (.not. step > 0.0_wp) step = max_step / rate
      end if
      self%terms = max_terms
      do term = min_terms, max_terms
         if (rate * step <= self%reach(term)) then
            self%terms = term
            exit
         end if
      end do
      call expand(self%system, self%state, self%terms, self%series)
   end subroutine expand_motion

   !> Shorten a step to the first time at which layer 1 leaves a window or turns round.
   subroutine find_end(self, window, step, crosses, turns, direction)
      class(slider_layered_type), intent(inout) :: self
      type(window_type), intent(in) :: window
      real(wp), intent(inout) :: step
      !> Whether it ends at an end of the window, or at a turning point
      logical, intent(out) :: crosses, turns
      !> Direction of the motion at first, +1 or -1
      real(wp), intent(out) :: direction

      real(wp) :: above, below, change
      integer :: term

      do term = 0, self%terms - 1
         self%sliding(term) = (term + 1) &
            & * (self%series(1, 1, term + 1) - self%series(0, 1, term + 1))
      end do
      crosses = .false.
      turns = .false.
      direction = 1.0_wp
      change = 0.0_wp
      do term = self%terms - 1, 1, -1
         change = (change + abs(self%sliding(term))) * step
      end do
      above = window%upper - self%displacement
      below = window%lower - self%displacement
      if ((abs(self%sliding(0)) + change) * step < min(above, -below)) return
      call first_end(self%sliding, self%terms, above, below, change, step, crosses, turns, &
         & direction)
   end subroutine find_end

   !> Move to a time after the start of the step.
   subroutine move_to(self, step, crosses, turns, target)
      class(slider_layered_type), intent(inout) :: self
      real(wp), intent(in) :: step
      !> Whether this is an end of the window, or a turning point
      logical, intent(in) :: crosses, turns
      !> Displacement of that end [m]
      real(wp), intent(in) :: target

      call sum_series(size(self%state), self%terms, self%series, step, self%state)
      if (crosses) then
         self%displacement = target
         self%state(1, 1) = self%state(0, 1) + self%displacement
      else
         self%displacement = self%state(1, 1) - self%state(0, 1)
      end if
      if (turns) self%state(1, 2) = self%state(0, 2)
      if (crosses .or. turns) self%integrator%is_stale = .true.
      self%base_velocity = self%state(0, 2)
      self%velocity = self%state(1, 2) - self%base_velocity
      if (abs(self%velocity) > 0.0_wp) self%direction = sign(1.0_wp, self%velocity)
      self%acceleration = slope(self%sliding, self%terms, step)
      self%start_acceleration = self%sliding(1)
   end subroutine move_to

   !> Add impulse and work of the drive in a step to the energy balance.
   subroutine add_work(self, step)
      class(slider_layered_type), intent(inout) :: self
      real(wp), intent(in) :: step

      real(wp) :: displacement, extension, drive_velocity, drive_acceleration, drive, lever
      integer :: last, term

      last = self%parameters%layers
      drive_velocity = self%drive%rate_at(self%step_time)
      drive_acceleration = self%drive%acceleration
      drive = self%drive%at(self%step_time)
      displacement = 0.0_wp
      do term = self%terms, 0, -1
         displacement = displacement * step + self%series(last, 1, term) * inverse(term + 1)
      end do
      displacement = displacement * step
      extension = step * (drive + step * (0.5_wp * drive_velocity &
         & + drive_acceleration * step / 6.0_wp)) - displacement
      if (abs(drive_acceleration) > 0.0_wp) then
         lever = 0.0_wp
         do term = self%terms, 0, -1
            lever = lever * step + self%series(last, 1, term) * inverse(term + 2)
         end do
         lever = step**2 * (0.5_wp * drive + step * (drive_velocity / 3.0_wp &
            & + 0.125_wp * drive_acceleration * step) - lever)
         call self%drive%earlier_impulse%add(self%system%spring * extension)
         call self%drive%add_work(self%system%spring &
            & * (drive_velocity * extension + drive_acceleration * lever))
      else
         call self%drive%impulse%add(self%system%spring * extension)
      end if
   end subroutine add_work

   !> Add the losses by drag and damping in a step to the energy balance.
   subroutine add_losses(self, step)
      class(slider_layered_type), intent(inout) :: self
      real(wp), intent(in) :: step

      real(wp) :: sliding, drag, damped, velocity(0:self%parameters%layers)
      integer :: last, node, term

      last = self%parameters%layers
      drag = 0.0_wp
      damped = 0.0_wp
      do node = 1, points
         sliding = horner(self%sliding, self%terms, self%point(node) * step)
         drag = drag + self%weight(node) * sliding**2
      end do
      call self%drag_loss%add(step * drag * self%system%law%drag)
      if (self%system%dashpot + self%parameters%base_damping <= 0.0_wp) return
      do node = 1, points
         velocity = self%series(:, 2, self%terms)
         do term = self%terms - 1, 0, -1
            velocity = velocity * (self%point(node) * step) + self%series(:, 2, term)
         end do
         damped = damped + step * self%weight(node) * (self%system%dashpot &
            & * sum((velocity(2:) - velocity(1:last - 1))**2) &
            & + self%parameters%base_mass * self%parameters%base_damping * velocity(0)**2)
      end do
      call self%damping_loss%add(damped)
   end subroutine add_losses

   !> The motion is that of layer 1 relative to the base.
   pure function observe(self, time) result(motion)
      class(slider_layered_type), intent(in) :: self
      real(wp), intent(in) :: time
      type(motion_type) :: motion

      real(wp) :: step, drive, first, last, base, first_velocity
      integer :: layers, term

      layers = self%parameters%layers
      step = time - self%step_time
      drive = self%drive%at(time)
      ! Side by side, term by term: these sums do not wait for each other.
      base = 0.0_wp
      first = 0.0_wp
      last = 0.0_wp
      motion%base_velocity = 0.0_wp
      first_velocity = 0.0_wp
      motion%pulled_velocity = 0.0_wp
      do term = self%terms, 0, -1
         base = base * step + self%series(0, 1, term)
         first = first * step + self%series(1, 1, term)
         last = last * step + self%series(layers, 1, term)
         motion%base_velocity = motion%base_velocity * step + self%series(0, 2, term)
         first_velocity = first_velocity * step + self%series(1, 2, term)
         motion%pulled_velocity = motion%pulled_velocity * step + self%series(layers, 2, term)
      end do
      motion%time = time
      motion%velocity = first_velocity - motion%base_velocity
      motion%drive_displacement = self%origin + drive
      motion%displacement = self%origin + first - base
      motion%spring_force = self%system%spring * (drive - last)
      motion%elastic_force = self%parameters%stiffness * (drive - first)
      motion%base_displacement = base
      motion%contact_force = self%system%law%stiffness * (first - base) - self%system%law%offset &
         & + self%system%law%drag * motion%velocity + self%system%law%rate * step
   end function observe

   pure subroutine observe_layers(self, time, displacement)
      class(slider_layered_type), intent(in) :: self
      real(wp), intent(in) :: time
      real(wp), intent(out) :: displacement(:)

      integer :: term

      displacement = self%series(1:, 1, self%terms)
      do term = self%terms - 1, 0, -1
         displacement = displacement * (time - self%step_time) + self%series(1:, 1, term)
      end do
      displacement = self%origin + displacement
   end subroutine observe_layers

   pure function energy(self)
      class(slider_layered_type), intent(in) :: self
      real(wp) :: energy

      integer :: last

      last = self%parameters%layers
      associate (x => self%state(:, 1), v => self%state(:, 2))
         energy = 0.5_wp * self%system%layer_mass * sum(v(2:)**2) &
            & + 0.5_wp * self%system%spring * (sum((x(3:) - x(2:last))**2) &
            & + (self%drive%at(self%time) - x(last + 1))**2) &
            & + 0.5_wp * self%parameters%base_mass * v(1)**2 &
            & + 0.5_wp * self%parameters%base_stiffness * x(1)**2
      end associate
   end function energy

   !> The base keeps its origin; CVODE restarts.
   subroutine shift_origin(self, shift)
      class(slider_layered_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call shift_slider(self, shift)
      self%state(1:, 1) = self%state(1:, 1) - shift
      self%integrator%is_stale = .true.
   end subroutine shift_origin

   subroutine close(self)
      type(slider_layered_type), intent(inout) :: self

      call self%integrator%close()
      if (associated(self%system)) deallocate (self%system)
   end subroutine close

   !> CVODE restarts.
   subroutine exchange(self, archive)
      class(slider_layered_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("layered slider")
      call exchange_slider(self, archive)
      call exchange_law(self%system%law, archive)
      call archive%exchange("drive", self%system%drive)
      call archive%exchange("drive_velocity", self%system%drive_velocity)
      call archive%exchange("drive_acceleration", self%system%drive_acceleration)
      call archive%exchange_fixed("state", shape(self%state), self%state)
      call archive%exchange_fixed("series", [size(self%state), max_terms + 1], self%series)
      call archive%exchange("terms", self%terms)
      call archive%exchange("steps", self%integrator_counts(1))
      call archive%exchange("evaluations", self%integrator_counts(2))
      call archive%exchange("failed_steps", self%integrator_counts(3))
      if (archive%saving) return
      call self%integrator%reset(self%integrator_counts)
   end subroutine exchange

end module mesoslip_sliders_layered
