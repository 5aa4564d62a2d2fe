!> A slider without inertia that follows the stable equilibrium of spring and contacts.
!>
!> Under a linear law of the contact force the equilibrium is one division away. Where contacts have
!> changed since, the slider jumps to it, or to the first contact on the way, while the drive
!> stands still; then it goes with the drive. The drive moves the end of the spring, or, without a
!> spring, is a force itself.
module mesoslip_sliders_quasistatic
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_sliders_base, only: motion_type, slider_type, exchange_slider, &
      & exchange_law, shift_slider
   implicit none
   private

   public :: slider_quasistatic_type, make_slider_quasistatic

   !> A slider in equilibrium.
   type, extends(slider_type) :: slider_quasistatic_type
      !> Stiffness of the drive's spring K [N/m]; zero if the drive is a force [N] that grows at a
      !> rate [N/s], for which the drive's displacement and velocity stand
      real(wp) :: stiffness = 0.0_wp
      !> Contact force during the last advance
      type(interface_law_type), private :: law
   contains
      procedure :: start
      procedure :: advance
      procedure :: observe
      procedure :: energy
      procedure :: shift_origin
      procedure :: exchange
      procedure, non_overridable, private :: pull
   end type slider_quasistatic_type

contains

   !> Set up a slider in equilibrium from named numbers.
   subroutine make_slider_quasistatic(slider, parameters, error)
      !> The slider
      class(slider_type), allocatable, intent(out) :: slider
      !> Stiffness of the drive's spring; 0 if the drive is a force
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or superfluous
      type(error_type), allocatable, intent(inout) :: error

      type(slider_quasistatic_type), allocatable :: self

      allocate (self)
      call parameters%take("stiffness", self%stiffness, error)
      call parameters%finish(error)
      if (allocated(error)) return
      self%under_force = .not. self%stiffness > 0.0_wp
      self%notes_extremes = .true.
      call move_alloc(self, slider)
   end subroutine make_slider_quasistatic

   !> Put the slider in balance with the contacts.
   subroutine start(self, law)
      !> The slider, its displacement zero
      class(slider_quasistatic_type), intent(inout) :: self
      !> Contact force at the start
      type(interface_law_type), intent(in) :: law

      self%law = law
      self%instant = .true.
      self%drive_displacement = law%stiffness * self%displacement - law%offset
      if (self%stiffness > 0.0_wp) self%drive_displacement = self%displacement &
         & + self%drive_displacement / self%stiffness
      self%rest_displacement = self%displacement
   end subroutine start

   !> Jump to equilibrium or to the first contact on the way; then move until the window's end.
   subroutine advance(self, law, window)
      !> The slider
      class(slider_quasistatic_type), intent(inout) :: self
      !> Contact force
      type(interface_law_type), intent(in) :: law
      !> Where the law holds
      type(window_type), intent(in) :: window

      real(wp) :: stiffness, start, target, way, pull, rate, limit, middle, change
      real(wp) :: arrival, step
      logical :: reaches

      self%instant = .true.
      self%law = law
      self%step_time = self%time
      self%velocity = 0.0_wp
      self%acceleration = 0.0_wp
      self%settled = .false.
      stiffness = self%stiffness + law%stiffness
      if (.not. stiffness > 0.0_wp) then
         self%unbound = .true.
         return
      end if

      start = self%displacement
      pull = self%pull(self%time)
      target = (pull + law%offset) / stiffness
      self%settled = target < window%upper .and. target > window%lower
      self%displacement = min(max(target, window%lower), window%upper)
      way = self%displacement - start
      if (abs(way) > 0.0_wp) then
         self%direction = sign(1.0_wp, way)
         call self%damping_loss%add(way * stiffness * (target - start - 0.5_wp * way))
         if (.not. self%stiffness > 0.0_wp) call self%earlier_work%add(way * pull)
      end if
      call note(self)
      if (.not. self%settled) return

      start = self%displacement
      self%rest_displacement = start
      rate = self%drive_velocity_at(self%time)
      change = self%drive_acceleration
      if (self%stiffness > 0.0_wp) then
         rate = rate * self%stiffness
         change = change * self%stiffness
      end if
      self%velocity = rate / stiffness
      self%acceleration = change / stiffness
      limit = window%upper
      if (self%drive_direction < 0.0_wp) limit = window%lower
      arrival = time_of(limit - start, self%velocity, self%acceleration)
      reaches = arrival < huge(1.0_wp) .and. arrival <= window%end_time - self%time
      if (reaches) then
         self%time = min(self%time + arrival, window%end_time)
         self%displacement = limit
      else
         self%time = window%end_time
         self%displacement = (self%pull(self%time) + law%offset) / stiffness
         ! Rounding may take it to the other side of a contact that is about to break.
         self%displacement = min(max(self%displacement, window%lower), window%upper)
      end if

      way = self%displacement - start
      if (abs(way) > 0.0_wp) self%direction = sign(1.0_wp, way)
      step = self%time - self%step_time
      ! In equilibrium the contact force is that of the spring, with more digits if it is stiff.
      middle = law%stiffness * (start + 0.5_wp * way) - law%offset
      if (abs(self%acceleration) > 0.0_wp) then
         call self%earlier_work%add(step * (self%drive_velocity_at(self%step_time) &
            & + 0.5_wp * self%drive_acceleration * step) * middle)
         call self%stage_impulse%add(step * (law%stiffness * (start + step * (0.5_wp &
            & * self%velocity + self%acceleration * step / 6.0_wp)) - law%offset))
         self%velocity = self%velocity + self%acceleration * step
      else if (self%stiffness > 0.0_wp) then
         call self%impulse%add(step * middle)
      else
         call self%earlier_work%add(way * (pull + 0.5_wp * rate * step))
         call self%impulse%add(step * (pull + 0.5_wp * rate * step))
      end if
      call note(self)
   end subroutine advance

   !> Time in which a motion makes a way, without turning round; huge if it does not move.
   pure function time_of(way, velocity, acceleration) result(time)
      !> Way [m], velocity at first [m/s], acceleration [m/s2]
      real(wp), intent(in) :: way, velocity, acceleration
      real(wp) :: time

      real(wp) :: square, pace

      time = huge(1.0_wp)
      if (abs(acceleration) > 0.0_wp) then
         square = velocity**2 + 2.0_wp * acceleration * way
         if (square < 0.0_wp) return
         pace = abs(velocity) + sqrt(square)
         if (abs(way) > 0.0_wp .and. pace > abs(way) / time) time = 2.0_wp * abs(way) / pace
         if (.not. abs(way) > 0.0_wp) time = 0.0_wp
      else if (abs(velocity) > 0.0_wp) then
         time = way / velocity
      end if
   end function time_of

   !> Note the force of the drive where the slider is.
   pure subroutine note(self)
      type(slider_quasistatic_type), intent(inout) :: self

      call self%extremes%note(self%pull(self%time) - self%stiffness * self%displacement, &
         & self%time, self%origin + self%displacement)
   end subroutine note

   !> Force of the drive on a slider without displacement.
   pure function pull(self, time) result(force)
      class(slider_quasistatic_type), intent(in) :: self
      real(wp), intent(in) :: time
      real(wp) :: force

      force = self%drive_at(time)
      if (self%stiffness > 0.0_wp) force = force * self%stiffness
   end function pull

   !> The motion at a time of the last advance.
   pure function observe(self, time) result(motion)
      !> The slider
      class(slider_quasistatic_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> The motion; under a force the drive is where the slider is
      type(motion_type) :: motion

      real(wp) :: displacement, step

      ! The velocity is that at the end.
      step = time - self%step_time
      motion%velocity = self%velocity + self%acceleration * (time - self%time)
      displacement = self%rest_displacement &
         & + (motion%velocity - 0.5_wp * self%acceleration * step) * step
      motion%time = time
      motion%displacement = self%origin + displacement
      motion%pulled_velocity = motion%velocity
      motion%contact_force = self%law%stiffness * displacement - self%law%offset
      motion%spring_force = self%pull(time) - self%stiffness * displacement
      motion%elastic_force = motion%spring_force
      motion%drive_displacement = motion%displacement
      if (self%stiffness > 0.0_wp) motion%drive_displacement = self%origin + self%drive_at(time)
   end function observe

   !> Energy of the drive's spring.
   pure function energy(self)
      !> The slider
      class(slider_quasistatic_type), intent(in) :: self
      !> Energy [J]
      real(wp) :: energy

      energy = 0.0_wp
      if (self%stiffness > 0.0_wp) then
         energy = 0.5_wp * self%stiffness * (self%drive_at(self%time) - self%displacement)**2
      end if
   end function energy

   !> Move the origin of displacements; ends what can be observed of the last advance.
   subroutine shift_origin(self, shift)
      !> The slider
      class(slider_quasistatic_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      real(wp) :: force

      force = self%drive_at(self%time)
      call shift_slider(self, shift)
      if (.not. self%stiffness > 0.0_wp) self%drive_displacement = force
   end subroutine shift_origin

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      !> The slider
      class(slider_quasistatic_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%section("quasistatic slider")
      call exchange_slider(self, archive)
      call exchange_law(self%law, archive)
   end subroutine exchange

end module mesoslip_sliders_quasistatic
