#pragma once

#include <map>
#include <string>
#include <vector>

#include "perception/detection/hazard_detection.h"

namespace livemap::evaluation {

/// Detections by the name of their picture, without folder and a picture's extension: "a.1" and
/// "a.1.jpg" are one name.
using DetectionTable = std::map<std::string, std::vector<perception::HazardDetection>>;

/// What some detector found, to be measured without running it: lines
/// "image,class,score,x_min,y_min,x_max,y_max" below that header, in any order, boxes in px of the
/// picture. A picture without a line has no detections; class_index stays 0, as no model is known.
/// `name` names the text in errors. Throws Error naming the line, its value and what is accepted,
/// for a line of another form, a name with a folder, a score outside [0, 1], an empty box, and a
/// class that is not among `classes`; where these are empty, every class is accepted. Blanks around
/// a value do not count.
DetectionTable ParseDetectionTable(const std::string& text, const std::string& name,
                                   const std::vector<std::string>& classes = {});

/// Typical usage, of a file:
///   DetectionTable table = ReadDetectionTable("reports.csv");
///   for (const HazardDetection& found : table["000120"]) ...
DetectionTable ReadDetectionTable(const std::string& path,
                                  const std::vector<std::string>& classes = {});

}  // namespace livemap::evaluation
