#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "common/error.h"
#include "common/text_file.h"
#include "datasets/sequences.h"
#include "datasets/stamp_pairs.h"
#include "datasets/text_parsing.h"

namespace livemap::datasets {
namespace {

namespace fs = std::filesystem;

constexpr double kPublishedDepthScale = 5000;
constexpr double kMaxRepeatedM = 0.02;
constexpr double kMaxRepeatedRad = 0.02;

[[noreturn]] void RefuseLine(const std::string& name, std::size_t index, const std::string& line,
                             const std::string& accepted) {
  const std::vector<std::string> parts = SplitBlanks(line);
  const std::string separator = SeparatorHint(line);
  throw Error("line " + std::to_string(index + 1) + " of '" + name + "' is '" + line.substr(0, 80) +
              "', accepted is '" + accepted + "'" +
              (separator.empty() && !parts.empty() ? StampHint(parts[0]) : separator));
}

[[noreturn]] void RefuseTwice(const std::string& name, std::size_t first, std::size_t second,
                              const std::vector<std::string>& lines, const std::string& what) {
  throw Error("lines " + std::to_string(first + 1) + " and " + std::to_string(second + 1) +
              " of '" + name + "' have one stamp and two " + what + ", '" +
              lines[first].substr(0, 80) + "' and '" + lines[second].substr(0, 80) +
              "', accepted is one for each stamp");
}

/// Lines that say once more what the line before said.
class RepeatedLines {
 public:
  void Add(std::size_t index) {
    if (count_++ == 0) first_ = index;
  }
  /// Tells of them, if there were any.
  void Note(const std::string& name, std::vector<std::string>* notes) const {
    if (count_ == 0 || notes == nullptr) return;
    notes->push_back(std::to_string(count_) + (count_ == 1 ? " line" : " lines") + " of '" + name +
                     "', the first of them line " + std::to_string(first_ + 1) +
                     ", repeated the stamp before and said (nearly) the same: left out");
  }

 private:
  std::size_t count_ = 0;
  std::size_t first_ = 0;
};

/// Whether two poses with one stamp say the same: a receiver of motion capture may round two
/// neighbouring moments to one.
bool AreNearlyEqual(const StampedPose& a, const StampedPose& b) {
  const Eigen::Isometry3d motion = a.world_from_camera.inverse() * b.world_from_camera;
  return motion.translation().norm() <= kMaxRepeatedM &&
         Eigen::AngleAxisd(motion.linear()).angle() <= kMaxRepeatedRad;
}

bool IsCommentOrEmpty(const std::string& line) {
  const std::size_t first = line.find_first_not_of(" \t\r");
  return first == std::string::npos || line[first] == '#';
}

/// A listed picture must lie inside the folder.
bool IsInside(const std::string& path) {
  if (path.empty() || path.size() > 1024 || path.find('\0') != std::string::npos) return false;
  const fs::path normal = fs::path(path).lexically_normal();
  return normal.is_relative() && *normal.begin() != "..";
}

double CameraNumber(const YAML::Node& root, const std::string& key, const std::string& path) {
  const YAML::Node node = root[key];
  const std::optional<double> value =
      node && node.IsScalar() ? ParseFinite(node.Scalar()) : std::nullopt;
  if (!value || *value <= 0 || *value > 1e6) {
    throw Error("'" + key + "' of '" + path + "' is " +
                (node && node.IsScalar() ? "'" + node.Scalar().substr(0, 40) + "'" : "missing") +
                ", it must be a positive number up to 1e6");
  }
  return *value;
}

int CameraPixels(const YAML::Node& root, const std::string& key, const std::string& path) {
  const double pixels = CameraNumber(root, key, path);
  if (pixels != std::floor(pixels)) {
    throw Error("'" + key + "' of '" + path + "' is " + root[key].Scalar() +
                ", accepted is a whole number");
  }
  return static_cast<int>(pixels);
}

/// Returns whether the file says the depth's scale.
bool ReadCamera(const std::string& path, Sequence& sequence) {
  YAML::Node root;
  try {
    root = YAML::Load(ReadTextFile(path, 1U << 16U));
  } catch (const YAML::Exception& exception) {
    throw Error("'" + path + "' is no YAML: " + exception.what());
  }
  if (!root.IsMap()) throw Error("'" + path + "' must be a map of camera numbers");
  sequence.intrinsics.width = CameraPixels(root, "width", path);
  sequence.intrinsics.height = CameraPixels(root, "height", path);
  sequence.intrinsics.fx = CameraNumber(root, "fx", path);
  sequence.intrinsics.fy = CameraNumber(root, "fy", path);
  sequence.intrinsics.cx = CameraNumber(root, "cx", path);
  sequence.intrinsics.cy = CameraNumber(root, "cy", path);
  sequence.depth_scale =
      root["depth_scale"] ? CameraNumber(root, "depth_scale", path) : kPublishedDepthScale;
  sequence.baseline_m = root["baseline_m"] ? CameraNumber(root, "baseline_m", path) : 0;
  return root["depth_scale"].IsDefined();
}

/// The camera as a file states it, or else as published for the folder's name. Returns the file
/// that does not say the depth's scale, or nothing.
std::string FindCamera(const fs::path& root, const std::string& camera_file, Sequence& sequence) {
  const fs::path beside = root / "camera.yaml";
  if (!camera_file.empty() || fs::exists(beside)) {
    const std::string path = camera_file.empty() ? beside.string() : camera_file;
    return ReadCamera(path, sequence) ? "" : path;
  }
  const std::optional<geo::CameraIntrinsics> published = PublishedTumCamera(root.string());
  if (!published) {
    throw Error("'" + root.string() +
                "' has no camera.yaml, and its name is not one of TUM's (freiburg1, freiburg2, "
                "freiburg3): its camera is not known");
  }
  sequence.intrinsics = *published;
  sequence.depth_scale = kPublishedDepthScale;
  return "";
}

/// A list; what is to be told of it goes to the sequence's notes.
std::vector<SequenceFrame> ReadList(const std::string& path, Sequence& sequence) {
  return ParseTumAssociations(ReadTextFile(path, kMaxTextBytes), path, &sequence.notes);
}

/// rgb.txt and, where there is one and it is wanted, depth.txt.
std::vector<SequenceFrame> PairLists(const fs::path& root, DepthImages depth_images,
                                     Sequence& sequence) {
  const std::string rgb = (root / "rgb.txt").string();
  const std::string depth = (root / "depth.txt").string();
  std::vector<SequenceFrame> pictures = ReadList(rgb, sequence);
  if (depth_images == DepthImages::kIgnored || !fs::exists(depth)) return pictures;
  const std::vector<SequenceFrame> depths = ReadList(depth, sequence);
  std::vector<SequenceFrame> frames = AssociateDepth(pictures, depths);
  if (frames.empty()) {
    throw Error("no picture of '" + rgb + "' is within 0.02 s of a depth image of '" + depth + "'");
  }
  return frames;
}

/// associations.txt, or else the lists that it is made of.
std::vector<SequenceFrame> ReadLists(const fs::path& root, DepthImages depth_images,
                                     Sequence& sequence) {
  const std::string both = (root / "associations.txt").string();
  if (!fs::exists(both)) return PairLists(root, depth_images, sequence);
  std::vector<SequenceFrame> frames = ReadList(both, sequence);
  if (depth_images == DepthImages::kIgnored) {
    for (SequenceFrame& frame : frames) frame.depth_path.clear();
  }
  return frames;
}

void RequireFolder(const fs::path& path) {
  if (!fs::exists(path)) throw Error("the TUM folder '" + path.string() + "' does not exist");
  if (!fs::is_directory(path)) throw Error("'" + path.string() + "' is no folder");
}

void Anchor(const fs::path& root, std::string& path, const std::string& listed_in) {
  if (path.empty()) return;
  const fs::path whole = root / path;
  if (!fs::is_regular_file(whole)) {
    throw Error("the image '" + whole.string() + "' listed in '" + listed_in + "' is missing");
  }
  path = whole.string();
}

/// The right camera's picture of each frame that has one.
void ReadRightCamera(const fs::path& root, Sequence& sequence) {
  const std::string list = (root / "rgb_right.txt").string();
  if (!fs::exists(list)) return;
  const std::vector<SequenceFrame> rights = ReadList(list, sequence);
  auto right = rights.begin();
  for (SequenceFrame& frame : sequence.frames) {
    while (right != rights.end() && right->stamp_ns < frame.stamp_ns) ++right;
    if (right == rights.end()) return;
    if (right->stamp_ns != frame.stamp_ns) continue;
    frame.right_path = right->image_path;
    Anchor(root, frame.right_path, list);
  }
}

/// As numpy.savetxt writes it, a trajectory's stamp may be "1.305031102160407066e+09".
std::optional<std::int64_t> ParseTrajectoryStampNs(const std::string& text) {
  if (text.find_first_of("eE") == std::string::npos) return ParseStampNs(text);
  const std::optional<double> seconds = ParseFinite(text);
  if (!seconds || *seconds < 0 || *seconds > 4294967295) return std::nullopt;
  return std::llround(*seconds * 1e9);
}

}  // namespace

std::optional<std::int64_t> ParseStampNs(const std::string& text) {
  const std::size_t point = text.find('.');
  const std::string whole = text.substr(0, point);
  std::string fraction = point == std::string::npos ? "" : text.substr(point + 1);
  const auto all_digits = [](const std::string& part) {
    return std::all_of(part.begin(), part.end(), [](char c) { return c >= '0' && c <= '9'; });
  };
  if (whole.empty() || whole.size() > 10 || !all_digits(whole) || !all_digits(fraction)) {
    return std::nullopt;
  }
  fraction.resize(9, '0');
  const std::int64_t seconds = std::stoll(whole);
  // What ROS's time can hold.
  if (seconds > 4294967295) return std::nullopt;
  return seconds * 1'000'000'000 + std::stoll(fraction);
}

std::vector<SequenceFrame> ParseTumAssociations(const std::string& text, const std::string& name,
                                                std::vector<std::string>* notes) {
  std::vector<SequenceFrame> frames;
  RepeatedLines repeated;
  std::size_t last = 0;
  const std::vector<std::string> lines = Lines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (IsCommentOrEmpty(lines[i])) continue;
    const std::vector<std::string> parts = SplitBlanks(lines[i]);
    const std::string accepted = "stamp image [stamp depth]";
    const bool has_depth = parts.size() == 4;
    if (parts.size() != 2 && !has_depth) RefuseLine(name, i, lines[i], accepted);
    const std::optional<std::int64_t> stamp = ParseStampNs(parts[0]);
    const std::optional<std::int64_t> depth_stamp = has_depth ? ParseStampNs(parts[2]) : stamp;
    if (!stamp || !depth_stamp || !IsInside(parts[1]) || (has_depth && !IsInside(parts[3]))) {
      RefuseLine(name, i, lines[i], accepted);
    }
    const SequenceFrame frame{*stamp, parts[1], *depth_stamp, has_depth ? parts[3] : ""};
    if (!frames.empty() && frame.stamp_ns < frames.back().stamp_ns) {
      RefuseLine(name, i, lines[i], "stamps that increase");
    }
    if (!frames.empty() && frame.stamp_ns == frames.back().stamp_ns) {
      const SequenceFrame& before = frames.back();
      if (frame.image_path != before.image_path || frame.depth_path != before.depth_path) {
        RefuseTwice(name, last, i, lines, "images");
      }
      repeated.Add(i);
      continue;
    }
    last = i;
    frames.push_back(frame);
  }
  repeated.Note(name, notes);
  if (frames.empty()) throw Error("'" + name + "' lists no image");
  return frames;
}

std::vector<StampedPose> ParseTumTrajectory(const std::string& text, const std::string& name,
                                            std::vector<std::string>* notes) {
  std::vector<StampedPose> poses;
  RepeatedLines repeated;
  std::size_t last = 0;
  const std::vector<std::string> lines = Lines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (IsCommentOrEmpty(lines[i])) continue;
    const std::vector<std::string> parts = SplitBlanks(lines[i]);
    const std::string accepted = "stamp tx ty tz qx qy qz qw";
    if (parts.size() != 8) RefuseLine(name, i, lines[i], accepted);
    const std::optional<std::int64_t> stamp = ParseTrajectoryStampNs(parts[0]);
    if (!stamp) RefuseLine(name, i, lines[i], accepted);
    std::array<double, 7> numbers{};
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      const std::optional<double> value = ParseFinite(parts[k + 1]);
      if (!value || std::abs(*value) > 1e9) RefuseLine(name, i, lines[i], accepted);
      numbers[k] = *value;
    }
    Eigen::Quaterniond rotation(numbers[6], numbers[3], numbers[4], numbers[5]);
    if (std::abs(rotation.norm() - 1) > 0.01) {
      RefuseLine(name, i, lines[i], accepted + " with a unit quaternion");
    }
    rotation.normalize();
    StampedPose pose;
    pose.stamp_ns = *stamp;
    pose.world_from_camera = Eigen::Translation3d(numbers[0], numbers[1], numbers[2]) * rotation;
    if (!poses.empty() && pose.stamp_ns < poses.back().stamp_ns) {
      RefuseLine(name, i, lines[i], "stamps that increase");
    }
    if (!poses.empty() && pose.stamp_ns == poses.back().stamp_ns) {
      if (!AreNearlyEqual(pose, poses.back())) RefuseTwice(name, last, i, lines, "poses");
      repeated.Add(i);
      continue;
    }
    last = i;
    poses.push_back(pose);
  }
  repeated.Note(name, notes);
  return poses;
}

std::vector<SequenceFrame> AssociateDepth(const std::vector<SequenceFrame>& pictures,
                                          const std::vector<SequenceFrame>& depths) {
  const auto stamps = [](const std::vector<SequenceFrame>& frames) {
    std::vector<std::int64_t> values;
    values.reserve(frames.size());
    for (const SequenceFrame& frame : frames) values.push_back(frame.stamp_ns);
    return values;
  };
  std::vector<SequenceFrame> frames;
  for (const auto& [picture, depth] :
       PairNearestStamps(stamps(pictures), stamps(depths), kMaxDepthDifferenceNs)) {
    frames.push_back({pictures[picture].stamp_ns, pictures[picture].image_path,
                      depths[depth].stamp_ns, depths[depth].image_path});
  }
  return frames;
}

std::optional<geo::CameraIntrinsics> PublishedTumCamera(const std::string& directory) {
  const fs::path whole = fs::absolute(directory).lexically_normal();
  // "fr1/" has no last name but an empty one.
  const std::string name = (whole.has_filename() ? whole : whole.parent_path()).filename().string();
  const auto holds = [&name](const std::string& number) {
    return name.find("freiburg" + number) != std::string::npos ||
           name.find("fr" + number) != std::string::npos;
  };
  if (holds("1")) return geo::CameraIntrinsics{517.3, 516.5, 318.6, 255.3, 640, 480};
  if (holds("2")) return geo::CameraIntrinsics{520.9, 521.0, 325.1, 249.7, 640, 480};
  if (holds("3")) return geo::CameraIntrinsics{535.4, 539.2, 320.1, 247.6, 640, 480};
  return std::nullopt;
}

Sequence ReadTumSequence(const std::string& directory, const std::string& camera_file,
                         DepthImages depth_images) {
  const fs::path root(directory);
  RequireFolder(root);
  const bool associated = fs::exists(root / "associations.txt");
  if (!associated && !fs::exists(root / "rgb.txt")) {
    throw Error("'" + directory +
                "' is no TUM sequence: it has no associations.txt and no rgb.txt");
  }
  Sequence sequence;
  const std::string without_scale = FindCamera(root, camera_file, sequence);
  sequence.frames = ReadLists(root, depth_images, sequence);
  const bool has_depth =
      std::any_of(sequence.frames.begin(), sequence.frames.end(),
                  [](const SequenceFrame& frame) { return !frame.depth_path.empty(); });
  if (has_depth && !without_scale.empty()) {
    sequence.notes.push_back("'" + without_scale +
                             "' does not say depth_scale: depth is taken in 5000ths of a metre");
  }
  const std::string list = (root / (associated ? "associations.txt" : "rgb.txt")).string();
  const std::string depth_list = associated ? list : (root / "depth.txt").string();
  for (SequenceFrame& frame : sequence.frames) {
    Anchor(root, frame.image_path, list);
    Anchor(root, frame.depth_path, depth_list);
  }
  ReadRightCamera(root, sequence);
  const std::string truth = (root / "groundtruth.txt").string();
  if (fs::exists(truth)) {
    sequence.poses = ParseTumTrajectory(ReadTextFile(truth, kMaxTextBytes), truth, &sequence.notes);
    if (sequence.poses.empty()) {
      throw Error("'" + truth +
                  "' has no pose, accepted is 'stamp tx ty tz qx qy qz qw' per line, " +
                  "or no such file where the truth is not known");
    }
  }
  return sequence;
}

}  // namespace livemap::datasets
