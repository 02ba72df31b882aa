#include "ros/parameters/change_detection_parameters.h"

#include "change/methods/change_network.h"
#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

/// Of the classical methods, whose score is a distance and no probability.
constexpr double kClassicalThreshold = 0.3;
constexpr double kMegabyte = 1e6;

void ReadChangeMemory(ParameterReader& parameters, change::ChangeDetector::Config& watch) {
  change::PlaceMemory::Config& memory = watch.memory;
  parameters.Section("Memory of places");
  parameters.ReadRequired("directory", memory.directory, "~/places",
                          "Folder of the remembered places, made when missing: one vehicle, many "
                          "drives. vehicle.launch gives places in the vehicle's directory.");
  if (memory.directory.empty()) {
    throw Error("parameter 'directory' is empty, accepted is a folder for remembered places");
  }
  parameters.Read("remember_spacing_m", watch.remember_spacing_m, {0.1, 1000},
                  "Distance between two pictures that are remembered.", "m");
  parameters.Read("jpeg_quality", watch.jpeg_quality, {1, 100},
                  "JPEG quality of remembered pictures.");
  parameters.Read("features", watch.features.max_features, {50, 8192},
                  "Number of SIFT features of a picture, the strongest.");
  parameters.Read("cell_m", memory.cell_m, {2, 1000}, "Edge of the map's cells.", "m");
  parameters.Read("heading_sectors", memory.heading_sectors, {1, 64},
                  "Sectors of heading per cell.");
  double cell_mb = memory.max_cell_bytes / kMegabyte;
  double all_mb = memory.max_bytes / kMegabyte;
  double cached_mb = memory.max_cached_bytes / kMegabyte;
  parameters.Read("max_cell_mb", cell_mb, {0.01, 1000},
                  "Pictures per cell; beyond it the worst and oldest go.", "MB");
  parameters.Read("max_mb", all_mb, {1, 1e7}, "Pictures altogether; beyond it the oldest go.",
                  "MB");
  parameters.Read("max_cached_mb", cached_mb, {0, 1e5}, "Features kept in main memory.", "MB");
  memory.max_cell_bytes = cell_mb * kMegabyte;
  memory.max_bytes = all_mb * kMegabyte;
  memory.max_cached_bytes = cached_mb * kMegabyte;
  parameters.Read("half_life_days", memory.half_life_days, {0.01, 1e5},
                  "Time in which a picture loses half of its worth.", "days");
}

void ReadChangeReach(ParameterReader& parameters, change::ChangeDetector::Config& watch) {
  change::PlaceMemory::Config& memory = watch.memory;
  parameters.Section("Choice of the earlier picture");
  // On board fewer than the library's own default, for the time they take; and its 30 degrees.
  memory.reach.candidates = 5;
  memory.reach.max_heading_difference_rad = 0.524;
  parameters.Read("candidates", memory.reach.candidates, {1, 100},
                  "Number of nearest pictures of earlier drives whose features are matched. The "
                  "thesis's 15 take three times as long.");
  parameters.Read("max_distance_m", memory.reach.max_distance_m, {0.1, 100},
                  "Largest distance of these from the present picture, geodesic.", "m");
  parameters.Read("max_heading_difference_rad", memory.reach.max_heading_difference_rad,
                  {0.01, 3.15}, "Largest difference of their headings from the present one.",
                  "rad");
  parameters.Read("partners", watch.partners, {1, 100},
                  "Number of candidates that registration may try, those with the most matches.");
}

void ReadChangeObjects(ParameterReader& parameters, change::ChangeDetector::Config& watch) {
  parameters.Section("From pixels to objects on the road");
  parameters.Read("min_region_px", watch.regions.min_pixels, {1, 1e6},
                  "Smaller pieces are noise. Pixels of a picture 320 wide.", "px");
  change::ChangeTracker::Config& tracker = watch.tracker;
  parameters.Read("min_seen", tracker.min_seen, {2, 100},
                  "Number of pictures that must show an object.");
  parameters.Read("min_travel_m", tracker.min_travel_m, {0, 100},
                  "Distance that must be driven between the first and the last of them.", "m");
  parameters.Read("min_share", tracker.min_share, {0, 1},
                  "Least share of the pictures that look at an object in which it must be seen.");
  parameters.Read("max_range_m", tracker.max_range_m, {1, 200},
                  "Nothing further away than this is placed.", "m");
  ReadProjectionErrors(parameters, tracker.ground);
}

void RefuseFormerChangeNames(const ParameterReader& parameters) {
  for (const auto& [former, present] :
       {std::pair{"most_position_sigma_m", "max_position_sigma_m"},
        {"most_cell_mb", "max_cell_mb"},
        {"most_mb", "max_mb"},
        {"most_cached_mb", "max_cached_mb"},
        {"most_distance_m", "max_distance_m"},
        {"most_heading_difference_rad", "max_heading_difference_rad"},
        {"least_region_px", "min_region_px"},
        {"least_seen", "min_seen"},
        {"least_travel_m", "min_travel_m"},
        {"least_share", "min_share"},
        {"most_range_m", "max_range_m"}}) {
    parameters.Renamed(former, present);
  }
}

}  // namespace

ChangeDetectionConfig ReadChangeDetectionConfig(ParameterReader& parameters, std::int64_t now_ns) {
  ChangeDetectionConfig config;
  RefuseFormerChangeNames(parameters);
  parameters.Section("Method");
  parameters.ReadChoice(
      "method", config.method, {"network", "dense-sift", "daisy"},
      "network, or a classical method: dense-sift or daisy, which tell no classes.");
  parameters.ReadRequired("model", config.model, "models/NAME.yaml",
                          "Path of a manifest of kind change. Required with method network. "
                          "vehicle.launch gives its change_model, models/change-small.yaml.");
  if (config.method == "network" && config.model.empty()) {
    throw Error(
        "parameter 'model' is empty, accepted with method 'network' is the path of a model "
        "manifest of kind change");
  }
  parameters.Read("threshold", config.threshold, {-1, 1},
                  "Least probability of change of a pixel, 0 to 1. Below 0: the manifest's "
                  "thresholds.changed, or 0.3 of a classical method.");
  parameters.Read(
      "threads", config.threads, {0, 256},
      "Threads of OpenCV, whose pool is one for the whole process. 0: as others set it.");
  config.watch.drive_id = ReadDriveId(parameters, now_ns);
  ListImageTransport(parameters);
  parameters.Section(
      "Pictures that are looked at",
      "While a picture is compared, others are skipped and counted: the CPU sets the rate.");
  parameters.Read("spacing_m", config.spacing_m, {0, 1000},
                  "Road between two pictures that are looked at: a standing car looks once.", "m");
  parameters.Read("width_px", config.width_px, {64, 4096}, "Wider images are scaled down to this.",
                  "px");
  parameters.Read(
      "max_waiting_frames", config.max_waiting_frames, {1, 1000},
      "Number of images that wait for their position; beyond it the oldest is dropped.");
  parameters.Read("max_position_sigma_m", config.watch.max_position_sigma_m, {0.01, 100},
                  "A picture whose position is less certain than this is neither compared nor "
                  "remembered. Standard deviation per axis.",
                  "m");
  ReadChangeMemory(parameters, config.watch);
  ReadChangeReach(parameters, config.watch);
  parameters.Section("Registration of the earlier picture",
                     "By camera/depth/image_raw where that knows enough, else by all edges of both "
                     "pictures, else by features that match.");
  parameters.Read("use_depth", config.use_depth,
                  "Whether depth images, registered to the images, are used. vehicle.launch sets "
                  "it by the argument `use_depth`.");
  parameters.Read("depth_wait_s", config.depth_wait_s, {0, 60},
                  "Time that an image waits for its depth image; then it goes without.", "s");
  ReadDepthUnits(parameters, config.depth_units_per_m);
  ReadChangeObjects(parameters, config.watch);
  parameters.Section(
      "Reports to the zone",
      "The zone is told each object once, when the vehicle has passed it (change/map_change).");
  parameters.Read(
      "tell_zone", config.tell_zone,
      "Whether the zone is told. Classical methods tell no classes and take parallax for change.");
  parameters.Read("tell_confidence", config.tell_confidence, {0, 1},
                  "Least confidence of an object that the zone is told of.");
  ReadZoneParameters(parameters, config.zones);
  parameters.Section(
      "Position of the vehicle at the image's stamp",
      "The parameters are those of hazard_reporting. The camera's mounting comes from tf "
      "(base_frame to the frame_id of the images), its focal length from camera_rect/camera_info.");
  parameters.Read("base_frame", config.base_frame, "Frame at road level: x forward, y left, z up.");
  parameters.Read("map_frame", config.map_frame, "Frame of the fused poses.");
  ReadBasePoseSource(parameters, config.pose);
  parameters.Section("Period of the diagnostics");
  ReadStampLimit(parameters, config.pose.fixes.stamps.max_ahead_s);
  config.pose.poses.stamps = config.pose.fixes.stamps;
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown({"diagnostic_period"});
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
