#include "simulation/objects/object_class.h"

#include <array>

namespace livemap::simulation {
namespace {

constexpr std::array<const char*, kObjectClasses> kNames = {"sky",
                                                            "road",
                                                            "kerb",
                                                            "pavement",
                                                            "grass",
                                                            "building",
                                                            "tree",
                                                            "pole",
                                                            "fence",
                                                            "vehicle",
                                                            "sign",
                                                            "bin",
                                                            "rubbish",
                                                            "person",
                                                            "other_object",
                                                            "cycle",
                                                            "pothole",
                                                            "traffic_cone",
                                                            "road_work_sign",
                                                            "barrier",
                                                            "debris",
                                                            "deer",
                                                            "construction_machine",
                                                            "stopped_accident"};

}  // namespace

const char* ClassName(ObjectClass object_class) {
  return kNames[static_cast<std::size_t>(object_class)];
}

std::optional<ObjectClass> ClassByName(const std::string& name) {
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i]) return static_cast<ObjectClass>(i);
  }
  return std::nullopt;
}

std::vector<ObjectClass> HazardClasses() {
  std::vector<ObjectClass> classes;
  for (int i = static_cast<int>(ObjectClass::kPothole); i < kObjectClasses; ++i) {
    classes.push_back(static_cast<ObjectClass>(i));
  }
  return classes;
}

}  // namespace livemap::simulation
