/* Large pages of memory, for which Fortran has no words. */
#include <stddef.h>
#include <stdint.h>

#ifdef __linux__
#include <sys/mman.h>
#include <unistd.h>
#endif

void mesoslip_request_large_pages(void *start, size_t length)
{
#if defined(__linux__) && defined(MADV_HUGEPAGE)
  const uintptr_t large = (uintptr_t)1 << 21, page = (uintptr_t)sysconf(_SC_PAGESIZE);
  const uintptr_t first = ((uintptr_t)start + page - 1) / page * page;
  const uintptr_t last = ((uintptr_t)start + length) / page * page;
  if (last >= first + 2 * large) {
    /* The system may refuse, and then nothing changes. */
    (void)madvise((void *)first, last - first, MADV_HUGEPAGE);
  }
#else
  (void)start;
  (void)length;
#endif
}
