#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "simulation/render/street_renderer.h"

namespace livemap::simulation {

/// A furnished room of 5 x 4 x 2.6 m and a camera that somebody holds in it: the test bed of visual
/// odometry at indoor scale, with exact truth. World frame: z up, origin in the middle of the
/// floor, metres. The same seed gives the same bytes.
class SimulatedRoom {
 public:
  explicit SimulatedRoom(std::uint64_t seed);

  /// Where the camera (optical frame) is at a time: it sways by decimetres and turns by some
  /// degrees about one place; `vigour` scales speed, 1 is a calm hand (about 0.15 m/s and 8 deg/s).
  Eigen::Isometry3d WorldFromOptical(double time_s, double vigour) const;

  /// Takes a picture; every pixel is the mean of `rays` x `rays` rays. `gain` is the exposure: grey
  /// values in linear light are multiplied by it.
  SimulatedFrame Render(const SimulatedCamera& camera, const Eigen::Isometry3d& world_from_optical,
                        std::uint32_t frame_number, float gain, int rays, int threads) const;

 private:
  struct Box {
    Vec3 low, high;
    Material material;
    bool hollow = false;  ///< Seen from inside: the room itself.
  };
  struct Hit {
    float distance = 0;  ///< In lengths of the ray's direction.
    const Box* box = nullptr;
    int axis = 0;    ///< Of the face's normal.
    float sign = 1;  ///< The normal's, towards the viewer.
  };

  void Furnish(std::uint64_t seed);
  Hit Cast(const Vec3& from, const Vec3& direction) const;
  Vec3 Shade(const Vec3& from, const Vec3& direction, const Hit& hit, float pixel_angle) const;

  std::uint64_t seed_;
  Lighting lighting_;
  std::vector<Box> boxes_;
};

}  // namespace livemap::simulation
