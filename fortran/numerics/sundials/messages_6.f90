!> Messages of SUNDIALS version 6, collected instead of printed.
module mesoslip_numerics_sundials_messages
   use, intrinsic :: iso_c_binding, only: c_char, c_funloc, c_funptr, c_int, c_loc, c_ptr
   use mesoslip_numerics_sundials_text, only: keep_text, message_type
   implicit none
   private

   public :: collect_messages

   interface
      !> Give CVODE a function for its messages.
      function set_handler(memory, handler, user_data) bind(c, name="CVodeSetErrHandlerFn") &
         & result(status)
         import :: c_funptr, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value :: memory
         !> The function, and what it gets
         type(c_funptr), value :: handler
         type(c_ptr), value :: user_data
         !> 0 means success
         integer(c_int) :: status
      end function set_handler
   end interface

contains

   !> Have the messages of an integrator collected.
   subroutine collect_messages(context, memory, message)
      !> Context and memory of the integrator
      type(c_ptr), intent(in) :: context, memory
      !> Where they go
      type(message_type), intent(inout), target :: message

      integer(c_int) :: status

      associate (unused => context)
      end associate
      status = set_handler(memory, c_funloc(handle), c_loc(message))
      if (status /= 0) message%text = "messages of CVODE cannot be collected"
   end subroutine collect_messages

   !> Keep a message.
   subroutine handle(code, module_name, function_name, text, user_data) &
      & bind(c, name="mesoslip_message")
      integer(c_int), value :: code
      character(kind=c_char), intent(in) :: module_name(*), function_name(*), text(*)
      type(c_ptr), value :: user_data

      call keep_text(text, user_data)
   end subroutine handle

end module mesoslip_numerics_sundials_messages
