// The readers of a recorded drive's tables of positions. The first byte chooses the table.
#include <cstdint>
#include <string>

#include "common/error.h"
#include "datasets/comma2k19.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 3) {
      case 0:
        livemap::datasets::ParseRecordedFixes(text, "input");
        break;
      case 1:
        livemap::datasets::ParseRecordedPoses(text, "input");
        break;
      default:
        livemap::datasets::ParseRecordedSpeeds(text, "input");
    }
  } catch (const livemap::Error&) {
    // Refused by a sentence: what the readers promise.
  }
  return 0;
}
