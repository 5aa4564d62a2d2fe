!> Sums that do not drift: a running total kept in two doubles.
!>
!> An addition loses about 2**-105 of the total, so the total of 10**9 terms that come and go is
!> right to the last bit of a double (T. J. Dekker, Numer. Math. 18 (1971) 224).
module mesoslip_accumulator
   use mesoslip_kinds, only: wp
   implicit none
   private

   public :: accumulator_type

   !> A running total, the unevaluated sum high + low.
   type :: accumulator_type
      !> The total rounded to a double
      real(wp) :: high = 0.0_wp
      !> What the rounding left over
      real(wp) :: low = 0.0_wp
   contains
      !> Add one term
      procedure :: add
   end type accumulator_type

contains

   !> Add one term to the total.
   elemental subroutine add(self, term)
      !> The running total
      class(accumulator_type), intent(inout) :: self
      !> What to add
      real(wp), intent(in) :: term

      real(wp) :: total, shadow, rest

      total = self%high + term
      shadow = total - self%high
      rest = (self%high - (total - shadow)) + (term - shadow)
      rest = rest + self%low
      self%high = total + rest
      self%low = rest - (self%high - total)
   end subroutine add

end module mesoslip_accumulator
