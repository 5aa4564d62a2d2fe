!> Contacts that break by thermal activation under a slider whose motion is prescribed and uniform.
!>
!> At the constant velocity v the hazard of a contact under positive force is a function of its
!> stretch: from the stretch a to the stretch x it grows by
!> omega_0 f_T/(k v) exp(-f_s/f_T) (exp(k x/f_T) - exp(k a/f_T)). At birth the stretch is solved at
!> which it reaches the deviate of the contact. The contact breaks there or at its threshold, as one
!> without temperature, and schedules have no clocks. Under negative force the same holds for the
!> stretch of the other sign. When the velocity changes, the remaining deviates continue with the
!> clocks.
module mesoslip_contacts_thermal_steady
   use mesoslip_contacts_individual_births, only: drag_of
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_stiffness
   use mesoslip_contacts_thermal_keys, only: life_clock, life_key, life_left, life_next, set_up_keys
   use mesoslip_contacts_thermal_lists, only: thermal_lists_type
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: thermal_steady_type, set_up_steady, grown

   !> Minimum velocity, over f_T/k times omega_0: the displacement of a slower slider does not
   !> resolve the time to rounding
   real(wp), parameter :: min_velocity_ratio = 1.0e-6_wp
   !> Numbers of a next life: stretch at the threshold, stretch at which the deviate is used up,
   !> configured breaking stretch, and deviates drawn
   integer, parameter :: next_limit = 1, next_key = 2, next_configured = 3, next_attempts = 4, &
      & next_length = 4

   !> Contacts whose breaking displacements are known in advance if the motion is uniform.
   type, abstract, extends(thermal_lists_type) :: thermal_steady_type
      !> Contacts of the schedule that break
      integer, private :: steady_listed(max_events) = 0
      !> Numbers of the next lives of contacts of the schedule, shape (next_length, count)
      real(wp), allocatable, private :: next(:, :)
   contains
      procedure, non_overridable :: follow_motion, join_steadily, plan_steadily, settle_steadily
      procedure, non_overridable :: breaking_stretch
      !> For one contact: solve where it breaks when a uniform motion begins, continue with the
      !> clocks when it ends, solve where it will break at birth, and begin that life
      procedure :: start_steadily, end_steadily, solve_newborn, begin_solved
      procedure, non_overridable, private :: begin_steady, end_steady, list_next
   end type thermal_steady_type

contains

   !> Set up contacts that write schedules, with common parameters, from the other numbers.
   subroutine set_up_steady(self, parameters, error)
      class(thermal_steady_type), intent(inout) :: self
      type(parameters_type), intent(inout) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      call set_up_keys(self, parameters, error)
      if (allocated(error)) return
      allocate (self%entry(self%parameters%count), source=0, stat=stat)
      if (stat == 0) then
         allocate (self%next(next_length, self%parameters%count), source=0.0_wp, stat=stat)
      end if
      if (stat /= 0) call raise(error, status_memory, "not enough memory for lists of contacts")
   end subroutine set_up_steady

   !> Order the contacts for the present motion of the slider, uniform or not.
   subroutine follow_motion(self, pose)
      class(thermal_steady_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      logical :: is_steady

      is_steady = pose%is_uniform .and. self%hazard%slope * abs(pose%velocity) &
         & >= min_velocity_ratio * self%hazard%rate
      if (self%is_steady) then
         if (is_steady .and. .not. abs(pose%velocity - self%velocity) > 0.0_wp) return
         call self%end_steady(pose)
      end if
      if (is_steady) call self%begin_steady(pose)
   end subroutine follow_motion

   !> Order contacts by where they break in the uniform motion.
   subroutine begin_steady(self, pose)
      class(thermal_steady_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      self%is_steady = .true.
      self%velocity = pose%velocity
      self%direction = sign(1.0_wp, pose%velocity)
      do contact = 1, self%parameters%count
         if (self%record(row_stiffness, contact) > 0.0_wp) call self%start_steadily(contact, pose)
      end do
      call self%rebuild(pose%displacement)
   end subroutine begin_steady

   !> Solve where a pinned contact breaks as a uniform motion begins.
   subroutine start_steadily(self, contact, pose)
      class(thermal_steady_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      call self%update_deviate(contact)
      self%life(life_key, contact) = self%breaking_stretch(self%record(row_limit, contact), &
         & self%direction * (pose%displacement - self%record(row_origin, contact)), &
         & self%life(life_left, contact))
   end subroutine start_steadily

   !> Order contacts by the clocks again.
   subroutine end_steady(self, pose)
      class(thermal_steady_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact

      self%is_steady = .false.
      call self%clear_orders()
      self%behind = -huge(1.0_wp)
      self%hazard%reference = pose%displacement
      self%hazard%reading = 0.0_wp
      self%hazard%max_exponent = 0.0_wp
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         call self%end_steadily(contact, pose)
         call self%put(contact)
      end do
   end subroutine end_steady

   !> Continue a pinned contact with the clocks as a uniform motion ends. Its remaining deviate
   !> follows from the distance to where it would break.
   subroutine end_steadily(self, contact, pose)
      class(thermal_steady_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: stretch, growth

      stretch = pose%displacement - self%record(row_origin, contact)
      associate (limit => self%record(row_limit, contact), life => self%life(:, contact))
         growth = grown(self%hazard%slope, limit, life(life_key)) &
            & - grown(self%hazard%slope, limit, self%direction * stretch)
         life(life_left) = max(0.0_wp, growth) * self%hazard%rate &
            & / (self%hazard%slope * abs(self%velocity))
         if (.not. abs(stretch) > 0.0_wp) stretch = self%direction
         life(life_clock) = merge(1.0_wp, 2.0_wp, stretch > 0.0_wp)
      end associate
   end subroutine end_steadily

   !> Solve where a contact will break that attaches in the uniform motion.
   subroutine solve_newborn(self, contact, later, stretch, left, limit, key, attempts)
      class(thermal_steady_type), intent(inout) :: self
      !> Number of the contact, and renewals until that life
      integer, intent(in) :: contact, later
      !> First stretch along the motion [m], and deviate
      real(wp), intent(in) :: stretch, left
      !> Configured breaking stretch; on return that at the threshold [m]
      real(wp), intent(inout) :: limit
      !> Stretch at which its deviate is used up [m], and deviates drawn
      real(wp), intent(out) :: key, attempts

      key = self%breaking_stretch(limit, stretch, left)
      attempts = 1.0_wp
   end subroutine solve_newborn

   !> Begin a life that was solved: nothing more here.
   subroutine begin_solved(self, contact, time, configured, attempts)
      class(thermal_steady_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Time [s], configured breaking stretch [m], and deviates drawn
      real(wp), intent(in) :: time, configured, attempts

   end subroutine begin_solved

   !> Hazard from zero stretch to a stretch, in units of omega_0 f_T/(k v), with the sign of the
   !> stretch; slope is k/f_T, and limit the stretch at the threshold.
   pure function grown(slope, limit, stretch)
      real(wp), intent(in) :: slope, limit, stretch
      real(wp) :: grown

      grown = sign(exp(slope * (abs(stretch) - limit)) - exp(-slope * limit), stretch)
   end function grown

   !> Stretch at which the hazard of a contact reaches its remaining deviate, given the stretch at
   !> the threshold and the present stretch along the motion [m].
   pure function breaking_stretch(self, limit, stretch, left) result(breaking)
      class(thermal_steady_type), intent(in) :: self
      real(wp), intent(in) :: limit, stretch, left
      real(wp) :: breaking

      real(wp) :: wanted

      associate (slope => self%hazard%slope)
         wanted = left * (slope * abs(self%velocity) / self%hazard%rate)
         if (stretch >= 0.0_wp) then
            wanted = exp(slope * (stretch - limit)) + wanted
            breaking = limit + log(max(wanted, tiny(1.0_wp))) / slope
            return
         end if
         wanted = wanted + grown(slope, limit, stretch)
         breaking = sign(limit + log(max(abs(wanted) + exp(-slope * limit), tiny(1.0_wp))) &
            & / slope, wanted)
      end associate
   end function breaking_stretch

   !> Insert a contact that has attached in a uniform motion.
   subroutine join_steadily(self, contact, pose)
      class(thermal_steady_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: stretch, configured, attempts

      stretch = pose%displacement - self%record(row_origin, contact)
      ! To the last digit as in a schedule.
      if (.not. (allocated(self%births%force) .or. self%parameters%keeps_thresholds &
         & .or. self%touches)) stretch = pose%direction &
         & * self%parameters%back_force_ratio * self%parameters%static_force &
         & / self%record(row_stiffness, contact)
      self%life(life_clock, contact) = merge(1.0_wp, 2.0_wp, self%direction > 0.0_wp)
      configured = self%record(row_limit, contact)
      call self%solve_newborn(contact, 0, self%direction * stretch, &
         & self%life(life_left, contact), self%record(row_limit, contact), &
         & self%life(life_key, contact), attempts)
      call self%begin_solved(contact, pose%time, configured, attempts)
      call self%insert(contact)
   end subroutine join_steadily

   !> Write a schedule of a uniform motion: the next breaks, and about as many attachments.
   subroutine plan_steadily(self, pose, limit, schedule)
      class(thermal_steady_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      integer :: number, event, contact(max_events)

      schedule%is_over = .true.
      ! With a track it is not known before where contacts attach, nor thus where they break.
      if (self%track%columns > 0 .or. self%parameters%strength%is_used) return
      call self%order(self%ahead)%preview(min(limit, max_events), self%steady_listed, &
         & schedule%break_coordinate, number)
      if (number == 0) return
      do event = 1, number
         schedule%break_origin(event) = self%record(row_origin, self%steady_listed(event))
      end do
      schedule%break_stiffness(:number) = self%parameters%stiffness
      schedule%break_drag(:number) = drag_of(self%parameters, self%parameters%stiffness)
      schedule%has_clocks = .false.
      schedule%breaks = number
      schedule%broken = 0
      schedule%moments = 0
      schedule%direction = self%direction
      schedule%behind = -huge(1.0_wp)
      call self%list_attachments(min(limit, max_events, 2 * number + 4), pose%direction, &
         & schedule, contact)
      call self%draw_deviates(contact(:schedule%attachments), 0_i8)
      call self%list_next(contact(:schedule%attachments), 0, schedule%attach_stretch, &
         & schedule%attach_limit)
      call self%list_births(self%steady_listed(:number), 0, pose%direction, schedule)
      if (schedule%has_births) then
         call self%draw_deviates(self%steady_listed(:number), 1_i8)
         call self%list_next(self%steady_listed(:number), 1, schedule%birth_stretch, &
            & schedule%birth_limit)
      end if
      schedule%is_over = .false.
   end subroutine plan_steadily

   !> Solve where contacts with drawn deviates break that attach in a uniform motion with a stretch
   !> [m]; limit is the stretch at the threshold, on return that at breaking [m].
   subroutine list_next(self, contact, later, stretch, limit)
      class(thermal_steady_type), intent(inout) :: self
      !> Numbers of the contacts, and renewals until those lives
      integer, intent(in) :: contact(:), later
      real(wp), intent(in) :: stretch(:)
      real(wp), intent(inout) :: limit(:)

      real(wp) :: configured, key, attempts
      integer :: event

      do event = 1, size(contact)
         configured = limit(event)
         call self%solve_newborn(contact(event), later, self%direction * stretch(event), &
            & self%life(life_next, contact(event)), limit(event), key, attempts)
         self%next(:, contact(event)) = [limit(event), key, configured, attempts]
         limit(event) = min(limit(event), key)
      end do
   end subroutine list_next

   !> Update the contacts after a schedule of a uniform motion.
   subroutine settle_steadily(self, schedule)
      class(thermal_steady_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule

      integer :: event, attached(max_events)

      do event = 1, schedule%broken
         call self%take_out(self%steady_listed(event))
         self%life(:life_key, self%steady_listed(event)) = 0.0_wp
      end do
      call self%detach_listed(self%steady_listed(:schedule%broken), schedule)
      call self%attach_listed(schedule, attached)
      do event = 1, schedule%attached
         associate (contact => attached(event), next => self%next(:, attached(event)))
            ! As for a contact that attaches outside a schedule, whose force is not known before.
            if (allocated(self%births%force) .or. self%parameters%keeps_thresholds) then
               next(next_limit) = next(next_configured)
               call self%solve_newborn(contact, 0, self%direction &
                  & * (schedule%attach_displacement(event) - self%record(row_origin, contact)), &
                  & self%life(life_next, contact), next(next_limit), next(next_key), &
                  & next(next_attempts))
            end if
            self%record(row_limit, contact) = next(next_limit)
            self%life(:, contact) = [merge(1.0_wp, 2.0_wp, self%direction > 0.0_wp), 0.0_wp, &
               & next(next_key), 0.0_wp]
            call self%begin_solved(contact, schedule%attach_time(event), next(next_configured), &
               & next(next_attempts))
            call self%insert(contact)
         end associate
      end do
   end subroutine settle_steadily

end module mesoslip_contacts_thermal_steady
