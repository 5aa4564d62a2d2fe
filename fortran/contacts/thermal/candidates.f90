!> Thermally activated breaks by thinning.
!>
!> A contact of origin Y and threshold f_s breaks at the rate omega_0 exp((k abs(X - Y) - f_s)/f_T)
!> (Bell's law). In a window of displacements this is at most its value where the window ends, so
!> that the sum over all contacts is bounded by a constant rate. Candidates are events of that rate,
!> the times of which are drawn in advance; each has a contact, chosen in proportion to its bound. A
!> candidate is accepted with the probability rate/bound at the displacement of the slider then: for
!> Bell's law where the slider is beyond a displacement that is drawn too. The breaks are exactly
!> those of the rates, whatever the window.
!>
!> Candidates are drawn a few at a time. A contact that attaches later than that has a small bound
!> of its own, the same for each; where its rate may be larger, candidates are drawn again: a
!> process of constant rate has no memory.
module mesoslip_contacts_thermal_candidates
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_renewal, row_stiffness
   use mesoslip_contacts_mechanics, only: coupling_equal
   use mesoslip_contacts_thermal_weight_tree, only: new_weight_tree, weight_tree_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_random, only: uniform_pairs
   implicit none
   private

   public :: candidates_type, candidate_type, new_candidates, take_activation
   public :: by_upward_force, by_downward_force, by_newborn

   !> The force for which a candidate is drawn: that of a contact, which is positive (or 0) or
   !> negative, or that of a contact that attaches after the draw
   integer, parameter :: by_upward_force = 1, by_downward_force = 2, by_newborn = 3
   !> Maximum number of candidates that are drawn together
   integer, parameter :: max_drawn = 32
   !> Distance from the slider to an end of the window, over f_T/k: usual one, factor of the rate
   !> there, minimum and maximum
   real(wp), parameter :: usual_width = 0.5_wp, usual_growth = exp(0.5_wp), &
      & min_width = 1.0_wp / 32.0_wp, max_width = 64.0_wp
   !> Candidates in a window times its width, at most: in wide windows many candidates are rejected,
   !> at the end of each there is some work
   real(wp), parameter :: max_work = 8.0_wp
   !> Candidates drawn over those expected
   real(wp), parameter :: drawn_share = 0.9_wp
   !> Bound for newborn contacts over that of the others, and minimum of their candidates in a
   !> window
   real(wp), parameter :: newborn_share = 0.005_wp, newborn_expected = 0.02_wp
   !> Sum of weights over the bound for one newborn contact below which they are not kept
   real(wp), parameter :: negligible_share = 1.0e-9_wp
   !> Maximum exponent of a weight before its reference moves, and minimum of one that is not 0
   real(wp), parameter :: max_exponent = 300.0_wp, min_exponent = -700.0_wp
   !> Minimum velocity over f_T/k in estimates [1/s]: numbers remain finite
   real(wp), parameter :: min_pace = 1.0e-200_wp
   !> Number in the key of the draws, in place of that of a contact
   integer(i8), parameter :: stream = 2_i8**32 - 1_i8

   !> A candidate.
   type :: candidate_type
      !> Time [s], huge if there is none
      real(wp) :: time = huge(1.0_wp)
      !> Number of the contact, and the force for which it is drawn
      integer :: contact = 0, purpose = by_upward_force
      !> Renewals of the contact: exactly, or at least for a newborn one
      real(wp) :: life = 0.0_wp
      !> Displacement from which on, or down to which, it is accepted [m]; for a newborn contact the
      !> stretch by which it is accepted below its threshold
      real(wp) :: bound = 0.0_wp
   contains
      procedure, non_overridable :: side => side_of
   end type candidate_type

   !> Candidates of the breaks of contacts.
   type :: candidates_type
      private
      !> Rate at the threshold, omega_0 [1/s], and k/f_T [1/m]
      real(wp), public :: rate = 0.0_wp, slope = 0.0_wp
      !> Displacements between which the bounds hold [m]
      real(wp), public :: lower = 0.0_wp, upper = 0.0_wp
      !> Contacts that attach are bounded where they break at a larger coordinate than this, and at
      !> a smaller one on the way down [m]
      real(wp), public :: newborn_upper = 0.0_wp, newborn_lower = 0.0_wp
      !> Lower bounds on the stretches at the threshold of contacts whose thresholds grow [m], shape
      !> (contacts); not allocated if they do not
      real(wp), allocatable, public :: limit(:)
      !> Number of contacts, and key of the random numbers
      integer :: contacts = 0
      integer(i8) :: seed = 0, realization = 0
      !> Rate over its bound at the other end of the window
      real(wp) :: always = 0.0_wp
      !> Weights of the contacts by positive and by negative force: rates over omega_0 where the
      !> slider is at the reference [m]
      type(weight_tree_type) :: tree(2)
      real(wp) :: reference = 0.0_wp
      !> Whether weights are kept: not as long as all are below the bound for newborn contacts
      logical :: has_weights(2) = .false.
      !> Coordinates beyond which contacts break by positive force, and before which by negative
      !> force, at least [m]
      real(wp) :: nearest(2) = [-huge(1.0_wp), huge(1.0_wp)]
      !> Candidates drawn so far, those of the last draw, and the next one of these
      integer(i8) :: draws = 0
      integer, public :: drawn = 0, next = 1
      type(candidate_type), public :: candidate(max_drawn)
   contains
      !> Insert a contact, remove one, insert all again
      procedure, non_overridable :: insert, remove, fill
      !> Draw none from now on, and keep no weights
      procedure, non_overridable :: forget
      !> Whether a contact that attaches needs a new draw
      procedure, non_overridable :: exceeds_bound
      !> Whether a new draw is due, and the draw
      procedure, non_overridable :: is_over, draw
      !> Time of the next candidate, and whether a candidate is accepted
      procedure, non_overridable :: next_time, accepts
      procedure, non_overridable :: shift_origin, exchange
      procedure, non_overridable, private :: weight_of, fill_side, choose_window, &
         & choose_contact, drop_weights, lacks_weights
   end type candidates_type

contains

   !> Take rate and force of activation from named numbers.
   subroutine take_activation(parameters, common, rate, slope, error)
      type(parameters_type), intent(inout) :: parameters
      type(contact_parameters_type), intent(in) :: common
      !> Rate at the threshold [1/s], and k/f_T [1/m]
      real(wp), intent(out) :: rate, slope
      type(error_type), allocatable, intent(inout) :: error

      real(wp) :: force

      slope = 0.0_wp
      call parameters%take("activation_rate", rate, error)
      call parameters%take("activation_force", force, error)
      if (allocated(error)) return
      if (.not. (rate > 0.0_wp .and. force > 0.0_wp) .or. common%coupling /= coupling_equal) then
         call raise(error, status_invalid, "rate and force of activation must be positive, " &
            & // "and contacts of one stiffness")
         return
      end if
      slope = common%stiffness / force
   end subroutine take_activation

   !> Set up without contacts.
   subroutine new_candidates(self, contacts, rate, slope, seed, realization, error)
      type(candidates_type), intent(out) :: self
      !> Number of contacts
      integer, intent(in) :: contacts
      !> Rate at the threshold [1/s], and k/f_T [1/m]
      real(wp), intent(in) :: rate, slope
      !> Key of the random numbers
      integer(i8), intent(in) :: seed, realization
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: side

      self%contacts = contacts
      self%rate = rate
      self%slope = slope
      self%seed = seed
      self%realization = realization
      do side = 1, size(self%tree)
         if (.not. allocated(error)) call new_weight_tree(self%tree(side), contacts, error)
      end do
   end subroutine new_candidates

   !> Weight of a contact by the force of a sign.
   pure function weight_of(self, side, origin, limit) result(weight)
      class(candidates_type), intent(in) :: self
      integer, intent(in) :: side
      !> Origin, and stretch at the threshold [m]
      real(wp), intent(in) :: origin, limit
      real(wp) :: weight

      real(wp) :: exponent

      exponent = merge(self%reference - origin, origin - self%reference, side == by_upward_force)
      exponent = self%slope * (exponent - limit)
      weight = 0.0_wp
      if (exponent > min_exponent) weight = exp(exponent)
   end function weight_of

   !> Insert a contact, or change it.
   pure subroutine insert(self, contact, origin, limit)
      class(candidates_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Origin, and stretch at the threshold, at least [m]
      real(wp), intent(in) :: origin, limit

      integer :: side

      if (allocated(self%limit)) self%limit(contact) = limit
      self%nearest = [min(self%nearest(1), origin + limit), max(self%nearest(2), origin - limit)]
      do side = 1, 2
         if (.not. self%has_weights(side)) cycle
         call self%tree(side)%set(contact, self%weight_of(side, origin, limit))
      end do
   end subroutine insert

   !> Remove a contact.
   pure subroutine remove(self, contact)
      class(candidates_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: side

      do side = 1, 2
         if (self%has_weights(side)) call self%tree(side)%set(contact, 0.0_wp)
      end do
   end subroutine remove

   !> Insert all pinned contacts, and remove all others.
   pure subroutine fill(self, record)
      class(candidates_type), intent(inout) :: self
      !> Records of all contacts, shape (record_length, number of contacts)
      real(wp), intent(in), contiguous :: record(:, :)

      integer :: side

      do side = 1, 2
         call self%fill_side(side, record)
      end do
   end subroutine fill

   !> The same by the force of a sign.
   pure subroutine fill_side(self, side, record)
      class(candidates_type), intent(inout) :: self
      integer, intent(in) :: side
      real(wp), intent(in), contiguous :: record(:, :)

      real(wp) :: weight, limit
      integer :: contact

      if (.not. self%has_weights(side)) return
      do contact = 1, self%contacts
         limit = record(row_limit, contact)
         if (allocated(self%limit)) limit = self%limit(contact)
         weight = 0.0_wp
         if (record(row_stiffness, contact) > 0.0_wp) then
            weight = self%weight_of(side, record(row_origin, contact), limit)
         end if
         call self%tree(side)%set(contact, weight)
      end do
      call self%tree(side)%update_all()
   end subroutine fill_side

   !> Draw no candidates from now on, in any window, and keep no weights until the next draw.
   pure subroutine forget(self)
      class(candidates_type), intent(inout) :: self

      self%has_weights = .false.
      self%nearest = [-huge(1.0_wp), huge(1.0_wp)]
      self%drawn = 0
      self%next = 1
      self%lower = -huge(1.0_wp)
      self%upper = huge(1.0_wp)
      self%newborn_upper = -huge(1.0_wp)
      self%newborn_lower = huge(1.0_wp)
   end subroutine forget

   !> Whether the rate of a contact that attaches may exceed the bound for newborn ones.
   pure function exceeds_bound(self, origin, limit)
      class(candidates_type), intent(in) :: self
      !> Origin, and stretch at the threshold [m]
      real(wp), intent(in) :: origin, limit
      logical :: exceeds_bound

      exceeds_bound = origin + limit < self%newborn_upper .or. origin - limit > self%newborn_lower
   end function exceeds_bound

   !> Whether a new draw is due: no candidate remains, or the slider has left the window.
   pure function is_over(self, displacement)
      class(candidates_type), intent(in) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      logical :: is_over

      is_over = displacement >= self%upper .or. displacement <= self%lower &
         & .or. (self%drawn > 0 .and. self%next > self%drawn)
   end function is_over

   !> Draw candidates from now on.
   subroutine draw(self, time, displacement, velocity, record)
      class(candidates_type), intent(inout) :: self
      !> Time [s], displacement [m] and velocity of the slider [m/s]
      real(wp), intent(in) :: time, displacement, velocity
      !> Records of all contacts, shape (record_length, number of contacts)
      real(wp), intent(in), contiguous :: record(:, :)

      real(wp) :: total(3), total_rate, expected, now, first(max_drawn), second(max_drawn)
      integer(i8) :: number(max_drawn), key(max_drawn)
      integer :: event, length, side

      if (self%slope * abs(displacement - self%reference) > max_exponent) then
         self%reference = displacement
         call self%fill(record)
      end if
      do
         call self%choose_window(displacement, velocity, total, expected)
         do side = 1, 2
            if (self%lacks_weights(side)) exit
         end do
         if (side > 2) exit
         self%has_weights(side) = .true.
         call self%fill_side(side, record)
      end do
      self%drawn = 0
      self%next = 1
      total_rate = total(1) + total(2) + total(3)
      if (.not. total_rate > 0.0_wp) return

      length = 1 + int(min(drawn_share * expected, real(max_drawn - 1, wp)))
      do event = 1, length
         number(event) = self%draws + event
         key(event) = stream
      end do
      call uniform_pairs(self%seed, self%realization, key(:length), number(:length), 1_i8, &
         & first(:length), second(:length))
      now = time
      do event = 1, length
         now = now - log(first(event)) / total_rate
         self%candidate(event)%time = now
         call self%choose_contact(second(event) * total_rate, total, record, self%candidate(event))
         ! The second candidate of a contact is usually rejected.
         if (any(self%candidate(:event - 1)%contact == self%candidate(event)%contact)) exit
      end do
      self%drawn = min(event, length)
      self%draws = self%draws + self%drawn
   end subroutine draw

   !> Choose the window, and bound the rates in it.
   pure subroutine choose_window(self, displacement, velocity, total, expected)
      class(candidates_type), intent(inout) :: self
      !> Displacement [m] and velocity of the slider [m/s]
      real(wp), intent(in) :: displacement, velocity
      !> Bounds on the sums of rates, by purpose [1/s], and number of candidates until the slider
      !> leaves the window
      real(wp), intent(out) :: total(3), expected

      real(wp) :: width, growth, pace, newborn, factor, margin
      integer :: side

      pace = max(abs(velocity) * self%slope, min_pace)
      factor = exp(self%slope * (displacement - self%reference))
      do side = 1, 2
         total(side) = 0.0_wp
         if (.not. self%has_weights(side)) cycle
         call self%tree(side)%update()
         total(side) = self%rate * self%tree(side)%total() &
            & * merge(factor, 1.0_wp / factor, side == by_upward_force)
      end do
      width = usual_width
      growth = usual_growth
      expected = (total(1) + total(2)) / pace
      if (expected * growth * width**2 > max_work) then
         do while (expected * growth * width**2 > max_work .and. width > min_width)
            width = 0.5_wp * width
            growth = sqrt(growth)
         end do
      else
         do while (expected * (2.0_wp * growth * width)**2 < max_work .and. width < max_width)
            width = 2.0_wp * width
            growth = growth**2
         end do
      end if
      total(:2) = growth * total(:2)
      total(3) = max(newborn_share * (total(1) + total(2)), newborn_expected * pace / width, &
         & self%contacts * self%rate * exp(-max_exponent))
      expected = (total(1) + total(2) + total(3)) * width / pace
      self%lower = displacement - width / self%slope
      self%upper = displacement + width / self%slope
      self%always = 1.0_wp / growth**2
      if (allocated(self%limit)) self%always = 0.0_wp
      newborn = total(3) / (self%contacts * self%rate)
      margin = huge(1.0_wp)
      if (newborn > tiny(1.0_wp)) margin = -log(newborn) / self%slope
      self%newborn_upper = self%upper + margin
      self%newborn_lower = self%lower - margin
      do side = 1, 2
         if (.not. self%has_weights(side)) cycle
         if (total(side) > negligible_share * newborn * self%rate) cycle
         call self%drop_weights(side)
         total(side) = 0.0_wp
      end do
   end subroutine choose_window

   !> Keep no weights by the force of a sign, as their sum is below the bound for newborn contacts.
   pure subroutine drop_weights(self, side)
      class(candidates_type), intent(inout) :: self
      integer, intent(in) :: side

      real(wp) :: distance

      distance = -min_exponent / self%slope
      if (self%tree(side)%total() > 0.0_wp) distance = -log(self%tree(side)%total()) / self%slope
      if (side == by_upward_force) then
         self%nearest(1) = self%reference + distance
      else
         self%nearest(2) = self%reference - distance
      end if
      self%has_weights(side) = .false.
   end subroutine drop_weights

   !> Whether contacts may exceed the bound for newborn ones by the force of a sign whose weights
   !> are not kept.
   pure function lacks_weights(self, side)
      class(candidates_type), intent(in) :: self
      integer, intent(in) :: side
      logical :: lacks_weights

      lacks_weights = .false.
      if (self%has_weights(side)) return
      if (side == by_upward_force) then
         lacks_weights = self%nearest(1) < self%newborn_upper
      else
         lacks_weights = self%nearest(2) > self%newborn_lower
      end if
   end function lacks_weights

   !> Choose the contact of a candidate, and where it is accepted.
   pure subroutine choose_contact(self, part, total, record, candidate)
      class(candidates_type), intent(in) :: self
      !> Part of the bounds on the sums of rates by purpose [1/s], and these
      real(wp), intent(in) :: part, total(3)
      real(wp), intent(in), contiguous :: record(:, :)
      !> The candidate, the time of which is set
      type(candidate_type), intent(inout) :: candidate

      real(wp) :: remaining, fraction
      integer :: purpose, contact

      remaining = part
      do purpose = by_upward_force, by_downward_force
         if (remaining < total(purpose)) exit
         remaining = remaining - total(purpose)
      end do
      if (purpose == by_newborn) then
         remaining = remaining / total(3) * self%contacts
         contact = min(1 + int(remaining), self%contacts)
         fraction = (remaining - (contact - 1)) * total(3) / (self%contacts * self%rate)
      else
         call self%tree(purpose)%find(remaining / total(purpose) * self%tree(purpose)%total(), &
            & contact, fraction)
      end if
      candidate%contact = contact
      candidate%purpose = purpose
      candidate%life = record(row_renewal, contact)
      ! Only where it may be rejected is the logarithm needed.
      candidate%bound = huge(1.0_wp)
      if (purpose == by_newborn .or. fraction > self%always) then
         candidate%bound = -log(max(fraction, tiny(1.0_wp))) / self%slope
      end if
      select case (purpose)
      case (by_upward_force)
         candidate%bound = self%upper - candidate%bound
      case (by_downward_force)
         candidate%bound = self%lower + candidate%bound
      case default
         if (record(row_stiffness, contact) > 0.0_wp) candidate%life = candidate%life + 1.0_wp
      end select
   end subroutine choose_contact

   !> Time of the next candidate; huge if there is none [s].
   pure function next_time(self)
      class(candidates_type), intent(in) :: self
      real(wp) :: next_time

      next_time = huge(1.0_wp)
      if (self%next <= self%drawn) next_time = self%candidate(self%next)%time
   end function next_time

   !> Whether a candidate is accepted.
   pure function accepts(self, candidate, displacement, record, threshold)
      class(candidates_type), intent(in) :: self
      type(candidate_type), intent(in) :: candidate
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Record of its contact
      real(wp), intent(in) :: record(:)
      !> Stretch at its threshold now [m]
      real(wp), intent(in) :: threshold
      logical :: accepts

      real(wp) :: side, growth

      accepts = .false.
      if (.not. record(row_stiffness) > 0.0_wp) return
      associate (stretch => displacement - record(row_origin))
         if (candidate%purpose == by_newborn) then
            accepts = abs(stretch) >= threshold - candidate%bound &
               & .and. (record(row_renewal) >= candidate%life &
               & .or. .not. self%has_weights(merge(1, 2, stretch >= 0.0_wp)))
            return
         end if
         side = candidate%side()
         growth = 0.0_wp
         if (allocated(self%limit)) growth = threshold - self%limit(candidate%contact)
         accepts = merge(stretch >= 0.0_wp, stretch < 0.0_wp, side > 0.0_wp) &
            & .and. side * (displacement - candidate%bound) >= growth &
            & .and. .not. abs(record(row_renewal) - candidate%life) > 0.0_wp
      end associate
   end function accepts

   !> Direction of the force of a candidate.
   pure function side_of(self) result(side)
      class(candidate_type), intent(in) :: self
      real(wp) :: side

      side = merge(-1.0_wp, 1.0_wp, self%purpose == by_downward_force)
   end function side_of

   !> Shift the origin of displacements; contacts are inserted again after it.
   pure subroutine shift_origin(self, shift)
      class(candidates_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      self%reference = self%reference - shift
      self%lower = self%lower - shift
      self%upper = self%upper - shift
      self%newborn_lower = self%newborn_lower - shift
      self%newborn_upper = self%newborn_upper - shift
      self%nearest = self%nearest - shift
      where (self%candidate%purpose /= by_newborn)
         self%candidate%bound = self%candidate%bound - shift
      end where
   end subroutine shift_origin

   !> Write the state to an archive, or read it; contacts are inserted again after that.
   subroutine exchange(self, archive)
      class(candidates_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      integer :: event

      call archive%exchange("reference", self%reference)
      call archive%exchange("lower", self%lower)
      call archive%exchange("upper", self%upper)
      call archive%exchange("newborn_lower", self%newborn_lower)
      call archive%exchange("newborn_upper", self%newborn_upper)
      do event = 1, 2
         call archive%exchange("has_weights", self%has_weights(event))
         call archive%exchange("nearest", self%nearest(event))
      end do
      call archive%exchange("always", self%always)
      call archive%exchange("draws", self%draws)
      call archive%exchange("drawn", self%drawn)
      call archive%exchange("next", self%next)
      do event = 1, max_drawn
         associate (candidate => self%candidate(event))
            call archive%exchange("time", candidate%time)
            call archive%exchange("contact", candidate%contact)
            call archive%exchange("purpose", candidate%purpose)
            call archive%exchange("life", candidate%life)
            call archive%exchange("bound", candidate%bound)
         end associate
      end do
   end subroutine exchange

end module mesoslip_contacts_thermal_candidates
