#pragma once

#include <string>
#include <vector>

namespace livemap::datasets {

/// A labelled box of an image as YOLO writes it: centre and size in fractions of the image.
struct LabelledBox {
  int class_index = 0;
  double centre_x = 0;
  double centre_y = 0;
  double width = 0;
  double height = 0;
};

/// Parses a YOLO label file: "class x y width height" per line. `name` is for messages. Throws
/// Error naming the line when it is malformed, a number lies outside 0..1 or the box is empty.
std::vector<LabelledBox> ParseYoloLabels(const std::string& text, const std::string& name);

}  // namespace livemap::datasets
