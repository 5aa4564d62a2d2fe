!> Steps of populations that break by thermal activation: their duration, and what breaks in them.
!>
!> In a step only a small part of the contacts breaks by activation. A slider that hardly oscillates
!> is expected to creep as in the step before; only the breaks then limit the duration of a step.
module mesoslip_contacts_populations_thermal_step
   use mesoslip_contacts_populations_motion, only: distance_in, time_after, time_to_move
   use mesoslip_contacts_populations_packets, only: expected_births_type
   use mesoslip_contacts_populations_state, only: population_state_type
   use mesoslip_interface_law, only: interface_law_type, pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: expect_motion, look_ahead_thermal, smooth_excess, max_growth, min_part

   !> Negligible force of an oscillation, over f_T of all contacts and at resolution 1
   real(wp), parameter :: quiet_part = 1.0e-2_wp
   !> Maximum duration of a step over that of the step before
   real(wp), parameter :: max_growth = 4.0_wp
   !> Minimum displacement over which breaks are found, over the length of a step
   real(wp), parameter :: min_part = 1.0e-3_wp
   !> Breaks allowed in a step at rest over those allowed in another, and displacement over the
   !> length of a step up to which the slider rests
   real(wp), parameter :: part_at_rest = 0.1_wp
   !> Tolerated breaks over those allowed in a step, and trials of shorter steps
   real(wp), parameter :: leeway = 1.1_wp
   integer, parameter :: max_trials = 100

contains

   !> Negligible force of an oscillation [N].
   pure function quiet_force(self) result(force)
      class(population_state_type), intent(in) :: self
      real(wp) :: force

      associate (parameters => self%parameters)
         ! Also beyond resolution 1, where a coarse run is for the error of another.
         force = quiet_part * self%resolution**2 * parameters%count &
            & * parameters%static_force * min(1.0_wp, self%pinned%activation%width)
      end associate
   end function quiet_force

   !> Expected motion: uniform, as in the step before, if the slider hardly oscillates.
   subroutine expect_motion(self, pose, expected, is_quiet)
      class(population_state_type), intent(in) :: self
      type(pose_type), intent(in) :: pose
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

   !> Find what breaks in a step of expected motion, and which part of it attaches; the step may
   !> become shorter.
   subroutine look_ahead_thermal(self, pose, direction, max_births, span, distance, reach, &
      & limit, births)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Direction of the motion, and maximum number of contacts that attach
      real(wp), intent(in) :: direction, max_births
      !> Duration of the step [s], expected displacement in it, displacement until which breaks at
      !> thresholds are found, and maximum displacement of the step [m]
      real(wp), intent(inout) :: span, distance, reach, limit
      type(expected_births_type), intent(inout) :: births

      real(wp) :: late, onset, part, heat, own, max_heat
      type(pose_type) :: after
      integer :: trial_number
      logical :: may_end_early

      may_end_early = .true.
      do trial_number = 1, max_trials
         after = pose
         after%time = time_after(pose%time, span)
         after%displacement = pose%displacement + direction * distance
         after%velocity = 2.0_wp * direction * distance / (after%time - pose%time) - pose%velocity
         call self%pinned%try_motion(pose, after, pose%displacement + direction * reach, late, &
            & onset, self%failure)
         if (allocated(self%failure)) return
         if (may_end_early .and. late > self%max_late &
            & .and. abs(onset - pose%displacement) < reach) then
            ! Where many populations start to reach their thresholds the force has a kink.
            may_end_early = .false.
            reach = abs(onset - pose%displacement)
            limit = reach
            if (reach < distance) then
               call shorten_step(pose, direction, time_to_move(pose, direction, reach), span, &
                  & distance, births)
            end if
            cycle
         end if
         associate (trial => self%pinned%trial)
            heat = trial%breaks - trial%cut_breaks
            own = self%detached%own_part(span, 0.0_wp)
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
         call shorten_step(pose, direction, part * span, span, distance, births)
         reach = max(distance, min_part * self%pinned%step)
         may_end_early = .true.
      end do
      births%own_mass = births%own
      ! Contacts break and attach by activation evenly in time.
      births%number = births%number + own * heat
      births%mass = births%mass + own * heat
   end subroutine look_ahead_thermal

   !> Shorten a step of a duration and displacement to a time [s], and its births in proportion:
   !> contacts break, and so attach, all the time.
   pure subroutine shorten_step(pose, direction, time, span, distance, births)
      type(pose_type), intent(in) :: pose
      real(wp), intent(in) :: direction, time
      real(wp), intent(inout) :: span, distance
      type(expected_births_type), intent(inout) :: births

      births%number = births%number * time / span
      births%mass = births%mass * time / span
      span = time
      distance = distance_in(pose, direction, span)
   end subroutine shorten_step

   !> Let the offered force begin with that at the end of the last step, and reach the contact force
   !> at the end of this one: a jump would shake the slider.
   pure subroutine smooth_excess(self, span, law)
      class(population_state_type), intent(in) :: self
      !> Duration of the step [s]
      real(wp), intent(in) :: span
      type(interface_law_type), intent(inout) :: law

      law%tolerance = quiet_force(self)
      if (.not. span > 0.0_wp) return
      law%offset = law%offset - self%excess
      law%rate = law%rate - self%excess / span
   end subroutine smooth_excess

end module mesoslip_contacts_populations_thermal_step
