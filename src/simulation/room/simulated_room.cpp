#include "simulation/room/simulated_room.h"

#include <cmath>
#include <limits>

#include "simulation/objects/counter_random.h"
#include "simulation/render/surface.h"

namespace livemap::simulation {
namespace {

constexpr float kHalfLength = 2.5F, kHalfWidth = 2.0F, kHeight = 2.6F;
const Vec3 kLamp(0.4F, -0.3F, 2.4F);

Material RoomMaterial(MaterialKind kind, const Vec3& colour, std::uint32_t seed) {
  Material material;
  material.kind = kind;
  material.colour = colour;
  material.seed = seed;
  return material;
}

/// Walls and floor are not of one stuff: which one a face of the room shows.
Material RoomFace(int axis, float sign, std::uint32_t seed) {
  if (axis == 2) {
    return sign > 0 ? RoomMaterial(MaterialKind::kWood, Vec3(0.36F, 0.22F, 0.12F), seed)
                    : RoomMaterial(MaterialKind::kPlaster, Vec3(0.75F, 0.74F, 0.70F), seed + 1);
  }
  if (axis == 0) return RoomMaterial(MaterialKind::kBrick, Vec3(0.45F, 0.22F, 0.15F), seed + 2);
  return RoomMaterial(MaterialKind::kPlaster, Vec3(0.55F, 0.58F, 0.50F), seed + 3);
}

/// Floor boards: the wood's grain alone has no edges.
float RoomBoards(const Vec2& uv, float footprint) {
  const float seams = std::max(FilteredStripes(0.006F, 0.12F, uv.x(), footprint),
                               FilteredStripes(0.006F, 1.3F, uv.y(), footprint));
  return 1 - 0.6F * seams;
}

}  // namespace

SimulatedRoom::SimulatedRoom(std::uint64_t seed)
    : seed_(seed), lighting_(MakeLighting(Condition::kDay, seed)) {
  boxes_.push_back(
      {Vec3(-kHalfLength, -kHalfWidth, 0), Vec3(kHalfLength, kHalfWidth, kHeight), {}, true});
  Furnish(seed);
}

void SimulatedRoom::Furnish(std::uint64_t seed) {
  CounterRandom random(seed, 31, 0);
  const auto real = [&random](double low, double high) {
    return static_cast<float>(random.Uniform(low, high));
  };
  const auto colour = [&real] { return Vec3(real(0.05, 0.7), real(0.05, 0.7), real(0.05, 0.7)); };
  const auto add = [this, &random](const Vec3& low, const Vec3& high, MaterialKind kind,
                                   const Vec3& paint) {
    boxes_.push_back(
        {low, high, RoomMaterial(kind, paint, static_cast<std::uint32_t>(random.Bits())), false});
  };
  // Pictures on the wall that the camera looks at, and on the side walls.
  for (int i = 0; i < 7; ++i) {
    const float y = -1.7F + 0.5F * static_cast<float>(i), z = real(1.2, 1.9);
    add(Vec3(2.44F, y, z), Vec3(2.5F, y + real(0.2, 0.4), z + real(0.2, 0.5)),
        i % 2 == 0 ? MaterialKind::kBrick : MaterialKind::kStripes, colour());
  }
  // A shelf with books.
  for (int board = 0; board < 4; ++board) {
    const float z = 0.3F + 0.32F * static_cast<float>(board);
    add(Vec3(2.05F, -1.9F, z - 0.02F), Vec3(2.4F, 0.2F, z), MaterialKind::kWood,
        Vec3(0.3F, 0.2F, 0.12F));
    for (float y = -1.85F; y < 0.1F;) {
      const float width = real(0.02, 0.07);
      add(Vec3(2.1F, y, z), Vec3(2.1F + real(0.12, 0.25), y + width, z + real(0.16, 0.27)),
          MaterialKind::kPlain, colour());
      y += width + (random.Chance(0.15) ? 0.1F : 0.003F);
    }
  }
  // A table with things on it, and boxes on the floor.
  add(Vec3(0.9F, 0.4F, 0.70F), Vec3(1.7F, 1.7F, 0.74F), MaterialKind::kWood,
      Vec3(0.5F, 0.36F, 0.2F));
  for (const float x : {0.95F, 1.6F}) {
    for (const float y : {0.45F, 1.6F}) {
      add(Vec3(x, y, 0), Vec3(x + 0.05F, y + 0.05F, 0.7F), MaterialKind::kWood,
          Vec3(0.4F, 0.28F, 0.16F));
    }
  }
  for (int i = 0; i < 14; ++i) {
    const float x = real(0.95, 1.55), y = real(0.45, 1.55);
    add(Vec3(x, y, 0.74F),
        Vec3(x + real(0.04, 0.15), y + real(0.04, 0.15), 0.74F + real(0.03, 0.3)),
        i % 3 == 0 ? MaterialKind::kStripes : MaterialKind::kPlain, colour());
  }
  for (int i = 0; i < 8; ++i) {
    const float x = real(0.2, 1.9), y = real(-1.6, 1.2);
    add(Vec3(x, y, 0), Vec3(x + real(0.15, 0.4), y + real(0.15, 0.4), real(0.1, 0.45)),
        i % 2 == 0 ? MaterialKind::kBrick : MaterialKind::kWood, colour());
  }
}

Eigen::Isometry3d SimulatedRoom::WorldFromOptical(double time_s, double vigour) const {
  const double t = time_s * vigour;
  const double phase = CounterRandom(seed_, 32, 0).Uniform(0.0, 2 * M_PI);
  const Eigen::Vector3d place(-1.2 + 0.12 * std::sin(0.9 * t + phase),
                              0.15 * std::sin(1.1 * t + 2 * phase),
                              1.35 + 0.07 * std::sin(1.3 * t + 3 * phase));
  const double yaw = 0.09 * std::sin(0.8 * t + phase), pitch = 0.15 + 0.06 * std::sin(1.2 * t),
               roll = 0.04 * std::sin(1.5 * t + phase);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = place;
  pose.linear() = (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  // REP 103: the optical frame's x is right, y down, z forward.
  Eigen::Matrix3d optical;
  optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  pose.linear() = pose.linear() * optical;
  return pose;
}

SimulatedRoom::Hit SimulatedRoom::Cast(const Vec3& from, const Vec3& direction) const {
  const Vec3 inverse = direction.cwiseInverse();
  Hit nearest;
  nearest.distance = std::numeric_limits<float>::infinity();
  for (const Box& box : boxes_) {
    const Vec3 to_low = (box.low - from).cwiseProduct(inverse);
    const Vec3 to_high = (box.high - from).cwiseProduct(inverse);
    const Vec3 enter = to_low.cwiseMin(to_high), leave = to_low.cwiseMax(to_high);
    int enter_axis = 0, leave_axis = 0;
    const float first = enter.maxCoeff(&enter_axis), last = leave.minCoeff(&leave_axis);
    const int axis = box.hollow ? leave_axis : enter_axis;
    const float distance = box.hollow ? last : first;
    if (last < first || distance <= 1e-4F || distance >= nearest.distance) continue;
    nearest = {distance, &box, axis, direction[axis] > 0 ? -1.0F : 1.0F};
  }
  return nearest;
}

Vec3 SimulatedRoom::Shade(const Vec3& from, const Vec3& direction, const Hit& hit,
                          float pixel_angle) const {
  SurfacePoint point;
  point.position = from + hit.distance * direction;
  point.view = direction.normalized();
  point.normal = Vec3::Zero();
  point.normal[hit.axis] = hit.sign;
  const Vec3 local = hit.box->hollow ? point.position : Vec3(point.position - hit.box->low);
  point.uv = hit.axis == 0   ? Vec2(local.y(), local.z())
             : hit.axis == 1 ? Vec2(local.x(), local.z())
                             : Vec2(local.x(), local.y());
  if (hit.box->hollow) point.uv += Vec2(10, 10);
  point.width_m = pixel_angle * hit.distance * direction.norm();
  point.stretch = 1 / std::max(0.05F, std::abs(point.view[hit.axis]));
  const Material material = hit.box->hollow
                                ? RoomFace(hit.axis, hit.sign, static_cast<std::uint32_t>(seed_))
                                : hit.box->material;
  const bool wall =
      material.kind == MaterialKind::kBrick || material.kind == MaterialKind::kPlaster;
  Vec3 colour = wall ? PaintHouse(material, point, lighting_).colour
                     : PaintObject(material, point, lighting_).colour;
  if (material.kind == MaterialKind::kWood && hit.box->hollow) {
    colour *= RoomBoards(point.uv, point.width_m);
  }
  const Vec3 to_lamp = kLamp - point.position;
  const float facing = std::max(0.0F, to_lamp.normalized().dot(point.normal));
  return colour * (0.35F + 1.6F * facing / (0.6F + to_lamp.squaredNorm()));
}

SimulatedFrame SimulatedRoom::Render(const SimulatedCamera& camera,
                                     const Eigen::Isometry3d& world_from_optical,
                                     std::uint32_t frame_number, float gain, int rays,
                                     int threads) const {
  const int width = camera.intrinsics.width, height = camera.intrinsics.height;
  const Eigen::Matrix3f rotation = world_from_optical.linear().cast<float>();
  const Vec3 from = world_from_optical.translation().cast<float>();
  const auto pixel_angle = static_cast<float>(1 / (camera.intrinsics.fx * rays));
  SimulatedFrame frame;
  frame.world_from_optical = world_from_optical;
  frame.depth.create(height, width, CV_32FC1);
  frame.classes = cv::Mat::zeros(height, width, CV_8UC1);
  frame.instances = cv::Mat::zeros(height, width, CV_32SC1);
  frame.bgr.create(height, width, CV_8UC3);
  cv::Mat light(height, width, CV_32FC3);
  const auto ray = [&](double column, double row) {
    return Vec3(rotation * camera.Ray(column, row).cast<float>());
  };
  const auto noise_seed = static_cast<std::uint32_t>(CounterRandom(seed_, 33, frame_number).Bits());
  ForEachRow(height, threads, [&](int row) {
    for (int column = 0; column < width; ++column) {
      frame.depth.ptr<float>(row)[column] = Cast(from, ray(column, row)).distance;
      Vec3 sum = Vec3::Zero();
      for (int i = 0; i < rays * rays; ++i) {
        const int across = i % rays, down = i / rays;
        const Vec3 direction =
            ray(column + (across + 0.5) / rays - 0.5, row + (down + 0.5) / rays - 0.5);
        sum += Shade(from, direction, Cast(from, direction), pixel_angle);
      }
      sum /= static_cast<float>(rays * rays);
      light.ptr<cv::Vec3f>(row)[column] = cv::Vec3f(sum.x(), sum.y(), sum.z());
    }
    DevelopRow(camera, light, row, gain, noise_seed, frame.bgr);
  });
  return frame;
}

}  // namespace livemap::simulation
