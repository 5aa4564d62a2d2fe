!> Contacts on a lattice: the first to break, neighbours, the extent of an avalanche.
program test_lattice
   use mesoslip_contacts_individual_avalanche_track, only: avalanche_track_type, new_avalanche_track
   use mesoslip_contacts_individual_break_tree, only: break_tree_type, new_break_tree
   use mesoslip_contacts_lattice, only: contact_lattice_type, interaction_type, &
      & new_contact_lattice
   use mesoslip_contacts_mechanics, only: coupling_equal, initial_uniform
   use mesoslip_contacts_individual_record, only: row_limit, row_origin, row_stiffness
   use mesoslip_contacts_base, only: contact_parameters_type, extent_length
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_interface_law, only: pose_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_contacts_individual_neighbours, only: coordination, find_neighbours, &
      & lattice_square, lattice_triangular, max_neighbours
   use mesoslip_numerics_random, only: uniform_pair
   use mesoslip_contacts_threshold_laws, only: new_threshold_law
   use testing, only: check, check_close, finish
   implicit none

   integer :: draws = 0

   call breaks_first(1)
   call breaks_first(2)
   call breaks_first(16)
   call breaks_first(17)
   call breaks_first(300)
   call breaks_first(5000)
   call have_neighbours(lattice_triangular, 2, 2)
   call have_neighbours(lattice_triangular, 7, 4)
   call have_neighbours(lattice_square, 2, 3)
   call have_neighbours(lattice_square, 5, 6)
   call check(coordination(0) == 0, "an unknown lattice has no neighbours")
   call reach(7, 5)
   call reach(40, 3)
   call reach(2, 60)
   call balances()
   call ends_cascade()
   call refuses()
   call finish()

contains

   !> A uniform deviate.
   function deviate()
      real(wp) :: deviate

      real(wp) :: uniform(2)

      draws = draws + 1
      call uniform_pair(7_i8, 0_i8, int(draws, i8), 0_i8, 0_i8, uniform)
      deviate = uniform(1)
   end function deviate

   !> The tree against a plain search, while contacts are added, changed and removed.
   subroutine breaks_first(count)
      integer, intent(in) :: count

      type(break_tree_type) :: tree
      type(error_type), allocatable :: error
      real(wp) :: coordinate(count), place
      integer :: step, contact, expected
      logical :: is_right

      call new_break_tree(tree, count, error)
      coordinate = huge(1.0_wp)
      is_right = .not. allocated(error) .and. tree%first() >= huge(1.0_wp)
      do step = 1, 4 * count + 50
         contact = 1 + int(deviate() * count)
         if (deviate() < 0.2_wp) then
            coordinate(contact) = huge(1.0_wp)
            call tree%remove(contact)
         else
            ! Few different values, so that some are equal.
            coordinate(contact) = real(int(50.0_wp * deviate()), wp)
            call tree%set(contact, coordinate(contact))
         end if
         is_right = is_right .and. .not. abs(tree%first() - minval(coordinate)) > 0.0_wp
         place = 60.0_wp * deviate() - 20.0_wp
         expected = 0
         if (minval(coordinate) <= place) expected = minloc(coordinate, dim=1)
         is_right = is_right .and. tree%due(place) == expected
      end do
      call check(is_right, "the first contact of a tree that changes")

      call tree%clear()
      do contact = 1, count
         if (coordinate(contact) < huge(1.0_wp)) call tree%put(contact, coordinate(contact))
      end do
      call tree%arrange()
      place = minval(coordinate)
      is_right = .not. abs(tree%first() - place) > 0.0_wp
      if (place < huge(1.0_wp)) is_right = is_right .and. &
         & tree%due(place) == minloc(coordinate, dim=1)
      call check(is_right, "the first contact of a rebuilt tree")
   end subroutine breaks_first

   !> Neighbours of all sites, shape (neighbours, sites).
   subroutine list_neighbours(lattice, columns, rows, neighbour)
      integer, intent(in) :: lattice, columns, rows
      integer, intent(out) :: neighbour(:, :)

      integer :: site, some(max_neighbours)

      do site = 1, columns * rows
         call find_neighbours(lattice, columns, rows, site, some)
         neighbour(:, site) = some(:size(neighbour, 1))
      end do
   end subroutine list_neighbours

   !> Each bond is there from both ends, and no site is its own neighbour.
   subroutine have_neighbours(lattice, columns, rows)
      integer, intent(in) :: lattice, columns, rows

      integer, allocatable :: neighbour(:, :)
      integer :: place, side
      logical :: is_mutual

      allocate (neighbour(coordination(lattice), columns * rows))
      call list_neighbours(lattice, columns, rows, neighbour)
      is_mutual = .true.
      do place = 1, columns * rows
         do side = 1, size(neighbour, 1)
            is_mutual = is_mutual .and. neighbour(side, place) /= place &
               & .and. count(neighbour(:, neighbour(side, place)) == place) &
               & == count(neighbour(:, place) == neighbour(side, place))
         end do
      end do
      call check(is_mutual, "neighbours are neighbours of each other")
   end subroutine have_neighbours

   !> The rectangle around an avalanche is the smallest one, wherever it wraps around the edges.
   subroutine reach(columns, rows)
      integer, intent(in) :: columns, rows

      type(avalanche_track_type) :: track
      type(error_type), allocatable :: error
      integer :: trial, number, place, width, height, size_wanted
      logical :: is_smallest, column(0:columns - 1), row(0:rows - 1)

      call new_avalanche_track(track, columns, rows, error)
      is_smallest = .true.
      do trial = 1, 200
         size_wanted = 1 + int(deviate()**3 * columns * rows)
         column = .false.
         row = .false.
         track%generation = 1
         do number = 1, size_wanted
            ! Close to a corner, so that many wrap around it.
            place = modulo(int((deviate() - 0.5_wp) * 0.7_wp * columns), columns) + 1 &
               & + columns * modulo(int((deviate() - 0.5_wp) * 0.9_wp * rows), rows)
            call track%add(place)
            column(modulo(place - 1, columns)) = .true.
            row((place - 1) / columns) = .true.
         end do
         is_smallest = is_smallest .and. track%area == count(track%contact(1, :) > 0)
         call track%extent(width, height)
         is_smallest = is_smallest .and. width == shortest(column) .and. height == shortest(row)
         call track%clear()
         is_smallest = is_smallest .and. all(track%contact(1, :) == 0) .and. track%area == 0
      end do
      call check(is_smallest, "the smallest rectangle around an avalanche")
   end subroutine reach

   !> Length of the shortest arc with all marks, by trying all arcs.
   pure integer function shortest(mark)
      logical, intent(in) :: mark(:)

      integer :: start

      do shortest = 1, size(mark)
         do start = 1, size(mark)
            associate (turned => cshift(mark, start))
               if (.not. any(turned(shortest + 1:))) return
            end associate
         end do
      end do
   end function shortest

   !> Contacts start below their thresholds, and are conserved in motions forward and back.
   subroutine balances()
      integer, parameter :: columns = 12, rows = 10, number = columns * rows
      type(contact_lattice_type) :: contacts
      real(wp) :: displacement
      integer :: step, extent(extent_length)
      real(wp), parameter :: bond = 5.0_wp, shift = 0.3_wp
      logical :: is_whole, bears, adds_up

      call build(contacts, columns, rows, bond, 1.0e-3_wp)
      call contacts%initialize(initial_uniform)
      call check(contacts%detached_count > 0.0_wp .and. contacts%breaks <= 0.0_wp, &
         & "contacts above their thresholds at the start are detached, without a break")
      is_whole = .true.
      bears = .true.
      adds_up = .true.
      do step = 1, 400
         displacement = 1.5_wp * sin(0.1_wp * step)
         call contacts%respond(pose_type(), pose_type(time=1.0e-4_wp * step, &
            & displacement=displacement, direction=sign(1.0_wp, cos(0.1_wp * step))))
         is_whole = is_whole .and. nint(contacts%detached_count) &
            & == count(.not. contacts%record(row_stiffness, :) > 0.0_wp)
         bears = bears .and. bearing(contacts, displacement)
         adds_up = adds_up .and. is_sum_of_bonds(contacts, displacement, columns, rows, bond)
         if (step == 200) then
            call contacts%shift_origin(shift, displacement - shift)
            adds_up = adds_up &
               & .and. is_sum_of_bonds(contacts, displacement - shift, columns, rows, bond)
            call contacts%shift_origin(-shift, displacement)
         end if
         call contacts%take_extent(extent)
      end do
      call check(is_whole .and. contacts%breaks > 10 * number, "contacts are conserved")
      call check(bears, "between events no contact is at its threshold")
      call check(adds_up, "forces are those of the bonds to the neighbours as they are")
   end subroutine balances

   !> Whether the force of each contact is k x + G times the sum of x less that of a neighbour.
   function is_sum_of_bonds(contacts, displacement, columns, rows, bond)
      type(contact_lattice_type), intent(in) :: contacts
      real(wp), intent(in) :: displacement, bond
      integer, intent(in) :: columns, rows
      logical :: is_sum_of_bonds

      real(wp) :: values(3, contacts%parameters%count), stretch(contacts%parameters%count), force
      integer :: neighbour(4, contacts%parameters%count), place

      call list_neighbours(lattice_square, columns, rows, neighbour)
      call contacts%snapshot(0.0_wp, displacement, values)
      associate (record => contacts%record)
         stretch = merge(displacement - record(row_origin, :), 0.0_wp, &
            & record(row_stiffness, :) > 0.0_wp)
         is_sum_of_bonds = .true.
         do place = 1, size(stretch)
            if (.not. record(row_stiffness, place) > 0.0_wp) cycle
            force = record(row_stiffness, place) * stretch(place) &
               & + bond * sum(stretch(place) - stretch(neighbour(:, place)))
            force = force / (record(row_stiffness, place) * record(row_limit, place))
            is_sum_of_bonds = is_sum_of_bonds .and. abs(force - values(2, place)) < 1.0e-12_wp
         end do
      end associate
   end function is_sum_of_bonds

   !> Whether no contact is at its threshold or beyond.
   function bearing(contacts, displacement)
      type(contact_lattice_type), intent(in) :: contacts
      real(wp), intent(in) :: displacement
      logical :: bearing

      real(wp) :: values(3, contacts%parameters%count)

      call contacts%snapshot(0.0_wp, displacement, values)
      bearing = all(abs(values(2, :)) < 1.0_wp + 1.0e-12_wp)
   end function bearing

   !> Without a delay, and with bonds that keep nearly all force in the lattice, a cascade ends.
   subroutine ends_cascade()
      integer, parameter :: columns = 4, rows = 4
      type(contact_lattice_type) :: contacts

      call build(contacts, columns, rows, 1.0e5_wp, 0.0_wp)
      call contacts%initialize(initial_uniform)
      call contacts%respond(pose_type(), pose_type(displacement=3.0_wp))
      call check(.not. allocated(contacts%failure), "a cascade without delay ends")
      call check_close(contacts%detached_count, 0.0_wp, 0.0_wp, "all attach again at once")
   end subroutine ends_cascade

   !> A lattice with another number of sites.
   subroutine refuses()
      type(contact_lattice_type) :: contacts
      type(contact_parameters_type) :: parameters
      type(error_type), allocatable :: error

      parameters%count = 10
      call new_contact_lattice(contacts, parameters, &
         & interaction_type(1.0_wp, lattice_square, 3, 3), error)
      call check(allocated(error), "a lattice of another size is refused")
   end subroutine refuses

   !> Contacts of unit threshold and stiffness on a lattice.
   subroutine build(contacts, columns, rows, bond, delay)
      type(contact_lattice_type), intent(out) :: contacts
      integer, intent(in) :: columns, rows
      real(wp), intent(in) :: bond, delay

      type(contact_parameters_type) :: parameters
      type(error_type), allocatable :: error

      call new_threshold_law(parameters%law, "gaussian", 0.2_wp, 0.1_wp, error)
      parameters%count = columns * rows
      parameters%static_force = 1.0_wp
      parameters%stiffness = 1.0_wp
      parameters%delay = delay
      parameters%back_force_ratio = 0.1_wp
      parameters%coupling = coupling_equal
      parameters%seed = 1_i8
      call new_contact_lattice(contacts, parameters, &
         & interaction_type(bond, lattice_square, columns, rows), error)
   end subroutine build

end program test_lattice
