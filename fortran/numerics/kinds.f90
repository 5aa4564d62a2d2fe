!> Kinds of numbers.
module mesoslip_numerics_kinds
   use, intrinsic :: iso_fortran_env, only: int32, int64, real64
   implicit none
   private

   public :: wp, i4, i8

   !> Working precision
   integer, parameter :: wp = real64
   !> Integers of the boundary
   integer, parameter :: i4 = int32
   !> Counters
   integer, parameter :: i8 = int64
end module mesoslip_numerics_kinds
