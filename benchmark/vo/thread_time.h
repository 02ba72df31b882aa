#pragma once

#include <ctime>

namespace livemap::bench {

/// Time that this thread has spent on a processor so far, ms: what a call of one thread takes on a
/// machine with nothing else to do, whatever else a shared one does.
inline double ThreadTimeMs() {
  std::timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

}  // namespace livemap::bench
