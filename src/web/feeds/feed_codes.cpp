#include "web/feeds/feed_codes.h"

#include <array>

namespace livemap::web {
namespace {

struct ClassCodes {
  std::string_view class_name;
  FeedCodes codes;
};

constexpr FeedCodes RoadworksCodes(WorkDeviceKind kind) {
  return {3, 4, "HAZARD", "HAZARD_ON_ROAD_CONSTRUCTION", SrtiKind::kRoadworks, "roadworks", kind};
}

constexpr std::array<ClassCodes, 8> kClassCodes{{
    {"pothole",
     {9, 0, "HAZARD", "HAZARD_ON_ROAD_POT_HOLE", SrtiKind::kNone, "", WorkDeviceKind::kNone}},
    {"traffic_cone", RoadworksCodes(WorkDeviceKind::kChannel)},
    {"road_work_sign", RoadworksCodes(WorkDeviceKind::kSign)},
    {"barrier", RoadworksCodes(WorkDeviceKind::kBarrier)},
    {"debris",
     {10, 0, "HAZARD", "HAZARD_ON_ROAD_OBJECT", SrtiKind::kObstacle, "debris",
      WorkDeviceKind::kNone}},
    {"deer",
     {11, 1, "HAZARD", "HAZARD_ON_SHOULDER_ANIMALS", SrtiKind::kAnimal, "wildAnimalsOnTheRoad",
      WorkDeviceKind::kNone}},
    {"construction_machine", RoadworksCodes(WorkDeviceKind::kMachine)},
    {"stopped_accident",
     {2, 7, "ACCIDENT", "", SrtiKind::kAccident, "unprotectedAccidentArea", WorkDeviceKind::kNone}},
}};

}  // namespace

FeedCodes CodesOf(std::string_view class_name) {
  for (const ClassCodes& entry : kClassCodes) {
    if (entry.class_name == class_name) return entry.codes;
  }
  return {};
}

}  // namespace livemap::web
