// A recorder's video: its header, times, orientation and frames. FFmpeg's own libraries are not
// watched; what is watched is what is done with what they say.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "common/error.h"
#include "recordings/video/video_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const int file = memfd_create("video", MFD_CLOEXEC);
  if (file < 0 || write(file, data, size) != static_cast<ssize_t>(size)) __builtin_trap();
  try {
    livemap::recordings::VideoFile video("/proc/self/fd/" + std::to_string(file), {64, true});
    video.creation_ns();
    video.duration_ns();
    std::int64_t last_ns = -1;
    for (int frames = 0; frames < 32; ++frames) {
      const auto frame = video.Next();
      if (!frame) break;
      if (frame->time_ns <= last_ns || frame->image.empty()) __builtin_trap();
      last_ns = frame->time_ns;
    }
  } catch (const livemap::Error&) {
    // Refused by a sentence: what the reader promises.
  }
  close(file);
  return 0;
}
