!> Candidates of activated breaks: sums of weights, and times and contacts against exact rates.
program test_candidates
   use mesoslip_contacts_individual_record, only: record_length, row_limit, row_origin, &
      & row_stiffness
   use mesoslip_contacts_thermal_candidates, only: candidates_type, new_candidates
   use mesoslip_contacts_thermal_weight_tree, only: new_weight_tree, weight_tree_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use testing, only: check, check_close, finish
   implicit none

   !> Contacts of the tests, and samples
   integer, parameter :: count = 75, samples = 20000

   call sums_do_not_depend_on_the_order_of_changes()
   call breaks_have_the_rates(0.3_wp, 0.0_wp, "held")
   call breaks_have_the_rates(0.3_wp, 1.0e3_wp, "window of a fast motion")
   call breaks_have_the_rates(-0.1_wp, 1.0_wp, "forces of both signs")
   call finish()

contains

   !> A part of the sum belongs to the contact that it lies in.
   subroutine sums_do_not_depend_on_the_order_of_changes()
      type(weight_tree_type) :: tree, other
      type(error_type), allocatable :: error
      real(wp) :: fraction, below
      integer :: contact, found
      logical :: is_right

      call new_weight_tree(tree, count, error)
      call new_weight_tree(other, count, error)
      do contact = 1, count
         call tree%set(contact, 1.0_wp)
         call tree%update()
         call tree%set(contact, weight(contact))
         call other%set(count + 1 - contact, weight(count + 1 - contact))
      end do
      call tree%update()
      call other%update_all()
      call check(.not. abs(tree%total() - other%total()) > 0.0_wp, "sums in any order")
      below = 0.0_wp
      is_right = .true.
      do contact = 1, count
         if (weight(contact) > 0.0_wp) then
            call tree%find(below + 0.25_wp * weight(contact), found, fraction)
            is_right = is_right .and. found == contact .and. abs(fraction - 0.25_wp) < 1.0e-9_wp
         end if
         below = below + weight(contact)
      end do
      call check(is_right, "contacts at parts of the sum")
      call check_close(tree%total(), below, 1.0e-12_wp * below, "sum")
   end subroutine sums_do_not_depend_on_the_order_of_changes

   !> Weights, some of which are 0.
   pure function weight(contact)
      integer, intent(in) :: contact
      real(wp) :: weight

      weight = modulo(contact * 0.618_wp, 1.0_wp)
      if (modulo(contact, 7) == 0) weight = 0.0_wp
   end function weight

   !> The first accepted candidates of a slider that stays, whatever window its velocity suggests.
   subroutine breaks_have_the_rates(displacement, velocity, name)
      real(wp), intent(in) :: displacement, velocity
      character(len=*), intent(in) :: name

      real(wp), parameter :: slope = 8.0_wp
      type(candidates_type) :: candidates
      type(error_type), allocatable :: error
      real(wp) :: record(record_length, count), rate(count), time, mean, deviation
      integer :: contact, sample, event, chosen(count)

      record = 0.0_wp
      do contact = 1, count
         record(row_origin, contact) = modulo(contact * 0.414_wp, 1.0_wp) - 0.5_wp
         record(row_limit, contact) = 0.85_wp + 0.2_wp * weight(contact)
         if (modulo(contact, 5) > 0) record(row_stiffness, contact) = 1.0_wp
      end do
      rate = 0.0_wp
      where (record(row_stiffness, :) > 0.0_wp) rate = 2.0_wp * exp(slope &
         & * (abs(displacement - record(row_origin, :)) - record(row_limit, :)))
      call new_candidates(candidates, count, 2.0_wp, slope, 3_i8, 1_i8, error)
      chosen = 0
      mean = 0.0_wp
      do sample = 1, samples
         time = 0.0_wp
         search: do
            call candidates%draw(time, displacement, velocity, record)
            do event = 1, candidates%drawn
               time = candidates%candidate(event)%time
               contact = candidates%candidate(event)%contact
               if (candidates%accepts(candidates%candidate(event), displacement, &
                  & record(:, contact), record(row_limit, contact))) exit search
            end do
         end do search
         chosen(contact) = chosen(contact) + 1
         mean = mean + time / samples
      end do
      call check_close(mean * sum(rate), 1.0_wp, 4.0_wp / sqrt(real(samples, wp)), &
         & name // ": mean time")
      rate = samples * rate / sum(rate)
      deviation = sum((chosen - rate)**2 / rate, rate > 0.0_wp)
      associate (freedom => count_of(rate) - 1.0_wp)
         call check_close(deviation, freedom, 5.0_wp * sqrt(2.0_wp * freedom), &
            & name // ": contacts")
      end associate
   end subroutine breaks_have_the_rates

   !> Number of positive rates.
   pure function count_of(rate) result(number)
      real(wp), intent(in) :: rate(:)
      real(wp) :: number

      number = sum(merge(1.0_wp, 0.0_wp, rate > 0.0_wp))
   end function count_of

end program test_candidates
