#include "simulation/room/simulated_room.h"

#include <cmath>
#include <limits>
#include <utility>

#include "simulation/objects/counter_random.h"
#include "simulation/render/surface.h"

namespace livemap::simulation {
namespace {

/// Between two poses that are close to each other.
Eigen::Isometry3d RoomPoseBetween(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to,
                                  double share) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = from.translation() + share * (to.translation() - from.translation());
  pose.linear() = Eigen::Quaterniond(from.linear())
                      .slerp(share, Eigen::Quaterniond(to.linear()))
                      .toRotationMatrix();
  return pose;
}

}  // namespace

SimulatedRoom::SimulatedRoom(RoomPlan plan)
    : plan_(std::move(plan)),
      lighting_(MakeLighting(Condition::kDay, plan_.seed)),
      low_(-plan_.half_size.x(), -plan_.half_size.y(), 0),
      high_(plan_.half_size.x(), plan_.half_size.y(), 2 * plan_.half_size.z()) {}

SimulatedRoom::Hit SimulatedRoom::Cast(const Vec3& from, const Vec3& direction) const {
  const Vec3 inverse = direction.cwiseInverse();
  Hit nearest;
  // The room is seen from inside: where the ray leaves it.
  const Vec3 room_leave =
      (low_ - from).cwiseProduct(inverse).cwiseMax((high_ - from).cwiseProduct(inverse));
  nearest.distance = room_leave.minCoeff(&nearest.axis);
  for (const RoomBox& box : plan_.boxes) {
    const Vec3 to_low = (box.low - from).cwiseProduct(inverse);
    const Vec3 to_high = (box.high - from).cwiseProduct(inverse);
    const Vec3 enter = to_low.cwiseMin(to_high), leave = to_low.cwiseMax(to_high);
    int axis = 0;
    const float distance = enter.maxCoeff(&axis), last = leave.minCoeff();
    if (last < distance || distance <= 1e-4F || distance >= nearest.distance) continue;
    nearest.distance = distance;
    nearest.box = &box;
    nearest.axis = axis;
  }
  nearest.sign = direction[nearest.axis] > 0 ? -1.0F : 1.0F;
  return nearest;
}

Vec3 SimulatedRoom::Shade(const Vec3& from, const Vec3& direction, const Hit& hit,
                          float pixel_angle) const {
  const bool wall = hit.box == nullptr;
  SurfacePoint point;
  point.position = from + hit.distance * direction;
  point.view = direction.normalized();
  point.normal = Vec3::Zero();
  point.normal[hit.axis] = hit.sign;
  const Vec3 local = wall ? point.position : Vec3(point.position - hit.box->low);
  point.uv = hit.axis == 0   ? Vec2(local.y(), local.z())
             : hit.axis == 1 ? Vec2(local.x(), local.z())
                             : Vec2(local.x(), local.y());
  if (wall) point.uv += Vec2(10, 10);
  point.width_m = pixel_angle * hit.distance * direction.norm();
  point.stretch = 1 / std::max(0.05F, std::abs(point.view[hit.axis]));
  // The face at the low side looks up the axis.
  const RoomFinish& finish =
      wall ? plan_.faces[static_cast<std::size_t>(hit.axis)][hit.sign > 0 ? 0 : 1]
           : hit.box->finish;
  const Material& material = finish.material;
  const bool stone =
      material.kind == MaterialKind::kBrick || material.kind == MaterialKind::kPlaster;
  Vec3 colour = stone ? PaintHouse(material, point, lighting_).colour
                      : PaintObject(material, point, lighting_).colour;
  if (finish.pattern != RoomPattern::kNone) {
    colour *= PaintRoomPattern(finish, point.uv, point.width_m);
  }
  const Vec3 to_lamp = plan_.lamp - point.position;
  const float facing = std::max(0.0F, to_lamp.normalized().dot(point.normal));
  return colour * (0.35F + 1.6F * plan_.lamp_power * facing /
                               (0.6F * plan_.lamp_power + to_lamp.squaredNorm()));
}

SimulatedFrame SimulatedRoom::Render(const SimulatedCamera& camera,
                                     const Eigen::Isometry3d& world_from_optical,
                                     std::uint32_t frame_number, float gain, int rays, int threads,
                                     const std::optional<Eigen::Isometry3d>& last_row) const {
  const int width = camera.intrinsics.width, height = camera.intrinsics.height;
  const auto pixel_angle = static_cast<float>(1 / (camera.intrinsics.fx * rays));
  SimulatedFrame frame;
  frame.world_from_optical = world_from_optical;
  frame.depth.create(height, width, CV_32FC1);
  frame.classes = cv::Mat::zeros(height, width, CV_8UC1);
  frame.instances = cv::Mat::zeros(height, width, CV_32SC1);
  frame.bgr.create(height, width, CV_8UC3);
  cv::Mat light(height, width, CV_32FC3);
  const auto noise_seed =
      static_cast<std::uint32_t>(CounterRandom(plan_.seed, 33, frame_number).Bits());
  ForEachRow(height, threads, [&](int row) {
    const Eigen::Isometry3d pose =
        last_row ? RoomPoseBetween(world_from_optical, *last_row, row / double(height - 1))
                 : world_from_optical;
    const Eigen::Matrix3f rotation = pose.linear().cast<float>();
    const Vec3 from = pose.translation().cast<float>();
    const auto ray = [&](double column, double line) {
      return Vec3(rotation * camera.Ray(column, line).cast<float>());
    };
    for (int column = 0; column < width; ++column) {
      const Vec3 middle = ray(column, row);
      const Hit hit = Cast(from, middle);
      frame.depth.ptr<float>(row)[column] = hit.distance;
      Vec3 sum = Vec3::Zero();
      if (rays == 1) {
        sum = Shade(from, middle, hit, pixel_angle);
      } else {
        for (int i = 0; i < rays * rays; ++i) {
          const int across = i % rays, down = i / rays;
          const Vec3 direction =
              ray(column + (across + 0.5) / rays - 0.5, row + (down + 0.5) / rays - 0.5);
          sum += Shade(from, direction, Cast(from, direction), pixel_angle);
        }
        sum /= static_cast<float>(rays * rays);
      }
      light.ptr<cv::Vec3f>(row)[column] = cv::Vec3f(sum.x(), sum.y(), sum.z());
    }
    DevelopRow(camera, light, row, gain, noise_seed, frame.bgr);
  });
  return frame;
}

}  // namespace livemap::simulation
