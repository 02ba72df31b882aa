#include "tools/common/progress.h"

#include <unistd.h>

#include <cstdio>
#include <utility>

namespace livemap::tools {

Progress::Progress(std::string what, std::size_t total)
    : what_(std::move(what)), total_(total), terminal_(isatty(STDERR_FILENO) != 0) {}

void Progress::At(std::size_t done) {
  if (total_ == 0) return;
  if (terminal_) {
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin_;
    const double left_s =
        done > 0 ? passed.count() * static_cast<double>(total_ - done) / static_cast<double>(done)
                 : 0;
    // Blanks wipe what a longer line has left.
    std::fprintf(stderr, "\r%s %zu of %zu, %.0f s left   %s", what_.c_str(), done, total_, left_s,
                 done == total_ ? "\n" : "");
    std::fflush(stderr);
    return;
  }
  const std::size_t tenth = done * 10 / total_;
  if (tenth == said_tenth_) return;
  said_tenth_ = tenth;
  std::fprintf(stderr, "%s %zu of %zu\n", what_.c_str(), done, total_);
}

}  // namespace livemap::tools
