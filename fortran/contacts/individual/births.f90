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

   public :: births_type, bear, bear_by_rule, drag_of

   !> Number of draws made together
   integer, parameter :: draws_together = 32
   !> Attempt of the first draw of a force at attaching; the next attempts count down
   integer(i8), parameter :: force_attempt = 65535_i8

   !> Births to come.
   type :: births_type
      !> Requested births: their number; the keys of their contacts, which are numbers from 0, and
      !> their renewals
      integer, private :: count = 0
      integer(i8), private :: key(draws_together) = 0_i8, renewal(draws_together) = 0_i8
      !> Delay of each contact before its next birth [s], if delays differ, and its force then over
      !> the mean threshold, positive in the direction of motion, if forces differ; shape (count)
      real(wp), allocatable :: delay(:), force(:)
   contains
      !> Allocate delays and forces
      procedure, non_overridable :: allocate_draws
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
      if (stat /= 0) call raise(error, status_memory, "not enough memory for births of contacts")
   end subroutine allocate_draws

   !> Draw all contacts for the start of a run.
   subroutine draw_all(self, parameters, state, record)
      class(births_type), intent(inout) :: self
      type(contact_parameters_type), intent(in) :: parameters
      !> One of the initial_ codes
      integer, intent(in) :: state
      !> Records of the contacts, shape (record_length, count)
      real(wp), intent(inout), contiguous :: record(:, :)

      integer :: drawn, number, draw, contact
      integer(i8) :: key(draws_together), renewal(draws_together)
      real(wp) :: first(draws_together), second(draws_together), threshold(draws_together)
      real(wp) :: stiffness, limit, force(draws_together)
      type(carried_law_type) :: carried
      logical :: is_spread

      is_spread = state == initial_steady .and. parameters%newborn_width > 0.0_wp
      if (state == initial_steady) call new_carried_law(carried, parameters%law, &
         & parameters%coupling, merge(0.0_wp, parameters%back_force_ratio, is_spread))
      renewal = 0_i8
      do drawn = 0, parameters%count - 1, draws_together
         number = min(draws_together, parameters%count - drawn)
         do draw = 1, number
            key(draw) = int(drawn + draw - 1, i8)
         end do
         call uniform_pairs(parameters%seed, parameters%realization, key(:number), &
            & renewal(:number), 0_i8, first(:number), second(:number))
         if (is_spread) then
            do draw = 1, number
               call draw_sliding(parameters, carried, drawn + draw, threshold(draw), force(draw))
            end do
         else if (state == initial_steady) then
            do draw = 1, number
               threshold(draw) = carried%quantile(first(draw))
            end do
         else
            call parameters%law%quantiles(first(:number), threshold(:number))
         end if

         do draw = 1, number
            contact = drawn + draw
            call bear(parameters, threshold(draw), stiffness, limit)
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
         call parameters%law%quantiles(first(:count), threshold(:count))
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
   !> A contact whose force is not below its threshold could not attach: both are drawn again.
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
            if (abs(force(birth)) < threshold_of(parameters, threshold(birth))) exit
            call uniform_pair(parameters%seed, parameters%realization, key(birth), &
               & renewal(birth), attempt, uniform)
            threshold(birth) = parameters%law%quantile(uniform(1))
            force(birth) = newborn_force(parameters, uniform(2))
         end do
      end do
   end subroutine draw_forces

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
   !> (u - b)/(2 u).
   pure subroutine draw_sliding(parameters, carried, contact, threshold, force)
      type(contact_parameters_type), intent(in) :: parameters
      !> Law of thresholds weighted by the distance from zero force to breaking
      type(carried_law_type), intent(in) :: carried
      integer, intent(in) :: contact
      !> Relative threshold and force
      real(wp), intent(out) :: threshold, force

      real(wp) :: uniform(2), other(2), newborn, max_force
      integer(i8) :: attempt, key

      threshold = 1.0_wp
      force = 0.0_wp
      key = int(contact - 1, i8)
      do attempt = force_attempt, 3_i8, -2_i8
         call uniform_pair(parameters%seed, parameters%realization, key, 0_i8, attempt, uniform)
         call uniform_pair(parameters%seed, parameters%realization, key, 0_i8, attempt - 1_i8, &
            & other)
         threshold = carried%quantile(uniform(1))
         newborn = newborn_force(parameters, uniform(2))
         max_force = threshold_of(parameters, threshold)
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
   end subroutine exchange

end module mesoslip_contacts_individual_births
