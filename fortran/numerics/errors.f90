!> Errors of the library: an allocatable object, unallocated meaning success.
module mesoslip_numerics_errors
   implicit none
   private

   public :: error_type, raise
   public :: status_ok, status_invalid, status_memory, status_stalled, status_failed

   !> Success
   integer, parameter :: status_ok = 0
   !> An argument is outside its domain
   integer, parameter :: status_invalid = 1
   !> An array could not be allocated
   integer, parameter :: status_memory = 2
   !> The motion makes no progress in time
   integer, parameter :: status_stalled = 3
   !> An integrator failed
   integer, parameter :: status_failed = 4

   !> Kind of a failure, and a sentence about it for the user.
   type :: error_type
      !> One of the status codes of this module
      integer :: status = status_ok
      !> One sentence: the fault, and the remedy
      character(len=:), allocatable :: message
   end type error_type

contains

   !> Report an error to the caller.
   pure subroutine raise(error, status, message)
      type(error_type), allocatable, intent(out) :: error
      !> One of the status codes of this module
      integer, intent(in) :: status
      character(len=*), intent(in) :: message

      allocate (error)
      error%status = status
      error%message = message
   end subroutine raise

end module mesoslip_numerics_errors
