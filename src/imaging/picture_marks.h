#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "imaging/box.h"

namespace livemap::imaging {

/// What is drawn into the picture of one hazard, in pixels of the image that the picture shows a
/// part of. A box without area, or with an edge that is not a number, is not drawn.
struct PictureMarks {
  Box subject;              ///< What the picture is about: the one loud box.
  std::string label;        ///< Beside it, for example "pothole 0.83"; empty: none.
  std::vector<Box> others;  ///< What else was found: thin, faint and without label.
};

/// "pothole 0.83".
std::string MarkLabel(const std::string& class_name, double confidence);

/// Draws the marks into `picture` (8 bit, 3 channels, blue first), which shows the part `shown` of
/// the image with `scale` pixels for each of its own. Lines and text have the picture's own pixels,
/// whatever its scale. An edge of the subject beyond the picture is drawn at the picture's edge.
/// The label is never cut: it lies above the box, else below it, else within it, and is made
/// smaller, then shortened, where the picture is too narrow. Characters that are not ASCII are
/// drawn as '?'.
void DrawMarks(cv::Mat& picture, const PictureMarks& marks, const PixelRegion& shown, double scale);

}  // namespace livemap::imaging
