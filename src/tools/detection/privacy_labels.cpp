#include "tools/detection/privacy_labels.h"

#include <algorithm>
#include <fstream>
#include <sstream>

#include "common/error.h"

namespace livemap::tools {
namespace {

constexpr int kLargestLabelPx = 100000;

PrivacyLabels::Label ParsePrivacyLabel(const std::string& line, const std::string& where) {
  std::istringstream fields(line);
  PrivacyLabels::Label label;
  std::string kind;
  std::string more;
  cv::Rect& box = label.box;
  fields >> label.photo >> kind >> box.x >> box.y >> box.width >> box.height;
  const bool is_read = !fields.fail() && !(fields >> more);
  const bool is_placed = box.x >= 0 && box.y >= 0 && box.width > 0 && box.height > 0 &&
                         box.x <= kLargestLabelPx && box.y <= kLargestLabelPx &&
                         box.width <= kLargestLabelPx && box.height <= kLargestLabelPx;
  if (kind == "face") {
    label.kind = PrivacyLabels::Kind::kFace;
  } else if (kind == "plate") {
    label.kind = PrivacyLabels::Kind::kPlate;
  } else if (kind == "unclear") {
    label.kind = PrivacyLabels::Kind::kUnclear;
  } else {
    label.photo.clear();
  }
  if (!is_read || !is_placed || label.photo.empty()) {
    throw Error(where + " is '" + line.substr(0, 200) +
                "', accepted is PHOTO face|plate|unclear X Y WIDTH HEIGHT in whole pixels");
  }
  return label;
}

bool IsEndOfPath(const std::string& end, const std::string& path) {
  if (path.size() < end.size()) return false;
  const std::size_t begin = path.size() - end.size();
  return path.compare(begin, end.size(), end) == 0 && (begin == 0 || path[begin - 1] == '/');
}

bool IsTouched(const cv::Rect& mask, const std::vector<PrivacyLabels::Label>& labels) {
  return std::any_of(labels.begin(), labels.end(), [&](const PrivacyLabels::Label& label) {
    return !(label.box & mask).empty();
  });
}

std::size_t CountFalse(const std::vector<cv::Rect>& masks,
                       const std::vector<PrivacyLabels::Label>& labels) {
  return static_cast<std::size_t>(std::count_if(
      masks.begin(), masks.end(), [&](const cv::Rect& mask) { return !IsTouched(mask, labels); }));
}

}  // namespace

PrivacyLabels PrivacyLabels::Load(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw Error("cannot read labels '" + path + "', accepted is a text file");
  PrivacyLabels labels;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    labels.labels_.push_back(
        ParsePrivacyLabel(line, "labels '" + path + "' line " + std::to_string(number)));
  }
  if (file.bad()) throw Error("cannot read labels '" + path + "', accepted is a text file");
  return labels;
}

std::vector<PrivacyLabels::Label> PrivacyLabels::Of(const std::string& path) const {
  std::vector<Label> found;
  std::copy_if(labels_.begin(), labels_.end(), std::back_inserter(found),
               [&](const Label& label) { return IsEndOfPath(label.photo, path); });
  return found;
}

void PrivacyScore::Add(const std::vector<PrivacyLabels::Label>& labels,
                       const std::vector<cv::Rect>& masks,
                       const std::vector<cv::Rect>& sure_masks) {
  for (const PrivacyLabels::Label& label : labels) {
    if (label.kind == PrivacyLabels::Kind::kUnclear) continue;
    const bool is_face = label.kind == PrivacyLabels::Kind::kFace;
    ++(is_face ? faces : plates);
    if (CoveredShare(label.box, masks) >= kMaskedShare) {
      ++(is_face ? faces_masked : plates_masked);
    }
  }
  false_masks += CountFalse(masks, labels);
  false_sure_masks += CountFalse(sure_masks, labels);
}

double CoveredShare(const cv::Rect& box, const std::vector<cv::Rect>& masks) {
  cv::Mat_<std::uint8_t> covered(box.size(), 0);
  const cv::Rect within({}, box.size());
  for (const cv::Rect& mask : masks) covered((mask - box.tl()) & within) = 1;
  return cv::countNonZero(covered) / static_cast<double>(box.area());
}

}  // namespace livemap::tools
