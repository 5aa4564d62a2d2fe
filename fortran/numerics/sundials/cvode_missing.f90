!> Stand-in for CVODE in a build without SUNDIALS: it cannot be opened.
module mesoslip_numerics_sundials_cvode
   use, intrinsic :: iso_c_binding, only: c_double, c_funptr, c_long, c_ptr
   use mesoslip_numerics_errors, only: error_type, raise, status_failed
   implicit none
   private

   public :: sundials_version, cvode_type
   public :: method_adams, method_bdf
   public :: band_entries, vector_values

   !> As with SUNDIALS, so that names of solvers are the same
   integer, parameter :: method_adams = 1, method_bdf = 2

   !> An integration that cannot be opened.
   type :: cvode_type
   contains
      procedure, nopass, non_overridable :: open
      procedure, nopass, non_overridable :: is_open
      procedure, nopass, non_overridable :: set_jacobian
      procedure, nopass, non_overridable :: restart
      procedure, nopass, non_overridable :: step
      procedure, nopass, non_overridable :: derivative
      procedure, nopass, non_overridable :: counts
      procedure, nopass, non_overridable :: find_roots
      procedure, nopass, non_overridable :: integrate
      procedure, nopass, non_overridable :: close
   end type cvode_type

contains

   !> The error of every procedure.
   subroutine refuse(error)
      !> Set
      type(error_type), allocatable, intent(out) :: error

      call raise(error, status_failed, "CVODE is missing: mesoslip was built without SUNDIALS")
   end subroutine refuse

   !> Fails.
   subroutine open(right_side, user_data, method, half_bandwidth, time, state, relative, &
      & absolute, error)
      type(c_funptr), intent(in) :: right_side
      type(c_ptr), intent(in) :: user_data
      integer, intent(in) :: method, half_bandwidth
      real(c_double), intent(in) :: time
      real(c_double), intent(inout), target, contiguous :: state(:)
      real(c_double), intent(in) :: relative, absolute
      !> Set
      type(error_type), allocatable, intent(out) :: error

      call refuse(error)
   end subroutine open

   !> It is not.
   pure logical function is_open()

      is_open = .false.
   end function is_open

   !> Fails.
   subroutine set_jacobian(jacobian, error)
      type(c_funptr), intent(in) :: jacobian
      !> Set
      type(error_type), allocatable, intent(out) :: error

      call refuse(error)
   end subroutine set_jacobian

   !> Fails.
   subroutine restart(time, error)
      real(c_double), intent(in) :: time
      !> Set
      type(error_type), allocatable, intent(out) :: error

      call refuse(error)
   end subroutine restart

   !> Fails.
   subroutine step(stop_time, time, length, order, error)
      real(c_double), intent(in) :: stop_time
      real(c_double), intent(out) :: time, length
      integer, intent(out) :: order
      !> Set
      type(error_type), allocatable, intent(out) :: error

      time = stop_time
      length = 0.0_c_double
      order = 0
      call refuse(error)
   end subroutine step

   !> Fails.
   subroutine derivative(time, order, values, error)
      real(c_double), intent(in) :: time
      integer, intent(in) :: order
      real(c_double), intent(inout), target, contiguous :: values(:)
      !> Set
      type(error_type), allocatable, intent(out) :: error

      call refuse(error)
   end subroutine derivative

   !> None.
   pure function counts()
      integer(c_long) :: counts(3)

      counts = 0_c_long
   end function counts

   !> Fails.
   subroutine find_roots(functions, number, error)
      type(c_funptr), intent(in) :: functions
      integer, intent(in) :: number
      !> Set
      type(error_type), allocatable, intent(out) :: error

      call refuse(error)
   end subroutine find_roots

   !> Fails.
   subroutine integrate(end_time, time, has_root, error)
      real(c_double), intent(in) :: end_time
      real(c_double), intent(out) :: time
      logical, intent(out) :: has_root
      !> Set
      type(error_type), allocatable, intent(out) :: error

      time = end_time
      has_root = .false.
      call refuse(error)
   end subroutine integrate

   !> Nothing is to be freed.
   subroutine close()
   end subroutine close

   !> There is none.
   pure function sundials_version() result(version)
      !> Empty
      character(len=:), allocatable :: version

      version = ""
   end function sundials_version

   !> No vectors come from CVODE.
   function vector_values(vector) result(values)
      type(c_ptr), intent(in) :: vector
      !> Null
      real(c_double), pointer, contiguous :: values(:)

      nullify (values)
   end function vector_values

   !> No matrices come from CVODE.
   subroutine band_entries(matrix, entries, upper)
      type(c_ptr), intent(in) :: matrix
      !> Null
      real(c_double), pointer, contiguous, intent(out) :: entries(:, :)
      !> 0
      integer, intent(out) :: upper

      nullify (entries)
      upper = 0
   end subroutine band_entries

end module mesoslip_numerics_sundials_cvode
