!> What breaks of pinned populations by thermal activation while the slider moves.
!>
!> Contacts of all populations break all the time. What is left of a population follows from the
!> maximum force on it and the level of its hazard, so that it does not depend on steps. Of what
!> breaks in a step, the contacts that come to their thresholds go with the displacement of the
!> slider, the others with the time.
module mesoslip_contacts_populations_activated
   use mesoslip_contacts_populations_activation, only: activation_type, growth_type
   use mesoslip_contacts_populations_breaking, only: breaking_populations_type, tiny_gap, &
      & trial_type, unresolved_part
   use mesoslip_contacts_populations_rows, only: column_ahead, column_behind, column_broken, &
      & column_force, column_level, column_origin, column_weight, moments_length, number
   use mesoslip_contacts_populations_survivors, only: new_survivors, no_level, &
      & survivors_type
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: activated_populations_type, joining_part

   !> Part of a population that has broken, beyond which no contacts join it any more
   real(wp), parameter :: max_joined_loss = 0.01_wp
   !> Displacement in which contacts join a population, over that of a step
   real(wp), parameter :: joining_part = 0.5_wp

   !> Exponent beyond which an exponential is 0
   real(wp), parameter :: max_exponent = 700.0_wp

   !> Pinned populations of which contacts may break by thermal activation.
   type, extends(breaking_populations_type) :: activated_populations_type
      !> Whether they do, and how
      logical :: is_activated = .false.
      type(activation_type) :: activation
      !> What it leaves of contacts
      type(survivors_type), private :: survivors
   contains
      !> Let contacts break by activation
      procedure, non_overridable :: set_activation
      !> Find what breaks in a motion
      procedure, non_overridable :: try_motion
      !> Let contacts that attach join the last population
      procedure, non_overridable :: join_last
      !> Whether contacts may join a population
      procedure, non_overridable :: may_join
   end type activated_populations_type

contains

   !> Let contacts break by activation.
   subroutine set_activation(self, activation)
      !> The populations
      class(activated_populations_type), intent(inout) :: self
      !> How they do
      type(activation_type), intent(in) :: activation

      self%is_activated = .true.
      self%keeps_order = .true.
      self%activation = activation
      call new_survivors(self%survivors, self%parameters%law, self%moments(1), number, &
         & activation%width)
   end subroutine set_activation

   !> Find what breaks in a motion of the slider.
   subroutine try_motion(self, before, after, displacement, late, onset)
      !> The populations
      class(activated_populations_type), intent(inout) :: self
      !> Where the slider is, and where it comes to
      type(pose_type), intent(in) :: before, after
      !> Displacement until which contacts are found that come to their thresholds, not less far [m]
      real(wp), intent(in) :: displacement
      !> Breaks of populations that start to come to their thresholds, and where most of them do [m]
      real(wp), intent(out) :: late, onset

      type(growth_type) :: growth
      real(wp) :: moments(moments_length), direction, edge, max_breaks, start, end, last, broken, &
         & cut, left, heat, squares
      integer :: row, column

      direction = sign(1.0_wp, displacement - before%displacement)
      if (.not. abs(displacement - before%displacement) > 0.0_wp) direction = before%direction
      column = merge(column_ahead, column_behind, direction > 0.0_wp)
      call self%make_room_to_try()
      growth = self%activation%growth(before, after)
      edge = direction * before%displacement + tiny_gap * self%step
      late = 0.0_wp
      max_breaks = 0.0_wp
      onset = displacement
      associate (trial => self%trial, population => self%population)
         trial%end = displacement
         trial%time = after%time
         trial%direction = direction
         trial%reach = abs(displacement - before%displacement)
         trial%next = direction * huge(1.0_wp)
         trial%count = self%count
         call clear_sums(trial)
         do row = 1, self%count
            associate (weight => population(row, column_weight), held => self%left(number, row))
               start = force_at(before%displacement)
               end = force_at(after%displacement)
               last = force_at(displacement)
               broken = population(row, column_broken)
               cut = held
               call self%moments(1)%interpolate(max(broken, abs(last)), moments)
               if (abs(last) > broken) cut = min(held, weight * self%survivors%left( &
                  & abs(last), population(row, column_level), moments(number)))
               trial%population(row) = row
               trial%broken(row) = max(broken, abs(last))
               trial%level(row) = self%activation%level_after(growth, &
                  & population(row, column_level), start, end)
               left = min(cut, weight * self%survivors%left(trial%broken(row), &
                  & trial%level(row), moments(number)))
               if (left < unresolved_part * weight) then
                  left = 0.0_wp
                  if (cut < unresolved_part * weight) cut = 0.0_wp
               end if
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
                  squares = mean_square(max(start, broken), last)
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

      !> Force on the contacts of a population.
      pure function force_at(place) result(force)
         !> Displacement of the slider [m]
         real(wp), intent(in) :: place
         real(wp) :: force

         force = self%population(row, column_force) &
            & + (place - self%population(row, column_origin)) / self%stretch
      end function force_at

   end subroutine try_motion

   !> Set the sums over what breaks to zero.
   pure subroutine clear_sums(trial)
      type(trial_type), intent(inout) :: trial

      trial%breaks = 0.0_wp
      trial%cut_breaks = 0.0_wp
      trial%work = 0.0_wp
      trial%cut_work = 0.0_wp
      trial%drop = 0.0_wp
      trial%cut_drop = 0.0_wp
   end subroutine clear_sums

   !> Mean square of a force that changes evenly.
   elemental function mean_square(first, second)
      real(wp), intent(in) :: first, second
      real(wp) :: mean_square

      mean_square = (first**2 + first * second + second**2) / 3.0_wp
   end function mean_square

   !> Whether contacts may join a population: hardly any of it have broken.
   pure function may_join(self, row)
      !> The populations
      class(activated_populations_type), intent(in) :: self
      !> Which one
      integer, intent(in) :: row
      !> Whether they may
      logical :: may_join

      real(wp) :: moments(moments_length)

      call self%moments(1)%interpolate(self%population(row, column_broken), moments)
      may_join = self%left(number, row) > (1.0_wp - max_joined_loss) &
         & * self%population(row, column_weight) * moments(number)
   end function may_join

   !> Let contacts that attach join a population that attached close by.
   subroutine join_last(self, row, origin, contacts, level, displacement, time, energy)
      !> The populations
      class(activated_populations_type), intent(inout) :: self
      !> Which population
      integer, intent(in) :: row
      !> Where they attach [m], how many they are, and the level of their hazard
      real(wp), intent(in) :: origin, contacts, level
      !> Where the slider is [m], and when that is [s]
      real(wp), intent(in) :: displacement, time
      !> Elastic energy that is lost by giving all of them one origin [J]
      real(wp), intent(inout) :: energy

      real(wp) :: moments(moments_length), below(2), part, high, all

      associate (population => self%population, width => self%activation%width)
         all = self%left(number, row) + contacts
         part = contacts / all
         energy = energy + 0.5_wp * self%parameters%stiffness * self%left(number, row) * part &
            & * (origin - population(row, column_origin))**2
         population(row, column_origin) = population(row, column_origin) &
            & + part * (origin - population(row, column_origin))
         high = max(level, population(row, column_level))
         if (high > no_level) then
            ! Without a hazard a level is far below, and its quotient would overflow.
            below = max([level, population(row, column_level)] - high, -max_exponent * width) &
               & / width
            population(row, column_level) = high + width &
               & * log(part * exp(below(1)) + (1.0_wp - part) * exp(below(2)))
         end if
         call self%moments(1)%interpolate(population(row, column_broken), moments)
         population(row, column_weight) = all / self%survivors%left( &
            & population(row, column_broken), population(row, column_level), moments(number))
         self%left(:, row) = all
         population(row, column_ahead) = max(displacement, self%next_break(row, 1.0_wp, time))
         population(row, column_behind) = min(displacement, self%next_break(row, -1.0_wp, time))
         self%ahead = min(self%ahead, population(row, column_ahead))
         self%behind = max(self%behind, population(row, column_behind))
      end associate
   end subroutine join_last

end module mesoslip_contacts_populations_activated
