#include "datasets/labels.h"

#include <cmath>

#include "common/error.h"
#include "datasets/text_parsing.h"

namespace livemap::datasets {
namespace {

constexpr std::size_t kMaxBoxes = 10000;
constexpr int kMaxClass = 1000;

bool IsFraction(const std::optional<double>& value) { return value && *value >= 0 && *value <= 1; }

}  // namespace

std::vector<LabelledBox> ParseYoloLabels(const std::string& text, const std::string& name) {
  std::vector<LabelledBox> boxes;
  const std::vector<std::string> lines = Lines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::vector<std::string> parts = SplitBlanks(lines[i]);
    if (parts.empty()) continue;
    const auto refuse = [&] {
      throw Error("line " + std::to_string(i + 1) + " of '" + name + "' is '" +
                  lines[i].substr(0, 80) +
                  "', accepted is 'class x y width height' with fractions of the image");
    };
    if (parts.size() != 5 || boxes.size() == kMaxBoxes) refuse();
    const std::optional<double> index = ParseFinite(parts[0]);
    const std::optional<double> x = ParseFinite(parts[1]);
    const std::optional<double> y = ParseFinite(parts[2]);
    const std::optional<double> width = ParseFinite(parts[3]);
    const std::optional<double> height = ParseFinite(parts[4]);
    if (!index || *index < 0 || *index > kMaxClass || *index != std::floor(*index)) refuse();
    if (!IsFraction(x) || !IsFraction(y) || !IsFraction(width) || !IsFraction(height)) refuse();
    if (*width == 0 || *height == 0) refuse();
    boxes.push_back({static_cast<int>(*index), *x, *y, *width, *height});
  }
  return boxes;
}

}  // namespace livemap::datasets
