#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace livemap::perception {

/// What may be a face or a number plate.
struct PrivateRegion {
  cv::Rect box;  ///< px
  /// Whether the finder is certain enough to hide the hazard of a picture for it. It finds more
  /// than there is: of what it is not sure of, most is no face and no plate.
  bool is_sure = false;
};

/// Finds what must not leave the car: faces and number plates. Not thread-safe.
class PrivateRegionFinder {
 public:
  virtual ~PrivateRegionFinder() = default;

  /// One word for logs and diagnostics: "networks" or "cascades".
  virtual std::string Name() const { return "another finder"; }

  /// All that meets `part` of `bgr` (8 bit, 3 channels), in pixels of `bgr` and inside it; others
  /// may be among them. Throws Error when it cannot say.
  virtual std::vector<PrivateRegion> Find(const cv::Mat& bgr, const cv::Rect& part) = 0;
};

/// What looks for faces and number plates.
enum class PrivateRegionSource {
  /// The networks where a file of theirs is placed and no face_model is named, else the cascades.
  kAuto,
  kNetworks,
  kCascades,
};

struct PrivateRegionConfig {
  PrivateRegionSource source = PrivateRegionSource::kAuto;
  /// Manifest of the networks (models/privacy.yaml); empty: there are none.
  std::string networks;
  /// Folder of OpenCV's Haar cascades (Debian's opencv-data): frontal and profile faces, plates.
  std::string cascades = "/usr/share/opencv4/haarcascades";
  /// A YuNet model (ONNX) that looks for faces instead of the cascades; empty: none.
  std::string face_model;
  /// The cascades do not look for smaller faces and plates; nobody knows them by it. The networks
  /// know no such limit.
  int min_side_px = 16;
};

/// The finder that the configuration asks for. Throws Error naming the file that cannot be loaded:
/// who has no finder sends no picture. In particular kAuto does not fall back to the cascades when
/// some of the networks' files are placed and one of them is missing, damaged or another one.
std::unique_ptr<PrivateRegionFinder> MakePrivateRegionFinder(const PrivateRegionConfig& config);

}  // namespace livemap::perception
