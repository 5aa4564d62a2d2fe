!> What version 7 of SUNDIALS gathers in this module, for version 6.
!
! All else is written for version 7; this file is compiled with version 6 only.
module fsundials_core_mod
   use, intrinsic :: iso_c_binding, only: c_int, c_null_ptr, c_ptr
   use fsundials_context_mod, only: create_context => FSUNContext_Create, FSUNContext_Free
   use fsundials_linearsolver_mod, only: FSUNLinSolFree, SUNLinearSolver
   use fsundials_matrix_mod, only: FSUNMatDestroy, SUNMatrix
   use fsundials_nonlinearsolver_mod, only: FSUNNonlinSolFree, SUNNonlinearSolver
   use fsundials_nvector_mod, only: FN_VDestroy, FN_VGetArrayPointer, N_Vector
   implicit none
   private

   public :: FSUNContext_Create, FSUNContext_Free, SUN_COMM_NULL
   public :: FSUNLinSolFree, SUNLinearSolver, FSUNMatDestroy, SUNMatrix
   public :: FSUNNonlinSolFree, SUNNonlinearSolver
   public :: FN_VDestroy, FN_VGetArrayPointer, N_Vector

   !> No MPI communicator
   integer(c_int), parameter :: SUN_COMM_NULL = 0

contains

   !> Make a context, without MPI.
   function FSUNContext_Create(communicator, context) result(status)
      !> SUN_COMM_NULL
      integer(c_int), intent(in) :: communicator
      !> The context
      type(c_ptr) :: context
      !> 0 means success
      integer(c_int) :: status

      status = create_context(c_null_ptr, context)
   end function FSUNContext_Create

end module fsundials_core_mod
