#include "zone/service/vehicle_claims.h"

#include <gtest/gtest.h>

namespace livemap::zone {
namespace {

TEST(VehicleClaims, OneDecisionAboutAVehicleAtATime) {
  VehicleClaims claims;
  {
    const VehicleClaims::Claim claim(claims, "car-1");
    EXPECT_THROW(VehicleClaims::Claim(claims, "car-1"), DecisionConflict);
    EXPECT_THROW(VehicleClaims::Claim(claims, "car-1"), DecisionConflict) << "still claimed";
    EXPECT_NO_THROW(VehicleClaims::Claim(claims, "car-2"));
  }
  EXPECT_NO_THROW(VehicleClaims::Claim(claims, "car-1"));
}

}  // namespace
}  // namespace livemap::zone
