!> A rigid slider on a spring, Eqs. S40 and S41, advanced exactly.
!>
!> Under a linear law of the contact force the motion is that of a linear system with constant
!> coefficients. It is advanced by its Taylor series over steps so short that the series is exact to
!> rounding. Times between events are short compared with any period of the system, so that a few
!> terms are enough.
module mesoslip_sliders_rigid
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_schedule, only: schedule_type
   use mesoslip_sliders_base, only: exchange_law, exchange_slider, motion_type, shift_law, &
      & shift_slider, slider_type
   use mesoslip_sliders_hazard_clock, only: limit_window
   use mesoslip_sliders_motion_series, only: horner, integral
   use mesoslip_sliders_rigid_long_step, only: take_long_step
   use mesoslip_sliders_rigid_settled_step, only: try_settled_step
   use mesoslip_sliders_rigid_short_step, only: audit, books_of, derive, find_end, &
      & keep_series, look_ahead, move, short_step_type, step_books_type, try_short_step
   use mesoslip_sliders_rigid_state, only: constants, drive_gap_at, few_terms, long_terms, &
      & many_terms, motion_rates, motion_rates_type, rates, rigid_motion_type, rigid_state_type, &
      & some_terms, system_type, uniform_gap
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: slider_rigid_type, make_slider_rigid

   !> A rigid slider on a spring.
   type, extends(rigid_state_type) :: slider_rigid_type
   contains
      procedure :: start
      procedure :: advance
      procedure :: run_ahead
      procedure :: complete_pose
      procedure :: observe
      procedure :: energy
      procedure :: shift_origin
      procedure :: exchange
   end type slider_rigid_type

contains

   !> Set up a rigid slider from named numbers.
   subroutine make_slider_rigid(slider, parameters, error)
      class(slider_type), allocatable, intent(out) :: slider
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      type(slider_rigid_type), allocatable :: self

      allocate (self)
      call parameters%take("mass", self%mass, error)
      call parameters%take("stiffness", self%stiffness, error)
      call parameters%take("damping", self%damping, error)
      call parameters%finish(error)
      if (allocated(error)) return
      self%has_passages = .true.
      self%inverse_mass = 1.0_wp / self%mass
      self%own_rate = sqrt(self%stiffness * self%inverse_mass)
      call move_alloc(self, slider)
   end subroutine make_slider_rigid

   subroutine start(self, law)
      class(slider_rigid_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law

      self%law = law
      self%velocity = 0.0_wp
      self%damper = 0.0_wp
      self%start_displacement = self%displacement
      self%drive%value = (law%stiffness * self%displacement - law%offset) / self%stiffness
      self%series = 0.0_wp
   end subroutine start

   subroutine advance(self, law, window)
      class(slider_rigid_type), intent(inout) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window

      self%law = law
      call take_step(self, constants(self), window)
   end subroutine advance

   subroutine run_ahead(self, schedule, filter)
      class(slider_rigid_type), intent(inout) :: self
      type(schedule_type), intent(inout) :: schedule
      type(step_filter_type), intent(inout) :: filter

      ! The compiler makes a copy for each constant.
      if (schedule%has_growth) then
         call run_through(self, schedule, filter, .true.)
      else
         call run_through(self, schedule, filter, .false.)
      end if
   end subroutine run_ahead

   !> Move through a schedule. Nearly all steps are short ones. The end of a step is
   !> known only after a chain of operations, each of which waits for the one before, and the
   !> processor cannot predict whether a contact breaks or attaches then. Meanwhile work and losses
   !> of the step before are added up.
   subroutine run_through(self, schedule, filter, has_growth)
      type(slider_rigid_type), intent(inout) :: self
      type(schedule_type), intent(inout) :: schedule
      type(step_filter_type), intent(inout) :: filter
      !> Whether the schedule has thresholds that grow
      logical, intent(in) :: has_growth

      type(system_type) :: system
      type(pose_type) :: pose
      type(interface_law_type) :: law
      type(window_type) :: window
      type(rigid_motion_type) :: motion
      type(short_step_type) :: step
      type(step_books_type) :: books
      real(wp) :: step_time, start_displacement
      logical :: is_short, is_pending

      system = constants(self)
      motion = self%motion()
      is_pending = .false.
      if (has_growth) then
         pose = self%pose()
         call self%complete_pose(pose)
      end if
      do
         step_time = motion%time
         start_displacement = motion%displacement
         law = schedule%law()
         window = schedule%window(motion%time)
         system%stiffness = system%spring + law%stiffness * system%inverse_mass
         system%drag = law%drag * system%inverse_mass
         step%drive_gap = drive_gap_at(self, motion)
         step%early = motion_rates(system, self%damping, motion, step%drive_gap, &
            & law%stiffness * motion%displacement - law%offset)
         call look_ahead(motion, window, step)
         call derive(system, self%damping, step)
         if (is_pending) call audit(self, books, motion)
         call find_end(system, self%damping, step, is_short)
         if (is_short) then
            call move(self, system, law, step, motion)
            books = books_of(step, law%drag)
         else
            call self%take_motion(motion)
            self%law = law
            self%step_time = step_time
            self%start_displacement = start_displacement
            system%drive_gap = step%drive_gap
            if (schedule%has_candidates) then
               call take_timed_step(self, system, window, step%early)
            else
               call take_long_step(self, system, window, step%early)
            end if
            motion = self%motion()
            step%acceleration = self%acceleration
         end if
         is_pending = is_short

         call filter%examine(motion%time, motion%velocity, step%early%acceleration, &
            & step%acceleration)
         if (filter%is_selected .or. motion%direction * schedule%direction < 0.0_wp) exit
         call schedule%pass(motion%time, motion%displacement)
         if (schedule%is_over .or. filter%steps >= filter%max_steps) exit
         if (has_growth) then
            pose%time = motion%time
            pose%displacement = motion%displacement
            pose%velocity = motion%velocity
            pose%acceleration = step%acceleration
            pose%direction = motion%direction
            pose%damper = motion%damper
            call schedule%look_ahead(pose)
            if (schedule%is_over) exit
         end if
      end do
      if (.not. is_pending) return
      call audit(self, books, motion)
      call keep_series(self, step)
      call self%take_motion(motion)
      self%law = law
      self%step_time = step_time
      self%start_displacement = start_displacement
      self%start_acceleration = step%early%acceleration
      self%acceleration = step%acceleration
   end subroutine run_through

   !> One step: a short one, as nearly all between two events, or another.
   subroutine take_step(self, constant, whole_window)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: constant
      type(window_type), intent(in) :: whole_window

      type(window_type) :: window
      type(system_type) :: system
      type(motion_rates_type) :: early
      logical :: is_done

      self%step_time = self%time
      self%start_displacement = self%displacement

      window = whole_window
      if (self%has_clocks) call limit_window(self%clock, self%time, self%velocity, window)
      system = constant
      system%stiffness = system%spring + self%law%stiffness * system%inverse_mass
      system%drag = self%law%drag * system%inverse_mass
      is_done = .false.
      if (abs(self%drive%acceleration) > 0.0_wp) then
         system%drive_velocity = self%drive%rate_at(self%time)
         system%driving = system%spring * system%drive_velocity &
            & - self%law%rate * system%inverse_mass
         system%driving_rate = system%spring * self%drive%acceleration
         system%drive_gap = self%drive%at(self%time) - self%displacement
         early = rates(self, system, system%drive_gap)
      else
         system%driving = constant%driving - self%law%rate * system%inverse_mass
         system%drive_gap = uniform_gap(self)
         early = rates(self, system, system%drive_gap)
         if (self%law%tolerance > 0.0_wp) then
            call try_settled_step(self, system, window, early, is_done)
         end if
         if (.not. is_done) call try_short_step(self, system, window, early, is_done)
      end if
      if (is_done) return
      if (self%has_clocks .or. window%may_turn) then
         call take_timed_step(self, system, window, early)
      else
         call take_long_step(self, system, window, early)
      end if
   end subroutine take_step

   !> A step that is not a short one, where most end in time or by a clock.
   subroutine take_timed_step(self, system, window, early)
      type(slider_rigid_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      type(window_type), intent(in) :: window
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early

      logical :: is_done

      is_done = .false.
      if (.not. abs(self%drive%acceleration) > 0.0_wp) then
         call try_settled_step(self, system, window, early, is_done)
      end if
      if (.not. is_done) call take_long_step(self, system, window, early)
   end subroutine take_timed_step

   pure subroutine complete_pose(self, pose)
      class(slider_rigid_type), intent(in) :: self
      type(pose_type), intent(inout) :: pose

      pose%is_known = .true.
      pose%driving = self%own_rate**2 * self%drive%rate_at(self%time)
      pose%driving_rate = self%own_rate**2 * self%drive%acceleration
      pose%damping = self%damping
      pose%damper = self%damper
   end subroutine complete_pose

   pure function observe(self, time) result(motion)
      class(slider_rigid_type), intent(in) :: self
      real(wp), intent(in) :: time
      type(motion_type) :: motion

      real(wp) :: displacement, drive, step

      step = time - self%step_time
      drive = self%drive%at(time)
      ! As in advance, the number of terms is a constant in each call.
      select case (self%terms)
      case (few_terms)
         call evaluate(self%series, few_terms, step, displacement, motion%velocity)
      case (some_terms)
         call evaluate(self%series, some_terms, step, displacement, motion%velocity)
      case (many_terms)
         call evaluate(self%series, many_terms, step, displacement, motion%velocity)
      case default
         call evaluate(self%series, long_terms, step, displacement, motion%velocity)
      end select
      displacement = self%start_displacement + displacement
      motion%time = time
      motion%drive_displacement = self%origin + drive
      motion%displacement = self%origin + displacement
      motion%spring_force = self%stiffness * (drive - displacement)
      motion%elastic_force = motion%spring_force
      motion%pulled_velocity = motion%velocity
      motion%contact_force = self%law%stiffness * displacement - self%law%offset &
         & + self%law%drag * motion%velocity + self%law%rate * step
   end function observe

   !> Displacement and velocity from the series of the velocity.
   pure subroutine evaluate(series, terms, time, displacement, velocity)
      real(wp), intent(in) :: series(0:), time
      integer, intent(in) :: terms
      real(wp), intent(out) :: displacement, velocity

      displacement = integral(series, terms, time)
      velocity = horner(series, terms, time)
   end subroutine evaluate

   pure function energy(self)
      class(slider_rigid_type), intent(in) :: self
      real(wp) :: energy

      energy = 0.5_wp * self%mass * self%velocity**2 &
         & + 0.5_wp * self%stiffness * (self%drive%at(self%time) - self%displacement)**2
   end function energy

   subroutine shift_origin(self, shift)
      class(slider_rigid_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      call shift_slider(self, shift)
      self%start_displacement = self%start_displacement - shift
      call shift_law(self%law, shift)
   end subroutine shift_origin

   subroutine exchange(self, archive)
      class(slider_rigid_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("rigid slider")
      call exchange_slider(self, archive)
      call archive%exchange("damper", self%damper)
      call exchange_law(self%law, archive)
      call archive%exchange("start_displacement", self%start_displacement)
      call archive%exchange("terms", self%terms)
      call archive%exchange_fixed("series", [long_terms, 1], self%series)
   end subroutine exchange

end module mesoslip_sliders_rigid
