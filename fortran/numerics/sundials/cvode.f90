!> The integrator CVODE of SUNDIALS.
module mesoslip_numerics_sundials_cvode
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_funptr, c_int, c_loc, &
      & c_long, c_null_char, c_null_ptr, c_ptr
   use mesoslip_numerics_errors, only: error_type, raise, status_failed
   use mesoslip_numerics_sundials_index, only: sunindextype
   use mesoslip_numerics_sundials_library, only: CV_ADAMS, CV_BDF, CV_NORMAL, CV_ONE_STEP, &
      & CV_ROOT_RETURN, CVode, CVodeCreate, CVodeFree, CVodeGetDky, CVodeGetLastOrder, &
      & CVodeGetLastStep, CVodeGetNumErrTestFails, CVodeGetNumRhsEvals, CVodeGetNumSteps, &
      & CVodeInit, CVodeReInit, CVodeRootInit, CVodeSetJacFn, CVodeSetLinearSolver, &
      & CVodeSetMaxNumSteps, CVodeSetNonlinearSolver, CVodeSetStopTime, CVodeSetUserData, &
      & CVodeSStolerances, N_VDestroy, N_VMake_Serial, SUNBandMatrix, SUNContext_Free, &
      & SUNDIALSGetVersion, SUNLinSol_Band, SUNLinSolFree, SUNMatDestroy, &
      & SUNNonlinSol_FixedPoint, SUNNonlinSolFree, band_entries, create_context, vector_values
   use mesoslip_numerics_sundials_messages, only: collect_messages
   use mesoslip_numerics_sundials_text, only: message_type
   implicit none
   private

   public :: sundials_version, cvode_type
   public :: method_adams, method_bdf
   public :: band_entries, vector_values

   !> Adams-Moulton's formulas with a fixed-point iteration, for what is not stiff
   integer, parameter :: method_adams = 1
   !> Backward differentiation formulas with Newton's iteration and a banded matrix
   integer, parameter :: method_bdf = 2

   !> An integration by CVODE. The state is an array of the caller, which must be a target as long
   !> as the integrator lives; close frees everything.
   type :: cvode_type
      type(c_ptr), private :: context = c_null_ptr, memory = c_null_ptr, state = c_null_ptr
      type(c_ptr), private :: fixed_point = c_null_ptr, linear = c_null_ptr, matrix = c_null_ptr
      type(message_type), pointer, private :: message => null()
      !> Steps, evaluations of the rates and failed steps before the last restart
      integer(c_long), private :: counts_before(3) = 0_c_long
   contains
      !> Set up an integration
      procedure, non_overridable :: open
      !> Whether it is set up
      procedure, non_overridable :: is_open
      !> Give the Jacobian as a function, for method_bdf
      procedure, non_overridable :: set_jacobian
      !> Restart from the state in the caller's array
      procedure, non_overridable :: restart
      !> Make one step, not beyond a time
      procedure, non_overridable :: step
      !> Derivative of the interpolating polynomial of the last step
      procedure, non_overridable :: derivative
      !> Steps, evaluations of the rates and failed steps so far
      procedure, non_overridable :: counts
      !> Have the integration stop where functions are zero
      procedure, non_overridable :: find_roots
      !> Integrate up to a time, or to a root before it
      procedure, non_overridable :: integrate
      !> Free everything
      procedure, non_overridable :: close
      procedure, non_overridable, private :: expect
   end type cvode_type

contains

   !> Set up an integration.
   subroutine open(self, right_side, user_data, method, half_bandwidth, time, state, relative, &
      & absolute, error)
      !> The integrator, not open
      class(cvode_type), intent(inout) :: self
      !> Function of SUNDIALS' form that gives the rates, and what it gets
      type(c_funptr), intent(in) :: right_side
      type(c_ptr), intent(in) :: user_data
      !> One of the method_ codes; half the bandwidth of the Jacobian, of use for method_bdf
      integer, intent(in) :: method, half_bandwidth
      !> Time at the start, and state of the system
      real(c_double), intent(in) :: time
      real(c_double), intent(inout), target, contiguous :: state(:)
      !> Tolerances of the local error
      real(c_double), intent(in) :: relative, absolute
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      integer(c_long), parameter :: max_steps = 1000000_c_long
      integer(sunindextype) :: length, band

      length = size(state, kind=sunindextype)
      band = min(int(half_bandwidth, sunindextype), length - 1_sunindextype)
      allocate (self%message)
      call self%expect(create_context(self%context), "context", error)
      if (allocated(error)) return
      self%state = N_VMake_Serial(length, c_loc(state), self%context)
      self%memory = CVodeCreate(merge(CV_ADAMS, CV_BDF, method == method_adams), self%context)
      if (.not. (c_associated(self%state) .and. c_associated(self%memory))) then
         call self%expect(-1_c_int, "memory", error)
         return
      end if
      call collect_messages(self%context, self%memory, self%message)
      call self%expect(CVodeInit(self%memory, right_side, time, self%state), "start", error)
      if (allocated(error)) return
      call self%expect(CVodeSetUserData(self%memory, user_data), "data", error)
      if (allocated(error)) return
      call self%expect(CVodeSStolerances(self%memory, relative, absolute), "tolerances", error)
      if (allocated(error)) return
      call self%expect(CVodeSetMaxNumSteps(self%memory, max_steps), "steps", error)
      if (allocated(error)) return
      if (method == method_adams) then
         self%fixed_point = SUNNonlinSol_FixedPoint(self%state, 0_c_int, self%context)
         call self%expect(CVodeSetNonlinearSolver(self%memory, self%fixed_point), "solver", error)
      else
         self%matrix = SUNBandMatrix(length, band, band, self%context)
         self%linear = SUNLinSol_Band(self%state, self%matrix, self%context)
         call self%expect(CVodeSetLinearSolver(self%memory, self%linear, self%matrix), "solver", &
            & error)
      end if
   end subroutine open

   !> Whether the integrator is set up.
   pure function is_open(self)
      !> The integrator
      class(cvode_type), intent(in) :: self
      !> Whether it is
      logical :: is_open

      is_open = c_associated(self%memory)
   end function is_open

   !> Give the Jacobian as a function of SUNDIALS' form, for method_bdf.
   subroutine set_jacobian(self, jacobian, error)
      !> The integrator
      class(cvode_type), intent(inout) :: self
      !> The function, which fills a banded matrix
      type(c_funptr), intent(in) :: jacobian
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      call self%expect(CVodeSetJacFn(self%memory, jacobian), "Jacobian", error)
   end subroutine set_jacobian

   !> Restart from the state in the caller's array.
   subroutine restart(self, time, error)
      !> The integrator
      class(cvode_type), intent(inout) :: self
      !> Time at the start
      real(c_double), intent(in) :: time
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      self%counts_before = self%counts()
      call self%expect(CVodeReInit(self%memory, time, self%state), "restart", error)
   end subroutine restart

   !> Make one step, not beyond a time.
   subroutine step(self, stop_time, time, length, order, error)
      !> The integrator
      class(cvode_type), intent(inout) :: self
      !> Time that must not be passed
      real(c_double), intent(in) :: stop_time
      !> Time at the end of the step, its length and order
      real(c_double), intent(out) :: time, length
      integer, intent(out) :: order
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      integer(c_int) :: last_order, status

      time = stop_time
      length = 0.0_c_double
      order = 0
      call self%expect(CVodeSetStopTime(self%memory, stop_time), "stop time", error)
      if (allocated(error)) return
      status = CVode(self%memory, stop_time, self%state, time, CV_ONE_STEP)
      call self%expect(status, "integration", error)
      if (allocated(error)) return
      status = CVodeGetLastStep(self%memory, length)
      status = CVodeGetLastOrder(self%memory, last_order)
      order = int(last_order)
   end subroutine step

   !> Derivative of the interpolating polynomial of the last step.
   subroutine derivative(self, time, order, values, error)
      !> The integrator
      class(cvode_type), intent(inout) :: self
      !> A time within the step, and the order, at most that of the step
      real(c_double), intent(in) :: time
      integer, intent(in) :: order
      !> The derivative, shape of the state
      real(c_double), intent(inout), target, contiguous :: values(:)
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: vector
      integer(c_int) :: status

      vector = N_VMake_Serial(size(values, kind=sunindextype), c_loc(values), self%context)
      status = CVodeGetDky(self%memory, time, int(order, c_int), vector)
      call N_VDestroy(vector)
      call self%expect(status, "interpolation", error)
   end subroutine derivative

   !> Steps, evaluations of the rates and failed steps so far.
   function counts(self)
      !> The integrator
      class(cvode_type), intent(in) :: self
      !> These three
      integer(c_long) :: counts(3)

      integer(c_long) :: number
      integer(c_int) :: status

      counts = self%counts_before
      if (.not. self%is_open()) return
      status = CVodeGetNumSteps(self%memory, number)
      if (status >= 0) counts(1) = counts(1) + number
      status = CVodeGetNumRhsEvals(self%memory, number)
      if (status >= 0) counts(2) = counts(2) + number
      status = CVodeGetNumErrTestFails(self%memory, number)
      if (status >= 0) counts(3) = counts(3) + number
   end function counts

   !> Have the integration stop where functions are zero.
   subroutine find_roots(self, functions, number, error)
      !> The integrator
      class(cvode_type), intent(inout) :: self
      !> Function of SUNDIALS' form that gives the values, and how many there are
      type(c_funptr), intent(in) :: functions
      integer, intent(in) :: number
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      call self%expect(CVodeRootInit(self%memory, int(number, c_int), functions), "roots", error)
   end subroutine find_roots

   !> Integrate up to a time, or to a root before it. The state is in the array given to open.
   subroutine integrate(self, end_time, time, has_root, error)
      !> The integrator
      class(cvode_type), intent(inout) :: self
      !> Time to come to
      real(c_double), intent(in) :: end_time
      !> Time that it came to
      real(c_double), intent(out) :: time
      !> Whether a function is zero there
      logical, intent(out) :: has_root
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      integer(c_int) :: status

      time = end_time
      status = CVode(self%memory, end_time, self%state, time, CV_NORMAL)
      has_root = status == CV_ROOT_RETURN
      if (status < 0) call self%expect(status, "integration", error)
   end subroutine integrate

   !> Make sure that a call succeeded; otherwise free everything.
   subroutine expect(self, status, what, error)
      class(cvode_type), intent(inout) :: self
      !> Status that SUNDIALS returned
      integer(c_int), intent(in) :: status
      !> The call
      character(len=*), intent(in) :: what
      type(error_type), allocatable, intent(inout) :: error

      character(len=12) :: code

      if (status >= 0) return
      write (code, "(i0)") status
      call raise(error, status_failed, "CVODE failed (" // what // ", code " // trim(code) &
         & // "): " // trim(self%message%text))
      call self%close()
   end subroutine expect

   !> Free everything; does nothing if there is nothing to free.
   subroutine close(self)
      !> The integrator
      class(cvode_type), intent(inout) :: self

      integer(c_int) :: status

      if (c_associated(self%memory)) call CVodeFree(self%memory)
      if (c_associated(self%fixed_point)) status = SUNNonlinSolFree(self%fixed_point)
      if (c_associated(self%linear)) status = SUNLinSolFree(self%linear)
      if (c_associated(self%matrix)) call SUNMatDestroy(self%matrix)
      if (c_associated(self%state)) call N_VDestroy(self%state)
      if (c_associated(self%context)) status = SUNContext_Free(self%context)
      if (associated(self%message)) deallocate (self%message)
      self%memory = c_null_ptr
      self%context = c_null_ptr
      self%state = c_null_ptr
      self%fixed_point = c_null_ptr
      self%linear = c_null_ptr
      self%matrix = c_null_ptr
   end subroutine close

   !> Version of the SUNDIALS library in use; empty if unknown.
   function sundials_version() result(version)
      !> Such as 6.4.1
      character(len=:), allocatable :: version

      integer, parameter :: longest = 32
      character(kind=c_char) :: text(longest)
      integer :: place

      text = c_null_char
      version = ""
      if (SUNDIALSGetVersion(text, int(longest, c_int)) /= 0) return
      do place = 1, longest
         if (text(place) == c_null_char) exit
         version = version // text(place)
      end do
   end function sundials_version

end module mesoslip_numerics_sundials_cvode
