!> A slider that moves exactly as the drive does: a velocity-controlled block, K = infinity.
module mesoslip_sliders_prescribed
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_interface_law, only: interface_law_type, window_type
   use mesoslip_schedule, only: schedule_type
   use mesoslip_step_filter, only: step_filter_type
   use mesoslip_sliders_base, only: motion_type, slider_type, exchange_slider, exchange_law, &
      & shift_law, shift_slider
   use mesoslip_sliders_hazard_clock, only: advance_clocks
   use mesoslip_sliders_scheduled, only: scheduled_slider_type
   implicit none
   private

   public :: slider_prescribed_type, make_slider_prescribed

   !> A slider whose displacement is that of the drive.
   type, extends(scheduled_slider_type) :: slider_prescribed_type
      !> Contact force during the last advance
      type(interface_law_type), private :: law
   contains
      procedure :: adapt_to_drive
      procedure :: start
      procedure :: advance
      procedure :: run_ahead
      procedure :: observe
      procedure :: energy
      procedure :: shift_origin
      procedure :: exchange
   end type slider_prescribed_type

contains

   !> Set up a prescribed slider, which has no parameters.
   subroutine make_slider_prescribed(slider, parameters, error)
      class(slider_type), allocatable, intent(out) :: slider
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(slider_prescribed_type), allocatable :: self

      allocate (self)
      self%follows_drive = .true.
      call parameters%finish(error)
      if (allocated(error)) return
      call move_alloc(self, slider)
   end subroutine make_slider_prescribed

   !> The slider has velocity and acceleration of the drive at once.
   subroutine adapt_to_drive(self)
      class(slider_prescribed_type), intent(inout) :: self

      self%velocity = self%drive%rate
      self%acceleration = self%drive%acceleration
      if (abs(self%velocity) > 0.0_wp) self%direction = sign(1.0_wp, self%velocity)
   end subroutine adapt_to_drive

   !> The slider starts with the velocity of the drive.
   subroutine start(self, law)
      class(slider_prescribed_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law

      self%law = law
      self%drive%value = 0.0_wp
      self%velocity = self%drive%rate
   end subroutine start

   subroutine advance(self, law, window)
      class(slider_prescribed_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      if (abs(self%drive%acceleration) > 0.0_wp) then
         call accelerate(self, law, window)
      else
         call move_uniformly(self, law, window)
      end if
   end subroutine advance

   subroutine run_ahead(self, schedule, filter)
      class(slider_prescribed_type), intent(inout) :: self
      type(schedule_type), intent(inout) :: schedule
      type(step_filter_type), intent(inout) :: filter

      do
         call move_uniformly(self, schedule%law(), schedule%window(self%time))
         call filter%examine(self%time, self%velocity, self%start_acceleration, self%acceleration)
         if (filter%is_selected .or. self%direction * schedule%direction < 0.0_wp) return
         call schedule%pass(self%time, self%displacement)
         if (schedule%is_over .or. filter%steps >= filter%max_steps) return
      end do
   end subroutine run_ahead

   !> One step at a constant velocity.
   pure subroutine move_uniformly(self, law, window)
      type(slider_prescribed_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      real(wp) :: limit, start, step, arrival, middle, half

      self%law = law
      self%step_time = self%time
      self%velocity = self%drive%rate
      start = self%displacement
      limit = window%upper
      if (self%velocity < 0.0_wp) limit = window%lower

      if (abs(self%velocity) > 0.0_wp .and. abs(limit - start) &
         & <= abs(self%velocity) * (window%end_time - self%time)) then
         arrival = self%drive%time + (limit - self%drive%value) / self%velocity
         self%time = min(max(arrival, self%time), window%end_time)
         self%displacement = limit
      else
         self%time = window%end_time
         self%displacement = self%drive%value &
            & + self%velocity * (self%time - self%drive%time)
      end if
      if (self%has_clocks) call end_at_clock(self)
      if (abs(self%velocity) > 0.0_wp) self%direction = sign(1.0_wp, self%velocity)

      step = self%displacement - start
      middle = law%stiffness * (start + 0.5_wp * step) - law%offset + law%drag * self%velocity &
         & + 0.5_wp * law%rate * (self%time - self%step_time)
      call self%drive%impulse%add((self%time - self%step_time) * middle)
      call self%drag_loss%add(step * law%drag * self%velocity)
      half = abs(0.5_wp * (law%stiffness * step + law%rate * (self%time - self%step_time)))
      if (middle + half > self%drive%extremes%max_force &
         & .or. middle - half < self%drive%extremes%min_force) then
         call note(self, self%step_time, start, self%velocity)
         call note(self, self%time, self%displacement, self%velocity)
      end if
   end subroutine move_uniformly

   !> One step while the drive has an acceleration, in which it does not turn round.
   pure subroutine accelerate(self, law, window)
      type(slider_prescribed_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      real(wp) :: limit, start, step, distance, early, late, time, pace

      self%law = law
      self%step_time = self%time
      self%acceleration = self%drive%acceleration
      self%start_acceleration = self%drive%acceleration
      start = self%displacement
      early = self%drive%rate_at(self%time)
      limit = merge(window%upper, window%lower, self%drive%direction > 0.0_wp)

      self%displacement = self%drive%at(window%end_time)
      if (self%drive%direction * (self%displacement - limit) >= 0.0_wp) then
         distance = limit - self%drive%value
         late = self%drive%direction * sqrt(max(0.0_wp, &
            & self%drive%rate**2 + 2.0_wp * self%drive%acceleration * distance))
         ! The form of the root in which nothing cancels.
         pace = self%drive%rate + late
         if (self%drive%direction * self%drive%rate < 0.0_wp) then
            time = (late - self%drive%rate) / self%drive%acceleration
         else if (abs(pace) > 0.0_wp) then
            time = 2.0_wp * distance / pace
         else
            time = 0.0_wp
         end if
         self%time = min(max(self%drive%time + time, self%time), window%end_time)
         self%displacement = limit
      else
         self%time = window%end_time
         late = self%drive%rate_at(self%time)
      end if
      if (self%has_clocks) then
         self%velocity = early
         call end_at_clock(self)
         late = self%drive%rate_at(self%time)
      end if
      self%velocity = late
      if (abs(late) > 0.0_wp) self%direction = sign(1.0_wp, late)

      distance = self%displacement - start
      step = self%time - self%step_time
      call self%drive%add_work(distance * (law%stiffness * (start + 0.5_wp * distance) &
         & - law%offset) + law%drag * square() &
         & + law%rate * step**2 * (0.5_wp * early + self%drive%acceleration * step / 3.0_wp))
      call self%drag_loss%add(law%drag * square())
      call self%drive%earlier_impulse%add(step * (law%stiffness * (start + step * (0.5_wp * early &
         & + self%drive%acceleration * step / 6.0_wp)) - law%offset + 0.5_wp * law%rate * step) &
         & + law%drag * distance)
      call note(self, self%step_time, start, early)
      call note(self, self%time, self%displacement, late)
      if (abs(law%stiffness) > 0.0_wp) then
         ! The force of the contacts grows as fast as drag and rate decrease there.
         time = -(law%drag + law%rate / self%drive%acceleration) / law%stiffness &
            & - early / self%drive%acceleration
         if (time > 0.0_wp .and. time < step) call note(self, self%step_time + time, start + time &
            & * (early + 0.5_wp * self%drive%acceleration * time), &
            & early + self%drive%acceleration * time)
      end if

   contains

      !> Integral of the velocity squared over the step.
      pure real(wp) function square()
         square = step * (early**2 + early * late + late**2) / 3.0_wp
      end function square

   end subroutine accelerate

   !> End a step where a clock reaches its reading.
   pure subroutine end_at_clock(self)
      type(slider_prescribed_type), intent(inout) :: self

      real(wp) :: step
      logical :: is_due

      step = self%time - self%step_time
      call advance_clocks(self%clock, [self%velocity, self%drive%acceleration], &
         & merge(2, 1, abs(self%drive%acceleration) > 0.0_wp), step, is_due)
      if (.not. is_due) return
      self%time = self%step_time + step
      self%displacement = self%drive%at(self%time)
   end subroutine end_at_clock

   !> Note the contact force at a time of the last step, for its extremes.
   pure subroutine note(self, time, displacement, velocity)
      type(slider_prescribed_type), intent(inout) :: self
      real(wp), intent(in) :: time, displacement, velocity

      call self%drive%extremes%note(self%law%stiffness * displacement - self%law%offset &
         & + self%law%drag * velocity + self%law%rate * (time - self%step_time), time, &
         & self%origin + displacement)
   end subroutine note

   pure function observe(self, time) result(motion)
      class(slider_prescribed_type), intent(in) :: self
      real(wp), intent(in) :: time
      type(motion_type) :: motion

      real(wp) :: displacement

      displacement = self%drive%at(time)
      motion%time = time
      motion%displacement = self%origin + displacement
      motion%drive_displacement = motion%displacement
      motion%velocity = self%drive%rate_at(time)
      motion%pulled_velocity = motion%velocity
      motion%contact_force = self%law%stiffness * displacement - self%law%offset &
         & + self%law%drag * motion%velocity + self%law%rate * (time - self%step_time)
      motion%spring_force = motion%contact_force
   end function observe

   !> The slider has neither mass nor spring.
   pure function energy(self)
      class(slider_prescribed_type), intent(in) :: self
      real(wp) :: energy

      energy = 0.0_wp
   end function energy

   subroutine shift_origin(self, shift)
      class(slider_prescribed_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call shift_slider(self, shift)
      call shift_law(self%law, shift)
   end subroutine shift_origin

   subroutine exchange(self, archive)
      class(slider_prescribed_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("prescribed slider")
      call exchange_slider(self, archive)
      call exchange_law(self%law, archive)
   end subroutine exchange

end module mesoslip_sliders_prescribed
