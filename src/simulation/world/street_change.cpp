#include "simulation/world/street_change.h"

#include "simulation/objects/counter_random.h"

namespace livemap::simulation {
namespace {

constexpr std::uint64_t kFates = 41;
/// Far above the serials of streets that fit the earth.
constexpr std::uint32_t kSuccessorSerial = 1U << 25U;
constexpr double kAppearingShare = 0.4;
constexpr double kVanishingShare = 0.4;

}  // namespace

protocol::ChangeClass ChangeClassOf(ObjectClass object_class) {
  switch (object_class) {
    case ObjectClass::kBarrier:
      return protocol::ChangeClass::kBarrier;
    case ObjectClass::kBin:
      return protocol::ChangeClass::kBin;
    case ObjectClass::kConstructionMachine:
      return protocol::ChangeClass::kConstruction;
    case ObjectClass::kDebris:
    case ObjectClass::kDeer:
    case ObjectClass::kFence:
    case ObjectClass::kOtherObject:
      return protocol::ChangeClass::kOtherObjects;
    case ObjectClass::kPerson:
    case ObjectClass::kCycle:
      return protocol::ChangeClass::kPersonCycle;
    case ObjectClass::kRubbish:
      return protocol::ChangeClass::kRubbish;
    case ObjectClass::kSign:
    case ObjectClass::kRoadWorkSign:
      return protocol::ChangeClass::kSign;
    case ObjectClass::kTrafficCone:
      return protocol::ChangeClass::kTrafficCone;
    case ObjectClass::kVehicle:
    case ObjectClass::kStoppedAccident:
      return protocol::ChangeClass::kVehicle;
    default:
      return protocol::ChangeClass::kNoChange;
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

}  // namespace livemap::simulation
