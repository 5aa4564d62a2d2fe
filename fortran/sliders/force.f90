!> A slider with mass under a force, without a spring: M V' = F_ext - F - M eta_S V.
!>
!> Under a linear law of the contact force the motion is that of a linear system with constant
!> coefficients, advanced by its Taylor series as that of a rigid slider. A motion that has settled
!> to uniform creep is advanced in one step, however long.
module mesoslip_sliders_force
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_quadrature, only: gauss_legendre
   use mesoslip_sliders_base, only: exchange_law, exchange_slider, motion_type, slider_type
   use mesoslip_sliders_hazard_clock, only: advance_clocks, limit_window
   use mesoslip_sliders_motion_series, only: first_end, horner, integral, inverse, long_time, &
      & rounding, second_integral
   implicit none
   private

   public :: slider_force_type, make_slider_force

   !> Terms of the series: those left out are less than 1e-16 of the first ones in a step of half a
   !> radian
   integer, parameter :: terms = 17
   !> Points of the rule for the losses of a step
   integer, parameter :: nodes = 6

   !> A slider with mass under a force.
   type, extends(slider_type) :: slider_force_type
      !> Mass M [kg], damping rate eta_S [1/s]
      real(wp), private :: mass = 1.0_wp, damping = 0.0_wp
      !> Contact force during the last advance, and displacement at its start [m]
      type(interface_law_type), private :: law
      real(wp), private :: start_displacement = 0.0_wp
      !> Taylor coefficients of the velocity in the time since then
      real(wp), private :: series(0:terms - 1) = 0.0_wp
      !> Gauss-Legendre rule on [0, 1]
      real(wp), private :: point(nodes), weight(nodes)
   contains
      procedure :: start
      procedure :: advance
      procedure :: observe
      procedure :: energy
      procedure :: shift_origin
      procedure :: exchange
   end type slider_force_type

contains

   !> Set up a slider under a force from named numbers.
   subroutine make_slider_force(slider, parameters, error)
      class(slider_type), allocatable, intent(out) :: slider
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(slider_force_type), allocatable :: self

      allocate (self)
      call parameters%take("mass", self%mass, error)
      call parameters%take("damping", self%damping, error)
      call parameters%finish(error)
      if (allocated(error)) return
      self%inverse_mass = 1.0_wp / self%mass
      call gauss_legendre(self%point, self%weight)
      call move_alloc(self, slider)
   end subroutine make_slider_force

   !> The slider starts at rest; the force, not in balance with the contacts, acts from now on.
   subroutine start(self, law)
      class(slider_force_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law

      self%law = law
      self%velocity = 0.0_wp
      self%start_displacement = self%displacement
      self%series = 0.0_wp
   end subroutine start

   subroutine advance(self, law, window)
      class(slider_force_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      type(window_type) :: bounds
      real(wp) :: force, step

      self%law = law
      self%step_time = self%time
      self%start_displacement = self%displacement
      bounds = window
      if (self%has_clocks) call limit_window(self%clock, self%time, self%velocity, bounds)
      force = self%drive%at(self%time)
      self%start_acceleration = acceleration_under(self, force, 0.0_wp)

      if (is_settled(self, force, bounds%end_time - self%time)) then
         call glide(self, bounds, step)
      else
         call move(self, bounds, step)
      end if

      call add_work(self, force, step)
      self%acceleration = acceleration_under(self, self%drive%at(self%time), step)
      if (abs(self%velocity) > 0.0_wp) self%direction = sign(1.0_wp, self%velocity)
   end subroutine advance

   !> Acceleration of the slider where it is [m/s2].
   pure function acceleration_under(self, force, since) result(acceleration)
      type(slider_force_type), intent(in) :: self
      !> Force [N], and time since the start of the advance [s]
      real(wp), intent(in) :: force, since
      real(wp) :: acceleration

      acceleration = self%inverse_mass * ((force - (self%law%stiffness * self%displacement &
         & - self%law%offset + self%law%rate * since)) - self%law%drag * self%velocity) &
         & - self%damping * self%velocity
   end function acceleration_under

   !> Velocity of uniform creep under a force that changes linearly [m/s].
   pure function creep_velocity(self) result(velocity)
      type(slider_force_type), intent(in) :: self
      real(wp) :: velocity

      velocity = (self%drive%rate - self%law%rate) / self%law%stiffness
   end function creep_velocity

   !> Whether the motion differs from uniform creep by less than rounding or the resolution of the
   !> contact force. Pinned contacts and a damper lead to creep.
   pure function is_settled(self, force, step) result(settled)
      type(slider_force_type), intent(in) :: self
      !> Force [N], and duration of the step [s]
      real(wp), intent(in) :: force, step
      logical :: settled

      real(wp) :: noise

      settled = .false.
      if (.not. (self%law%stiffness > 0.0_wp &
         & .and. self%law%drag + self%mass * self%damping > 0.0_wp)) return
      noise = rounding * (abs(force) + abs(self%law%stiffness * self%displacement) &
         & + abs(self%law%offset))
      if (is_long(self, step)) noise = max(noise, self%law%tolerance)
      settled = self%mass * abs(self%start_acceleration) <= noise &
         & .and. sqrt(self%mass * self%law%stiffness) &
         & * abs(self%velocity - creep_velocity(self)) <= noise
   end function is_settled

   !> Whether a step is so long that an oscillation below the resolution of the contact force is
   !> ignored.
   pure function is_long(self, step)
      type(slider_force_type), intent(in) :: self
      real(wp), intent(in) :: step
      logical :: is_long

      is_long = self%law%tolerance > 0.0_wp &
         & .and. step * sqrt(abs(self%law%stiffness) * self%inverse_mass) > long_time
   end function is_long

   !> Creep uniformly to the first end of the window.
   subroutine glide(self, window, step)
      type(slider_force_type), intent(inout) :: self
      type(window_type), intent(in) :: window
      !> Duration of the motion [s]
      real(wp), intent(out) :: step

      real(wp) :: velocity, gap, target, longest
      logical :: crosses, is_due

      step = window%end_time - self%time
      velocity = creep_velocity(self)
      ! The slider is in balance at the end of the step.
      if (is_long(self, step)) velocity = velocity &
         & + self%start_acceleration * self%mass / (self%law%stiffness * step)
      self%velocity = velocity
      self%series = 0.0_wp
      self%series(0) = velocity
      target = merge(window%upper, window%lower, velocity > 0.0_wp)
      gap = abs(target - self%displacement)
      longest = step
      crosses = abs(velocity) * step >= gap .and. abs(velocity) > 0.0_wp
      if (crosses) step = gap / abs(velocity)
      is_due = .false.
      if (self%has_clocks) call advance_clocks(self%clock, self%series, 1, step, is_due)
      crosses = crosses .and. .not. is_due
      self%displacement = merge(target, self%displacement + velocity * step, crosses)
      self%time = merge(self%time + step, window%end_time, crosses .or. step < longest)
   end subroutine glide

   !> Move as far as a series reaches, or to the first end of the window or turning point before.
   subroutine move(self, window, step)
      type(slider_force_type), intent(inout) :: self
      type(window_type), intent(in) :: window
      !> Duration of the motion [s]
      real(wp), intent(out) :: step

      real(wp) :: rate, change, target, direction
      logical :: ends, crosses, turns, is_due
      integer :: term

      rate = sqrt(abs(self%law%stiffness) * self%inverse_mass) &
         & + self%law%drag * self%inverse_mass + self%damping
      step = window%end_time - self%time
      ends = step * rate <= window%max_phase
      if (.not. ends) step = window%max_phase / rate
      call forget_rounding(self)
      call expand(self)
      change = 0.0_wp
      do term = terms - 1, 1, -1
         change = (change + abs(self%series(term))) * step
      end do
      associate (longest => window%end_time - self%time)
         call first_end(self%series, terms, window%upper - self%displacement, &
            & window%lower - self%displacement, change, step, crosses, turns, direction)
         is_due = .false.
         if (self%has_clocks) call advance_clocks(self%clock, self%series, terms, step, is_due)
         crosses = crosses .and. .not. is_due
         turns = turns .and. .not. is_due
         ends = ends .and. .not. (crosses .or. turns .or. is_due) .and. step >= longest
      end associate
      target = merge(window%upper, window%lower, direction > 0.0_wp)
      if (crosses) then
         self%displacement = target
      else
         self%displacement = self%displacement + integral(self%series, terms, step)
      end if
      if (ends) then
         self%time = window%end_time
      else
         self%time = self%time + step
      end if
      self%velocity = horner(self%series, terms, step)
      if (turns) self%velocity = 0.0_wp
   end subroutine move

   !> Start from rest where a growing force turns the slider within the resolution of time: it would
   !> turn there without end.
   subroutine forget_rounding(self)
      type(slider_force_type), intent(inout) :: self

      real(wp) :: jerk, resolution

      jerk = abs(self%drive%rate - self%law%rate) * self%inverse_mass
      resolution = spacing(self%time)
      if (abs(self%start_acceleration) > jerk * resolution) return
      if (abs(self%velocity) > jerk * resolution**2) return
      self%velocity = 0.0_wp
      self%start_acceleration = 0.0_wp
   end subroutine forget_rounding

   !> Taylor coefficients of the velocity, from the equation of motion.
   subroutine expand(self)
      type(slider_force_type), intent(inout) :: self

      real(wp) :: driving, drag
      integer :: term

      driving = (self%drive%rate - self%law%rate) * self%inverse_mass
      drag = self%law%drag * self%inverse_mass + self%damping
      self%series(0) = self%velocity
      self%series(1) = self%start_acceleration
      do term = 2, terms - 1
         self%series(term) = inverse(term) * (inverse(term - 1) * (driving &
            & - self%law%stiffness * self%inverse_mass * self%series(term - 2)) &
            & - drag * self%series(term - 1))
         driving = 0.0_wp
      end do
   end subroutine expand

   !> Add work and impulse of the force in a step, and the losses, to the energy balance.
   subroutine add_work(self, force, step)
      type(slider_force_type), intent(inout) :: self
      !> Force at the start [N], and duration [s]
      real(wp), intent(in) :: force, step

      real(wp) :: distance, swept, squares
      integer :: node

      distance = self%displacement - self%start_displacement
      swept = second_integral(self%series, terms, step)
      squares = 0.0_wp
      do node = 1, nodes
         squares = squares + self%weight(node) &
            & * horner(self%series, terms, self%point(node) * step)**2
      end do
      squares = squares * step
      call self%drive%add_work(force * distance &
         & + self%drive%rate * (step * distance - swept))
      call self%drive%earlier_impulse%add(step * (force + 0.5_wp * self%drive%rate * step))
      call self%drag_loss%add(self%law%drag * squares)
      call self%damping_loss%add(self%mass * self%damping * squares)
   end subroutine add_work

   !> The drive's displacement is that of the slider.
   pure function observe(self, time) result(motion)
      class(slider_force_type), intent(in) :: self
      real(wp), intent(in) :: time
      type(motion_type) :: motion

      real(wp) :: step, displacement

      step = time - self%step_time
      displacement = self%start_displacement + integral(self%series, terms, step)
      motion%time = time
      motion%displacement = self%origin + displacement
      motion%drive_displacement = motion%displacement
      motion%velocity = horner(self%series, terms, step)
      motion%pulled_velocity = motion%velocity
      motion%spring_force = self%drive%at(time)
      motion%elastic_force = motion%spring_force
      motion%contact_force = self%law%stiffness * displacement - self%law%offset &
         & + self%law%drag * motion%velocity + self%law%rate * step
   end function observe

   pure function energy(self)
      class(slider_force_type), intent(in) :: self
      real(wp) :: energy

      energy = 0.5_wp * self%mass * self%velocity**2
   end function energy

   !> The force does not depend on the origin.
   subroutine shift_origin(self, shift)
      class(slider_force_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call self%drive%rebase(self%time, 0.0_wp)
      self%displacement = self%displacement - shift
      self%origin = self%origin + shift
   end subroutine shift_origin

   subroutine exchange(self, archive)
      class(slider_force_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("slider under a force")
      call exchange_slider(self, archive)
      call exchange_law(self%law, archive)
      call archive%exchange("start_displacement", self%start_displacement)
      call archive%exchange_fixed("series", [terms, 1], self%series)
   end subroutine exchange

end module mesoslip_sliders_force
