#include "evaluation/trajectory/trajectory.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "common/error.h"
#include "common/text_file.h"
#include "datasets/text_parsing.h"

namespace livemap::evaluation {
namespace {

constexpr std::size_t kMaxBytes = 256U << 20U;
constexpr std::ptrdiff_t kMaxLines = 1'000'000;

/// Columns and number (from 1) of the first line that is neither comment nor empty; 0 without one.
struct FirstLine {
  std::size_t columns = 0;
  std::size_t number = 0;
  std::string text;
};

FirstLine FindFirstTrajectoryLine(const std::string& text) {
  FirstLine first;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string line = text.substr(begin, end - begin);
    const std::vector<std::string> parts = datasets::SplitBlanks(line);
    ++first.number;
    if (!parts.empty() && parts[0][0] != '#') {
      first.columns = parts.size();
      first.text = std::move(line);
      return first;
    }
    begin = end + 1;
  }
  return first;
}

}  // namespace

std::vector<datasets::StampedPose> ParseTrajectory(const std::string& text, const std::string& name,
                                                   double kitti_rate_hz,
                                                   std::vector<std::string>* notes) {
  if (std::count(text.begin(), text.end(), '\n') > kMaxLines) {
    throw Error("trajectory file '" + name + "' has more than " + std::to_string(kMaxLines) +
                " lines, which is the most that is accepted");
  }
  const FirstLine first = FindFirstTrajectoryLine(text);
  if (first.columns == 0) throw Error("trajectory file '" + name + "' has no pose");
  if (first.columns == 8) return datasets::ParseTumTrajectory(text, name, notes);
  if (first.columns != 12) {
    throw Error("line " + std::to_string(first.number) + " of '" + name + "' has " +
                std::to_string(first.columns) +
                " columns, accepted are 8 (TUM: stamp tx ty tz qx qy qz qw) or 12 (KITTI: a 3x4 "
                "pose row by row)" +
                datasets::SeparatorHint(first.text));
  }
  std::vector<datasets::StampedPose> poses;
  for (const Eigen::Isometry3d& pose : datasets::ParseKittiPoses(text, name)) {
    const double seconds = static_cast<double>(poses.size()) / kitti_rate_hz;
    poses.push_back({std::llround(seconds * 1e9), pose});
  }
  return poses;
}

std::vector<datasets::StampedPose> ReadTrajectory(const std::string& path, double kitti_rate_hz,
                                                  std::vector<std::string>* notes) {
  if (std::filesystem::is_directory(path)) {
    throw Error("'" + path + "' is a folder, wanted is a trajectory file");
  }
  return ParseTrajectory(ReadTextFile(path, kMaxBytes), path, kitti_rate_hz, notes);
}

bool HasKittiLayout(const std::string& path) {
  return FindFirstTrajectoryLine(ReadTextFile(path, kMaxBytes)).columns == 12;
}

}  // namespace livemap::evaluation
