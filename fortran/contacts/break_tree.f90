!> Which of many contacts breaks first, when its place may change at any time.
!>
!> A tree with many branches at each node, which holds the least of its branches. A contact that
!> changes is hardly ever the least of its node, before or after, so a change costs one comparison
!> whatever the number of contacts. Contacts that are neighbours in number share lines of the cache.
module mesoslip_contacts_break_tree
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   implicit none
   private

   public :: break_tree_type, new_break_tree

   !> Branches of a node
   integer, parameter :: branches = 16
   !> Levels above that of 2**31 contacts
   integer, parameter :: most_levels = 8
   !> Coordinate at which nothing breaks
   real(wp), parameter :: never = huge(1.0_wp)

   !> Coordinates along a direction of motion at which contacts break.
   type :: break_tree_type
      private
      !> Number of levels of nodes, and the place before the first of each; level 0 is the contacts
      integer :: levels = 0, before(0:most_levels) = 0
      !> Coordinate at which a contact, or the first one below a node, breaks, shape (places)
      real(wp), allocatable :: least(:)
   contains
      !> Put a contact in, or change it
      procedure, non_overridable :: set
      !> Take a contact out
      procedure, non_overridable :: remove
      !> Forget all contacts
      procedure, non_overridable :: clear
      !> Put a contact in, to be followed by arrange
      procedure, non_overridable :: put
      !> Make the tree anew from its contacts
      procedure, non_overridable :: arrange
      !> Coordinate at which the first contact breaks
      procedure, non_overridable :: first
      !> A contact that breaks at a coordinate
      procedure, non_overridable :: due
   end type break_tree_type

contains

   !> Set up an empty tree.
   subroutine new_break_tree(self, capacity, error)
      !> The tree
      type(break_tree_type), intent(out) :: self
      !> Largest number of a contact
      integer, intent(in) :: capacity
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      integer :: nodes, places, stat

      nodes = capacity
      places = branches * ((capacity + branches - 1) / branches)
      do
         nodes = (nodes + branches - 1) / branches
         self%levels = self%levels + 1
         self%before(self%levels) = places
         ! The nodes of each level but the last one fill those above.
         places = places + merge(1, branches * ((nodes + branches - 1) / branches), nodes == 1)
         if (nodes == 1) exit
      end do
      allocate (self%least(places), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the order of breaking")
         return
      end if
      call self%clear()
   end subroutine new_break_tree

   !> Put a contact in, or change it.
   pure subroutine set(self, contact, coordinate)
      !> The tree
      class(break_tree_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Coordinate at which it breaks [m]
      real(wp), intent(in) :: coordinate

      call change(size(self%least), self%least, self%before, self%levels, contact, coordinate)
   end subroutine set

   !> Take a contact out.
   pure subroutine remove(self, contact)
      !> The tree
      class(break_tree_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact

      call self%set(contact, never)
   end subroutine remove

   !> Change a contact, and the nodes above for which that matters.
   pure subroutine change(places, least, before, levels, contact, coordinate)
      integer, intent(in) :: places
      real(wp), intent(inout) :: least(places)
      integer, intent(in) :: before(0:most_levels), levels, contact
      real(wp), intent(in) :: coordinate

      integer :: level, branch, node
      real(wp) :: old, new, was_least

      branch = contact
      old = least(branch)
      new = coordinate
      least(branch) = new
      do level = 1, levels
         node = (branch - 1) / branches + 1
         was_least = least(before(level) + node)
         if (.not. new < was_least) then
            if (old > was_least) return
            new = least_of(least(before(level - 1) + (node - 1) * branches + 1: &
               & before(level - 1) + node * branches))
            if (.not. (new < was_least .or. new > was_least)) return
         end if
         old = was_least
         least(before(level) + node) = new
         branch = node
      end do
   end subroutine change

   !> The least of the branches of a node.
   pure function least_of(branch) result(least)
      real(wp), intent(in) :: branch(branches)
      real(wp) :: least

      integer :: place
      real(wp) :: part(4)

      part = branch(:4)
      do place = 5, branches, 4
         part(1) = min(part(1), branch(place))
         part(2) = min(part(2), branch(place + 1))
         part(3) = min(part(3), branch(place + 2))
         part(4) = min(part(4), branch(place + 3))
      end do
      least = min(min(part(1), part(2)), min(part(3), part(4)))
   end function least_of

   !> The first branch of a node that is not above the least, without a branch of the program: which
   !> one it is could not be guessed.
   pure function first_of(branch, least) result(place)
      real(wp), intent(in) :: branch(branches), least
      integer :: place

      integer :: later

      place = branches
      do later = branches - 1, 1, -1
         place = merge(place, later, branch(later) > least)
      end do
   end function first_of

   !> Forget all contacts.
   pure subroutine clear(self)
      !> The tree
      class(break_tree_type), intent(inout) :: self

      self%least = never
   end subroutine clear

   !> Put a contact in, to be followed by arrange.
   pure subroutine put(self, contact, coordinate)
      !> The tree
      class(break_tree_type), intent(inout) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      !> Coordinate at which it breaks [m]
      real(wp), intent(in) :: coordinate

      self%least(contact) = coordinate
   end subroutine put

   !> Make the tree anew from its contacts.
   pure subroutine arrange(self)
      !> The tree
      class(break_tree_type), intent(inout) :: self

      integer :: level, node, nodes

      nodes = self%before(1)
      do level = 1, self%levels
         nodes = (nodes + branches - 1) / branches
         do node = 1, nodes
            self%least(self%before(level) + node) = least_of( &
               & self%least(self%before(level - 1) + (node - 1) * branches + 1:))
         end do
      end do
   end subroutine arrange

   !> Coordinate at which the first contact breaks.
   pure function first(self) result(coordinate)
      !> The tree
      class(break_tree_type), intent(in) :: self
      !> The coordinate, huge without contacts [m]
      real(wp) :: coordinate

      coordinate = self%least(size(self%least))
   end function first

   !> A contact that breaks at a coordinate: the first one, or of many the lowest in number.
   pure function due(self, coordinate) result(contact)
      !> The tree
      class(break_tree_type), intent(in) :: self
      !> Coordinate of the slider [m]
      real(wp), intent(in) :: coordinate
      !> Number of the contact; 0 if none breaks
      integer :: contact

      integer :: level, place

      contact = 0
      if (self%first() > coordinate) return
      contact = 1
      do level = self%levels - 1, 0, -1
         place = self%before(level) + (contact - 1) * branches
         contact = (contact - 1) * branches + first_of(self%least(place + 1:), self%first())
      end do
   end function due

end module mesoslip_contacts_break_tree
