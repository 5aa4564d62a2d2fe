!> Breaks of pinned populations in a motion of the slider.
!>
!> A trial of the motion comes first: the slider is offered a force by what will break. That breaks
!> when the slider has arrived.
module mesoslip_contacts_populations_breaking
   use mesoslip_contacts_mechanics, only: broken_threshold
   use mesoslip_contacts_populations_rows, only: column_ahead, column_behind, column_birth, &
      & column_broken, column_factor, column_force, column_law, column_level, column_origin, &
      & column_weight, compliant, lost, massive, moments_length, number, population_rows_type, stiff
   use mesoslip_contacts_populations_survivors, only: no_level
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: breaking_populations_type, tiny_gap, unresolved_part

   !> Part of a population below which its first contacts do not break apart and its last ones do
   !> not remain: breaks are differences of numbers, and rounding errors must not decide
   real(wp), parameter :: unresolved_part = 1.0e-12_wp
   !> Populations that are searched together for breaks
   integer, parameter :: block = 8
   !> Negligible gap over the length of a step
   real(wp), parameter :: tiny_gap = 1.0e-6_wp
   !> The same of contacts that age
   real(wp), parameter :: near_part = 1.0e-3_wp

   !> Trial of a motion to a displacement and time in a direction.
   type :: trial_type
      !> Displacement [m], time [s] and direction, and length of the motion [m]
      real(wp) :: end = 0.0_wp, time = 0.0_wp, direction = 1.0_wp, reach = 0.0_wp
      !> The populations of which contacts break; their forces at attaching and distances from
      !> there, both along the direction; after the breaks their broken thresholds, levels and
      !> moments, and what activation leaves at nodes; and twice the energy that is lost; shape
      !> (count or more)
      integer :: count = 0
      integer, allocatable :: population(:)
      real(wp), allocatable :: force(:), distance(:), broken(:), level(:), moments(:, :), lost(:)
      real(wp), allocatable :: kept(:, :)
      !> Sums over the breaks: contacts, mass, work that the breaks save [J], and force that the
      !> contacts would bear at the end [N]
      real(wp) :: breaks = 0.0_wp, mass = 0.0_wp, work = 0.0_wp, drop = 0.0_wp
      !> Stiffness of the contacts that break [N/m], and breaks of populations that start to break
      !> at one place in the motion
      real(wp) :: stiffness = 0.0_wp, together = 0.0_wp
      !> The same of contacts that reach their thresholds, which break with the displacement; the
      !> others break with the time
      real(wp) :: cut_breaks = 0.0_wp, cut_work = 0.0_wp, cut_drop = 0.0_wp
      !> Displacement at which the next population breaks [m]
      real(wp) :: next = 0.0_wp
   contains
      procedure, non_overridable :: bend, growth
   end type trial_type

   !> Pinned populations of which contacts break.
   type, extends(population_rows_type) :: breaking_populations_type
      !> Maximum displacement in which one population attaches [m]
      real(wp) :: step = 0.0_wp
      type(trial_type) :: trial
   contains
      procedure, non_overridable :: try, begin_trial, has_tried, forget_trial, break_tried
      procedure, non_overridable :: tried_mix, keep
      procedure, non_overridable :: gap_ahead, near_gap
      procedure, non_overridable, private :: list_breaking, find_thresholds, find_moments, &
         & find_left_of_table, sum_breaks, more_lost, remove_empty
   end type breaking_populations_type

contains

   !> Height by which the mean force in the trial lies above its chord, by breaks at thresholds [N].
   elemental function bend(self)
      class(trial_type), intent(in) :: self
      real(wp) :: bend

      bend = 0.5_wp * self%cut_drop - self%cut_work / self%reach
   end function bend

   !> Half the change of the rate of breaks over the displacement, over its mean.
   !>
   !> Contacts that break at a part s of the displacement h would bear k (1 - s) h more at its end:
   !> at a constant rate these forces bend the force by K h / 12, for all of the stiffness K.
   elemental function growth(self)
      class(trial_type), intent(in) :: self
      real(wp) :: growth

      real(wp) :: force

      force = self%drop - 0.5_wp * self%stiffness * self%reach
      growth = 0.0_wp
      if (force * self%reach > 0.0_wp) then
         growth = (6.0_wp * self%bend() - 0.5_wp * self%stiffness * self%reach) / force
      end if
   end function growth

   !> Find what breaks until the slider reaches a displacement [m] at a time [s].
   subroutine try(self, before, displacement, time, direction, late, onset, error)
      class(breaking_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before
      real(wp), intent(in) :: displacement, time, direction
      !> Breaks of populations that start to break in the motion, and where most of them do so [m]
      real(wp), intent(out) :: late, onset
      !> Set if there is not enough memory; nothing breaks then
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: next
      integer :: column

      column = merge(column_ahead, column_behind, direction > 0.0_wp)
      late = 0.0_wp
      onset = displacement
      call self%begin_trial(before, displacement, time, direction, error)
      if (allocated(error)) return
      call self%list_breaking(displacement, direction, column, self%trial%count, next)
      self%trial%next = direction * next

      ! Each for all populations, so that one does not wait for the results of another.
      call self%find_thresholds()
      call self%find_moments()
      call self%sum_breaks(before, column, late, onset)
      if (self%trial%count == 0) then
         if (direction > 0.0_wp) self%ahead = self%trial%next
         if (direction < 0.0_wp) self%behind = self%trial%next
      end if
   end subroutine try

   !> Forces, distances and broken thresholds of the populations that break.
   subroutine find_thresholds(self)
      class(breaking_populations_type), intent(inout) :: self

      real(wp) :: distance, force, broken, factor
      integer :: row, one

      associate (trial => self%trial)
         do one = 1, trial%count
            row = trial%population(one)
            force = trial%direction * self%population(row, column_force)
            distance = trial%direction * (trial%end - self%population(row, column_origin)) &
               & / self%stretch
            trial%force(one) = force
            trial%distance(one) = distance
            if (self%has_track) then
               factor = self%population(row, column_factor)
               force = force / factor
               distance = distance / factor
            end if
            if (self%has_table) then
               broken = 0.0_wp
            else if (self%ages) then
               broken = self%ageing%configured(max(0.0_wp, distance + force), &
                  & trial%time - self%population(row, column_birth))
            else
               broken = broken_threshold(self%parameters%coupling, force, distance)
            end if
            trial%broken(one) = max(self%population(row, column_broken), broken)
         end do
      end associate
   end subroutine find_thresholds

   !> Moments of the contacts that remain pinned.
   subroutine find_moments(self)
      class(breaking_populations_type), intent(inout) :: self

      real(wp) :: moments(moments_length)
      integer :: row, one

      associate (trial => self%trial)
         do one = 1, trial%count
            row = trial%population(one)
            if (self%has_table) then
               call self%find_left_of_table(row, trial%distance(one), moments)
            else
               call self%moments(int(self%population(row, column_law)))%interpolate( &
                  & trial%broken(one), moments)
            end if
            if (moments(number) < unresolved_part) moments = 0.0_wp
            if (self%has_track) then
               moments(lost) = self%population(row, column_factor)**2 * moments(lost)
            end if
            trial%moments(:, one) = min(self%population(row, column_weight) * moments, &
               & self%left(:, row))
         end do
      end associate
   end subroutine find_moments

   !> The same for contacts with the stiffnesses of a table, after a distance along the direction.
   pure subroutine find_left_of_table(self, row, distance, moments)
      class(breaking_populations_type), intent(in) :: self
      integer, intent(in) :: row
      real(wp), intent(in) :: distance
      real(wp), intent(out) :: moments(moments_length)

      real(wp) :: ahead, behind

      associate (one => self%population(row, :))
         ahead = (one(column_ahead) - one(column_origin)) / self%stretch
         behind = (one(column_origin) - one(column_behind)) / self%stretch
         if (self%trial%direction > 0.0_wp) then
            ahead = max(ahead, distance)
         else
            behind = max(behind, distance)
         end if
         call self%table_lives%left(nint(one(column_law)), ahead, behind, moments)
      end associate
   end subroutine find_left_of_table

   !> Sums over the breaks; the column is that of the direction.
   subroutine sum_breaks(self, before, column, late, onset)
      class(breaking_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before
      integer, intent(in) :: column
      real(wp), intent(inout) :: late, onset

      real(wp) :: loss(moments_length), distance, force, max_breaks, edge, breaks, mass, work, drop
      real(wp) :: stiffness
      integer :: row, one

      associate (trial => self%trial)
         max_breaks = 0.0_wp
         edge = trial%direction * before%displacement + self%near_gap()
         breaks = 0.0_wp
         mass = 0.0_wp
         work = 0.0_wp
         drop = 0.0_wp
         stiffness = 0.0_wp
         do one = 1, trial%count
            row = trial%population(one)
            force = trial%force(one)
            distance = trial%distance(one)
            loss = self%left(:, row) - trial%moments(:, one)
            if (self%ages) loss(lost) = loss(lost) + loss(number) &
               & * self%more_lost(before, row, trial%broken(one), distance + force)
            trial%lost(one) = loss(lost)
            breaks = breaks + loss(number)
            mass = mass + loss(massive)
            stiffness = stiffness + loss(stiff)
            drop = drop + loss(stiff) * distance + loss(number) * force
            work = work + 0.5_wp * (loss(stiff) * distance**2 &
               & + 2.0_wp * loss(number) * force * distance + loss(compliant) * force**2 &
               & - loss(lost))
            if (trial%direction * self%population(row, column) > edge) then
               late = late + loss(number)
               if (loss(number) > max_breaks) then
                  max_breaks = loss(number)
                  onset = self%population(row, column)
               end if
            end if
         end do
         trial%together = 0.0_wp
         if (late > max_breaks) trial%together = breaks_from(onset)
         if (.not. trial%together > max_breaks) trial%together = 0.0_wp
         trial%breaks = breaks
         trial%mass = mass
         trial%stiffness = stiffness * self%parameters%stiffness
         trial%work = work * self%parameters%static_force * self%stretch
         trial%drop = drop * self%parameters%static_force
         trial%cut_breaks = trial%breaks
         trial%cut_work = trial%work
         trial%cut_drop = trial%drop
      end associate

   contains

      !> Breaks of the populations that start to break at a displacement [m].
      pure function breaks_from(start) result(breaks)
         real(wp), intent(in) :: start
         real(wp) :: breaks

         integer :: one

         breaks = 0.0_wp
         do one = 1, self%trial%count
            associate (row => self%trial%population(one))
               if (abs(self%population(row, column) - start) <= self%near_gap()) breaks = breaks &
                  & + (self%left(number, row) - self%trial%moments(number, one))
            end associate
         end do
      end function breaks_from

   end subroutine sum_breaks

   !> Energy of the contacts of a population that break beyond that of their configured thresholds,
   !> twice the mean over them, if the force at breaking is linear in these thresholds.
   pure function more_lost(self, before, row, last, last_force) result(energy)
      class(breaking_populations_type), intent(in) :: self
      type(pose_type), intent(in) :: before
      integer, intent(in) :: row
      !> Configured threshold below which contacts break, and the force then
      real(wp), intent(in) :: last, last_force
      real(wp) :: energy

      real(wp) :: first, start_force, start_broken, part, first_force, end_force, factor

      energy = 0.0_wp
      first = self%population(row, column_broken)
      if (.not. last > first) return
      start_force = max(0.0_wp, self%trial%direction * (self%population(row, column_force) &
         & + (before%displacement - self%population(row, column_origin)) / self%stretch))
      end_force = last_force
      factor = 1.0_wp
      if (self%has_track) then
         factor = self%population(row, column_factor)
         start_force = start_force / factor
         end_force = end_force / factor
      end if
      start_broken = self%ageing%configured(start_force, &
         & before%time - self%population(row, column_birth))
      part = 0.0_wp
      if (start_broken < first) part = (first - start_broken) / (last - start_broken)
      first_force = start_force + part * (end_force - start_force)
      if (start_broken > first) first = start_broken
      energy = factor**2 * ((first_force**2 - first**2) + (first_force * end_force &
         & - first * last) + (end_force**2 - last**2)) / 3.0_wp
   end function more_lost

   !> Begin a trial: make room for all populations, and set its motion.
   subroutine begin_trial(self, before, displacement, time, direction, error)
      class(breaking_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before
      real(wp), intent(in) :: displacement, time, direction
      !> Set if there is not enough memory; the trial is empty then
      type(error_type), allocatable, intent(inout) :: error

      integer :: rows, stat

      stat = 0
      rows = size(self%population, 1)
      if (allocated(self%trial%population)) then
         if (size(self%trial%population) /= rows) self%trial = trial_type()
      end if
      associate (trial => self%trial)
         if (.not. allocated(trial%population)) then
            allocate (trial%population(rows), stat=stat)
            if (stat == 0) allocate (trial%force(rows), stat=stat)
            if (stat == 0) allocate (trial%distance(rows), stat=stat)
            if (stat == 0) allocate (trial%broken(rows), stat=stat)
            if (stat == 0) allocate (trial%level(rows), source=no_level, stat=stat)
            if (stat == 0) allocate (trial%moments(moments_length, rows), stat=stat)
            if (stat == 0) allocate (trial%lost(rows), stat=stat)
            if (stat == 0 .and. allocated(self%kept)) then
               allocate (trial%kept(size(self%kept, 1), rows), stat=stat)
            end if
         end if
         trial%end = displacement
         trial%time = time
         trial%direction = direction
         trial%reach = abs(displacement - before%displacement)
      end associate
      if (stat == 0) return
      self%trial = trial_type()
      call raise(error, status_memory, "not enough memory for the populations of contacts")
   end subroutine begin_trial

   !> List the populations of which contacts break until the slider reaches a displacement [m].
   subroutine list_breaking(self, displacement, direction, column, listed, next)
      class(breaking_populations_type), intent(inout) :: self
      real(wp), intent(in) :: displacement, direction
      integer, intent(in) :: column
      !> Their number, and the coordinate along the direction at which the next one breaks [m]
      integer, intent(out) :: listed
      real(wp), intent(out) :: next

      real(wp) :: here, coordinate, nearest_of(4)
      integer :: first, row
      logical :: breaks

      listed = 0
      next = huge(1.0_wp)
      here = direction * displacement
      do first = 1, self%count, block
         if (first + block - 1 <= self%count) then
            ! In most blocks no population breaks.
            associate (position => self%population(first:first + block - 1, column))
               nearest_of = min(direction * position(:4), direction * position(5:))
            end associate
            coordinate = min(min(nearest_of(1), nearest_of(2)), min(nearest_of(3), nearest_of(4)))
            if (coordinate > here) then
               next = min(next, coordinate)
               cycle
            end if
         end if
         ! In the others breaks are as good as random: they are listed without a branch. Contacts
         ! whose thresholds fall may break while the slider rests.
         do row = first, min(first + block - 1, self%count)
            coordinate = direction * self%population(row, column)
            breaks = coordinate < here .or. (self%some_fall .and. .not. coordinate > here)
            self%trial%population(listed + 1) = row
            listed = listed + merge(1, 0, breaks)
            next = min(next, merge(huge(1.0_wp), coordinate, breaks))
         end do
      end do
   end subroutine list_breaking

   !> Distance of the slider at a displacement to the next break in a direction [m].
   pure function gap_ahead(self, displacement, direction) result(gap)
      class(breaking_populations_type), intent(in) :: self
      real(wp), intent(in) :: displacement, direction
      real(wp) :: gap

      gap = merge(self%ahead - displacement, displacement - self%behind, direction > 0.0_wp)
   end function gap_ahead

   !> Distance to the next break up to which a step begins with breaks [m]. Steps that end at the
   !> next break of contacts which strengthen meanwhile become shorter and shorter.
   pure function near_gap(self) result(gap)
      class(breaking_populations_type), intent(in) :: self
      real(wp) :: gap

      gap = merge(near_part, tiny_gap, self%ages) * self%step
   end function near_gap

   !> Whether the trial is that of a displacement [m] and a time [s], which matters only with
   !> ageing.
   pure function has_tried(self, displacement, time)
      class(breaking_populations_type), intent(in) :: self
      real(wp), intent(in) :: displacement, time
      logical :: has_tried

      has_tried = self%trial%count > 0 .and. .not. abs(self%trial%end - displacement) > 0.0_wp
      if (self%ages) has_tried = has_tried .and. .not. abs(self%trial%time - time) > 0.0_wp
   end function has_tried

   !> Make the trial one of no breaks.
   pure subroutine forget_trial(self)
      class(breaking_populations_type), intent(inout) :: self

      self%trial%count = 0
      self%trial%breaks = 0.0_wp
      self%trial%cut_breaks = 0.0_wp
      self%trial%mass = 0.0_wp
   end subroutine forget_trial

   !> Break what breaks in the trial, and add the elastic energy lost [J].
   subroutine break_tried(self, break_loss)
      class(breaking_populations_type), intent(inout) :: self
      type(accumulator_type), intent(inout) :: break_loss

      type(accumulator_type) :: stiffness, offset, energy
      real(wp) :: loss(moments_length), ahead, behind
      integer :: trial, row

      ! Local, so that they stay in registers: each break waits for the one before.
      stiffness = self%stiffness
      offset = self%offset
      energy = break_loss
      ahead = self%ahead
      behind = self%behind
      if (self%trial%direction > 0.0_wp) then
         ahead = self%trial%next
      else
         behind = self%trial%next
      end if
      associate (population => self%population, parameters => self%parameters)
         ! The last population, already done, takes the row of one that is removed.
         do trial = self%trial%count, 1, -1
            row = self%trial%population(trial)
            loss = self%left(:, row) - self%trial%moments(:, trial)
            call stiffness%add(-parameters%stiffness * loss(stiff))
            call offset%add(parameters%static_force * loss(number) &
               & * population(row, column_force) &
               & - parameters%stiffness * loss(stiff) * population(row, column_origin))
            call energy%add(0.5_wp * parameters%static_force * self%stretch &
               & * self%trial%lost(trial))
            self%left(:, row) = self%trial%moments(:, trial)
            population(row, column_broken) = self%trial%broken(trial)
            population(row, column_level) = self%trial%level(trial)
            if (allocated(self%kept)) self%kept(:, row) = self%trial%kept(:, trial)
            if (self%left(number, row) > 0.0_wp) then
               if (self%trial%direction > 0.0_wp) then
                  population(row, column_ahead) = self%trial%end
                  population(row, column_behind) = self%next_break(row, -1.0_wp, self%trial%time)
               else
                  population(row, column_behind) = self%trial%end
                  population(row, column_ahead) = self%next_break(row, 1.0_wp, self%trial%time)
               end if
               ahead = min(ahead, population(row, column_ahead))
               behind = max(behind, population(row, column_behind))
            else if (.not. self%keeps_order) then
               if (self%newest == row) self%newest = 0
               if (self%newest == self%count) self%newest = row
               population(row, :) = population(self%count, :)
               self%left(:, row) = self%left(:, self%count)
               if (allocated(self%mix)) self%mix(:, row) = self%mix(:, self%count)
               self%count = self%count - 1
            end if
         end do
      end associate
      self%stiffness = stiffness
      self%offset = offset
      break_loss = energy
      self%ahead = ahead
      self%behind = behind
      if (self%keeps_order) call self%remove_empty()
      if (self%count == 0) then
         self%stiffness = accumulator_type()
         self%offset = accumulator_type()
      end if
   end subroutine break_tried

   !> Remove populations without contacts; the others keep their order.
   subroutine remove_empty(self)
      class(breaking_populations_type), intent(inout) :: self

      integer :: row, kept

      kept = 0
      self%newest = 0
      do row = 1, self%count
         if (.not. self%left(number, row) > 0.0_wp) then
            if (row > self%count - self%open_count) self%open_count = 0
            cycle
         end if
         kept = kept + 1
         if (kept == row) cycle
         self%population(kept, :) = self%population(row, :)
         self%left(:, kept) = self%left(:, row)
         if (allocated(self%kept)) self%kept(:, kept) = self%kept(:, row)
         if (allocated(self%mix)) self%mix(:, kept) = self%mix(:, row)
      end do
      self%count = kept
   end subroutine remove_empty

   !> Numbers of contacts that break in the trial, by the heights of their sites.
   pure function tried_mix(self) result(numbers)
      class(breaking_populations_type), intent(in) :: self
      real(wp) :: numbers(size(self%newborn_mix))

      integer :: trial

      numbers = 0.0_wp
      do trial = 1, self%trial%count
         associate (row => self%trial%population(trial))
            numbers = numbers + (self%left(number, row) - self%trial%moments(number, trial)) &
               & * self%mix(:, row)
         end associate
      end do
   end function tried_mix

   !> Keep parts of the contacts by the heights of their sites.
   subroutine keep(self, part)
      class(breaking_populations_type), intent(inout) :: self
      real(wp), intent(in) :: part(:)

      real(wp) :: all
      integer :: row

      do row = 1, self%count
         associate (mix => self%mix(:, row))
            mix = mix * part
            all = sum(mix)
            if (all > 0.0_wp) mix = mix / all
         end associate
         self%population(row, column_weight) = all * self%population(row, column_weight)
         self%left(:, row) = all * self%left(:, row)
      end do
      call self%remove_empty()
      call self%sum_forces()
   end subroutine keep

end module mesoslip_contacts_populations_breaking
