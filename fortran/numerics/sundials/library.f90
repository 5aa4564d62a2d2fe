!> The C library of SUNDIALS, as far as it is used: functions, and constants of their headers.
!>
!> Vectors, matrices, solvers and contexts are addresses. prototypes.c compares these interfaces
!> with the headers, in C; they are those of versions 6 and 7.
module mesoslip_numerics_sundials_library
   use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_funptr, c_int, c_long, &
      & c_ptr
   use mesoslip_numerics_sundials_index, only: sunindextype
   implicit none
   private

   public :: CV_ADAMS, CV_BDF, CV_NORMAL, CV_ONE_STEP, CV_ROOT_RETURN
   public :: create_context, SUNContext_Free, SUNDIALSGetVersion
   public :: N_VDestroy, N_VMake_Serial, vector_values
   public :: SUNBandMatrix, SUNMatDestroy, band_entries
   public :: SUNLinSol_Band, SUNLinSolFree, SUNNonlinSol_FixedPoint, SUNNonlinSolFree
   public :: CVode, CVodeCreate, CVodeFree, CVodeGetDky, CVodeGetLastOrder, CVodeGetLastStep
   public :: CVodeGetNumErrTestFails, CVodeGetNumRhsEvals, CVodeGetNumSteps, CVodeInit
   public :: CVodeReInit, CVodeRootInit, CVodeSetJacFn, CVodeSetLinearSolver
   public :: CVodeSetMaxNumSteps, CVodeSetNonlinearSolver, CVodeSetStopTime, CVodeSetUserData
   public :: CVodeSStolerances

   !> Methods of integration
   integer(c_int), parameter :: CV_ADAMS = 1, CV_BDF = 2
   !> Tasks: integrate up to a time, or make one step
   integer(c_int), parameter :: CV_NORMAL = 1, CV_ONE_STEP = 2
   !> Status: a function is zero
   integer(c_int), parameter :: CV_ROOT_RETURN = 2

   ! Contexts, vectors, matrices and solvers. Those that make one return its address, null if that
   ! fails.
   interface
      !> Make a context, without MPI: context.c.
      function create_context(context) bind(c, name="mesoslip_create_context") result(status)
         import :: c_int, c_ptr
         implicit none
         !> The context
         type(c_ptr), intent(out) :: context
         !> 0 means success
         integer(c_int) :: status
      end function create_context

      !> Free a context.
      function SUNContext_Free(context) bind(c, name="SUNContext_Free") result(status)
         import :: c_int, c_ptr
         implicit none
         !> The context, null after that
         type(c_ptr), intent(inout) :: context
         !> 0 means success
         integer(c_int) :: status
      end function SUNContext_Free

      !> Version of the library.
      function SUNDIALSGetVersion(version, length) bind(c, name="SUNDIALSGetVersion") &
         & result(status)
         import :: c_char, c_int
         implicit none
         !> The version, a C string
         character(kind=c_char), intent(out) :: version(*)
         !> Room for it
         integer(c_int), value, intent(in) :: length
         !> 0 means success
         integer(c_int) :: status
      end function SUNDIALSGetVersion

      !> Make a vector of an array, which it does not copy.
      function N_VMake_Serial(length, values, context) bind(c, name="N_VMake_Serial") &
         & result(vector)
         import :: c_ptr, sunindextype
         implicit none
         !> Length of the array
         integer(sunindextype), value, intent(in) :: length
         !> Address of the array, and the context
         type(c_ptr), value, intent(in) :: values, context
         !> The vector
         type(c_ptr) :: vector
      end function N_VMake_Serial

      !> Free a vector, not its array.
      subroutine N_VDestroy(vector) bind(c, name="N_VDestroy")
         import :: c_ptr
         implicit none
         !> The vector
         type(c_ptr), value, intent(in) :: vector
      end subroutine N_VDestroy

      !> Length of a vector.
      function N_VGetLength(vector) bind(c, name="N_VGetLength") result(length)
         import :: c_ptr, sunindextype
         implicit none
         !> The vector
         type(c_ptr), value, intent(in) :: vector
         !> Its length
         integer(sunindextype) :: length
      end function N_VGetLength

      !> Address of the array of a vector.
      function N_VGetArrayPointer(vector) bind(c, name="N_VGetArrayPointer") result(values)
         import :: c_ptr
         implicit none
         !> The vector
         type(c_ptr), value, intent(in) :: vector
         !> The address
         type(c_ptr) :: values
      end function N_VGetArrayPointer

      !> Make a banded matrix.
      function SUNBandMatrix(size, upper, lower, context) bind(c, name="SUNBandMatrix") &
         & result(matrix)
         import :: c_ptr, sunindextype
         implicit none
         !> Number of rows, and of diagonals above and below the main one
         integer(sunindextype), value, intent(in) :: size, upper, lower
         !> The context
         type(c_ptr), value, intent(in) :: context
         !> The matrix
         type(c_ptr) :: matrix
      end function SUNBandMatrix

      !> Number of columns of a banded matrix.
      function SUNBandMatrix_Columns(matrix) bind(c, name="SUNBandMatrix_Columns") result(columns)
         import :: c_ptr, sunindextype
         implicit none
         !> The matrix
         type(c_ptr), value, intent(in) :: matrix
         !> Their number
         integer(sunindextype) :: columns
      end function SUNBandMatrix_Columns

      !> Distance of two columns in the array of a banded matrix.
      function SUNBandMatrix_LDim(matrix) bind(c, name="SUNBandMatrix_LDim") result(stride)
         import :: c_ptr, sunindextype
         implicit none
         !> The matrix
         type(c_ptr), value, intent(in) :: matrix
         !> The distance
         integer(sunindextype) :: stride
      end function SUNBandMatrix_LDim

      !> Entries above the main diagonal that a column has room for.
      function SUNBandMatrix_StoredUpperBandwidth(matrix) &
         & bind(c, name="SUNBandMatrix_StoredUpperBandwidth") result(upper)
         import :: c_ptr, sunindextype
         implicit none
         !> The matrix
         type(c_ptr), value, intent(in) :: matrix
         !> Their number
         integer(sunindextype) :: upper
      end function SUNBandMatrix_StoredUpperBandwidth

      !> Address of the array of a banded matrix.
      function SUNBandMatrix_Data(matrix) bind(c, name="SUNBandMatrix_Data") result(entries)
         import :: c_ptr
         implicit none
         !> The matrix
         type(c_ptr), value, intent(in) :: matrix
         !> The address
         type(c_ptr) :: entries
      end function SUNBandMatrix_Data

      !> Free a matrix.
      subroutine SUNMatDestroy(matrix) bind(c, name="SUNMatDestroy")
         import :: c_ptr
         implicit none
         !> The matrix
         type(c_ptr), value, intent(in) :: matrix
      end subroutine SUNMatDestroy

      !> Make a solver for a banded matrix.
      function SUNLinSol_Band(vector, matrix, context) bind(c, name="SUNLinSol_Band") &
         & result(solver)
         import :: c_ptr
         implicit none
         !> A vector of the size of the system, the matrix and the context
         type(c_ptr), value, intent(in) :: vector, matrix, context
         !> The solver
         type(c_ptr) :: solver
      end function SUNLinSol_Band

      !> Free a solver for matrices.
      function SUNLinSolFree(solver) bind(c, name="SUNLinSolFree") result(status)
         import :: c_int, c_ptr
         implicit none
         !> The solver
         type(c_ptr), value, intent(in) :: solver
         !> 0 means success
         integer(c_int) :: status
      end function SUNLinSolFree

      !> Make a fixed-point iteration.
      function SUNNonlinSol_FixedPoint(vector, acceleration, context) &
         & bind(c, name="SUNNonlinSol_FixedPoint") result(solver)
         import :: c_int, c_ptr
         implicit none
         !> A vector of the size of the system
         type(c_ptr), value, intent(in) :: vector
         !> Vectors of Anderson's acceleration
         integer(c_int), value, intent(in) :: acceleration
         !> The context
         type(c_ptr), value, intent(in) :: context
         !> The solver
         type(c_ptr) :: solver
      end function SUNNonlinSol_FixedPoint

      !> Free an iteration.
      function SUNNonlinSolFree(solver) bind(c, name="SUNNonlinSolFree") result(status)
         import :: c_int, c_ptr
         implicit none
         !> The solver
         type(c_ptr), value, intent(in) :: solver
         !> 0 means success
         integer(c_int) :: status
      end function SUNNonlinSolFree
   end interface

   ! CVODE. All but the first two return a status, negative if they fail.
   interface
      !> Make the memory of an integration.
      function CVodeCreate(method, context) bind(c, name="CVodeCreate") result(memory)
         import :: c_int, c_ptr
         implicit none
         !> CV_ADAMS or CV_BDF
         integer(c_int), value, intent(in) :: method
         !> The context
         type(c_ptr), value, intent(in) :: context
         !> CVODE's memory, null if that fails
         type(c_ptr) :: memory
      end function CVodeCreate

      !> Free the memory of an integration.
      subroutine CVodeFree(memory) bind(c, name="CVodeFree")
         import :: c_ptr
         implicit none
         !> CVODE's memory, null after that
         type(c_ptr), intent(inout) :: memory
      end subroutine CVodeFree

      !> State the problem.
      function CVodeInit(memory, right_side, time, state) bind(c, name="CVodeInit") result(status)
         import :: c_double, c_funptr, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> Function that gives the rates
         type(c_funptr), value, intent(in) :: right_side
         !> Time at the start
         real(c_double), value, intent(in) :: time
         !> State at the start, a vector
         type(c_ptr), value, intent(in) :: state
         integer(c_int) :: status
      end function CVodeInit

      !> Restart.
      function CVodeReInit(memory, time, state) bind(c, name="CVodeReInit") result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> Time at the start
         real(c_double), value, intent(in) :: time
         !> State at the start, a vector
         type(c_ptr), value, intent(in) :: state
         integer(c_int) :: status
      end function CVodeReInit

      !> Look for zeros of functions.
      function CVodeRootInit(memory, number, functions) bind(c, name="CVodeRootInit") &
         & result(status)
         import :: c_funptr, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> How many functions
         integer(c_int), value, intent(in) :: number
         !> Function that gives their values
         type(c_funptr), value, intent(in) :: functions
         integer(c_int) :: status
      end function CVodeRootInit

      !> Set what functions get.
      function CVodeSetUserData(memory, user_data) bind(c, name="CVodeSetUserData") result(status)
         import :: c_int, c_ptr
         implicit none
         !> CVODE's memory, and what functions get
         type(c_ptr), value, intent(in) :: memory, user_data
         integer(c_int) :: status
      end function CVodeSetUserData

      !> Set tolerances.
      function CVodeSStolerances(memory, relative, absolute) bind(c, name="CVodeSStolerances") &
         & result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> Tolerances of the local error
         real(c_double), value, intent(in) :: relative, absolute
         integer(c_int) :: status
      end function CVodeSStolerances

      !> Set the maximum number of steps of a call.
      function CVodeSetMaxNumSteps(memory, steps) bind(c, name="CVodeSetMaxNumSteps") &
         & result(status)
         import :: c_int, c_long, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> Number of steps
         integer(c_long), value, intent(in) :: steps
         integer(c_int) :: status
      end function CVodeSetMaxNumSteps

      !> Set the iteration.
      function CVodeSetNonlinearSolver(memory, solver) bind(c, name="CVodeSetNonlinearSolver") &
         & result(status)
         import :: c_int, c_ptr
         implicit none
         !> CVODE's memory, and the iteration
         type(c_ptr), value, intent(in) :: memory, solver
         integer(c_int) :: status
      end function CVodeSetNonlinearSolver

      !> Set the solver of Newton's iteration.
      function CVodeSetLinearSolver(memory, solver, matrix) bind(c, name="CVodeSetLinearSolver") &
         & result(status)
         import :: c_int, c_ptr
         implicit none
         !> CVODE's memory, the solver and its matrix
         type(c_ptr), value, intent(in) :: memory, solver, matrix
         integer(c_int) :: status
      end function CVodeSetLinearSolver

      !> Set the function that fills the Jacobian.
      function CVodeSetJacFn(memory, jacobian) bind(c, name="CVodeSetJacFn") result(status)
         import :: c_funptr, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> The function
         type(c_funptr), value, intent(in) :: jacobian
         integer(c_int) :: status
      end function CVodeSetJacFn

      !> Set the time that the next call does not pass.
      function CVodeSetStopTime(memory, time) bind(c, name="CVodeSetStopTime") result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> The time
         real(c_double), value, intent(in) :: time
         integer(c_int) :: status
      end function CVodeSetStopTime

      !> Integrate.
      function CVode(memory, end_time, state, time, task) bind(c, name="CVode") result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> Time to come to
         real(c_double), value, intent(in) :: end_time
         !> State there, a vector
         type(c_ptr), value, intent(in) :: state
         !> Time that it came to
         real(c_double), intent(out) :: time
         !> CV_NORMAL or CV_ONE_STEP
         integer(c_int), value, intent(in) :: task
         integer(c_int) :: status
      end function CVode

      !> Derivative of the interpolating polynomial of the last step.
      function CVodeGetDky(memory, time, order, values) bind(c, name="CVodeGetDky") result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> A time within the step
         real(c_double), value, intent(in) :: time
         !> Order of the derivative
         integer(c_int), value, intent(in) :: order
         !> The derivative, a vector
         type(c_ptr), value, intent(in) :: values
         integer(c_int) :: status
      end function CVodeGetDky

      !> Length of the last step.
      function CVodeGetLastStep(memory, length) bind(c, name="CVodeGetLastStep") result(status)
         import :: c_double, c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> The length
         real(c_double), intent(out) :: length
         integer(c_int) :: status
      end function CVodeGetLastStep

      !> Order of the last step.
      function CVodeGetLastOrder(memory, order) bind(c, name="CVodeGetLastOrder") result(status)
         import :: c_int, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> The order
         integer(c_int), intent(out) :: order
         integer(c_int) :: status
      end function CVodeGetLastOrder

      !> Number of steps.
      function CVodeGetNumSteps(memory, number) bind(c, name="CVodeGetNumSteps") result(status)
         import :: c_int, c_long, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> The number
         integer(c_long), intent(out) :: number
         integer(c_int) :: status
      end function CVodeGetNumSteps

      !> Number of evaluations of the rates.
      function CVodeGetNumRhsEvals(memory, number) bind(c, name="CVodeGetNumRhsEvals") &
         & result(status)
         import :: c_int, c_long, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> The number
         integer(c_long), intent(out) :: number
         integer(c_int) :: status
      end function CVodeGetNumRhsEvals

      !> Number of steps that failed the test of their error.
      function CVodeGetNumErrTestFails(memory, number) bind(c, name="CVodeGetNumErrTestFails") &
         & result(status)
         import :: c_int, c_long, c_ptr
         implicit none
         !> CVODE's memory
         type(c_ptr), value, intent(in) :: memory
         !> The number
         integer(c_long), intent(out) :: number
         integer(c_int) :: status
      end function CVodeGetNumErrTestFails
   end interface

contains

   !> The array of a vector.
   function vector_values(vector) result(values)
      !> The vector
      type(c_ptr), intent(in) :: vector
      !> Its array
      real(c_double), pointer, contiguous :: values(:)

      call c_f_pointer(N_VGetArrayPointer(vector), values, [N_VGetLength(vector)])
   end function vector_values

   !> The array of a banded matrix: entry (i, j) is in row upper + 1 + i - j of column j.
   subroutine band_entries(matrix, entries, upper)
      !> The matrix
      type(c_ptr), intent(in) :: matrix
      !> Its array, shape (room of a column, columns)
      real(c_double), pointer, contiguous, intent(out) :: entries(:, :)
      !> Rows above that of the main diagonal
      integer, intent(out) :: upper

      upper = int(SUNBandMatrix_StoredUpperBandwidth(matrix))
      call c_f_pointer(SUNBandMatrix_Data(matrix), entries, &
         & [SUNBandMatrix_LDim(matrix), SUNBandMatrix_Columns(matrix)])
   end subroutine band_entries

end module mesoslip_numerics_sundials_library
