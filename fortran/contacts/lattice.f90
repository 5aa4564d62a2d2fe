!> Contacts on a lattice that interact with their neighbours and break in avalanches.
!>
!> The force that breaks a contact is f_i = k_i x_i + G sum_j (x_i - x_j) over its neighbours, with
!> x_j = 0 for a detached one. While no neighbour breaks or attaches it grows with the displacement
!> at the rate k_i + G n_i, n_i neighbours being detached: breaks are events in the displacement,
!> which move when a neighbour breaks or attaches. Each contact keeps sums over its neighbours,
!> which change by one neighbour at a time and are recomputed when the contact attaches. The order
!> of breaking is that of one direction of motion. Breaking in the other direction has a bound; the
!> order is rebuilt when the slider reaches it.
module mesoslip_contacts_lattice
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   use mesoslip_numerics_archive, only: archive_type
   use mesoslip_numerics_memory, only: request_large_pages
   use mesoslip_numerics_parameters, only: parameters_type
   use mesoslip_numerics_errors, only: error_type, raise, status_invalid, status_memory, &
      & status_stalled
   use mesoslip_interface_law, only: interface_law_type, pose_type, window_type
   use mesoslip_contacts_base, only: contact_parameters_type, contacts_type
   use mesoslip_contacts_individual_base, only: exchange_individual, individual_contacts_type, &
      & snapshot_individual, total_law
   use mesoslip_contacts_individual_break_tree, only: break_tree_type, new_break_tree
   use mesoslip_contacts_individual_neighbours, only: coordination, find_neighbours, &
      & lattice_names, max_neighbours
   use mesoslip_contacts_individual_record, only: record_length, row_limit, row_origin, &
      & row_stiffness
   implicit none
   private

   public :: contact_lattice_type, interaction_type, new_contact_lattice, make_contact_lattice

   !> A cascade of more breaks is considered endless: max_breaks a contact or max_all_breaks in all,
   !> whichever is fewer, but at least min_breaks a contact. A cascade is not cut into segments.
   real(wp), parameter :: max_breaks = 1000.0_wp, max_all_breaks = 1.0e7_wp, min_breaks = 20.0_wp

   !> Sums over the neighbours of a pinned contact: of the pinned ones, their origin minus its own
   !> [m]; the number of detached ones
   integer, parameter :: surroundings_length = 2, row_ahead = 1, row_free = 2

   !> Interaction of contacts.
   type :: interaction_type
      !> Stiffness of the bond between neighbours, G [N/m]
      real(wp) :: bond = 0.0_wp
      !> One of the lattice_ codes
      integer :: lattice = 0
      !> Columns and rows of the lattice
      integer :: columns = 0, rows = 0
   end type interaction_type

   !> Contacts on a lattice.
   type, extends(individual_contacts_type) :: contact_lattice_type
      !> Stiffness of a bond [N/m]
      real(wp), private :: bond = 0.0_wp
      !> One of the lattice_ codes, and the number of neighbours of each contact
      integer, private :: lattice = 0, sides = 0
      !> Sums over the neighbours of each contact, shape (surroundings_length, count)
      real(wp), allocatable, private :: surroundings(:, :)
      !> Contacts of one generation, which break together
      integer, allocatable, private :: generation(:)
      type(break_tree_type), private :: tree
   contains
      procedure :: initialize, offer, respond, join, behind_of, neighbour_force, shift_order
      procedure :: rebuild, snapshot, exchange
      procedure, private, non_overridable :: cascade, list_due, list_behind, sum_neighbours, &
         & update_neighbours, neighbours_of
   end type contact_lattice_type

contains

   !> Set up contacts on a lattice.
   subroutine new_contact_lattice(self, parameters, interaction, error)
      type(contact_lattice_type), intent(out) :: self
      !> Parameters of the contacts
      type(contact_parameters_type), intent(in) :: parameters
      !> Their interaction
      type(interaction_type), intent(in) :: interaction
      !> Set if the lattice does not hold as many contacts, or there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      integer :: stat

      self%lattice = interaction%lattice
      self%sides = coordination(interaction%lattice)
      if (self%sides == 0 .or. interaction%columns < 1) then
         call raise(error, status_invalid, "unknown lattice")
         return
      end if
      self%parameters = parameters
      self%bond = interaction%bond
      self%bonds = real(self%sides, wp) * interaction%bond
      call self%allocate_records(interaction%columns, interaction%rows, error)
      if (allocated(error)) return
      allocate (self%generation(parameters%count), stat=stat)
      if (stat == 0) allocate (self%surroundings(surroundings_length, parameters%count), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the neighbours of contacts")
         return
      end if
      call request_large_pages(self%surroundings, size(self%surroundings))
      self%surroundings = 0.0_wp
      call new_break_tree(self%tree, parameters%count, error)
   end subroutine new_contact_lattice

   !> Set up contacts on a lattice from named parameters.
   subroutine make_contact_lattice(contacts, common, parameters, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> Parameters that all kinds of contacts have
      type(contact_parameters_type), intent(in) :: common
      !> The others: bond, lattice, columns and rows
      type(parameters_type), intent(inout) :: parameters
      !> Set if a parameter is missing or wrong, or there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

      type(contact_lattice_type), allocatable :: lattice
      type(interaction_type) :: interaction

      call parameters%take("bond", interaction%bond, error)
      call parameters%take("lattice", lattice_names, interaction%lattice, error)
      call parameters%take("columns", interaction%columns, error)
      call parameters%take("rows", interaction%rows, error)
      call parameters%finish(error)
      if (allocated(error)) return
      allocate (lattice)
      call new_contact_lattice(lattice, common, interaction, error)
      call move_alloc(lattice, contacts)
   end subroutine make_contact_lattice

   !> Contacts that cannot bear the forces of their neighbours break first.
   subroutine initialize(self, state)
      class(contact_lattice_type), intent(inout) :: self
      integer, intent(in) :: state

      call self%draw(state)
      call self%shift_order(0.0_wp)
      call self%rebuild_queue(0.0_wp)
      call self%respond(pose_type(), pose_type())
      call self%track%clear()
      self%breaks = 0.0_wp
      self%break_loss = accumulator_type()
      self%birth_gain = accumulator_type()
   end subroutine initialize

   subroutine offer(self, pose, law, window)
      class(contact_lattice_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      type(interface_law_type), intent(out) :: law
      type(window_type), intent(out) :: window

      law = total_law(self)
      window = self%window_between(self%behind, self%tree%first(), self%detached%next_due)
   end subroutine offer

   !> Break all contacts that are due and those that these push over, then attach contacts.
   subroutine respond(self, before, after)
      class(contact_lattice_type), intent(inout) :: self
      type(pose_type), intent(in) :: before, after

      real(wp) :: breaks, limit

      breaks = self%breaks
      limit = min(max_breaks * self%parameters%count, &
         & max(max_all_breaks, min_breaks * self%parameters%count))
      do
         call self%cascade(after)
         if (self%detached%next_due > after%time) exit
         if (self%breaks - breaks > limit) then
            call raise(self%failure, status_stalled, "a cascade of contacts that break and " // &
               & "attach at once does not end: a delay (contacts.delay) or a weaker " // &
               & "interaction (interaction.strength) would end it")
            exit
         end if
         call self%attach_due(after)
      end do
      self%detached_count = real(self%detached%count, wp)
   end subroutine respond

   !> Break all contacts that are due, then those that these push over, until no more break.
   subroutine cascade(self, pose)
      class(contact_lattice_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: number, listed

      do
         call self%list_due(pose, number)
         if (number == 0) return
         do listed = 1, number
            call self%detach(self%generation(listed), pose%displacement, pose%time)
         end do
         do listed = 1, number
            call self%update_neighbours(self%generation(listed), -1.0_wp)
         end do
         self%track%generation = self%track%generation + 1
      end do
   end subroutine cascade

   !> Remove all contacts that are due from the order of breaking, and list them.
   subroutine list_due(self, pose, number)
      class(contact_lattice_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> Their number
      integer, intent(out) :: number

      integer :: contact

      if (self%direction * pose%direction < 0.0_wp &
         & .and. self%direction * pose%displacement <= self%behind) then
         self%direction = -self%direction
         call self%rebuild_queue(pose%displacement)
      end if
      number = 0
      do
         contact = self%tree%due(self%direction * pose%displacement)
         if (contact == 0) exit
         call self%tree%remove(contact)
         number = number + 1
         self%generation(number) = contact
      end do
      if (self%direction * pose%displacement <= self%behind) then
         call self%list_behind(pose%displacement, number)
      end if
   end subroutine list_due

   !> The same for contacts that their neighbours push over against the direction of motion.
   subroutine list_behind(self, displacement, number)
      class(contact_lattice_type), intent(inout) :: self
      real(wp), intent(in) :: displacement
      !> Number of listed contacts
      integer, intent(inout) :: number

      integer :: contact
      real(wp) :: centre, limit

      ! The bound may be that of a contact that has since broken, or now breaks elsewhere.
      self%behind = -huge(1.0_wp)
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         call bearing(self%record(:, contact), self%surroundings(:, contact), self%bond, centre, &
            & limit)
         if (self%direction * displacement <= self%direction * centre - limit) then
            call self%tree%remove(contact)
            number = number + 1
            self%generation(number) = contact
         else
            self%behind = max(self%behind, self%direction * centre - limit)
         end if
      end do
   end subroutine list_behind

   pure function behind_of(self, contact) result(coordinate)
      class(contact_lattice_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp) :: coordinate

      real(wp) :: centre, limit

      call bearing(self%record(:, contact), self%surroundings(:, contact), self%bond, centre, limit)
      coordinate = self%direction * centre - limit
   end function behind_of

   pure function neighbour_force(self, contact, displacement) result(force)
      class(contact_lattice_type), intent(in) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: displacement
      real(wp) :: force

      integer :: side, neighbour(max_neighbours)
      real(wp) :: pull

      neighbour = self%neighbours_of(contact)
      pull = 0.0_wp
      do side = 1, self%sides
         associate (record => self%record(:, neighbour(side)))
            if (record(row_stiffness) > 0.0_wp) pull = pull + (displacement - record(row_origin))
         end associate
      end do
      force = self%bond * pull
   end function neighbour_force

   !> Neighbours now break elsewhere.
   subroutine join(self, contact, pose)
      class(contact_lattice_type), intent(inout) :: self
      integer, intent(in) :: contact
      type(pose_type), intent(in) :: pose

      real(wp) :: centre, limit

      call self%sum_neighbours(contact)
      call bearing(self%record(:, contact), self%surroundings(:, contact), self%bond, centre, limit)
      call self%tree%set(contact, self%direction * centre + limit)
      self%behind = max(self%behind, self%direction * centre - limit)
      call self%update_neighbours(contact, 1.0_wp)
   end subroutine join

   !> Neighbours of a contact.
   pure function neighbours_of(self, contact) result(neighbour)
      class(contact_lattice_type), intent(in) :: self
      integer, intent(in) :: contact
      !> Their numbers, of which the first ones are used
      integer :: neighbour(max_neighbours)

      call find_neighbours(self%lattice, self%track%columns, self%track%rows, contact, neighbour)
   end function neighbours_of

   !> Compute the sums of a contact over its neighbours.
   pure subroutine sum_neighbours(self, contact)
      class(contact_lattice_type), intent(inout) :: self
      integer, intent(in) :: contact

      integer :: side, neighbour(max_neighbours)
      real(wp) :: ahead, free, is_pinned

      neighbour = self%neighbours_of(contact)
      ahead = 0.0_wp
      free = 0.0_wp
      do side = 1, self%sides
         associate (record => self%record(:, neighbour(side)))
            is_pinned = merge(1.0_wp, 0.0_wp, record(row_stiffness) > 0.0_wp)
            ahead = ahead + is_pinned * (record(row_origin) - self%record(row_origin, contact))
            free = free + (1.0_wp - is_pinned)
         end associate
      end do
      self%surroundings(:, contact) = [ahead, free]
   end subroutine sum_neighbours

   !> Update the neighbours of a contact that broke (change -1) or attached (+1).
   subroutine update_neighbours(self, contact, change)
      class(contact_lattice_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: change

      ! The number of neighbours is a constant in each call, for which the compiler makes a copy.
      if (self%sides == 6) then
         call update_all(contact, change, 6, self%neighbours_of(contact), self%parameters%count, &
            & self%record, self%surroundings, self%bond, self%direction, self%tree, self%behind)
      else
         call update_all(contact, change, 4, self%neighbours_of(contact), self%parameters%count, &
            & self%record, self%surroundings, self%bond, self%direction, self%tree, self%behind)
      end if
   end subroutine update_neighbours

   !> Update where the pinned neighbours of a contact break after it broke or attached.
   pure subroutine update_all(contact, change, sides, neighbour, count, record, surroundings, &
      & bond, direction, tree, behind)
      !> The contact, the number of its neighbours and of all contacts, and the neighbours
      integer, intent(in) :: contact, sides, count, neighbour(max_neighbours)
      !> -1 if the contact broke, +1 if it attached
      real(wp), intent(in) :: change
      real(wp), intent(in) :: record(record_length, count)
      real(wp), intent(inout) :: surroundings(surroundings_length, count)
      real(wp), intent(in) :: bond, direction
      type(break_tree_type), intent(inout) :: tree
      !> Upper bound of the coordinates at which contacts break in backward motion [m]
      real(wp), intent(inout) :: behind

      integer :: side
      real(wp) :: origin, centre, limit

      origin = record(row_origin, contact)
      do side = 1, sides
         associate (other => neighbour(side))
            if (.not. record(row_stiffness, other) > 0.0_wp) cycle
            surroundings(row_ahead, other) = surroundings(row_ahead, other) &
               & + change * (origin - record(row_origin, other))
            surroundings(row_free, other) = surroundings(row_free, other) - change
            call bearing(record(:, other), surroundings(:, other), bond, centre, limit)
            call tree%set(other, direction * centre + limit)
            behind = max(behind, direction * centre - limit)
         end associate
      end do
   end subroutine update_all

   !> Displacement at which a pinned contact bears no force, and distance from there to breaking.
   pure subroutine bearing(record, surroundings, bond, centre, limit)
      real(wp), intent(in) :: record(record_length), surroundings(surroundings_length), bond
      real(wp), intent(out) :: centre, limit

      real(wp) :: relative, softness

      ! f_i = k_i [(X - Y_i) (1 + G n_i/k_i) + G/k_i sum (Y_j - Y_i)], the sum over the pinned.
      relative = bond / record(row_stiffness)
      softness = 1.0_wp / (1.0_wp + relative * surroundings(row_free))
      centre = record(row_origin) - relative * surroundings(row_ahead) * softness
      limit = record(row_limit) * softness
   end subroutine bearing

   !> Recompute the sums of differences of origins, which change by rounding alone.
   subroutine shift_order(self, shift)
      class(contact_lattice_type), intent(inout) :: self
      real(wp), intent(in) :: shift

      integer :: contact

      do contact = 1, self%parameters%count
         call self%sum_neighbours(contact)
      end do
   end subroutine shift_order

   subroutine rebuild(self, displacement)
      class(contact_lattice_type), intent(inout) :: self
      real(wp), intent(in) :: displacement

      integer :: contact
      real(wp) :: centre, limit

      call self%tree%clear()
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         call bearing(self%record(:, contact), self%surroundings(:, contact), self%bond, centre, &
            & limit)
         call self%tree%put(contact, self%direction * centre + limit)
      end do
      call self%tree%arrange()
   end subroutine rebuild

   pure subroutine snapshot(self, time, displacement, values)
      class(contact_lattice_type), intent(in) :: self
      real(wp), intent(in) :: time, displacement
      real(wp), intent(out) :: values(:, :)

      integer :: contact
      real(wp) :: centre, limit

      call snapshot_individual(self, time, displacement, values)
      do contact = 1, self%parameters%count
         if (.not. self%record(row_stiffness, contact) > 0.0_wp) cycle
         call bearing(self%record(:, contact), self%surroundings(:, contact), self%bond, centre, &
            & limit)
         values(2, contact) = (displacement - centre) / limit
      end do
   end subroutine snapshot

   subroutine exchange(self, archive)
      class(contact_lattice_type), intent(inout) :: self
      type(archive_type), intent(inout) :: archive

      call archive%section("contact lattice")
      call exchange_individual(self, archive)
      call archive%exchange("surroundings", self%surroundings)
   end subroutine exchange

end module mesoslip_contacts_lattice
