!> Lists of contacts without an order.
module mesoslip_contacts_ageing_lists
   implicit none
   private

   public :: list_type, append, remove, position_of

   !> A list of contacts.
   type :: list_type
      integer :: count = 0
      !> Their numbers, the first of them, shape (number of contacts)
      integer, allocatable :: contact(:)
   end type list_type

contains

   !> Add a contact to a list.
   pure subroutine append(list, contact)
      type(list_type), intent(inout) :: list
      integer, intent(in) :: contact

      list%count = list%count + 1
      list%contact(list%count) = contact
   end subroutine append

   !> Remove a contact from a list; the last one takes its position.
   pure subroutine remove(list, position)
      type(list_type), intent(inout) :: list
      integer, intent(in) :: position

      list%contact(position) = list%contact(list%count)
      list%count = list%count - 1
   end subroutine remove

   !> Position of a contact in a list; 0 if it is not in it.
   pure function position_of(list, contact) result(position)
      type(list_type), intent(in) :: list
      integer, intent(in) :: contact
      integer :: position

      do position = list%count, 1, -1
         if (list%contact(position) == contact) return
      end do
      position = 0
   end function position_of

end module mesoslip_contacts_ageing_lists
