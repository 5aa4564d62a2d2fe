!> Individual contacts: their records, detaching and attaching, and what all kinds have in common.
!>
!> The earthquake-like model, except for the time of breaking. Each kind sorts its contacts by a key
!> and implements when the first contact breaks (offer), which contacts break (respond), insertion
!> of an attached contact (join), and the coordinate at which a contact breaks after a reversal
!> (behind_of). Coordinates are along a direction of motion.
module mesoslip_contacts_individual_base
   use mesoslip_contacts_base, only: contact_record_length, contacts_type, exchange_contacts, &
      & extent_length
   use mesoslip_contacts_individual_avalanche_track, only: avalanche_track_type, &
      & new_avalanche_track, row_generation
   use mesoslip_contacts_individual_births, only: bear, bear_by_rule, births_type, drag_of, &
      & draw_again
   use mesoslip_contacts_individual_detached, only: detached_contacts_type, new_detached_contacts
   use mesoslip_contacts_mechanics, only: coupling_table, delay_fixed
   use mesoslip_contacts_individual_record, only: record_length, row_limit, row_next, &
      & row_origin, row_renewal, row_stiffness, behind_coordinate
   use mesoslip_contacts_individual_sites, only: contact_sites_type, new_contact_sites
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory
   use mesoslip_numerics_memory, only: request_large_pages
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: uniform_pair
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: individual_contacts_type, exchange_individual, total_law, snapshot_individual

   !> Number of contacts whose records are evaluated together for a snapshot
   integer, parameter :: snapshot_block = 256
   !> Length of a schedule over the breaks between two changes of the normal load
   real(wp), parameter :: length_ratio = 1.5_wp
   !> Minimum number of sites in a schedule that may touch or separate
   integer, parameter :: min_sites = 4

   !> N individual contacts.
   type, abstract, extends(contacts_type) :: individual_contacts_type
      !> Records of the contacts, shape (record_length, count)
      real(wp), allocatable :: record(:, :)
      !> Sites of the contacts under the normal load
      type(contact_sites_type) :: sites
      !> Contacts that are detached
      type(detached_contacts_type) :: detached
      !> Contacts whose next thresholds have not been drawn
      type(births_type) :: births
      !> Sums over pinned contacts (stiffness; stiffness times origin) and detached ones (drag)
      type(accumulator_type) :: stiffness, offset, drag
      !> Contacts of the current avalanche
      type(avalanche_track_type) :: track
      !> Stiffness of all bonds of a contact to its neighbours [N/m]
      real(wp) :: bonds = 0.0_wp
      !> Direction of motion by which contacts are sorted, +1 or -1
      real(wp) :: direction = 1.0_wp
      !> Upper bound of the coordinates at which contacts break after a reversal [m]
      real(wp) :: behind = -huge(1.0_wp)
      !> Breaks until the normal load changed last
      real(wp) :: breaks_at_load = 0.0_wp
      !> Whether the contact that joins touches: it attaches without a force
      logical :: touches = .false.
      !> Stretch with which the last contact attached, to the last digit as in a schedule [m]
      real(wp) :: newborn_stretch = 0.0_wp
      !> Whether sites that touch or separate are listed in schedules, and those sites
      logical :: lists_sites = .false.
      integer, private :: site_listed(max_events) = 0
      !> Configured breaking stretches of the contacts that touch [m]
      real(wp), private :: site_limit(max_events) = 0.0_wp
      !> Maximum number of those sites, by how many moved in the last schedule
      integer, private :: max_sites = max_events
   contains
      procedure :: law => total_law
      procedure :: snapshot => snapshot_individual
      procedure :: shift_origin, elastic_energy, individual_count, records, take_extent
      !> Insert an attached contact into the order of breaking, and take a pinned one out
      procedure(join_interface), deferred :: join
      procedure :: leave
      !> Maximum coordinate at which a pinned contact breaks after a reversal
      procedure :: behind_of
      !> Force of the neighbours on an attaching contact
      procedure :: neighbour_force
      !> Shift the origin in further data of a kind
      procedure :: shift_order
      !> Breaking stretch of a contact when it attaches
      procedure :: limit_at_birth
      !> Allocate the records, and draw all contacts at the start of a run
      procedure, non_overridable :: allocate_records, draw
      !> Detach a contact that breaks, and attach all contacts that are due
      procedure, non_overridable :: detach, attach_due
      !> Number of pinned contacts
      procedure, non_overridable :: pinned_count, are_broken
      !> Sort all contacts again from the records, and recompute the bound behind
      procedure, non_overridable :: rebuild_queue, max_behind
      !> Window between two coordinates
      procedure, non_overridable :: window_between
      !> List the next attachments and births in a schedule
      procedure, non_overridable :: list_attachments, list_births, knows_lives, list_sites
      !> Update records and sums after a schedule, but not the order of breaking
      procedure, non_overridable :: detach_listed, attach_listed, move_listed
      procedure, non_overridable, private :: attach_next, draw_births, give_birth, list_lives, &
         & own_excess, fit_to_track, sum_totals, follow_load, touch, separate
   end type individual_contacts_type

   abstract interface
      subroutine join_interface(self, contact, pose)
         import :: individual_contacts_type, pose_type
         implicit none
         class(individual_contacts_type), intent(inout) :: self
         !> Number of the contact
         integer, intent(in) :: contact
         type(pose_type), intent(in) :: pose
      end subroutine join_interface
   end interface

contains

   !> Allocate the records of contacts, whose parameters are set, and of avalanches on a lattice.
   subroutine allocate_records(self, columns, rows, error)
      class(individual_contacts_type), intent(inout) :: self
      !> Columns and rows of the lattice; 0 columns without a lattice
      integer, intent(in) :: columns, rows
      !> Set if there is not enough memory, or the lattice does not hold the contacts
      type(error_type), allocatable, intent(inout) :: error

      integer :: stat

      if (columns > 0 .and. columns * rows /= self%parameters%count) then
         call raise(error, status_invalid, "columns times rows of the lattice must be the number " &
            & // "of contacts")
         return
      end if
      allocate (self%record(record_length, self%parameters%count), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the contacts")
         return
      end if
      call request_large_pages(self%record, size(self%record))
      self%record = 0.0_wp
      call new_detached_contacts(self%detached, self%parameters%count, self%parameters%reattach, &
         & self%parameters%delay_law == delay_fixed, error)
      if (.not. allocated(error)) call new_contact_sites(self%sites, self%parameters, error)
      if (.not. allocated(error)) call self%births%allocate_draws(self%parameters, error)
      if (.not. allocated(error)) call new_avalanche_track(self%track, columns, rows, error)
   end subroutine allocate_records

   !> Draw all contacts at the start of a run.
   subroutine draw(self, state)
      class(individual_contacts_type), intent(inout) :: self
      !> One of the initial_ codes
      integer, intent(in) :: state

      real(wp) :: factor
      integer :: order

      factor = 1.0_wp
      if (self%parameters%strength%is_used) factor = self%parameters%strength%factor(0.0_wp)
      call self%births%draw_all(self%parameters, state, factor, self%record)
      do order = self%sites%count + 1, self%parameters%count
         associate (record => self%record(:, self%sites%site_at(order)))
            ! Its first life is over before it began.
            record(row_stiffness) = 0.0_wp
            record(row_renewal) = 1.0_wp
         end associate
      end do
      call self%sum_totals()
   end subroutine draw

   !> Contact force as a law, from the sums over contacts.
   pure function total_law(self) result(law)
      class(individual_contacts_type), intent(in) :: self
      type(interface_law_type) :: law

      law%stiffness = self%stiffness%total()
      law%offset = self%offset%total()
      law%drag = self%drag%total()
   end function total_law

   !> Window between two coordinates along the direction of motion.
   pure function window_between(self, behind, ahead, end_time) result(window)
      class(individual_contacts_type), intent(in) :: self
      !> Coordinates between which no contact breaks [m], and time at which the law ends [s]
      real(wp), intent(in) :: behind, ahead, end_time
      type(window_type) :: window

      window%end_time = min(end_time, self%sites%next_time)
      if (self%direction > 0.0_wp) then
         window%upper = ahead
         window%lower = behind
      else
         window%upper = -behind
         window%lower = -ahead
      end if
   end function window_between

   !> Detach a contact that breaks: subtract its force, and schedule its next attachment.
   subroutine detach(self, contact, displacement, time)
      class(individual_contacts_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Displacement of the slider [m] and time [s]
      real(wp), intent(in) :: displacement, time

      real(wp) :: stiffness, origin, drag, delay

      associate (record => self%record(:, contact))
         origin = record(row_origin)
         stiffness = record(row_stiffness)
         record(row_stiffness) = 0.0_wp
         record(row_renewal) = record(row_renewal) + 1.0_wp
      end associate

      drag = drag_of(self%parameters, stiffness)
      call self%break_loss%add(0.5_wp * stiffness * (displacement - origin)**2)
      call self%stiffness%add(-stiffness)
      call self%offset%add(-stiffness * origin)
      if (drag > 0.0_wp) call self%drag%add(drag)
      self%breaks = self%breaks + 1.0_wp
      call self%track%add(contact)
      delay = self%parameters%delay
      if (allocated(self%births%delay)) then
         call self%draw_births([contact])
         delay = self%births%delay(contact)
      end if
      call self%detached%push(contact, time + delay, drag)
      if (self%pinned_count() == 0) then
         self%stiffness = accumulator_type()
         self%offset = accumulator_type()
      end if
   end subroutine detach

   !> Number of pinned contacts.
   pure function pinned_count(self) result(number)
      class(individual_contacts_type), intent(in) :: self
      integer :: number

      number = self%sites%count - self%detached%count
   end function pinned_count

   !> Whether no contact is pinned, nor ever will be.
   pure function are_broken(self)
      class(individual_contacts_type), intent(in) :: self
      logical :: are_broken

      are_broken = self%pinned_count() == 0 &
         & .and. min(self%detached%next_due, self%sites%next_time) >= huge(1.0_wp)
   end function are_broken

   !> Attach all contacts that are due, in the order of their attachment times.
   subroutine attach_due(self, pose)
      class(individual_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact
      real(wp) :: back_force, force

      back_force = pose%direction * self%parameters%back_force_ratio * self%parameters%static_force
      do while (self%detached%next_due <= pose%time)
         force = back_force
         if (self%bonds > 0.0_wp) then
            call self%detached%find_next(contact)
            force = back_force + self%neighbour_force(contact, pose%displacement)
         end if
         call self%attach_next(pose, force, contact)
         call self%join(contact, pose)
      end do
      if (self%sites%next_time <= pose%time) call self%follow_load(pose)
      self%detached_count = real(self%detached%count, wp)
   end subroutine attach_due

   !> Force of the neighbours on an attaching contact; 0 for kinds without neighbours.
   pure function neighbour_force(self, contact, displacement) result(force)
      class(individual_contacts_type), intent(in) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Force of the neighbours where the stretch of the contact is 0 [N]
      real(wp) :: force

      force = 0.0_wp
   end function neighbour_force

   !> Attach the next contact that is due.
   subroutine attach_next(self, pose, mean_force, contact)
      class(individual_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Mean force of a contact when it attaches, including that of its neighbours [N]
      real(wp), intent(in) :: mean_force
      integer, intent(out) :: contact

      real(wp) :: stiffness, limit, origin, stretch, drag, force, factor

      call self%detached%pop(contact, drag)
      call self%draw_births([contact])
      call self%give_birth(contact, mean_force, pose%direction, stiffness, limit, force)
      factor = 1.0_wp
      if (self%parameters%strength%is_used) then
         call self%fit_to_track(contact, mean_force, pose, factor, stiffness, limit, force)
      else if (self%parameters%keeps_thresholds) then
         force = force + pose%direction * self%own_excess(stiffness, self%limit_at_birth(limit))
      end if
      stretch = force / (stiffness + self%bonds)
      if (self%parameters%keeps_thresholds .and. .not. (allocated(self%births%force) &
         & .or. self%bonds > 0.0_wp)) then
         ! To the last digit as in a schedule.
         stretch = factor * (pose%direction * self%parameters%back_force_ratio &
            & * self%limit_at_birth(limit))
      end if
      self%newborn_stretch = stretch
      limit = factor * limit
      origin = pose%displacement - stretch
      call self%drag%add(-drag)
      if (self%detached%count == 0) self%drag = accumulator_type()
      call self%birth_gain%add(0.5_wp * stiffness * (pose%displacement - origin)**2)
      call self%stiffness%add(stiffness)
      call self%offset%add(stiffness * origin)
      self%record(row_origin, contact) = origin
      self%record(row_stiffness, contact) = stiffness
      self%record(row_limit, contact) = limit
      call self%births%request(contact, self%parameters, self%record)
   end subroutine attach_next

   !> Let sites touch and separate as the normal load has changed.
   subroutine follow_load(self, pose)
      class(individual_contacts_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: contact
      logical :: touches

      if (.not. self%lists_sites) self%schedule_length = int(min(real(max_events, wp), &
         & 2.0_wp + length_ratio * (self%breaks - self%breaks_at_load)))
      self%breaks_at_load = self%breaks
      do while (self%sites%next_time <= pose%time)
         call self%sites%take_next(self%parameters, contact, touches)
         if (contact == 0) cycle
         if (touches) then
            call self%touch(contact, pose)
         else
            call self%separate(contact, pose)
         end if
         if (allocated(self%failure)) return
      end do
   end subroutine follow_load

   !> A site touches: its contact attaches without a force.
   subroutine touch(self, contact, pose)
      class(individual_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: threshold, stiffness, limit, factor, uniform(2)

      call self%draw_births([contact])
      threshold = self%record(row_next, contact)
      if (allocated(self%births%force) .and. .not. self%parameters%keeps_thresholds) then
         ! The drawn threshold may have been rejected for the force at attaching.
         call uniform_pair(self%parameters%seed, self%parameters%realization, &
            & int(contact - 1, i8), int(self%record(row_renewal, contact), i8), 0_i8, uniform)
         threshold = self%parameters%law%quantile(uniform(1))
      end if
      call bear(self%parameters, threshold, stiffness, limit)
      if (self%parameters%strength%is_used) then
         factor = self%parameters%strength%factor(pose%displacement)
         limit = factor * limit
         if (allocated(self%births%factor)) self%births%factor(contact) = factor
      end if
      call self%stiffness%add(stiffness)
      call self%offset%add(stiffness * pose%displacement)
      self%record(row_origin, contact) = pose%displacement
      self%record(row_stiffness, contact) = stiffness
      self%record(row_limit, contact) = limit
      call self%births%request(contact, self%parameters, self%record)
      self%touches = .true.
      call self%join(contact, pose)
      self%touches = .false.
   end subroutine touch

   !> A site separates: the energy of its contact is lost, and one that is detached does not attach.
   subroutine separate(self, contact, pose)
      class(individual_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: stiffness, origin, drag

      stiffness = self%record(row_stiffness, contact)
      origin = self%record(row_origin, contact)
      if (.not. stiffness > 0.0_wp) then
         call self%detached%remove(contact, drag)
         call self%drag%add(-drag)
         if (self%detached%count == 0) self%drag = accumulator_type()
         return
      end if
      call self%leave(contact)
      self%record(row_stiffness, contact) = 0.0_wp
      self%record(row_renewal, contact) = self%record(row_renewal, contact) + 1.0_wp
      call self%separation_loss%add(0.5_wp * stiffness * (pose%displacement - origin)**2)
      call self%stiffness%add(-stiffness)
      call self%offset%add(-stiffness * origin)
      if (self%pinned_count() > 0) return
      self%stiffness = accumulator_type()
      self%offset = accumulator_type()
   end subroutine separate

   !> Take a pinned contact out of the order of breaking; kinds that cannot end the run.
   subroutine leave(self, contact)
      class(individual_contacts_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact

      call raise(self%failure, status_invalid, "contacts of this kind do not separate")
   end subroutine leave

   !> List the next contacts to attach in a schedule, up to a maximum number.
   subroutine list_attachments(self, limit, direction, schedule, contact)
      class(individual_contacts_type), intent(inout) :: self
      !> Maximum number
      integer, intent(in) :: limit
      !> Sign of the velocity at which they attach
      real(wp), intent(in) :: direction
      type(schedule_type), intent(inout) :: schedule
      !> The contacts
      integer, intent(out) :: contact(max_events)

      integer :: number

      call self%detached%preview(limit, number, contact, schedule%attach_time, &
         & schedule%attach_drag)
      call self%list_lives(contact(:number), direction, schedule%attach_stiffness, &
         & schedule%attach_limit, schedule%attach_stretch)
      schedule%attachments = number
      schedule%attached = 0
      schedule%sites = 0
      schedule%moved = 0
      schedule%site_time(1) = self%sites%next_time
      schedule%delay = self%parameters%delay
      if (self%parameters%strength%is_used) then
         if (.not. allocated(schedule%strength)) then
            allocate (schedule%strength, source=self%parameters%strength)
         end if
         schedule%strength%origin = self%parameters%strength%origin
         schedule%scales_stretches = self%parameters%keeps_thresholds
      end if
      if (.not. self%parameters%reattach) schedule%delay = huge(1.0_wp)
      schedule%stiffness = self%stiffness
      schedule%offset = self%offset
      schedule%drag = self%drag
      schedule%detached = self%detached%count
      schedule%pinned = self%pinned_count()
   end subroutine list_attachments

   !> List the next sites that touch or separate in a schedule. The list ends before one whose
   !> contact is detached, or listed to break.
   subroutine list_sites(self, limit, breaking, schedule)
      class(individual_contacts_type), intent(inout) :: self
      !> Maximum number
      integer, intent(in) :: limit
      !> Contacts that are listed to break
      integer, intent(in) :: breaking(:)
      type(schedule_type), intent(inout) :: schedule

      integer :: event, number

      if (.not. (self%lists_sites .and. self%sites%next_time < huge(1.0_wp))) return
      call self%sites%preview(self%parameters, min(limit, self%max_sites), self%site_listed, &
         & schedule%site_touches, schedule%site_time, number)
      do event = 1, number
         associate (contact => self%site_listed(event))
            if (schedule%site_touches(event)) then
               call self%draw_births([contact])
               call bear(self%parameters, self%record(row_next, contact), &
                  & schedule%site_stiffness(event), self%site_limit(event))
               schedule%site_limit(event) = self%limit_at_birth(self%site_limit(event))
            else
               schedule%site_stiffness(event) = self%record(row_stiffness, contact)
               schedule%site_origin(event) = self%record(row_origin, contact)
               if (.not. schedule%site_stiffness(event) > 0.0_wp) exit
               if (any(breaking == contact)) exit
            end if
         end associate
      end do
      schedule%sites = event - 1
   end subroutine list_sites

   !> List the next births of the contacts that break in a schedule, if they can attach within it.
   subroutine list_births(self, contact, before, direction, schedule)
      class(individual_contacts_type), intent(inout) :: self
      !> The contacts that are listed to break, and the number of births listed before
      integer, intent(in) :: contact(:), before
      !> Sign of the velocity at which they attach
      real(wp), intent(in) :: direction
      type(schedule_type), intent(inout) :: schedule

      integer :: event

      schedule%has_births = self%parameters%reattach .and. (allocated(self%births%delay) &
         & .or. .not. self%parameters%delay > 0.0_wp)
      if (.not. schedule%has_births) return
      call self%list_lives(contact, direction, schedule%birth_stiffness(before + 1:), &
         & schedule%birth_limit(before + 1:), schedule%birth_stretch(before + 1:))
      schedule%birth_delay(before + 1:before + size(contact)) = self%parameters%delay
      if (.not. allocated(self%births%delay)) return
      do event = 1, size(contact)
         schedule%birth_delay(before + event) = self%births%delay(contact(event))
      end do
   end subroutine list_births

   !> Stiffness, limit and first stretch of the next lives of some contacts.
   subroutine list_lives(self, contact, direction, stiffness, limit, stretch)
      class(individual_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact(:)
      !> Sign of the velocity at which they attach
      real(wp), intent(in) :: direction
      !> Stiffness [N/m], stretch at breaking and at first [m] of each
      real(wp), intent(inout) :: stiffness(max_events), limit(max_events), stretch(max_events)

      real(wp) :: threshold(max_events), back_force, force
      integer :: event

      call self%draw_births(contact)
      back_force = direction * self%parameters%back_force_ratio * self%parameters%static_force
      ! Apart from the next loop, which is vectorized.
      do event = 1, size(contact)
         threshold(event) = self%record(row_next, contact(event))
      end do
      if (self%parameters%coupling == coupling_table) then
         do event = 1, size(contact)
            call bear(self%parameters, threshold(event), stiffness(event), limit(event))
            stretch(event) = back_force / stiffness(event)
         end do
      else
         do event = 1, size(contact)
            call bear_by_rule(self%parameters, threshold(event), stiffness(event), limit(event))
            stretch(event) = back_force / stiffness(event)
         end do
      end if
      if (self%parameters%keeps_thresholds) then
         do event = 1, size(contact)
            stretch(event) = direction * self%parameters%back_force_ratio * limit(event)
         end do
      end if
      if (.not. allocated(self%births%force)) return
      do event = 1, size(contact)
         call self%give_birth(contact(event), back_force, direction, stiffness(event), &
            & limit(event), force)
         if (self%parameters%keeps_thresholds) then
            force = force + direction * self%own_excess(stiffness(event), limit(event))
         end if
         stretch(event) = force / stiffness(event)
      end do
   end subroutine list_lives

   !> Draw all requested births if the next birth of one of some contacts has not been drawn.
   subroutine draw_births(self, contact)
      class(individual_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact(:)

      integer :: event

      do event = 1, size(contact)
         if (self%record(row_next, contact(event)) > 0.0_wp) cycle
         call self%births%draw(self%parameters, self%record)
         return
      end do
   end subroutine draw_births

   !> Stiffness, limit and force at the next birth of a contact, which has been drawn.
   pure subroutine give_birth(self, contact, mean_force, direction, stiffness, limit, force)
      class(individual_contacts_type), intent(in) :: self
      integer, intent(in) :: contact
      !> Mean force of a contact when it attaches, including that of its neighbours [N], and the
      !> sign of the velocity then
      real(wp), intent(in) :: mean_force, direction
      !> Stiffness [N/m], breaking stretch [m], force when it attaches [N]
      real(wp), intent(out) :: stiffness, limit, force

      call bear(self%parameters, self%record(row_next, contact), stiffness, limit)
      force = mean_force
      if (allocated(self%births%force)) force = mean_force + direction &
         & * self%parameters%static_force &
         & * (self%births%force(contact) - self%parameters%back_force_ratio)
   end subroutine give_birth

   !> Find the factor of the threshold of a contact that attaches where it is on the track.
   !>
   !> A contact that cannot bear the force with which it attaches is drawn again, as others are.
   subroutine fit_to_track(self, contact, mean_force, pose, factor, stiffness, limit, force)
      class(individual_contacts_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Mean force of a contact when it attaches, including that of its neighbours [N]
      real(wp), intent(in) :: mean_force
      type(pose_type), intent(in) :: pose
      !> Factor of the threshold
      real(wp), intent(out) :: factor
      !> Stiffness [N/m], breaking stretch without the factor [m], force when it attaches [N]
      real(wp), intent(inout) :: stiffness, limit, force

      real(wp) :: mean_own, threshold, ratio, excess
      integer :: attempt

      associate (static => pose%direction * self%parameters%static_force)
         mean_own = static * self%parameters%back_force_ratio
         factor = self%parameters%strength%factor(pose%displacement)
         attempt = 0
         do
            excess = pose%direction &
               & * self%own_excess(stiffness, factor * self%limit_at_birth(limit))
            if (abs(force + excess - mean_force + mean_own) &
               & < stiffness * (factor * self%limit_at_birth(limit)) .or. attempt < 0) exit
            call draw_again(self%parameters, self%record(:, contact), contact, attempt, &
               & threshold, ratio)
            call bear(self%parameters, threshold, stiffness, limit)
            force = mean_force - mean_own + static * ratio
         end do
      end associate
      force = force + excess
      if (allocated(self%births%factor)) self%births%factor(contact) = factor
   end subroutine fit_to_track

   !> Force at attaching of a contact that keeps its threshold, whose mean is a part of that, beyond
   !> that of other contacts [N]; 0 for those.
   pure function own_excess(self, stiffness, limit) result(force)
      class(individual_contacts_type), intent(in) :: self
      !> Stiffness [N/m] and breaking stretch when it attaches [m]
      real(wp), intent(in) :: stiffness, limit
      real(wp) :: force

      force = 0.0_wp
      if (self%parameters%keeps_thresholds) force = self%parameters%back_force_ratio &
         & * (stiffness * limit - self%parameters%static_force)
   end function own_excess

   !> Whether the next lives of contacts are known before they attach, up to the strength there.
   pure function knows_lives(self)
      class(individual_contacts_type), intent(in) :: self
      logical :: knows_lives

      ! Else the strength changes a part of the force at attaching only.
      knows_lives = .not. (self%parameters%keeps_thresholds .and. allocated(self%births%force) &
         & .and. self%parameters%strength%is_used)
   end function knows_lives

   !> Breaking stretch of a contact when it attaches: the configured one, of contacts that do not
   !> age.
   pure function limit_at_birth(self, limit) result(newborn)
      class(individual_contacts_type), intent(in) :: self
      !> Configured breaking stretch [m]
      real(wp), intent(in) :: limit
      real(wp) :: newborn

      newborn = limit
   end function limit_at_birth

   !> Update records and sums for the contacts that broke in a schedule.
   subroutine detach_listed(self, contact, schedule)
      class(individual_contacts_type), intent(inout) :: self
      !> The contacts that broke, in their order
      integer, intent(in) :: contact(:)
      type(schedule_type), intent(in) :: schedule

      integer :: event
      real(wp) :: delay

      delay = self%parameters%delay
      do event = 1, schedule%broken
         if (allocated(self%births%delay)) delay = self%births%delay(contact(event))
         self%record(row_stiffness, contact(event)) = 0.0_wp
         self%record(row_renewal, contact(event)) = self%record(row_renewal, contact(event)) &
            & + 1.0_wp
         call self%break_loss%add(0.5_wp * schedule%break_stiffness(event) &
            * (schedule%break_displacement(event) - schedule%break_origin(event))**2)
         call self%detached%push(contact(event), &
            & schedule%break_time(event) + delay, schedule%break_drag(event))
      end do
      self%breaks = self%breaks + schedule%broken
      self%stiffness = schedule%stiffness
      self%offset = schedule%offset
      self%drag = schedule%drag
   end subroutine detach_listed

   !> Update records for the contacts that attached in a schedule, after those that broke.
   subroutine attach_listed(self, schedule, contact)
      class(individual_contacts_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule
      !> The contacts that attached, in their order
      integer, intent(out) :: contact(:)

      integer :: event
      real(wp) :: drag

      do event = 1, schedule%attached
         call self%detached%pop(contact(event), drag)
         associate (record => self%record(:, contact(event)))
            record(row_origin) = schedule%attach_displacement(event) &
               & - schedule%attach_stretch(event)
            record(row_stiffness) = schedule%attach_stiffness(event)
            record(row_limit) = schedule%attach_limit(event)
            call self%birth_gain%add(0.5_wp * record(row_stiffness) &
               & * (schedule%attach_displacement(event) - record(row_origin))**2)
         end associate
         call self%births%request(contact(event), self%parameters, self%record)
      end do
   end subroutine attach_listed

   !> Update records for the sites that touched or separated in a schedule, after contacts broke and
   !> attached.
   subroutine move_listed(self, schedule, pose)
      class(individual_contacts_type), intent(inout) :: self
      type(schedule_type), intent(in) :: schedule
      type(pose_type), intent(in) :: pose

      type(pose_type) :: touching
      integer :: event

      touching = pose
      do event = 1, schedule%moved
         associate (contact => self%site_listed(event), stiffness => schedule%site_stiffness(event))
            if (schedule%site_touches(event)) then
               self%record(row_origin, contact) = schedule%site_displacement(event)
               self%record(row_stiffness, contact) = stiffness
               self%record(row_limit, contact) = self%site_limit(event)
               call self%births%request(contact, self%parameters, self%record)
               self%touches = .true.
               touching%time = schedule%site_time(event)
               touching%displacement = schedule%site_displacement(event)
               call self%join(contact, touching)
               self%touches = .false.
            else
               call self%leave(contact)
               self%record(row_stiffness, contact) = 0.0_wp
               self%record(row_renewal, contact) = self%record(row_renewal, contact) + 1.0_wp
               call self%separation_loss%add(0.5_wp * stiffness &
                  & * (schedule%site_displacement(event) - schedule%site_origin(event))**2)
            end if
         end associate
      end do
      call self%sites%take_previewed(self%parameters, schedule%site_touches(:schedule%moved))
      self%max_sites = min(max_events, min_sites + 2 * schedule%moved)
   end subroutine move_listed

   !> Sort all contacts again from the records, and recompute the bound behind.
   subroutine rebuild_queue(self, displacement)
      class(individual_contacts_type), intent(inout) :: self
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement

      call self%rebuild(displacement)
      self%behind = self%max_behind()
   end subroutine rebuild_queue

   !> Maximum coordinate at which any contact breaks after a reversal [m].
   pure function max_behind(self) result(coordinate)
      class(individual_contacts_type), intent(in) :: self
      real(wp) :: coordinate

      integer :: contact

      coordinate = -huge(1.0_wp)
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         coordinate = max(coordinate, self%behind_of(contact))
      end do
   end function max_behind

   !> Maximum coordinate at which a pinned contact breaks after a reversal [m].
   pure function behind_of(self, contact) result(coordinate)
      class(individual_contacts_type), intent(in) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      real(wp) :: coordinate

      coordinate = behind_coordinate(self%record(:, contact), self%direction)
   end function behind_of

   subroutine shift_origin(self, shift, displacement)
      class(individual_contacts_type), intent(inout) :: self
      real(wp), intent(in) :: shift
      real(wp), intent(in) :: displacement

      integer :: contact

      do contact = 1, self%parameters%count
         self%record(row_origin, contact) = self%record(row_origin, contact) - shift
      end do
      self%parameters%strength%origin = self%parameters%strength%origin + shift
      call self%sum_totals()
      call self%shift_order(shift)
      call self%rebuild_queue(displacement)
   end subroutine shift_origin

   !> Shift the origin in further data of a kind, after the records; by default there are none.
   subroutine shift_order(self, shift)
      class(individual_contacts_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

   end subroutine shift_order

   subroutine take_extent(self, extent)
      class(individual_contacts_type), intent(inout) :: self
      integer, intent(out) :: extent(extent_length)

      extent(1) = self%track%area
      call self%track%extent(extent(2), extent(3))
      extent(4) = self%track%generation
      call self%track%clear()
   end subroutine take_extent

   !> State of each contact, without the forces of neighbours.
   pure subroutine snapshot_individual(self, time, displacement, values)
      class(individual_contacts_type), intent(in) :: self
      real(wp), intent(in) :: time, displacement
      real(wp), intent(out) :: values(:, :)

      real(wp) :: now(contact_record_length, snapshot_block)
      integer :: first, last, contact

      do first = 1, self%parameters%count, snapshot_block
         last = min(first + snapshot_block - 1, self%parameters%count)
         ! Present thresholds, which are not in the records of ageing contacts.
         call self%records(time, first, now(:, :last - first + 1))
         do contact = first, last
            values(:, contact) = [huge(1.0_wp), 0.0_wp, 0.0_wp]
            if (self%track%columns > 0) then
               values(3, contact) = real(self%track%contact(row_generation, contact), wp)
            end if
            associate (one => now(:, contact - first + 1))
               if (.not. one(2) > 0.0_wp) cycle
               values(1, contact) = displacement - one(1)
               values(2, contact) = values(1, contact) / one(3)
            end associate
         end do
      end do
   end subroutine snapshot_individual

   !> Recompute stiffness and offset from the records.
   subroutine sum_totals(self)
      class(individual_contacts_type), intent(inout) :: self

      integer :: contact

      self%stiffness = accumulator_type()
      self%offset = accumulator_type()
      do contact = 1, self%parameters%count
         call self%stiffness%add(self%record(row_stiffness, contact))
         call self%offset%add(self%record(row_stiffness, contact) &
            & * self%record(row_origin, contact))
      end do
   end subroutine sum_totals

   pure function elastic_energy(self, displacement) result(energy)
      class(individual_contacts_type), intent(in) :: self
      real(wp), intent(in) :: displacement
      real(wp) :: energy

      integer :: contact
      type(accumulator_type) :: total

      do contact = 1, self%parameters%count
         call total%add(0.5_wp * self%record(row_stiffness, contact) &
            & * (displacement - self%record(row_origin, contact))**2)
      end do
      energy = total%total()
   end function elastic_energy

   pure function individual_count(self) result(number)
      class(individual_contacts_type), intent(in) :: self
      integer :: number

      number = self%parameters%count
   end function individual_count

   pure subroutine records(self, time, first, values)
      class(individual_contacts_type), intent(in) :: self
      real(wp), intent(in) :: time
      integer, intent(in) :: first
      real(wp), intent(out) :: values(:, :)

      values = self%record([row_origin, row_stiffness, row_limit, row_renewal], &
         & first:first + size(values, 2) - 1)
   end subroutine records

   !> Write the state to an archive, or read it.
   subroutine exchange_individual(self, archive)
      class(individual_contacts_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call self%births%draw(self%parameters, self%record)
      call exchange_contacts(self, archive)
      call archive%exchange("record", self%record)
      call self%births%exchange(archive)
      call self%sites%exchange(self%parameters, archive)
      call self%detached%exchange(archive)
      call archive%exchange("stiffness", self%stiffness)
      call archive%exchange("offset", self%offset)
      call archive%exchange("drag", self%drag)
      call archive%exchange("direction", self%direction)
      call archive%exchange("behind", self%behind)
      call self%track%exchange(archive)
   end subroutine exchange_individual

end module mesoslip_contacts_individual_base
