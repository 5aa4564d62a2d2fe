!> SUNDIALS, with the names of its version 7; for version 6 see sundials_6.f90.
module mesoslip_sundials_cvode
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
   implicit none
   private

   public :: sundials_version

   interface
      !> Version of the SUNDIALS library; its Fortran modules have no such function.
      function get_version(version, length) bind(c, name="SUNDIALSGetVersion") result(status)
         import :: c_char, c_int
         implicit none
         !> The version, a C string
         character(kind=c_char), intent(out) :: version(*)
         !> Room for it
         integer(c_int), value, intent(in) :: length
         !> 0 means success
         integer(c_int) :: status
      end function get_version
   end interface

contains

   !> Version of the SUNDIALS library in use; empty if it does not tell.
   function sundials_version() result(version)
      !> Such as 6.4.1
      character(len=:), allocatable :: version

      integer, parameter :: longest = 32
      character(kind=c_char) :: text(longest)
      integer :: place

      text = c_null_char
      version = ""
      if (get_version(text, int(longest, c_int)) /= 0) return
      do place = 1, longest
         if (text(place) == c_null_char) exit
         version = version // text(place)
      end do
   end function sundials_version

end module mesoslip_sundials_cvode
