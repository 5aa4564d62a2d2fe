!> Numbers of pinned contacts of infinitely many, a row for each population.
!>
!> A population attached within one step, or at one place. It is labelled by its origin, so that
!> nothing is advected, and keeps the threshold below which its contacts have broken: the maximum
!> of the force on it, in either direction.
!>
!> Where thresholds change with age, that is the configured threshold of the last contact that
!> broke, as contacts of one age and force break in its order. It is solved again at the end of each
!> step, from the force and the age.
!>
!> With the stiffnesses of a table, the threshold alone does not determine which contacts have
!> broken: a population keeps how far the slider was ahead of its origin and behind it, where it
!> breaks next.
!>
!> With a strength along the track, the thresholds of a population are multiplied by the factor of
!> the place where it attached. Forces and distances over that factor are those of a population
!> without one. Stored thresholds are without the factor, stored energies with it.
!>
!> Forces of populations are in units of f_s, their stiffness of k, distances of f_s/k.
module mesoslip_contacts_populations_rows
   use mesoslip_contacts_ageing_law, only: ageing_law_type
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_mechanics, only: breaking_distance
   use mesoslip_contacts_partial_moments, only: partial_moments_type
   use mesoslip_contacts_populations_survivors, only: no_level
   use mesoslip_contacts_populations_table_lives, only: table_lives_type
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: population_rows_type, new_population_rows
   public :: moments_length, number, stiff, compliant, lost, massive
   public :: column_origin, column_force, column_weight, column_broken, column_law, column_ahead, &
      & column_behind, column_factor, column_birth, column_level

   !> Moments of the thresholds of a population's pinned contacts: number, stiffness, one over it,
   !> twice the energy that they lose in breaking, and mass
   integer, parameter :: moments_length = 5
   integer, parameter :: number = 1, stiff = 2, compliant = 3, lost = 4, massive = 5

   !> Numbers of a population, besides its moments, without a track and with one
   integer, parameter :: population_length = 9, track_length = 10
   !> Displacement at which stretches are zero except for the force at attaching [m]
   integer, parameter :: column_origin = 1
   !> Force at attaching, signed
   integer, parameter :: column_force = 2
   !> Number of contacts that attached, broken or not
   integer, parameter :: column_weight = 3
   !> Threshold below which they have broken
   integer, parameter :: column_broken = 4
   !> 1 for the law of thresholds, 2 for that weighted by one over the breaking stretch; see
   !> mesoslip_contacts_populations_table_lives for those of a table with stiffnesses
   integer, parameter :: column_law = 5
   !> Displacements at which contacts break next, forward and backward [m]
   integer, parameter :: column_ahead = 6, column_behind = 7
   !> Time of attaching [s]
   integer, parameter :: column_birth = 8
   !> Level of the hazard of thermal activation
   integer, parameter :: column_level = 9
   !> With a track, the factor of the thresholds
   integer, parameter :: column_factor = 10

   !> Populations for which there is room at first
   integer, parameter :: initial_rows = 64
   !> Number of the last populations among which there may be one to join
   integer, parameter :: max_joined = 64

   !> Populations of pinned contacts.
   type :: population_rows_type
      !> Number of populations
      integer :: count = 0
      !> Bounds on the displacements at which contacts break next, forward and backward [m]
      real(wp) :: ahead = huge(1.0_wp), behind = -huge(1.0_wp)
      !> Total stiffness [N/m], and total of stiffness times origin minus force at attaching [N]
      type(accumulator_type) :: stiffness, offset

      !> Whether thresholds change with age, how, and whether some fall
      logical :: ages = .false.
      type(ageing_law_type) :: ageing
      logical :: some_fall = .false.
      !> Time since which all attached contacts age [s]
      real(wp) :: last_birth = 0.0_wp

      type(contact_parameters_type) :: parameters
      !> Whether strength varies along the track
      logical :: has_track = .false.
      !> Stretch of a mean contact at its threshold, f_s/k [m]
      real(wp) :: stretch = 1.0_wp
      !> Threshold at which the first contacts of a population break
      real(wp) :: first_broken = 0.0_wp
      !> Moments of the law of thresholds, and of that weighted by one over the breaking stretch
      type(partial_moments_type) :: moments(2)
      !> Whether contacts have the stiffnesses of a table, and their survival
      logical :: has_table = .false.
      type(table_lives_type) :: table_lives
      !> Whether populations keep the order in which they attached; the number of those at the end
      !> that contacts may still join, the first origin of these [m], and the sign of their forces
      logical :: keeps_order = .false.
      integer :: open_count = 0
      real(wp) :: open_origin = 0.0_wp, open_direction = 1.0_wp
      !> Row of the population that attached last, 0 if there is none, its number of contacts, and
      !> the displacement in which they attached, signed [m]
      integer :: newest = 0
      real(wp) :: newest_births = 0.0_wp, newest_width = 0.0_wp
      !> Numbers of the populations, shape (count or more, population_length)
      real(wp), allocatable :: population(:, :)
      !> Moments of the pinned contacts, shape (moments_length, count or more)
      real(wp), allocatable :: left(:, :)
      !> With ageing and thermal activation, surviving part at nodes over the thresholds, shape
      !> (nodes, count or more)
      real(wp), allocatable :: kept(:, :)
      !> Under a changing load, parts of a population by the heights of its sites, shape (bins,
      !> count or more), and those of the next one, shape (bins)
      real(wp), allocatable :: mix(:, :), newborn_mix(:)
   contains
      procedure, non_overridable :: add, row_to_join, join, mean_broken, shift_row, next_break, &
         & update_thresholds, &
         & sum_forces, shift_origin, number_of_contacts, elastic_energy, scale_all, sum_bin, &
         & exchange
      procedure, non_overridable, private :: make_room, next_break_of_table, find_next_breaks
   end type population_rows_type

contains

   !> Set up rows without contacts.
   subroutine new_population_rows(self, parameters)
      class(population_rows_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters

      self%parameters = parameters
      self%stretch = parameters%static_force / parameters%stiffness
      self%has_track = parameters%strength%is_used
      allocate (self%population(initial_rows, merge(track_length, population_length, &
         & self%has_track)), source=0.0_wp)
      allocate (self%left(moments_length, initial_rows), source=0.0_wp)
   end subroutine new_population_rows

   !> Add a population.
   subroutine add(self, origin, force, factor, weight, law, broken, displacement, birth, time, &
      & error)
      class(population_rows_type), intent(inout) :: self
      !> Origin [m], force, factor of the thresholds and law at attaching, and number of contacts
      real(wp), intent(in) :: origin, force, factor, weight
      integer, intent(in) :: law
      !> Threshold below which contacts have broken before, or distance for those of a table
      real(wp), intent(in) :: broken
      !> Displacement of the slider [m]: contacts that are due there break in its next motion
      real(wp), intent(in) :: displacement
      !> Time of attaching, and present time [s]
      real(wp), intent(in) :: birth, time
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: moments(moments_length), ahead, behind

      call self%make_room(error)
      if (allocated(error)) return
      self%count = self%count + 1
      if (self%has_table) then
         ahead = max(broken, self%table_lives%shortest(law, 1.0_wp))
         behind = self%table_lives%shortest(law, -1.0_wp)
         call self%table_lives%left(law, ahead, behind, moments)
      else
         call self%moments(law)%interpolate(broken, moments)
      end if
      moments(lost) = factor**2 * moments(lost)
      associate (row => self%count, population => self%population)
         population(row, column_origin) = origin
         population(row, column_force) = force
         population(row, column_weight) = weight
         population(row, column_law) = real(law, wp)
         population(row, column_broken) = max(broken, self%first_broken)
         population(row, column_birth) = birth
         population(row, column_level) = no_level
         if (self%has_track) population(row, column_factor) = factor
         self%left(:, row) = weight * moments
         if (self%has_table) then
            population(row, column_ahead) = origin + self%stretch * ahead
            population(row, column_behind) = origin - self%stretch * behind
         end if
         if (allocated(self%kept)) self%kept(:, row) = 1.0_wp
         if (allocated(self%mix)) self%mix(:, row) = self%newborn_mix
      end associate
      call self%find_next_breaks(self%count, displacement, time)
   end subroutine add

   !> Last population that contacts attaching with this force at this origin [m] may join: of the
   !> same force, within a distance [m], with no less than a part of its weight left; 0 if none.
   pure function row_to_join(self, origin, force, distance, min_left) result(row)
      class(population_rows_type), intent(in) :: self
      real(wp), intent(in) :: origin, force, distance, min_left
      integer :: row

      do row = self%count, max(1, self%count - max_joined + 1), -1
         if (abs(self%population(row, column_origin) - origin) > distance) cycle
         if (abs(self%population(row, column_force) - force) > 0.0_wp) cycle
         if (nint(self%population(row, column_law)) /= 1) cycle
         if (self%left(number, row) >= min_left * self%population(row, column_weight)) return
      end do
      row = 0
   end function row_to_join

   !> Let contacts that attach at an origin [m] join a population of contacts alike.
   subroutine join(self, row, origin, broken, moments, displacement, time, energy)
      class(population_rows_type), intent(inout) :: self
      integer, intent(in) :: row
      !> Their origin, and the threshold up to which they have broken
      real(wp), intent(in) :: origin, broken
      !> Moments of these contacts
      real(wp), intent(in) :: moments(moments_length)
      !> Displacement of the slider [m], and time [s]
      real(wp), intent(in) :: displacement, time
      !> Elastic energy, to which that lost by giving all contacts one origin is added [J]
      real(wp), intent(inout) :: energy

      real(wp) :: all(moments_length), part, shift

      associate (population => self%population, left => self%left(:, row))
         ! Of the stiffnesses, so that the force stays the same.
         part = moments(stiff) / (left(stiff) + moments(stiff))
         shift = origin - population(row, column_origin)
         energy = energy + 0.5_wp * self%parameters%stiffness * left(stiff) * part * shift**2 &
            & + self%parameters%static_force * population(row, column_force) * shift &
            & * (left(number) * part - moments(number) * (1.0_wp - part))
         population(row, column_origin) = population(row, column_origin) + part * shift
         if (allocated(self%mix)) self%mix(:, row) = self%mix(:, row) + moments(number) &
            & / (left(number) + moments(number)) * (self%newborn_mix - self%mix(:, row))
         call self%mean_broken(row, moments(number) / (left(number) + moments(number)), broken)
         left = left + moments
         call self%moments(1)%interpolate(population(row, column_broken), all)
         population(row, column_weight) = left(number) / all(number)
      end associate
      call self%find_next_breaks(row, displacement, time)
   end subroutine join

   !> Set the threshold up to which a population has broken to the mean of that of its contacts and
   !> that of others that join it: with the higher one, those that join would skip breaks.
   pure subroutine mean_broken(self, row, part, broken)
      class(population_rows_type), intent(inout) :: self
      integer, intent(in) :: row
      !> Part of the contacts that join, and the threshold up to which they have broken
      real(wp), intent(in) :: part, broken

      associate (mean => self%population(row, column_broken))
         mean = mean + part * (max(broken, self%first_broken) - mean)
      end associate
   end subroutine mean_broken

   !> Shift the origin of a population [m], and the time at which it attached.
   subroutine shift_row(self, row, shift, slowness, displacement, time, energy)
      class(population_rows_type), intent(inout) :: self
      integer, intent(in) :: row
      !> Shift of the origin [m], and that of the time over it [s/m]
      real(wp), intent(in) :: shift, slowness
      !> Displacement of the slider [m], and time [s]
      real(wp), intent(in) :: displacement, time
      !> Elastic energy, to which that lost by the shift is added [J]
      real(wp), intent(inout) :: energy

      real(wp) :: stiffness, before, moved

      associate (origin => self%population(row, column_origin), left => self%left(:, row))
         before = origin
         origin = before + shift
         ! But for rounding, the shift.
         moved = origin - before
         stiffness = self%parameters%stiffness * left(stiff)
         energy = energy + moved * (stiffness * (displacement - 0.5_wp * (before + origin)) &
            & + self%parameters%static_force * self%population(row, column_force) * left(number))
         call self%offset%add(stiffness * moved)
      end associate
      associate (birth => self%population(row, column_birth))
         birth = min(time, birth + moved * slowness)
      end associate
      if (.not. self%has_table) then
         call self%find_next_breaks(row, displacement, time)
         return
      end if
      ! Of the stiffnesses of a table these also say which contacts have broken.
      associate (ahead => self%population(row, column_ahead), &
         & behind => self%population(row, column_behind))
         ahead = ahead + moved
         behind = behind + moved
         self%ahead = min(self%ahead, ahead)
         self%behind = max(self%behind, behind)
      end associate
   end subroutine shift_row

   !> Find where contacts of a population break next, from a displacement of the slider [m] on, at
   !> a time [s].
   subroutine find_next_breaks(self, row, displacement, time)
      class(population_rows_type), intent(inout) :: self
      integer, intent(in) :: row
      real(wp), intent(in) :: displacement, time

      associate (ahead => self%population(row, column_ahead), &
         & behind => self%population(row, column_behind))
         ahead = max(displacement, self%next_break(row, 1.0_wp, time))
         behind = min(displacement, self%next_break(row, -1.0_wp, time))
         self%ahead = min(self%ahead, ahead)
         self%behind = max(self%behind, behind)
      end associate
   end subroutine find_next_breaks

   !> Make room for one more population.
   subroutine make_room(self, error)
      class(population_rows_type), intent(inout) :: self
      type(error_type), allocatable, intent(inout) :: error

      real(wp), allocatable :: population(:, :), left(:, :), kept(:, :), mix(:, :)
      integer :: stat

      if (self%count < size(self%population, 1)) return
      allocate (population(2 * self%count, size(self%population, 2)), source=0.0_wp, stat=stat)
      if (stat == 0) allocate (left(moments_length, 2 * self%count), source=0.0_wp, stat=stat)
      if (stat == 0 .and. allocated(self%kept)) then
         allocate (kept(size(self%kept, 1), 2 * self%count), source=0.0_wp, stat=stat)
      end if
      if (stat == 0 .and. allocated(self%mix)) then
         allocate (mix(size(self%mix, 1), 2 * self%count), source=0.0_wp, stat=stat)
      end if
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the populations of contacts")
         return
      end if
      population(:self%count, :) = self%population
      call move_alloc(population, self%population)
      left(:, :self%count) = self%left
      call move_alloc(left, self%left)
      if (allocated(mix)) then
         mix(:, :self%count) = self%mix
         call move_alloc(mix, self%mix)
      end if
      if (.not. allocated(kept)) return
      kept(:, :self%count) = self%kept
      call move_alloc(kept, self%kept)
   end subroutine make_room

   !> Displacement at which contacts of a population break next in a direction, at a time [s].
   pure function next_break(self, row, direction, time) result(displacement)
      class(population_rows_type), intent(in) :: self
      integer, intent(in) :: row
      real(wp), intent(in) :: direction, time
      real(wp) :: displacement

      real(wp) :: threshold

      if (self%has_table) then
         displacement = self%next_break_of_table(row, direction)
         return
      end if
      threshold = self%population(row, column_broken)
      if (self%ages) threshold = self%ageing%threshold(threshold, 1.0_wp, &
         & time - self%population(row, column_birth))
      if (self%has_track) then
         associate (factor => self%population(row, column_factor))
            displacement = self%population(row, column_origin) + direction * self%stretch * factor &
               & * breaking_distance(self%parameters%coupling, &
               & direction * self%population(row, column_force) / factor, threshold)
         end associate
         return
      end if
      displacement = self%population(row, column_origin) + direction * self%stretch &
         & * breaking_distance(self%parameters%coupling, &
         & direction * self%population(row, column_force), threshold)
   end function next_break

   !> The same for contacts with the stiffnesses of a table: breaks in one direction may have
   !> removed the first contacts in the other.
   pure function next_break_of_table(self, row, direction) result(displacement)
      class(population_rows_type), intent(in) :: self
      integer, intent(in) :: row
      real(wp), intent(in) :: direction
      real(wp) :: displacement

      real(wp) :: distance

      associate (one => self%population(row, :))
         displacement = one(merge(column_ahead, column_behind, direction > 0.0_wp))
         distance = direction * (one(column_origin) &
            & - one(merge(column_behind, column_ahead, direction > 0.0_wp))) / self%stretch
         distance = self%table_lives%min_opposite(nint(one(column_law)), -direction, distance)
         displacement = direction * max(direction * displacement, &
            & direction * one(column_origin) + distance * self%stretch)
      end associate
   end function next_break_of_table

   !> Update where populations break next, with the slider at a displacement [m] and a time [s].
   subroutine update_thresholds(self, displacement, time)
      class(population_rows_type), intent(inout) :: self
      real(wp), intent(in) :: displacement, time

      real(wp) :: threshold, rate
      integer :: row

      if (self%ageing%is_old(time - self%last_birth)) return
      do row = 1, self%count
         associate (one => self%population(row, :))
            call self%ageing%evaluate(one(column_broken), 1.0_wp, time - one(column_birth), &
               & threshold, rate)
            if (.not. abs(rate) > 0.0_wp) cycle
            self%population(row, column_ahead) = &
               & max(displacement, self%next_break(row, 1.0_wp, time))
            self%population(row, column_behind) = &
               & min(displacement, self%next_break(row, -1.0_wp, time))
         end associate
      end do
      self%ahead = minval(self%population(:self%count, column_ahead))
      self%behind = maxval(self%population(:self%count, column_behind))
   end subroutine update_thresholds

   !> Recompute stiffness and offset, and the bounds on the next breaks.
   subroutine sum_forces(self)
      class(population_rows_type), intent(inout) :: self

      integer :: row

      self%stiffness = accumulator_type()
      self%offset = accumulator_type()
      do row = 1, self%count
         associate (one => self%population(row, :), left => self%left(:, row))
            call self%stiffness%add(self%parameters%stiffness * left(stiff))
            call self%offset%add(self%parameters%stiffness * left(stiff) * one(column_origin))
            call self%offset%add(-self%parameters%static_force * left(number) * one(column_force))
         end associate
      end do
      self%ahead = minval(self%population(:self%count, column_ahead))
      self%behind = maxval(self%population(:self%count, column_behind))
   end subroutine sum_forces

   !> Multiply the numbers of all contacts.
   subroutine scale_all(self, factor)
      class(population_rows_type), intent(inout) :: self
      real(wp), intent(in) :: factor

      associate (weight => self%population(:self%count, column_weight))
         weight = factor * weight
      end associate
      self%left(:, :self%count) = factor * self%left(:, :self%count)
   end subroutine scale_all

   !> Stiffness [N/m], and stiffness times origin minus force at attaching [N], of the contacts in a
   !> bin of heights.
   pure subroutine sum_bin(self, bin, stiffness, offset)
      class(population_rows_type), intent(in) :: self
      integer, intent(in) :: bin
      real(wp), intent(out) :: stiffness, offset

      integer :: row

      stiffness = 0.0_wp
      offset = 0.0_wp
      do row = 1, self%count
         associate (one => self%population(row, :), left => self%left(:, row), &
            & part => self%mix(bin, row))
            stiffness = stiffness + part * self%parameters%stiffness * left(stiff)
            offset = offset + part * (self%parameters%stiffness * left(stiff) &
               & * one(column_origin) - self%parameters%static_force * left(number) &
               & * one(column_force))
         end associate
      end do
   end subroutine sum_bin

   !> Shift the origin of displacements [m].
   subroutine shift_origin(self, shift)
      class(population_rows_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      associate (all => self%population(:self%count, :))
         all(:, column_origin) = all(:, column_origin) - shift
         all(:, column_ahead) = all(:, column_ahead) - shift
         all(:, column_behind) = all(:, column_behind) - shift
      end associate
      self%open_origin = self%open_origin - shift
      call self%sum_forces()
   end subroutine shift_origin

   !> Number of contacts.
   pure function number_of_contacts(self) result(total)
      class(population_rows_type), intent(in) :: self
      real(wp) :: total

      total = sum(self%left(number, :self%count))
   end function number_of_contacts

   !> Elastic energy of the contacts with the slider at a displacement [m], in joules.
   pure function elastic_energy(self, displacement) result(energy)
      class(population_rows_type), intent(in) :: self
      real(wp), intent(in) :: displacement
      real(wp) :: energy

      type(accumulator_type) :: total
      real(wp) :: distance
      integer :: row

      do row = 1, self%count
         associate (force => self%population(row, column_force), &
            & left => self%left(:, row))
            distance = (displacement - self%population(row, column_origin)) / self%stretch
            call total%add(left(stiff) * distance**2 + 2.0_wp * left(number) * force &
               & * distance + left(compliant) * force**2)
         end associate
      end do
      energy = 0.5_wp * self%parameters%static_force * self%stretch * total%total()
   end function elastic_energy

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(population_rows_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("pinned populations")
      call archive%exchange("population", self%population)
      call archive%exchange("left", self%left)
      if (allocated(self%kept)) call archive%exchange("kept", self%kept)
      if (allocated(self%mix)) call archive%exchange("mix", self%mix)
      call archive%exchange("count", self%count)
      call archive%exchange("ahead", self%ahead)
      call archive%exchange("behind", self%behind)
      call archive%exchange("stiffness", self%stiffness)
      call archive%exchange("offset", self%offset)
      call archive%exchange("last_birth", self%last_birth)
      call archive%exchange("newest", self%newest)
      call archive%exchange("newest_births", self%newest_births)
      call archive%exchange("newest_width", self%newest_width)
      if (.not. self%keeps_order) return
      call archive%exchange("open_count", self%open_count)
      call archive%exchange("open_origin", self%open_origin)
      call archive%exchange("open_direction", self%open_direction)
   end subroutine exchange

end module mesoslip_contacts_populations_rows
