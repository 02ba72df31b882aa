// What the box rooms of docs/results/odometry-rooms.md are measured by: each is drawn and followed
// in this process, nothing is written to disk.
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <random>

#include "box_room.h"
#include "box_walk.h"
#include "evaluation/quantile.h"
#include "followed_frames.h"
#include "tools/common/command_line.h"

namespace livemap::bench {
namespace {

constexpr std::int64_t kFirstStampNs = 1'700'000'000'000'000'000;
/// A step that is wrong by more is a false one.
constexpr double kFalseStepM = 0.02;

/// How a room is walked through and looked at.
struct BoxTrial {
  double speed = 1;
  double rate_hz = 30;
  int frames = 60;
  double depth_noise = 0;  ///< Standard deviation at 1 m, growing with the square of the depth, m.
  bool trace = false;
};

geo::CameraIntrinsics BoxCamera() { return {525, 525, 319.5, 239.5, 640, 480}; }

void AddDepthNoise(double sigma_at_1_m, std::uint64_t seed, cv::Mat& depth_m) {
  std::mt19937_64 random(seed);
  std::normal_distribution<float> noise(0, static_cast<float>(sigma_at_1_m));
  for (int y = 0; y < depth_m.rows; ++y) {
    for (int x = 0; x < depth_m.cols; ++x) {
      float& depth = depth_m.at<float>(y, x);
      depth += noise(random) * depth * depth;
    }
  }
}

void Trace(std::size_t frame, const odometry::VoResult& result, double error_m) {
  std::fprintf(stderr, "  %3zu %-12s off %.4f m, points %zu, agreement %.3f, overlap %.2f%s\n",
               frame, odometry::VoStateName(result.state), error_m, result.points, result.agreement,
               result.overlap, result.new_keyframe ? ", keyframe" : "");
}

nlohmann::ordered_json MeasureBoxRoom(std::uint64_t seed, const BoxTrial& trial) {
  const BoxRoom room(seed);
  const BoxWalk walk(room, seed, trial.speed);
  FollowedFrames followed(BoxCamera());
  std::vector<datasets::StampedPose> truth;
  for (int i = 0; i < trial.frames; ++i) {
    const double time_s = i / trial.rate_hz;
    const Eigen::Isometry3d pose = walk.At(time_s);
    const std::uint64_t picture = seed * 1000 + static_cast<std::uint64_t>(i);
    BoxRoom::View view = room.Render(BoxCamera(), pose, picture);
    if (trial.depth_noise > 0) AddDepthNoise(trial.depth_noise, picture, view.depth_m);
    odometry::RgbdFrame frame;
    frame.stamp_ns = kFirstStampNs + static_cast<std::int64_t>(time_s * 1e9);
    frame.grey = view.grey;
    frame.depth = view.depth_m;
    truth.push_back({frame.stamp_ns, pose});
    const odometry::VoResult& result = followed.Track(frame, pose);
    if (trial.trace) Trace(static_cast<std::size_t>(i), result, followed.last_step_error_m());
  }
  nlohmann::ordered_json json;
  json["seed"] = seed;
  json.update(followed.Figures(truth));
  json["false"] = followed.lost() > 0 || followed.worst_step_m() > kFalseStepM;
  return json;
}

/// The figures of all rooms that the table has.
nlohmann::ordered_json SummaryOf(const std::vector<nlohmann::ordered_json>& rooms) {
  std::vector<double> ate_m, nees, median_ms;
  std::size_t lost = 0, frames = 0, wrong = 0;
  for (const nlohmann::ordered_json& room : rooms) {
    ate_m.push_back(room["ate_rmse_m"].get<double>());
    if (!room["nees_translation"].is_null()) {
      nees.push_back(room["nees_translation"].get<double>());
    }
    median_ms.push_back(room["median_ms"].get<double>());
    lost += room["lost"].get<std::size_t>();
    frames += room["tracked_frames"].get<std::size_t>();
    wrong += room["false"].get<bool>() ? 1U : 0U;
  }
  nlohmann::ordered_json json;
  json["rooms"] = rooms.size();
  json["median_ate_m"] = evaluation::Quantile(ate_m, 0.5);
  json["worst_ate_m"] = *std::max_element(ate_m.begin(), ate_m.end());
  json["lost"] = lost;
  json["frames"] = frames;
  json["false_rooms"] = wrong;
  json["median_nees_translation"] = evaluation::Quantile(nees, 0.5);
  json["rooms_above_nees_2"] =
      std::count_if(nees.begin(), nees.end(), [](double value) { return value > 2; });
  json["median_ms"] = evaluation::Quantile(median_ms, 0.5);
  return json;
}

int Run(int argc, char** argv) {
  tools::CommandLine line(
      "livemap_measure_boxes [FLAGS]",
      "Draws rooms of boxes with a ray caster of its own, follows a camera through each with the "
      "default odometry, and prints a line of JSON for each room, then one for all. A room is "
      "false "
      "where a step is wrong by more than 0.02 m or a frame is lost.",
      0,
      {{"first-seed", "N", "of the first room, default 1"},
       {"seed-step", "N", "from one room's seed to the next, default 1"},
       {"rooms", "N", "so many, default 10"},
       {"frames", "N", "of each room, default 60"},
       {"speed", "X", "1 is 2.5 cm and 0.6 degrees in 1/30 s, default 1"},
       {"rate", "HZ", "frames per second, default 30"},
       {"depth-noise", "M",
        "standard deviation of depth at 1 m, growing with its square, default 0"},
       {"trace", "", "say on standard error what each frame gave"}});
  if (!line.Parse(argc, argv)) return 0;
  cv::setNumThreads(1);
  BoxTrial trial;
  trial.speed = line.Number("speed", 1, 0.05, 20);
  trial.rate_hz = line.Number("rate", 30, 1, 1000);
  trial.frames = line.Whole("frames", 60, 3, 100000);
  trial.depth_noise = line.Number("depth-noise", 0, 0, 1);
  trial.trace = line.Has("trace");
  const std::uint64_t first = line.Seed("first-seed", 1), step = line.Seed("seed-step", 1);
  std::vector<nlohmann::ordered_json> rooms;
  for (int i = 0; i < line.Whole("rooms", 10, 1, 100000); ++i) {
    rooms.push_back(MeasureBoxRoom(first + step * static_cast<std::uint64_t>(i), trial));
    std::cout << rooms.back().dump() << std::endl;
  }
  std::cout << SummaryOf(rooms).dump() << std::endl;
  return 0;
}

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_measure_boxes", argc, argv, livemap::bench::Run);
}
