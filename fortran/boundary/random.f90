! The random numbers as Python calls them, wrapped by f2py.

!> Philox 4x32-10, for tests and for other programs that need the same numbers.
subroutine philox(length, counter, key, word)
   !f2py threadsafe
   use mesoslip_numerics_random, only: philox4x32
   implicit none
   integer, intent(in) :: length
   !> 32-bit words in 64-bit integers, shapes (4, length), (2, length)
   integer(8), intent(in) :: counter(4, length), key(2, length)
   integer(8), intent(out) :: word(4, length)

   integer :: draw

   do draw = 1, length
      call philox4x32(counter(:, draw), key(:, draw), word(:, draw))
   end do
end subroutine philox
