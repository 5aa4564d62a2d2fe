!> What every slider can do: move under a linear law of the contact force, and say where it is.
!>
!> A slider knows nothing about contacts. Displacements are relative to an origin that moves along
!> with the slider, so that they keep their digits however far it goes.
module mesoslip_sliders_base
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_extremes, only: extremes_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_schedule, only: schedule_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: slider_type, motion_type, drive_slider, exchange_slider, exchange_law, shift_slider

   !> The motion at one time.
   type :: motion_type
      !> Time [s]
      real(wp) :: time = 0.0_wp
      !> Displacement of the drive [m]
      real(wp) :: drive_displacement = 0.0_wp
      !> Displacement of the slider [m]
      real(wp) :: displacement = 0.0_wp
      !> Velocity of the slider [m/s]
      real(wp) :: velocity = 0.0_wp
      !> Force that the drive exerts on the slider [N]
      real(wp) :: spring_force = 0.0_wp
      !> Force that the slider exerts on the contacts [N]
      real(wp) :: contact_force = 0.0_wp
      !> Mean elastic force of a slider of layers [N]
      real(wp) :: elastic_force = 0.0_wp
      !> Displacement [m] and velocity [m/s] of its base
      real(wp) :: base_displacement = 0.0_wp, base_velocity = 0.0_wp
      !> Velocity of the slider where the drive's spring pulls it [m/s]
      real(wp) :: pulled_velocity = 0.0_wp
   end type motion_type

   !> A slider: what it has in common whatever its kind.
   type, abstract :: slider_type
      !> Time [s]
      real(wp) :: time = 0.0_wp
      !> Displacement of the origin of all other displacements [m]
      real(wp) :: origin = 0.0_wp
      !> Displacement of the slider [m] and its velocity [m/s]
      real(wp) :: displacement = 0.0_wp, velocity = 0.0_wp
      !> Velocity of the base, to which that of the slider is relative [m/s]
      real(wp) :: base_velocity = 0.0_wp
      !> Its acceleration at the end of the last advance, and at its start [m/s2]
      real(wp) :: acceleration = 0.0_wp, start_acceleration = 0.0_wp
      !> Sign of the last velocity that was not zero
      real(wp) :: direction = 1.0_wp
      !> Velocity of the drive at a time [m/s], its place then, from the moving origin [s, m], and
      !> its acceleration since [m/s2]
      real(wp) :: drive_velocity = 0.0_wp, drive_time = 0.0_wp, drive_displacement = 0.0_wp, &
         & drive_acceleration = 0.0_wp
      !> Time at which the drive will turn round [s]; no step goes beyond
      real(wp) :: drive_turn = huge(1.0_wp)
      !> Sign of its velocity until then, or of the last one that was not zero
      real(wp) :: drive_direction = 1.0_wp
      !> Time at which the last advance started [s]
      real(wp) :: step_time = 0.0_wp
      !> Lost in the drag of contacts and in the slider's damping [J]
      type(accumulator_type) :: drag_loss, damping_loss
      !> Impulse of the drive since it took its velocity [N s], by which, times the velocity, its
      !> work is more than what was added up [J]; none under an acceleration
      type(accumulator_type) :: impulse, earlier_work
      !> Impulse of the drive in its stage, but for that [N s]
      type(accumulator_type) :: stage_impulse
      !> Extremes of the drive's force in its stage, and whether the slider notes them itself: those
      !> without inertia, whose force jumps
      type(extremes_type) :: extremes
      logical :: notes_extremes = .false.
      !> Whether it has no inertia, and jumps to its equilibrium while the drive stands still
      logical :: instant = .false.
      !> Whether it came to its equilibrium in the last advance, and where [m]
      logical :: settled = .false.
      real(wp) :: rest_displacement = 0.0_wp
      !> Set when nothing holds it any more
      logical :: unbound = .false.
      !> Whether the drive is a force, under which contacts may break without end
      logical :: under_force = .false.
      !> Whether a run that is put away here goes on to the bit
      logical :: can_pause = .true.
      !> Whether it may run through a schedule, being looked at here and there only
      logical :: runs_ahead = .false.
      !> Layers whose displacements can be observed
      integer :: layer_count = 0
      !> Cost of an advance over that of a rigid slider
      real(wp) :: cost = 1.0_wp
      !> Steps, evaluations and failed steps of its integrator, if it has one
      integer(i8) :: integrator_counts(3) = 0_i8
      !> Set when the slider cannot go on
      type(error_type), allocatable :: failure
   contains
      !> Put the slider at rest in balance with the contacts
      procedure(start_interface), deferred :: start
      !> Move until the first end of a window, or less far
      procedure(advance_interface), deferred :: advance
      !> Move through a schedule of changes of the contact force
      procedure :: run_ahead
      !> The motion at a time of the last advance
      procedure(observe_interface), deferred :: observe
      !> Kinetic energy and that of the drive's spring
      procedure(energy_interface), deferred :: energy
      !> Where it is
      procedure, non_overridable :: pose
      !> Give the drive another velocity and acceleration
      procedure :: drive => drive_slider
      !> Where the drive is at a time, and its velocity
      procedure, non_overridable :: drive_at
      procedure, non_overridable :: drive_velocity_at
      !> Work that the drive has done
      procedure, non_overridable :: drive_work
      !> Velocity where the drive's spring pulls
      procedure :: pulled_velocity
      !> Move the origin of displacements
      procedure :: shift_origin => shift_slider
      !> Displacements of the layers at a time of the last advance
      procedure :: observe_layers
      !> Put the state into an archive or take it out
      procedure :: exchange => exchange_slider
   end type slider_type

   abstract interface
      !> Put the slider at rest in balance with the contacts.
      subroutine start_interface(self, law)
         import :: slider_type, interface_law_type
         implicit none
         !> The slider, its displacement zero
         class(slider_type), intent(inout) :: self
         !> Contact force at the start
         type(interface_law_type), intent(in) :: law
      end subroutine start_interface

      !> Move until the first end of a window, or less far.
      subroutine advance_interface(self, law, window)
         import :: slider_type, interface_law_type, window_type
         implicit none
         !> The slider; on return at an end of the window, or inside it.
         !> At an end its displacement or time equals the window's to the bit.
         class(slider_type), intent(inout) :: self
         !> Contact force
         type(interface_law_type), intent(in) :: law
         !> Where the law holds
         type(window_type), intent(in) :: window
      end subroutine advance_interface

      !> The motion at a time of the last advance, from its start to the slider's time.
      pure function observe_interface(self, time) result(motion)
         import :: slider_type, motion_type, wp
         implicit none
         !> The slider
         class(slider_type), intent(in) :: self
         !> Time [s]
         real(wp), intent(in) :: time
         !> The motion, displacements being absolute
         type(motion_type) :: motion
      end function observe_interface

      !> Kinetic energy and that of the drive's spring.
      pure function energy_interface(self) result(energy)
         import :: slider_type, wp
         implicit none
         !> The slider
         class(slider_type), intent(in) :: self
         !> Energy [J]
         real(wp) :: energy
      end function energy_interface
   end interface

contains

   !> Move through a schedule until it ends, or until a step is of interest.
   subroutine run_ahead(self, schedule, filter)
      !> The slider
      class(slider_type), intent(inout) :: self
      !> What happens on the way; what is due at the end of a step of interest, or after a turn, has
      !> not happened yet
      type(schedule_type), intent(inout) :: schedule
      !> Which steps are of interest; the slider stops after one
      type(step_filter_type), intent(inout) :: filter

      do
         call self%advance(schedule%law(), schedule%window(self%time))
         call filter%examine(self%time, self%velocity, self%start_acceleration, self%acceleration)
         if (filter%is_selected .or. self%direction * schedule%direction < 0.0_wp) return
         call schedule%pass(self%time, self%displacement)
         if (schedule%is_over .or. filter%steps >= filter%max_steps) return
      end do
   end subroutine run_ahead

   !> Where the slider is.
   pure function pose(self)
      !> The slider
      class(slider_type), intent(in) :: self
      !> Where it is
      type(pose_type) :: pose

      pose = pose_type(self%time, self%displacement, self%velocity, self%acceleration, &
         & self%direction)
   end function pose

   !> Give the drive another velocity and acceleration.
   subroutine drive_slider(self, velocity, acceleration)
      !> The slider
      class(slider_type), intent(inout) :: self
      !> Velocity of the drive now [m/s], and its acceleration from now on [m/s2]
      real(wp), intent(in) :: velocity, acceleration

      if (.not. self%under_force) then
         call self%earlier_work%add(self%drive_velocity * self%impulse%total())
      end if
      call self%stage_impulse%add(self%impulse%total())
      self%impulse = accumulator_type()
      self%drive_displacement = self%drive_at(self%time)
      self%drive_time = self%time
      self%drive_velocity = velocity
      self%drive_acceleration = acceleration
      self%drive_turn = huge(1.0_wp)
      if (velocity * acceleration < 0.0_wp) self%drive_turn = self%time - velocity / acceleration
      if (abs(velocity) > 0.0_wp) then
         self%drive_direction = sign(1.0_wp, velocity)
      else if (abs(acceleration) > 0.0_wp) then
         self%drive_direction = sign(1.0_wp, acceleration)
      end if
   end subroutine drive_slider

   !> Work that the drive has done.
   pure function drive_work(self) result(work)
      !> The slider
      class(slider_type), intent(in) :: self
      !> Work [J]
      real(wp) :: work

      work = self%earlier_work%total()
      ! A drive by force has a rate of that for its velocity.
      if (.not. self%under_force) work = work + self%drive_velocity * self%impulse%total()
   end function drive_work

   !> Velocity, at the end of the last advance, where the drive's spring pulls.
   pure function pulled_velocity(self) result(velocity)
      !> The slider
      class(slider_type), intent(in) :: self
      !> Velocity [m/s]
      real(wp) :: velocity

      velocity = self%velocity + self%base_velocity
   end function pulled_velocity

   !> Where the drive is at a time.
   pure function drive_at(self, time) result(displacement)
      !> The slider
      class(slider_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> Displacement of the drive from the moving origin [m]
      real(wp) :: displacement

      displacement = self%drive_displacement + (self%drive_velocity &
         & + 0.5_wp * self%drive_acceleration * (time - self%drive_time)) * (time - self%drive_time)
   end function drive_at

   !> Velocity of the drive at a time.
   pure function drive_velocity_at(self, time) result(velocity)
      !> The slider
      class(slider_type), intent(in) :: self
      !> Time, until the drive turns round [s]
      real(wp), intent(in) :: time
      !> Velocity [m/s]
      real(wp) :: velocity

      velocity = self%drive_velocity
      if (.not. abs(self%drive_acceleration) > 0.0_wp) return
      velocity = velocity + self%drive_acceleration * (time - self%drive_time)
      ! Rounding must not turn it round early.
      velocity = self%drive_direction * max(0.0_wp, self%drive_direction * velocity)
   end function drive_velocity_at

   !> Move the origin of displacements; ends what can be observed of the last advance.
   subroutine shift_slider(self, shift)
      !> The slider
      class(slider_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      self%drive_displacement = self%drive_at(self%time) - shift
      self%drive_velocity = self%drive_velocity_at(self%time)
      self%drive_time = self%time
      self%displacement = self%displacement - shift
      self%origin = self%origin + shift
   end subroutine shift_slider

   !> Displacements of the layers at a time of the last advance: without layers, that of the slider.
   pure subroutine observe_layers(self, time, displacement)
      !> The slider
      class(slider_type), intent(in) :: self
      !> Time [s]
      real(wp), intent(in) :: time
      !> Absolute displacements, shape (layers) [m]
      real(wp), intent(out) :: displacement(:)

      type(motion_type) :: motion

      motion = self%observe(time)
      displacement = motion%displacement
   end subroutine observe_layers

   !> Put the state into an archive or take it out.
   subroutine exchange_slider(self, archive)
      !> The slider
      class(slider_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%exchange("time", self%time)
      call archive%exchange("origin", self%origin)
      call archive%exchange("displacement", self%displacement)
      call archive%exchange("velocity", self%velocity)
      call archive%exchange("base_velocity", self%base_velocity)
      call archive%exchange("acceleration", self%acceleration)
      call archive%exchange("start_acceleration", self%start_acceleration)
      call archive%exchange("direction", self%direction)
      call archive%exchange("drive_velocity", self%drive_velocity)
      call archive%exchange("drive_time", self%drive_time)
      call archive%exchange("drive_displacement", self%drive_displacement)
      call archive%exchange("drive_acceleration", self%drive_acceleration)
      call archive%exchange("drive_turn", self%drive_turn)
      call archive%exchange("drive_direction", self%drive_direction)
      call archive%exchange("step_time", self%step_time)
      call archive%exchange("impulse", self%impulse)
      call archive%exchange("earlier_work", self%earlier_work)
      call archive%exchange("stage_impulse", self%stage_impulse)
      call self%extremes%exchange(archive)
      call archive%exchange("drag_loss", self%drag_loss)
      call archive%exchange("damping_loss", self%damping_loss)
      call archive%exchange("instant", self%instant)
      call archive%exchange("settled", self%settled)
      call archive%exchange("rest_displacement", self%rest_displacement)
      call archive%exchange("unbound", self%unbound)
      call archive%exchange("can_pause", self%can_pause)
   end subroutine exchange_slider

   !> Put a law of the contact force into an archive or take it out.
   subroutine exchange_law(law, archive)
      !> The law
      type(interface_law_type), intent(inout) :: law
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%exchange("law stiffness", law%stiffness)
      call archive%exchange("law offset", law%offset)
      call archive%exchange("law drag", law%drag)
   end subroutine exchange_law

end module mesoslip_sliders_base
