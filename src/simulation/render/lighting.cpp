#include "simulation/render/lighting.h"

#include <cmath>

namespace livemap::simulation {
namespace {

Vec3 SunDirection(float azimuth, float elevation) {
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation)};
}

Lighting DayLighting(CounterRandom& random) {
  Lighting light;
  light.sun_direction = SunDirection(random.Uniform(0.0F, 6.2832F), random.Uniform(0.6F, 0.95F));
  light.sun = Vec3(2.55F, 2.30F, 1.95F);
  light.zenith = Vec3(0.20F, 0.40F, 0.88F);
  light.horizon = Vec3(0.78F, 0.92F, 1.12F);
  light.ambient = Vec3(0.60F, 0.67F, 0.77F);
  light.bounce = Vec3(0.30F, 0.28F, 0.25F);
  light.haze = Vec3(0.72F, 0.82F, 0.95F);
  light.haze_m = 1100;
  light.clouds = random.Uniform(0.25F, 0.6F);
  light.exposure = 0.62F;
  return light;
}

Lighting DuskLighting(CounterRandom& random) {
  Lighting light;
  light.sun_direction = SunDirection(random.Uniform(-0.9F, 0.9F), -0.03F);
  light.zenith = Vec3(0.030F, 0.062F, 0.16F);
  light.horizon = Vec3(0.30F, 0.19F, 0.17F);
  light.ambient = Vec3(0.052F, 0.066F, 0.112F);
  light.bounce = Vec3(0.03F, 0.028F, 0.03F);
  light.haze = Vec3(0.105F, 0.10F, 0.135F);
  light.haze_m = 500;
  light.clouds = random.Uniform(0.3F, 0.6F);
  light.lamps = Vec3(19.0F, 12.5F, 6.4F);
  light.headlights = Vec3(13.0F, 12.2F, 10.4F);
  light.lit_windows = 0.38F;
  light.exposure = 2.3F;
  light.key = 0.095F;
  return light;
}

Lighting RainLighting(CounterRandom& random) {
  Lighting light;
  light.zenith = Vec3(0.46F, 0.50F, 0.56F) * random.Uniform(0.85F, 1.1F);
  light.horizon = Vec3(0.66F, 0.70F, 0.75F);
  light.ambient = Vec3(0.52F, 0.56F, 0.62F);
  light.bounce = Vec3(0.14F, 0.14F, 0.14F);
  light.haze = Vec3(0.60F, 0.64F, 0.69F);
  light.haze_m = 430;
  light.clouds = 1;
  light.wetness = 1;
  light.lit_windows = 0.14F;
  light.headlights = Vec3(2.0F, 1.9F, 1.7F);
  light.exposure = 1.35F;
  light.key = 0.185F;
  return light;
}

Lighting SnowLighting(CounterRandom& random) {
  Lighting light;
  light.zenith = Vec3(0.62F, 0.66F, 0.72F) * random.Uniform(0.9F, 1.1F);
  light.horizon = Vec3(0.82F, 0.85F, 0.90F);
  light.ambient = Vec3(0.72F, 0.77F, 0.86F);
  light.bounce = Vec3(0.48F, 0.50F, 0.55F);
  light.haze = Vec3(0.80F, 0.83F, 0.88F);
  light.haze_m = 300;
  light.clouds = 1;
  light.snow = 1;
  light.wetness = 0.25F;
  light.lit_windows = 0.15F;
  light.exposure = 1.05F;
  light.key = 0.27F;
  return light;
}

/// Roofs and trees far away, in front of the horizon.
float SkylineShareOfSky(const Lighting& lighting, const Vec3& direction) {
  const float azimuth = std::atan2(direction.y(), direction.x());
  const float wave = 0.022F + 0.010F * Noise(azimuth * 7, 1.5F, lighting.seed + 40) +
                     0.008F * Noise(azimuth * 31, 2.5F, lighting.seed + 41) +
                     0.004F * Noise(azimuth * 120, 3.5F, lighting.seed + 42);
  return 1 - SmoothStep(wave - 0.002F, wave + 0.002F, direction.z());
}

float CloudShareOfSky(const Lighting& lighting, const Vec3& direction) {
  const float height = 1.0F / (std::max(direction.z(), 0.0F) + 0.12F);
  const float x = direction.x() * height;
  const float y = direction.y() * height;
  const float bend = 0.35F * Noise(x * 1.1F, y * 1.1F, lighting.seed + 50);
  const float fluff = FractalNoise(x + bend, y, 0.95F, 6, 0.004F * height, lighting.seed + 51);
  const float edge = 0.55F - 1.1F * lighting.clouds;
  return SmoothStep(edge, edge + 0.5F, fluff) * SmoothStep(0.0F, 0.14F, direction.z());
}

}  // namespace

std::optional<Condition> ParseCondition(const std::string& name) {
  for (const Condition condition :
       {Condition::kDay, Condition::kDusk, Condition::kRain, Condition::kSnow}) {
    if (name == ConditionName(condition)) return condition;
  }
  return std::nullopt;
}

const char* ConditionName(Condition condition) {
  switch (condition) {
    case Condition::kDay:
      return "day";
    case Condition::kDusk:
      return "dusk";
    case Condition::kRain:
      return "rain";
    default:
      return "snow";
  }
}

Lighting MakeLighting(Condition condition, std::uint64_t seed) {
  CounterRandom random(seed, 3);
  Lighting light;
  switch (condition) {
    case Condition::kDay:
      light = DayLighting(random);
      break;
    case Condition::kDusk:
      light = DuskLighting(random);
      break;
    case Condition::kRain:
      light = RainLighting(random);
      break;
    default:
      light = SnowLighting(random);
  }
  light.condition = condition;
  light.seed = random.Bits32();
  return light;
}

Vec3 SmoothSky(const Lighting& lighting, const Vec3& direction) {
  const float up = std::max(direction.z(), 0.0F);
  Vec3 sky = Blend(lighting.horizon, lighting.zenith, std::sqrt(up));
  const float toward_sun = std::max(0.0F, direction.dot(lighting.sun_direction));
  if (lighting.condition == Condition::kDusk) {
    const float glow = toward_sun * toward_sun * (1 - up) * (1 - up);
    sky += glow * Vec3(0.75F, 0.30F, 0.09F);
  } else if (lighting.sun.x() > 0) {
    const float narrow = std::pow(toward_sun, 24.0F);
    sky += narrow * Vec3(0.5F, 0.42F, 0.3F);
  }
  return sky;
}

Vec3 SkyRadiance(const Lighting& lighting, const Vec3& direction) {
  Vec3 sky = SmoothSky(lighting, direction);
  if (direction.z() > 0) {
    if (lighting.clouds >= 1) {
      const float height = 1.0F / (direction.z() + 0.15F);
      const float fluff = FractalNoise(direction.x() * height, direction.y() * height, 1.2F, 4,
                                       0.004F * height, lighting.seed + 52);
      sky *= 1 + 0.17F * fluff;
    } else {
      const float share = CloudShareOfSky(lighting, direction);
      const float lit = 0.72F + 0.28F * FractalNoise(direction.x() * 5, direction.y() * 5, 1, 3,
                                                     0.01F, lighting.seed + 53);
      const Vec3 cloud =
          lighting.condition == Condition::kDusk
              ? Vec3(Blend(lighting.zenith, lighting.horizon, 0.45F) * (0.6F + 0.5F * lit))
              : Vec3(Vec3(1.45F, 1.45F, 1.48F) * lit);
      sky = Blend(sky, cloud, 0.92F * share);
    }
    if (lighting.sun.x() > 0) {
      const float disc = SmoothStep(0.99985F, 0.99997F, direction.dot(lighting.sun_direction));
      sky += disc * Vec3(40, 38, 32);
    }
  }
  const float skyline = SkylineShareOfSky(lighting, direction);
  const Vec3 far = Blend(lighting.haze, Vec3(0.10F, 0.13F, 0.10F).cwiseProduct(lighting.ambient),
                         lighting.haze_m > 400 ? 0.55F : 0.12F);
  return Blend(sky, far, skyline);
}

}  // namespace livemap::simulation
