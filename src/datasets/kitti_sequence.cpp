#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "common/error.h"
#include "datasets/sequences.h"
#include "datasets/text_parsing.h"

namespace livemap::datasets {
namespace {

namespace fs = std::filesystem;

using Projection = Eigen::Matrix<double, 3, 4>;

/// The 12 numbers of a row-major 3x4 matrix from parts[first...]; none when one is malformed.
std::optional<Projection> ParseMatrix(const std::vector<std::string>& parts, std::size_t first) {
  if (parts.size() != first + 12) return std::nullopt;
  Projection matrix;
  for (int i = 0; i < 12; ++i) {
    const std::optional<double> value = ParseFinite(parts[first + static_cast<std::size_t>(i)]);
    if (!value || std::abs(*value) > 1e9) return std::nullopt;
    matrix(i / 4, i % 4) = *value;
  }
  return matrix;
}

/// The projection in a line of calib.txt, line 0 the first.
Projection ParseProjection(const std::vector<std::string>& lines, std::size_t index,
                           const std::string& name) {
  const std::vector<std::string> parts =
      index < lines.size() ? SplitBlanks(lines[index]) : std::vector<std::string>();
  const std::size_t first = !parts.empty() && parts[0].back() == ':' ? 1 : 0;
  const std::optional<Projection> p = ParseMatrix(parts, first);
  if (!p || (*p)(0, 0) <= 0 || (*p)(1, 1) <= 0) {
    throw Error("line " + std::to_string(index + 1) + " of '" + name +
                "' must be a 3x4 projection of 12 numbers with positive focal lengths");
  }
  return *p;
}

/// The folder of the right camera's pictures and which lines of calib.txt are the pair's.
struct RightCamera {
  fs::path folder;
  std::size_t left_line = 0;
};

/// None where the left camera is alone.
std::optional<RightCamera> FindRightCamera(const fs::path& left_folder) {
  const std::string left = left_folder.filename().string();
  if (left != "image_0" && left != "image_2") return std::nullopt;
  const fs::path folder = left_folder.parent_path() / (left == "image_0" ? "image_1" : "image_3");
  if (!fs::is_directory(folder)) return std::nullopt;
  return RightCamera{folder, left == "image_0" ? 0U : 2U};
}

void ReadRightCamera(const RightCamera& camera, const std::vector<std::string>& calibration,
                     const std::string& name, Sequence& sequence) {
  const Projection left = ParseProjection(calibration, camera.left_line, name);
  const Projection right = ParseProjection(calibration, camera.left_line + 1, name);
  // The other numbers are the left camera's, as in every rectified pair.
  sequence.baseline_m = left(0, 3) / left(0, 0) - right(0, 3) / right(0, 0);
  if ((left.leftCols<3>() - right.leftCols<3>()).cwiseAbs().maxCoeff() > 0.01 ||
      !(sequence.baseline_m > 0)) {
    throw Error("lines " + std::to_string(camera.left_line + 1) + " and " +
                std::to_string(camera.left_line + 2) + " of '" + name +
                "' must be projections of a rectified pair, the right one with the baseline");
  }
  for (SequenceFrame& frame : sequence.frames) {
    const fs::path path = camera.folder / fs::path(frame.image_path).filename();
    if (fs::is_regular_file(path)) frame.right_path = path.string();
  }
}

fs::path ImageFolder(const fs::path& root) {
  for (const char* name : {"images", "image_0", "image_2"}) {
    if (fs::is_directory(root / name)) return root / name;
  }
  throw Error("the KITTI folder '" + root.string() + "' holds no images, image_0 or image_2");
}

std::vector<std::string> ListImages(const fs::path& folder) {
  std::vector<std::string> paths;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".png" || extension == ".jpg") paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  if (paths.empty())
    throw Error("the image folder '" + folder.string() + "' holds no .png or .jpg");
  return paths;
}

std::vector<std::int64_t> FrameTimesNs(const fs::path& root, std::size_t count, double rate_hz) {
  std::vector<std::int64_t> times_ns;
  const std::string path = (root / "times.txt").string();
  if (!fs::exists(path)) {
    for (std::size_t i = 0; i < count; ++i) {
      times_ns.push_back(std::llround(static_cast<double>(i) / rate_hz * 1e9));
    }
    return times_ns;
  }
  for (const std::string& line : Lines(ReadFile(path, kMaxTextBytes))) {
    const std::optional<double> seconds = ParseFinite(line);
    if (!seconds || *seconds < 0 || *seconds > 1e6 ||
        (!times_ns.empty() && std::llround(*seconds * 1e9) <= times_ns.back())) {
      throw Error("line " + std::to_string(times_ns.size() + 1) + " of '" + path + "' is '" +
                  line.substr(0, 40) + "', accepted are seconds that increase");
    }
    times_ns.push_back(std::llround(*seconds * 1e9));
  }
  if (times_ns.size() < count) {
    throw Error("'" + path + "' has " + std::to_string(times_ns.size()) + " lines for " +
                std::to_string(count) + " images");
  }
  return times_ns;
}

}  // namespace

std::vector<Eigen::Isometry3d> ParseKittiPoses(const std::string& text, const std::string& name) {
  std::vector<Eigen::Isometry3d> poses;
  const std::vector<std::string> lines = Lines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::optional<Projection> matrix = ParseMatrix(SplitBlanks(lines[i]), 0);
    // The public files round: rotations are orthonormal to some 1e-6 only.
    const bool is_rotation =
        matrix &&
        (matrix->leftCols<3>() * matrix->leftCols<3>().transpose() - Eigen::Matrix3d::Identity())
                .norm() < 1e-2 &&
        matrix->leftCols<3>().determinant() > 0;
    if (!is_rotation) {
      throw Error("line " + std::to_string(i + 1) + " of '" + name + "' is '" +
                  lines[i].substr(0, 60) + "', accepted are the 12 numbers of a 3x4 pose");
    }
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::Quaterniond(matrix->leftCols<3>()).normalized().toRotationMatrix();
    pose.translation() = matrix->col(3);
    poses.push_back(pose);
  }
  return poses;
}

Sequence ReadKittiSequence(const std::string& directory, double rate_hz) {
  const fs::path root(directory);
  if (!fs::exists(root)) throw Error("the KITTI folder '" + directory + "' does not exist");
  if (!fs::is_directory(root)) throw Error("'" + directory + "' is no folder");
  Sequence sequence;
  const std::string calibration = (root / "calib.txt").string();
  const std::vector<std::string> projections = Lines(ReadFile(calibration, kMaxTextBytes));
  const Projection p = ParseProjection(projections, 0, calibration);
  sequence.intrinsics = {p(0, 0), p(1, 1), p(0, 2), p(1, 2), 0, 0};
  const fs::path folder = ImageFolder(root);
  const std::vector<std::string> paths = ListImages(folder);
  const std::vector<std::int64_t> times_ns = FrameTimesNs(root, paths.size(), rate_hz);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    sequence.frames.push_back({times_ns[i], paths[i], 0, ""});
  }
  const std::optional<RightCamera> right = FindRightCamera(folder);
  // A calibration that stops at the left camera is that of a folder used with one.
  if (right && projections.size() > right->left_line + 1) {
    ReadRightCamera(*right, projections, calibration, sequence);
  }
  const std::string poses_path = (root / "poses.txt").string();
  if (!fs::exists(poses_path)) return sequence;
  const std::vector<Eigen::Isometry3d> poses =
      ParseKittiPoses(ReadFile(poses_path, kMaxTextBytes), poses_path);
  if (poses.size() < paths.size()) {
    throw Error("'" + poses_path + "' has " + std::to_string(poses.size()) + " poses for " +
                std::to_string(paths.size()) + " images");
  }
  for (std::size_t i = 0; i < paths.size(); ++i) {
    sequence.poses.push_back({times_ns[i], poses[i]});
  }
  return sequence;
}

}  // namespace livemap::datasets
