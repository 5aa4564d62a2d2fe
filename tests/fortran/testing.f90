!> A small frame for unit tests: checks are counted, failures are told, finish ends the program.
module testing
   use mesoslip_kinds, only: wp
   implicit none
   private

   public :: check, check_close, finish

   integer :: passed = 0, failed = 0

contains

   !> Check that a condition holds.
   subroutine check(condition, name)
      !> What must be true
      logical, intent(in) :: condition
      !> What is checked
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
      !> The number, and what it must be
      real(wp), intent(in) :: actual, expected
      !> Greatest difference
      real(wp), intent(in) :: tolerance
      !> What is checked
      character(len=*), intent(in) :: name

      call check(abs(actual - expected) <= tolerance, name)
      if (.not. abs(actual - expected) <= tolerance) then
         print "(a, es24.16, a, es24.16)", "   is ", actual, ", must be ", expected
      end if
   end subroutine check_close

   !> Tell the result; the program fails if a check did.
   subroutine finish()
      print "(i0, a, i0, a)", passed, " passed, ", failed, " failed"
      if (failed > 0) error stop 1
   end subroutine finish

end module testing
