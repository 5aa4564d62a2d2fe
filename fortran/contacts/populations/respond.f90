!> Response of populations to a motion of the slider: contacts break, and others attach.
module mesoslip_contacts_populations_respond
   use mesoslip_contacts_populations_loading, only: follow_load, jump_load
   use mesoslip_contacts_populations_motion, only: excess_of_mean
   use mesoslip_contacts_populations_state, only: population_state_type
   use mesoslip_interface_law, only: interface_law_type, pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: respond_to_motion

   !> Populations that cost as much as one contact that breaks
   real(wp), parameter :: populations_per_cost = 16.0_wp
   !> Duration of a step over the time in which the slider oscillates by a radian, beyond which its
   !> motion counts as uniform
   real(wp), parameter :: even_time = 1.5_wp
   !> Maximum part of a motion after which breaks start
   real(wp), parameter :: max_start = 0.99_wp

contains

   !> Break and attach contacts after a motion of the slider.
   subroutine respond_to_motion(self, before, after)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      type(pose_type) :: start, end
      logical :: has_broken

      start = before
      end = after
      if (self%pinned%is_thermal) call straighten(self, start, end)
      if (self%offers) call add_step_work(self, start, end)
      if (self%pinned%is_thermal) then
         call try_thermal(self, start, end, has_broken)
      else
         call try_to_break(self, start, end, has_broken)
      end if
      if (has_broken) call detach_tried(self, before, after)
      if (.not. self%detached%is_empty()) call attach_due(self, start, end)
      call follow_load(self, start, end)
      if (self%pinned%ages) call self%pinned%update_thresholds(after%displacement, after%time)
      if (self%pinned%some_fall .and. .not. self%pinned%is_thermal) then
         call break_fallen(self, before, after)
      end if
      self%detached_count = self%detached%number%total()
      self%cost = 1.0_wp + self%pinned%count / populations_per_cost
      if (self%pinned%is_thermal) call record_step(self, before, after)
      call jump_load(self, after)
      self%offers = .false.
   end subroutine respond_to_motion

   !> Detach the contacts that break in the trial.
   subroutine detach_tried(self, before, after)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp), allocatable :: held(:)
      real(wp) :: start_time, growth

      allocate (held(0))
      if (allocated(self%pinned%mix)) held = self%pinned%tried_mix()
      call self%pinned%break_tried(self%break_loss)
      associate (trial => self%pinned%trial)
         self%breaks = self%breaks + trial%breaks
         call self%step_work%add(trial%work)
         call find_rate_of_breaks(self, before, after, start_time, growth)
         call self%detached%add(start_time, after%time, trial%breaks, trial%mass, growth, held, &
            & self%failure)
      end associate
   end subroutine detach_tried

   !> Time at which breaks in a motion start [s], and half the change of their rate from then on
   !> over the mean rate, from -1 to 1. Contacts that reach their thresholds break as the slider
   !> moves, and by where they break on average, as the work says that their breaks save; by
   !> activation evenly in time. A rate that grows from 0 starts later where most break late.
   pure subroutine find_rate_of_breaks(self, before, after, start_time, growth)
      class(population_state_type), intent(in) :: self
      type(pose_type), intent(in) :: before, after
      real(wp), intent(out) :: start_time, growth

      start_time = before%time
      growth = 0.0_wp
      if (self%pinned%is_thermal) return
      associate (twice_mean => before%velocity + after%velocity, trial => self%pinned%trial)
         if (trial%direction * twice_mean > 0.0_wp) then
            growth = (after%velocity - before%velocity) / twice_mean + trial%growth()
            if (growth > 1.0_wp) start_time = before%time &
               & + min(max_start, 0.5_wp * (growth - 1.0_wp)) * (after%time - before%time)
            growth = max(-1.0_wp, min(1.0_wp, growth))
         end if
      end associate
   end subroutine find_rate_of_breaks

   !> Break contacts whose thresholds fell to forces against the direction of motion.
   subroutine break_fallen(self, before, after)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: direction, late, onset

      direction = -after%direction
      if (abs(after%displacement - before%displacement) > 0.0_wp) then
         direction = sign(1.0_wp, before%displacement - after%displacement)
      end if
      if (self%pinned%gap_ahead(after%displacement, direction) > 0.0_wp) return
      call self%pinned%try(before, after%displacement, after%time, direction, late, onset, &
         & self%failure)
      call detach_tried(self, before, after)
   end subroutine break_fallen

   !> Find what breaks of contacts that break at their thresholds.
   subroutine try_to_break(self, before, after, has_broken)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after
      !> Whether contacts break
      logical, intent(out) :: has_broken

      real(wp) :: direction, late, onset, distance

      distance = after%displacement - before%displacement
      direction = sign(1.0_wp, distance)
      has_broken = self%pinned%gap_ahead(after%displacement, direction) < 0.0_wp
      if (self%pinned%some_fall .and. .not. has_broken) then
         ! Where thresholds fall contacts may break at rest.
         if (.not. abs(distance) > 0.0_wp) direction = after%direction
         has_broken = self%pinned%gap_ahead(after%displacement, direction) <= 0.0_wp
      end if
      if (.not. has_broken) return
      if (.not. self%pinned%has_tried(after%displacement, after%time)) then
         call self%pinned%try(before, after%displacement, after%time, direction, late, onset, &
            & self%failure)
      end if
   end subroutine try_to_break

   !> Find what breaks of contacts that break by activation.
   subroutine try_thermal(self, before, after, has_broken)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after
      !> Whether contacts break
      logical, intent(out) :: has_broken

      real(wp) :: late, onset

      has_broken = self%pinned%count > 0 .and. (after%time > before%time &
         & .or. abs(after%displacement - before%displacement) > 0.0_wp)
      if (has_broken) call self%pinned%try_motion(before, after, after%displacement, late, onset, &
         & self%failure)
   end subroutine try_thermal

   !> Make a motion uniform in which the slider may have oscillated many times, hardly visibly.
   pure subroutine straighten(self, before, after)
      class(population_state_type), intent(in) :: self
      type(pose_type), intent(inout) :: before, after

      real(wp) :: duration

      duration = after%time - before%time
      if (.not. duration * self%oscillation_rate(before) > even_time) return
      before%velocity = (after%displacement - before%displacement) / duration
      before%acceleration = 0.0_wp
      after%velocity = before%velocity
      after%acceleration = 0.0_wp
   end subroutine straighten

   !> Record what the next step is based on.
   subroutine record_step(self, before, after)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: duration
      type(interface_law_type) :: law

      duration = after%time - before%time
      if (.not. duration > 0.0_wp) return
      self%last_duration = duration
      self%last_velocity = (after%displacement - before%displacement) / duration
      self%excess = 0.0_wp
      if (.not. (before%inverse_mass > 0.0_wp .and. self%offers)) return
      law = self%law()
      self%excess = (self%offered%stiffness - law%stiffness) * after%displacement &
         & - (self%offered%offset - law%offset) + (self%offered%drag - law%drag) * after%velocity &
         & + self%offered%rate * duration
   end subroutine record_step

   !> Add the work of the offered force minus that of the contacts before the motion.
   subroutine add_step_work(self, before, after)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: distance, duration, middle
      type(interface_law_type) :: law

      law = self%law()
      distance = after%displacement - before%displacement
      duration = after%time - before%time
      middle = before%displacement + 0.5_wp * distance
      call self%step_work%add(distance * ((self%offered%stiffness - law%stiffness) * middle &
         & - (self%offered%offset - law%offset)) + self%offered%rate * duration &
         & * (0.5_wp * distance - excess_of_mean(before, after)))
   end subroutine add_step_work

   !> Attach all contacts that are due, as one population at their mean displacement.
   subroutine attach_due(self, before, after)
      class(population_state_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: births, moment, square, when, origin, force, lost, slowness
      real(wp), allocatable :: held(:)

      allocate (held(self%bins()), source=0.0_wp)
      call self%detached%take_due(before, after, births, moment, square, when, held)
      if (.not. births > 0.0_wp) return
      if (size(held) > 0) self%pinned%newborn_mix = held / births

      origin = before%displacement + moment / births
      if (self%pinned%has_track) then
         call self%pinned%sum_newborns(self%parameters%strength%factor(origin))
      end if
      call self%birth_gain%add(births * self%pinned%newborn_energy)
      force = after%direction * self%pinned%newborn_force
      call self%step_work%add(-births * (after%displacement - origin) &
         & * (0.5_wp * self%pinned%newborn_stiffness * (after%displacement - origin) &
         & + self%parameters%static_force * force))
      slowness = 0.0_wp
      if (abs(after%displacement - before%displacement) > 0.0_wp) slowness = (after%time &
         & - before%time) / (after%displacement - before%displacement)
      call self%pinned%attach(births, origin, max(0.0_wp, square / births &
         & - (moment / births)**2), after%direction, slowness, after%displacement, &
         & min(when / births, after%time), after%time, lost, self%failure)
      call self%step_work%add(lost)
   end subroutine attach_due

end module mesoslip_contacts_populations_respond
