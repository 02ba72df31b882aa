// The readers of what people record: logs of receivers, tables of positions, what exiftool says of
// photos, times as text, and the order of a recording's pieces. The first byte chooses the reader.
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "common/error.h"
#include "common/utc_text.h"
#include "recordings/positions/gpx_track.h"
#include "recordings/positions/nmea_log.h"
#include "recordings/positions/photo_list.h"
#include "recordings/positions/position_table.h"
#include "recordings/time_text.h"
#include "recordings/video/clip_sequence.h"
#include "test/fuzz/fuzz_bytes.h"

namespace {

void Check(const livemap::recordings::RecordedPosition& position) {
  if (!livemap::geo::IsValid(position.position)) __builtin_trap();
  if (position.speed_mps && !(*position.speed_mps >= 0)) __builtin_trap();
  if (position.course_deg && !(*position.course_deg >= 0 && *position.course_deg <= 360)) {
    __builtin_trap();
  }
  if (position.sigma_m && !(*position.sigma_m > 0)) __builtin_trap();
}

void Check(const livemap::recordings::RecordedTrack& track) {
  if (track.positions.size() < 2) __builtin_trap();
  for (std::size_t i = 0; i < track.positions.size(); ++i) {
    Check(track.positions[i]);
    if (i > 0 && track.positions[i].stamp_ns <= track.positions[i - 1].stamp_ns) __builtin_trap();
  }
}

void OrderAnyClips(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzBytes bytes(data, size);
  std::vector<livemap::recordings::Clip> clips;
  while (!bytes.empty() && clips.size() < 64) {
    livemap::recordings::Clip clip;
    clip.path = std::to_string(clips.size());
    clip.duration_ns = std::int64_t{bytes.Any<std::uint32_t>()} * 100;
    // What times of files can be.
    if (bytes.Byte() % 4 != 0) clip.start_ns = bytes.Any<std::uint32_t>() * 1'000'000'000LL;
    clips.push_back(std::move(clip));
  }
  const livemap::recordings::ClipSequence sequence =
      livemap::recordings::OrderClips(std::move(clips));
  for (std::size_t i = 1; i < sequence.clips.size(); ++i) {
    const livemap::recordings::Clip &before = sequence.clips[i - 1], &clip = sequence.clips[i];
    if (*clip.start_ns < *before.start_ns + before.duration_ns) __builtin_trap();
  }
}

void ReadAnyTime(const std::string& text) {
  const auto time = livemap::recordings::ParseTimeText(text);
  if (time &&
      !livemap::recordings::ParseTimeText(livemap::Rfc3339(time->stamp_ns + 86'400'000'000'000))) {
    // A day later is a time too, but at the end of the years that are read.
    if (text.find("2105") == std::string::npos && text.find("2106") == std::string::npos) {
      __builtin_trap();
    }
  }
  livemap::recordings::ParseZone(text);
  livemap::recordings::TimeOfFileName(text);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 6) {
      case 0:
        Check(livemap::recordings::ParseGpx(text, "input"));
        break;
      case 1:
        Check(livemap::recordings::ParseNmea(text, "input"));
        break;
      case 2:
        Check(livemap::recordings::ParsePositionTable(text, 7200, "input"));
        break;
      case 3:
        for (const auto& photo :
             livemap::recordings::ParsePhotoList(text, std::nullopt, "input").photos) {
          Check(photo.position);
        }
        break;
      case 4:
        ReadAnyTime(text);
        break;
      default:
        OrderAnyClips(data + 1, size - 1);
    }
  } catch (const livemap::Error&) {
    // Refused by a sentence: what the readers promise.
  }
  return 0;
}
