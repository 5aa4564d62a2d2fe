/* A context of SUNDIALS without MPI. How "without MPI" is written, a pointer, a number or a handle
   of an MPI library, depends on how SUNDIALS was built, and only its headers know. */
#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>
#include <stddef.h>

int mesoslip_create_context(SUNContext *context)
{
#if SUNDIALS_VERSION_MAJOR < 7
  return SUNContext_Create(NULL, context);
#else
  return SUNContext_Create(SUN_COMM_NULL, context);
#endif
}
