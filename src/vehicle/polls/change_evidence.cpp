#include "vehicle/polls/change_evidence.h"

#include <array>
#include <utility>

namespace livemap::vehicle {
namespace {

using ClassPair = std::pair<const char*, const char*>;

/// Classes of change with the hazards that they may be, as the simulator paints them.
constexpr std::array<ClassPair, 6> kSame = {{{"barrier", "barrier"},
                                             {"construction", "construction_machine"},
                                             {"rubbish", "debris"},
                                             {"sign", "road_work_sign"},
                                             {"traffic_cone", "traffic_cone"},
                                             {"vehicle", "stopped_accident"}}};

}  // namespace

bool MayBe(const std::string& change_class, const std::string& hazard_class) {
  if (change_class == "other_objects") return hazard_class != "pothole";
  for (const auto& [change, hazard] : kSame) {
    if (change_class == change && hazard_class == hazard) return true;
  }
  return false;
}

}  // namespace livemap::vehicle
