/* CVODE of SUNDIALS, version 6 or 7, behind the functions that cvode.f90 declares. */
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

/* Functions of the caller; data is its own. The entry (i, j) of a Jacobian is in row
   upper + i - j of column j, from 0; columns are one after another. */
typedef int (*rates_function)(double time, int size, const double *state, double *rates, void *data);
typedef double (*root_function)(double time, int size, const double *state, void *data);
typedef void (*jacobian_function)(int rows, int size, int upper, double *entries, void *data);

struct integration {
  SUNContext context;
  void *memory;
  N_Vector state;
  SUNNonlinearSolver iteration;
  SUNMatrix matrix;
  SUNLinearSolver solver;
  rates_function rates;
  jacobian_function jacobian;
  root_function root;
  void *data;
  char message[160];
};

/* Statuses below 0 are failures, in all of SUNDIALS. */
#define TRY(call)                    \
  do {                               \
    const int status_ = (call);      \
    if (status_ < 0) return status_; \
  } while (0)

static int rates(sunrealtype time, N_Vector state, N_Vector rate, void *data)
{
  const struct integration *self = data;
  return self->rates(time, (int)N_VGetLength(state), N_VGetArrayPointer(state),
                     N_VGetArrayPointer(rate), self->data);
}

static int root(sunrealtype time, N_Vector state, sunrealtype *value, void *data)
{
  const struct integration *self = data;
  *value = self->root(time, (int)N_VGetLength(state), N_VGetArrayPointer(state), self->data);
  return 0;
}

static int jacobian(sunrealtype time, N_Vector state, N_Vector rate, SUNMatrix matrix, void *data,
                    N_Vector first, N_Vector second, N_Vector third)
{
  const struct integration *self = data;
  (void)time, (void)state, (void)rate, (void)first, (void)second, (void)third;
  self->jacobian((int)SUNBandMatrix_LDim(matrix), (int)SUNBandMatrix_Columns(matrix),
                 (int)SUNBandMatrix_StoredUpperBandwidth(matrix), SUNBandMatrix_Data(matrix),
                 self->data);
  return 0;
}

/* Messages are kept instead of printed. */
#if SUNDIALS_VERSION_MAJOR < 7
static void keep(int code, const char *module, const char *function, char *text, void *data)
{
  struct integration *self = data;
  (void)code, (void)module, (void)function;
  snprintf(self->message, sizeof self->message, "%s", text);
}
#else
static void keep(int line, const char *function, const char *file, const char *text,
                 SUNErrCode code, void *data, SUNContext context)
{
  struct integration *self = data;
  (void)line, (void)function, (void)file, (void)context;
  snprintf(self->message, sizeof self->message, "%s", text ? text : SUNGetErrMsg(code));
}
#endif

/* Set up an integration, with the state in an array that must outlive it. If this fails, *opened
   has the message, and is still to be closed; it is NULL if there is no memory. */
int mesoslip_cvode_open(struct integration **opened, rates_function rates_of,
                        jacobian_function jacobian_of, root_function root_of, void *data,
                        int is_stiff, int half_bandwidth, double time, int size, double *state,
                        double relative, double absolute)
{
  struct integration *self = *opened = calloc(1, sizeof *self);
  if (!self) return CV_MEM_FAIL;
  self->rates = rates_of;
  self->jacobian = jacobian_of;
  self->root = root_of;
  self->data = data;
#if SUNDIALS_VERSION_MAJOR < 7
  TRY(SUNContext_Create(NULL, &self->context));
#else
  TRY(SUNContext_Create(SUN_COMM_NULL, &self->context));
#endif
  self->state = N_VMake_Serial(size, state, self->context);
  self->memory = CVodeCreate(is_stiff ? CV_BDF : CV_ADAMS, self->context);
  if (!self->state || !self->memory) return CV_MEM_FAIL;
#if SUNDIALS_VERSION_MAJOR < 7
  TRY(CVodeSetErrHandlerFn(self->memory, keep, self));
#else
  /* Or the context's own handler prints as well. */
  TRY(SUNContext_ClearErrHandlers(self->context));
  TRY(SUNContext_PushErrHandler(self->context, keep, self));
#endif
  TRY(CVodeInit(self->memory, rates, time, self->state));
  TRY(CVodeSetUserData(self->memory, self));
  TRY(CVodeSStolerances(self->memory, relative, absolute));
  TRY(CVodeSetMaxNumSteps(self->memory, 1000000));
  if (is_stiff) {
    const int band = half_bandwidth < size ? half_bandwidth : size - 1;
    self->matrix = SUNBandMatrix(size, band, band, self->context);
    self->solver = SUNLinSol_Band(self->state, self->matrix, self->context);
    TRY(CVodeSetLinearSolver(self->memory, self->solver, self->matrix));
    if (jacobian_of) TRY(CVodeSetJacFn(self->memory, jacobian));
  } else {
    self->iteration = SUNNonlinSol_FixedPoint(self->state, 0, self->context);
    TRY(CVodeSetNonlinearSolver(self->memory, self->iteration));
  }
  if (root_of) TRY(CVodeRootInit(self->memory, 1, root));
  return CV_SUCCESS;
}

int mesoslip_cvode_restart(struct integration *self, double time)
{
  return CVodeReInit(self->memory, time, self->state);
}

/* One step, not beyond stop_time. */
int mesoslip_cvode_step(struct integration *self, double stop_time, double *time, double *length,
                        int *order)
{
  TRY(CVodeSetStopTime(self->memory, stop_time));
  TRY(CVode(self->memory, stop_time, self->state, time, CV_ONE_STEP));
  TRY(CVodeGetLastStep(self->memory, length));
  return CVodeGetLastOrder(self->memory, order);
}

/* Derivative of the interpolating polynomial of the last step. */
int mesoslip_cvode_derivative(struct integration *self, double time, int order, int size,
                              double *values)
{
  N_Vector vector = N_VMake_Serial(size, values, self->context);
  const int status = CVodeGetDky(self->memory, time, order, vector);
  N_VDestroy(vector);
  return status;
}

/* Up to end_time, or to a root before it. */
int mesoslip_cvode_integrate(struct integration *self, double end_time, double *time, int *has_root)
{
  const int status = CVode(self->memory, end_time, self->state, time, CV_NORMAL);
  *has_root = status == CV_ROOT_RETURN;
  return status;
}

/* Steps, evaluations of the rates and failed steps since the last start. */
void mesoslip_cvode_counts(struct integration *self, long counts[3])
{
  CVodeGetNumSteps(self->memory, &counts[0]);
  CVodeGetNumRhsEvals(self->memory, &counts[1]);
  CVodeGetNumErrTestFails(self->memory, &counts[2]);
}

/* Last message. */
void mesoslip_cvode_message(const struct integration *self, char *text, int length)
{
  snprintf(text, (size_t)length, "%s", self ? self->message : "not enough memory");
}

void mesoslip_cvode_close(struct integration *self)
{
  if (!self) return;
  CVodeFree(&self->memory);
  SUNNonlinSolFree(self->iteration);
  SUNLinSolFree(self->solver);
  SUNMatDestroy(self->matrix);
  N_VDestroy(self->state);
  SUNContext_Free(&self->context);
  free(self);
}

/* Version of the library in use, empty if unknown. */
void mesoslip_cvode_version(char *text, int length)
{
  if (SUNDIALSGetVersion(text, length) != 0) text[0] = '\0';
}
