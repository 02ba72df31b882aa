#include "evaluation/detection/detection_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "common/error.h"
#include "common/picture_folder.h"
#include "common/text_file.h"
#include "datasets/text_parsing.h"

namespace livemap::evaluation {
namespace {

constexpr char kDetectionHeader[] = "image,class,score,x_min,y_min,x_max,y_max";
/// No picture is larger; what is beyond it would lose its fractions as a float.
constexpr double kMaxBoxPx = 1e5;
constexpr std::size_t kMaxNameBytes = 128;

bool IsNameInTable(const std::string& name) {
  return !name.empty() && name.size() <= kMaxNameBytes && name.find('/') == std::string::npos &&
         name.find('\0') == std::string::npos;
}

/// The values of a line, without the blanks around them.
std::vector<std::string> SplitDetectionLine(const std::string& line) {
  std::vector<std::string> parts = datasets::Split(line, ',');
  for (std::string& part : parts) {
    const std::size_t first = part.find_first_not_of(" \t");
    part = first == std::string::npos
               ? ""
               : part.substr(first, part.find_last_not_of(" \t") + 1 - first);
  }
  return parts;
}

/// A name may have dots: only a picture's extension is none of it.
std::string PictureNameInTable(const std::string& text) {
  return HasPictureExtension(text) ? StemOf(text) : text;
}

std::string JoinTableClasses(const std::vector<std::string>& classes) {
  std::string list;
  for (const std::string& name : classes) list += (list.empty() ? "" : ", ") + name;
  return list;
}

/// None where the line has another form.
std::optional<perception::HazardDetection> ParseDetectionLine(
    const std::vector<std::string>& parts) {
  if (parts.size() != 7 || !IsNameInTable(parts[0]) || !IsNameInTable(parts[1])) {
    return std::nullopt;
  }
  std::array<double, 5> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::optional<double> number = datasets::ParseFinite(parts[i + 2]);
    if (!number || std::abs(*number) > kMaxBoxPx) return std::nullopt;
    numbers[i] = *number;
  }
  const auto [score, x_min, y_min, x_max, y_max] = numbers;
  perception::HazardDetection found;
  found.class_name = parts[1];
  found.confidence = static_cast<float>(score);
  found.box = cv::Rect2f(cv::Point2f(static_cast<float>(x_min), static_cast<float>(y_min)),
                         cv::Point2f(static_cast<float>(x_max), static_cast<float>(y_max)));
  const bool is_box = x_min < x_max && y_min < y_max && !found.box.empty();
  return score >= 0 && score <= 1 && is_box ? std::optional(found) : std::nullopt;
}

}  // namespace

DetectionTable ParseDetectionTable(const std::string& text, const std::string& name,
                                   const std::vector<std::string>& classes) {
  const std::vector<std::string> lines = datasets::Lines(text);
  if (lines.empty() || lines[0] != kDetectionHeader) {
    throw Error("line 1 of '" + name + "' is '" + (lines.empty() ? "" : lines[0].substr(0, 80)) +
                "', it must be '" + kDetectionHeader + "'");
  }
  DetectionTable table;
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const std::vector<std::string> parts = SplitDetectionLine(lines[i]);
    const std::optional<perception::HazardDetection> found = ParseDetectionLine(parts);
    if (!found) {
      throw Error("line " + std::to_string(i + 1) + " of '" + name + "' is '" +
                  lines[i].substr(0, 120) + "', accepted is '" + kDetectionHeader +
                  "' with a picture's name, a score from 0 to 1 and a box in px that is not empty");
    }
    if (!classes.empty() && std::count(classes.begin(), classes.end(), found->class_name) == 0) {
      throw Error("line " + std::to_string(i + 1) + " of '" + name + "' has the class '" +
                  found->class_name + "', accepted are " + JoinTableClasses(classes));
    }
    table[PictureNameInTable(parts[0])].push_back(*found);
  }
  return table;
}

DetectionTable ReadDetectionTable(const std::string& path,
                                  const std::vector<std::string>& classes) {
  return ParseDetectionTable(ReadTextFile(path, datasets::kMaxTableBytes), path, classes);
}

}  // namespace livemap::evaluation
