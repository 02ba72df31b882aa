#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "simulation/datasets/tum_writer.h"
#include "simulation/datasets/yolo_writer.h"
#include "tools/simulation/simulation_bag.h"
#include "tools/simulation/simulation_setup.h"

namespace livemap::tools {

/// Throws Error when the flags ask for no output at all.
void RefuseNoOutput(const CommandLine& line);
/// Reads `flag`, a contact sheet that is written at the end: "" when it is not asked for. Throws
/// Error when its file cannot be written or is of no known kind.
std::string ReadSheetPath(const CommandLine& line, const std::string& flag);

/// Everything that a simulated drive writes; what was not asked for stays null.
class SimulationOutputs {
 public:
  /// Reads --preview, --truth-preview, --hazards, --tum, --yolo and --video; throws Error naming
  /// the path.
  SimulationOutputs(const CommandLine& line, const SimulationSetup& setup, double rate_hz,
                    std::size_t frames);

  /// Reads --bag and its flags; both must outlive the outputs.
  void OpenBag(const CommandLine& line, const simulation::Street& street,
               const simulation::VehicleMotion& motion);
  /// The frame `index`; `right` is the right camera's picture, or empty.
  void Add(std::size_t index, double time_s, double along_m,
           const simulation::SimulatedFrame& frame, const cv::Mat& right);
  /// Writes what is written once, --hazards too, and closes every file.
  void Finish(const simulation::Street& street, double end_s);

  /// Hazards that were in view so far.
  std::size_t hazards() const { return frames_seen_.size(); }

 private:
  /// What the depth sensor of --depth sees.
  cv::Mat Sense(std::size_t index, const simulation::SimulatedFrame& frame) const;
  void AddToSheets(const simulation::SimulatedFrame& frame,
                   const std::vector<simulation::HazardInView>& hazards);

  SimulationSetup setup_;
  bool bag_depth_ = false;
  cv::VideoWriter video_;
  std::unique_ptr<SimulationBag> bag_;
  std::string preview_path_;
  std::string truth_path_;
  std::string hazards_path_;
  std::size_t frames_;
  std::size_t preview_moments_ = 0;
  std::unique_ptr<simulation::TumWriter> tum_;
  std::unique_ptr<simulation::YoloWriter> yolo_;
  std::vector<cv::Mat> preview_;
  std::vector<cv::Mat> truth_;
  std::map<std::uint32_t, int> frames_seen_;
  double along_m_ = 0;
};

}  // namespace livemap::tools
