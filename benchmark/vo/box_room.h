#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geo/camera_intrinsics.h"

namespace livemap::bench {

/// What covers one wall, floor, ceiling or box of a BoxRoom.
struct BoxRoomSurface {
  enum class Pattern {
    kChecks,   ///< Squares of two shades in turn, each a little different.
    kStripes,  ///< Of two shades in turn.
    kBricks,   ///< In courses, each moved by half a brick; all but alike.
    kPatches,  ///< Squares of any shade.
    kNoise,    ///< Smooth random shades.
    kFaint,    ///< The same with a tenth of the contrast: all but bare.
  };
  Pattern pattern = Pattern::kNoise;
  double period_m = 0.3;   ///< Of what repeats, or the size of what does not.
  double angle_rad = 0;    ///< By which the pattern is turned on its surface.
  double mean_grey = 128;  ///< Before light.
  double contrast = 60;    ///< Grey levels to either side of the mean.
  std::uint64_t seed = 1;  ///< Of what is random in it.
};

/// A room of plain boxes that says whether odometry holds on pictures of another kind than the
/// simulator's: it shares no code with that. One ray per pixel, so that slanted edges have steps;
/// exact depth; one lamp; noise of one grey level. Half of the surfaces repeat, some hardly
/// show anything. World frame: z up, origin in the middle of the floor, m.
class BoxRoom {
 public:
  struct View {
    cv::Mat grey;     ///< CV_8UC1.
    cv::Mat depth_m;  ///< CV_32FC1, along the optical axis.
  };

  /// Everything is drawn from the seed.
  explicit BoxRoom(std::uint64_t seed);

  /// What a camera (optical frame) sees; `frame` draws the noise.
  View Render(const geo::CameraIntrinsics& camera, const Eigen::Isometry3d& world_from_camera,
              std::uint64_t frame) const;

  /// From a place in the room to the nearest wall or box, m; negative inside of one.
  double Clearance(const Eigen::Vector3d& place) const;

  const Eigen::Vector3d& low() const { return room_.low; }
  const Eigen::Vector3d& high() const { return room_.high; }

 private:
  /// A box turned about the vertical axis; its faces by axis, low side and high side.
  struct Box {
    Eigen::Isometry3d box_from_world = Eigen::Isometry3d::Identity();
    Eigen::Vector3d low, high;
    std::array<std::array<BoxRoomSurface, 2>, 3> faces;
  };
  /// Where a ray meets a surface.
  struct Hit;

  static void MeetFromInside(const Box& box, const Eigen::Vector3d& origin,
                             const Eigen::Vector3d& ray, Hit& nearest);
  static void MeetFromOutside(const Box& box, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& ray, Hit& nearest);
  double Light(const Eigen::Vector3d& place) const;

  Box room_;
  std::vector<Box> boxes_;
  Eigen::Vector3d lamp_;
};

}  // namespace livemap::bench
