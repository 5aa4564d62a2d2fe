!> Breaks of pinned populations by thermal activation in a motion of the slider.
!>
!> Contacts of all populations break all the time. The contacts that remain of a population follow
!> from the maximum force on it and the level of its hazard, independently of steps. In a step, the
!> contacts that reach their thresholds break with the displacement of the slider, the others with
!> the time.
module mesoslip_contacts_populations_thermal
   use mesoslip_contacts_populations_activation, only: activation_type, growth_type
   use mesoslip_contacts_populations_breaking, only: breaking_populations_type, tiny_gap, &
      & unresolved_part
   use mesoslip_contacts_populations_nodes, only: new_threshold_nodes, threshold_nodes_type
   use mesoslip_contacts_populations_rows, only: column_ahead, column_behind, column_birth, &
      & column_broken, column_force, column_level, column_origin, column_weight, moments_length, &
      & number
   use mesoslip_contacts_populations_survivors, only: new_survivors, no_level, survivors_type
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: thermal_populations_type, joining_part

   !> Broken part of a population up to which contacts may join it
   real(wp), parameter :: max_joined_loss = 0.01_wp
   !> Displacement in which contacts join a population, over that of a step
   real(wp), parameter :: joining_part = 0.5_wp

   !> Exponent beyond which an exponential is 0
   real(wp), parameter :: max_exponent = 700.0_wp

   !> Pinned populations of which contacts may break by thermal activation.
   type, extends(breaking_populations_type) :: thermal_populations_type
      !> Whether they do, and how
      logical :: is_thermal = .false.
      type(activation_type) :: activation
      !> Surviving fraction of contacts without ageing, and with it
      type(survivors_type), private :: survivors
      type(threshold_nodes_type), private :: nodes
      !> Time in which contacts join a population [s]
      real(wp), private :: joining_time = huge(1.0_wp)
   contains
      procedure, non_overridable :: set_activation, try_motion, join_last, may_join, begin_hazard
      procedure, non_overridable, private :: break_one, number_left, thresholds_reached, &
         & first_break_force
   end type thermal_populations_type

contains

   !> Let contacts break by activation, with the length of a step over the spread of the breaking
   !> stretches.
   subroutine set_activation(self, activation, resolution)
      class(thermal_populations_type), intent(inout) :: self
      type(activation_type), intent(in) :: activation
      real(wp), intent(in) :: resolution

      self%is_thermal = .true.
      self%keeps_order = .true.
      self%activation = activation
      if (self%ages) then
         self%joining_time = joining_part * resolution * self%ageing%time
         call new_threshold_nodes(self%nodes, self%parameters%law, self%moments(1), self%ageing, &
            & activation%width)
         allocate (self%kept(self%nodes%count, size(self%population, 1)), source=1.0_wp)
      else
         call new_survivors(self%survivors, self%parameters%law, self%moments(1), activation%width)
      end if
   end subroutine set_activation

   !> Find what breaks in a motion of the slider, and at thresholds until it reaches a displacement
   !> [m], which is not less far.
   subroutine try_motion(self, before, after, displacement, late, onset, error)
      class(thermal_populations_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after
      real(wp), intent(in) :: displacement
      !> Breaks of populations that start to reach their thresholds, and where most of them do [m]
      real(wp), intent(out) :: late, onset
      !> Set if there is not enough memory; nothing breaks then
      type(error_type), allocatable, intent(inout) :: error

      type(growth_type) :: growth
      real(wp) :: direction, edge, max_breaks, start, end, last, cut, left, heat, squares
      integer :: row, column

      direction = sign(1.0_wp, displacement - before%displacement)
      if (.not. abs(displacement - before%displacement) > 0.0_wp) direction = before%direction
      column = merge(column_ahead, column_behind, direction > 0.0_wp)
      late = 0.0_wp
      onset = displacement
      call self%begin_trial(before, displacement, after%time, direction, error)
      if (allocated(error)) return
      growth = self%activation%growth(before, after)
      edge = direction * before%displacement + tiny_gap * self%step
      max_breaks = 0.0_wp
      associate (trial => self%trial, population => self%population)
         trial%next = direction * huge(1.0_wp)
         trial%count = self%count
         trial%breaks = 0.0_wp
         trial%work = 0.0_wp
         trial%drop = 0.0_wp
         trial%cut_breaks = 0.0_wp
         trial%cut_work = 0.0_wp
         trial%cut_drop = 0.0_wp
         do row = 1, self%count
            associate (held => self%left(number, row))
               start = force_at(before%displacement)
               end = force_at(after%displacement)
               last = force_at(displacement)
               call self%break_one(row, growth, before, after, [start, end, last], cut, left)
               trial%moments(:, row) = left

               ! Forces along the direction from here on.
               start = direction * start
               end = direction * end
               last = direction * last
               heat = cut - left
               trial%lost(row) = heat * mean_square(start, end)
               trial%work = trial%work + 0.5_wp * heat * (end**2 - mean_square(start, end))
               trial%breaks = trial%breaks + (held - left)
               trial%drop = trial%drop + (held - cut) * last + heat * end
               if (held > cut) then
                  squares = mean_square(self%first_break_force(row, before, start, last), last)
                  trial%lost(row) = trial%lost(row) + (held - cut) * squares
                  trial%work = trial%work + 0.5_wp * (held - cut) * (last**2 - squares)
                  trial%cut_work = trial%cut_work + 0.5_wp * (held - cut) * (last**2 - squares)
                  trial%cut_breaks = trial%cut_breaks + (held - cut)
                  trial%cut_drop = trial%cut_drop + (held - cut) * last
                  if (direction * population(row, column) > edge) then
                     late = late + (held - cut)
                     if (held - cut > max_breaks) then
                        max_breaks = held - cut
                        onset = population(row, column)
                     end if
                  end if
               end if
            end associate
         end do
         trial%mass = trial%breaks
         trial%work = trial%work * self%parameters%static_force * self%stretch
         trial%cut_work = trial%cut_work * self%parameters%static_force * self%stretch
         trial%drop = trial%drop * self%parameters%static_force
         trial%cut_drop = trial%cut_drop * self%parameters%static_force
      end associate

   contains

      !> Force on the contacts of the population where the slider is at a displacement [m].
      pure function force_at(displacement) result(force)
         real(wp), intent(in) :: displacement
         real(wp) :: force

         force = self%population(row, column_force) &
            & + (displacement - self%population(row, column_origin)) / self%stretch
      end function force_at

   end subroutine try_motion

   !> Find what breaks of a population.
   subroutine break_one(self, row, growth, before, after, forces, cut, left)
      class(thermal_populations_type), intent(inout) :: self
      integer, intent(in) :: row
      !> Increase of levels in the motion
      type(growth_type), intent(in) :: growth
      type(pose_type), intent(in) :: before, after
      !> Forces on the contacts before and after, and where breaks at thresholds end
      real(wp), intent(in) :: forces(3)
      !> Number of contacts that would survive without activation, and that survive
      real(wp), intent(out) :: cut, left

      real(wp) :: moments(moments_length)

      associate (trial => self%trial, population => self%population)
         trial%population(row) = row
         trial%broken(row) = max(population(row, column_broken), &
            & self%thresholds_reached(row, forces(3), after%time))
         trial%level(row) = population(row, column_level)
         call self%moments(1)%interpolate(trial%broken(row), moments)
         associate (weight => population(row, column_weight))
            cut = self%left(number, row)
            if (self%ages) then
               if (trial%broken(row) > population(row, column_broken)) cut = min(cut, &
                  & weight * self%nodes%left(trial%broken(row), self%kept(:, row), moments(number)))
               trial%kept(:, row) = self%kept(:, row)
               call self%nodes%pass(self%activation, growth, before, after, &
                  & population(row, column_birth), forces(:2), trial%broken(row), &
                  & trial%kept(:, row))
               left = min(cut, weight * self%nodes%left(trial%broken(row), trial%kept(:, row), &
                  & moments(number)))
            else
               if (trial%broken(row) > population(row, column_broken)) cut = min(cut, &
                  & weight * self%survivors%left(trial%broken(row), trial%level(row), &
                  & moments(number)))
               trial%level(row) = self%activation%level_after(growth, trial%level(row), forces(1), &
                  & forces(2))
               left = min(cut, weight * self%survivors%left(trial%broken(row), trial%level(row), &
                  & moments(number)))
            end if
            if (left < unresolved_part * weight) then
               left = 0.0_wp
               if (cut < unresolved_part * weight) cut = 0.0_wp
            end if
         end associate
      end associate
   end subroutine break_one

   !> Configured threshold of the contacts that break under a force at a time [s].
   pure function thresholds_reached(self, row, force, time) result(threshold)
      class(thermal_populations_type), intent(in) :: self
      integer, intent(in) :: row
      real(wp), intent(in) :: force, time
      real(wp) :: threshold

      threshold = abs(force)
      if (self%ages) threshold = self%ageing%configured(threshold, &
         & max(0.0_wp, time - self%population(row, column_birth)))
   end function thresholds_reached

   !> Force at which the first contacts of a population reach their thresholds, between those before
   !> the motion and at its end, all along the direction.
   pure function first_break_force(self, row, before, start, last) result(force)
      class(thermal_populations_type), intent(in) :: self
      integer, intent(in) :: row
      type(pose_type), intent(in) :: before
      real(wp), intent(in) :: start, last
      real(wp) :: force

      real(wp) :: reached

      associate (broken => self%population(row, column_broken))
         force = max(start, broken)
         if (.not. self%ages) return
         force = max(start, 0.0_wp)
         reached = self%thresholds_reached(row, force, before%time)
         if (broken > reached) force = force + (last - force) * (broken - reached) &
            & / (self%trial%broken(row) - reached)
      end associate
   end function first_break_force

   !> Surviving contacts of a population over its weight.
   pure function number_left(self, row) result(left)
      class(thermal_populations_type), intent(in) :: self
      integer, intent(in) :: row
      real(wp) :: left

      real(wp) :: moments(moments_length)

      associate (broken => self%population(row, column_broken))
         call self%moments(1)%interpolate(broken, moments)
         if (self%ages) then
            left = self%nodes%left(broken, self%kept(:, row), moments(number))
         else
            left = self%survivors%left(broken, self%population(row, column_level), moments(number))
         end if
      end associate
   end function number_left

   !> Mean square of a force that changes evenly.
   elemental function mean_square(first, second)
      real(wp), intent(in) :: first, second
      real(wp) :: mean_square

      mean_square = (first**2 + first * second + second**2) / 3.0_wp
   end function mean_square

   !> Whether contacts that attached at a time [s] may join a population: only a small part of it
   !> has broken, and it is not much older.
   pure function may_join(self, row, birth)
      class(thermal_populations_type), intent(in) :: self
      integer, intent(in) :: row
      real(wp), intent(in) :: birth
      logical :: may_join

      real(wp) :: moments(moments_length)

      call self%moments(1)%interpolate(self%population(row, column_broken), moments)
      may_join = self%left(number, row) > (1.0_wp - max_joined_loss) &
         & * self%population(row, column_weight) * moments(number) &
         & .and. birth - self%population(row, column_birth) <= self%joining_time
   end function may_join

   !> Set the hazard that a population has had in the time [s] since its contacts attached, under a
   !> force.
   subroutine begin_hazard(self, row, duration, force)
      class(thermal_populations_type), intent(inout) :: self
      integer, intent(in) :: row
      real(wp), intent(in) :: duration, force

      self%population(row, column_level) = self%activation%newborn_level(duration, force)
      if (.not. allocated(self%kept)) return
      call self%nodes%pass_newborn(self%activation%rate, duration, force, self%kept(:, row))
   end subroutine begin_hazard

   !> Let contacts that attach join a population that attached close by.
   subroutine join_last(self, row, origin, birth, broken, contacts, force, displacement, time, &
      & energy)
      class(thermal_populations_type), intent(inout) :: self
      integer, intent(in) :: row
      !> Where [m] and when [s] they attach, the threshold up to which they have broken, their
      !> number, and the force on them
      real(wp), intent(in) :: origin, birth, broken, contacts, force
      !> Displacement of the slider [m], and time [s]
      real(wp), intent(in) :: displacement, time
      !> Elastic energy, to which that lost by giving all contacts one origin is added [J]
      real(wp), intent(inout) :: energy

      real(wp) :: below(2), part, high, all, level
      real(wp), allocatable :: kept(:)

      level = self%activation%newborn_level(time - birth, force)
      associate (population => self%population, width => self%activation%width)
         all = self%left(number, row) + contacts
         part = contacts / all
         energy = energy + 0.5_wp * self%parameters%stiffness * self%left(number, row) * part &
            & * (origin - population(row, column_origin))**2
         population(row, column_origin) = population(row, column_origin) &
            & + part * (origin - population(row, column_origin))
         high = max(level, population(row, column_level))
         if (high > no_level) then
            ! Without a hazard a level is far below, and its exponent would overflow.
            below = max([level, population(row, column_level)] - high, -max_exponent * width) &
               & / width
            population(row, column_level) = high + width &
               & * log(part * exp(below(1)) + (1.0_wp - part) * exp(below(2)))
         end if
         if (allocated(self%kept)) then
            allocate (kept(self%nodes%count))
            call self%nodes%pass_newborn(self%activation%rate, time - birth, force, kept)
            self%kept(:, row) = self%kept(:, row) + part * (kept - self%kept(:, row))
            population(row, column_birth) = population(row, column_birth) &
               & + part * (birth - population(row, column_birth))
         end if
         if (allocated(self%mix)) then
            self%mix(:, row) = self%mix(:, row) + part * (self%newborn_mix - self%mix(:, row))
         end if
         call self%mean_broken(row, part, broken)
         population(row, column_weight) = all / self%number_left(row)
         self%left(:, row) = all
         population(row, column_ahead) = max(displacement, self%next_break(row, 1.0_wp, time))
         population(row, column_behind) = min(displacement, self%next_break(row, -1.0_wp, time))
         self%ahead = min(self%ahead, population(row, column_ahead))
         self%behind = max(self%behind, population(row, column_behind))
      end associate
   end subroutine join_last

end module mesoslip_contacts_populations_thermal
