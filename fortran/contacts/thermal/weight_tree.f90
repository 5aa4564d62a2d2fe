!> Weights of contacts, their sum, and the choice of a contact in proportion to its weight.
!>
!> A tree with several branches at each node, which holds the sum of its branches. Sums depend on
!> the weights alone, not on the order of their changes; they are recomputed when they are needed.
module mesoslip_contacts_thermal_weight_tree
   use mesoslip_numerics_errors, only: error_type, raise, status_memory
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: weight_tree_type, new_weight_tree

   !> Branches of a node
   integer, parameter :: branches = 8
   !> Levels above the contacts, if they are 2**31
   integer, parameter :: max_levels = 11

   !> Weights of contacts.
   type :: weight_tree_type
      private
      !> Number of levels of nodes, and the position before the first of each; level 0 has the
      !> contacts
      integer :: levels = 0, before(0:max_levels + 1) = 0
      !> Weight of a contact, or of all below a node, shape (positions)
      real(wp), allocatable :: weight(:)
      !> Whether the sum of a node is outdated, shape (positions); numbers of the nodes of the first
      !> level of which that is so, and how many
      logical, allocatable :: is_outdated(:)
      integer, allocatable :: outdated(:)
      integer :: outdated_count = 0
   contains
      !> Change the weight of a contact
      procedure, non_overridable :: set
      !> Recompute the sums, those that are outdated or all
      procedure, non_overridable :: update, update_all
      !> Sum of all weights, and the contact at a part of it
      procedure, non_overridable :: total, find
      procedure, non_overridable, private :: sum_up
   end type weight_tree_type

contains

   !> Set up contacts without weights.
   subroutine new_weight_tree(self, capacity, error)
      type(weight_tree_type), intent(out) :: self
      !> Number of contacts
      integer, intent(in) :: capacity
      !> Set if there is not enough memory
      type(error_type), allocatable, intent(inout) :: error

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
      self%before(self%levels + 1) = positions
      allocate (self%weight(positions), source=0.0_wp, stat=stat)
      if (stat == 0) allocate (self%is_outdated(positions), source=.false., stat=stat)
      if (stat == 0) allocate (self%outdated(self%before(1) / branches), source=0, stat=stat)
      if (stat /= 0) call raise(error, status_memory, "not enough memory for rates of contacts")
   end subroutine new_weight_tree

   !> Change the weight of a contact.
   pure subroutine set(self, contact, weight)
      class(weight_tree_type), intent(inout) :: self
      integer, intent(in) :: contact
      real(wp), intent(in) :: weight

      integer :: node

      self%weight(contact) = weight
      node = (contact - 1) / branches + 1
      if (self%is_outdated(self%before(1) + node)) return
      self%is_outdated(self%before(1) + node) = .true.
      self%outdated_count = self%outdated_count + 1
      self%outdated(self%outdated_count) = node
   end subroutine set

   !> Recompute the sums that are outdated.
   pure subroutine update(self)
      class(weight_tree_type), intent(inout) :: self

      integer :: level, event, node, count

      count = self%outdated_count
      self%outdated_count = 0
      do level = 1, self%levels
         do event = 1, count
            node = self%outdated(event)
            call self%sum_up(level, node)
            self%is_outdated(self%before(level) + node) = .false.
            if (level == self%levels) exit
            node = (node - 1) / branches + 1
            if (self%is_outdated(self%before(level + 1) + node)) cycle
            self%is_outdated(self%before(level + 1) + node) = .true.
            self%outdated_count = self%outdated_count + 1
            self%outdated(self%outdated_count) = node
         end do
         count = self%outdated_count
         self%outdated_count = 0
      end do
   end subroutine update

   !> Make all sums again.
   pure subroutine update_all(self)
      class(weight_tree_type), intent(inout) :: self

      integer :: level, node

      do level = 1, self%levels
         do node = 1, (self%before(level) - self%before(level - 1)) / branches
            call self%sum_up(level, node)
         end do
      end do
      self%is_outdated = .false.
      self%outdated_count = 0
   end subroutine update_all

   !> Make the sum of a node of a level.
   pure subroutine sum_up(self, level, node)
      class(weight_tree_type), intent(inout) :: self
      integer, intent(in) :: level, node

      integer :: first

      first = self%before(level - 1) + branches * (node - 1)
      self%weight(self%before(level) + node) = &
         & ((self%weight(first + 1) + self%weight(first + 2)) &
         & + (self%weight(first + 3) + self%weight(first + 4))) &
         & + ((self%weight(first + 5) + self%weight(first + 6)) &
         & + (self%weight(first + 7) + self%weight(first + 8)))
   end subroutine sum_up

   !> Sum of all weights, after an update.
   pure function total(self)
      class(weight_tree_type), intent(in) :: self
      real(wp) :: total

      total = self%weight(size(self%weight))
   end function total

   !> Find the contact at a part of the sum of all weights, after an update.
   pure subroutine find(self, part, contact, fraction)
      class(weight_tree_type), intent(in) :: self
      !> Part of the sum, which is positive, from 0 to less than the sum
      real(wp), intent(in) :: part
      integer, intent(out) :: contact
      !> Part of the weight of this contact that lies before, from 0 to 1
      real(wp), intent(out) :: fraction

      real(wp) :: remaining, bound, passed
      integer :: level, first, branch, chosen

      remaining = part
      contact = 1
      do level = self%levels - 1, 0, -1
         first = self%before(level) + branches * (contact - 1)
         ! Without a branch, which the processor could not predict.
         bound = 0.0_wp
         passed = 0.0_wp
         chosen = 1
         do branch = 1, branches - 1
            bound = bound + self%weight(first + branch)
            chosen = chosen + merge(1, 0, remaining >= bound)
            passed = merge(bound, passed, remaining >= bound)
         end do
         remaining = remaining - passed
         ! Rounding may have led beyond the last branch that has a weight.
         do while (.not. self%weight(first + chosen) > 0.0_wp)
            chosen = chosen - 1
            remaining = self%weight(first + chosen)
         end do
         contact = first + chosen - self%before(level)
      end do
      fraction = min(remaining / self%weight(contact), 1.0_wp)
   end subroutine find

end module mesoslip_contacts_thermal_weight_tree
