!> The integrator CVODE of SUNDIALS, through cvode.c.
module mesoslip_numerics_sundials_cvode
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_funloc, c_funptr, &
      & c_int, c_long, c_null_char, c_null_funptr, c_null_ptr, c_ptr
   use mesoslip_numerics_errors, only: error_type, raise, status_failed
   implicit none
   private

   public :: sundials_version, cvode_type
   public :: rates_function, jacobian_function, root_function
   public :: method_adams, method_bdf

   !> Adams-Moulton formulas with a fixed-point iteration, for non-stiff problems
   integer, parameter :: method_adams = 1
   !> Backward differentiation formulas with Newton's iteration and a banded matrix
   integer, parameter :: method_bdf = 2
   !> Maximum length of a text of SUNDIALS
   integer, parameter :: max_text = 160

   !> An integration by CVODE. The state is an array of the caller, which must be a target as long
   !> as the integrator lives; close frees everything.
   type :: cvode_type
      type(c_ptr), private :: address = c_null_ptr
      !> Steps, evaluations of the rates and failed steps before the last restart
      integer(c_long), private :: counts_before(3) = 0_c_long
   contains
      procedure, non_overridable :: open
      procedure, non_overridable :: is_open
      procedure, non_overridable :: restart
      procedure, non_overridable :: step
      procedure, non_overridable :: derivative
      procedure, non_overridable :: counts
      procedure, non_overridable :: integrate
      procedure, non_overridable :: close
      procedure, non_overridable, private :: expect
   end type cvode_type

   abstract interface
      !> Rates of a state.
      function rates_function(time, size, state, rates, data) bind(c) result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         !> Time, and length of the state
         real(c_double), value :: time
         integer(c_int), value :: size
         real(c_double), intent(in) :: state(size)
         real(c_double), intent(inout) :: rates(size)
         !> Data of the caller
         type(c_ptr), value :: data
         !> 0, or -1 if they cannot be computed
         integer(c_int) :: status
      end function rates_function

      !> Fill the Jacobian of the rates of a linear system, a banded matrix.
      subroutine jacobian_function(rows, size, upper, entries, data) bind(c)
         import :: c_double, c_int, c_ptr
         implicit none
         !> Shape of the array; rows above that of the main diagonal
         integer(c_int), value :: rows, size, upper
         !> Entry (i, j) of the matrix is in row upper + 1 + i - j of column j
         real(c_double), intent(inout) :: entries(rows, size)
         !> Data of the caller
         type(c_ptr), value :: data
      end subroutine jacobian_function

      !> A function of the state, at whose zeros an integration stops.
      function root_function(time, size, state, data) bind(c) result(value)
         import :: c_double, c_int, c_ptr
         implicit none
         !> Time, and length of the state
         real(c_double), value :: time
         integer(c_int), value :: size
         real(c_double), intent(in) :: state(size)
         !> Data of the caller
         type(c_ptr), value :: data
         real(c_double) :: value
      end function root_function
   end interface

   ! Functions of cvode.c; a negative status is a failure.
   interface
      function c_open(cvode, rates, jacobian, root, data, is_stiff, half_bandwidth, time, size, &
         & state, relative, absolute) bind(c, name="mesoslip_cvode_open") result(status)
         import :: c_double, c_funptr, c_int, c_ptr
         implicit none
         type(c_ptr), intent(out) :: cvode
         type(c_funptr), value :: rates, jacobian, root
         type(c_ptr), value :: data
         integer(c_int), value :: is_stiff, half_bandwidth, size
         real(c_double), value :: time, relative, absolute
         real(c_double), intent(inout) :: state(size)
         integer(c_int) :: status
      end function c_open

      function c_restart(cvode, time) bind(c, name="mesoslip_cvode_restart") result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         type(c_ptr), value :: cvode
         real(c_double), value :: time
         integer(c_int) :: status
      end function c_restart

      function c_step(cvode, stop_time, time, length, order) bind(c, name="mesoslip_cvode_step") &
         & result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         type(c_ptr), value :: cvode
         real(c_double), value :: stop_time
         real(c_double), intent(inout) :: time, length
         integer(c_int), intent(inout) :: order
         integer(c_int) :: status
      end function c_step

      function c_derivative(cvode, time, order, size, values) &
         & bind(c, name="mesoslip_cvode_derivative") result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         type(c_ptr), value :: cvode
         real(c_double), value :: time
         integer(c_int), value :: order, size
         real(c_double), intent(inout) :: values(size)
         integer(c_int) :: status
      end function c_derivative

      function c_integrate(cvode, end_time, time, has_root) &
         & bind(c, name="mesoslip_cvode_integrate") result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         type(c_ptr), value :: cvode
         real(c_double), value :: end_time
         real(c_double), intent(inout) :: time
         integer(c_int), intent(inout) :: has_root
         integer(c_int) :: status
      end function c_integrate

      subroutine c_counts(cvode, counts) bind(c, name="mesoslip_cvode_counts")
         import :: c_long, c_ptr
         implicit none
         type(c_ptr), value :: cvode
         integer(c_long), intent(inout) :: counts(3)
      end subroutine c_counts

      subroutine c_message(cvode, text, length) bind(c, name="mesoslip_cvode_message")
         import :: c_char, c_int, c_ptr
         implicit none
         type(c_ptr), value :: cvode
         integer(c_int), value :: length
         character(kind=c_char), intent(inout) :: text(length)
      end subroutine c_message

      subroutine c_close(cvode) bind(c, name="mesoslip_cvode_close")
         import :: c_ptr
         implicit none
         type(c_ptr), value :: cvode
      end subroutine c_close

      subroutine c_version(text, length) bind(c, name="mesoslip_cvode_version")
         import :: c_char, c_int
         implicit none
         integer(c_int), value :: length
         character(kind=c_char), intent(inout) :: text(length)
      end subroutine c_version
   end interface

contains

   !> Set up an integration.
   subroutine open(self, rates, data, method, half_bandwidth, time, state, relative, absolute, &
      & jacobian, root, error)
      class(cvode_type), intent(inout) :: self
      procedure(rates_function) :: rates
      !> What these functions get
      type(c_ptr), intent(in) :: data
      !> One of the method_ codes; half the bandwidth of the Jacobian, used by method_bdf
      integer, intent(in) :: method, half_bandwidth
      !> Time at the start, and state of the system
      real(c_double), intent(in) :: time
      real(c_double), intent(inout), target, contiguous :: state(:)
      !> Tolerances of the local error
      real(c_double), intent(in) :: relative, absolute
      !> The Jacobian, otherwise differences of the rates; a function at whose zeros integrate stops
      procedure(jacobian_function), optional :: jacobian
      procedure(root_function), optional :: root
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      type(c_funptr) :: jacobian_address, root_address

      jacobian_address = c_null_funptr
      root_address = c_null_funptr
      if (present(jacobian)) jacobian_address = c_funloc(jacobian)
      if (present(root)) root_address = c_funloc(root)
      self%counts_before = 0_c_long
      call self%expect(c_open(self%address, c_funloc(rates), jacobian_address, root_address, data, &
         & merge(1_c_int, 0_c_int, method == method_bdf), int(half_bandwidth, c_int), time, &
         & int(size(state), c_int), state, relative, absolute), "start", error)
   end subroutine open

   !> Whether it is set up.
   pure function is_open(self)
      class(cvode_type), intent(in) :: self
      logical :: is_open

      is_open = c_associated(self%address)
   end function is_open

   !> Restart from the state in the caller's array.
   subroutine restart(self, time, error)
      class(cvode_type), intent(inout) :: self
      !> Time at the start
      real(c_double), intent(in) :: time
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      self%counts_before = self%counts()
      call self%expect(c_restart(self%address, time), "restart", error)
   end subroutine restart

   !> Make one step, not beyond a time.
   subroutine step(self, stop_time, time, length, order, error)
      class(cvode_type), intent(inout) :: self
      !> Time that must not be passed
      real(c_double), intent(in) :: stop_time
      !> Time at the end of the step, its length and order
      real(c_double), intent(out) :: time, length
      integer, intent(out) :: order
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      integer(c_int) :: last_order

      time = stop_time
      length = 0.0_c_double
      last_order = 0_c_int
      call self%expect(c_step(self%address, stop_time, time, length, last_order), "integration", &
         & error)
      order = int(last_order)
   end subroutine step

   !> Derivative of the interpolating polynomial of the last step.
   subroutine derivative(self, time, order, values, error)
      class(cvode_type), intent(inout) :: self
      !> A time within the step, and the order, at most that of the step
      real(c_double), intent(in) :: time
      integer, intent(in) :: order
      !> The derivative, shape of the state
      real(c_double), intent(inout), contiguous :: values(:)
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      call self%expect(c_derivative(self%address, time, int(order, c_int), &
         & int(size(values), c_int), values), "interpolation", error)
   end subroutine derivative

   !> Integrate up to a time, or to a root before it. The state is in the array given to open.
   subroutine integrate(self, end_time, time, has_root, error)
      class(cvode_type), intent(inout) :: self
      !> Time to reach
      real(c_double), intent(in) :: end_time
      !> Time reached
      real(c_double), intent(out) :: time
      !> Whether the root function is zero there
      logical, intent(out) :: has_root
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      integer(c_int) :: root

      time = end_time
      root = 0_c_int
      call self%expect(c_integrate(self%address, end_time, time, root), "integration", error)
      has_root = root /= 0_c_int
   end subroutine integrate

   !> Steps, evaluations of the rates and failed steps so far.
   function counts(self)
      class(cvode_type), intent(in) :: self
      integer(c_long) :: counts(3)

      counts = 0_c_long
      if (self%is_open()) call c_counts(self%address, counts)
      counts = self%counts_before + counts
   end function counts

   !> Make sure that a call succeeded; otherwise free everything.
   subroutine expect(self, status, what, error)
      class(cvode_type), intent(inout) :: self
      !> Status that cvode.c returned
      integer(c_int), intent(in) :: status
      !> The call
      character(len=*), intent(in) :: what
      type(error_type), allocatable, intent(inout) :: error

      character(kind=c_char, len=max_text) :: text
      character(len=12) :: code

      if (status >= 0) return
      write (code, "(i0)") status
      call c_message(self%address, text, int(max_text, c_int))
      call raise(error, status_failed, "CVODE failed (" // what // ", code " // trim(code) &
         & // "): " // before_null(text))
      call self%close()
   end subroutine expect

   !> Free everything; does nothing if there is nothing to free.
   subroutine close(self)
      class(cvode_type), intent(inout) :: self

      call c_close(self%address)
      self%address = c_null_ptr
   end subroutine close

   !> Version of the SUNDIALS library in use, such as 6.4.1; empty if unknown or without SUNDIALS.
   function sundials_version() result(version)
      character(len=:), allocatable :: version

      character(kind=c_char, len=max_text) :: text

      call c_version(text, int(max_text, c_int))
      version = before_null(text)
   end function sundials_version

   !> Text of a C string.
   pure function before_null(text)
      character(kind=c_char, len=*), intent(in) :: text
      character(len=:), allocatable :: before_null

      before_null = text(:index(text, c_null_char) - 1)
   end function before_null

end module mesoslip_numerics_sundials_cvode
