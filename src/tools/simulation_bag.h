#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drives/camera_file.h"
#include "geo/wgs84.h"
#include "simulation/labels_in_view.h"
#include "simulation/renderer.h"

namespace livemap {

/// Writes a simulated drive as a bag with the topics of a real vehicle and the truth beside them,
/// as livemap_bag_generate does. This header knows no ROS, so that the simulation builds without.
class SimulationBag {
 public:
  struct Setup {
    CameraFile camera;
    std::function<GeoPoint(double time_s)>
        place;               ///< Of base_link; also a second before and after.
    std::uint64_t seed = 1;  ///< Of the receiver's errors.
    int jpeg_quality = 88;   ///< Of the pictures, 1 to 100.
  };

  virtual ~SimulationBag() = default;
  virtual void Add(double time_s, const SimulatedFrame& frame,
                   const std::vector<HazardInView>& hazards) = 0;
  virtual void Finish(double end_s) = 0;
};

/// Throws Error when the file cannot be created or this build has no ROS.
std::unique_ptr<SimulationBag> OpenSimulationBag(const std::string& path,
                                                 const SimulationBag::Setup& setup);

}  // namespace livemap
