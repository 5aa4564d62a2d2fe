!> Contacts in the order of keys, removed and inserted at any time, against a search of all.
program test_scan_order
   use mesoslip_contacts_individual_scan_order, only: new_scan_order, scan_order_type
   use mesoslip_numerics_errors, only: error_type
   use mesoslip_numerics_kinds, only: i8, wp
   use mesoslip_numerics_random, only: uniform_pair
   use testing, only: check, finish
   implicit none

   call follows(40, 1.0_wp)
   call follows(1000, 1.0_wp)
   call follows(1000, 300.0_wp)
   call finish()

contains

   !> Contacts are inserted and removed, some with their last key.
   subroutine follows(count, width)
      integer, intent(in) :: count
      !> Keys are spread over this many e-folds
      real(wp), intent(in) :: width

      integer, parameter :: steps = 4000, limit = 7
      type(scan_order_type) :: order
      type(error_type), allocatable :: error
      real(wp) :: key(count), old(count), listed(limit), first, uniform(2)
      integer :: step, contact, number, due, contacts(limit), position
      logical :: agrees

      call new_scan_order(order, count, error)
      key = huge(1.0_wp)
      old = huge(1.0_wp)
      agrees = .not. allocated(error)
      do step = 1, steps
         call uniform_pair(1_i8, 0_i8, int(step, i8), int(count, i8), 0_i8, uniform)
         contact = 1 + int(uniform(1) * count)
         if (key(contact) < huge(1.0_wp) .and. uniform(2) < 0.5_wp) then
            old(contact) = key(contact)
            key(contact) = huge(1.0_wp)
            call order%remove(contact)
         else
            if (.not. (old(contact) < huge(1.0_wp) .and. uniform(2) < 0.7_wp)) then
               old(contact) = exp(width * uniform(2))
            end if
            key(contact) = old(contact)
            call order%put(contact, key(contact))
         end if
         call order%first(first)
         call order%due(first, due)
         agrees = agrees .and. abs(first - minval(key)) <= 0.0_wp &
            & .and. abs(order%lowest() - first) <= 0.0_wp
         if (first < huge(1.0_wp)) agrees = agrees .and. due == minloc(key, dim=1)
         call order%preview(limit, contacts, listed, number)
         do position = 1, number
            agrees = agrees .and. abs(key(contacts(position)) - listed(position)) <= 0.0_wp &
               & .and. size(pack(key, key < listed(position))) == position - 1
         end do
      end do
      call check(agrees, "contacts are in order")
   end subroutine follows

end program test_scan_order
