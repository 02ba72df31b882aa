#include "simulation/objects/hazard_shapes.h"

#include <cmath>

#include "simulation/objects/car.h"

namespace livemap::simulation {
namespace {

const Vec3 kOrange(0.78F, 0.115F, 0.015F);
const Vec3 kWhite(0.72F, 0.72F, 0.70F);
const Vec3 kRed(0.55F, 0.025F, 0.02F);
const Vec3 kBlack(0.02F, 0.02F, 0.02F);

Material PlainHazardMaterial(const Vec3& colour) {
  return {MaterialKind::kPlain, colour, Vec3::Ones(), 0};
}
Material HazardMetal(const Vec3& colour) { return {MaterialKind::kMetal, colour, Vec3::Ones(), 0}; }

Eigen::Affine3f TurnedHazardShape(float angle, const Vec3& place) {
  return Eigen::Translation3f(place) * Eigen::AngleAxisf(angle, Vec3::UnitZ());
}

}  // namespace

void AddTrafficCone(CounterRandom& random, MeshBuilder& builder) {
  const float scale = random.Uniform(0.85F, 1.15F);
  const Eigen::Affine3f frame = builder.frame();
  builder.SetFrame(frame * Eigen::AngleAxisf(random.Uniform(0.0F, 1.5F), Vec3::UnitZ()) *
                   Eigen::Scaling(scale));
  builder.SetMaterial({MaterialKind::kPlain,
                       random.Chance(0.6) ? Vec3(0.025F, 0.025F, 0.027F) : Vec3(0.5F, 0.09F, 0.02F),
                       Vec3::Ones(), 0});
  builder.AddBox({-0.19F, -0.19F, 0}, {0.19F, 0.19F, 0.035F});
  builder.SetMaterial({MaterialKind::kCone, kOrange, kWhite, random.Bits32()});
  std::vector<Vec2> profile = {{0.15F, 0.035F}, {0.135F, 0.05F}, {0.125F, 0.1F}};
  profile.push_back({0.032F, 0.735F});
  profile.push_back({0.028F, 0.75F});
  profile.push_back({0.0F, 0.752F});
  builder.AddLathe(profile, 24);
  builder.SetFrame(frame);
}

void AddWorkSign(CounterRandom& random, MeshBuilder& builder) {
  const double kind = random.Uniform(0.0, 1.0);
  builder.SetMaterial(HazardMetal(Vec3(0.20F, 0.21F, 0.22F)));
  builder.AddTube({0.03F, 0, 0.05F}, {0.03F, 0, 1.1F}, 0.025F, 0.025F, 8);
  builder.SetMaterial(PlainHazardMaterial(Vec3(0.04F, 0.04F, 0.04F)));
  builder.AddBox({-0.25F, -0.35F, 0}, {0.35F, 0.35F, 0.09F});
  const float middle = 1.2F;
  const float half = 0.46F;
  if (kind < 0.45) {
    const float base = 0.75F;
    builder.SetMaterial({MaterialKind::kWorkSign, kWhite, kRed, random.Bits32()});
    const std::uint32_t first = builder.AddVertex({0, half, base}, -Vec3::UnitX(), {0, 0});
    builder.AddVertex({0, -half, base}, -Vec3::UnitX(), {1, 0});
    builder.AddVertex({0, 0, base + 0.80F}, -Vec3::UnitX(), {0.5F, 0.87F});
    builder.AddTriangle(first, first + 1, first + 2);
  } else if (kind < 0.75) {
    builder.SetMaterial(
        {MaterialKind::kDiamondSign, Vec3(0.75F, 0.24F, 0.02F), kBlack, random.Bits32()});
    const float r = 0.58F;
    builder.AddQuad({0, 0, middle - r}, {0, -r, middle}, {0, 0, middle + r}, {0, r, middle}, {0, 0},
                    {1, 1});
  } else {
    builder.SetMaterial({MaterialKind::kClosedSign, kWhite, kRed, random.Bits32()});
    builder.AddDisc({0, 0, middle}, -Vec3::UnitX(), 0.38F, 28);
  }
}

void AddBarrier(CounterRandom& random, MeshBuilder& builder) {
  builder.SetMaterial(HazardMetal(Vec3(0.25F, 0.26F, 0.27F)));
  for (const float y : {-0.75F, 0.75F}) {
    builder.AddTube({0.02F, y, 0}, {0.02F, y, 1.05F}, 0.025F, 0.025F, 6);
    builder.AddBox({-0.4F, y - 0.06F, 0}, {0.4F, y + 0.06F, 0.07F});
  }
  builder.SetMaterial({MaterialKind::kStripes, kWhite, kRed, random.Bits32()});
  builder.AddBox({-0.02F, -0.9F, 0.78F}, {0, 0.9F, 1.03F});
  if (random.Chance(0.7)) builder.AddBox({-0.02F, -0.9F, 0.3F}, {0, 0.9F, 0.48F});
  builder.SetMaterial({MaterialKind::kLight, Vec3(1.0F, 0.42F, 0.05F), Vec3::Ones(), 0});
  for (const float y : {-0.75F, 0.75F}) {
    builder.AddEllipsoid({0, y, 1.14F}, {0.06F, 0.09F, 0.1F}, 10);
  }
}

void AddDebris(CounterRandom& random, MeshBuilder& builder) {
  const int kind = random.Index(4);
  if (kind == 0) {
    for (int stone = 0; stone < 9; ++stone) {
      const float r = random.Uniform(0.05F, 0.2F);
      builder.SetMaterial(
          {MaterialKind::kConcrete, Vec3(0.28F, 0.25F, 0.22F), Vec3::Ones(), random.Bits32()});
      builder.AddEllipsoid({random.Uniform(-0.5F, 0.5F), random.Uniform(-0.6F, 0.6F), 0.4F * r},
                           {r, r * random.Uniform(0.6F, 1.0F), r * random.Uniform(0.5F, 0.8F)}, 6);
    }
  } else if (kind == 1) {
    const Eigen::Affine3f frame = builder.frame();
    for (int plank = 0; plank < 4; ++plank) {
      builder.SetMaterial(
          {MaterialKind::kWood, Vec3(0.38F, 0.25F, 0.13F), Vec3::Ones(), random.Bits32()});
      const float length = random.Uniform(0.5F, 0.9F);
      builder.SetFrame(frame *
                       TurnedHazardShape(random.Uniform(0.0F, 3.1F),
                                         {random.Uniform(-0.2F, 0.2F), random.Uniform(-0.3F, 0.3F),
                                          0.035F * static_cast<float>(plank)}));
      builder.AddBox({-0.06F, -length, 0}, {0.06F, length, 0.035F});
    }
    builder.SetFrame(frame);
  } else if (kind == 2) {
    builder.SetMaterial({MaterialKind::kRubber, Vec3(0.02F, 0.02F, 0.021F), Vec3::Ones(), 0});
    builder.AddLathe({{0.2F, 0.03F},
                      {0.29F, 0},
                      {0.33F, 0.05F},
                      {0.33F, 0.15F},
                      {0.29F, 0.2F},
                      {0.2F, 0.17F},
                      {0.19F, 0.03F}},
                     26);
  } else {
    builder.SetMaterial(
        {MaterialKind::kWood, Vec3(0.36F, 0.25F, 0.15F), Vec3::Ones(), random.Bits32()});
    builder.AddBox({-0.28F, -0.36F, 0}, {0.28F, 0.36F, 0.42F});
    builder.AddQuad({-0.28F, -0.36F, 0.42F}, {0.28F, -0.36F, 0.42F}, {0.28F, -0.6F, 0.52F},
                    {-0.28F, -0.6F, 0.52F}, {0, 0}, {0.5F, 0.3F});
  }
}

void AddDeer(CounterRandom& random, MeshBuilder& builder) {
  const Vec3 fur = Vec3(0.24F, 0.135F, 0.07F) * random.Uniform(0.8F, 1.15F);
  const Eigen::Affine3f frame = builder.frame();
  builder.SetFrame(frame * Eigen::AngleAxisf(random.Chance(0.5) ? 1.57F : -1.57F, Vec3::UnitZ()) *
                   Eigen::AngleAxisf(random.Uniform(-0.5F, 0.5F), Vec3::UnitZ()));
  builder.SetMaterial({MaterialKind::kFur, fur, fur * 1.9F, random.Bits32()});
  builder.AddEllipsoid({0, 0, 0.95F}, {0.52F, 0.19F, 0.25F}, 16);
  builder.AddEllipsoid({0.34F, 0, 0.98F}, {0.26F, 0.18F, 0.27F}, 14);
  builder.AddEllipsoid({-0.36F, 0, 0.98F}, {0.25F, 0.18F, 0.25F}, 14);
  builder.AddTube({0.42F, 0, 1.02F}, {0.68F, 0, 1.36F}, 0.16F, 0.09F, 12);
  builder.AddEllipsoid({0.76F, 0, 1.41F}, {0.16F, 0.085F, 0.095F}, 12);
  builder.AddTube({0.83F, 0, 1.39F}, {0.97F, 0, 1.33F}, 0.065F, 0.04F, 10);
  for (const float side : {-1.0F, 1.0F}) {
    builder.AddEllipsoid({0.67F, side * 0.12F, 1.51F}, {0.04F, 0.10F, 0.05F}, 8);
    for (const float x : {0.36F, -0.38F}) {
      const float swing = random.Uniform(-0.12F, 0.12F);
      const Vec3 knee(x + 0.4F * swing - (x < 0 ? 0.06F : 0.0F), side * 0.10F, 0.48F);
      builder.AddTube({x, side * 0.10F, 0.92F}, knee, 0.10F, 0.048F, 9);
      builder.AddTube(knee, {x + swing, side * 0.10F, 0.06F}, 0.042F, 0.028F, 8);
    }
  }
  builder.SetMaterial(PlainHazardMaterial(Vec3(0.62F, 0.58F, 0.50F)));
  builder.AddEllipsoid({-0.58F, 0, 1.0F}, {0.05F, 0.07F, 0.12F}, 8);
  builder.SetMaterial(PlainHazardMaterial(kBlack));
  builder.AddEllipsoid({0.98F, 0, 1.325F}, {0.025F, 0.03F, 0.025F}, 6);
  for (const float side : {-1.0F, 1.0F}) {
    builder.AddEllipsoid({0.81F, side * 0.078F, 1.44F}, {0.02F, 0.012F, 0.02F}, 6);
    for (const float x : {0.36F, -0.38F}) {
      builder.AddTube({x, side * 0.10F, 0}, {x, side * 0.10F, 0.07F}, 0.035F, 0.03F, 6);
    }
  }
  if (random.Chance(0.55)) {
    builder.SetMaterial(PlainHazardMaterial(Vec3(0.16F, 0.11F, 0.07F)));
    for (const float side : {-1.0F, 1.0F}) {
      const Vec3 fork(0.59F, side * 0.22F, 1.75F);
      builder.AddTube({0.69F, side * 0.05F, 1.49F}, fork, 0.022F, 0.017F, 6);
      builder.AddTube(fork, {0.71F, side * 0.30F, 1.99F}, 0.016F, 0.006F, 5);
      builder.AddTube(fork, {0.49F, side * 0.27F, 1.92F}, 0.014F, 0.006F, 5);
      builder.AddTube({0.64F, side * 0.13F, 1.62F}, {0.83F, side * 0.16F, 1.75F}, 0.014F, 0.005F,
                      5);
    }
  }
  builder.SetFrame(frame);
}

void AddExcavator(CounterRandom& random, MeshBuilder& builder) {
  const Vec3 yellow = Vec3(0.62F, 0.36F, 0.025F) * random.Uniform(0.85F, 1.1F);
  const Vec3 dark(0.03F, 0.03F, 0.032F);
  for (const float side : {-1.0F, 1.0F}) {
    builder.SetMaterial({MaterialKind::kRubber, dark, Vec3::Ones(), 1});
    builder.AddBox({-1.3F, side * 0.95F - 0.24F, 0.2F}, {1.3F, side * 0.95F + 0.24F, 0.62F});
    for (const float x : {-1.3F, 1.3F}) {
      builder.AddTube({x, side * 0.95F - 0.24F, 0.41F}, {x, side * 0.95F + 0.24F, 0.41F}, 0.37F,
                      0.37F, 16);
      builder.AddDisc({x, side * 1.19F, 0.41F}, {0, side, 0}, 0.37F, 16);
    }
    builder.AddBox({-1.3F, side * 0.95F - 0.24F, 0.04F}, {1.3F, side * 0.95F + 0.24F, 0.78F});
    builder.SetMaterial(HazardMetal(Vec3(0.16F, 0.13F, 0.10F)));
    for (float x = -1.4F; x < 1.45F; x += 0.2F) {
      builder.AddBox({x, side * 0.95F - 0.27F, 0.77F}, {x + 0.09F, side * 0.95F + 0.27F, 0.81F});
    }
  }
  const Eigen::Affine3f frame = builder.frame();
  builder.SetFrame(frame * Eigen::AngleAxisf(random.Uniform(-0.7F, 0.7F), Vec3::UnitZ()));
  builder.SetMaterial(PlainHazardMaterial(dark));
  builder.AddBox({-0.6F, -0.6F, 0.7F}, {0.6F, 0.6F, 0.95F});
  builder.SetMaterial({MaterialKind::kCarPaint, yellow, Vec3::Ones(), random.Bits32()});
  builder.AddBox({-1.7F, -1.15F, 0.95F}, {0.9F, 1.15F, 1.35F});
  builder.AddBox({-1.75F, -1.15F, 1.35F}, {-0.3F, 1.15F, 1.95F});
  builder.AddBox({-0.3F, -1.15F, 1.35F}, {0.9F, -0.2F, 1.7F});
  builder.AddBox({-0.3F, 0.18F, 2.72F}, {0.98F, 1.15F, 2.82F});
  for (const float x : {-0.28F, 0.86F}) {
    for (const float y : {0.2F, 1.1F}) builder.AddBox({x, y, 1.35F}, {x + 0.07F, y + 0.05F, 2.75F});
  }
  builder.SetMaterial({MaterialKind::kCarGlass, Vec3(0.02F, 0.025F, 0.03F), Vec3::Ones(), 0});
  builder.AddBox({-0.26F, 0.22F, 1.4F}, {0.9F, 1.13F, 2.72F});
  builder.SetMaterial({MaterialKind::kCarPaint, yellow, Vec3::Ones(), 7});
  const float lift = random.Uniform(-0.3F, 0.5F);
  const Vec3 elbow(2.7F, -0.2F, 3.3F + lift);
  const Vec3 wrist(3.9F, -0.2F, 1.5F + lift);
  builder.AddTube({0.7F, -0.2F, 1.5F}, {1.6F, -0.2F, 3.0F + 0.8F * lift}, 0.24F, 0.24F, 4);
  builder.AddTube({1.6F, -0.2F, 3.0F + 0.8F * lift}, elbow, 0.24F, 0.18F, 4);
  builder.AddTube(elbow - Vec3(0.3F, 0, -0.35F), wrist, 0.2F, 0.13F, 4);
  builder.SetMaterial(HazardMetal(Vec3(0.3F, 0.3F, 0.3F)));
  builder.AddTube({1.0F, -0.2F, 1.45F}, {1.9F, -0.2F, 2.9F + 0.8F * lift}, 0.07F, 0.05F, 8);
  builder.AddTube({1.7F, -0.2F, 3.4F + 0.8F * lift}, elbow + Vec3(-0.2F, 0, 0.3F), 0.06F, 0.05F, 8);
  builder.SetMaterial(HazardMetal(Vec3(0.10F, 0.09F, 0.08F)));
  builder.AddTube(wrist + Vec3(-0.25F, -0.5F, -0.25F), wrist + Vec3(-0.25F, 0.5F, -0.25F), 0.38F,
                  0.38F, 12);
  builder.AddBox(wrist + Vec3(-0.75F, -0.5F, -0.7F), wrist + Vec3(-0.15F, 0.5F, -0.4F));
  builder.SetFrame(frame);
}

void AddAccident(CounterRandom& random, MeshBuilder& builder) {
  const Eigen::Affine3f frame = builder.frame();
  builder.SetFrame(frame * TurnedHazardShape(random.Uniform(0.2F, 0.5F), {-1.9F, 0.1F, 0}));
  AddCar(random, random.Uniform(0.7F, 1.0F), builder);
  builder.SetFrame(frame *
                   TurnedHazardShape(3.14F + random.Uniform(-0.9F, -0.4F), {2.0F, 0.5F, 0}));
  AddCar(random, random.Uniform(0.7F, 1.0F), builder);
  for (int part = 0; part < 24; ++part) {
    const float r = random.Uniform(0.02F, 0.11F);
    builder.SetMaterial(PlainHazardMaterial(random.Chance(0.5) ? Vec3(0.03F, 0.03F, 0.03F)
                                                               : Vec3(0.42F, 0.43F, 0.44F)));
    builder.SetFrame(
        frame * TurnedHazardShape(random.Uniform(0.0F, 6.0F),
                                  {random.Uniform(-2.4F, 1.6F), random.Uniform(-1.7F, 1.3F), 0}));
    builder.AddBox({-r, -0.6F * r, 0}, {r, 0.6F * r, 0.35F * r});
  }
  builder.SetFrame(frame);
}

}  // namespace livemap::simulation
