!> Steps of populations that break by thermal activation: how long they are, what breaks in them.
!>
!> In a step only a small part of the contacts breaks by activation. A slider that hardly oscillates
!> is taken to creep on as in the step before: the step may then be as long as what breaks allows.
module mesoslip_contacts_populations_thermal_step
   use mesoslip_contacts_populations_motion, only: distance_in, time_to_move
   use mesoslip_contacts_populations_packets, only: expected_births_type
   use mesoslip_contacts_populations_state, only: population_state_type
   use mesoslip_interface_law, only: interface_law_type, pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: expect_motion, look_ahead_thermal, max_growth, min_part, quiet_force, smooth_excess

   !> Force of an oscillation that counts as none, over f_T of all contacts and at resolution 1
   real(wp), parameter :: quiet_part = 1.0e-2_wp
   !> Duration of a step over that of the step before, at most
   real(wp), parameter :: max_growth = 4.0_wp
   !> Part of a step's length over which breaks are looked for at least
   real(wp), parameter :: min_part = 1.0e-3_wp
   !> Part of what may break in a step at rest, and displacement over the length of a step below
   !> which the slider rests
   real(wp), parameter :: part_at_rest = 0.1_wp
   !> How much more may break than a step allows, and trials of shorter steps
   real(wp), parameter :: leeway = 1.1_wp
   integer, parameter :: max_trials = 100

contains

   !> Force of an oscillation that counts as none [N].
   pure function quiet_force(self) result(force)
      class(population_state_type), intent(in) :: self
      !> The force
      real(wp) :: force

      associate (parameters => self%parameters)
         force = quiet_part * min(1.0_wp, self%resolution)**2 * parameters%count &
            & * parameters%static_force * min(1.0_wp, self%pinned%activation%width)
      end associate
   end function quiet_force

   !> The motion that is expected: even, as in the step before, of a slider that hardly oscillates.
   subroutine expect_motion(self, pose, expected, is_quiet)
      class(population_state_type), intent(in) :: self
      !> Pose of the slider
      type(pose_type), intent(in) :: pose
      !> The same, with the motion that is expected
      type(pose_type), intent(out) :: expected
      !> Whether the slider hardly oscillates
      logical, intent(out) :: is_quiet

      real(wp) :: limit

      expected = pose
      limit = quiet_force(self) * pose%inverse_mass
      is_quiet = pose%inverse_mass > 0.0_wp .and. self%last_duration < huge(1.0_wp) &
         & .and. abs(pose%acceleration) <= limit .and. abs(pose%velocity - self%last_velocity) &
         & * self%oscillation_rate(pose) <= limit
      if (.not. is_quiet) return
      expected%velocity = self%last_velocity
      expected%acceleration = 0.0_wp
      if (abs(expected%velocity) > 0.0_wp) expected%direction = sign(1.0_wp, expected%velocity)
   end subroutine expect_motion

   !> Find what breaks in a step, and what of that attaches in it; the step may become shorter.
   subroutine look_ahead_thermal(self, pose, direction, max_births, span, distance, reach, &
      & limit, births)
      class(population_state_type), intent(inout) :: self
      !> Pose of the slider, and its expected motion
      type(pose_type), intent(in) :: pose
      !> The direction in which the slider moves, and contacts that may attach in a step
      real(wp), intent(in) :: direction, max_births
      !> Duration of the step [s], expected displacement in it, displacement until which breaks at
      !> thresholds are found, and largest displacement of the step [m]
      real(wp), intent(inout) :: span, distance, reach, limit
      !> Contacts that attach in it
      type(expected_births_type), intent(inout) :: births

      real(wp) :: late, onset, part, heat, own, max_heat
      type(pose_type) :: after
      integer :: trial_number
      logical :: may_end_early

      may_end_early = .true.
      do trial_number = 1, max_trials
         after = pose_after()
         call self%pinned%try_motion(pose, after, pose%displacement + direction * reach, late, &
            & onset, self%failure)
         if (allocated(self%failure)) return
         if (may_end_early .and. late > self%max_late &
            & .and. abs(onset - pose%displacement) < reach) then
            ! Where many populations start to come to their thresholds the force has a kink.
            may_end_early = .false.
            reach = abs(onset - pose%displacement)
            limit = reach
            if (reach < distance) call shorten(time_to_move(pose, direction, reach))
            cycle
         end if
         associate (trial => self%pinned%trial)
            heat = trial%breaks - trial%cut_breaks
            own = self%detached%own_part(span)
            births%own = 0.0_wp
            if (distance > 0.0_wp) births%own = own * trial%cut_breaks * distance / reach
         end associate
         max_heat = self%max_attached &
            & * max(part_at_rest, min(1.0_wp, distance / self%pinned%step))
         part = 1.0_wp
         if (heat > leeway * max_heat) part = max_heat / heat
         associate (all => births%number + births%own + own * heat)
            if (all > leeway * max_births) part = min(part, max_births / all)
         end associate
         if (.not. part < 1.0_wp) exit
         if (.not. pose%time + part * span > pose%time) exit
         call shorten(part * span)
         reach = max(distance, min_part * self%pinned%step)
         may_end_early = .true.
      end do
      births%own_mass = births%own
      ! Contacts break and attach by activation evenly in time.
      births%number = births%number + own * heat
      births%mass = births%mass + own * heat

   contains

      !> Pose of the slider expected at the end of the step.
      pure function pose_after() result(after)
         type(pose_type) :: after

         after = pose
         after%time = max(pose%time + span, nearest(pose%time, 1.0_wp))
         after%displacement = pose%displacement + direction * distance
         after%velocity = 2.0_wp * direction * distance / (after%time - pose%time) - pose%velocity
      end function pose_after

      !> Let the step end earlier.
      subroutine shorten(time)
         real(wp), intent(in) :: time

         births%number = births%number * time / span
         births%mass = births%mass * time / span
         span = time
         distance = distance_in(pose, direction, span)
      end subroutine shorten

   end subroutine look_ahead_thermal

   !> Let the offered force go on from that of the step before, and come to that of the contacts at
   !> the end of the step: a jump would shake the slider.
   pure subroutine smooth_excess(self, span, law)
      class(population_state_type), intent(in) :: self
      !> Duration of the step [s]
      real(wp), intent(in) :: span
      !> The law
      type(interface_law_type), intent(inout) :: law

      law%tolerance = quiet_force(self)
      if (.not. span > 0.0_wp) return
      law%offset = law%offset - self%excess
      law%rate = law%rate - self%excess / span
   end subroutine smooth_excess

end module mesoslip_contacts_populations_thermal_step
