!> The integrator CVODE of SUNDIALS, with the names of version 7; for version 6 see sundials_6.f90.
module mesoslip_sundials_cvode
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_funloc, c_funptr, &
      & c_int, c_loc, c_long, c_null_char, c_null_ptr, c_ptr
   use fcvode_mod, only: CV_ADAMS, CV_BDF, CV_NORMAL, CV_ONE_STEP, CV_ROOT_RETURN, FCVode, &
      & FCVodeCreate, FCVodeFree, FCVodeGetDky, FCVodeGetNumErrTestFails, FCVodeGetNumRhsEvals, &
      & FCVodeGetNumSteps, FCVodeInit, FCVodeReInit, FCVodeRootInit, FCVodeSetInitStep, &
      & FCVodeSetJacFn, FCVodeSetLinearSolver, FCVodeSetMaxNumSteps, FCVodeSetMaxStep, &
      & FCVodeSetNonlinearSolver, FCVodeSetUserData, FCVodeSStolerances
   use fnvector_serial_mod, only: FN_VMake_Serial
   use fsundials_core_mod, only: FN_VDestroy, FSUNContext_Create, FSUNContext_Free, &
      & FSUNLinSolFree, FSUNMatDestroy, FSUNNonlinSolFree, N_Vector, SUN_COMM_NULL, &
      & SUNLinearSolver, SUNMatrix, SUNNonlinearSolver
   use fsunlinsol_band_mod, only: FSUNLinSol_Band
   use fsunmatrix_band_mod, only: FSUNBandMatrix
   use fsunnonlinsol_fixedpoint_mod, only: FSUNNonlinSol_FixedPoint
   use mesoslip_errors, only: error_type, raise, status_failed
   use mesoslip_sundials_index, only: sunindextype
   use mesoslip_sundials_messages, only: collect_messages, message_type
   implicit none
   private

   public :: sundials_version, cvode_type
   public :: method_adams, method_bdf

   !> Adams-Moulton's formulas with a fixed-point iteration, for what is not stiff
   integer, parameter :: method_adams = 1
   !> Backward differentiation formulas with Newton's iteration and a banded matrix
   integer, parameter :: method_bdf = 2

   !> An integration by CVODE. The state is an array of the caller, which must be a target as long
   !> as the integrator lives; close frees everything.
   type :: cvode_type
      type(c_ptr), private :: context = c_null_ptr, memory = c_null_ptr
      type(N_Vector), pointer, private :: state => null(), dense => null()
      type(SUNNonlinearSolver), pointer, private :: fixed_point => null()
      type(SUNLinearSolver), pointer, private :: linear => null()
      type(SUNMatrix), pointer, private :: matrix => null()
      type(message_type), pointer, private :: message => null()
      integer(c_long), private :: steps_before = 0, evaluations_before = 0, failures_before = 0
   contains
      !> Set up an integration
      procedure :: open
      !> Have the integration stop where functions are zero
      procedure :: find_roots
      !> Integrate up to a time, or to a root before it
      procedure :: integrate
      !> Free everything
      procedure :: close
      procedure, private :: expect
   end type cvode_type

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

      integer(c_long), parameter :: most_steps = 1000000_c_long
      integer(sunindextype) :: length, band

      length = size(state, kind=sunindextype)
      band = min(int(half_bandwidth, sunindextype), length - 1_sunindextype)
      allocate (self%message)
      call self%expect(FSUNContext_Create(SUN_COMM_NULL, self%context), "context", error)
      if (allocated(error)) return
      self%state => FN_VMake_Serial(length, state, self%context)
      self%memory = FCVodeCreate(merge(CV_ADAMS, CV_BDF, method == method_adams), self%context)
      if (.not. (associated(self%state) .and. c_associated(self%memory))) then
         call self%expect(-1_c_int, "memory", error)
         return
      end if
      call collect_messages(self%context, self%memory, self%message)
      call self%expect(FCVodeInit(self%memory, right_side, time, self%state), "start", error)
      if (allocated(error)) return
      call self%expect(FCVodeSetUserData(self%memory, user_data), "data", error)
      if (allocated(error)) return
      call self%expect(FCVodeSStolerances(self%memory, relative, absolute), "tolerances", error)
      if (allocated(error)) return
      call self%expect(FCVodeSetMaxNumSteps(self%memory, most_steps), "steps", error)
      if (allocated(error)) return
      if (method == method_adams) then
         self%fixed_point => FSUNNonlinSol_FixedPoint(self%state, 0_c_int, self%context)
         call self%expect(FCVodeSetNonlinearSolver(self%memory, self%fixed_point), "solver", error)
      else
         self%matrix => FSUNBandMatrix(length, band, band, self%context)
         self%linear => FSUNLinSol_Band(self%state, self%matrix, self%context)
         call self%expect(FCVodeSetLinearSolver(self%memory, self%linear, self%matrix), "solver", &
            & error)
      end if
   end subroutine open

   !> Have the integration stop where functions are zero.
   subroutine find_roots(self, functions, number, error)
      !> The integrator
      class(cvode_type), intent(inout) :: self
      !> Function of SUNDIALS' form that gives the values, and how many there are
      type(c_funptr), intent(in) :: functions
      integer, intent(in) :: number
      !> Set if it fails; the integrator is then closed
      type(error_type), allocatable, intent(out) :: error

      call self%expect(FCVodeRootInit(self%memory, int(number, c_int), functions), "roots", error)
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

      real(c_double) :: reached(1)
      integer(c_int) :: status

      reached = end_time
      status = FCVode(self%memory, end_time, self%state, reached, CV_NORMAL)
      time = reached(1)
      has_root = status == CV_ROOT_RETURN
      if (status < 0) call self%expect(status, "integration", error)
   end subroutine integrate

   !> Make sure that a call succeeded; otherwise free everything.
   subroutine expect(self, status, what, error)
      class(cvode_type), intent(inout) :: self
      !> Status that SUNDIALS returned
      integer(c_int), intent(in) :: status
      !> What was done
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

      if (c_associated(self%memory)) call FCVodeFree(self%memory)
      if (associated(self%fixed_point)) status = FSUNNonlinSolFree(self%fixed_point)
      if (associated(self%linear)) status = FSUNLinSolFree(self%linear)
      if (associated(self%matrix)) call FSUNMatDestroy(self%matrix)
      if (associated(self%state)) call FN_VDestroy(self%state)
      if (c_associated(self%context)) status = FSUNContext_Free(self%context)
      if (associated(self%message)) deallocate (self%message)
      self%memory = c_null_ptr
      self%context = c_null_ptr
      nullify (self%fixed_point, self%linear, self%matrix, self%state)
   end subroutine close

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
