#pragma once

#include <cstddef>
#include <fstream>
#include <string>
#include <vector>

#include "simulation/datasets/labels_in_view.h"
#include "simulation/render/street_renderer.h"

namespace livemap::simulation {

/// Writes a labelled drive: images/ (JPEG), labels/ (YOLO lines), difficult/ (the same of hazards
/// that are difficult), classes.txt and frames.csv.
class YoloWriter {
 public:
  explicit YoloWriter(const std::string& directory);
  void Add(double chainage_m, const SimulatedFrame& frame,
           const std::vector<HazardInView>& hazards);
  void Finish();

 private:
  std::string directory_;
  std::ofstream frames_;
  std::size_t count_ = 0;
};

}  // namespace livemap::simulation
