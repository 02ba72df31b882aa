#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "datasets/camera_file.h"
#include "geo/wgs84.h"
#include "simulation/datasets/labels_in_view.h"
#include "simulation/render/street_renderer.h"

namespace livemap::simulation {

/// Depth units per metre in the TUM RGB-D benchmark's own files.
constexpr double kTumDepthScale = 5000;

/// Writes a drive in TUM RGB-D layout: rgb/, depth/ (16-bit PNG, `depth_scale` units per metre, 0:
/// sky or beyond 65535 units), rgb.txt, depth.txt, associations.txt, groundtruth.txt (optical frame
/// in the world frame, z up), camera.yaml and of a stereo pair rgb_right/ with rgb_right.txt. Every
/// Error names the path.
class TumWriter {
 public:
  /// Makes the folder; throws Error when it exists and is not empty. `baseline_m` is that of a
  /// stereo pair, 0: monocular.
  TumWriter(const std::string& directory, const SimulatedCamera& camera,
            double depth_scale = kTumDepthScale, double baseline_m = 0);
  /// `right` is the right camera's picture of a stereo pair, for rgb_right/; empty: none.
  void Add(double time_s, const SimulatedFrame& frame, const cv::Mat& right = cv::Mat());
  /// Closes the lists; throws Error when the disk was full.
  void Finish();

 private:
  std::string directory_;
  double depth_scale_;
  std::ofstream rgb_;
  std::ofstream right_;  ///< Open once there is a right camera.
  std::ofstream depth_;
  std::ofstream associations_;
  std::ofstream truth_;
};

/// Writes a labelled drive: images/ (JPEG), labels/ (YOLO lines), difficult/ (the same of hazards
/// that are difficult), classes.txt and frames.csv.
class YoloWriter {
 public:
  explicit YoloWriter(const std::string& directory);
  void Add(double chainage_m, const SimulatedFrame& frame,
           const std::vector<HazardInView>& hazards);
  void Finish();

 private:
  std::string directory_;
  std::ofstream frames_;
  std::size_t count_ = 0;
};

/// The true hazards that at least one frame shows, as GeoJSON points (RFC 7946). `frames_seen`
/// counts by instance; `datum` is the world's origin; a hazard before `end_along_m`, where the
/// drive ends, is marked as passed.
std::string HazardsAsGeoJson(const Street& street, const geo::GeoPoint& datum,
                             const std::map<std::uint32_t, int>& frames_seen, double end_along_m);

/// Each class in its colour, for looking at truth; CV_8UC3.
cv::Mat ColourClasses(const cv::Mat& classes);
/// Near warm, far cold, sky black; CV_8UC3.
cv::Mat ColourDepth(const cv::Mat& depth);
/// Draws boxes with class names into a picture.
void DrawHazards(const std::vector<HazardInView>& hazards, cv::Mat& bgr);

}  // namespace livemap::simulation
