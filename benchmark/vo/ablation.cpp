#include <vector>

#include "evaluation/quantile.h"
#include "measurements.h"
#include "thread_time.h"
#include "tools/common/progress.h"

namespace livemap::bench {
namespace {

/// A run of EdgeOdometry that also says how many points it used and what a keyframe took.
struct PointRun {
  MethodRun all;
  std::vector<double> tracked_ms;   // Frames that did not become a keyframe.
  std::vector<double> keyframe_ms;  // Those that did.
  std::vector<double> points;       // Of the finest level.
};

/// No limit on the points but the pixels of each level.
odometry::EdgeOdometry::Config UnlimitedPoints(const geo::CameraIntrinsics& camera) {
  odometry::EdgeOdometry::Config config;
  int pixels = camera.width * camera.height;
  for (int& most : config.max_points) {
    most = pixels;
    pixels /= 4;
  }
  return config;
}

PointRun Follow(const std::vector<odometry::RgbdFrame>& frames,
                const odometry::EdgeOdometry::Config& config, const geo::CameraIntrinsics& camera) {
  odometry::EdgeOdometry odometry(config, camera);
  PointRun run;
  for (const odometry::RgbdFrame& frame : frames) {
    const double start_ms = ThreadTimeMs();
    const odometry::VoResult result = odometry.Track(frame);
    const double took_ms = ThreadTimeMs() - start_ms;
    run.all.trajectory.push_back({frame.stamp_ns, result.world_from_camera});
    run.all.milliseconds.push_back(took_ms);
    run.all.lost += result.state == odometry::VoState::kLost ? 1U : 0U;
    run.all.keyframes += result.new_keyframe ? 1U : 0U;
    if (result.points == 0) continue;  // The first frame, or a lost one.
    run.points.push_back(static_cast<double>(result.points));
    (result.new_keyframe ? run.keyframe_ms : run.tracked_ms).push_back(took_ms);
  }
  return run;
}

nlohmann::ordered_json MedianOf(const std::vector<double>& values) {
  if (values.empty()) return nullptr;
  return evaluation::Quantile(values, 0.5);
}

nlohmann::ordered_json RowOf(const Recording& recording, const PointRun& run) {
  nlohmann::ordered_json row = FiguresOf(recording.truth(), run.all);
  row["points"] = MedianOf(run.points);
  row["tracked_ms"] = MedianOf(run.tracked_ms);
  row["keyframe_ms"] = MedianOf(run.keyframe_ms);
  return row;
}

const char* NameOf(odometry::PixelChoice choice) {
  return choice == odometry::PixelChoice::kRandomPixels ? "random" : "edges";
}

}  // namespace

nlohmann::ordered_json MeasureAblation(const Recording& recording, std::size_t runs) {
  const std::vector<odometry::RgbdFrame> frames = recording.ReadAll();
  const std::vector<double> shares = {0.05, 0.1, 0.2, 0.4, 0.7, 1.0};
  nlohmann::ordered_json json = DescriptionOf(recording);
  tools::Progress progress("ablation", runs * shares.size() * 2);
  std::size_t done = 0;
  for (std::size_t run = 0; run < runs; ++run) {
    for (const double share : shares) {
      for (const odometry::PixelChoice choice :
           {odometry::PixelChoice::kRandomEdges, odometry::PixelChoice::kRandomPixels}) {
        odometry::EdgeOdometry::Config config = UnlimitedPoints(recording.camera());
        config.constant_motion = false;
        config.points.choice = choice;
        config.points.share = share;
        config.points.seed = static_cast<std::uint32_t>(run + 1);
        nlohmann::ordered_json row = {
            {"pixels", NameOf(choice)}, {"share", share}, {"seed", run + 1}};
        row.update(RowOf(recording, Follow(frames, config, recording.camera())));
        json["rows"].push_back(row);
        progress.At(++done);
      }
    }
  }
  return json;
}

nlohmann::ordered_json MeasurePixels(const Recording& recording) {
  const std::vector<odometry::RgbdFrame> frames = recording.ReadAll();
  nlohmann::ordered_json json = DescriptionOf(recording);
  // Shares of the edge pixels; the last is more than any image has.
  const std::vector<double> of_edges = {0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0};
  const std::vector<double> of_all = {1, 2, 4, 8, 1000};
  tools::Progress progress("pixels", of_edges.size() + of_all.size());
  std::size_t done = 0;
  const auto measure = [&](odometry::PixelChoice choice, double share) {
    odometry::EdgeOdometry::Config config = UnlimitedPoints(recording.camera());
    config.points.choice = choice;
    config.points.share = share;
    nlohmann::ordered_json row = {{"pixels", NameOf(choice)}, {"share", share}};
    row.update(RowOf(recording, Follow(frames, config, recording.camera())));
    json["rows"].push_back(row);
    progress.At(++done);
  };
  for (const double share : of_edges) measure(odometry::PixelChoice::kRandomEdges, share);
  for (const double share : of_all) measure(odometry::PixelChoice::kRandomPixels, share);
  return json;
}

}  // namespace livemap::bench
