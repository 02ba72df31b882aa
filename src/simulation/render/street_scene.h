#pragma once

#include <embree3/rtcore.h>

#include <map>
#include <memory>
#include <vector>

#include "simulation/world/street.h"

namespace livemap::simulation {

/// What a ray met.
struct SceneHit {
  bool found = false;
  float distance = 0;  ///< In lengths of the ray's direction.
  std::uint32_t block = 0;
  std::uint32_t triangle = 0;
  float u = 0;
  float v = 0;
};

/// The part of a street that is seen from one place, ready for ray casting. Positions are relative
/// to origin(). MoveTo() needs to be alone; rays may be cast by many threads.
class StreetScene {
 public:
  /// `street` must outlive the scene. Without `lit` the scene is built quicker and knows nothing of
  /// the sky over the ground: enough for what rays meet.
  explicit StreetScene(const Street& street, bool lit = true);
  ~StreetScene();
  StreetScene(const StreetScene&) = delete;
  StreetScene& operator=(const StreetScene&) = delete;

  /// Builds what a viewer at `along_m` may see and forgets what lies far behind.
  void MoveTo(double along_m);
  const Eigen::Vector3d& origin() const { return origin_; }

  SceneHit Cast(const Vec3& from, const Vec3& direction, float nearest, float farthest) const;
  /// The same for eight rays from one point; much quicker when they are neighbours.
  void CastEight(const Vec3& from, const Vec3* directions, int count, SceneHit* hits) const;
  /// Which of up to eight parallel rays meet anything; bit i of the result is ray i's.
  unsigned BlockedOfEight(const Vec3* from, unsigned wanted, const Vec3& direction,
                          float farthest) const;

  struct Block {
    StreetBlock street;
    Vec3 offset = Vec3::Zero();    ///< From origin() to the block's own origin.
    Vec2 heading = Vec2::UnitX();  ///< Of the road at the block's middle, unit.
    std::vector<float> sky;        ///< Share of the sky that the ground sees; rows along the road.
    RTCScene scene = nullptr;
  };
  const Block& block(std::uint32_t index) const { return *visible_[index]; }
  const std::vector<std::shared_ptr<Block>>& visible() const { return visible_; }
  /// Share of the sky over a place on the ground, `local` metres from the block's beginning.
  static float SkyOverGround(const Block& block, float local_along, float left);

 private:
  std::shared_ptr<Block> Load(int index);
  void MeasureSky(int index);
  RTCScene Assemble(int first, int last, const Eigen::Vector3d& origin);

  const Street& street_;
  const bool lit_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  int first_ = 1;
  int last_ = 0;
  std::map<int, std::shared_ptr<Block>> loaded_;
  std::vector<std::shared_ptr<Block>> visible_;
};

}  // namespace livemap::simulation
