#include "tools/common/contact_sheet.h"

#include "common/error.h"

namespace livemap::tools {

cv::Mat ContactSheet(const std::vector<cv::Mat>& pictures, int columns) {
  if (pictures.empty()) throw Error("a contact sheet needs at least one picture");
  constexpr int kGap = 4;
  const int rows = (static_cast<int>(pictures.size()) + columns - 1) / columns;
  const cv::Size size = pictures.front().size();
  cv::Mat sheet(rows * (size.height + kGap) + kGap, columns * (size.width + kGap) + kGap, CV_8UC3,
                cv::Scalar(24, 24, 24));
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const int column = static_cast<int>(i) % columns;
    const int row = static_cast<int>(i) / columns;
    pictures[i].copyTo(sheet(cv::Rect(kGap + column * (size.width + kGap),
                                      kGap + row * (size.height + kGap), size.width, size.height)));
  }
  return sheet;
}

}  // namespace livemap::tools
