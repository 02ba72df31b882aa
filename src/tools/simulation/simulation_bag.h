#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "datasets/camera_file.h"
#include "datasets/sensors/gnss_receiver_model.h"
#include "geo/wgs84.h"
#include "simulation/datasets/labels_in_view.h"
#include "simulation/motion/vehicle_motion.h"
#include "simulation/render/street_renderer.h"

namespace livemap::tools {

/// What a person may decide about a simulated drive's bag.
struct SimulationBagConfig {
  datasets::GnssReceiverNoise noise;
  double fix_rate_hz = 10;
  double multipath_m = 2;  ///< See GnssMultipath; 0: none.
  bool depth = false;      ///< Depth images too.
  int jpeg_quality = 88;   ///< 1 to 100.
};

/// Writes a simulated drive as a bag with the topics of a real vehicle and the truth beside them
/// (docs/reference/simulator.md lists them). This header knows no ROS, so that the simulation
/// builds without. The same calls give the same bytes.
class SimulationBag {
 public:
  struct Setup {
    SimulationBagConfig options;
    datasets::CameraFile camera;
    double baseline_m = 0;  ///< Of the right camera to the right; 0: none.
    geo::GeoPoint datum;    ///< Of the world's origin.
    /// Of the vehicle in the world; also a second before and after.
    std::function<simulation::VehicleKinematics(double time_s)> state;
    /// Error of a fix, east and north, metres; called once per fix in order of time.
    std::function<Eigen::Vector2d(double time_s)> multipath_m;
    std::uint64_t seed = 1;  ///< Of the sensors' errors.
  };

  virtual ~SimulationBag() = default;
  /// `depth` is what the depth sensor sees (CV_32FC1 metres, 0: nothing), `right` the right
  /// camera's picture; either is empty where the bag has none.
  virtual void Add(double time_s, const simulation::SimulatedFrame& frame, const cv::Mat& depth,
                   const cv::Mat& right, const std::vector<simulation::HazardInView>& hazards) = 0;
  /// `hazards` is the drive's truth as GeoJSON.
  virtual void Finish(double end_s, const std::string& hazards) = 0;
};

/// Throws Error when the file cannot be created or this build has no ROS.
std::unique_ptr<SimulationBag> OpenSimulationBag(const std::string& path,
                                                 const SimulationBag::Setup& setup);

}  // namespace livemap::tools
