/* Does SUNDIALS have the functions that library.f90 declares, with the same arguments? Compiled and
   linked by meson, with INDEX the type of lengths; never run. */
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <stdint.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

typedef void *memory;
typedef int (*right_side)(double, N_Vector, N_Vector, void *);
typedef int (*roots)(double, N_Vector, double *, void *);
typedef int (*jacobian)(double, N_Vector, N_Vector, SUNMatrix, void *, N_Vector, N_Vector, N_Vector);

_Static_assert(CV_ADAMS == 1 && CV_BDF == 2, "methods");
_Static_assert(CV_NORMAL == 1 && CV_ONE_STEP == 2, "tasks");
_Static_assert(CV_ROOT_RETURN == 2, "status");

int (*context_free)(SUNContext *) = SUNContext_Free;
int (*get_version)(char *, int) = SUNDIALSGetVersion;
N_Vector (*vector_make)(INDEX, double *, SUNContext) = N_VMake_Serial;
void (*vector_destroy)(N_Vector) = N_VDestroy;
INDEX (*vector_length)(N_Vector) = N_VGetLength;
double *(*vector_array)(N_Vector) = N_VGetArrayPointer;
SUNMatrix (*matrix_make)(INDEX, INDEX, INDEX, SUNContext) = SUNBandMatrix;
INDEX (*matrix_columns)(SUNMatrix) = SUNBandMatrix_Columns;
INDEX (*matrix_stride)(SUNMatrix) = SUNBandMatrix_LDim;
INDEX (*matrix_upper)(SUNMatrix) = SUNBandMatrix_StoredUpperBandwidth;
double *(*matrix_array)(SUNMatrix) = SUNBandMatrix_Data;
void (*matrix_destroy)(SUNMatrix) = SUNMatDestroy;
SUNLinearSolver (*linear_make)(N_Vector, SUNMatrix, SUNContext) = SUNLinSol_Band;
int (*linear_free)(SUNLinearSolver) = SUNLinSolFree;
SUNNonlinearSolver (*iteration_make)(N_Vector, int, SUNContext) = SUNNonlinSol_FixedPoint;
int (*iteration_free)(SUNNonlinearSolver) = SUNNonlinSolFree;
memory (*create)(int, SUNContext) = CVodeCreate;
void (*destroy)(memory *) = CVodeFree;
int (*init)(memory, right_side, double, N_Vector) = CVodeInit;
int (*reinit)(memory, double, N_Vector) = CVodeReInit;
int (*root_init)(memory, int, roots) = CVodeRootInit;
int (*set_user_data)(memory, void *) = CVodeSetUserData;
int (*set_tolerances)(memory, double, double) = CVodeSStolerances;
int (*set_steps)(memory, long) = CVodeSetMaxNumSteps;
int (*set_iteration)(memory, SUNNonlinearSolver) = CVodeSetNonlinearSolver;
int (*set_linear)(memory, SUNLinearSolver, SUNMatrix) = CVodeSetLinearSolver;
int (*set_jacobian)(memory, jacobian) = CVodeSetJacFn;
int (*set_stop)(memory, double) = CVodeSetStopTime;
int (*integrate)(memory, double, N_Vector, double *, int) = CVode;
int (*derivative)(memory, double, int, N_Vector) = CVodeGetDky;
int (*last_step)(memory, double *) = CVodeGetLastStep;
int (*last_order)(memory, int *) = CVodeGetLastOrder;
int (*steps)(memory, long *) = CVodeGetNumSteps;
int (*evaluations)(memory, long *) = CVodeGetNumRhsEvals;
int (*failures)(memory, long *) = CVodeGetNumErrTestFails;

#if SUNDIALS_VERSION_MAJOR < 7
typedef void (*handler)(int, const char *, const char *, char *, void *);
int (*set_handler)(memory, handler, void *) = CVodeSetErrHandlerFn;
int (*context_create)(void *, SUNContext *) = SUNContext_Create;
#else
typedef void (*handler)(int, const char *, const char *, const char *, int, void *, SUNContext);
int (*push_handler)(SUNContext, handler, void *) = SUNContext_PushErrHandler;
int (*context_create)(SUNComm, SUNContext *) = SUNContext_Create;
#endif

int main(void) { return 0; }
