!> Messages of SUNDIALS version 7, collected instead of printed.
module mesoslip_numerics_sundials_messages
   use, intrinsic :: iso_c_binding, only: c_char, c_funloc, c_funptr, c_int, c_loc, c_ptr
   use mesoslip_numerics_sundials_text, only: keep_text, message_type
   implicit none
   private

   public :: collect_messages

   interface
      !> Give a context a function for its messages.
      function push_handler(context, handler, user_data) &
         & bind(c, name="SUNContext_PushErrHandler") result(status)
         import :: c_funptr, c_int, c_ptr
         implicit none
         !> The context
         type(c_ptr), value :: context
         !> The function, and what it gets
         type(c_funptr), value :: handler
         type(c_ptr), value :: user_data
         !> 0 means success
         integer(c_int) :: status
      end function push_handler
   end interface

contains

   !> Have the messages of an integrator collected.
   subroutine collect_messages(context, memory, message)
      !> Context and memory of the integrator
      type(c_ptr), intent(in) :: context, memory
      !> Where they go
      type(message_type), intent(inout), target :: message

      integer(c_int) :: status

      associate (unused => memory)
      end associate
      status = push_handler(context, c_funloc(handle), c_loc(message))
      if (status /= 0) message%text = "messages of CVODE cannot be collected"
   end subroutine collect_messages

   !> Keep a message.
   subroutine handle(line, function_name, file_name, text, code, user_data, context) &
      & bind(c, name="mesoslip_message")
      integer(c_int), value :: line, code
      character(kind=c_char), intent(in) :: function_name(*), file_name(*), text(*)
      type(c_ptr), value :: user_data, context

      call keep_text(text, user_data)
   end subroutine handle

end module mesoslip_numerics_sundials_messages
