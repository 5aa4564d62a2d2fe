!> Counter-based random numbers: every draw is a pure function of its key and counter.
!>
!> Philox 4x32-10 of J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers:
!> as easy as 1, 2, 3", SC'11. A draw of mesoslip is keyed by (seed, realization, contact, renewal),
!> so it does not depend on what was drawn before it, or where.
module mesoslip_numerics_random
   use mesoslip_numerics_kinds, only: i8, wp
   implicit none
   private

   public :: first_uniforms, philox4x32, uniform_pair

   integer(i8), parameter :: mask = int(z'FFFFFFFF', i8)
   integer(i8), parameter :: multiplier_0 = int(z'D2511F53', i8)
   integer(i8), parameter :: multiplier_1 = int(z'CD9E8D57', i8)
   integer(i8), parameter :: weyl_0 = int(z'9E3779B9', i8)
   integer(i8), parameter :: weyl_1 = int(z'BB67AE85', i8)
   integer, parameter :: rounds = 10

contains

   !> Philox 4x32-10: a keyed bijection of 128 bits.
   pure subroutine philox4x32(counter, key, word)
      !> Four 32-bit words, each in the low half of an element
      integer(i8), intent(in) :: counter(0:3)
      !> Two 32-bit words, each in the low half of an element
      integer(i8), intent(in) :: key(0:1)
      !> Four random 32-bit words, each in the low half of an element
      integer(i8), intent(out) :: word(0:3)

      integer(i8) :: c0, c1, c2, c3, k0, k1, low_0, high_0, low_1, high_1
      integer :: round

      c0 = counter(0)
      c1 = counter(1)
      c2 = counter(2)
      c3 = counter(3)
      k0 = key(0)
      k1 = key(1)
      do round = 1, rounds
         call multiply(multiplier_0, c0, high_0, low_0)
         call multiply(multiplier_1, c2, high_1, low_1)
         c0 = ieor(ieor(high_1, c1), k0)
         c2 = ieor(ieor(high_0, c3), k1)
         c1 = low_1
         c3 = low_0
         k0 = iand(k0 + weyl_0, mask)
         k1 = iand(k1 + weyl_1, mask)
      end do
      word = [c0, c1, c2, c3]
   end subroutine philox4x32

   !> Two independent deviates, uniform on the open interval (0, 1), for one birth of one contact.
   pure subroutine uniform_pair(seed, realization, contact, renewal, attempt, uniform)
      !> Seed of the run, 0 <= seed
      integer(i8), intent(in) :: seed
      !> Number of the realization, 0 <= realization < 2**32
      integer(i8), intent(in) :: realization
      !> Number of the contact, 0 <= contact < 2**32
      integer(i8), intent(in) :: contact
      !> How often the contact has been born before, 0 <= renewal < 2**48
      integer(i8), intent(in) :: renewal
      !> Number of the attempt, for draws by rejection, 0 <= attempt < 2**16
      integer(i8), intent(in) :: attempt
      !> The two deviates, odd multiples of 2**-53
      real(wp), intent(out) :: uniform(2)

      integer(i8) :: word(0:3)

      call philox4x32([contact, iand(renewal, mask), &
         & ior(ishft(renewal, -32), ishft(attempt, 16)), realization], &
         & [iand(seed, mask), ishft(seed, -32)], word)
      uniform(1) = unit_real(word(0), word(1))
      uniform(2) = unit_real(word(2), word(3))
   end subroutine uniform_pair

   !> The first deviates of the pairs of several contacts.
   pure subroutine first_uniforms(seed, realization, contact, renewal, uniform)
      !> Seed of the run, and number of the realization
      integer(i8), intent(in) :: seed, realization
      !> Numbers of the contacts, and how often each has been born before
      integer(i8), intent(in), contiguous :: contact(:), renewal(:)
      !> The deviates, shape that of contact
      real(wp), intent(out), contiguous :: uniform(:)

      integer :: place
      real(wp) :: pair(2)

      do place = 1, size(contact)
         call uniform_pair(seed, realization, contact(place), renewal(place), 0_i8, pair)
         uniform(place) = pair(1)
      end do
   end subroutine first_uniforms

   !> The 64-bit product of two 32-bit words, in halves.
   elemental subroutine multiply(odd, word, high, low)
      integer(i8), intent(in) :: odd, word
      integer(i8), intent(out) :: high, low

      ! As wide as it takes for the product not to overflow; it is one instruction all the same.
      integer, parameter :: wide = selected_int_kind(30)
      integer(wide) :: product

      product = int(odd, wide) * int(word, wide)
      low = int(iand(product, int(mask, wide)), i8)
      high = int(shiftr(product, 32), i8)
   end subroutine multiply

   !> 52 of 64 random bits as a real in the open interval (0, 1).
   !>
   !> One bit more, and the largest value would round to 1.
   pure function unit_real(low, high) result(uniform)
      integer(i8), intent(in) :: low, high
      real(wp) :: uniform

      uniform = (real(ior(ishft(high, 20), ishft(low, -12)), wp) + 0.5_wp) * 2.0_wp**(-52)
   end function unit_real

end module mesoslip_numerics_random
