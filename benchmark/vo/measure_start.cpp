// What docs/results/stereo-and-monocular-odometry.md says of the start of one eye: a camera sets
// off through simulated rooms, and each walk is followed several times with other noise.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "common/error.h"
#include "geo/wgs84.h"
#include "odometry/monocular/monocular_odometry.h"
#include "odometry/se3.h"
#include "simulation/room/room_motion.h"
#include "simulation/room/simulated_room.h"
#include "tools/common/command_line.h"

namespace livemap::bench {
namespace {

constexpr double kFrameS = 0.1;
constexpr double kStepM = 0.06;
constexpr double kFixSigmaM = 0.01;
/// Walks come no nearer to anything in view: a wall that fills the picture is another matter.
constexpr float kLeastDepthM = 0.6F;
constexpr std::int64_t kFirstStampNs = 1'700'000'000'000'000'000;
/// A way that is wrong by more than this is counted, a share of it.
constexpr double kWrongShare = 0.1;

simulation::SimulatedCamera StartCamera() {
  simulation::SimulatedCamera camera;
  camera.intrinsics = {250, 250, 159.5, 119.5, 320, 240};
  return camera;
}

struct StartWalk {
  std::vector<cv::Mat> grey;
  std::vector<Eigen::Isometry3d> first_from_camera;
};

/// Where a walk of the twist per metre is after some frames.
Eigen::Isometry3d PlaceOfWalk(const odometry::Vector6d& twist_per_m, int frame) {
  return odometry::Se3Exp(twist_per_m * (kStepM * frame));
}

cv::Mat Greys(const simulation::SimulatedFrame& seen) {
  cv::Mat grey;
  cv::cvtColor(seen.bgr, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

/// A direction and a turn of the scene's seed, drawn until the walk stays clear of what it sees.
StartWalk MakeWalk(std::uint64_t seed, int frames) {
  const simulation::SimulatedRoom room(seed);
  const Eigen::Isometry3d start = RoomCameraPose(room.plan(), simulation::RoomMotion::kHand, 0, 1);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> share(-1, 1);
  const auto see = [&](const odometry::Vector6d& twist_per_m, int frame) {
    return room.Render(StartCamera(), start * PlaceOfWalk(twist_per_m, frame),
                       static_cast<std::uint32_t>(frame), 1.3F, 1, 2);
  };
  for (int attempt = 0; attempt < 100; ++attempt) {
    const double heading = M_PI * share(random), rise = 0.2 * share(random);
    odometry::Vector6d twist = odometry::Vector6d::Zero();
    twist.head<3>() = Eigen::Vector3d(std::sin(heading), rise, std::cos(heading)).normalized();
    twist[4] = 0.3 * share(random);
    bool clear = true;
    for (int frame = frames - 1; frame >= 0 && clear; frame -= 4) {
      double least = 0;
      cv::Mat depth = see(twist, frame).depth;
      cv::minMaxLoc(depth, &least, nullptr, nullptr, nullptr, depth > 0);
      clear = least >= static_cast<double>(kLeastDepthM);
    }
    if (!clear) continue;
    StartWalk walk;
    for (int frame = 0; frame < frames; ++frame) {
      walk.grey.push_back(Greys(see(twist, frame)));
      walk.first_from_camera.push_back(PlaceOfWalk(twist, frame));
    }
    return walk;
  }
  throw Error("no walk of " + std::to_string(frames) + " frames is clear in the room of seed " +
              std::to_string(seed));
}

geo::Fix FixAt(const Eigen::Vector3d& place, std::int64_t stamp_ns) {
  geo::Fix fix;
  fix.stamp_ns = stamp_ns;
  fix.position = geo::LocalFrame({48.8566, 9.0}).ToGeo({place.x(), place.z()});
  fix.covariance_m2 = kFixSigmaM * kFixSigmaM * Eigen::Matrix2d::Identity();
  return fix;
}

struct StartOutcome {
  int first_frame = -1;  ///< The first with metres.
  double way_m = 0, true_way_m = 0;
  bool tracking = false;  ///< At the end.
  double Error() const { return way_m / true_way_m - 1; }
};

/// Follows a walk; every run but the first with a grey level of noise of its own.
StartOutcome FollowWalk(const StartWalk& walk, std::uint64_t run, bool by_fixes, bool trace) {
  odometry::MonocularOdometry::Config config;
  config.depth.min_depth_m = 0.3F;
  config.depth.max_depth_m = 20.0F;
  config.min_speed_mps = 0.1;
  config.speed_sigma_mps = 0.02;
  config.camera_height_m = 0;
  config.fixes.lever_m = 0;
  if (by_fixes) config.scale_source = odometry::ScaleSource::kBest;
  odometry::MonocularOdometry odometry(config, StartCamera().intrinsics);
  cv::RNG random(run + 1);
  StartOutcome outcome;
  std::optional<Eigen::Isometry3d> last;
  Eigen::Isometry3d begin, true_begin;
  for (std::size_t i = 0; i < walk.grey.size(); ++i) {
    odometry::MonocularFrame frame;
    frame.stamp_ns =
        kFirstStampNs + static_cast<std::int64_t>(static_cast<double>(i) * kFrameS * 1e9);
    frame.grey = walk.grey[i].clone();
    if (run > 0) {
      cv::Mat noise(frame.grey.size(), CV_16SC1);
      random.fill(noise, cv::RNG::NORMAL, 0, 1);
      cv::add(frame.grey, noise, frame.grey, cv::noArray(), CV_8U);
    }
    if (by_fixes && i > 0) {
      odometry.AddFix(FixAt(walk.first_from_camera[i - 1].translation(),
                            frame.stamp_ns - static_cast<std::int64_t>(kFrameS * 1e9)));
    } else if (!by_fixes) {
      frame.speed_mps = kStepM / kFrameS;
    }
    const odometry::VoResult result = odometry.Track(frame);
    if (trace) {
      const double step =
          last ? (last->inverse() * result.world_from_camera).translation().norm() : 0;
      std::printf("  %2zu %s step %.4f scale %.4f kf %d points %zu agree %.3f\n", i,
                  odometry::VoStateName(result.state), step, odometry.metres_per_unit(),
                  result.new_keyframe, result.points, result.agreement);
    }
    outcome.tracking = result.state == odometry::VoState::kTracking;
    if (!outcome.tracking) continue;
    if (outcome.first_frame < 0) {
      outcome.first_frame = static_cast<int>(i);
      begin = result.world_from_camera;
      true_begin = walk.first_from_camera[i];
    }
    outcome.way_m = (begin.inverse() * result.world_from_camera).translation().norm();
    outcome.true_way_m = (true_begin.inverse() * walk.first_from_camera[i]).translation().norm();
    last = result.world_from_camera;
  }
  return outcome;
}

/// What all walks made of one way to know metres.
struct StartSummary {
  int runs = 0, followed = 0, wrong = 0;
  std::vector<double> errors;

  void Add(const StartOutcome& outcome) {
    ++runs;
    if (!outcome.tracking || outcome.true_way_m <= 0) {
      std::printf("  -(%d)", outcome.first_frame);
      return;
    }
    ++followed;
    errors.push_back(std::abs(outcome.Error()));
    wrong += errors.back() > kWrongShare ? 1 : 0;
    std::printf("  %+.1f%%(%d)", 100 * outcome.Error(), outcome.first_frame);
  }
  void Print(const char* metres) {
    std::printf("%s: followed %d of %d", metres, followed, runs);
    if (!errors.empty()) {
      std::sort(errors.begin(), errors.end());
      const auto at = [this](double share) {
        return 100 *
               errors[static_cast<std::size_t>(share * static_cast<double>(errors.size() - 1))];
      };
      std::printf(
          ", error of the way: median %.1f %%, 90 %% below %.1f %%, worst %.1f %%; %d above %.0f "
          "%%",
          at(0.5), at(0.9), at(1), wrong, 100 * kWrongShare);
    }
    std::printf("\n");
  }
};

int RunStart(int argc, char** argv) {
  tools::CommandLine line(
      "livemap_measure_start [FLAGS]",
      "Walks through simulated rooms with one eye, with metres by the speed and then by fixes, and "
      "prints for each walk and run by how much the way is too long, and in brackets the first "
      "frame that was followed.",
      0,
      {{"first-seed", "N", "of the first room and walk, default 1"},
       {"scenes", "N", "so many rooms, one walk in each, default 8"},
       {"runs", "N", "of each walk, all but the first with noise of one grey level, default 3"},
       {"frames", "N", "of each walk, default 24"},
       {"trace", "", "say what each frame gave"}});
  if (!line.Parse(argc, argv)) return 0;
  cv::setNumThreads(1);
  const std::uint64_t first = line.Seed("first-seed", 1);
  const int scenes = line.Whole("scenes", 8, 1, 1000), runs = line.Whole("runs", 3, 1, 1000);
  StartSummary by_speed, by_fixes;
  for (int scene = 0; scene < scenes; ++scene) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(scene);
    const StartWalk walk = MakeWalk(seed, line.Whole("frames", 24, 4, 1000));
    std::printf("%llu", static_cast<unsigned long long>(seed));
    for (const bool fixes : {false, true}) {
      std::printf(fixes ? "  fixes" : "  speed");
      for (int run = 0; run < runs; ++run) {
        (fixes ? by_fixes : by_speed)
            .Add(FollowWalk(walk, static_cast<std::uint64_t>(run), fixes, line.Has("trace")));
      }
    }
    std::printf("\n");
    std::fflush(stdout);
  }
  by_speed.Print("metres by the speed");
  by_fixes.Print("metres by fixes");
  return 0;
}

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_measure_start", argc, argv, livemap::bench::RunStart);
}
