!> Births of contacts: draws of thresholds, and stiffness, breaking stretch and drag from them.
!>
!> Thresholds of the next births are drawn several at a time, which is faster and gives the same
!> numbers, as each draw has its own key. So are delays and forces at attaching, if they differ
!> between contacts. With the stiffnesses of a table, break stretches are drawn instead of
!> thresholds.
module mesoslip_contacts_individual_births
   use mesoslip_contacts_base, only: contact_parameters_type
   use mesoslip_contacts_carried_law, only: carried_law_type, new_carried_law
   use mesoslip_contacts_individual_record, only: row_limit, row_next, row_origin, row_renewal, &
      & row_stiffness
   use mesoslip_contacts_mechanics, only: coupling_scaled, coupling_table, delay_exponential, &
      & initial_steady, initial_uniform
   use mesoslip_contacts_threshold_laws_gaussian, only: inverse_normal
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: uniform_pair, uniform_pairs
   implicit none
   private

   public :: births_type, bear, bear_by_rule, drag_of, draw_again

   !> Number of draws made together
   integer, parameter :: draws_together = 32
   !> Attempt of the first draw of a force at attaching; the next attempts count down
   integer(i8), parameter :: force_attempt = 65535_i8
   !> Number added to that of a contact in the key of draws again, on a weak place of a track
   integer(i8), parameter :: again_stream = 2_i8**31

   !> Births to come.
   type :: births_type
      !> Requested births: their number; the keys of their contacts, which are numbers from 0, and
      !> their renewals
      integer, private :: count = 0
      integer(i8), private :: key(draws_together) = 0_i8, renewal(draws_together) = 0_i8
      !> Delay of each contact before its next birth [s], if delays differ, and its force then over
      !> the mean threshold, positive in the direction of motion, if forces differ; shape (count)
      real(wp), allocatable :: delay(:), force(:)
      !> Thresholds that contacts keep for all their lives, if they do; and factors by which a track
      !> has scaled thresholds, for kinds that need them; shape (count)
      real(wp), allocatable :: kept(:), factor(:)
   contains
      !> Allocate delays and forces
      procedure, non_overridable :: allocate_draws
      !> Record the factors of thresholds if there is a track
      procedure, non_overridable :: record_factors
      !> Draw all contacts for the start of a run
      procedure, non_overridable :: draw_all
      !> Request the draws of the next birth of a contact, and make all requested draws
      procedure, non_overridable :: request, draw
      !> Write the draws to an archive, or read them
      procedure, non_overridable :: exchange
   end type births_type

contains

   !> Allocate delays and forces, if they differ between contacts.
   subroutine allocate_draws(self, parameters, error)
      class(births_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      stat = 0
      if (parameters%delay_law == delay_exponential) then
         allocate (self%delay(parameters%count), source=0.0_wp, stat=stat)
      end if
      if (stat == 0 .and. parameters%newborn_width > 0.0_wp) then
         allocate (self%force(parameters%count), source=0.0_wp, stat=stat)
      end if
      if (stat == 0 .and. parameters%keeps_thresholds) then
         allocate (self%kept(parameters%count), source=0.0_wp, stat=stat)
      end if
      if (stat /= 0) call raise(error, status_memory, "not enough memory for births of contacts")
   end subroutine allocate_draws

   !> Record the factors of thresholds if there is a track.
   subroutine record_factors(self, parameters, error)
      class(births_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      if (.not. parameters%strength%is_used) return
      allocate (self%factor(parameters%count), source=1.0_wp, stat=stat)
      if (stat /= 0) call raise(error, status_memory, "not enough memory for births of contacts")
   end subroutine record_factors

   !> Draw all contacts for the start of a run, with the strength of the place where it starts.
   subroutine draw_all(self, parameters, state, factor, record)
      class(births_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      !> One of the initial_ codes
      integer, intent(in) :: state
      !> Factor of thresholds there
      real(wp), intent(in) :: factor
      !> Records of the contacts, shape (record_length, count)
      real(wp), intent(inout), contiguous :: record(:, :)

      integer :: drawn, number, draw, contact, attempt
      integer(i8) :: key(draws_together), renewal(draws_together)
      real(wp) :: first(draws_together), second(draws_together), threshold(draws_together)
      real(wp) :: stiffness, limit, back_force, force(draws_together)
      type(carried_law_type) :: carried
      logical :: is_spread, is_carried

      is_spread = state == initial_steady .and. parameters%newborn_width > 0.0_wp
      ! Where contacts keep their thresholds, these have the law of draws in any state.
      is_carried = state == initial_steady .and. .not. parameters%keeps_thresholds
      back_force = parameters%back_force_ratio
      ! The law of scaled thresholds, if all contacts can attach.
      if (parameters%law%survival(back_force / factor) >= 1.0_wp) back_force = back_force / factor
      if (is_carried) call new_carried_law(carried, parameters%law, parameters%coupling, &
         & merge(0.0_wp, back_force, is_spread))
      renewal = 0_i8
      do drawn = 0, parameters%count - 1, draws_together
         number = min(draws_together, parameters%count - drawn)
         do draw = 1, number
            key(draw) = int(drawn + draw - 1, i8)
         end do
         call uniform_pairs(parameters%seed, parameters%realization, key(:number), &
            & renewal(:number), 0_i8, first(:number), second(:number))
         if (is_carried .and. .not. is_spread) then
            do draw = 1, number
               threshold(draw) = carried%quantile(first(draw))
            end do
         else
            call parameters%law%quantiles(first(:number), threshold(:number))
         end if
         if (allocated(self%kept)) self%kept(drawn + 1:drawn + number) = threshold(:number)
         if (is_spread) then
            do draw = 1, number
               call draw_sliding(parameters, carried, drawn + draw, factor, threshold(draw), &
                  & force(draw))
            end do
         end if

         do draw = 1, number
            contact = drawn + draw
            call bear(parameters, threshold(draw), stiffness, limit)
            limit = factor * limit
            attempt = 0
            do while (parameters%strength%is_used .and. attempt >= 0 .and. .not. (is_spread &
               & .or. parameters%keeps_thresholds) &
               & .and. stiffness * limit <= parameters%back_force_ratio * parameters%static_force)
               call draw_again(parameters, record(:, contact), contact, attempt, threshold(draw), &
                  & back_force)
               call bear(parameters, threshold(draw), stiffness, limit)
               limit = factor * limit
            end do
            if (is_spread) then
               record(row_origin, contact) = -force(draw) * parameters%static_force / stiffness
            else
               record(row_origin, contact) = &
                  & -initial_stretch(parameters, state, second(draw), stiffness, limit)
            end if
            record(row_stiffness, contact) = stiffness
            record(row_limit, contact) = limit
            record(row_renewal, contact) = 0.0_wp
            call self%request(contact, parameters, record)
         end do
      end do
      if (allocated(self%factor)) self%factor = factor
   end subroutine draw_all

   !> Stretch of a contact at the start of a run.
   pure function initial_stretch(parameters, state, deviate, stiffness, limit) result(stretch)
      type(contact_parameters_type), intent(in) :: parameters
      !> One of the initial_ codes
      integer, intent(in) :: state
      !> A uniform deviate; stiffness [N/m] and breaking stretch [m]
      real(wp), intent(in) :: deviate, stiffness, limit
      real(wp) :: stretch

      real(wp) :: back

      select case (state)
      case (initial_steady)
         back = parameters%back_force_ratio * parameters%static_force / stiffness
         if (parameters%keeps_thresholds) back = parameters%back_force_ratio * limit
         stretch = back + deviate * (limit - back)
      case (initial_uniform)
         stretch = deviate * limit
      case default
         stretch = 0.0_wp
      end select
   end function initial_stretch

   !> Request the draws of the next birth of a contact, which are made with those of others.
   subroutine request(self, contact, parameters, record)
      class(births_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      type(contact_parameters_type), intent(in) :: parameters
      !> Records of the contacts, shape (record_length, count)
      real(wp), intent(inout), contiguous :: record(:, :)

      record(row_next, contact) = 0.0_wp
      if (allocated(self%kept)) then
         record(row_next, contact) = self%kept(contact)
         if (.not. (allocated(self%delay) .or. allocated(self%force))) return
         record(row_next, contact) = 0.0_wp
      end if
      self%count = self%count + 1
      self%key(self%count) = int(contact - 1, i8)
      self%renewal(self%count) = int(record(row_renewal, contact) + 1.0_wp, i8)
      if (self%count == draws_together) call self%draw(parameters, record)
   end subroutine request

   !> Draw all requested births.
   !>
   !> The first deviate of a birth is that of its threshold, the second that of the delay before it.
   subroutine draw(self, parameters, record)
      class(births_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      !> Records of the contacts, shape (record_length, count)
      real(wp), intent(inout), contiguous :: record(:, :)

      integer :: event
      real(wp) :: first(draws_together), second(draws_together), threshold(draws_together)

      if (self%count == 0) return
      associate (count => self%count)
         call uniform_pairs(parameters%seed, parameters%realization, self%key(:count), &
            & self%renewal(:count), 0_i8, first(:count), second(:count))
         if (allocated(self%kept)) then
            do event = 1, count
               threshold(event) = self%kept(self%key(event) + 1_i8)
            end do
         else
            call parameters%law%quantiles(first(:count), threshold(:count))
         end if
         if (allocated(self%delay)) then
            do event = 1, count
               self%delay(self%key(event) + 1_i8) = -parameters%delay * log(second(event))
            end do
         end if
         if (allocated(self%force)) then
            call draw_forces(parameters, self%key(:count), self%renewal(:count), &
               & threshold(:count), first(:count))
            do event = 1, count
               self%force(self%key(event) + 1_i8) = first(event)
            end do
         end if
         do event = 1, count
            record(row_next, self%key(event) + 1_i8) = threshold(event)
         end do
         count = 0
      end associate
   end subroutine draw

   !> Stiffness and breaking stretch of a contact that is born with a relative threshold.
   pure subroutine bear(parameters, threshold, stiffness, limit)
      type(contact_parameters_type), intent(in) :: parameters
      !> Relative threshold; break stretch with the stiffnesses of a table
      real(wp), intent(in) :: threshold
      !> Stiffness [N/m] and breaking stretch [m]
      real(wp), intent(out) :: stiffness, limit

      if (parameters%coupling == coupling_table) then
         limit = threshold * (parameters%static_force / parameters%stiffness)
         stiffness = parameters%stiffness * parameters%law%stiffness_at(threshold)
      else
         call bear_by_rule(parameters, threshold, stiffness, limit)
      end if
   end subroutine bear

   !> The same if the stiffness follows from the threshold.
   pure subroutine bear_by_rule(parameters, threshold, stiffness, limit)
      type(contact_parameters_type), intent(in) :: parameters
      !> Relative threshold
      real(wp), intent(in) :: threshold
      !> Stiffness [N/m] and breaking stretch [m]
      real(wp), intent(out) :: stiffness, limit

      stiffness = parameters%stiffness
      if (parameters%coupling == coupling_scaled) stiffness = stiffness * sqrt(threshold)
      limit = threshold * parameters%static_force / stiffness
   end subroutine bear_by_rule

   !> Relative threshold of a drawn contact.
   pure function threshold_of(parameters, drawn) result(threshold)
      type(contact_parameters_type), intent(in) :: parameters
      !> The threshold; its break stretch with the stiffnesses of a table
      real(wp), intent(in) :: drawn
      real(wp) :: threshold

      threshold = drawn
      if (parameters%coupling == coupling_table) then
         threshold = drawn * parameters%law%stiffness_at(drawn)
      end if
   end function threshold_of

   !> Draw the forces with which contacts attach, from a normal law.
   !>
   !> A contact whose force is not below its threshold could not attach: both are drawn again, or
   !> the force alone if the contact keeps its threshold.
   subroutine draw_forces(parameters, key, renewal, threshold, force)
      type(contact_parameters_type), intent(in) :: parameters
      !> Keys of the contacts, which are numbers from 0, and their renewals; shape (contacts)
      integer(i8), intent(in), contiguous :: key(:), renewal(:)
      !> Relative thresholds, first as drawn, then those with which the contacts attach
      real(wp), intent(inout), contiguous :: threshold(:)
      !> Relative forces, positive in the direction of motion
      real(wp), intent(out), contiguous :: force(:)

      real(wp) :: uniform(2), first(size(key)), second(size(key))
      integer(i8) :: attempt
      integer :: birth

      call uniform_pairs(parameters%seed, parameters%realization, key, renewal, force_attempt, &
         & first, second)
      do birth = 1, size(key)
         force(birth) = newborn_force(parameters, second(birth))
         do attempt = force_attempt - 1_i8, 1_i8, -1_i8
            associate (max_force => threshold_of(parameters, threshold(birth)))
               if (abs(force(birth) + own_excess(parameters, max_force)) < max_force) exit
            end associate
            call uniform_pair(parameters%seed, parameters%realization, key(birth), &
               & renewal(birth), attempt, uniform)
            if (.not. parameters%keeps_thresholds) then
               threshold(birth) = parameters%law%quantile(uniform(1))
            end if
            force(birth) = newborn_force(parameters, uniform(2))
         end do
      end do
   end subroutine draw_forces

   !> Draw the threshold and the force at attaching of a contact again, which is too weak for its
   !> place on the track.
   subroutine draw_again(parameters, record, contact, attempt, threshold, force)
      type(contact_parameters_type), intent(in) :: parameters
      !> Record of the contact, and its number
      real(wp), intent(in), contiguous :: record(:)
      integer, intent(in) :: contact
      !> Number of attempts before; -1 after the last one
      integer, intent(inout) :: attempt
      !> Relative threshold and force
      real(wp), intent(out) :: threshold, force

      real(wp) :: uniform(2)

      call uniform_pair(parameters%seed, parameters%realization, again_stream + int(contact, i8), &
         & int(record(row_renewal), i8), int(attempt, i8), uniform)
      threshold = parameters%law%quantile(uniform(1))
      force = parameters%back_force_ratio
      if (parameters%newborn_width > 0.0_wp) force = newborn_force(parameters, uniform(2))
      attempt = attempt + 1
      if (attempt > force_attempt) attempt = -1
   end subroutine draw_again

   !> Relative force at attaching of a contact that keeps its relative threshold, beyond that of
   !> other contacts; 0 for those.
   pure real(wp) function own_excess(parameters, threshold)
      type(contact_parameters_type), intent(in) :: parameters
      real(wp), intent(in) :: threshold

      own_excess = 0.0_wp
      if (parameters%keeps_thresholds) then
         own_excess = parameters%back_force_ratio * (threshold - 1.0_wp)
      end if
   end function own_excess

   !> Relative force at attaching of a uniform deviate.
   pure real(wp) function newborn_force(parameters, deviate)
      type(contact_parameters_type), intent(in) :: parameters
      real(wp), intent(in) :: deviate

      newborn_force = parameters%back_force_ratio &
         & + parameters%newborn_width * inverse_normal(deviate)
   end function newborn_force

   !> Draw a contact of slow sliding if forces at attaching differ.
   !>
   !> Contacts that attach with the threshold u and the force b, abs(b) < u, slide from b to u.
   !> Their number is proportional to u - b, and their forces are uniform between b and u. A
   !> threshold is drawn with the weight 2 u, then b; they are accepted with the probability
   !> (u - b)/(2 u). A contact that keeps its threshold draws the force alone.
   pure subroutine draw_sliding(parameters, carried, contact, factor, threshold, force)
      type(contact_parameters_type), intent(in) :: parameters
      !> Law of thresholds weighted by the distance from zero force to breaking
      type(carried_law_type), intent(in) :: carried
      integer, intent(in) :: contact
      !> Factor of thresholds
      real(wp), intent(in) :: factor
      !> Relative threshold, which may be kept, and force
      real(wp), intent(inout) :: threshold
      real(wp), intent(out) :: force

      real(wp) :: uniform(2), other(2), newborn, max_force
      integer(i8) :: attempt, key

      force = 0.0_wp
      key = int(contact - 1, i8)
      do attempt = force_attempt, 3_i8, -2_i8
         call uniform_pair(parameters%seed, parameters%realization, key, 0_i8, attempt, uniform)
         call uniform_pair(parameters%seed, parameters%realization, key, 0_i8, attempt - 1_i8, &
            & other)
         if (.not. parameters%keeps_thresholds) threshold = carried%quantile(uniform(1))
         max_force = factor * threshold_of(parameters, threshold)
         newborn = newborn_force(parameters, uniform(2)) + own_excess(parameters, max_force)
         force = newborn + other(2) * (max_force - newborn)
         if (abs(newborn) < max_force &
            & .and. 2.0_wp * max_force * other(1) < max_force - newborn) return
      end do
   end subroutine draw_sliding

   !> Drag of a contact while it is detached [N s/m].
   pure function drag_of(parameters, stiffness) result(drag)
      type(contact_parameters_type), intent(in) :: parameters
      !> Stiffness of the contact [N/m]
      real(wp), intent(in) :: stiffness
      real(wp) :: drag

      drag = parameters%drag
      if (drag > 0.0_wp .and. parameters%coupling == coupling_scaled) then
         drag = drag * (stiffness / parameters%stiffness)**2
      else if (drag > 0.0_wp .and. parameters%coupling == coupling_table) then
         drag = drag * (stiffness / parameters%stiffness)**2 / parameters%law%mean_square_stiffness
      end if
   end function drag_of

   !> Write the draws to an archive, or read them; no requested draw may be pending.
   subroutine exchange(self, archive)
      class(births_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      if (allocated(self%delay)) call archive%exchange("next_delay", self%delay)
      if (allocated(self%force)) call archive%exchange("next_force", self%force)
      if (allocated(self%kept)) call archive%exchange("kept_threshold", self%kept)
      if (allocated(self%factor)) call archive%exchange("factor", self%factor)
   end subroutine exchange

end module mesoslip_contacts_individual_births
