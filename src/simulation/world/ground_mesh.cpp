#include "simulation/world/ground_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace livemap::simulation {
namespace {

constexpr int kColumns = 7;  // of one side, from the middle line outwards
constexpr float kHoleCellM = 0.035F;

/// One line across the street: where its columns lie and how high.
struct Station {
  float along = 0;
  std::array<float, 2 * kColumns - 1> left{};
  std::array<float, 2 * kColumns - 1> up{};
};

float GroundCrownHeight(float left) { return -kCrownFall * std::min(std::abs(left), 6.0F); }

Station MakeGroundStation(const GroundPlan& plan, float along, bool in_crossing) {
  const float foot =
      in_crossing ? plan.profile.half_road_m() + kCornerRadiusM : plan.KerbFoot(along, nullptr);
  const float back = foot + kKerbWidthM;
  const float road = plan.profile.half_road_m();
  const std::array<float, kColumns> out = {0,
                                           0.5F * road,
                                           foot,
                                           foot + 0.02F,
                                           back,
                                           back + plan.profile.pavement_width_m,
                                           kGroundHalfWidthM};
  Station station;
  station.along = along;
  for (int column = 0; column < kColumns; ++column) {
    const auto c = static_cast<std::size_t>(column);
    const bool raised = column >= 3 && !in_crossing;
    float up = GroundCrownHeight(std::min(out[c], foot)) + (raised ? kKerbHeightM : 0);
    if (column >= 5 && raised) up += 0.03F;
    station.left[kColumns - 1 + c] = out[c];
    station.up[kColumns - 1 + c] = up;
    station.left[kColumns - 1 - c] = -out[c];
    station.up[kColumns - 1 - c] = up;
  }
  return station;
}

std::vector<Station> MakeGroundStations(const GroundPlan& plan, float begin, float end) {
  std::vector<Station> stations;
  const auto add = [&](float along, bool in_crossing) {
    if (along >= begin && along <= end)
      stations.push_back(MakeGroundStation(plan, along, in_crossing));
  };
  std::vector<std::pair<float, bool>> places;
  for (int i = 0; static_cast<float>(i) * 2 <= end - begin + 0.01F; ++i) {
    const float along = begin + 2 * static_cast<float>(i);
    float crossing = 0;
    plan.KerbFoot(along, &crossing);
    if (std::abs(crossing) > kSideRoadHalfM + kCornerRadiusM) {
      places.emplace_back(along, false);
    }
    const bool at_border = i == 0 || along + 1 > end;
    if (at_border && std::abs(crossing) <= kSideRoadHalfM + kCornerRadiusM) {
      places.emplace_back(along, std::abs(crossing) < kSideRoadHalfM);
    }
  }
  for (const float at : plan.crossings_m) {
    for (const float side : {-1.0F, 1.0F}) {
      for (int i = 0; i <= 12; ++i) {
        const float beside = kCornerRadiusM * static_cast<float>(i) / 12.0F;
        places.emplace_back(at + side * (kSideRoadHalfM + std::max(beside, 1e-3F)), false);
      }
      places.emplace_back(at + side * kSideRoadHalfM, true);
      places.emplace_back(at + side * kSideRoadHalfM * 0.4F, true);
    }
  }
  std::sort(places.begin(), places.end());
  for (const auto& [along, in_crossing] : places) add(along, in_crossing);
  return stations;
}

/// One four-cornered piece of ground, bilinear between its corners.
struct GroundMeshPatch {
  const Station& near;
  const Station& far;
  std::size_t column;

  float Along(float t) const { return Blend(near.along, far.along, t); }
  float Left(float t, float u) const {
    return Blend(Blend(near.left[column], near.left[column + 1], u),
                 Blend(far.left[column], far.left[column + 1], u), t);
  }
};

class GroundMeshLayer {
 public:
  GroundMeshLayer(const RoadLine& line, const GroundPlan& plan, const Eigen::Vector3d& origin,
                  MeshBuilder& builder)
      : line_(line), plan_(plan), origin_(origin), builder_(builder) {}

  void Lay(const GroundMeshPatch& patch) {
    const Vec3 a = Place(patch.near, patch.column);
    const Vec3 b = Place(patch.far, patch.column);
    const Vec3 c = Place(patch.far, patch.column + 1);
    const Vec3 d = Place(patch.near, patch.column + 1);
    const std::vector<const Pothole*> holes = HolesIn(patch);
    if (holes.empty()) {
      LayFlat(patch, a, b, c, d);
    } else {
      LayDented(patch, holes, a, b, c, d);
    }
  }

 private:
  Vec3 Place(const Station& station, std::size_t column) const {
    return (line_.At(static_cast<double>(station.along), static_cast<double>(station.left[column]),
                     static_cast<double>(station.up[column])) -
            origin_)
        .cast<float>();
  }

  std::vector<const Pothole*> HolesIn(const GroundMeshPatch& patch) const {
    std::vector<const Pothole*> holes;
    const float low = std::min(patch.near.left[patch.column], patch.far.left[patch.column]);
    const float high =
        std::max(patch.near.left[patch.column + 1], patch.far.left[patch.column + 1]);
    for (const Pothole& hole : plan_.potholes) {
      const float reach = 1.7F * hole.radius_m;
      if (hole.along_m + reach > patch.near.along && hole.along_m - reach < patch.far.along &&
          hole.left_m + reach > low && hole.left_m - reach < high) {
        holes.push_back(&hole);
      }
    }
    return holes;
  }

  void LayFlat(const GroundMeshPatch& patch, const Vec3& a, const Vec3& b, const Vec3& c,
               const Vec3& d) {
    const Vec3 normal = (c - a).cross(d - b);
    if (normal.norm() < 1e-6F) return;
    const std::uint32_t first = builder_.AddVertex(a, normal, {patch.Along(0), patch.Left(0, 0)});
    builder_.AddVertex(b, normal, {patch.Along(1), patch.Left(1, 0)});
    builder_.AddVertex(c, normal, {patch.Along(1), patch.Left(1, 1)});
    builder_.AddVertex(d, normal, {patch.Along(0), patch.Left(0, 1)});
    builder_.AddTriangle(first, first + 1, first + 2);
    builder_.AddTriangle(first, first + 2, first + 3);
  }

  float Height(const std::vector<const Pothole*>& holes, float along, float left) const {
    float height = 0;
    for (const Pothole* hole : holes) {
      height = std::min(height, std::max(hole->Dent(along, left), hole->WaterLevel()));
    }
    return height;
  }

  void LayDented(const GroundMeshPatch& patch, const std::vector<const Pothole*>& holes,
                 const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    const int rows = 1 + static_cast<int>((b - a).norm() / kHoleCellM);
    const int columns = 1 + static_cast<int>((d - a).norm() / kHoleCellM);
    std::uint32_t first = 0;
    for (int row = 0; row <= rows; ++row) {
      const float t = static_cast<float>(row) / static_cast<float>(rows);
      for (int column = 0; column <= columns; ++column) {
        const float u = static_cast<float>(column) / static_cast<float>(columns);
        const float along = patch.Along(t);
        const float left = patch.Left(t, u);
        // On the border the dent has ended, so that the patch meets its flat neighbours.
        Vec3 place = Blend(Blend(a, b, t), Blend(d, c, t), u);
        constexpr float kStep = 0.02F;
        const float here = Height(holes, along, left);
        place.z() += here;
        const Vec3 normal(Height(holes, along - kStep, left) - Height(holes, along + kStep, left),
                          Height(holes, along, left - kStep) - Height(holes, along, left + kStep),
                          2 * kStep);
        const double heading = line_.HeadingRad(static_cast<double>(along));
        const auto cosine = static_cast<float>(std::cos(heading));
        const auto sine = static_cast<float>(std::sin(heading));
        const Vec3 turned(cosine * normal.x() - sine * normal.y(),
                          sine * normal.x() + cosine * normal.y(), normal.z());
        builder_.SetOpenness(1.0F / (1.0F - 7.0F * here));
        const std::uint32_t vertex = builder_.AddVertex(place, turned, {along, left});
        if (row == 0 && column == 0) first = vertex;
      }
    }
    builder_.SetOpenness(1);
    const auto width = static_cast<std::uint32_t>(columns + 1);
    for (std::uint32_t row = 0; row < static_cast<std::uint32_t>(rows); ++row) {
      for (std::uint32_t column = 0; column + 1 < width; ++column) {
        const std::uint32_t corner = first + row * width + column;
        builder_.AddTriangle(corner, corner + width, corner + width + 1);
        builder_.AddTriangle(corner, corner + width + 1, corner + 1);
      }
    }
  }

  const RoadLine& line_;
  const GroundPlan& plan_;
  const Eigen::Vector3d& origin_;
  MeshBuilder& builder_;
};

}  // namespace

void AddGround(const RoadLine& line, const GroundPlan& plan, double begin_m, double end_m,
               const Eigen::Vector3d& origin, MeshBuilder& builder) {
  const std::vector<Station> stations =
      MakeGroundStations(plan, static_cast<float>(begin_m), static_cast<float>(end_m));
  GroundMeshLayer layer(line, plan, origin, builder);
  for (std::size_t i = 0; i + 1 < stations.size(); ++i) {
    for (std::size_t column = 0; column + 1 < stations[i].left.size(); ++column) {
      layer.Lay({stations[i], stations[i + 1], column});
    }
  }
}

float GroundHeight(const GroundPlan& plan, float along_m, float left_m) {
  float crossing = 0;
  const float foot = plan.KerbFoot(along_m, &crossing);
  const float away = std::abs(left_m);
  const float height = GroundCrownHeight(std::min(away, foot));
  if (away <= foot) return height;
  return height + kKerbHeightM +
         (away > foot + kKerbWidthM + plan.profile.pavement_width_m ? 0.03F : 0.0F);
}

}  // namespace livemap::simulation
