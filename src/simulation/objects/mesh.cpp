#include "simulation/objects/mesh.h"

#include <cmath>

namespace livemap::simulation {
namespace {

constexpr float kPi = 3.14159265F;

/// Two directions that span the plane across `axis`.
void AcrossMeshAxis(const Vec3& axis, Vec3& first, Vec3& second) {
  const Vec3 helper = std::abs(axis.z()) < 0.9F ? Vec3::UnitZ() : Vec3::UnitX();
  first = axis.cross(helper).normalized();
  second = axis.cross(first);
}

}  // namespace

std::uint16_t MeshBuilder::SetMaterial(const Material& material) {
  mesh_.materials.push_back(material);
  material_ = static_cast<std::uint16_t>(mesh_.materials.size() - 1);
  return material_;
}

std::uint32_t MeshBuilder::AddVertex(const Vec3& position, const Vec3& normal, const Vec2& uv) {
  mesh_.positions.push_back(frame_ * position);
  mesh_.normals.push_back((frame_.linear() * normal).normalized());
  mesh_.uvs.push_back(uv);
  mesh_.openness.push_back(openness_);
  return static_cast<std::uint32_t>(mesh_.positions.size() - 1);
}

void MeshBuilder::AddTriangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  Triangle triangle;
  triangle.corners[0] = a;
  triangle.corners[1] = b;
  triangle.corners[2] = c;
  triangle.material = material_;
  triangle.instance = instance_;
  mesh_.triangles.push_back(triangle);
}

void MeshBuilder::AddQuad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d,
                          const Vec2& low, const Vec2& high) {
  const Vec3 normal = (c - a).cross(d - b);
  const float length = normal.norm();
  if (length < 1e-9F) return;
  const Vec3 unit = normal / length;
  const std::uint32_t first = AddVertex(a, unit, low);
  AddVertex(b, unit, {high.x(), low.y()});
  AddVertex(c, unit, high);
  AddVertex(d, unit, {low.x(), high.y()});
  AddTriangle(first, first + 1, first + 2);
  AddTriangle(first, first + 2, first + 3);
}

void MeshBuilder::AddBox(const Vec3& low, const Vec3& high) {
  const auto corner = [&](int x, int y, int z) {
    return Vec3(x ? high.x() : low.x(), y ? high.y() : low.y(), z ? high.z() : low.z());
  };
  const Vec2 xz_low(low.x(), low.z());
  const Vec2 xz_high(high.x(), high.z());
  const Vec2 yz_low(low.y(), low.z());
  const Vec2 yz_high(high.y(), high.z());
  const Vec2 xy_low(low.x(), low.y());
  const Vec2 xy_high(high.x(), high.y());
  AddQuad(corner(0, 0, 0), corner(1, 0, 0), corner(1, 0, 1), corner(0, 0, 1), xz_low, xz_high);
  AddQuad(corner(1, 1, 0), corner(0, 1, 0), corner(0, 1, 1), corner(1, 1, 1), xz_low, xz_high);
  AddQuad(corner(1, 0, 0), corner(1, 1, 0), corner(1, 1, 1), corner(1, 0, 1), yz_low, yz_high);
  AddQuad(corner(0, 1, 0), corner(0, 0, 0), corner(0, 0, 1), corner(0, 1, 1), yz_low, yz_high);
  AddQuad(corner(0, 0, 1), corner(1, 0, 1), corner(1, 1, 1), corner(0, 1, 1), xy_low, xy_high);
  AddQuad(corner(0, 1, 0), corner(1, 1, 0), corner(1, 0, 0), corner(0, 0, 0), xy_low, xy_high);
}

void MeshBuilder::AddLathe(const std::vector<Vec2>& profile, int sides) {
  for (std::size_t ring = 0; ring + 1 < profile.size(); ++ring) {
    const Vec2& low = profile[ring];
    const Vec2& high = profile[ring + 1];
    const Vec2 along = high - low;
    const Vec2 out = Vec2(along.y(), -along.x()).normalized();
    std::uint32_t before = 0;
    for (int side = 0; side <= sides; ++side) {
      const float angle = 2 * kPi * static_cast<float>(side) / static_cast<float>(sides);
      const float c = std::cos(angle);
      const float s = std::sin(angle);
      const Vec3 normal(out.x() * c, out.x() * s, out.y());
      const std::uint32_t bottom =
          AddVertex({low.x() * c, low.x() * s, low.y()}, normal, {angle * low.x(), low.y()});
      AddVertex({high.x() * c, high.x() * s, high.y()}, normal, {angle * high.x(), high.y()});
      if (side > 0) {
        AddTriangle(before, bottom, bottom + 1);
        AddTriangle(before, bottom + 1, before + 1);
      }
      before = bottom;
    }
  }
}

void MeshBuilder::AddTube(const Vec3& from, const Vec3& to, float from_radius, float to_radius,
                          int sides) {
  const Vec3 axis = (to - from).normalized();
  Vec3 u;
  Vec3 v;
  AcrossMeshAxis(axis, u, v);
  const float length = (to - from).norm();
  std::uint32_t before = 0;
  for (int side = 0; side <= sides; ++side) {
    const float angle = 2 * kPi * static_cast<float>(side) / static_cast<float>(sides);
    const Vec3 out = std::cos(angle) * u + std::sin(angle) * v;
    const std::uint32_t bottom = AddVertex(from + from_radius * out, out, {angle * from_radius, 0});
    AddVertex(to + to_radius * out, out, {angle * from_radius, length});
    if (side > 0) {
      AddTriangle(before, bottom, bottom + 1);
      AddTriangle(before, bottom + 1, before + 1);
    }
    before = bottom;
  }
}

void MeshBuilder::AddEllipsoid(const Vec3& centre, const Vec3& radii, int sides) {
  const int rings = sides / 2 + 1;
  const auto row = static_cast<std::uint32_t>(sides + 1);
  for (int ring = 0; ring <= rings; ++ring) {
    const float latitude = kPi * (static_cast<float>(ring) / static_cast<float>(rings) - 0.5F);
    std::uint32_t first = 0;
    for (int side = 0; side <= sides; ++side) {
      const float angle = 2 * kPi * static_cast<float>(side) / static_cast<float>(sides);
      const Vec3 unit(std::cos(latitude) * std::cos(angle), std::cos(latitude) * std::sin(angle),
                      std::sin(latitude));
      const Vec3 offset = unit.cwiseProduct(radii);
      first = AddVertex(centre + offset, unit.cwiseQuotient(radii),
                        {angle * radii.x(), latitude * radii.z()});
      if (ring > 0 && side > 0) {
        AddTriangle(first - row - 1, first - row, first);
        AddTriangle(first - row - 1, first, first - 1);
      }
    }
  }
}

void MeshBuilder::AddDisc(const Vec3& centre, const Vec3& normal, float radius, int sides) {
  const Vec3 right = Vec3::UnitZ().cross(normal).normalized();
  const Vec3 up = normal.cross(right);
  const std::uint32_t middle = AddVertex(centre, normal, {0.5F, 0.5F});
  for (int side = 0; side <= sides; ++side) {
    const float angle = 2 * kPi * static_cast<float>(side) / static_cast<float>(sides);
    const float c = std::cos(angle);
    const float s = std::sin(angle);
    const std::uint32_t rim = AddVertex(centre + radius * (c * right + s * up), normal,
                                        {0.5F + 0.5F * c, 0.5F + 0.5F * s});
    if (side > 0) AddTriangle(middle, rim - 1, rim);
  }
}

}  // namespace livemap::simulation
