!> Large pages of memory for long arrays.
!>
!> Contacts break in an order that has nothing to do with their numbers. With a million of them the
!> processor has to look up the address of nearly each one that it reads, unless pages are large.
module mesoslip_numerics_memory
   use, intrinsic :: iso_c_binding, only: c_double, c_loc, c_ptr, c_size_t
   implicit none
   private

   public :: request_large_pages

   interface
      !> The same, in C
      subroutine request_pages(array, length) bind(c, name="mesoslip_request_large_pages")
         import :: c_ptr, c_size_t
         implicit none
         type(c_ptr), value :: array
         !> In bytes
         integer(c_size_t), value :: length
      end subroutine request_pages
   end interface

contains

   !> Ask for large pages of memory for an array, before anything is written to it (Linux, where the
   !> system may refuse; nothing is done elsewhere).
   subroutine request_large_pages(array, length)
      integer, intent(in) :: length
      real(c_double), intent(inout), target :: array(length)

      if (length < 1) return
      call request_pages(c_loc(array(1)), 8_c_size_t * int(length, c_size_t))
   end subroutine request_large_pages

end module mesoslip_numerics_memory
