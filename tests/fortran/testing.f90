!> A small frame for unit tests: checks are counted, failures are reported, finish ends the program.
module testing
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: check, check_close, finish

   integer :: passed = 0, failed = 0

contains

   !> Check that a condition holds.
   subroutine check(condition, name)
      logical, intent(in) :: condition
      character(len=*), intent(in) :: name

      if (condition) then
         passed = passed + 1
      else
         failed = failed + 1
         print "(2a)", "FAILED: ", name
      end if
   end subroutine check

   !> Check that a number is close to another.
   subroutine check_close(actual, expected, tolerance, name)
      real(wp), intent(in) :: actual, expected
      !> Maximum difference, in the unit of the number
      real(wp), intent(in) :: tolerance
      character(len=*), intent(in) :: name

      logical :: is_close

      is_close = abs(actual - expected) <= tolerance
      call check(is_close, name)
      if (.not. is_close) then
         print "(a, es24.16, a, es24.16)", "   is ", actual, ", must be ", expected
      end if
   end subroutine check_close

   !> Print the result and end the program, with status 1 if a check failed.
   !
   ! It ends here, rather than in the program, so that the memory of the program's variables is
   ! still in use, and the sanitizer reports only leaks of the kernels.
   subroutine finish()
      print "(i0, a, i0, a)", passed, " passed, ", failed, " failed"
      if (failed > 0) error stop 1
      stop
   end subroutine finish

end module testing
