#include "perception/inference/processor.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace livemap::perception {

bool HasInt8Instructions() {
#if defined(__x86_64__)
  // The builtins ask the system too whether it keeps the wide registers.
  if (__builtin_cpu_supports("avx512vnni") != 0) return true;
  unsigned int eax = 0;
  unsigned int ebx = 0;
  unsigned int ecx = 0;
  unsigned int edx = 0;
  constexpr unsigned int kAvxVnni = 1U << 4U;  // Of eax, leaf 7, part 1.
  return __builtin_cpu_supports("avx2") != 0 &&
         __get_cpuid_count(7, 1, &eax, &ebx, &ecx, &edx) != 0 && (eax & kAvxVnni) != 0;
#else
  return false;
#endif
}

}  // namespace livemap::perception
