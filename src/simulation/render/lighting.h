#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "simulation/objects/noise.h"

namespace livemap::simulation {

/// Hour and weather of a drive.
enum class Condition { kDay, kDusk, kRain, kSnow };

/// "day", "dusk", "rain", "snow"; none for anything else.
std::optional<Condition> ParseCondition(const std::string& name);
const char* ConditionName(Condition condition);

/// Light and air of a condition. Radiances are linear RGB, 1 about what a white wall sends in the
/// light that the exposure is made for.
struct Lighting {
  Condition condition = Condition::kDay;
  std::uint32_t seed = 0;
  Vec3 sun_direction = Vec3::UnitZ();  ///< From the ground to the sun, unit, world frame.
  Vec3 sun = Vec3::Zero();             ///< On a surface across it; zero: no sun, no shadows.
  Vec3 zenith = Vec3::Zero();
  Vec3 horizon = Vec3::Zero();
  Vec3 ambient = Vec3::Zero();  ///< From the whole sky on level ground.
  Vec3 bounce = Vec3::Zero();   ///< From the ground on what looks down.
  Vec3 haze = Vec3::Zero();
  float haze_m = 2000;             ///< Distance that dims to 1/e.
  float clouds = 0.4F;             ///< Share of the sky.
  float wetness = 0;               ///< 0 dry, 1 standing water.
  float snow = 0;                  ///< 0 none, 1 everything covered.
  Vec3 lamps = Vec3::Zero();       ///< Of street lamps, at one metre; zero: off.
  Vec3 headlights = Vec3::Zero();  ///< Of the vehicle, at one metre.
  float lit_windows = 0;           ///< Share.
  float key = 0.17F;               ///< Mean grey that the exposure control aims at.
  float exposure = 1;              ///< Start value of the camera's exposure control.
};

/// The light of a condition; sun and clouds differ between seeds.
Lighting MakeLighting(Condition condition, std::uint64_t seed);

/// What the sky sends from a direction (unit, z up), clouds and far roofs and trees included.
Vec3 SkyRadiance(const Lighting& lighting, const Vec3& direction);
/// The same without fine structure, for reflections on dull surfaces.
Vec3 SmoothSky(const Lighting& lighting, const Vec3& direction);

}  // namespace livemap::simulation
