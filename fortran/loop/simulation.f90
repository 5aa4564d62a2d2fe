!> The loop of a run: a slider moves under the law of its contacts until one breaks or attaches.
module mesoslip_loop_simulation
   use mesoslip_contacts_row, only: contact_row_type
   use mesoslip_interface_law, only: interface_law_type
   use mesoslip_loop_endings, only: ending_drive, ending_none, ending_slips, ending_steady
   use mesoslip_loop_events, only: advance_to_event
   use mesoslip_loop_instant, only: advance_in_equilibrium
   use mesoslip_loop_row, only: advance_row, start_row
   use mesoslip_loop_scheduled, only: advance_through_schedule
   use mesoslip_loop_segment, only: new_segment, segment_type
   use mesoslip_loop_state, only: max_idle_advances, no_progress, state_type
   use mesoslip_loop_transitions, only: look_for_steady, shift_origin, take_next_part
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_stalled
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_sliders_instant, only: instant_slider_type
   use mesoslip_sliders_interface_row, only: row_slider_type
   use mesoslip_sliders_scheduled, only: scheduled_slider_type
   implicit none
   private

   public :: simulation_type

   !> Share of the time of a part of the drive that is no progress for all of them together
   real(wp), parameter :: tiny_part = 1.0e-20_wp
   !> Time at which nothing happens
   real(wp), parameter :: never = huge(1.0_wp)

   !> A run.
   type, extends(state_type) :: simulation_type
   contains
      procedure, non_overridable :: start
      procedure, non_overridable :: follow
      procedure, non_overridable :: run
      procedure, non_overridable, private :: balance, advance, check_progress
   end type simulation_type

contains

   !> Prepare the start of a run: contacts drawn, slider at rest and in balance.
   subroutine start(self, initial)
      class(simulation_type), intent(inout) :: self
      !> Initial state of the contacts, an initial_ code of the ensemble
      integer, intent(in) :: initial

      type(interface_law_type) :: law

      self%is_started = .true.
      call self%contacts%initialize(initial)
      call self%slider%drive%begin(self%slider%time)
      call self%slider%adapt_to_drive()
      self%slider%direction = self%slider%drive%direction
      law = self%contacts%law()
      call self%balance(law)
      call self%stages%begin(self%slider, self%slider%drive%stage())
      call look_for_steady(self)
      call self%recorder%record(self%slider, self%contacts%detached_count, 0.0_wp)
      call self%avalanches%count_breaks(self%slider, self%contacts, law)
      select type (slider => self%slider)
      class is (instant_slider_type)
         continue
      class default
         call self%avalanches%close(slider, self%contacts, slider%displacement)
      end select
      call self%avalanches%take_due_snapshots(self%slider, self%contacts)
   end subroutine start

   !> Put the slider at rest, in balance with the contacts, which may break at once.
   subroutine balance(self, law)
      class(simulation_type), intent(inout), target :: self
      !> Force of the contacts
      type(interface_law_type), intent(in) :: law

      select type (contacts => self%contacts)
      type is (contact_row_type)
         select type (slider => self%slider)
         class is (row_slider_type)
            call start_row(self, slider, contacts)
            return
         end select
      end select
      call self%slider%start(law)
      self%start_energy = self%slider%energy() &
         & + self%contacts%elastic_energy(self%slider%displacement)
      call self%contacts%respond(self%slider%pose(), self%slider%pose())
   end subroutine balance

   !> Continue from the end of another run, whose state was restored: the first part of the drive is
   !> over, and the second begins. Time, displacement and counts continue.
   subroutine follow(self, error)
      class(simulation_type), intent(inout) :: self
      !> Set if no run can follow
      type(error_type), allocatable, intent(out) :: error

      if (all(self%ending /= [ending_drive, ending_slips, ending_steady])) then
         call raise(error, status_invalid, "a run follows one that came to the end of its drive, " &
            & // "to a steady state or to a number of slips")
         return
      end if
      call self%slider%drive%rewind()
      if (self%slider%drive%is_last_part()) then
         call raise(error, status_invalid, "the drive of a run that follows has a part before it")
         return
      end if
      self%ending = ending_none
      call take_next_part(self)
      call shift_origin(self)
      call self%recorder%trace%begin(self%slider%time)
      call self%recorder%trace%take_samples(self%slider, self%contacts%detached_count)
      call self%avalanches%begin_run()
      call self%avalanches%take_due_snapshots(self%slider, self%contacts)
   end subroutine follow

   !> Continue until the end of the run or of a segment, or until a buffer should be drained.
   subroutine run(self, max_advances, max_work, error)
      class(simulation_type), intent(inout) :: self
      !> Advances of the slider, and work, in the segment: 1 for an advance of a rigid slider or a
      !> break
      integer(i8), intent(in) :: max_advances
      real(wp), intent(in) :: max_work
      !> Set if the motion makes no progress, or there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      type(segment_type) :: segment
      integer(i8) :: advances
      logical :: is_scheduled

      ! Once, as this takes some time.
      is_scheduled = .false.
      select type (slider => self%slider)
      class is (scheduled_slider_type)
         is_scheduled = .true.
      end select
      segment = new_segment(self%advances, self%contacts%breaks, max_advances, max_work)
      do while (self%ending == ending_none)
         if (self%slider%can_pause()) then
            if (segment%is_over(self%advances, self%contacts%breaks)) exit
            if (self%recorder%is_full()) exit
            if (self%avalanches%is_full() .or. self%stages%is_full()) exit
            if (self%ruptures%is_full()) exit
         end if
         advances = self%advances
         call self%advance(is_scheduled, segment)
         call segment%add(self%advances - advances, self%slider%cost + self%contacts%cost)
         if (allocated(self%slider%failure)) then
            error = self%slider%failure
         else if (allocated(self%contacts%failure)) then
            error = self%contacts%failure
         else
            call self%check_progress(self%advances - advances, error)
         end if
         if (allocated(error)) exit
      end do
      call self%contacts%gather()
      if (allocated(error)) return
      call self%report_failure(error)
   end subroutine run

   !> Some advances, by the loop for this family of sliders.
   subroutine advance(self, is_scheduled, segment)
      class(simulation_type), intent(inout), target :: self
      !> Whether the slider runs through schedules
      logical, intent(in) :: is_scheduled
      type(segment_type), intent(in) :: segment

      if (is_scheduled) then
         call advance_through_schedule(self, segment)
         return
      end if
      select type (slider => self%slider)
      class is (instant_slider_type)
         call advance_in_equilibrium(self, slider, segment)
      class is (row_slider_type)
         select type (contacts => self%contacts)
         type is (contact_row_type)
            call advance_row(self, slider, contacts)
         class default
            call advance_to_event(self)
         end select
      class default
         call advance_to_event(self)
      end select
   end subroutine advance

   !> Make sure that advances change time or displacement. Steps that become shorter without end do
   !> not.
   subroutine check_progress(self, advances, error)
      class(simulation_type), intent(inout) :: self
      !> Number of the last advances
      integer(i8), intent(in) :: advances
      !> Set if very many have changed neither
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: no_time, no_distance

      associate (slider => self%slider, contacts => self%contacts%parameters)
         no_time = epsilon(1.0_wp) * slider%time
         if (slider%drive%end_of_part() < never) then
            no_time = max(no_time, tiny_part * slider%drive%end_of_part())
         end if
         no_distance = epsilon(1.0_wp) * contacts%static_force / contacts%stiffness
         ! The origin moves without rounding error: that is no progress.
         if (slider%time - self%idle_since(1) > no_time .or. abs((slider%origin &
            & - self%idle_since(2)) + (slider%displacement - self%idle_since(3))) &
            & > no_distance) then
            self%idle = 0
            self%idle_since = [slider%time, slider%origin, slider%displacement]
            return
         end if
      end associate
      self%idle = self%idle + int(min(max(1_i8, advances), int(max_idle_advances, i8)))
      if (self%idle > max_idle_advances) call raise(error, status_stalled, no_progress)
   end subroutine check_progress

end module mesoslip_loop_simulation
