#pragma once

#include <cstddef>

namespace livemap::bench {

/// Prints what one second of a zone costs PollScheduler, in processor time of one thread: 10 000
/// vehicles move and all are told who is asked, at 1000 to `max_hazards` told hazards that wait.
void PrintPollScheduler(std::size_t max_hazards);

}  // namespace livemap::bench
