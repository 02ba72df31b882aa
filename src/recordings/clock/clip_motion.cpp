#include "recordings/clock/clip_motion.h"

#include "common/time.h"
#include "recordings/video/video_file.h"

namespace livemap::recordings {

std::vector<ImageMotion> MeasureMotion(const std::vector<Clip>& clips,
                                       const std::function<void(double seconds)>& progress) {
  std::vector<ImageMotion> motions;
  ImageMotionMeter meter;
  for (const Clip& clip : clips) {
    VideoFile video(clip.path, {ImageMotionMeter::kWidth, true});
    while (const std::optional<std::int64_t> time_ns = video.Skip()) {
      const std::int64_t stamp_ns = *clip.start_ns + *time_ns;
      if (!meter.Wants(stamp_ns)) continue;
      const std::optional<ImageMotion> motion = meter.Add(video.Skipped(), stamp_ns);
      if (motion) motions.push_back(*motion);
      progress(Seconds(stamp_ns - *clips.front().start_ns));
    }
  }
  return motions;
}

}  // namespace livemap::recordings
