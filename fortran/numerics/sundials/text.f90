!> A message of SUNDIALS, kept instead of printed. Which functions SUNDIALS calls with its messages
!> depends on its version, see sundials_messages_6.f90 and sundials_messages_7.f90.
module mesoslip_numerics_sundials_text
   use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_null_char, c_ptr
   implicit none
   private

   public :: message_type, keep_text

   !> The last message.
   type :: message_type
      !> Its text, blank for none
      character(len=160) :: text = ""
   end type message_type

contains

   !> Keep a message.
   subroutine keep_text(text, address)
      !> The message, a C string
      character(kind=c_char), intent(in) :: text(*)
      !> Address of a message_type
      type(c_ptr), intent(in) :: address

      type(message_type), pointer :: message
      integer :: place

      call c_f_pointer(address, message)
      message%text = ""
      do place = 1, len(message%text)
         if (text(place) == c_null_char) exit
         message%text(place:place) = text(place)
      end do
   end subroutine keep_text

end module mesoslip_numerics_sundials_text
