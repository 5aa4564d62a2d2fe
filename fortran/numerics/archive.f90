!> State as plain arrays: each part of a simulation puts its numbers into an archive, or gets them.
module mesoslip_numerics_archive
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_accumulator, only: accumulator_type
   implicit none
   private

   public :: archive_type

   !> Numbers of a state, with a place where the next one goes.
   type :: archive_type
      !> Real numbers of the state
      real(wp), allocatable :: reals(:)
      !> Whole numbers of the state
      integer(i8), allocatable :: integers(:)
      !> Whether values are put into the archive, rather than taken from it
      logical :: saving = .false.
      integer, private :: real_place = 0, integer_place = 0
   contains
      !> Put one value into the archive, or take it out
      generic :: exchange => exchange_real, exchange_integer, exchange_long, exchange_logical, &
         & exchange_accumulator
      procedure, private :: exchange_real, exchange_integer, exchange_long, exchange_logical
      procedure, private :: exchange_accumulator
   end type archive_type

contains

   subroutine exchange_real(self, value)
      class(archive_type), intent(inout) :: self
      real(wp), intent(inout) :: value

      self%real_place = self%real_place + 1
      if (self%saving) then
         self%reals(self%real_place) = value
      else
         value = self%reals(self%real_place)
      end if
   end subroutine exchange_real

   subroutine exchange_long(self, value)
      class(archive_type), intent(inout) :: self
      integer(i8), intent(inout) :: value

      self%integer_place = self%integer_place + 1
      if (self%saving) then
         self%integers(self%integer_place) = value
      else
         value = self%integers(self%integer_place)
      end if
   end subroutine exchange_long

   subroutine exchange_integer(self, value)
      class(archive_type), intent(inout) :: self
      integer, intent(inout) :: value

      integer(i8) :: long

      long = int(value, i8)
      call self%exchange_long(long)
      value = int(long)
   end subroutine exchange_integer

   subroutine exchange_logical(self, value)
      class(archive_type), intent(inout) :: self
      logical, intent(inout) :: value

      integer(i8) :: long

      long = merge(1_i8, 0_i8, value)
      call self%exchange_long(long)
      value = long /= 0_i8
   end subroutine exchange_logical

   subroutine exchange_accumulator(self, value)
      class(archive_type), intent(inout) :: self
      type(accumulator_type), intent(inout) :: value

      call self%exchange_real(value%high)
      call self%exchange_real(value%low)
   end subroutine exchange_accumulator

end module mesoslip_numerics_archive
