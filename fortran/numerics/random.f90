!> Counter-based random numbers: every draw is a pure function of its key and counter.
!>
!> Philox 4x32-10 of J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers:
!> as easy as 1, 2, 3", SC'11. A draw of mesoslip is keyed by (seed, realization, contact, renewal),
!> so it does not depend on other draws.
module mesoslip_numerics_random
   use mesoslip_numerics_kinds, only: i8, wp
   implicit none
   private

   public :: philox4x32, philox_words, uniform_pair, uniform_pairs

   integer(i8), parameter :: mask = int(z'FFFFFFFF', i8)
   integer(i8), parameter :: multiplier_0 = int(z'D2511F53', i8)
   integer(i8), parameter :: multiplier_1 = int(z'CD9E8D57', i8)
   integer(i8), parameter :: weyl_0 = int(z'9E3779B9', i8)
   integer(i8), parameter :: weyl_1 = int(z'BB67AE85', i8)
   integer, parameter :: rounds = 10

   !> Contacts whose words are mixed side by side: one round waits for the one before, but not for
   !> those of another contact. The words of two fill the registers.
   integer, parameter :: abreast = 2

contains

   !> Philox 4x32-10: a keyed bijection of 128 bits.
   pure subroutine philox4x32(counter, key, word)
      !> Four 32-bit words, each in the low half of an element
      integer(i8), intent(in) :: counter(0:3)
      !> Two 32-bit words, each in the low half of an element
      integer(i8), intent(in) :: key(0:1)
      !> Four random 32-bit words, each in the low half of an element
      integer(i8), intent(out) :: word(0:3)

      integer(i8) :: round_key(0:1, rounds)
      integer :: round

      round_key = round_keys(key)
      word = counter
      do round = 1, rounds
         call mix(word(0), word(1), word(2), word(3), round_key(0, round), round_key(1, round))
      end do
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

      call philox_words(seed, realization, contact, renewal, attempt, word)
      uniform(1) = unit_real(word(0), word(1))
      uniform(2) = unit_real(word(2), word(3))
   end subroutine uniform_pair

   !> The random words from which the deviates of a birth are made.
   pure subroutine philox_words(seed, realization, contact, renewal, attempt, word)
      !> The key, as that of uniform_pair
      integer(i8), intent(in) :: seed, realization, contact, renewal, attempt
      !> Four random 32-bit words, each in the low half of an element
      integer(i8), intent(out) :: word(0:3)

      call philox4x32([contact, iand(renewal, mask), &
         & ior(ishft(renewal, -32), ishft(attempt, 16)), realization], &
         & [iand(seed, mask), ishft(seed, -32)], word)
   end subroutine philox_words

   !> The pairs of several contacts at one attempt, to the same bits and in less time.
   pure subroutine uniform_pairs(seed, realization, contact, renewal, attempt, first, second)
      !> Seed of the run, and number of the realization
      integer(i8), intent(in) :: seed, realization
      !> Numbers of the contacts, and how often each has been born before
      integer(i8), intent(in), contiguous :: contact(:), renewal(:)
      !> Number of the attempt
      integer(i8), intent(in) :: attempt
      !> The two deviates of each, shape that of contact
      real(wp), intent(out), contiguous :: first(:), second(:)

      integer(i8), dimension(abreast) :: word_0, word_1, word_2, word_3
      integer(i8) :: round_key(0:1, rounds)
      integer :: place(abreast), start, lane, round

      round_key = round_keys([iand(seed, mask), ishft(seed, -32)])
      do start = 0, size(contact) - 1, abreast
         do lane = 1, abreast
            ! The last contact may come twice.
            place(lane) = min(start + lane, size(contact))
            word_0(lane) = contact(place(lane))
            word_1(lane) = iand(renewal(place(lane)), mask)
            word_2(lane) = ior(ishft(renewal(place(lane)), -32), ishft(attempt, 16))
            word_3(lane) = realization
         end do
         do round = 1, rounds
            call mix(word_0, word_1, word_2, word_3, round_key(0, round), round_key(1, round))
         end do
         do lane = 1, abreast
            first(place(lane)) = unit_real(word_0(lane), word_1(lane))
            second(place(lane)) = unit_real(word_2(lane), word_3(lane))
         end do
      end do
   end subroutine uniform_pairs

   !> The keys of all rounds.
   pure function round_keys(key) result(round_key)
      integer(i8), intent(in) :: key(0:1)
      integer(i8) :: round_key(0:1, rounds)

      integer :: round

      round_key(:, 1) = key
      do round = 2, rounds
         round_key(:, round) = iand(round_key(:, round - 1) + [weyl_0, weyl_1], mask)
      end do
   end function round_keys

   !> A round of Philox: two products, halves of which are mixed with the other words and the key.
   elemental subroutine mix(word_0, word_1, word_2, word_3, key_0, key_1)
      integer(i8), intent(inout) :: word_0, word_1, word_2, word_3
      integer(i8), intent(in) :: key_0, key_1

      integer(i8) :: high_0, high_1, low_0, low_1

      call multiply(multiplier_0, word_0, high_0, low_0)
      call multiply(multiplier_1, word_2, high_1, low_1)
      word_0 = ieor(ieor(high_1, word_1), key_0)
      word_2 = ieor(ieor(high_0, word_3), key_1)
      word_1 = low_1
      word_3 = low_0
   end subroutine mix

   !> The 64-bit product of two 32-bit words, in halves.
   elemental subroutine multiply(odd, word, high, low)
      !> The words, the first one greater than 2**31
      integer(i8), intent(in) :: odd, word
      integer(i8), intent(out) :: high, low

      integer(i8) :: product

      ! Less 2**32, and the product cannot overflow; its low half stays, its high one lacks a word.
      product = (odd - 2_i8**32) * word
      low = iand(product, mask)
      high = shifta(product, 32) + word
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
