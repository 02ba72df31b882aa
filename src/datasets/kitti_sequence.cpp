#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "common/error.h"
#include "common/picture_folder.h"
#include "common/text_file.h"
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

/// The name before a line's numbers, "P0:"; empty where it has none.
std::string NameOfKittiLine(const std::string& line) {
  const std::vector<std::string> parts = SplitBlanks(line);
  return !parts.empty() && parts[0].back() == ':' ? parts[0] : "";
}

/// The line of a camera's projection: that of its name where the lines have names, else that of its
/// number. None without such a line.
std::optional<std::size_t> LineOfKittiCamera(const std::vector<std::string>& lines,
                                             std::size_t camera) {
  const std::string wanted = "P" + std::to_string(camera) + ":";
  bool named = false;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string name = NameOfKittiLine(lines[i]);
    if (name == wanted) return i;
    named = named || !name.empty();
  }
  return named || camera >= lines.size() ? std::nullopt : std::optional(camera);
}

/// The line of the only or left camera. A file that has not that camera's has another's, which has
/// the same focal length and principal point.
std::size_t LineOfFirstKittiCamera(const std::vector<std::string>& lines, const fs::path& folder,
                                   const std::string& name) {
  const bool named = std::any_of(lines.begin(), lines.end(), [](const std::string& line) {
    return !NameOfKittiLine(line).empty();
  });
  if (!named) return 0;
  for (const std::size_t camera : {folder.filename() == "image_2" ? 2U : 0U, 0U, 1U, 2U, 3U}) {
    if (const auto line = LineOfKittiCamera(lines, camera)) return *line;
  }
  throw Error("'" + name + "' names no camera's projection, its first line is '" +
              lines[0].substr(0, 40) + "', accepted are lines 'P0: ' to 'P3: ' with 12 numbers");
}

/// The folder of the right camera's pictures and the number of the left one.
struct RightCamera {
  fs::path folder;
  std::size_t left = 0;
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
  const std::optional<std::size_t> left_line = LineOfKittiCamera(calibration, camera.left);
  const std::optional<std::size_t> right_line = LineOfKittiCamera(calibration, camera.left + 1);
  // A calibration that stops at the left camera is that of a folder used with one.
  if (!left_line || !right_line) return;
  const Projection left = ParseProjection(calibration, *left_line, name);
  const Projection right = ParseProjection(calibration, *right_line, name);
  // The other numbers are the left camera's, as in every rectified pair.
  sequence.baseline_m = left(0, 3) / left(0, 0) - right(0, 3) / right(0, 0);
  if ((left.leftCols<3>() - right.leftCols<3>()).cwiseAbs().maxCoeff() > 0.01 ||
      !(sequence.baseline_m > 0)) {
    throw Error("lines " + std::to_string(*left_line + 1) + " and " +
                std::to_string(*right_line + 1) + " of '" + name +
                "' must be projections of a rectified pair, the right one with the baseline");
  }
  const PictureFolder pictures(camera.folder.string(), PictureNames::kNumbered);
  for (SequenceFrame& frame : sequence.frames) {
    frame.right_path = pictures.Find(StemOf(frame.image_path)).value_or("");
  }
}

fs::path ImageFolder(const fs::path& root) {
  for (const char* name : {"images", "image_0", "image_2"}) {
    if (fs::is_directory(root / name)) return root / name;
  }
  throw Error("the KITTI folder '" + root.string() + "' holds no images, image_0 or image_2");
}

std::vector<std::string> ListImages(const fs::path& folder) {
  std::vector<std::string> paths = PictureFolder(folder.string(), PictureNames::kNumbered).paths();
  if (paths.empty()) {
    throw Error("the image folder '" + folder.string() + "' holds no .png, .jpg or .jpeg");
  }
  return paths;
}

/// The whole of times.txt.
std::vector<std::int64_t> ReadTimesNs(const std::string& path) {
  std::vector<std::int64_t> times_ns;
  for (const std::string& line : Lines(ReadTextFile(path, kMaxTextBytes))) {
    const std::optional<double> seconds = ParseFinite(line);
    if (!seconds || *seconds < 0 || *seconds > 1e6 ||
        (!times_ns.empty() && std::llround(*seconds * 1e9) <= times_ns.back())) {
      throw Error("line " + std::to_string(times_ns.size() + 1) + " of '" + path + "' is '" +
                  line.substr(0, 40) + "', accepted are seconds from 0 to 1e6 that increase" +
                  StampHint(line));
    }
    times_ns.push_back(std::llround(*seconds * 1e9));
  }
  return times_ns;
}

/// The numbers in the pictures' names; none where one has no number or they do not increase.
std::optional<std::vector<std::uint64_t>> NumbersOf(const std::vector<std::string>& pictures) {
  std::vector<std::uint64_t> numbers;
  for (const std::string& picture : pictures) {
    const std::optional<std::uint64_t> number = NumberOf(StemOf(picture));
    if (!number || (!numbers.empty() && *number <= numbers.back())) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

/// 0, 1, 2, ... `count` of them.
std::vector<std::size_t> InOrder(std::size_t count) {
  std::vector<std::size_t> lines(count);
  std::iota(lines.begin(), lines.end(), std::size_t{0});
  return lines;
}

/// Above, a number is a stamp and no frame's.
constexpr std::uint64_t kMaxFrameNumber = 100'000'000;

[[noreturn]] void RefuseMatrix(const std::string& line, std::size_t index,
                               const std::string& name) {
  const std::size_t columns = SplitBlanks(line).size();
  throw Error("line " + std::to_string(index + 1) + " of '" + name + "' is '" + line.substr(0, 60) +
              (columns == 12 ? "', which are not 12 numbers up to 1e9"
                             : "', which has " + std::to_string(columns) + " columns") +
              ", accepted are the 12 numbers of a 3x4 pose" + SeparatorHint(line));
}

}  // namespace

std::vector<std::size_t> LinesOfPictures(const std::vector<std::string>& pictures,
                                         const std::vector<LineCount>& files) {
  const std::size_t count = pictures.size();
  const std::optional<std::vector<std::uint64_t>> numbers = NumbersOf(pictures);
  const bool one_per_picture = std::all_of(
      files.begin(), files.end(), [&](const LineCount& file) { return file.lines == count; });
  const bool no_gap = numbers && numbers->back() - numbers->front() + 1 == count;
  const bool are_frames = numbers && numbers->back() <= kMaxFrameNumber;
  if (files.empty()) {
    // Only the distances in time count: by the numbers, where these are of frames.
    if (!are_frames) return InOrder(count);
    std::vector<std::size_t> lines;
    for (const std::uint64_t number : *numbers) lines.push_back(number - numbers->front());
    return lines;
  }
  if (one_per_picture && (no_gap || !are_frames)) return InOrder(count);
  for (const LineCount& file : files) {
    if (are_frames && numbers->back() < file.lines) continue;
    throw Error("'" + pictures.back() + "' " +
                (are_frames ? "has the number " + std::to_string(numbers->back())
                            : "has no number of a frame") +
                ", but '" + file.file + "' has " + std::to_string(file.lines) + " lines for " +
                std::to_string(count) +
                " images: accepted is the number, from 0, of each image's line, or a line per "
                "image and numbers without a gap");
  }
  return {numbers->begin(), numbers->end()};
}

std::vector<Eigen::Isometry3d> ParseKittiPoses(const std::string& text, const std::string& name) {
  std::vector<Eigen::Isometry3d> poses;
  const std::vector<std::string> lines = Lines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::optional<Projection> matrix = ParseMatrix(SplitBlanks(lines[i]), 0);
    if (!matrix) RefuseMatrix(lines[i], i, name);
    const Eigen::Matrix3d rotation = matrix->leftCols<3>();
    // The public files round: rotations are orthonormal to some 1e-6 only.
    if ((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() >= 1e-2 ||
        rotation.determinant() <= 0) {
      throw Error("line " + std::to_string(i + 1) + " of '" + name + "' is '" +
                  lines[i].substr(0, 60) + "', whose 3x3 part is no rotation (its determinant is " +
                  std::to_string(rotation.determinant()) +
                  "), accepted are 3x4 poses row by row with perpendicular axes of length 1");
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
  const std::vector<std::string> projections = Lines(ReadTextFile(calibration, kMaxTextBytes));
  const fs::path folder = ImageFolder(root);
  const Projection p = ParseProjection(
      projections, LineOfFirstKittiCamera(projections, folder, calibration), calibration);
  sequence.intrinsics = {p(0, 0), p(1, 1), p(0, 2), p(1, 2), 0, 0};
  const std::vector<std::string> paths = ListImages(folder);
  const std::string times_path = (root / "times.txt").string();
  const std::string poses_path = (root / "poses.txt").string();
  std::vector<LineCount> files;
  std::vector<std::int64_t> times_ns;
  const bool has_times = fs::exists(times_path);
  if (has_times) {
    times_ns = ReadTimesNs(times_path);
    files.push_back({times_path, times_ns.size()});
  }
  std::vector<Eigen::Isometry3d> poses;
  const bool has_poses = fs::exists(poses_path);
  if (has_poses) {
    poses = ParseKittiPoses(ReadTextFile(poses_path, kMaxTextBytes), poses_path);
    files.push_back({poses_path, poses.size()});
  }
  const std::vector<std::size_t> lines = LinesOfPictures(paths, files);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const std::int64_t stamp_ns = has_times
                                      ? times_ns[lines[i]]
                                      : std::llround(static_cast<double>(lines[i]) / rate_hz * 1e9);
    sequence.frames.push_back({stamp_ns, paths[i], 0, ""});
    if (has_poses) sequence.poses.push_back({stamp_ns, poses[lines[i]]});
  }
  const std::optional<RightCamera> right = FindRightCamera(folder);
  if (right) ReadRightCamera(*right, projections, calibration, sequence);
  return sequence;
}

}  // namespace livemap::datasets
