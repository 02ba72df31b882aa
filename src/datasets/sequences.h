#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "geo/camera_intrinsics.h"

namespace livemap::datasets {

/// A pose with its time.
struct StampedPose {
  std::int64_t stamp_ns = 0;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();  ///< Optical frame.
};

/// One picture of a recorded sequence, with depth where the sequence has it.
struct SequenceFrame {
  std::int64_t stamp_ns = 0;
  std::string image_path;
  std::int64_t depth_stamp_ns = 0;
  std::string depth_path;    ///< 16-bit PNG, empty without depth.
  std::string right_path{};  ///< The right camera's picture of the same moment, empty without one.
};

/// A folder in TUM RGB-D or KITTI odometry layout, paths checked, images not opened yet.
struct Sequence {
  geo::CameraIntrinsics intrinsics;  ///< Width and height zero: as the images.
  double depth_scale = 1;            ///< Depth units per metre.
  double baseline_m =
      0;  ///< From the left camera to the right one; 0: no right camera, or unknown.
  std::vector<SequenceFrame> frames;
  std::vector<StampedPose> poses;
  /// Sentences about what was mended in the files or taken for granted, for people: lines that were
  /// repeated, a scale of depth that no file says.
  std::vector<std::string> notes{};
};

/// A TUM stamp "1305031102.175304" to nanoseconds without losing digits; none when malformed.
std::optional<std::int64_t> ParseStampNs(const std::string& text);

/// Whether a sequence's depth images are wanted.
enum class DepthImages {
  kRead,
  kIgnored,  ///< Frames are all listed pictures, without depth, which may be missing.
};

/// TUM RGB-D layout: associations.txt ("rgb_stamp rgb_path depth_stamp depth_path") or else rgb.txt
/// and depth.txt ("stamp path", paired by AssociateDepth; rgb.txt alone: no depth), groundtruth.txt
/// ("stamp tx ty tz qx qy qz qw", camera to world, optional) and camera.yaml (width, height, fx,
/// fy, cx, cy, depth_scale). Of a rectified stereo pair also rgb_right.txt (as rgb.txt, pictures
/// with the same stamp belong together) and baseline_m in camera.yaml. `camera_file` is read
/// instead of camera.yaml when it is not empty; without either the camera is PublishedTumCamera's.
/// With DepthImages::kIgnored depth.txt is not opened. Stamps must increase; a line that repeats
/// the stamp of the line before and says the same (the same images, or a pose within 0.02 m and
/// 0.02 rad) is left out and noted. Throws Error naming file and line.
Sequence ReadTumSequence(const std::string& directory, const std::string& camera_file = "",
                         DepthImages depth_images = DepthImages::kRead);

/// Stamps of picture and depth that are farther apart do not belong together.
constexpr std::int64_t kMaxDepthDifferenceNs = 20'000'000;

/// Pictures with their depth, as associate.py of the TUM benchmark pairs them (PairNearestStamps);
/// pictures without one are left out. In both lists `image_path` is what the list names.
std::vector<SequenceFrame> AssociateDepth(const std::vector<SequenceFrame>& pictures,
                                          const std::vector<SequenceFrame>& depths);

/// The calibration that TUM publishes for its cameras fr1, fr2 and fr3 (ideal pinhole; the
/// distortion of fr1 and fr2 is left aside), which of them by the folder's name: it holds
/// "freiburg1" or "fr1" and so on. None for any other name.
std::optional<geo::CameraIntrinsics> PublishedTumCamera(const std::string& directory);

/// KITTI odometry layout: images/ (or image_0, image_2) with numbered pictures, calib.txt ("P0: 12
/// numbers" or 12 bare numbers per line, the first line counts), poses.txt (3x4 rows, camera to
/// world, optional), times.txt (seconds, optional: else frames at `rate_hz`). Of a stereo pair also
/// image_1 beside image_0 with P1 in the second line of calib.txt, or image_3 beside image_2 with
/// P2 and P3 in the third and fourth; pictures of one number belong together.
///
/// Pictures are in the order of their numbers (PictureFolder). A picture's number, counted from 0,
/// is its line of times.txt and poses.txt, so that a missing picture moves no other. Where the
/// numbers do not say a line (they begin elsewhere without a gap, or are stamps), a file with
/// exactly one line per picture is taken line by line; anything else is refused. Throws Error.
Sequence ReadKittiSequence(const std::string& directory, double rate_hz);

/// A file with a line per frame.
struct LineCount {
  std::string file;  ///< Its name, for messages.
  std::size_t lines = 0;
};

/// Which line of each of the files, from 0, belongs to each of the pictures, which are in the order
/// of their numbers, as ReadKittiSequence says. Throws Error naming picture and file.
std::vector<std::size_t> LinesOfPictures(const std::vector<std::string>& pictures,
                                         const std::vector<LineCount>& files);

/// For the parsers' tests and fuzzers; `name` is for messages, `notes` receives Sequence::notes.
std::vector<SequenceFrame> ParseTumAssociations(const std::string& text, const std::string& name,
                                                std::vector<std::string>* notes = nullptr);
std::vector<StampedPose> ParseTumTrajectory(const std::string& text, const std::string& name,
                                            std::vector<std::string>* notes = nullptr);
std::vector<Eigen::Isometry3d> ParseKittiPoses(const std::string& text, const std::string& name);

}  // namespace livemap::datasets
