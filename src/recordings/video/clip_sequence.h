#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace livemap::recordings {

/// One file of a recorder that writes its recording in pieces.
struct Clip {
  std::string path;
  std::optional<std::int64_t> start_ns;  ///< Of the first frame by the recorder's clock.
  std::int64_t duration_ns = 0;
};

/// The pieces of one recording.
struct ClipSequence {
  std::vector<Clip> clips;         ///< In the order of time; each `start_ns` is set.
  std::vector<std::string> notes;  ///< What was assumed, a sentence each.
};

/// How far a piece's clock may be from the end of the piece before for the two to be one recording
/// without a gap: recorders state whole seconds, and let pieces overlap a little.
constexpr double kClipToleranceS = 1.6;

/// Puts pieces into the order of their clocks. Pieces that follow one another within
/// kClipToleranceS do so without a gap: a recorder states whole seconds, but its frames go on.
/// Where no piece but the first has a time, they follow one another as they are given. Throws Error
/// naming the files where pieces overlap by more, where only some have a time, or where the first
/// has none.
ClipSequence OrderClips(std::vector<Clip> clips);

}  // namespace livemap::recordings
