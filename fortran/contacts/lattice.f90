!> Contacts on a lattice that push their neighbours over: when they break, and in what avalanches.
!>
!> The force that breaks a contact is f_i = k_i x_i + G sum_j (x_i - x_j) over its neighbours, with
!> x_j = 0 for a detached one. While neighbours stay as they are it grows with the displacement at
!> the rate k_i + G n_i, n_i of them being detached: breaks are events in the displacement, which
!> move when a neighbour breaks or attaches. Each contact keeps what its neighbours are to it, a sum
!> that changes by one of them at a time, recomputed when it attaches. The order of breaking is kept
!> for one direction of motion; what breaks on the way back is bounded, and the order rebuilt when
!> the slider comes to the bound.
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

   !> Breaks in one cascade beyond which it is taken to have no end: of each contact on average, and
   !> of all, unless these are fewer for each than the last. A cascade is not cut into segments.
   real(wp), parameter :: max_breaks = 1000.0_wp, max_all_breaks = 1.0e7_wp, min_breaks = 20.0_wp

   !> Influence of the neighbours on a pinned contact: the sum, over the pinned ones, of the lead of
   !> their origins over its own [m], and the number of detached ones
   integer, parameter :: surroundings_length = 2, row_ahead = 1, row_free = 2

   !> How contacts act on each other.
   type :: interaction_type
      !> Stiffness of the bond between neighbours, G [N/m]; 0 for none
      real(wp) :: bond = 0.0_wp
      !> One of the lattice_ codes
      integer :: lattice = 0
      !> Columns and rows of the lattice; no columns when contacts are not on one
      integer :: columns = 0, rows = 0
   end type interaction_type

   !> Contacts on a lattice.
   type, extends(individual_contacts_type) :: contact_lattice_type
      !> Stiffness of a bond [N/m]
      real(wp), private :: bond = 0.0_wp
      !> One of the lattice_ codes, and the number of neighbours of each contact
      integer, private :: lattice = 0, sides = 0
      !> Their influence on it while it is pinned, shape (surroundings_length, count)
      real(wp), allocatable, private :: surroundings(:, :)
      !> Contacts that let go together
      integer, allocatable, private :: generation(:)
      type(break_tree_type), private :: tree
   contains
      procedure :: initialize
      procedure :: offer
      procedure :: respond
      procedure :: join
      procedure :: behind_of
      procedure :: neighbour_force
      procedure :: shift_order
      procedure :: rebuild
      procedure :: snapshot
      procedure :: exchange
      procedure, private, non_overridable :: cascade, list_due, list_behind, sum_neighbours, &
         & update_neighbours, neighbours_of
   end type contact_lattice_type

contains

   !> Set up contacts on a lattice.
   subroutine new_contact_lattice(self, parameters, interaction, error)
      type(contact_lattice_type), intent(out) :: self
      !> Parameters of the contacts
      type(contact_parameters_type), intent(in) :: parameters
      !> How they act on each other
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

   !> Set up contacts on a lattice from named numbers.
   subroutine make_contact_lattice(contacts, common, parameters, error)
      !> The contacts
      class(contacts_type), allocatable, intent(out) :: contacts
      !> Parameters that all kinds of contacts have
      type(contact_parameters_type), intent(in) :: common
      !> The other numbers: bond, lattice, columns and rows
      type(parameters_type), intent(inout) :: parameters
      !> Set if a number is missing or wrong, or there is not enough memory
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

   !> Draw all contacts for the start of a run, and let go those that cannot bear their neighbours.
   subroutine initialize(self, state)
      class(contact_lattice_type), intent(inout) :: self
      !> One of the initial_ codes
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

   !> Contact force as a law, which holds until a contact breaks or attaches.
   subroutine offer(self, pose, law, window)
      class(contact_lattice_type), intent(inout) :: self
      !> Pose of the slider
      type(pose_type), intent(in) :: pose
      !> The law
      type(interface_law_type), intent(out) :: law
      !> Range in which it holds; a contact may break at the end that is behind
      type(window_type), intent(out) :: window

      law = total_law(self)
      window = self%window_between(self%behind, self%tree%first(), self%detached%next_due)
   end subroutine offer

   !> Break all contacts that are due and those that they push over, then attach what is to attach.
   subroutine respond(self, before, after)
      class(contact_lattice_type), intent(inout) :: self
      !> Pose of the slider before the motion, and after it
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

   !> Break all contacts that are due, then those that they push over, until none is left.
   subroutine cascade(self, pose)
      class(contact_lattice_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose

      integer :: number, listed

      do
         call self%list_due(pose, number)
         if (number == 0) return
         self%track%generation = self%track%generation + 1
         do listed = 1, number
            call self%detach(self%generation(listed), pose%displacement, pose%time)
         end do
         do listed = 1, number
            call self%update_neighbours(self%generation(listed), -1.0_wp)
         end do
      end do
   end subroutine cascade

   !> Take all contacts that are due out of the order of breaking.
   subroutine list_due(self, pose, number)
      class(contact_lattice_type), intent(inout) :: self
      type(pose_type), intent(in) :: pose
      !> How many they are
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

   !> The same of contacts that their neighbours push over against the direction of motion.
   subroutine list_behind(self, displacement, number)
      class(contact_lattice_type), intent(inout) :: self
      real(wp), intent(in) :: displacement
      !> How many are listed
      integer, intent(inout) :: number

      integer :: contact
      real(wp) :: centre, limit

      ! The bound may be that of a contact which has broken since, or breaks elsewhere now.
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

   !> Greatest coordinate at which a pinned contact breaks on the way back.
   pure function behind_of(self, contact) result(coordinate)
      class(contact_lattice_type), intent(in) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> The coordinate [m]
      real(wp) :: coordinate

      real(wp) :: centre, limit

      call bearing(self%record(:, contact), self%surroundings(:, contact), self%bond, centre, limit)
      coordinate = self%direction * centre - limit
   end function behind_of

   !> Force of its neighbours on a contact that attaches.
   pure function neighbour_force(self, contact, displacement) result(force)
      class(contact_lattice_type), intent(in) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Displacement of the slider [m]
      real(wp), intent(in) :: displacement
      !> Force of the neighbours where the stretch of the contact is zero [N]
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

   !> Put a contact that has attached into the order of breaking; its neighbours break elsewhere
   !> now.
   subroutine join(self, contact, pose)
      class(contact_lattice_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Pose of the slider
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
      !> Their numbers, as many as there are sides
      integer :: neighbour(max_neighbours)

      call find_neighbours(self%lattice, self%track%columns, self%track%rows, contact, neighbour)
   end function neighbours_of

   !> Sum what a contact keeps of its neighbours.
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

   !> Neighbours of a contact that broke (change -1) or attached (+1) break elsewhere now.
   subroutine update_neighbours(self, contact, change)
      class(contact_lattice_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: change

      ! The number of neighbours is a constant in each call: the compiler makes a copy for each.
      if (self%sides == 6) then
         call update_all(contact, change, 6, self%neighbours_of(contact), self%parameters%count, &
            & self%record, self%surroundings, self%bond, self%direction, self%tree, self%behind)
      else
         call update_all(contact, change, 4, self%neighbours_of(contact), self%parameters%count, &
            & self%record, self%surroundings, self%bond, self%direction, self%tree, self%behind)
      end if
   end subroutine update_neighbours

   !> Update where the pinned neighbours of a contact break that broke or attached.
   pure subroutine update_all(contact, change, sides, neighbour, count, record, surroundings, &
      & bond, direction, tree, behind)
      !> The contact, -1 if it broke and +1 if it attached, and its neighbours, of so many in all
      integer, intent(in) :: contact, sides, count, neighbour(max_neighbours)
      real(wp), intent(in) :: change
      real(wp), intent(in) :: record(record_length, count)
      real(wp), intent(inout) :: surroundings(surroundings_length, count)
      real(wp), intent(in) :: bond, direction
      type(break_tree_type), intent(inout) :: tree
      !> Bound on the coordinates at which contacts break on the way back [m]
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

   !> Displacement at which a pinned contact bears no force, and how far from there it breaks.
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

   !> Sum what contacts keep of their neighbours, which differences of origins are.
   subroutine shift_order(self, shift)
      class(contact_lattice_type), intent(inout) :: self
      !> Displacement of the new origin [m]
      real(wp), intent(in) :: shift

      integer :: contact

      do contact = 1, self%parameters%count
         call self%sum_neighbours(contact)
      end do
   end subroutine shift_order

   !> Recompute the order of breaking from the records.
   subroutine rebuild(self, displacement)
      class(contact_lattice_type), intent(inout) :: self
      !> Displacement of the slider [m]
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

   !> How the contacts are.
   pure subroutine snapshot(self, time, displacement, values)
      class(contact_lattice_type), intent(in) :: self
      !> Time [s], displacement of the slider [m]
      real(wp), intent(in) :: time, displacement
      !> Of each contact its stretch, huge if it is detached [m], force over threshold, and
      !> generation in the present avalanche, shape (snapshot_length, count)
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

   !> Put the state into an archive or take it out.
   subroutine exchange(self, archive)
      class(contact_lattice_type), intent(inout) :: self
      !> The archive
      type(archive_type), intent(inout) :: archive

      call archive%section("contact lattice")
      call exchange_individual(self, archive)
      call archive%exchange("surroundings", self%surroundings)
   end subroutine exchange

end module mesoslip_contacts_lattice
