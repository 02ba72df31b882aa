#include "ros/parameters/change_parameters.h"

#include "change/methods/change_network.h"
#include "ros/parameters/vehicle_parameters.h"

namespace livemap::ros_io {
namespace {

/// Of the classical methods, whose score is a distance and no probability.
constexpr double kClassicalThreshold = 0.3;
constexpr double kMegabyte = 1e6;

void ReadMemory(ParameterReader& parameters, change::PlaceMemory::Config& memory) {
  parameters.Read("directory", memory.directory);
  if (memory.directory.empty()) {
    throw Error("parameter 'directory' is empty, accepted is a folder for remembered places");
  }
  parameters.Read("cell_m", memory.cell_m, {2, 1000});
  parameters.Read("heading_sectors", memory.heading_sectors, {1, 64});
  double cell_mb = memory.max_cell_bytes / kMegabyte;
  double all_mb = memory.max_bytes / kMegabyte;
  double cached_mb = memory.max_cached_bytes / kMegabyte;
  parameters.Read("most_cell_mb", cell_mb, {0.01, 1000});
  parameters.Read("most_mb", all_mb, {1, 1e7});
  parameters.Read("most_cached_mb", cached_mb, {0, 1e5});
  memory.max_cell_bytes = cell_mb * kMegabyte;
  memory.max_bytes = all_mb * kMegabyte;
  memory.max_cached_bytes = cached_mb * kMegabyte;
  parameters.Read("half_life_days", memory.half_life_days, {0.01, 1e5});
  int candidates = 5;
  parameters.Read("candidates", candidates, {1, 100});
  memory.reach.candidates = static_cast<std::size_t>(candidates);
  parameters.Read("most_distance_m", memory.reach.max_distance_m, {0.1, 100});
  parameters.Read("most_heading_difference_rad", memory.reach.max_heading_difference_rad,
                  {0.01, 3.15});
}

void ReadWatch(ParameterReader& parameters, change::ChangeDetector::Config& watch) {
  parameters.Read("remember_spacing_m", watch.remember_spacing_m, {0.1, 1000});
  parameters.Read("most_position_sigma_m", watch.max_position_sigma_m, {0.01, 100});
  int partners = static_cast<int>(watch.partners);
  parameters.Read("partners", partners, {1, 100});
  watch.partners = static_cast<std::size_t>(partners);
  parameters.Read("jpeg_quality", watch.jpeg_quality, {1, 100});
  parameters.Read("features", watch.features.max_features, {50, 8192});
  parameters.Read("least_region_px", watch.regions.min_pixels, {1, 1e6});
  change::ChangeTracker::Config& tracker = watch.tracker;
  parameters.Read("least_seen", tracker.min_seen, {2, 100});
  parameters.Read("least_travel_m", tracker.min_travel_m, {0, 100});
  parameters.Read("least_share", tracker.min_share, {0, 1});
  parameters.Read("most_range_m", tracker.max_range_m, {1, 200});
  parameters.Read("pixel_sigma_px", tracker.ground.pixel_sigma_px, {0, 100});
  parameters.Read("pitch_sigma_rad", tracker.ground.pitch_sigma_rad, {0, 0.5});
  parameters.Read("height_sigma_m", tracker.ground.height_sigma_m, {0, 2});
}

}  // namespace

ChangeDetectionConfig ReadChangeDetectionConfig(ParameterReader& parameters, std::int64_t now_ns) {
  ChangeDetectionConfig config;
  parameters.ReadChoice("method", config.method, {"network", "dense-sift", "daisy"});
  parameters.Read("model", config.model);
  if (config.method == "network" && config.model.empty()) {
    throw Error(
        "parameter 'model' is empty, accepted with method 'network' is the path of a model "
        "manifest of kind change");
  }
  parameters.Read("threshold", config.threshold, {-1, 1});
  parameters.Read("threads", config.threads, {0, 256});
  parameters.Read("spacing_m", config.spacing_m, {0, 1000});
  parameters.Read("width_px", config.width_px, {64, 4096});
  parameters.Read("max_waiting_frames", config.max_waiting_frames, {1, 1000});
  config.watch.drive_id = ReadDriveId(parameters, now_ns);
  ReadMemory(parameters, config.watch.memory);
  ReadWatch(parameters, config.watch);
  ReadBasePoseSource(parameters, config.pose);
  parameters.Read("use_depth", config.use_depth);
  parameters.Read("depth_wait_s", config.depth_wait_s, {0, 60});
  parameters.Read("depth_units_per_m", config.depth_units_per_m, {1, 1e6});
  parameters.Read("tell_zone", config.tell_zone);
  parameters.Read("tell_confidence", config.tell_confidence, {0, 1});
  parameters.Read("base_frame", config.base_frame);
  parameters.Read("map_frame", config.map_frame);
  parameters.Read("diagnostics_period_s", config.diagnostics_period_s, {0.05, 60});
  parameters.RejectUnknown({"image_transport", "diagnostic_period"});
  return config;
}

ConfiguredChangeMethod MakeConfiguredMethod(const ChangeDetectionConfig& config) {
  ConfiguredChangeMethod made;
  if (config.method == "network") {
    auto network = change::MakeChangeNetwork(config.model, config.threads);
    made.name = network->manifest().name;
    made.threshold = network->manifest().changed;
    made.method = std::move(network);
  } else {
    if (config.threads > 0) cv::setNumThreads(config.threads);
    made.method = change::MakeChangeMethod(config.method);
    made.name = config.method;
    made.threshold = kClassicalThreshold;
  }
  if (config.threshold >= 0) made.threshold = config.threshold;
  return made;
}

}  // namespace livemap::ros_io
