!> The loop of a run: a slider moves under the law of its contacts until one breaks or attaches.
module mesoslip_loop_simulation
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_stalled
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_schedule, only: max_events, schedule_type
   use mesoslip_step_filter, only: step_filter_type
   use mesoslip_recording_buffer, only: buffer_type
   use mesoslip_recording_avalanches, only: avalanche_recorder_type
   use mesoslip_contacts_base, only: contacts_type
   use mesoslip_sliders_base, only: slider_type
   use mesoslip_recording_recorder, only: recorder_type, most_samples_in_step
   use mesoslip_recording_stages, only: stage_recorder_type
   use mesoslip_recording_steady, only: steady_recorder_type
   implicit none
   private

   public :: simulation_type
   public :: energy_length
   public :: ending_none, ending_drive, ending_avalanches, ending_broken, ending_slides, &
      & ending_slips, ending_displacement, ending_steady

   !> Terms of the energy balance: work of the drive; energy of the slider and its spring; of the
   !> contacts; losses by damping, by drag, by breaking; gain by attaching; residual
   integer, parameter :: energy_length = 8

   !> Why a run is over: it is not; the drive came to its end; there were as many avalanches as
   !> wanted; no contact is left to break; contacts break under a force without end; there were as
   !> many slips as wanted; the slider came to its displacement; the state is steady
   integer, parameter :: ending_none = 0, ending_drive = 1, ending_avalanches = 2, &
      & ending_broken = 3, ending_slides = 4, ending_slips = 5, ending_displacement = 6, &
      & ending_steady = 7

   !> Time at which nothing happens
   real(wp), parameter :: never = huge(1.0_wp)

   !> Breaks of each contact in one avalanche, on average, from which on a slider under a force is
   !> taken to slide for ever.
   real(wp), parameter :: most_lives = 1000.0_wp

   !> The origin of displacements follows the slider when it is this many breaking stretches ahead.
   real(wp), parameter :: farthest_stretches = 64.0_wp
   !> A velocity of the drive that differs by this part is another one.
   real(wp), parameter :: tiny_part = 1.0e-9_wp
   !> Advances in a row that leave both time and displacement as they were.
   integer, parameter :: most_idle_advances = 1000000

   !> A slider on contacts, driven in stages, and what is recorded of it.
   type :: simulation_type
      !> The slider
      class(slider_type), allocatable :: slider
      !> The contacts
      class(contacts_type), allocatable :: contacts
      !> The recorder
      type(recorder_type) :: recorder
      !> The recorder of avalanches and snapshots
      type(avalanche_recorder_type) :: avalanches
      !> The recorder of stages of the drive
      type(stage_recorder_type) :: stages
      !> Whether the state is steady, in the last part of the drive
      type(steady_recorder_type) :: steady
      !> Slips after which the run is over
      integer(i8) :: most_slips = huge(1_i8)
      !> Displacement of the slider at which it is over [m]; 0 for none
      real(wp) :: farthest = 0.0_wp
      !> Ends of the parts of the drive, in which its acceleration is constant, shape (parts) [s]
      real(wp), allocatable :: part_end(:)
      !> Its velocities at the start and at the end of each part, shape (parts) [m/s]
      real(wp), allocatable :: start_velocity(:), end_velocity(:)
      !> Numbers of the stages that the parts are of, shape (parts)
      integer, allocatable :: stage_of_part(:)
      !> Advances of the slider so far
      integer(i8) :: advances = 0
      !> Why the run is over, an ending_ code
      integer :: ending = ending_none
      !> Breaks, and attachments, in a schedule; 0 for none. The numbers do not depend on it
      integer :: longest_schedule = max_events

      !> Whether the run has been started
      logical :: is_started = .false.

      !> A state that was put away and has not been fetched
      type(archive_type), private :: kept

      !> What comes next; between two calls of run it is over
      type(schedule_type), private :: schedule

      !> Part of the drive
      integer, private :: part = 1
      !> Advances since time or displacement changed
      integer, private :: idle = 0
      real(wp), private :: start_energy = 0.0_wp
   contains
      !> Prepare the start of a run
      procedure, non_overridable :: start
      !> Go on for some advances, or until the end
      procedure, non_overridable :: run
      !> Terms of the energy balance
      procedure, non_overridable :: energy_balance
      !> Put the state into an archive or take it out
      procedure, non_overridable :: exchange
      !> A table of what was recorded, rows of it that can be taken away, and taking them away
      procedure, non_overridable :: table
      procedure, non_overridable :: rows_to_drain
      procedure, non_overridable :: drain
      !> Put the state away, fetch it, and go on from it
      procedure, non_overridable :: save
      procedure, non_overridable :: fetch
      procedure, non_overridable :: restore
      !> Whether all parts are there
      procedure, non_overridable :: is_whole
      procedure, non_overridable, private :: advance, advance_once, run_ahead, change_drive, &
         & take_part, acceleration, follow, finish, is_broken, slides, longest_step, stop_early, &
         & is_there, look_for_steady
   end type simulation_type

contains

   !> Whether all parts are there: a slider, contacts, and a drive.
   pure function is_whole(self)
      !> The simulation
      class(simulation_type), intent(in) :: self
      !> Whether they are
      logical :: is_whole

      is_whole = allocated(self%slider) .and. allocated(self%contacts) &
         & .and. allocated(self%stage_of_part) .and. allocated(self%recorder%trace%row) &
         & .and. allocated(self%avalanches%catalogue%row) .and. allocated(self%stages%rows%row) &
         & .and. allocated(self%recorder%slips%row)
   end function is_whole

   !> Prepare the start of a run: contacts drawn, slider at rest and in balance.
   subroutine start(self, initial)
      !> The simulation
      class(simulation_type), intent(inout) :: self
      !> Initial state of the contacts, an initial_ code of the ensemble
      integer, intent(in) :: initial

      self%is_started = .true.
      call self%contacts%initialize(initial)
      call self%slider%drive(self%start_velocity(1), self%acceleration())
      call self%slider%start(self%contacts%law())
      self%slider%direction = self%slider%drive_direction
      call self%contacts%respond(self%slider%pose(), self%slider%pose())
      self%start_energy = self%slider%energy() &
         & + self%contacts%elastic_energy(self%slider%displacement)
      call self%stages%begin(self%slider, self%stage_of_part(1))
      call self%look_for_steady()
      call self%recorder%record(self%slider, self%contacts%detached_count, 0.0_wp)
      call self%avalanches%see_response(self%slider, self%contacts, self%contacts%law())
      call self%avalanches%see_advance(self%slider, self%contacts)
   end subroutine start

   !> Go on for some advances or some work, or until much waits to be taken away, or until the end.
   subroutine run(self, most_advances, most_work, error)
      !> The simulation
      class(simulation_type), intent(inout) :: self
      !> Number of advances of the slider
      integer(i8), intent(in) :: most_advances
      !> Work, in units of an advance of a rigid slider or a contact that breaks
      real(wp), intent(in) :: most_work
      !> Set if the motion makes no progress
      type(error_type), allocatable, intent(out) :: error

      integer(i8) :: last
      integer(i8) :: advances
      real(wp) :: time, displacement, most_breaks, work

      ! One advance may break very many contacts, and a segment must not last for minutes.
      last = self%advances + most_advances
      most_breaks = self%contacts%breaks + most_work
      work = 0.0_wp
      do
         if (self%ending /= ending_none) exit
         if (self%slider%can_pause) then
            if (self%advances >= last .or. work >= most_work) exit
            if (self%contacts%breaks > most_breaks) exit
            if (self%recorder%is_full() .or. self%avalanches%is_full()) exit
            if (self%stages%is_full()) exit
         end if
         advances = self%advances
         time = self%slider%time
         displacement = self%slider%displacement
         call self%advance(last, most_breaks)
         work = work + real(max(1_i8, self%advances - advances), wp) &
            & * (self%slider%cost + self%contacts%cost)
         if (allocated(self%slider%failure)) then
            error = self%slider%failure
            return
         end if
         if (allocated(self%contacts%failure)) then
            error = self%contacts%failure
            return
         end if
         if (self%slider%time > time &
            & .or. abs(self%slider%displacement - displacement) > 0.0_wp) then
            self%idle = 0
         else
            self%idle = self%idle + 1
            if (self%idle > most_idle_advances) then
               call raise(error, status_stalled, "the motion makes no progress: contacts break "// &
                  & "and attach again without end at one displacement")
               return
            end if
         end if
      end do
   end subroutine run

   !> Some advances of the slider through a schedule, or one.
   subroutine advance(self, last, most_breaks)
      class(simulation_type), intent(inout) :: self
      !> Advances, and breaks, after which to stop
      integer(i8), intent(in) :: last
      real(wp), intent(in) :: most_breaks

      self%schedule%is_over = .true.
      if (self%slider%runs_ahead .and. self%longest_schedule > 0 &
         & .and. .not. (self%avalanches%sees_each() &
         & .or. abs(self%slider%drive_acceleration) > 0.0_wp)) then
         call self%contacts%plan(self%slider%pose(), self%longest_schedule, self%schedule)
         if (abs(self%farthest) > 0.0_wp) call stop_within(self%schedule, &
            & self%farthest - self%slider%origin, sign(1.0_wp, self%farthest))
      end if
      if (self%schedule%is_over) then
         call self%advance_once(last, most_breaks)
      else
         call self%run_ahead(last)
      end if
   end subroutine advance

   !> The slider runs ahead through the schedule, and contacts keep their books afterwards.
   subroutine run_ahead(self, last)
      class(simulation_type), intent(inout) :: self
      !> Advances after which to stop
      integer(i8), intent(in) :: last

      type(step_filter_type) :: filter
      type(pose_type) :: before
      type(interface_law_type) :: law
      logical :: turns

      self%schedule%end_time = min(self%part_end(self%part), self%steady%block_end)
      self%schedule%longest_step = self%longest_step()
      self%schedule%mean_stiffness = self%contacts%parameters%stiffness
      self%schedule%farthest_force = farthest_stretches * self%contacts%parameters%static_force
      before = self%slider%pose()
      do
         filter = self%recorder%step_filter(self%slider)
         call self%stages%narrow(filter, self%slider)
         filter%max_steps = last - self%advances
         call self%slider%run_ahead(self%schedule, filter)
         self%advances = self%advances + filter%steps
         call self%recorder%skip_steps(filter)
         turns = self%slider%direction * self%schedule%direction < 0.0_wp
         if (filter%is_selected) then
            call self%recorder%record(self%slider, real(self%schedule%detached, wp), &
               & self%contacts%breaks + self%schedule%broken)
            call self%stages%record(self%slider)
            if (.not. turns) call self%schedule%pass(self%slider%time, self%slider%displacement)
         end if
         if (turns .or. self%schedule%is_over .or. self%advances >= last) exit
         if (self%recorder%is_full() .or. self%recorder%slips_so_far() >= self%most_slips) exit
      end do
      call self%contacts%settle(self%schedule, self%slider%pose())
      call self%avalanches%pass_over(self%schedule%moments, self%contacts%breaks)
      if (turns) then
         ! The schedule was for the other direction: what is due at the turn is for contacts to say.
         law = self%contacts%law()
         call self%contacts%respond(before, self%slider%pose())
         call self%avalanches%see_response(self%slider, self%contacts, law)
      end if
      call self%change_drive()
   end subroutine run_ahead

   !> One advance of the slider and the events at its end, or several in the midst of an avalanche.
   subroutine advance_once(self, last, most_breaks)
      class(simulation_type), intent(inout) :: self
      !> Advances, and breaks, after which to stop
      integer(i8), intent(in) :: last
      real(wp), intent(in) :: most_breaks

      type(pose_type) :: before
      type(interface_law_type) :: law
      type(window_type) :: window
      real(wp) :: end_time

      before = self%slider%pose()
      call self%contacts%offer(before, law, window)
      if (self%is_broken(law, window)) then
         call self%finish(ending_broken)
         return
      end if
      end_time = min(self%part_end(self%part), self%slider%drive_turn, self%steady%block_end, &
         & self%slider%time + self%longest_step())
      window%end_time = min(window%end_time, end_time)
      if (abs(self%farthest) > 0.0_wp .and. .not. self%slider%instant) then
         if (self%farthest > 0.0_wp) then
            window%upper = min(window%upper, self%farthest - self%slider%origin)
         else
            window%lower = max(window%lower, self%farthest - self%slider%origin)
         end if
      end if

      call self%slider%advance(law, window)
      self%advances = self%advances + 1
      if (self%slider%instant) then
         ! In the midst of an avalanche time stands still: there is nothing else to look at.
         do while (self%advances < last .and. self%contacts%breaks <= most_breaks)
            if (self%slider%settled .or. self%slider%unbound) exit
            before = self%slider%pose()
            call self%contacts%respond(before, before)
            call self%avalanches%see_response(self%slider, self%contacts, law)
            if (allocated(self%contacts%failure) .or. self%slides()) exit
            call self%follow()
            before = self%slider%pose()
            call self%contacts%offer(before, law, window)
            window%end_time = min(window%end_time, end_time)
            call self%slider%advance(law, window)
            self%advances = self%advances + 1
         end do
      end if
      if (allocated(self%slider%failure) .or. allocated(self%contacts%failure)) return
      if (self%slider%unbound) then
         call self%finish(ending_broken)
         return
      end if
      if (self%slides()) then
         call self%finish(ending_slides)
         return
      end if
      call self%recorder%record(self%slider, self%contacts%detached_count, self%contacts%breaks)
      call self%stages%record(self%slider)
      call self%avalanches%see_advance(self%slider, self%contacts)
      if (self%avalanches%avalanches >= self%avalanches%parameters%most_avalanches) then
         call self%finish(ending_avalanches)
         return
      end if

      if (self%slider%instant .and. self%slider%settled .and. self%is_there()) then
         call self%finish(ending_displacement)
         return
      end if

      call self%contacts%respond(before, self%slider%pose())
      call self%avalanches%see_response(self%slider, self%contacts, law)
      call self%change_drive()
   end subroutine advance_once

   !> Longest step of the slider, so that it does not come past too many samples [s].
   pure function longest_step(self) result(step)
      class(simulation_type), intent(in) :: self
      real(wp) :: step

      step = self%recorder%parameters%interval
      if (self%recorder%parameters%slip_interval > 0.0_wp) then
         step = min(step, self%recorder%parameters%slip_interval)
      end if
      step = 0.5_wp * most_samples_in_step * step
   end function longest_step

   !> Go over to the next part of the drive, or to the end; move the origin along.
   subroutine change_drive(self)
      class(simulation_type), intent(inout) :: self

      call self%stop_early()
      if (self%ending /= ending_none) return
      ! An avalanche under a slider without inertia has to end before a part of the drive does.
      if (self%slider%time >= min(self%part_end(self%part), self%slider%drive_turn) &
         & .and. .not. self%avalanches%size > 0.0_wp) then
         if (self%slider%time < self%part_end(self%part)) then
            call self%slider%drive(0.0_wp, self%acceleration())
            call self%stages%mark(self%slider)
            self%recorder%drive_changes = .true.
         else if (self%part == size(self%part_end)) then
            call self%finish(ending_drive)
            return
         else
            call self%take_part(self%part + 1)
         end if
      end if
      call self%follow()
   end subroutine change_drive

   !> Go over to a part of the drive, which may be of another stage.
   subroutine take_part(self, part)
      class(simulation_type), intent(inout) :: self
      integer, intent(in) :: part

      real(wp) :: velocity, direction
      logical :: is_new

      is_new = self%stage_of_part(part) /= self%stage_of_part(self%part)
      velocity = self%slider%drive_velocity_at(self%slider%time)
      direction = self%slider%drive_direction
      if (is_new) call self%stages%finish(self%slider)
      self%part = part
      call self%slider%drive(self%start_velocity(part), self%acceleration())
      if (is_new) then
         call self%stages%begin(self%slider, self%stage_of_part(part))
      else
         call self%stages%mark(self%slider)
      end if
      call self%look_for_steady()
      is_new = is_new .and. abs(self%start_velocity(part) - velocity) &
         & > tiny_part * max(abs(velocity), abs(self%start_velocity(part)))
      if (is_new .or. abs(self%slider%drive_direction - direction) > 0.0_wp) then
         self%recorder%drive_changes = .true.
      end if
   end subroutine take_part

   !> In the last part of the drive, at a constant velocity, look for a steady state.
   subroutine look_for_steady(self)
      class(simulation_type), intent(inout) :: self

      if (self%part < size(self%part_end) .or. abs(self%acceleration()) > 0.0_wp) return
      call self%steady%begin(self%slider%time, self%start_velocity(self%part))
   end subroutine look_for_steady

   !> End the run where it is to stop before its drive ends.
   subroutine stop_early(self)
      class(simulation_type), intent(inout) :: self

      logical :: is_steady

      if (self%recorder%slips_so_far() >= self%most_slips) then
         call self%finish(ending_slips)
         return
      end if
      ! A slider without inertia jumps past a displacement: that is told where it comes to rest.
      if (self%is_there() .and. .not. self%slider%instant) then
         call self%finish(ending_displacement)
         return
      end if
      if (self%slider%time < self%steady%block_end) return
      call self%steady%see_block(self%slider%stage_impulse%total() &
         & + self%slider%impulse%total(), is_steady)
      if (is_steady) call self%finish(ending_steady)
   end subroutine stop_early

   !> Whether the slider has come to the displacement at which the run is over.
   pure function is_there(self)
      class(simulation_type), intent(in) :: self
      logical :: is_there

      is_there = abs(self%farthest) > 0.0_wp .and. sign(1.0_wp, self%farthest) &
         & * (self%slider%displacement - (self%farthest - self%slider%origin)) >= 0.0_wp
   end function is_there

   !> Let a schedule end before a displacement.
   pure subroutine stop_within(schedule, displacement, direction)
      type(schedule_type), intent(inout) :: schedule
      !> The displacement [m], and the direction in which it must not be passed, +1 or -1
      real(wp), intent(in) :: displacement, direction

      if (schedule%is_over) return
      if (direction * schedule%direction > 0.0_wp) then
         do while (schedule%breaks > 0)
            if (schedule%break_coordinate(schedule%breaks) < direction * displacement) exit
            schedule%breaks = schedule%breaks - 1
         end do
         schedule%is_over = schedule%breaks == 0
      else
         schedule%behind = max(schedule%behind, schedule%direction * displacement)
      end if
   end subroutine stop_within

   !> Acceleration of the drive in its part [m/s2].
   pure function acceleration(self)
      class(simulation_type), intent(in) :: self
      real(wp) :: acceleration

      real(wp) :: start

      acceleration = self%end_velocity(self%part) - self%start_velocity(self%part)
      start = 0.0_wp
      if (self%part > 1) start = self%part_end(self%part - 1)
      if (abs(acceleration) > 0.0_wp) acceleration = acceleration &
         & / (self%part_end(self%part) - start)
   end function acceleration

   !> Whether contacts break under a force without end.
   pure function slides(self)
      class(simulation_type), intent(in) :: self
      logical :: slides

      slides = self%slider%under_force &
         & .and. self%avalanches%size > most_lives * self%contacts%parameters%count
   end function slides

   !> Whether no contact is left to break, in a run that would go on until one does.
   pure function is_broken(self, law, window)
      class(simulation_type), intent(in) :: self
      type(interface_law_type), intent(in) :: law
      type(window_type), intent(in) :: window
      logical :: is_broken

      is_broken = .not. (law%stiffness > 0.0_wp .or. window%end_time < never &
         & .or. self%part_end(self%part) < never .or. self%avalanches%size > 0.0_wp)
   end function is_broken

   !> The run is over.
   subroutine finish(self, ending)
      class(simulation_type), intent(inout) :: self
      !> An ending_ code
      integer, intent(in) :: ending

      ! A slide without end is no avalanche.
      if (ending /= ending_slides) then
         call self%avalanches%close(self%slider, self%contacts, self%slider%displacement)
      end if
      call self%recorder%finish()
      call self%stages%finish(self%slider)
      self%ending = ending
   end subroutine finish

   !> Move the origin of displacements along with the slider.
   subroutine follow(self)
      class(simulation_type), intent(inout) :: self

      real(wp) :: grid, shift

      if (abs(self%slider%displacement) * self%contacts%parameters%stiffness &
         & < farthest_stretches * self%contacts%parameters%static_force) return
      ! On a grid of powers of two the origin and the new displacement have no rounding error.
      grid = scale(1.0_wp, &
         & exponent(self%contacts%parameters%static_force / self%contacts%parameters%stiffness))
      shift = grid * anint(self%slider%displacement / grid)
      call self%slider%shift_origin(shift)
      call self%contacts%shift_origin(shift, self%slider%displacement)
   end subroutine follow

   !> Terms of the energy balance, and how far it is from closing.
   function energy_balance(self) result(energy)
      !> The simulation
      class(simulation_type), intent(in) :: self
      !> Terms in the order of energy_length [J]
      real(wp) :: energy(energy_length)

      energy(1) = self%slider%drive_work()
      energy(2) = self%slider%energy()
      energy(3) = self%contacts%elastic_energy(self%slider%displacement)
      energy(4) = self%slider%damping_loss%total()
      energy(5) = self%slider%drag_loss%total()
      energy(6) = self%contacts%break_loss%total()
      energy(7) = self%contacts%birth_gain%total()
      energy(8) = energy(1) - (energy(2) + energy(3) - self%start_energy) &
         & - energy(4) - energy(5) - energy(6) + energy(7)
   end function energy_balance

   !> Put the state into an archive or take it out; a queue taken out is ordered anew.
   subroutine exchange(self, archive)
      !> The simulation
      class(simulation_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%section("simulation")
      call archive%exchange("part", self%part)
      call archive%exchange("idle", self%idle)
      call archive%exchange("start_energy", self%start_energy)
      call archive%exchange("advances", self%advances)
      call archive%exchange("ending", self%ending)
      call archive%exchange("is_started", self%is_started)
      call self%slider%exchange(archive)
      call self%contacts%exchange(archive)
      call self%recorder%exchange(archive)
      call self%stages%exchange(archive)
      call self%steady%exchange(archive)
      call self%avalanches%exchange(archive)
      call archive%finish()
      if (archive%saving .or. allocated(archive%failure)) return
      call self%contacts%rebuild(self%slider%displacement)
   end subroutine exchange

   !> A table of what was recorded.
   function table(self, name) result(buffer)
      !> The simulation
      class(simulation_type), intent(inout), target :: self
      !> Its name
      character(len=*), intent(in) :: name
      !> The table; null if there is none of this name
      type(buffer_type), pointer :: buffer

      select case (name)
      case ("trace")
         buffer => self%recorder%trace
      case ("slip_trace")
         buffer => self%recorder%slip_trace
      case ("slips")
         buffer => self%recorder%slips
      case ("stages")
         buffer => self%stages%rows
      case ("layers")
         buffer => self%recorder%layers
      case ("avalanches")
         buffer => self%avalanches%catalogue
      case ("snapshot_places")
         buffer => self%avalanches%places
      case ("snapshots")
         buffer => self%avalanches%snapshots
      case default
         buffer => null()
      end select
   end function table

   !> Rows of a table that can be taken away.
   function rows_to_drain(self, name) result(rows)
      !> The simulation
      class(simulation_type), intent(inout), target :: self
      !> Name of the table
      character(len=*), intent(in) :: name
      !> Their number
      integer :: rows

      type(buffer_type), pointer :: buffer

      buffer => self%table(name)
      rows = 0
      if (associated(buffer)) rows = buffer%count
      if (name == "slip_trace") rows = self%recorder%final_slip_samples()
   end function rows_to_drain

   !> Take the first rows of a table away.
   subroutine drain(self, name, values, error)
      !> The simulation
      class(simulation_type), intent(inout), target :: self
      !> Name of the table
      character(len=*), intent(in) :: name
      !> The rows, shape (numbers in a row, rows)
      real(wp), intent(inout) :: values(:, :)
      !> Set if there is no such table, or it has not as many rows, or others
      type(error_type), allocatable, intent(out) :: error

      type(buffer_type), pointer :: buffer
      integer :: rows

      buffer => self%table(name)
      rows = self%rows_to_drain(name)
      if (.not. associated(buffer)) then
         call raise(error, status_invalid, "unknown table '" // name // "'")
      else if (size(values, 1) /= size(buffer%row, 1) .or. size(values, 2) > rows) then
         call raise(error, status_invalid, "the table '" // name // "' has other rows")
      else if (name == "slip_trace") then
         call self%recorder%drain_slip_trace(values)
      else
         call buffer%drain(values)
      end if
   end subroutine drain

   !> Put the state away.
   subroutine save(self, length, error)
      !> The simulation
      class(simulation_type), intent(inout) :: self
      !> Words of the state
      integer(i8), intent(out) :: length
      !> Set if the run cannot be taken up from here
      type(error_type), allocatable, intent(out) :: error

      self%kept = archive_type(saving=.true.)
      call self%exchange(self%kept)
      length = self%kept%length
      if (allocated(self%kept%failure)) error = self%kept%failure
   end subroutine save

   !> Fetch the state that was put away; it is forgotten.
   subroutine fetch(self, words, error)
      !> The simulation
      class(simulation_type), intent(inout) :: self
      !> The state, as many words as it has
      integer(i8), intent(inout) :: words(:)
      !> Set if there is none, or one of another length
      type(error_type), allocatable, intent(out) :: error

      if (size(words, kind=i8) == self%kept%length .and. self%kept%length > 0) then
         words = self%kept%word(:self%kept%length)
         self%kept = archive_type()
      else
         call raise(error, status_invalid, "no state of this length was put away")
      end if
   end subroutine fetch

   !> Go on from a state that was put away.
   subroutine restore(self, words, error)
      !> The simulation
      class(simulation_type), intent(inout) :: self
      !> The state
      integer(i8), intent(in) :: words(:)
      !> Set if the state is of another simulation, or damaged
      type(error_type), allocatable, intent(out) :: error

      type(archive_type) :: archive

      if (self%is_started) then
         call raise(error, status_invalid, "the simulation has been started already")
         return
      end if
      archive%word = words
      archive%length = size(words, kind=i8)
      call self%exchange(archive)
      if (allocated(archive%failure)) error = archive%failure
   end subroutine restore

end module mesoslip_loop_simulation
