#include "simulation/objects/furniture.h"

#include <cmath>

namespace livemap::simulation {

float AddLampPost(MeshBuilder& builder) {
  constexpr float kHeightM = 6.4F;
  builder.SetMaterial({MaterialKind::kMetal, Vec3(0.11F, 0.12F, 0.12F), Vec3::Ones(), 0});
  builder.AddTube({0, 0, 0}, {0, 0, 1.1F}, 0.10F, 0.09F, 10);
  builder.AddTube({0, 0, 1.1F}, {0, 0, kHeightM - 0.5F}, 0.065F, 0.045F, 8);
  builder.AddTube({0, 0, kHeightM - 0.5F}, {0, -0.45F, kHeightM}, 0.042F, 0.035F, 6);
  builder.AddTube({0, -0.45F, kHeightM}, {0, kLampReachM, kHeightM + 0.06F}, 0.035F, 0.03F, 6);
  builder.AddBox({-0.12F, kLampReachM - 0.3F, kHeightM + 0.01F},
                 {0.12F, kLampReachM + 0.3F, kHeightM + 0.12F});
  builder.SetMaterial({MaterialKind::kLight, Vec3(1.0F, 0.72F, 0.40F), Vec3::Ones(), 0});
  builder.AddBox({-0.09F, kLampReachM - 0.25F, kHeightM - 0.03F},
                 {0.09F, kLampReachM + 0.25F, kHeightM + 0.01F});
  return kHeightM;
}

void AddTrafficSign(CounterRandom& random, MeshBuilder& builder) {
  builder.SetMaterial({MaterialKind::kMetal, Vec3(0.33F, 0.34F, 0.35F), Vec3::Ones(), 0});
  builder.AddTube({0, 0, 0}, {0, 0, 2.75F}, 0.03F, 0.03F, 8);
  builder.AddDisc({-0.036F, 0, 2.45F}, Vec3::UnitX(), 0.31F, 20);
  builder.SetMaterial(
      {MaterialKind::kTrafficSign, Vec3(0.6F, 0.6F, 0.6F), Vec3::Ones(), random.Bits32()});
  builder.AddDisc({-0.045F, 0, 2.45F}, -Vec3::UnitX(), 0.31F, 20);
}

void AddFence(float length_m, CounterRandom& random, MeshBuilder& builder) {
  const bool wood = random.Chance(0.5);
  const float height = wood ? random.Uniform(0.9F, 1.3F) : random.Uniform(0.95F, 1.15F);
  const Vec3 colour =
      wood ? (random.Chance(0.4) ? Vec3(0.58F, 0.57F, 0.54F) : Vec3(0.20F, 0.13F, 0.08F))
           : Vec3(0.035F, 0.045F, 0.04F);
  builder.SetMaterial(
      {wood ? MaterialKind::kWood : MaterialKind::kMetal, colour, Vec3::Ones(), random.Bits32()});
  const float pitch = wood ? 0.14F : 0.13F;
  const float half = wood ? 0.045F : 0.011F;
  for (float x = 0.5F * pitch; x < length_m; x += pitch) {
    const float top = height + (wood ? 0.02F * std::sin(12 * x) : 0.0F);
    builder.AddBox({x - half, -0.011F, 0.06F}, {x + half, 0.011F, top});
  }
  for (const float z : {0.2F, height - 0.12F}) {
    builder.AddBox({0, 0.011F, z - 0.03F}, {length_m, 0.045F, z + 0.03F});
  }
  for (float x = 0; x <= length_m; x += 2.4F) {
    builder.AddBox({x - 0.05F, -0.03F, 0}, {x + 0.05F, 0.07F, height + 0.1F});
  }
}

void AddBin(CounterRandom& random, MeshBuilder& builder) {
  const Vec3 colours[] = {Vec3(0.02F, 0.06F, 0.03F), Vec3(0.03F, 0.03F, 0.035F),
                          Vec3(0.03F, 0.05F, 0.16F), Vec3(0.30F, 0.24F, 0.03F)};
  builder.SetMaterial(
      {MaterialKind::kPlain, colours[random.Index(4)], Vec3::Ones(), random.Bits32()});
  const float h = 1.02F;
  const Vec3 low[] = {{-0.22F, -0.26F, 0.06F},
                      {0.22F, -0.26F, 0.06F},
                      {0.22F, 0.26F, 0.06F},
                      {-0.22F, 0.26F, 0.06F}};
  const Vec3 high[] = {
      {-0.29F, -0.34F, h}, {0.29F, -0.34F, h}, {0.29F, 0.36F, h}, {-0.29F, 0.36F, h}};
  for (int i = 0; i < 4; ++i) {
    const int next = (i + 1) % 4;
    builder.AddQuad(low[i], low[next], high[next], high[i], {0, 0}, {0.5F, 1});
  }
  builder.AddBox({-0.31F, -0.37F, h}, {0.31F, 0.38F, h + 0.06F});
  builder.AddBox({-0.25F, 0.34F, h - 0.1F}, {0.25F, 0.42F, h - 0.03F});
  builder.SetMaterial({MaterialKind::kRubber, Vec3(0.015F, 0.015F, 0.015F), Vec3::Ones(), 0});
  for (const float x : {-0.24F, 0.24F}) {
    builder.AddTube({x - 0.03F, 0.27F, 0.1F}, {x + 0.03F, 0.27F, 0.1F}, 0.1F, 0.1F, 10);
  }
}

void AddRubbishBags(CounterRandom& random, MeshBuilder& builder) {
  for (int bag = 0; bag < 3; ++bag) {
    const float r = random.Uniform(0.22F, 0.34F);
    const Vec3 colour = random.Chance(0.7) ? Vec3(0.02F, 0.02F, 0.022F) : Vec3(0.10F, 0.22F, 0.40F);
    builder.SetMaterial({MaterialKind::kCarGlass, colour, Vec3::Ones(), random.Bits32()});
    const Vec3 centre(0.45F * static_cast<float>(bag) - 0.4F, random.Uniform(-0.2F, 0.2F),
                      0.8F * r);
    builder.AddEllipsoid(centre, {r, 0.9F * r, 0.85F * r}, 12);
    builder.AddTube(centre + Vec3(0, 0, 0.75F * r), centre + Vec3(0.03F, 0, 1.15F * r), 0.09F,
                    0.03F, 6);
  }
}

void AddPerson(CounterRandom& random, MeshBuilder& builder) {
  const auto cloth = [&](float dark) -> Vec3 {
    return Vec3(random.Uniform(0.02F, 0.4F), random.Uniform(0.02F, 0.35F),
                random.Uniform(0.02F, 0.4F)) *
           dark;
  };
  const float stride = random.Uniform(0.05F, 0.32F);
  builder.SetMaterial({MaterialKind::kPlain, cloth(0.4F), Vec3::Ones(), 0});
  for (const float side : {-1.0F, 1.0F}) {
    const Vec3 knee(0.3F * side * stride + 0.05F, 0.09F * side, 0.48F);
    builder.AddTube({0, 0.08F * side, 0.92F}, knee, 0.095F, 0.07F, 8);
    builder.AddTube(knee, {side * stride, 0.09F * side, 0.06F}, 0.07F, 0.05F, 8);
    builder.AddBox({side * stride - 0.09F, 0.09F * side - 0.05F, 0},
                   {side * stride + 0.17F, 0.09F * side + 0.05F, 0.09F});
  }
  builder.SetMaterial({MaterialKind::kPlain, cloth(1.0F), Vec3::Ones(), 0});
  builder.AddEllipsoid({0, 0, 1.17F}, {0.14F, 0.22F, 0.34F}, 12);
  for (const float side : {-1.0F, 1.0F}) {
    const Vec3 elbow(-0.3F * side * stride, 0.27F * side, 1.12F);
    builder.AddTube({0, 0.2F * side, 1.4F}, elbow, 0.06F, 0.05F, 7);
    builder.AddTube(elbow, {-0.8F * side * stride + 0.08F, 0.27F * side, 0.87F}, 0.05F, 0.035F, 7);
  }
  const float tone = random.Uniform(0.12F, 0.45F);
  builder.SetMaterial(
      {MaterialKind::kPlain, Vec3(tone, 0.68F * tone, 0.52F * tone), Vec3::Ones(), 0});
  builder.AddTube({0, 0, 1.42F}, {0.01F, 0, 1.56F}, 0.055F, 0.055F, 8);
  builder.AddEllipsoid({0.02F, 0, 1.64F}, {0.10F, 0.08F, 0.125F}, 12);
  builder.SetMaterial({MaterialKind::kPlain, Vec3(0.05F, 0.03F, 0.02F), Vec3::Ones(), 0});
  builder.AddEllipsoid({-0.015F, 0, 1.675F}, {0.105F, 0.088F, 0.11F}, 12);
}

namespace {

void AddBench(CounterRandom& random, MeshBuilder& builder) {
  builder.SetMaterial({MaterialKind::kMetal, Vec3(0.06F, 0.06F, 0.065F), Vec3::Ones(), 0});
  for (const float x : {-0.72F, 0.72F}) {
    builder.AddBox({x - 0.03F, -0.22F, 0}, {x + 0.03F, -0.16F, 0.44F});
    builder.AddBox({x - 0.03F, -0.22F, 0.4F}, {x + 0.03F, 0.24F, 0.44F});
    builder.AddTube({x, 0.2F, 0}, {x, 0.3F, 0.9F}, 0.03F, 0.03F, 6);
  }
  builder.SetMaterial(
      {MaterialKind::kWood, Vec3(0.24F, 0.14F, 0.07F), Vec3::Ones(), random.Bits32()});
  for (int slat = 0; slat < 4; ++slat) {
    const float y = -0.24F + 0.115F * static_cast<float>(slat);
    builder.AddBox({-0.85F, y, 0.44F}, {0.85F, y + 0.09F, 0.475F});
  }
  for (int slat = 0; slat < 3; ++slat) {
    const float z = 0.55F + 0.125F * static_cast<float>(slat);
    const float y = 0.2F + 0.1F * z / 0.9F;
    builder.AddBox({-0.85F, y - 0.03F, z}, {0.85F, y, z + 0.095F});
  }
}

void AddPlanter(CounterRandom& random, MeshBuilder& builder) {
  builder.SetMaterial(
      {MaterialKind::kConcrete, Vec3(0.36F, 0.35F, 0.33F), Vec3::Ones(), random.Bits32()});
  builder.AddBox({-0.62F, -0.27F, 0.04F}, {0.62F, 0.27F, 0.46F});
  builder.AddBox({-0.66F, -0.31F, 0.46F}, {0.66F, 0.31F, 0.54F});
  builder.AddBox({-0.55F, -0.2F, 0}, {0.55F, 0.2F, 0.04F});
  const Vec3 green(0.045F, 0.10F, 0.035F);
  builder.SetMaterial({MaterialKind::kHedge, green, green * 0.5F, random.Bits32()});
  for (int bush = 0; bush < 4; ++bush) {
    const float r = random.Uniform(0.2F, 0.28F);
    builder.AddEllipsoid(
        {0.32F * static_cast<float>(bush) - 0.48F, random.Uniform(-0.05F, 0.05F), 0.56F + 0.5F * r},
        {r, r, 1.1F * r}, 9);
  }
}

void AddPostBox(CounterRandom& random, MeshBuilder& builder) {
  const Vec3 colour = random.Chance(0.6) ? Vec3(0.78F, 0.50F, 0.01F) : Vec3(0.50F, 0.025F, 0.02F);
  builder.SetMaterial({MaterialKind::kMetal, Vec3(0.10F, 0.10F, 0.11F), Vec3::Ones(), 0});
  builder.AddTube({0, 0, 0}, {0, 0, 0.62F}, 0.06F, 0.06F, 10);
  builder.SetMaterial({MaterialKind::kMetal, colour, Vec3::Ones(), 0});
  builder.AddBox({-0.28F, -0.2F, 0.6F}, {0.28F, 0.2F, 1.28F});
  builder.AddBox({-0.3F, -0.22F, 1.28F}, {0.3F, 0.22F, 1.34F});
  builder.SetMaterial({MaterialKind::kPlain, Vec3(0.02F, 0.02F, 0.02F), Vec3::Ones(), 0});
  builder.AddBox({-0.2F, -0.204F, 1.14F}, {0.2F, -0.2F, 1.19F});
  builder.SetMaterial({MaterialKind::kPlain, Vec3(0.7F, 0.7F, 0.68F), Vec3::Ones(), 0});
  builder.AddBox({-0.13F, -0.203F, 0.82F}, {0.13F, -0.2F, 1.02F});
}

/// Tyre, rim and spokes in the plane y = 0 about `hub`.
void AddBicycleWheel(const Vec3& hub, MeshBuilder& builder) {
  constexpr int kPieces = 20;
  constexpr float kRadiusM = 0.33F;
  const auto rim = [&](int piece, float radius) {
    const float angle = 6.2831853F * static_cast<float>(piece) / kPieces;
    return Vec3(hub + radius * Vec3(std::cos(angle), 0, std::sin(angle)));
  };
  builder.SetMaterial({MaterialKind::kRubber, Vec3(0.015F, 0.015F, 0.015F), Vec3::Ones(), 0});
  for (int piece = 0; piece < kPieces; ++piece) {
    builder.AddTube(rim(piece, kRadiusM), rim(piece + 1, kRadiusM), 0.022F, 0.022F, 6);
  }
  builder.SetMaterial({MaterialKind::kMetal, Vec3(0.45F, 0.46F, 0.47F), Vec3::Ones(), 0});
  for (int piece = 0; piece < kPieces; ++piece) {
    builder.AddTube(rim(piece, 0.305F), rim(piece + 1, 0.305F), 0.01F, 0.01F, 4);
    if (piece % 2 == 0) builder.AddTube(hub, rim(piece, 0.3F), 0.003F, 0.003F, 3);
  }
  builder.AddTube(hub - Vec3(0, 0.05F, 0), hub + Vec3(0, 0.05F, 0), 0.025F, 0.025F, 8);
}

void AddBicycleFrame(CounterRandom& random, MeshBuilder& builder) {
  const Vec3 colours[] = {Vec3(0.03F, 0.03F, 0.035F), Vec3(0.35F, 0.02F, 0.02F),
                          Vec3(0.02F, 0.08F, 0.28F), Vec3(0.50F, 0.50F, 0.48F),
                          Vec3(0.03F, 0.18F, 0.09F)};
  builder.SetMaterial({MaterialKind::kMetal, colours[random.Index(5)], Vec3::Ones(), 0});
  const Vec3 rear(-0.5F, 0, 0.35F);
  const Vec3 front(0.54F, 0, 0.35F);
  const Vec3 pedals(-0.06F, 0, 0.29F);
  const Vec3 saddle(-0.22F, 0, 0.82F);
  const Vec3 neck(0.34F, 0, 0.84F);
  builder.AddTube(pedals, saddle, 0.017F, 0.017F, 7);
  builder.AddTube(pedals, neck - Vec3(-0.02F, 0, 0.08F), 0.02F, 0.02F, 7);
  builder.AddTube(saddle - Vec3(0, 0, 0.07F), neck, 0.017F, 0.017F, 7);
  for (const float y : {-0.04F, 0.04F}) {
    const Vec3 beside(0, y, 0);
    builder.AddTube(pedals + beside, rear + beside, 0.011F, 0.011F, 5);
    builder.AddTube(saddle - Vec3(0, 0, 0.07F), rear + beside, 0.01F, 0.01F, 5);
    builder.AddTube(neck - Vec3(-0.03F, 0, 0.1F) + beside, front + beside, 0.012F, 0.012F, 5);
  }
  builder.SetMaterial({MaterialKind::kMetal, Vec3(0.12F, 0.12F, 0.13F), Vec3::Ones(), 0});
  builder.AddTube(neck, neck + Vec3(-0.03F, 0, 0.16F), 0.014F, 0.014F, 6);
  const Vec3 bar = neck + Vec3(-0.03F, 0, 0.16F);
  builder.AddTube(bar - Vec3(0, 0.29F, 0), bar + Vec3(0, 0.29F, 0), 0.013F, 0.013F, 6);
  builder.AddTube(saddle, saddle + Vec3(-0.03F, 0, 0.12F), 0.013F, 0.013F, 6);
  builder.AddEllipsoid(saddle + Vec3(-0.03F, 0, 0.14F), {0.14F, 0.08F, 0.035F}, 9);
  builder.AddDisc(pedals - Vec3(0, 0.05F, 0), -Vec3::UnitY(), 0.1F, 16);
  builder.AddDisc(pedals + Vec3(0, 0.05F, 0), Vec3::UnitY(), 0.1F, 16);
  builder.AddBox(pedals + Vec3(0.12F, -0.17F, -0.01F), pedals + Vec3(0.2F, -0.07F, 0.015F));
  builder.AddBox(pedals + Vec3(-0.2F, 0.07F, -0.01F), pedals + Vec3(-0.12F, 0.17F, 0.015F));
  for (const Vec3& hub : {rear, front}) AddBicycleWheel(hub, builder);
}

}  // namespace

void AddOtherObject(CounterRandom& random, MeshBuilder& builder) {
  switch (random.Index(3)) {
    case 0:
      AddBench(random, builder);
      break;
    case 1:
      AddPlanter(random, builder);
      break;
    default:
      AddPostBox(random, builder);
  }
}

void AddBicycle(CounterRandom& random, MeshBuilder& builder) {
  // A hoop to lock it to.
  builder.SetMaterial({MaterialKind::kMetal, Vec3(0.30F, 0.31F, 0.32F), Vec3::Ones(), 0});
  for (const float x : {-0.32F, 0.32F}) {
    builder.AddTube({x, 0.14F, 0}, {x, 0.14F, 0.72F}, 0.022F, 0.022F, 8);
    builder.AddTube({x, 0.14F, 0.72F}, {0.6F * x, 0.14F, 0.82F}, 0.022F, 0.022F, 8);
  }
  builder.AddTube({-0.192F, 0.14F, 0.82F}, {0.192F, 0.14F, 0.82F}, 0.022F, 0.022F, 8);
  const Eigen::Affine3f frame = builder.frame();
  builder.SetFrame(frame *
                   Eigen::AngleAxisf(random.Chance(0.5) ? 0.0F : 3.14159265F, Vec3::UnitZ()) *
                   Eigen::AngleAxisf(random.Uniform(-0.04F, 0.04F), Vec3::UnitX()));
  AddBicycleFrame(random, builder);
  builder.SetFrame(frame);
}

}  // namespace livemap::simulation
