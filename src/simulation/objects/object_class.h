#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace livemap::simulation {

/// What a pixel of a simulated picture shows. The values are those of the class image.
enum class ObjectClass : std::uint8_t {
  kSky = 0,
  kRoad,
  kKerb,
  kPavement,
  kGrass,
  kBuilding,
  kTree,
  kPole,
  kFence,
  kVehicle,
  kSign,
  kBin,
  kRubbish,
  kPerson,
  kOtherObject,  ///< A bench, planter or post box.
  kCycle,        ///< A parked bicycle.
  kPothole,
  kTrafficCone,
  kRoadWorkSign,
  kBarrier,
  kDebris,
  kDeer,
  kConstructionMachine,
  kStoppedAccident,
};
constexpr int kObjectClasses = 24;

/// "sky", "road", ..., "stopped_accident"; hazards as config/hazards.yaml names them.
const char* ClassName(ObjectClass object_class);
/// None for an unknown name.
std::optional<ObjectClass> ClassByName(const std::string& name);
/// True for what LiveMap reports: potholes and everything after them.
inline bool IsHazard(ObjectClass object_class) { return object_class >= ObjectClass::kPothole; }
/// In the order of their class ids in label files.
std::vector<ObjectClass> HazardClasses();

/// An instance id carries its class in the lowest five bits. Serial 0 are the sky and the surfaces
/// of the ground, which every street has once: their ids equal their class.
inline std::uint32_t MakeInstance(std::uint32_t serial, ObjectClass object_class) {
  return (serial << 5U) | static_cast<std::uint32_t>(object_class);
}
inline ObjectClass ClassOfInstance(std::uint32_t instance) {
  return static_cast<ObjectClass>(instance & 31U);
}

}  // namespace livemap::simulation
