#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace livemap::tools {

/// Faces and number plates that people labelled in photos. A text file, a line each:
///
///   PHOTO KIND X Y WIDTH HEIGHT
///
/// PHOTO is the end of the photo's path, from the start of a folder's or the file's name; KIND is
/// face, plate or unclear (one that is too small, turned away or unreadable: it is neither missed
/// nor false); the rest are px of the photo. Empty lines and lines that begin with # are passed by.
class PrivacyLabels {
 public:
  enum class Kind { kFace, kPlate, kUnclear };
  struct Label {
    std::string photo;
    Kind kind = Kind::kFace;
    cv::Rect box;  ///< px
  };

  /// Throws Error that names the file, the line and what is accepted.
  static PrivacyLabels Load(const std::string& path);

  /// Those of the photo at this path; none where it has none.
  std::vector<Label> Of(const std::string& path) const;

 private:
  std::vector<Label> labels_;
};

/// What masks do to labelled faces and plates, over all photos.
struct PrivacyScore {
  std::size_t faces = 0;
  std::size_t faces_masked = 0;
  std::size_t plates = 0;
  std::size_t plates_masked = 0;
  std::size_t false_masks = 0;       ///< They touch no label of any kind.
  std::size_t false_sure_masks = 0;  ///< Of these, those that would hide a hazard.

  /// Adds one photo. A face or plate counts as masked when the masks together cover at least
  /// kMaskedShare of its box.
  void Add(const std::vector<PrivacyLabels::Label>& labels, const std::vector<cv::Rect>& masks,
           const std::vector<cv::Rect>& sure_masks);
};
constexpr double kMaskedShare = 0.75;

/// The share of a box that the masks together cover, 0 to 1.
double CoveredShare(const cv::Rect& box, const std::vector<cv::Rect>& masks);

}  // namespace livemap::tools
