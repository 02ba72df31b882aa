#include "followed_frames.h"
#include "measurements.h"

namespace livemap::bench {

nlohmann::ordered_json MeasureWorld(const Recording& recording, std::size_t step) {
  FollowedFrames followed(recording.camera());
  for (std::size_t i = 0; i < recording.size(); i += step) {
    followed.Track(recording.Read(i), recording.TruthAt(i));
  }
  nlohmann::ordered_json json = DescriptionOf(recording);
  json["step"] = step;
  json.update(followed.Figures(recording.truth()));
  return json;
}

}  // namespace livemap::bench
