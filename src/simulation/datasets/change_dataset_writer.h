#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <map>
#include <opencv2/core.hpp>
#include <string>

#include "geo/wgs84.h"
#include "simulation/datasets/change_truth.h"
#include "simulation/render/street_renderer.h"

namespace livemap::simulation {

/// One pass's picture of a pair.
struct PassPicture {
  SimulatedFrame frame;
  double along_m = 0;  ///< Of the vehicle along the road's middle line.
};

/// Writes pairs of pictures as VL-CMU-CD lays them out: raw/NNN/RGB/1_II.png (first pass) and
/// 2_II.png (second pass), raw/NNN/GT/gtII.png (CV_8UC1, ChangeClass, in the second picture's
/// view), up to 100 pairs per NNN. Beside them raw/NNN/GT_colours/gtII.png (the same in the
/// published colours), raw/NNN/GT_direction/gtII.png (ChangeView::direction), classes.txt (one name
/// per line, by index), camera.yaml, poses.csv (optical frames in the world frame, metres and
/// quaternions) and changes.geojson. Every Error names the path.
class ChangeDatasetWriter {
 public:
  static constexpr std::size_t kPairsPerSequence = 100;
  static constexpr std::size_t kMaxPairs = 1000 * kPairsPerSequence;
  /// A change is seen in a picture when it decides at least so many pixels of the mask.
  static constexpr int kMinPixels = 24;

  /// Makes the folder; throws Error when it exists and is not empty.
  ChangeDatasetWriter(const std::string& directory, const SimulatedCamera& camera);

  /// The next pair, at most kMaxPairs in all; `view` is the truth from the second picture's pose.
  void Add(const PassPicture& first, const PassPicture& second, const ChangeView& view);
  /// Writes `changes` as GeoJSON points (RFC 7946) and closes the files. `street` is that of either
  /// pass, `datum` the world's origin.
  void Finish(const Street& street, const geo::GeoPoint& datum,
              const std::map<std::uint32_t, StreetChange>& changes);

  std::size_t pairs() const { return pairs_; }
  /// Changes that at least one pair shows.
  std::size_t seen() const { return frames_seen_.size(); }

 private:
  std::string directory_;
  std::ofstream poses_;
  std::size_t pairs_ = 0;
  std::map<std::uint32_t, int> frames_seen_;
};

/// A mask in the published colours; CV_8UC3, BGR.
cv::Mat ColourChanges(const cv::Mat& mask);
/// A picture, grey and dim where nothing changed and in the class's colour elsewhere; CV_8UC3.
cv::Mat OverlayChanges(const cv::Mat& bgr, const cv::Mat& mask);

}  // namespace livemap::simulation
