!> A slider without inertia that follows the stable equilibrium of spring and contacts.
!>
!> Under a linear law of the contact force the equilibrium is one division. After a change of
!> contacts the slider jumps to it, or to the first contact before it, while the drive stands still;
!> then it moves with the drive, which moves the end of the spring.
module mesoslip_sliders_quasistatic
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_sliders_base, only: exchange_law, motion_type, shift_law, shift_slider, slider_type
   use mesoslip_sliders_hazard_clock, only: advance_clocks
   use mesoslip_sliders_instant, only: exchange_instant, instant_slider_type
   implicit none
   private

   public :: slider_quasistatic_type, make_slider_quasistatic

   !> Contacts farther away are ignored [m].
   real(wp), parameter :: max_distance = 1.0e150_wp

   !> A slider in equilibrium.
   type, extends(instant_slider_type) :: slider_quasistatic_type
      !> Stiffness of the drive's spring K [N/m]; 0 for none
      real(wp) :: stiffness = 0.0_wp
      !> Force of the drive on the slider at displacement 0, over the drive's value: K [N/m] of a
      !> spring, 1 [N/N] for a force
      real(wp) :: pull_over_value = 0.0_wp
      !> Contact force during the last advance
      type(interface_law_type) :: law
   contains
      procedure :: start
      procedure :: advance
      procedure :: observe
      procedure :: energy
      procedure :: shift_origin
      procedure :: exchange
      procedure, non_overridable :: pull
      procedure :: add_jump
      procedure :: add_motion
      procedure, non_overridable, private :: jump, follow_drive
   end type slider_quasistatic_type

contains

   !> Set up a slider in equilibrium from named numbers.
   subroutine make_slider_quasistatic(slider, parameters, error)
      class(slider_type), allocatable, intent(out) :: slider
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(slider_quasistatic_type), allocatable :: self

      allocate (self)
      call parameters%take("stiffness", self%stiffness, error)
      call parameters%finish(error)
      if (allocated(error)) return
      self%pull_over_value = self%stiffness
      call move_alloc(self, slider)
   end subroutine make_slider_quasistatic

   subroutine start(self, law)
      class(slider_quasistatic_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law

      self%law = law
      self%drive%value = self%displacement &
         & + (law%stiffness * self%displacement - law%offset) / self%pull_over_value
      self%rest_displacement = self%displacement
   end subroutine start

   !> Jump to the equilibrium or to the first contact before it; then move until the window's end.
   subroutine advance(self, law, window)
      class(slider_quasistatic_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      real(wp) :: pull, start

      self%law = law
      self%step_time = self%time
      self%velocity = 0.0_wp
      self%acceleration = 0.0_wp
      self%is_settled = .false.
      if (.not. self%stiffness + law%stiffness > 0.0_wp) then
         self%is_unbound = .true.
         return
      end if
      pull = self%pull(self%time)
      start = self%displacement
      call self%jump(window, pull)
      call note(self, pull)
      if (.not. self%is_settled) return
      ! Clocks stand still in a jump, and have another rate after it.
      if (self%has_clocks) then
         self%clock%rate = self%clock%rate * exp(self%clock%slope * (self%displacement - start))
      end if
      call self%follow_drive(window)
      call note(self, self%pull(self%time))
   end subroutine advance

   !> Jump to the equilibrium or to the first contact before it.
   subroutine jump(self, window, pull)
      class(slider_quasistatic_type), intent(inout) :: self
      type(window_type), intent(in) :: window
      !> Force of the drive at displacement 0 [N]
      real(wp), intent(in) :: pull

      real(wp) :: stiffness, start, target, distance

      stiffness = self%stiffness + self%law%stiffness
      start = self%displacement
      target = (pull + self%law%offset) / stiffness
      self%is_settled = target < window%upper .and. target > window%lower
      self%displacement = min(max(target, window%lower), window%upper)
      distance = self%displacement - start
      if (.not. abs(distance) > 0.0_wp) return
      self%direction = sign(1.0_wp, distance)
      call self%damping_loss%add(distance * stiffness * (target - start - 0.5_wp * distance))
      call self%add_jump(distance, pull)
   end subroutine jump

   !> Move with the drive from the equilibrium until the window's end.
   subroutine follow_drive(self, window)
      class(slider_quasistatic_type), intent(inout) :: self
      type(window_type), intent(in) :: window

      real(wp) :: stiffness, start, distance, lower, upper, limit, arrival, step
      logical :: is_due

      stiffness = self%stiffness + self%law%stiffness
      start = self%displacement
      self%rest_displacement = start
      self%velocity = self%drive%rate_at(self%time) * self%pull_over_value / stiffness
      self%acceleration = self%drive%acceleration * self%pull_over_value / stiffness
      upper = min(window%upper, max(self%stop_upper, start))
      lower = max(window%lower, min(self%stop_lower, start))
      limit = merge(upper, lower, self%drive%direction > 0.0_wp)
      arrival = time_of(limit - start, self%velocity, self%acceleration)
      if (arrival < huge(1.0_wp) .and. arrival <= window%end_time - self%time) then
         self%time = min(self%time + arrival, window%end_time)
         self%displacement = limit
      else
         self%time = window%end_time
         self%displacement = (self%pull(self%time) + self%law%offset) / stiffness
         ! Rounding could take it beyond a contact that is about to break.
         self%displacement = min(max(self%displacement, lower), upper)
      end if
      step = self%time - self%step_time
      if (self%has_clocks) then
         call advance_clocks(self%clock, [self%velocity, self%acceleration], &
            & merge(2, 1, abs(self%acceleration) > 0.0_wp), step, is_due)
         if (is_due) then
            self%time = self%step_time + step
            self%displacement = (self%pull(self%time) + self%law%offset) / stiffness
            self%displacement = min(max(self%displacement, lower), upper)
            step = self%time - self%step_time
         end if
      end if
      distance = self%displacement - start
      if (abs(distance) > 0.0_wp) self%direction = sign(1.0_wp, distance)
      call self%add_motion(step, distance)
      if (abs(self%acceleration) > 0.0_wp) then
         self%velocity = self%velocity + self%acceleration * step
      end if
   end subroutine follow_drive

   !> Add the work of the drive in a jump to the energy balance: that of a spring whose end stands
   !> still is zero.
   subroutine add_jump(self, distance, pull)
      class(slider_quasistatic_type), intent(inout) :: self
      !> Displacement in the jump [m], and force of the drive at displacement 0 [N]
      real(wp), intent(in) :: distance, pull

   end subroutine add_jump

   !> Add work and impulse of the drive in the motion of the last advance to the energy balance.
   subroutine add_motion(self, step, distance)
      class(slider_quasistatic_type), intent(inout) :: self
      !> Duration [s] and displacement [m] of the motion
      real(wp), intent(in) :: step, distance

      real(wp) :: middle

      associate (law => self%law, drive => self%drive, start => self%rest_displacement)
         ! In equilibrium the contact force is that of the spring, with more digits if it is stiff.
         middle = law%stiffness * (start + 0.5_wp * distance) - law%offset
         if (abs(drive%acceleration) > 0.0_wp) then
            call drive%add_work(step * (drive%rate_at(self%step_time) &
               & + 0.5_wp * drive%acceleration * step) * middle)
            call drive%earlier_impulse%add(step * (law%stiffness * (start + step * (0.5_wp &
               & * self%velocity + self%acceleration * step / 6.0_wp)) - law%offset))
         else
            call drive%impulse%add(step * middle)
         end if
      end associate
   end subroutine add_motion

   !> Duration of a displacement without a turn; huge if the motion does not reach it.
   pure function time_of(distance, velocity, acceleration) result(time)
      !> Displacement [m], velocity at first [m/s], acceleration [m/s2]
      real(wp), intent(in) :: distance, velocity, acceleration
      real(wp) :: time

      real(wp) :: square, pace

      time = huge(1.0_wp)
      if (abs(distance) > max_distance) return
      if (abs(acceleration) > 0.0_wp) then
         square = velocity**2 + 2.0_wp * acceleration * distance
         if (square < 0.0_wp) return
         pace = abs(velocity) + sqrt(square)
         if (abs(distance) > 0.0_wp .and. pace > abs(distance) / time) then
            time = 2.0_wp * abs(distance) / pace
         end if
         if (.not. abs(distance) > 0.0_wp) time = 0.0_wp
      else if (abs(velocity) > 0.0_wp) then
         time = distance / velocity
      end if
   end function time_of

   !> Note the force of the drive where the slider is.
   subroutine note(self, pull)
      class(slider_quasistatic_type), intent(inout) :: self
      !> Force of the drive at displacement 0 [N]
      real(wp), intent(in) :: pull

      call self%drive%extremes%note(pull - self%stiffness * self%displacement, self%time, &
         & self%origin + self%displacement)
   end subroutine note

   !> Force of the drive on the slider at displacement 0 [N].
   pure function pull(self, time) result(force)
      class(slider_quasistatic_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      real(wp) :: force

      force = self%drive%at(time) * self%pull_over_value
   end function pull

   pure function observe(self, time) result(motion)
      class(slider_quasistatic_type), intent(in) :: self
      real(wp), intent(in) :: time
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
      motion%drive_displacement = self%origin + self%drive%at(time)
   end function observe

   pure function energy(self)
      class(slider_quasistatic_type), intent(in) :: self
      real(wp) :: energy

      energy = 0.5_wp * self%stiffness * (self%drive%at(self%time) - self%displacement)**2
   end function energy

   subroutine shift_origin(self, shift)
      class(slider_quasistatic_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call shift_slider(self, shift)
      self%rest_displacement = self%rest_displacement - shift
      call shift_law(self%law, shift)
   end subroutine shift_origin

   subroutine exchange(self, archive)
      class(slider_quasistatic_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("quasistatic slider")
      call exchange_instant(self, archive)
      call exchange_law(self%law, archive)
   end subroutine exchange

end module mesoslip_sliders_quasistatic
