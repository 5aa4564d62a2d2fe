/* Stand-in for cvode.c in a build without SUNDIALS: no integration can be opened. */
#include <stdio.h>
#pragma GCC diagnostic ignored "-Wunused-parameter"

int mesoslip_cvode_open(void **opened, void *rates, void *jacobian, void *root, void *data,
                        int is_stiff, int half_bandwidth, double time, int size, double *state,
                        double relative, double absolute)
{
  *opened = NULL;
  return -1;
}

void mesoslip_cvode_message(void *self, char *text, int length)
{
  snprintf(text, (size_t)length, "mesoslip was built without SUNDIALS");
}

void mesoslip_cvode_version(char *text, int length) { text[0] = '\0'; }

void mesoslip_cvode_close(void *self) {}

/* Never called. */
int mesoslip_cvode_restart(void *self, double time) { return -1; }

int mesoslip_cvode_step(void *self, double stop_time, double *time, double *length, int *order)
{
  return -1;
}

int mesoslip_cvode_derivative(void *self, double time, int order, int size, double *values)
{
  return -1;
}

int mesoslip_cvode_integrate(void *self, double end_time, double *time, int *has_root)
{
  return -1;
}

void mesoslip_cvode_counts(void *self, long counts[3]) {}
