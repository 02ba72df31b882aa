#include "box_room.h"

#include <cmath>
#include <limits>
#include <opencv2/core/utility.hpp>
#include <random>

namespace livemap::bench {

struct BoxRoom::Hit {
  double distance = std::numeric_limits<double>::infinity();  // In lengths of the ray.
  const BoxRoomSurface* surface = nullptr;
  Eigen::Vector2d place;  // On the surface, m.
};

namespace {

using Pattern = BoxRoomSurface::Pattern;

constexpr double kNoiseGrey = 1;
constexpr double kLampReachM = 3;  // Half of the lamp's light is left there.
constexpr double kAmbient = 0.55;
constexpr double kFaintShare = 0.1;
constexpr double kMortarShare = 0.08;  // Of a brick's height, to either side.
constexpr double kAlike = 0.06;        // By how much of the contrast one tile differs from another.

/// -1 to 1, of a cell of a grid (SplitMix64's finaliser).
double RandomOf(std::uint64_t seed, std::int64_t column, std::int64_t row) {
  std::uint64_t bits = seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(column) +
                       0xc2b2ae3d27d4eb4fULL * static_cast<std::uint64_t>(row);
  bits = (bits ^ (bits >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  bits = (bits ^ (bits >> 27U)) * 0x94d049bb133111ebULL;
  return static_cast<double>((bits ^ (bits >> 31U)) >> 11U) * 0x1p-52 - 1;
}

std::int64_t Cell(double value) { return static_cast<std::int64_t>(std::floor(value)); }

double Smooth(double value) { return value * value * (3 - 2 * value); }

/// Random shades at the corners of a grid of one period, smooth between them.
double ValueNoise(std::uint64_t seed, double u, double v) {
  const std::int64_t column = Cell(u), row = Cell(v);
  const double across = Smooth(u - std::floor(u)), down = Smooth(v - std::floor(v));
  const auto at = [&](std::int64_t right, std::int64_t below) {
    return RandomOf(seed, column + right, row + below);
  };
  const double above = at(0, 0) + across * (at(1, 0) - at(0, 0));
  const double below = at(0, 1) + across * (at(1, 1) - at(0, 1));
  return above + down * (below - above);
}

/// Three octaves, each half as strong as the one before.
double Fractal(std::uint64_t seed, double u, double v) {
  return (ValueNoise(seed, u, v) + 0.5 * ValueNoise(seed + 1, 2 * u, 2 * v) +
          0.25 * ValueNoise(seed + 2, 4 * u, 4 * v)) /
         1.75;
}

double Bricks(const BoxRoomSurface& surface, double u, double v) {
  const double course = 2 * v;  // A brick is half as high as it is long.
  const std::int64_t row = Cell(course);
  const double along = u + 0.5 * static_cast<double>(row & 1);
  const double up = course - std::floor(course), side = 2 * (along - std::floor(along));
  const bool mortar =
      up < kMortarShare || up > 1 - kMortarShare || side < kMortarShare || side > 2 - kMortarShare;
  return mortar ? -1 : 0.5 + kAlike * RandomOf(surface.seed, Cell(along), row);
}

/// -1 to 1 and a little beyond.
double PatternAt(const BoxRoomSurface& surface, double u, double v) {
  switch (surface.pattern) {
    case Pattern::kChecks:
      return (((Cell(u) + Cell(v)) & 1) == 0 ? 1 : -1) +
             kAlike * RandomOf(surface.seed, Cell(u), Cell(v));
    case Pattern::kStripes:
      return (Cell(u) & 1) == 0 ? 1 : -1;
    case Pattern::kBricks:
      return Bricks(surface, u, v);
    case Pattern::kPatches:
      return RandomOf(surface.seed, Cell(u), Cell(v));
    case Pattern::kNoise:
      return Fractal(surface.seed, u, v);
    case Pattern::kFaint:
      return kFaintShare * Fractal(surface.seed, u, v);
  }
  return 0;
}

double GreyAt(const BoxRoomSurface& surface, const Eigen::Vector2d& place) {
  const Eigen::Vector2d turned = Eigen::Rotation2Dd(surface.angle_rad) * place / surface.period_m;
  return surface.mean_grey + surface.contrast * PatternAt(surface, turned.x(), turned.y());
}

/// What a room is drawn from.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  double Between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  BoxRoomSurface Surface() {
    constexpr std::array<Pattern, 6> kPatterns = {Pattern::kChecks, Pattern::kStripes,
                                                  Pattern::kBricks, Pattern::kPatches,
                                                  Pattern::kNoise,  Pattern::kFaint};
    // Half of them repeat, a twelfth is all but bare.
    constexpr std::array<double, 6> kShares = {2, 2, 2, 3, 2, 1};
    BoxRoomSurface surface;
    surface.pattern =
        kPatterns[std::discrete_distribution<std::size_t>(kShares.begin(), kShares.end())(random_)];
    surface.period_m = Between(0.12, 0.5);
    surface.angle_rad = Between(0, 1) < 0.5 ? 0 : Between(-0.6, 0.6);
    surface.mean_grey = Between(90, 160);
    surface.contrast = Between(25, 70);
    surface.seed = random_();
    return surface;
  }
  void Faces(std::array<std::array<BoxRoomSurface, 2>, 3>& faces) {
    for (auto& sides : faces) {
      for (BoxRoomSurface& surface : sides) surface = Surface();
    }
  }

 private:
  std::mt19937_64 random_;
};

/// The two axes of a face across `axis`, level one first.
Eigen::Vector2d PlaceOnFace(const Eigen::Vector3d& point, int axis) {
  if (axis == 0) return {point.y(), point.z()};
  if (axis == 1) return {point.x(), point.z()};
  return {point.x(), point.y()};
}

}  // namespace

BoxRoom::BoxRoom(std::uint64_t seed) {
  Draw draw(seed);
  const Eigen::Vector3d half(draw.Between(1.8, 4), draw.Between(1.6, 3), draw.Between(1.1, 1.6));
  room_.low = Eigen::Vector3d(-half.x(), -half.y(), 0);
  room_.high = Eigen::Vector3d(half.x(), half.y(), 2 * half.z());
  draw.Faces(room_.faces);
  lamp_ = Eigen::Vector3d(draw.Between(-1, 1), draw.Between(-1, 1), 2 * half.z() - 0.2);
  const int count = static_cast<int>(draw.Between(0, 4));
  for (int i = 0; i < count; ++i) {
    Box box;
    const Eigen::Vector3d size(draw.Between(0.3, 0.9), draw.Between(0.3, 0.9),
                               draw.Between(0.4, 1.6));
    // Along the walls, so that the middle is free.
    const double way_rad = draw.Between(-M_PI, M_PI);
    const Eigen::Vector3d place(0.8 * half.x() * std::cos(way_rad),
                                0.8 * half.y() * std::sin(way_rad), 0);
    box.low = Eigen::Vector3d(-size.x() / 2, -size.y() / 2, 0);
    box.high = Eigen::Vector3d(size.x() / 2, size.y() / 2, size.z());
    box.box_from_world = Eigen::AngleAxisd(draw.Between(-M_PI, M_PI), Eigen::Vector3d::UnitZ()) *
                         Eigen::Translation3d(-place);
    draw.Faces(box.faces);
    boxes_.push_back(box);
  }
}

void BoxRoom::MeetFromInside(const Box& box, const Eigen::Vector3d& origin,
                             const Eigen::Vector3d& ray, Hit& nearest) {
  for (int axis = 0; axis < 3; ++axis) {
    if (ray[axis] == 0) continue;
    const bool high = ray[axis] > 0;
    const double distance = ((high ? box.high : box.low)[axis] - origin[axis]) / ray[axis];
    if (distance < 0 || distance >= nearest.distance) continue;
    nearest.distance = distance;
    nearest.surface = &box.faces[static_cast<std::size_t>(axis)][high ? 1 : 0];
    nearest.place = PlaceOnFace(origin + distance * ray, axis);
  }
}

void BoxRoom::MeetFromOutside(const Box& box, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& ray, Hit& nearest) {
  double enter = 0, leave = nearest.distance;
  int entered = -1;
  for (int axis = 0; axis < 3; ++axis) {
    if (ray[axis] == 0) {
      if (origin[axis] < box.low[axis] || origin[axis] > box.high[axis]) return;
      continue;
    }
    const bool forward = ray[axis] > 0;
    const double near = ((forward ? box.low : box.high)[axis] - origin[axis]) / ray[axis];
    const double far = ((forward ? box.high : box.low)[axis] - origin[axis]) / ray[axis];
    if (near > enter) enter = near, entered = axis;
    leave = std::min(leave, far);
  }
  if (entered < 0 || enter >= leave) return;
  nearest.distance = enter;
  nearest.surface = &box.faces[static_cast<std::size_t>(entered)][ray[entered] > 0 ? 0 : 1];
  nearest.place = PlaceOnFace(origin + enter * ray, entered);
}

double BoxRoom::Light(const Eigen::Vector3d& place) const {
  const double reach = (place - lamp_).squaredNorm() / (kLampReachM * kLampReachM);
  return kAmbient + (1 - kAmbient) / (1 + reach);
}

BoxRoom::View BoxRoom::Render(const geo::CameraIntrinsics& camera,
                              const Eigen::Isometry3d& world_from_camera,
                              std::uint64_t frame) const {
  View view{cv::Mat(camera.height, camera.width, CV_8UC1),
            cv::Mat(camera.height, camera.width, CV_32FC1)};
  std::vector<Eigen::Isometry3d> box_from_camera;
  for (const Box& box : boxes_) box_from_camera.push_back(box.box_from_world * world_from_camera);
  cv::parallel_for_(cv::Range(0, camera.height), [&](const cv::Range& rows) {
    for (int y = rows.start; y < rows.end; ++y) {
      // A generator for each row: the same pixels whatever the threads.
      std::mt19937_64 random(frame * 100'003 + static_cast<std::uint64_t>(y));
      std::normal_distribution<double> noise(0, kNoiseGrey);
      for (int x = 0; x < camera.width; ++x) {
        const Eigen::Vector3d in_camera((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy,
                                        1);
        const Eigen::Vector3d ray = world_from_camera.linear() * in_camera;
        Hit hit;
        MeetFromInside(room_, world_from_camera.translation(), ray, hit);
        for (std::size_t i = 0; i < boxes_.size(); ++i) {
          MeetFromOutside(boxes_[i], box_from_camera[i].translation(),
                          box_from_camera[i].linear() * in_camera, hit);
        }
        const double light = Light(world_from_camera.translation() + hit.distance * ray);
        view.grey.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(
            light * GreyAt(*hit.surface, hit.place) + noise(random));
        // The ray has a length of one along the optical axis.
        view.depth_m.at<float>(y, x) = static_cast<float>(hit.distance);
      }
    }
  });
  return view;
}

double BoxRoom::Clearance(const Eigen::Vector3d& place) const {
  double least = std::min((place - room_.low).minCoeff(), (room_.high - place).minCoeff());
  for (const Box& box : boxes_) {
    const Eigen::Vector3d in_box = box.box_from_world * place;
    const Eigen::Vector3d beyond = (box.low - in_box).cwiseMax(in_box - box.high);
    least = std::min(least, beyond.maxCoeff() < 0 ? beyond.maxCoeff() : beyond.cwiseMax(0).norm());
  }
  return least;
}

}  // namespace livemap::bench
