!> Philox 4x32-10 against the known answers published with Random123, and the keying of draws.
program test_random
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: philox4x32, uniform_pair, uniform_pairs
   use testing, only: check, check_close, finish
   implicit none

   integer(i8), parameter :: ones = int(z'FFFFFFFF', i8)
   integer, parameter :: draws = 100000
   real(wp) :: pair(2), other(2), total, squares
   integer :: draw

   call known_answer([0_i8, 0_i8, 0_i8, 0_i8], [0_i8, 0_i8], &
      & [int(z'6627E8D5', i8), int(z'E169C58D', i8), int(z'BC57AC4C', i8), int(z'9B00DBD8', i8)], &
      & "zeros")
   call known_answer([ones, ones, ones, ones], [ones, ones], &
      & [int(z'408F276D', i8), int(z'41C83B0E', i8), int(z'A20BC7C6', i8), int(z'6D5451FD', i8)], &
      & "ones")
   call known_answer( &
      & [int(z'243F6A88', i8), int(z'85A308D3', i8), int(z'13198A2E', i8), int(z'03707344', i8)], &
      & [int(z'A4093822', i8), int(z'299F31D0', i8)], &
      & [int(z'D16CFE09', i8), int(z'94FDCCEB', i8), int(z'5001E420', i8), int(z'24126EA1', i8)], &
      & "digits of pi")

   call uniform_pair(7_i8, 2_i8, 5_i8, 3_i8, 0_i8, pair)
   call uniform_pair(7_i8, 2_i8, 5_i8, 3_i8 + 2_i8**32, 0_i8, other)
   call check(all(abs(pair - other) > 0.0_wp), "renewals beyond 2**32 differ")
   call uniform_pair(7_i8 + 2_i8**40, 2_i8, 5_i8, 3_i8, 0_i8, other)
   call check(all(abs(pair - other) > 0.0_wp), "seeds beyond 2**32 differ")
   call uniform_pair(7_i8, 2_i8, 5_i8, 3_i8, 1_i8, other)
   call check(all(abs(pair - other) > 0.0_wp), "attempts differ")

   call several_are_as_single_ones()

   total = 0.0_wp
   squares = 0.0_wp
   do draw = 1, draws
      call uniform_pair(1_i8, 0_i8, int(draw, i8), 0_i8, 0_i8, pair)
      total = total + sum(pair)
      squares = squares + sum(pair**2)
   end do
   call check_close(total / (2 * draws), 0.5_wp, 0.003_wp, "mean of the deviates")
   call check_close(squares / (2 * draws), 1.0_wp / 3.0_wp, 0.003_wp, "mean square of the deviates")
   call finish()

contains

   !> Check one published answer.
   subroutine known_answer(counter, key, expected, name)
      integer(i8), intent(in) :: counter(4), key(2), expected(4)
      character(len=*), intent(in) :: name

      integer(i8) :: word(4)

      call philox4x32(counter, key, word)
      call check(all(word == expected), "known answer: " // name)
   end subroutine known_answer

   !> Pairs of several contacts are those of each alone, for any number.
   subroutine several_are_as_single_ones()
      integer, parameter :: most = 70
      integer(i8), parameter :: seed = 7_i8 + 2_i8**40, realization = 2_i8**32 - 1_i8
      integer(i8) :: contact(most), renewal(most)
      real(wp) :: first(most), second(most), pair(2)
      integer :: length, place
      logical :: agree

      do place = 1, most
         contact(place) = iand(int(place, i8)**6, ones)
         renewal(place) = int(place, i8) * (2_i8**40 + 12345_i8)
      end do
      agree = .true.
      do length = 1, most
         first = -1.0_wp
         second = -1.0_wp
         call uniform_pairs(seed, realization, contact(:length), renewal(:length), 0_i8, &
            & first(:length), second(:length))
         do place = 1, length
            call uniform_pair(seed, realization, contact(place), renewal(place), 0_i8, pair)
            agree = agree .and. all(abs(pair - [first(place), second(place)]) <= 0.0_wp)
         end do
         agree = agree .and. all(first(length + 1:) < 0.0_wp) &
            & .and. all(second(length + 1:) < 0.0_wp)
      end do
      call check(agree, "pairs of 1 to 70 contacts are those of each alone")
      call uniform_pairs(seed, realization, contact(:0), renewal(:0), 0_i8, first(:0), second(:0))
      call check(all(first(2:) > 0.0_wp), "no contact, no draw")
   end subroutine several_are_as_single_ones

end program test_random
