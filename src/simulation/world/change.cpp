#include "simulation/world/change.h"

#include "simulation/objects/random.h"

namespace livemap {
namespace {

constexpr std::uint64_t kFates = 41;
/// Far above the serials of streets that fit the earth.
constexpr std::uint32_t kSuccessorSerial = 1U << 25U;
constexpr double kAppearingShare = 0.4;
constexpr double kVanishingShare = 0.4;

}  // namespace

ChangeClass ChangeClassOf(ObjectClass object_class) {
  switch (object_class) {
    case ObjectClass::kBarrier:
      return ChangeClass::kBarrier;
    case ObjectClass::kBin:
      return ChangeClass::kBin;
    case ObjectClass::kConstructionMachine:
      return ChangeClass::kConstruction;
    case ObjectClass::kDebris:
    case ObjectClass::kDeer:
    case ObjectClass::kFence:
    case ObjectClass::kOtherObject:
      return ChangeClass::kOtherObjects;
    case ObjectClass::kPerson:
    case ObjectClass::kCycle:
      return ChangeClass::kPersonCycle;
    case ObjectClass::kRubbish:
      return ChangeClass::kRubbish;
    case ObjectClass::kSign:
    case ObjectClass::kRoadWorkSign:
      return ChangeClass::kSign;
    case ObjectClass::kTrafficCone:
      return ChangeClass::kTrafficCone;
    case ObjectClass::kVehicle:
    case ObjectClass::kStoppedAccident:
      return ChangeClass::kVehicle;
    default:
      return ChangeClass::kNoChange;
  }
}

ObjectFate StreetPass::FateOf(std::uint64_t seed, std::uint32_t instance) const {
  if (which == Which::kOnly) return ObjectFate::kStays;
  CounterRandom random(seed, kFates, instance >> 5U);
  if (!random.Chance(changes)) return ObjectFate::kStays;
  const double fate = random.Uniform(0.0, 1.0);
  if (fate < kAppearingShare) return ObjectFate::kAppears;
  return fate < kAppearingShare + kVanishingShare ? ObjectFate::kVanishes : ObjectFate::kReplaced;
}

bool StreetPass::Shows(ObjectFate fate) const {
  if (which == Which::kOnly || fate == ObjectFate::kStays) return true;
  return (fate == ObjectFate::kAppears) == (which == Which::kSecond);
}

std::uint32_t SuccessorOf(std::uint32_t instance, ObjectClass object_class) {
  return MakeInstance((instance >> 5U) | kSuccessorSerial, object_class);
}

}  // namespace livemap
