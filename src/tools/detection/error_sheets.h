#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "evaluation/detection/detection_errors.h"

namespace livemap::tools {

/// A drive of one class with the pictures that its frames were detected in.
struct PicturedDrive {
  const evaluation::ScoredDrive* drive = nullptr;
  const std::vector<std::string>* pictures = nullptr;  ///< Paths, one per frame.
};

/// Writes CLASS_missed.jpg and CLASS_false.jpg into `directory`, which is made where it is not
/// there: a crop per missed event and false report of the drives with labels (green), difficult
/// objects (grey), detections (red, weaker than `threshold` dark red) and a caption; and appends a
/// line for each to errors.csv there. Throws Error naming the path that cannot be read or written.
void WriteErrorSheets(const std::string& directory, const std::string& class_name,
                      const std::vector<PicturedDrive>& drives, double threshold);

}  // namespace livemap::tools
