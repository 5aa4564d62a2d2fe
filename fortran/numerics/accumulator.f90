!> Sums that do not drift: a running total kept in two doubles.
!>
!> The rounding error of each addition is kept and added up apart (A. Neumaier, Z. angew. Math.
!> Mech. 54 (1974) 39), so the total of 10**9 terms that come and go is right to the last bit of a
!> double.
module mesoslip_numerics_accumulator
   use mesoslip_numerics_kinds, only: wp
   implicit none
   private

   public :: accumulator_type

   !> A running total, the unevaluated sum high + low.
   type :: accumulator_type
      !> The sum as additions of doubles give it
      real(wp) :: high = 0.0_wp
      !> Sum of their rounding errors
      real(wp) :: low = 0.0_wp
   contains
      procedure, non_overridable :: add
      procedure, non_overridable :: total
   end type accumulator_type

contains

   !> Add one term to the total.
   elemental subroutine add(self, term)
      class(accumulator_type), intent(inout) :: self
      real(wp), intent(in) :: term

      real(wp) :: sum, shadow

      sum = self%high + term
      shadow = sum - self%high
      self%low = self%low + ((self%high - (sum - shadow)) + (term - shadow))
      self%high = sum
   end subroutine add

   !> The total, rounded to a double.
   elemental function total(self)
      class(accumulator_type), intent(in) :: self
      real(wp) :: total

      total = self%high + self%low
   end function total

end module mesoslip_numerics_accumulator
