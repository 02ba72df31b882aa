#include "simulation/world/ground_plan.h"

#include <cmath>

namespace livemap::simulation {

float Pothole::Reach(float along, float left) const {
  const float x = along - along_m;
  const float y = left - left_m;
  const float distance = std::sqrt(x * x + y * y);
  if (distance < 1e-4F) return 0;
  const float c = x / distance;
  const float s = y / distance;
  // Noise on a circle closes by itself. Wheels stretch holes along the road.
  const float rough = 0.24F * Noise(1.3F * c + 7, 1.3F * s + 3, seed) +
                      0.10F * Noise(3.7F * c + 5, 3.7F * s + 9, seed + 1);
  const float radius = radius_m * (1.0F + 0.12F * c * c + rough);
  return distance / radius;
}

float Pothole::Dent(float along, float left) const {
  const float reach = Reach(along, left);
  if (reach >= 1.12F) return 0;
  const float wall = 1.0F - SmoothStep(0.62F, 1.0F, reach);
  const float bowl = 0.75F + 0.25F * (1.0F - std::min(1.0F, reach * reach));
  const float rubble = 0.16F * Noise(along * 14, left * 14, seed + 2) +
                       0.08F * Noise(along * 31, left * 31, seed + 3);
  // The worn edge sags a little before it breaks.
  const float lip = 0.08F * (1.0F - SmoothStep(0.95F, 1.12F, reach));
  return -depth_m * std::max(0.0F, wall * (bowl + rubble) + lip);
}

float GroundPlan::KerbFoot(float along, float* crossing) const {
  const float foot = profile.half_road_m();
  float nearest = 1e9F;
  for (const float at : crossings_m) {
    if (std::abs(along - at) < std::abs(nearest)) nearest = along - at;
  }
  if (crossing != nullptr) *crossing = nearest;
  const float beside = std::abs(nearest) - kSideRoadHalfM;
  if (beside >= kCornerRadiusM) return foot;
  if (beside < 0) return kGroundHalfWidthM;
  const float inward = kCornerRadiusM - beside;
  return foot + kCornerRadiusM -
         std::sqrt(std::max(0.0F, kCornerRadiusM * kCornerRadiusM - inward * inward));
}

}  // namespace livemap::simulation
