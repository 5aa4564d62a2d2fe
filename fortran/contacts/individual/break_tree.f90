!> The order of breaking of contacts whose coordinates change at any time.
!>
!> A tree with many branches at each node, which holds the minimum of its branches. A contact that
!> changes is rarely the minimum of its node, before or after, so a change costs one comparison
!> whatever the number of contacts. Contacts of successive numbers share cache lines.
module mesoslip_contacts_individual_break_tree
   use mesoslip_numerics_kinds, only: wp
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_memory, only: request_large_pages
   implicit none
   private

   public :: break_tree_type, new_break_tree

   !> Branches of a node
   integer, parameter :: branches = 16
   !> Levels above the contacts, if they are 2**31
   integer, parameter :: max_levels = 8
   !> Coordinate at which nothing breaks
   real(wp), parameter :: never = huge(1.0_wp)

   !> Coordinates along a direction of motion at which contacts break.
   type :: break_tree_type
      private
      !> Number of levels of nodes, and the position before the first of each; level 0 has the
      !> contacts
      integer :: levels = 0, before(0:max_levels) = 0
      !> Coordinate at which a contact, or the first one below a node, breaks, shape (positions)
      real(wp), allocatable :: minimum(:)
   contains
      !> Insert or change a contact, remove one, remove all
      procedure, non_overridable :: set, remove, clear
      !> Insert contacts, then rebuild the tree
      procedure, non_overridable :: put, arrange
      !> Coordinate at which the first contact breaks, and a contact that breaks up to a coordinate
      procedure, non_overridable :: first, due
   end type break_tree_type

contains

   !> Set up an empty tree.
   subroutine new_break_tree(self, capacity, error)
      type(break_tree_type), intent(out) :: self
      !> Maximum number of a contact
      integer, intent(in) :: capacity
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(out) :: error

      integer :: nodes, positions, stat

      nodes = capacity
      positions = branches * ((capacity + branches - 1) / branches)
      do
         nodes = (nodes + branches - 1) / branches
         self%levels = self%levels + 1
         self%before(self%levels) = positions
         ! The nodes of each level but the last fill whole nodes of the level above.
         positions = positions + merge(1, branches * ((nodes + branches - 1) / branches), &
            & nodes == 1)
         if (nodes == 1) exit
      end do
      allocate (self%minimum(positions), stat=stat)
      if (stat /= 0) then
         call raise(error, status_memory, "not enough memory for the order of breaking")
         return
      end if
      call request_large_pages(self%minimum, positions)
      call self%clear()
   end subroutine new_break_tree

   !> Insert a contact, or change it.
   pure subroutine set(self, contact, coordinate)
      class(break_tree_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Coordinate at which it breaks [m]
      real(wp), intent(in) :: coordinate

      call change(size(self%minimum), self%minimum, self%before, self%levels, contact, coordinate)
   end subroutine set

   !> Remove a contact.
   pure subroutine remove(self, contact)
      class(break_tree_type), intent(inout) :: self
      integer, intent(in) :: contact

      call self%set(contact, never)
   end subroutine remove

   !> Change a contact, and the nodes above whose minimum changes.
   pure subroutine change(positions, minimum, before, levels, contact, coordinate)
      integer, intent(in) :: positions
      real(wp), intent(inout) :: minimum(positions)
      integer, intent(in) :: before(0:max_levels), levels, contact
      real(wp), intent(in) :: coordinate

      integer :: level, branch, node
      real(wp) :: old, new, old_minimum

      branch = contact
      old = minimum(branch)
      new = coordinate
      minimum(branch) = new
      do level = 1, levels
         node = (branch - 1) / branches + 1
         old_minimum = minimum(before(level) + node)
         if (.not. new < old_minimum) then
            if (old > old_minimum) return
            new = min_of(minimum(before(level - 1) + (node - 1) * branches + 1: &
               & before(level - 1) + node * branches))
            if (.not. (new < old_minimum .or. new > old_minimum)) return
         end if
         old = old_minimum
         minimum(before(level) + node) = new
         branch = node
      end do
   end subroutine change

   !> The minimum of the branches of a node.
   pure function min_of(branch) result(minimum)
      real(wp), intent(in) :: branch(branches)
      real(wp) :: minimum

      integer :: position
      real(wp) :: part(4)

      part = branch(:4)
      do position = 5, branches, 4
         part(1) = min(part(1), branch(position))
         part(2) = min(part(2), branch(position + 1))
         part(3) = min(part(3), branch(position + 2))
         part(4) = min(part(4), branch(position + 3))
      end do
      minimum = min(min(part(1), part(2)), min(part(3), part(4)))
   end function min_of

   !> The first branch of a node that is not above the minimum, without a conditional branch, which
   !> could not be predicted.
   pure function first_of(branch, minimum) result(position)
      real(wp), intent(in) :: branch(branches), minimum
      integer :: position

      integer :: later

      position = branches
      do later = branches - 1, 1, -1
         position = merge(position, later, branch(later) > minimum)
      end do
   end function first_of

   !> Remove all contacts.
   pure subroutine clear(self)
      class(break_tree_type), intent(inout) :: self

      self%minimum = never
   end subroutine clear

   !> Insert a contact, followed by arrange.
   pure subroutine put(self, contact, coordinate)
      class(break_tree_type), intent(inout) :: self
      integer, intent(in) :: contact
      !> Coordinate at which it breaks [m]
      real(wp), intent(in) :: coordinate

      self%minimum(contact) = coordinate
   end subroutine put

   !> Rebuild the tree from its contacts.
   pure subroutine arrange(self)
      class(break_tree_type), intent(inout) :: self

      integer :: level, node, nodes

      nodes = self%before(1)
      do level = 1, self%levels
         nodes = (nodes + branches - 1) / branches
         do node = 1, nodes
            self%minimum(self%before(level) + node) = min_of( &
               & self%minimum(self%before(level - 1) + (node - 1) * branches + 1:))
         end do
      end do
   end subroutine arrange

   !> Coordinate at which the first contact breaks [m]; huge without contacts.
   pure function first(self) result(coordinate)
      class(break_tree_type), intent(in) :: self
      real(wp) :: coordinate

      coordinate = self%minimum(size(self%minimum))
   end function first

   !> The first contact that breaks up to a coordinate; of equal ones that of the lowest number.
   pure function due(self, coordinate) result(contact)
      class(break_tree_type), intent(in) :: self
      !> Coordinate of the slider [m]
      real(wp), intent(in) :: coordinate
      !> Number of the contact; 0 if no contact breaks
      integer :: contact

      integer :: level, position

      contact = 0
      if (self%first() > coordinate) return
      contact = 1
      do level = self%levels - 1, 0, -1
         position = self%before(level) + (contact - 1) * branches
         contact = (contact - 1) * branches + first_of(self%minimum(position + 1:), self%first())
      end do
   end function due

end module mesoslip_contacts_individual_break_tree
