!> N independent contacts: the earthquake-like model without interaction.
!>
!> Contacts are queued for one direction of motion. Breaking in the other direction has a bound; the
!> queue is rebuilt when the slider reverses.
module mesoslip_contacts_ensemble
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_base, only: exchange_individual, individual_contacts_type, &
      & total_law
   use mesoslip_contacts_individual_births, only: drag_of
   use mesoslip_contacts_individual_queue, only: contact_queue_type, new_contact_queue
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_stiffness, &
      & ahead_coordinate
   use mesoslip_schedule, only: max_events, schedule_type
   implicit none
   private

   public :: make_contact_ensemble

   !> Probability of a threshold beyond the ring of buckets
   real(wp), parameter :: rare = 1.0e-4_wp
   !> Attachments in a schedule of backward motion
   integer, parameter :: events_back = 8
   !> Normal deviate beyond which few newborn forces lie
   real(wp), parameter :: far_newborn = 4.0_wp

   !> An ensemble of independent contacts.
   type, extends(individual_contacts_type) :: contact_ensemble_type
      type(contact_queue_type), private :: queue
      !> Contacts of the breaks in the schedule
      integer, private :: listed(max_events) = 0
   contains
      procedure :: initialize, offer, respond, plan, settle, join, leave, exchange, rebuild
      procedure, non_overridable, private :: break_due, plan_back
   end type contact_ensemble_type

contains

   !> Set up an ensemble from named parameters.
   subroutine make_contact_ensemble(contacts, common, parameters, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> Parameters that all kinds of contacts have
      type(contact_parameters_type), intent(in) :: common
      !> The others: columns and rows of the lattice on whose sites contacts are, 0 without one
      type(parameters_type), intent(inout) :: parameters
      !> Set if a parameter is missing, or there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      type(contact_ensemble_type), allocatable :: ensemble
      integer :: columns, rows
      real(wp) :: max_distance

      call parameters%take("columns", columns, error)
      call parameters%take("rows", rows, error)
      call parameters%finish(error)
      if (allocated(error)) return
      allocate (ensemble)
      ensemble%parameters = common
      ensemble%keeps_offers = .true.
      call ensemble%allocate_records(columns, rows, error)
      if (allocated(error)) return
      ! Otherwise the threshold of a contact that touches is one of its own, or by its place.
      ensemble%lists_sites = .not. (allocated(ensemble%births%force) .or. common%strength%is_used)
      ! A contact that attaches in backward motion starts with the back force against the direction.
      max_distance = common%static_force / common%stiffness &
         & * max(common%law%quantile(rare), 1.0_wp) * (1.0_wp + common%back_force_ratio &
         & + far_newborn * common%newborn_width) * common%strength%usual_max()
      call new_contact_queue(ensemble%queue, common%count, 1.1_wp * max_distance, error)
      call move_alloc(ensemble, contacts)
   end subroutine make_contact_ensemble

   subroutine initialize(self, state)
      class(contact_ensemble_type), intent(inout) :: self
      integer, intent(in) :: state

      call self%draw(state)
      call self%rebuild_queue(0.0_wp)
   end subroutine initialize

   subroutine offer(self, pose, law, window)
      class(contact_ensemble_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      law = total_law(self)
      window = self%window_between(self%behind, self%queue%first_key, self%detached%next_due)
   end subroutine offer

   !> Break all contacts that are due, then attach those that are due, in the order of breaking.
   subroutine respond(self, before, after)
      class(contact_ensemble_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      call self%break_due(after%displacement, after%time)
      call self%attach_due(after)
   end subroutine respond

   !> The schedule has the sorted breaks at the front of the queue, and about as many attachments.
   subroutine plan(self, pose, limit, schedule)
      class(contact_ensemble_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      integer, intent(in) :: limit
      type(schedule_type), intent(inout) :: schedule

      integer :: number, event, contact(max_events)

      schedule%is_over = .true.
      schedule%at_bound = .false.
      if (self%track%columns > 0 .or. .not. self%knows_lives()) return
      schedule%is_bounded = pose%direction * self%direction < 0.0_wp
      if (schedule%is_bounded) then
         call self%plan_back(min(limit, max_events), schedule)
         return
      end if
      call self%queue%preview(self%record, min(limit, max_events), self%listed, &
         & schedule%break_coordinate, number)
      if (number == 0) return
      do event = 1, number
         schedule%break_origin(event) = self%record(row_origin, self%listed(event))
         schedule%break_stiffness(event) = self%record(row_stiffness, self%listed(event))
         schedule%break_drag(event) = drag_of(self%parameters, schedule%break_stiffness(event))
      end do
      schedule%breaks = number
      schedule%broken = 0
      schedule%moments = 0
      schedule%direction = self%direction
      schedule%behind = self%behind
      call self%list_attachments(min(limit, max_events, number + 4), pose%direction, schedule, &
         & contact)
      call self%list_births(self%listed(:number), 0, pose%direction, schedule)
      call self%list_sites(min(limit, max_events), self%listed(:number), schedule)
      schedule%is_over = .false.
   end subroutine plan

   !> Write a schedule of backward motion: attachments, up to where a contact may break.
   subroutine plan_back(self, limit, schedule)
      class(contact_ensemble_type), intent(inout) :: self
      !> Maximum number of events of a kind
      integer, intent(in) :: limit
      !> The schedule
      type(schedule_type), intent(inout) :: schedule

      integer :: contact(max_events)

      schedule%direction = -self%direction
      schedule%breaks = 1
      schedule%broken = 0
      schedule%moments = 0
      schedule%break_coordinate(1) = -self%behind
      schedule%behind = -self%queue%first_key
      call self%list_attachments(min(limit, events_back), schedule%direction, schedule, contact)
      call self%list_sites(limit, [integer ::], schedule)
      schedule%has_births = .false.
      schedule%is_over = .false.
   end subroutine plan_back

   subroutine settle(self, schedule, pose)
      class(contact_ensemble_type), intent(inout) :: self
      type(schedule_type), intent(inout) :: schedule
      type(pose_type), intent(in) :: pose

      integer :: event, contact(max_events)

      call self%detach_listed(self%listed(:schedule%broken), schedule)
      if (schedule%broken > 0) call self%queue%remove_previewed(self%record, schedule%broken)
      call self%attach_listed(schedule, contact)
      if (schedule%is_bounded) then
         do event = 1, schedule%attached
            call self%join(contact(event), pose)
         end do
      else
         do event = 1, schedule%attached
            call self%queue%insert(contact(event), &
               & ahead_coordinate(self%record(:, contact(event)), self%direction))
         end do
         self%behind = schedule%behind
      end if
      call self%move_listed(schedule, pose)
      ! A contact that broke just now and attaches at once was not in the schedule.
      if (schedule%is_over) call self%attach_due(pose)
      self%detached_count = real(self%detached%count, wp)
   end subroutine settle

   subroutine join(self, contact, pose)
      class(contact_ensemble_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: origin, limit

      origin = self%record(row_origin, contact)
      limit = self%record(row_limit, contact)
      call self%queue%insert(contact, self%direction * origin + limit)
      self%behind = max(self%behind, self%direction * origin - limit)
   end subroutine join

   subroutine leave(self, contact)
      class(contact_ensemble_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%queue%remove(self%record, contact)
   end subroutine leave

   !> Break all contacts that are due.
   subroutine break_due(self, displacement, time)
      class(contact_ensemble_type), intent(inout) :: self
      real(wp), intent(in) :: displacement, time

      integer :: contact

      if (self%direction * displacement <= self%behind) then
         ! The bound may be that of a contact that has since broken.
         self%behind = self%max_behind()
         if (self%direction * displacement <= self%behind) then
            self%direction = -self%direction
            call self%rebuild_queue(displacement)
         end if
      end if
      if (self%queue%first_key > self%direction * displacement) return
      do while (self%queue%first_key <= self%direction * displacement)
         call self%queue%pop(self%record, contact)
         call self%detach(contact, displacement, time)
      end do
      self%track%generation = self%track%generation + 1
   end subroutine break_due

   subroutine rebuild(self, displacement)
      class(contact_ensemble_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      integer :: contact

      call self%queue%clear(self%direction, self%direction * displacement)
      do contact = 1, self%parameters%count
         if (self%record(row_stiffness, contact) > 0.0_wp) then
            call self%queue%insert(contact, &
               & ahead_coordinate(self%record(:, contact), self%direction))
         end if
      end do
   end subroutine rebuild

   subroutine exchange(self, archive)
      class(contact_ensemble_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("contact ensemble")
      call exchange_individual(self, archive)
   end subroutine exchange

end module mesoslip_contacts_ensemble
