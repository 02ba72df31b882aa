#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "simulation/render/simulated_camera.h"
#include "simulation/render/street_renderer.h"
#include "simulation/render/street_scene.h"
#include "simulation/world/street.h"

namespace livemap::simulation {

/// Says what a camera's pixels show, without light and hence much quicker than StreetRenderer.
class InstanceCaster {
 public:
  /// `street` must outlive the caster.
  InstanceCaster(const Street& street, const SimulatedCamera& camera, int threads);

  /// CV_32SC1: the instance that the ray through each pixel's centre meets, as StreetRenderer's
  /// but for the ground, which is all road here, potholes included.
  cv::Mat Cast(const CameraExposure& motion);
  /// What only one pass shows within the range of sight of the last picture.
  const std::vector<StreetChange>& changes() const { return changes_; }

 private:
  const int threads_;
  StreetScene scene_;
  const cv::Size size_;
  std::vector<Vec3> rays_;  ///< Optical frame, z = 1, row by row.
  std::vector<StreetChange> changes_;
};

/// What changed, as a picture of the second pass shows it.
struct ChangeView {
  cv::Mat mask;       ///< CV_8UC1, ChangeClass.
  cv::Mat direction;  ///< CV_8UC1: where something changed, kAppearedPixel or kVanishedPixel.
  std::map<std::uint32_t, int> pixels;  ///< Of the mask, by the changed object that decided them.
};

/// Two instance images of one pose (CV_32SC1): a pixel is changed where they differ and one of its
/// two objects is in `changed`. The class is that of the object which appeared where it is in
/// sight, else of the vanished one that would be.
ChangeView CompareInstances(const cv::Mat& before, const cv::Mat& after,
                            const std::map<std::uint32_t, StreetChange>& changed);

/// The truth about what changed between two passes of a street: from a pose of the second pass it
/// looks into both passes' worlds, both in the second pass's season. Leaves, snow, shadows,
/// reflections and exposure are therefore no change, and neither are potholes. Bytes do not depend
/// on the number of threads.
class ChangeTruth {
 public:
  /// As Street's; `leaves` of the second pass, `changes` is StreetPass's share.
  ChangeTruth(const WorldDescription& description, std::uint64_t seed, double length_m, bool leaves,
              double changes, const SimulatedCamera& camera, int threads);

  /// A later pose of `motion` (motion blur) is left out of account.
  ChangeView Look(const CameraExposure& motion);
  /// All that changed ahead of the cameras so far, within the range of sight, seen or hidden.
  const std::map<std::uint32_t, StreetChange>& changes() const { return changes_; }

 private:
  Street before_;
  Street after_;
  InstanceCaster before_caster_;
  InstanceCaster after_caster_;
  std::map<std::uint32_t, StreetChange> changes_;
};

}  // namespace livemap::simulation
