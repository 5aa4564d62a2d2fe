!> The state of a rigid slider, and the equation of its motion.
module mesoslip_sliders_rigid_state
   use mesoslip_interface_law, only: interface_law_type
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_sliders_motion_series, only: inverse
   use mesoslip_sliders_scheduled, only: scheduled_slider_type
   implicit none
   private

   public :: rigid_state_type, system_type, motion_rates_type, rigid_motion_type
   public :: constants, drive_gap_at, motion_rates, rates, uniform_gap, pull, pull_unevenly, arrive
   public :: few_terms, some_terms, many_terms, long_terms

   !> Terms of the series of steps from short to long. The terms left out are less than 1e-16 of the
   !> first two.
   integer, parameter :: few_terms = 6, some_terms = 8, many_terms = 10, long_terms = 17

   !> Coefficients of the equation of motion, per mass of the slider:
   !> V' = spring gap - (K_c X - S)/M - drag V - D and D' = eta_S (V' - D), with D = eta_S (V - W).
   type :: system_type
      !> One over the mass [1/kg], and K/M [1/s2]
      real(wp) :: inverse_mass, spring
      !> (K + K_c)/M [1/s2], C/M [1/s], and K/M times the drive's velocity at the start of a step
      !> [m/s3] and times its acceleration [m/s4]
      real(wp) :: stiffness, drag, driving, driving_rate
      !> Distance from the slider to the drive at the start of a step [m], and its velocity [m/s]
      real(wp) :: drive_gap, drive_velocity
   end type system_type

   !> Velocity and acceleration of the slider, and the same of the damper.
   type :: motion_rates_type
      !> Velocity [m/s] and acceleration [m/s2]
      real(wp) :: velocity, acceleration
      !> D = eta_S (V - W) [m/s2] and its rate [m/s3]
      real(wp) :: damper, damper_rate
   end type motion_rates_type

   !> The motion of the slider.
   type :: rigid_motion_type
      !> Time [s], displacement [m], velocity [m/s], deceleration by the damper [m/s2]
      real(wp) :: time, displacement, velocity, damper
      !> Sign of the last velocity that was not zero
      real(wp) :: direction
   end type rigid_motion_type

   !> A rigid slider on a spring.
   type, abstract, extends(scheduled_slider_type) :: rigid_state_type
      !> Mass M [kg], stiffness of the drive's spring K [N/m], damping rate eta_S [1/s]
      real(wp) :: mass = 1.0_wp, stiffness = 1.0_wp, damping = 0.0_wp
      !> Deceleration by the damper, D = eta_S (V - W), W being the mean velocity [m/s2]
      real(wp) :: damper = 0.0_wp
      !> Contact force during the last advance, and displacement at its start [m]
      type(interface_law_type) :: law
      real(wp) :: start_displacement = 0.0_wp
      !> Taylor coefficients of the velocity in the time since then
      integer :: terms = few_terms
      real(wp) :: series(0:long_terms - 1) = 0.0_wp
   contains
      procedure, non_overridable :: motion
      procedure, non_overridable :: take_motion
   end type rigid_state_type

contains

   !> Terms of the equation of motion that do not change with the contacts.
   pure function constants(self) result(system)
      class(rigid_state_type), intent(in) :: self
      type(system_type) :: system

      system%inverse_mass = 1.0_wp / self%mass
      system%spring = self%stiffness * system%inverse_mass
      system%drive_velocity = self%drive%rate
      system%driving = system%spring * self%drive%rate
      system%driving_rate = 0.0_wp
      system%stiffness = 0.0_wp
      system%drag = 0.0_wp
      system%drive_gap = 0.0_wp
   end function constants

   pure function motion(self)
      class(rigid_state_type), intent(in) :: self
      type(rigid_motion_type) :: motion

      motion = rigid_motion_type(self%time, self%displacement, self%velocity, self%damper, &
         & self%direction)
   end function motion

   pure subroutine take_motion(self, motion)
      class(rigid_state_type), intent(inout) :: self
      type(rigid_motion_type), intent(in) :: motion

      self%time = motion%time
      self%displacement = motion%displacement
      self%velocity = motion%velocity
      self%damper = motion%damper
      self%direction = motion%direction
   end subroutine take_motion

   !> Distance from a motion of the slider to a drive of constant velocity [m].
   pure function drive_gap_at(self, motion) result(drive_gap)
      class(rigid_state_type), intent(in) :: self
      type(rigid_motion_type), intent(in) :: motion
      real(wp) :: drive_gap

      drive_gap = self%drive%value - motion%displacement &
         & + self%drive%rate * (motion%time - self%drive%time)
   end function drive_gap_at

   !> Distance from the slider to a drive of constant velocity [m].
   pure function uniform_gap(self) result(drive_gap)
      class(rigid_state_type), intent(in) :: self
      real(wp) :: drive_gap

      drive_gap = drive_gap_at(self, self%motion())
   end function uniform_gap

   !> Velocity and damper with their rates, from the equation of motion.
   pure function motion_rates(system, damping, motion, drive_gap, contact_force) result(rates)
      type(system_type), intent(in) :: system
      !> Damping rate [1/s]
      real(wp), intent(in) :: damping
      type(rigid_motion_type), intent(in) :: motion
      !> Distance to the drive [m], and contact force without drag [N]
      real(wp), intent(in) :: drive_gap, contact_force
      type(motion_rates_type) :: rates

      rates%velocity = motion%velocity
      rates%damper = motion%damper
      rates%acceleration = ((system%spring * drive_gap - system%inverse_mass * contact_force) &
         & - system%drag * motion%velocity) - motion%damper
      rates%damper_rate = damping * (rates%acceleration - rates%damper)
   end function motion_rates

   !> The same of a slider under its law.
   pure function rates(self, system, drive_gap) result(motion)
      class(rigid_state_type), intent(in) :: self
      type(system_type), intent(in) :: system
      !> Distance to the drive [m]
      real(wp), intent(in) :: drive_gap
      type(motion_rates_type) :: motion

      motion = motion_rates(system, self%damping, self%motion(), drive_gap, &
         & self%law%stiffness * self%displacement - self%law%offset &
         & + self%law%rate * (self%time - self%step_time))
   end function rates

   !> Observations at the end of any step.
   subroutine arrive(self, system, early, drive_gap, late)
      class(rigid_state_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      !> The motion at the start of the step
      type(motion_rates_type), intent(in) :: early
      !> Distance to the drive, and motion, at the end of the step [m]
      real(wp), intent(in) :: drive_gap
      type(motion_rates_type), intent(out) :: late

      if (abs(self%velocity) > 0.0_wp) self%direction = sign(1.0_wp, self%velocity)
      late = rates(self, system, drive_gap)
      self%acceleration = late%acceleration
      self%start_acceleration = early%acceleration
   end subroutine arrive

   !> Add the impulse of a drive of constant velocity in a step to the energy balance.
   subroutine pull(self, drive_gap, step, swept)
      class(rigid_state_type), intent(inout) :: self
      !> Distance to the drive at the start of the step [m]
      real(wp), intent(in) :: drive_gap
      !> Length of the step [s], and integral of the displacement over the time [m s]
      real(wp), intent(in) :: step, swept

      call self%drive%impulse%add(self%stiffness &
         & * (step * (drive_gap + 0.5_wp * self%drive%rate * step) - swept))
   end subroutine pull

   !> Add impulse and work of an accelerated drive in a step to the energy balance.
   subroutine pull_unevenly(self, system, step, swept, moment)
      class(rigid_state_type), intent(inout) :: self
      type(system_type), intent(in) :: system
      !> Length of the step [s], integrals of the displacement [m s] and of that times the time
      !> [m s2]
      real(wp), intent(in) :: step, swept, moment

      real(wp) :: extension

      associate (velocity => system%drive_velocity, acceleration => self%drive%acceleration)
         extension = step * (system%drive_gap + step * (0.5_wp * velocity &
            & + inverse(6) * acceleration * step)) - swept
         call self%drive%earlier_impulse%add(self%stiffness * extension)
         call self%drive%add_work(self%stiffness * (velocity * extension + acceleration &
            & * (step**2 * (0.5_wp * system%drive_gap + step &
            & * (inverse(3) * velocity + 0.125_wp * acceleration * step)) - moment)))
      end associate
   end subroutine pull_unevenly

end module mesoslip_sliders_rigid_state
