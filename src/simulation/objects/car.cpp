#include "simulation/objects/car.h"

#include <array>
#include <cmath>
#include <vector>

namespace livemap::simulation {
namespace {

/// The side view of a body: heights in metres at shares of the length, from the rear.
struct Silhouette {
  float length;
  float half_width;
  float belt;             ///< Height of the lower edge of the windows.
  std::vector<Vec2> top;  ///< (share of the length, height).
  float front_wheel;      ///< Shares of the length.
  float rear_wheel;
};

const std::array<Silhouette, 4> kBodies = {Silhouette{4.0F,
                                                      0.86F,
                                                      0.93F,
                                                      {{0.0F, 0.55F},
                                                       {0.012F, 0.9F},
                                                       {0.05F, 1.02F},
                                                       {0.13F, 1.40F},
                                                       {0.25F, 1.47F},
                                                       {0.48F, 1.46F},
                                                       {0.57F, 1.39F},
                                                       {0.73F, 0.97F},
                                                       {0.88F, 0.87F},
                                                       {0.965F, 0.74F},
                                                       {1.0F, 0.5F}},
                                                      0.80F,
                                                      0.18F},
                                           Silhouette{4.6F,
                                                      0.89F,
                                                      0.93F,
                                                      {{0.0F, 0.55F},
                                                       {0.012F, 0.93F},
                                                       {0.05F, 1.01F},
                                                       {0.15F, 1.03F},
                                                       {0.29F, 1.40F},
                                                       {0.40F, 1.45F},
                                                       {0.52F, 1.44F},
                                                       {0.58F, 1.38F},
                                                       {0.72F, 0.99F},
                                                       {0.88F, 0.89F},
                                                       {0.965F, 0.76F},
                                                       {1.0F, 0.5F}},
                                                      0.80F,
                                                      0.20F},
                                           Silhouette{4.55F,
                                                      0.92F,
                                                      1.06F,
                                                      {{0.0F, 0.6F},
                                                       {0.012F, 1.05F},
                                                       {0.035F, 1.15F},
                                                       {0.09F, 1.58F},
                                                       {0.2F, 1.68F},
                                                       {0.50F, 1.67F},
                                                       {0.58F, 1.58F},
                                                       {0.71F, 1.12F},
                                                       {0.88F, 1.03F},
                                                       {0.965F, 0.9F},
                                                       {1.0F, 0.55F}},
                                                      0.80F,
                                                      0.19F},
                                           Silhouette{5.2F,
                                                      0.97F,
                                                      1.25F,
                                                      {{0.0F, 0.6F},
                                                       {0.008F, 1.3F},
                                                       {0.02F, 1.9F},
                                                       {0.05F, 2.0F},
                                                       {0.4F, 2.02F},
                                                       {0.68F, 2.0F},
                                                       {0.75F, 1.85F},
                                                       {0.86F, 1.28F},
                                                       {0.95F, 1.05F},
                                                       {1.0F, 0.6F}},
                                                      0.82F,
                                                      0.2F}};

const std::array<Vec3, 10> kPaints = {Vec3(0.60F, 0.60F, 0.60F), Vec3(0.015F, 0.015F, 0.017F),
                                      Vec3(0.22F, 0.23F, 0.24F), Vec3(0.38F, 0.39F, 0.40F),
                                      Vec3(0.03F, 0.06F, 0.20F), Vec3(0.32F, 0.02F, 0.02F),
                                      Vec3(0.05F, 0.10F, 0.08F), Vec3(0.10F, 0.19F, 0.32F),
                                      Vec3(0.34F, 0.27F, 0.17F), Vec3(0.07F, 0.07F, 0.08F)};

float CarHeightAt(const std::vector<Vec2>& top, float share) {
  for (std::size_t i = 1; i < top.size(); ++i) {
    if (share <= top[i].x()) {
      const float t = (share - top[i - 1].x()) / (top[i].x() - top[i - 1].x());
      return Blend(top[i - 1].y(), top[i].y(), Saturate(t));
    }
  }
  return top.back().y();
}

constexpr int kRing = 8;  // points of half a cross-section from the sill to the roof's middle

using Ring = std::array<Vec3, kRing>;

Ring CarCrossSection(const Silhouette& body, float share, float crushed, std::uint32_t seed) {
  const float x = (share - 0.5F) * body.length;
  const float top = CarHeightAt(body.top, share);
  const float taper = 1 - 0.16F * std::pow(std::abs(2 * share - 1), 4.0F);
  const float half = body.half_width * taper;
  const float belt = std::min(body.belt, top - 0.02F);
  const float cabin = Saturate((top - belt) / 0.45F);
  const float sill = 0.24F + 0.10F * std::pow(std::abs(2 * share - 1), 6.0F);
  const float roof_half = Blend(half * 0.90F, half * 0.74F, cabin);
  Ring ring = {Vec3(x, 0.82F * half, sill),
               Vec3(x, 0.97F * half, sill + 0.10F),
               Vec3(x, half, std::min(0.62F, belt - 0.05F)),
               Vec3(x, 0.985F * half, belt - 0.03F),
               Vec3(x, 0.955F * half, belt),
               Vec3(x, roof_half, Blend(belt, top, 0.9F)),
               Vec3(x, roof_half * 0.86F, Blend(belt, top, 0.985F)),
               Vec3(x, 0, top)};
  if (crushed > 0) {
    const float hit = crushed * SmoothStep(0.55F, 1.0F, share);
    for (Vec3& point : ring) {
      const float crumple = Noise(point.y() * 4 + 9, point.z() * 5 + share * 23, seed);
      point.x() -= hit * (0.75F + 0.28F * crumple);
      point.z() += hit * (0.10F + 0.16F * crumple) * Saturate(point.z());
      point.y() *= 1 + 0.12F * hit * crumple;
    }
  }
  return ring;
}

class CarBody {
 public:
  CarBody(const Silhouette& silhouette, std::uint16_t paint, std::uint16_t glass,
          MeshBuilder& builder)
      : silhouette_(silhouette), paint_(paint), glass_(glass), builder_(builder) {}

  void Skin(float from, float to, float crushed, std::uint32_t seed) {
    const Ring a = CarCrossSection(silhouette_, from, crushed, seed);
    const Ring b = CarCrossSection(silhouette_, to, crushed, seed);
    const float middle = 0.5F * (from + to);
    const Rounding rounding{Normals(from, crushed, seed), Normals(to, crushed, seed)};
    for (std::size_t i = 0; i + 1 < kRing; ++i) {
      builder_.UseMaterial(IsGlass(i, from, to, middle) ? glass_ : paint_);
      Quad(a, b, i, rounding, 1);
      Quad(a, b, i, rounding, -1);
    }
  }

  void Cap(float share, float crushed, std::uint32_t seed) {
    builder_.UseMaterial(paint_);
    const Ring ring = CarCrossSection(silhouette_, share, crushed, seed);
    const Vec3 normal(share > 0.5F ? 1.0F : -1.0F, 0, 0);
    for (std::size_t i = 0; i + 1 < kRing; ++i) {
      Vec3 a = ring[i];
      Vec3 b = ring[i + 1];
      Vec3 c = b;
      Vec3 d = a;
      c.y() = -c.y();
      d.y() = -d.y();
      const std::uint32_t first = builder_.AddVertex(a, normal, {a.x(), a.z()});
      builder_.AddVertex(b, normal, {b.x(), b.z()});
      builder_.AddVertex(c, normal, {c.x(), c.z()});
      builder_.AddVertex(d, normal, {d.x(), d.z()});
      builder_.AddTriangle(first, first + 1, first + 2);
      builder_.AddTriangle(first, first + 2, first + 3);
    }
  }

 private:
  struct Rounding {
    Ring near;
    Ring far;
  };

  /// Unit normals of the rounded body at one station.
  Ring Normals(float share, float crushed, std::uint32_t seed) const {
    constexpr float kStep = 0.02F;
    const Ring before = CarCrossSection(silhouette_, std::max(share - kStep, 0.0F), crushed, seed);
    const Ring here = CarCrossSection(silhouette_, share, crushed, seed);
    const Ring after = CarCrossSection(silhouette_, std::min(share + kStep, 1.0F), crushed, seed);
    Ring normals;
    for (std::size_t i = 0; i < kRing; ++i) {
      const Vec3& low = here[i > 0 ? i - 1 : 0];
      const Vec3 high =
          i + 1 < kRing ? here[i + 1] : Vec3(here[i].x(), -here[i - 1].y(), here[i - 1].z());
      const Vec3 normal = (after[i] - before[i]).cross(high - low);
      normals[i] = normal.norm() > 1e-8F ? normal.normalized().eval() : Vec3::UnitZ().eval();
    }
    return normals;
  }

  /// Side windows lie between belt and roof edge, wind shields where the roof line falls steeply.
  bool IsGlass(std::size_t i, float from, float to, float middle) const {
    const float top = CarHeightAt(silhouette_.top, middle);
    const float rise = CarHeightAt(silhouette_.top, to) - CarHeightAt(silhouette_.top, from);
    const float slope = std::abs(rise) / ((to - from) * silhouette_.length);
    const bool cabin = top > silhouette_.belt + 0.12F;
    const bool pillar = std::abs(middle - 0.44F) < 0.012F;
    if (i == 4) return cabin && !pillar && middle > 0.1F;
    return i >= 5 && cabin && slope > 0.32F && middle > 0.04F;
  }

  /// Corners of ring points `i` and `i + 1` at two stations; normals between the flat one and that
  /// of the rounded body.
  void Quad(const Ring& near, const Ring& far, std::size_t i, const Rounding& rounding,
            float side) {
    Vec3 corners[4] = {near[i], far[i], far[i + 1], near[i + 1]};
    const Vec3 round[4] = {rounding.near[i], rounding.far[i], rounding.far[i + 1],
                           rounding.near[i + 1]};
    const Vec3 flat = (corners[2] - corners[0]).cross(corners[3] - corners[1]);
    if (flat.norm() < 1e-8F) return;
    std::uint32_t first = 0;
    for (std::size_t corner = 0; corner < 4; ++corner) {
      Vec3 normal = 0.35F * flat.normalized() + 0.65F * round[corner];
      normal.y() *= side;
      corners[corner].y() *= side;
      const std::uint32_t vertex =
          builder_.AddVertex(corners[corner], normal, {corners[corner].x(), corners[corner].z()});
      if (corner == 0) first = vertex;
    }
    builder_.AddTriangle(first, first + 1, first + 2);
    builder_.AddTriangle(first, first + 2, first + 3);
  }

  const Silhouette& silhouette_;
  std::uint16_t paint_;
  std::uint16_t glass_;
  MeshBuilder& builder_;
};

void AddWheel(const Vec3& centre, float side, MeshBuilder& builder, std::uint16_t rubber,
              std::uint16_t rim, std::uint16_t dark) {
  const Vec3 out(0, side, 0);
  constexpr float kRadius = 0.31F;
  builder.UseMaterial(dark);
  builder.SetOpenness(0.3F);
  builder.AddDisc(centre + 0.008F * out, out, kRadius + 0.05F, 20);
  builder.UseMaterial(rubber);
  builder.SetOpenness(0.7F);
  builder.AddTube(centre - 0.18F * out, centre + 0.015F * out, kRadius, kRadius, 18);
  builder.AddDisc(centre + 0.015F * out, out, kRadius, 18);
  builder.UseMaterial(rim);
  builder.AddDisc(centre + 0.025F * out, out, 0.205F, 14);
  builder.UseMaterial(dark);
  for (int spoke = 0; spoke < 5; ++spoke) {
    const float angle = 1.2566F * static_cast<float>(spoke);
    builder.AddDisc(centre + 0.03F * out + 0.125F * Vec3(std::cos(angle), 0, std::sin(angle)), out,
                    0.045F, 6);
  }
  builder.SetOpenness(1);
}

void AddCarLights(const Silhouette& body, float crushed, MeshBuilder& builder) {
  const float front = 0.5F * body.length - 0.055F;
  const float rear = -0.5F * body.length;
  const float width = body.half_width * 0.80F;
  const Vec3 plate(0.6F, 0.6F, 0.55F);
  for (const float side : {-1.0F, 1.0F}) {
    if (crushed <= 0) {
      builder.SetMaterial({MaterialKind::kMetal, Vec3(0.62F, 0.64F, 0.66F), Vec3::Ones(), 0});
      builder.AddEllipsoid({front - 0.03F, side * width * 0.82F, 0.66F}, {0.07F, 0.17F, 0.075F}, 8);
    }
    builder.SetMaterial({MaterialKind::kPlain, Vec3(0.38F, 0.015F, 0.015F), Vec3::Ones(), 0});
    builder.AddEllipsoid({rear + 0.03F, side * width * 0.88F, body.belt - 0.12F},
                         {0.045F, 0.10F, 0.12F}, 8);
  }
  builder.SetMaterial({MaterialKind::kPlain, plate, Vec3::Ones(), 0});
  builder.AddBox({rear - 0.012F, -0.26F, 0.62F}, {rear + 0.02F, 0.26F, 0.73F});
  builder.SetMaterial({MaterialKind::kRubber, Vec3(0.02F, 0.02F, 0.02F), Vec3::Ones(), 0});
  builder.AddBox({rear - 0.03F, -width, 0.36F}, {rear + 0.08F, width, 0.50F});
  if (crushed > 0) return;
  builder.AddBox({front - 0.03F, -0.5F * width, 0.52F}, {front + 0.05F, 0.5F * width, 0.64F});
  builder.AddBox({front - 0.06F, -0.9F * width, 0.3F}, {front + 0.055F, 0.9F * width, 0.42F});
  builder.SetMaterial({MaterialKind::kPlain, plate, Vec3::Ones(), 0});
  builder.AddBox({front, -0.26F, 0.44F}, {front + 0.07F, 0.26F, 0.55F});
}

}  // namespace

float AddCar(CounterRandom& random, float crushed, MeshBuilder& builder) {
  const double kind = random.Uniform(0.0, 1.0);
  const Silhouette& body = kBodies[kind < 0.38 ? 0 : kind < 0.62 ? 1 : kind < 0.9 ? 2 : 3];
  const std::uint32_t seed = random.Bits32();
  const std::uint16_t paint = builder.SetMaterial(
      {MaterialKind::kCarPaint,
       kPaints[static_cast<std::size_t>(random.Index(static_cast<int>(kPaints.size())))],
       Vec3::Ones(), seed});
  const std::uint16_t glass = builder.SetMaterial(
      {MaterialKind::kCarGlass, Vec3(0.015F, 0.018F, 0.02F), Vec3::Ones(), seed});
  const std::uint16_t rubber = builder.SetMaterial(
      {MaterialKind::kRubber, Vec3(0.018F, 0.018F, 0.018F), Vec3::Ones(), seed});
  const std::uint16_t rim =
      builder.SetMaterial({MaterialKind::kMetal, Vec3(0.42F, 0.43F, 0.44F), Vec3::Ones(), seed});
  const std::uint16_t dark = builder.SetMaterial(
      {MaterialKind::kRubber, Vec3(0.008F, 0.008F, 0.008F), Vec3::Ones(), seed});
  CarBody skin(body, paint, glass, builder);
  constexpr int kStations = 44;
  for (int i = 0; i < kStations; ++i) {
    skin.Skin(static_cast<float>(i) / kStations, static_cast<float>(i + 1) / kStations, crushed,
              seed);
  }
  skin.Cap(0, crushed, seed);
  skin.Cap(1, crushed, seed);
  builder.UseMaterial(dark);
  builder.SetOpenness(0.2F);
  builder.AddBox({-0.47F * body.length, -0.8F * body.half_width, 0.2F},
                 {0.44F * body.length, 0.8F * body.half_width, 0.3F});
  builder.SetOpenness(1);
  for (const float side : {-1.0F, 1.0F}) {
    for (const float share : {body.rear_wheel, body.front_wheel}) {
      AddWheel({(share - 0.5F) * body.length, side * (body.half_width + 0.0F), 0.31F}, side,
               builder, rubber, rim, dark);
    }
    builder.UseMaterial(paint);
    builder.AddEllipsoid({0.16F * body.length, side * (body.half_width + 0.09F), body.belt + 0.07F},
                         {0.06F, 0.10F, 0.065F}, 8);
  }
  AddCarLights(body, crushed, builder);
  return body.length;
}

}  // namespace livemap::simulation
