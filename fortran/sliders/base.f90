!> Interface of every slider: move under a linear law of the contact force, and report the motion.
!>
!> A slider has a drive, and is independent of contacts. Displacements are relative to an origin
!> that moves along with the slider, so that they keep their digits however far it goes.
module mesoslip_sliders_base
   use mesoslip_drive, only: drive_type
   use mesoslip_interface_law, only: clocks, hazard_clock_type, interface_law_type, pose_type, &
      & window_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_step_filter, only: step_filter_type
   implicit none
   private

   public :: slider_type, motion_type, exchange_slider, exchange_law, shift_law, shift_slider

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

   !> A slider of any kind.
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
      type(drive_type) :: drive
      !> Time at which the last advance started [s]
      real(wp) :: step_time = 0.0_wp
      !> Energy lost in the drag of contacts and in the slider's damping [J]
      type(accumulator_type) :: drag_loss, damping_loss
      !> Whether the force of the drive has extremes where the slider passes the velocity of the
      !> drive, and whether the slider is faster where the drive's spring pulls: the force falls
      logical :: has_passages = .false., is_faster = .false.
      !> One over the mass that the contact force moves [1/kg], and the rate of the slider's own
      !> oscillation [1/s]; 0 if its motion is prescribed
      real(wp) :: inverse_mass = 0.0_wp, own_rate = 0.0_wp
      !> Whether it moves as the drive does
      logical :: follows_drive = .false.
      !> Cost of an advance over that of a rigid slider
      real(wp) :: cost = 1.0_wp
      !> Steps, evaluations and failed steps of its integrator, if it has one
      integer(i8) :: integrator_counts(3) = 0_i8
      !> Clocks of the contacts, which end an advance as its window does; whether there are any
      type(hazard_clock_type) :: clock(clocks)
      logical :: has_clocks = .false.
      !> Set when the slider cannot continue
      type(error_type), allocatable :: failure
   contains
      procedure(start_interface), deferred :: start
      procedure(advance_interface), deferred :: advance
      procedure(observe_interface), deferred :: observe
      procedure(energy_interface), deferred :: energy
      procedure, non_overridable :: pose
      !> Complete a pose with drive and damper, for contacts that predict the motion
      procedure :: complete_pose
      procedure :: adapt_to_drive
      procedure :: can_pause
      procedure :: pulled_velocity
      procedure :: shift_origin => shift_slider
      procedure, non_overridable :: note_force
      procedure, non_overridable :: mark_extreme
      procedure, non_overridable :: note_extreme
      procedure, non_overridable :: select_extremes
      procedure :: observe_layers
      procedure :: exchange => exchange_slider
   end type slider_type

   abstract interface
      !> Put the slider, its displacement being zero, at rest in balance with the contacts.
      subroutine start_interface(self, law)
         import :: slider_type, interface_law_type
         implicit none
         class(slider_type), intent(inout) :: self
         !> Contact force at the start
         type(interface_law_type), intent(in) :: law
      end subroutine start_interface

      !> Move until the first end of a window, or less far. At an end the slider's displacement or
      !> time equals the window's to the bit.
      subroutine advance_interface(self, law, window)
         import :: slider_type, interface_law_type, window_type
         implicit none
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
         class(slider_type), intent(in) :: self
         !> Energy [J]
         real(wp) :: energy
      end function energy_interface
   end interface

contains

   !> Pose of the slider.
   pure function pose(self)
      class(slider_type), intent(in) :: self
      type(pose_type) :: pose

      pose = pose_type(self%time, self%displacement, self%velocity, self%acceleration, &
         & self%direction, self%inverse_mass, self%own_rate, &
         & self%follows_drive .and. abs(self%velocity) > 0.0_wp &
         & .and. .not. abs(self%acceleration) > 0.0_wp)
   end function pose

   !> Complete a pose with drive and damper: of most sliders their rates are unknown.
   pure subroutine complete_pose(self, pose)
      class(slider_type), intent(in) :: self
      type(pose_type), intent(inout) :: pose

   end subroutine complete_pose

   !> Adapt to a change of the drive: most sliders need not.
   subroutine adapt_to_drive(self)
      class(slider_type), intent(inout) :: self

   end subroutine adapt_to_drive

   !> Whether a run that is saved now continues to the bit: where all of the slider's state can be
   !> saved.
   pure function can_pause(self)
      class(slider_type), intent(in) :: self
      logical :: can_pause

      can_pause = .true.
   end function can_pause

   !> Velocity, at the end of the last advance, where the drive's spring pulls.
   pure function pulled_velocity(self) result(velocity)
      class(slider_type), intent(in) :: self
      !> Velocity [m/s]
      real(wp) :: velocity

      velocity = self%velocity + self%base_velocity
   end function pulled_velocity

   !> Take the force of the drive at a time of the last advance into account in its extremes.
   subroutine note_force(self, time)
      class(slider_type), intent(inout) :: self
      !> Time [s]
      real(wp), intent(in) :: time

      type(motion_type) :: motion

      motion = self%observe(time)
      call self%drive%extremes%note(motion%spring_force, motion%time, motion%displacement)
   end subroutine note_force

   !> The drive has changed: its force may have an extreme here.
   subroutine mark_extreme(self)
      class(slider_type), intent(inout) :: self

      call self%note_force(self%time)
      self%is_faster = self%pulled_velocity() > self%drive%rate
   end subroutine mark_extreme

   !> Look for an extreme of the force in the last advance, where the slider passes the velocity of
   !> the drive. Two passages within one step, between which the force hardly changes, are missed.
   !> Other sliders note extremes in each advance, or have none between changes of the drive.
   subroutine note_extreme(self)
      class(slider_type), intent(inout) :: self

      logical :: is_faster

      if (.not. self%has_passages) return
      is_faster = self%pulled_velocity() > self%drive%rate_at(self%time)
      if (is_faster .eqv. self%is_faster) return
      self%is_faster = is_faster
      call self%note_force(passage(self))
   end subroutine note_extreme

   !> Let a filter select the steps in which the slider passes the velocity of the drive, which is
   !> constant.
   pure subroutine select_extremes(self, filter)
      class(slider_type), intent(in) :: self
      type(step_filter_type), intent(inout) :: filter

      if (.not. self%has_passages) return
      if (self%is_faster .eqv. filter%direction > 0.0_wp) then
         filter%min_excess = max(filter%min_excess, merge(0.0_wp, -tiny(1.0_wp), self%is_faster))
      else
         filter%max_excess = min(filter%max_excess, merge(-tiny(1.0_wp), 0.0_wp, self%is_faster))
      end if
   end subroutine select_extremes

   !> Time at which the slider passed the drive's velocity in the last advance, by the rule of
   !> Illinois.
   pure function passage(slider) result(time)
      class(slider_type), intent(in) :: slider
      real(wp) :: time

      integer, parameter :: max_iterations = 60
      real(wp) :: early, late, early_excess, late_excess, excess
      integer :: iteration

      early = slider%step_time
      late = slider%time
      early_excess = excess_at(early)
      late_excess = excess_at(late)
      time = merge(late, early, abs(early_excess) > 0.0_wp)
      if (.not. early_excess * late_excess < 0.0_wp) return
      do iteration = 1, max_iterations
         time = late - late_excess * ((late - early) / (late_excess - early_excess))
         if (.not. (time > min(early, late) .and. time < max(early, late))) exit
         excess = excess_at(time)
         if (excess * late_excess < 0.0_wp) then
            early = late
            early_excess = late_excess
         else
            early_excess = 0.5_wp * early_excess
         end if
         late = time
         late_excess = excess
         if (.not. abs(excess) > 0.0_wp) exit
      end do
      time = min(max(time, slider%step_time), slider%time)

   contains

      !> Velocity of the slider, where it is pulled, above that of the drive.
      pure real(wp) function excess_at(time)
         real(wp), intent(in) :: time

         type(motion_type) :: motion

         motion = slider%observe(time)
         excess_at = motion%pulled_velocity - slider%drive%rate_at(time)
      end function excess_at

   end function passage

   !> Move the origin of displacements; of the last advance only the end can be observed then.
   subroutine shift_slider(self, shift)
      class(slider_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      call self%drive%rebase(self%time, shift)
      self%displacement = self%displacement - shift
      self%origin = self%origin + shift
   end subroutine shift_slider

   !> Displacements of the layers at a time of the last advance: without layers, that of the slider.
   pure subroutine observe_layers(self, time, displacement)
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
      class(slider_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%exchange("time", self%time)
      call archive%exchange("origin", self%origin)
      call archive%exchange("displacement", self%displacement)
      call archive%exchange("velocity", self%velocity)
      call archive%exchange("base_velocity", self%base_velocity)
      call archive%exchange("acceleration", self%acceleration)
      call archive%exchange("start_acceleration", self%start_acceleration)
      call archive%exchange("direction", self%direction)
      call self%drive%exchange(archive)
      call archive%exchange("step_time", self%step_time)
      call archive%exchange("is_faster", self%is_faster)
      call archive%exchange("drag_loss", self%drag_loss)
      call archive%exchange("damping_loss", self%damping_loss)
   end subroutine exchange_slider

   !> Let a law of the contact force count displacements from another origin.
   pure subroutine shift_law(law, shift)
      type(interface_law_type), intent(inout) :: law
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      law%offset = law%offset - law%stiffness * shift
   end subroutine shift_law

   !> Put a law of the contact force into an archive or take it out.
   subroutine exchange_law(law, archive)
      type(interface_law_type), intent(inout) :: law
      type(archive_type), intent(inout) :: archive

      call archive%exchange("law stiffness", law%stiffness)
      call archive%exchange("law offset", law%offset)
      call archive%exchange("law drag", law%drag)
      call archive%exchange("law rate", law%rate)
   end subroutine exchange_law

end module mesoslip_sliders_base
