#include "simulation/objects/plant.h"

#include <cmath>
#include <vector>

namespace livemap::simulation {
namespace {

Vec3 PlantDirection(CounterRandom& random) {
  const float z = random.Uniform(-1.0F, 1.0F);
  const float angle = random.Uniform(0.0F, 6.2831853F);
  const float r = std::sqrt(std::max(0.0F, 1 - z * z));
  return {r * std::cos(angle), r * std::sin(angle), z};
}

/// A pointed leaf or spray of leaves, its normal bent to the crown's outside for soft shading.
void AddPlantLeaf(const Vec3& place, const Vec3& outward, float length, CounterRandom& random,
                  MeshBuilder& builder) {
  const Vec3 along = PlantDirection(random) * (0.5F * length);
  const Vec3 across = along.cross(PlantDirection(random)).normalized() * (0.26F * length);
  const Vec3 normal = outward + 0.55F * PlantDirection(random);
  const std::uint32_t first = builder.AddVertex(place - along, normal, {0, 0});
  builder.AddVertex(place + across, normal, {1, 0});
  builder.AddVertex(place + along, normal, {1, 1});
  builder.AddVertex(place - across, normal, {0, 1});
  builder.AddTriangle(first, first + 1, first + 2);
  builder.AddTriangle(first, first + 2, first + 3);
}

struct Limb {
  Vec3 from;
  Vec3 to;
  float radius;
  int level;
};

/// Branches of a crown, thick to thin; the tips are where leaves grow.
class PlantCrown {
 public:
  PlantCrown(float height, bool fine, CounterRandom& random, MeshBuilder& builder)
      : height_(height), fine_(fine), random_(random), builder_(builder) {}

  void Grow(const Vec3& from, const Vec3& direction, float length, float radius, int level) {
    Vec3 place = from;
    Vec3 way = direction;
    const int pieces = level == 0 ? 3 : 2;
    for (int piece = 0; piece < pieces; ++piece) {
      const Vec3 next = place + way * (length / static_cast<float>(pieces));
      const float shrink = 1 - 0.4F * static_cast<float>(piece + 1) / static_cast<float>(pieces);
      builder_.AddTube(place, next, radius * (shrink + 0.4F / static_cast<float>(pieces)),
                       radius * shrink,
                       level == 0   ? 9
                       : level == 1 ? 6
                                    : 3);
      place = next;
      way = (way + 0.22F * PlantDirection(random_) + Vec3(0, 0, 0.06F)).normalized();
    }
    const int last = fine_ ? 4 : 2;
    if (level >= last) {
      tips_.push_back(place);
      return;
    }
    const int children = level == 0 ? 6 : 3;
    for (int child = 0; child < children; ++child) {
      const float angle =
          2.4F * static_cast<float>(child) + random_.Uniform(-0.5F, 0.5F) + 1.1F * from.x();
      const Vec3 out(std::cos(angle), std::sin(angle), random_.Uniform(-0.1F, 0.9F));
      // The first child goes on upwards, so that the crown grows as high as wide.
      const bool leads = child == 0 && level < 2;
      const float bend = leads ? 0.25F : 0.9F;
      const Vec3 bent = (way * random_.Uniform(0.6F, 1.0F) + bend * out).normalized();
      const float share = level == 0 ? random_.Uniform(0.6F, 0.9F) : random_.Uniform(0.5F, 0.75F);
      Grow(place, bent, length * share, radius * 0.52F, level + 1);
    }
  }

  const std::vector<Vec3>& tips() const { return tips_; }
  float height() const { return height_; }

 private:
  float height_;
  bool fine_;
  CounterRandom& random_;
  MeshBuilder& builder_;
  std::vector<Vec3> tips_;
};

}  // namespace

void AddTree(float height_m, bool leaves, CounterRandom& random, MeshBuilder& builder) {
  const float girth = 0.022F * height_m;
  builder.SetMaterial({MaterialKind::kBark, Vec3(0.13F, 0.10F, 0.075F) * random.Uniform(0.8F, 1.4F),
                       Vec3::Ones(), random.Bits32()});
  builder.AddTube({0, 0, -0.1F}, {0, 0, 0.35F}, 1.6F * girth, 1.05F * girth, 10);
  PlantCrown crown(height_m, !leaves, random, builder);
  crown.Grow({0, 0, 0.3F}, Vec3::UnitZ(), 0.34F * height_m, 1.05F * girth, 0);
  if (!leaves) return;
  const Vec3 green(random.Uniform(0.065F, 0.13F), random.Uniform(0.15F, 0.21F),
                   random.Uniform(0.03F, 0.05F));
  builder.SetMaterial({MaterialKind::kLeaf, green, green * 0.6F, random.Bits32()});
  const Vec3 middle(0, 0, 0.66F * height_m);
  const auto count = static_cast<int>(3300.0F / static_cast<float>(crown.tips().size()));
  for (const Vec3& tip : crown.tips()) {
    const float cluster = 0.125F * height_m * random.Uniform(0.8F, 1.3F);
    for (int leaf = 0; leaf < count; ++leaf) {
      const Vec3 offset = PlantDirection(random) * cluster * std::cbrt(random.Uniform(0.05F, 1.0F));
      const Vec3 place = tip + offset.cwiseProduct(Vec3(1.15F, 1.15F, 0.8F));
      const Vec3 outward = (place - middle).normalized();
      const float depth = (place - middle).norm() / (0.36F * height_m);
      const float inside = 0.5F + 0.5F * offset.dot(outward) / cluster;
      builder.SetOpenness(Saturate(0.22F + 0.4F * depth * inside + 0.32F * inside));
      AddPlantLeaf(place, (outward + offset / cluster).normalized(),
                   0.036F * height_m * random.Uniform(0.7F, 1.3F), random, builder);
    }
  }
  builder.SetOpenness(1);
}

void AddHedge(float length_m, float height_m, bool leaves, CounterRandom& random,
              MeshBuilder& builder) {
  const Vec3 green = leaves ? Vec3(0.06F, 0.13F, 0.035F) : Vec3(0.10F, 0.08F, 0.055F);
  builder.SetMaterial({MaterialKind::kHedge, green, green * 0.5F, random.Bits32()});
  builder.AddBox({0, -0.28F, 0}, {length_m, 0.28F, height_m - 0.06F});
  builder.SetMaterial({MaterialKind::kLeaf, green, green * 0.6F, random.Bits32()});
  const auto count = static_cast<int>(length_m * (leaves ? 110.0F : 40.0F));
  for (int leaf = 0; leaf < count; ++leaf) {
    const bool top = random.Chance(0.3);
    const float side = random.Chance(0.5) ? 1.0F : -1.0F;
    const Vec3 normal = top ? Vec3::UnitZ().eval() : Vec3(0, side, 0.3F);
    const Vec3 place(random.Uniform(0.0F, length_m),
                     top ? random.Uniform(-0.3F, 0.3F) : side * random.Uniform(0.26F, 0.32F),
                     top ? height_m : random.Uniform(0.05F, height_m));
    builder.SetOpenness(0.45F + 0.55F * Saturate(place.z() / height_m));
    AddPlantLeaf(place, normal, random.Uniform(0.09F, 0.18F), random, builder);
  }
  builder.SetOpenness(1);
}

}  // namespace livemap::simulation
