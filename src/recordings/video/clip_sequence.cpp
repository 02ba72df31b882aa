#include "recordings/video/clip_sequence.h"

#include <algorithm>
#include <sstream>

#include "common/error.h"
#include "common/time.h"
#include "common/utc_text.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

void FollowOneAnother(std::vector<Clip>& clips) {
  for (std::size_t i = 1; i < clips.size(); ++i) {
    clips[i].start_ns = *clips[i - 1].start_ns + clips[i - 1].duration_ns;
  }
}

/// Moves a piece to the end of the one before, where it is about there.
void Attach(const Clip& before, Clip& clip, std::vector<std::string>& notes) {
  const std::int64_t end_ns = *before.start_ns + before.duration_ns;
  const double gap_s = Seconds(*clip.start_ns - end_ns);
  if (gap_s < -kClipToleranceS) {
    std::ostringstream sentence;
    sentence << "the videos '" << before.path << "' and '" << clip.path << "' overlap by " << -gap_s
             << " s by their clocks, the second begins at " << Rfc3339(*clip.start_ns)
             << ": accepted are the pieces of one recording";
    throw Error(sentence.str());
  }
  if (gap_s <= kClipToleranceS) {
    clip.start_ns = end_ns;
    return;
  }
  std::ostringstream note;
  note << "nothing was recorded for " << gap_s << " s before '" << clip.path << "'";
  notes.push_back(note.str());
}

}  // namespace

ClipSequence OrderClips(std::vector<Clip> clips) {
  if (clips.empty()) throw Error("no video is given");
  ClipSequence sequence;
  const auto timeless =
      std::find_if(clips.begin() + 1, clips.end(), [](const Clip& clip) { return !clip.start_ns; });
  if (!clips.front().start_ns) {
    throw Error("'" + clips.front().path +
                "' does not state when it was recorded: --start-time says when it begins");
  }
  if (timeless != clips.end()) {
    const bool others =
        std::any_of(clips.begin() + 1, clips.end(), [](const Clip& clip) { return clip.start_ns; });
    if (others) {
      throw Error("'" + timeless->path +
                  "' does not state when it was recorded, though others do: accepted are pieces "
                  "that all state it, or none but the first");
    }
    FollowOneAnother(clips);
    sequence.notes.push_back("'" + timeless->path +
                             "' does not state when it was recorded: it is taken to follow the one "
                             "that is named before it");
  } else {
    std::stable_sort(clips.begin(), clips.end(),
                     [](const Clip& a, const Clip& b) { return *a.start_ns < *b.start_ns; });
    for (std::size_t i = 1; i < clips.size(); ++i) Attach(clips[i - 1], clips[i], sequence.notes);
  }
  sequence.clips = std::move(clips);
  return sequence;
}

}  // namespace livemap::recordings
