#include "imaging/picture_marks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace livemap::imaging {
namespace {

const cv::Scalar kSubjectColour(0, 0, 230);  // A red that neither road nor plants have.
const cv::Scalar kHaloColour(255, 255, 255);
const cv::Scalar kOtherColour(230, 230, 230);
constexpr double kOtherOpacity = 0.45;
constexpr double kMarkFont = 0.5;
constexpr double kLeastMarkFont = 0.3;  // Below it letters are no longer told apart.
constexpr std::size_t kMostLabelBytes = 60;
constexpr int kLabelMarginPx = 3;

/// The box in the picture's pixels, its edges moved into the picture; none where it has no part of
/// it.
std::optional<cv::Rect> MarkInPicture(const Box& box, const PixelRegion& shown, double scale,
                                      const cv::Size& picture) {
  // Written so that NaN is refused.
  if (!(box.x_max > box.x_min && box.y_max > box.y_min)) return std::nullopt;
  const auto at = [scale](float edge, std::uint32_t begin, int length) {
    const double pixel = (static_cast<double>(edge) - begin) * scale;
    return std::clamp(pixel, -1.0, length + 1.0);
  };
  const double left = at(box.x_min, shown.x, picture.width);
  const double top = at(box.y_min, shown.y, picture.height);
  const double right = at(box.x_max, shown.x, picture.width);
  const double bottom = at(box.y_max, shown.y, picture.height);
  if (right <= 0 || bottom <= 0 || left >= picture.width || top >= picture.height) {
    return std::nullopt;
  }
  const auto pixel = [](double edge, int length) { return std::clamp(cvRound(edge), 0, length); };
  const cv::Point first(pixel(left, picture.width - 1), pixel(top, picture.height - 1));
  const cv::Point end(std::max(first.x + 1, pixel(right, picture.width)),
                      std::max(first.y + 1, pixel(bottom, picture.height)));
  return cv::Rect(first, end);
}

/// The text of a label as far as OpenCV's stroke fonts have characters for it.
std::string DrawableLabel(const std::string& label) {
  std::string text = label.substr(0, kMostLabelBytes);
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

/// The plate on which a text stands, and how large its letters are.
struct LabelPlate {
  std::string text;
  double font = kMarkFont;
  cv::Size letters;
  int baseline = 0;

  cv::Size size() const {
    return {letters.width + 2 * kLabelMarginPx, letters.height + baseline + 2 * kLabelMarginPx};
  }
};

LabelPlate MeasureLabel(const std::string& text, double font) {
  LabelPlate plate{text, font, {}, 0};
  plate.letters = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, font, 1, &plate.baseline);
  return plate;
}

/// The largest plate that fits the picture's width; smaller letters come before fewer of them.
LabelPlate FitLabel(std::string text, int width) {
  const auto fits = [width](const LabelPlate& plate) { return plate.size().width <= width; };
  LabelPlate plate = MeasureLabel(text, kMarkFont);
  if (fits(plate)) return plate;
  plate = MeasureLabel(text, kLeastMarkFont);
  while (!fits(plate) && !text.empty()) {
    text.pop_back();
    plate = MeasureLabel(text + "..", kLeastMarkFont);
  }
  return plate;
}

void DrawMarkLabel(cv::Mat& picture, const cv::Rect& box, const std::string& label) {
  constexpr int kLinePx = 2;
  const LabelPlate plate = FitLabel(DrawableLabel(label), picture.cols);
  const cv::Size size = plate.size();
  if (size.width > picture.cols || size.height > picture.rows) return;
  int top = box.y - kLinePx - size.height;
  if (top < 0) top = box.br().y + kLinePx;
  // Neither above nor below: within, at the box's upper edge.
  if (top + size.height > picture.rows) top = box.y + kLinePx;
  top = std::clamp(top, 0, picture.rows - size.height);
  const int left = std::clamp(box.x - kLinePx, 0, picture.cols - size.width);
  cv::rectangle(picture, cv::Rect({left, top}, size), kSubjectColour, cv::FILLED);
  cv::putText(picture, plate.text,
              {left + kLabelMarginPx, top + kLabelMarginPx + plate.letters.height},
              cv::FONT_HERSHEY_SIMPLEX, plate.font, kHaloColour, 1, cv::LINE_AA);
}

void DrawOtherMarks(cv::Mat& picture, const PictureMarks& marks, const PixelRegion& shown,
                    double scale) {
  cv::Mat drawn;
  for (const Box& other : marks.others) {
    if (other == marks.subject) continue;
    const auto box = MarkInPicture(other, shown, scale, picture.size());
    if (!box) continue;
    if (drawn.empty()) drawn = picture.clone();
    cv::rectangle(drawn, *box, kOtherColour, 1);
  }
  if (drawn.empty()) return;
  cv::addWeighted(drawn, kOtherOpacity, picture, 1 - kOtherOpacity, 0, picture);
}

}  // namespace

std::string MarkLabel(const std::string& class_name, double confidence) {
  std::array<char, 16> number{};
  std::snprintf(number.data(), number.size(), " %.2f", std::clamp(confidence, 0.0, 1.0));
  return class_name.substr(0, kMostLabelBytes - 5) + number.data();
}

void DrawMarks(cv::Mat& picture, const PictureMarks& marks, const PixelRegion& shown,
               double scale) {
  DrawOtherMarks(picture, marks, shown, scale);
  const auto subject = MarkInPicture(marks.subject, shown, scale, picture.size());
  if (!subject) return;
  // The light line beneath keeps the red one apart from a dark or a red ground.
  cv::rectangle(picture, *subject, kHaloColour, 4, cv::LINE_4);
  cv::rectangle(picture, *subject, kSubjectColour, 2, cv::LINE_4);
  if (!marks.label.empty()) DrawMarkLabel(picture, *subject, marks.label);
}

}  // namespace livemap::imaging
