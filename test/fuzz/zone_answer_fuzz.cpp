// What a region gets as the answer of a zone, which anybody may have written. What is accepted
// keeps to the documented ranges, and is read back as it is kept on disk.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "common/error.h"
#include "protocol/hazard_catalogue.h"
#include "protocol/text_rules.h"
#include "region/region_map.h"
#include "region/zone_answer.h"
#include "web/json/json.h"

namespace livemap::fuzz {
namespace {

constexpr std::int64_t kAnswerNowNs = 1'767'225'600'000'000'000;

void Require(bool holds) {
  if (!holds) std::abort();
}

bool IsShare(float value) { return value >= 0 && value <= 1; }

void CheckTold(const region::ToldHazard& told) {
  const zone::Hazard& hazard = told.hazard;
  Require(!hazard.uuid.IsNil() && geo::IsValid(hazard.position));
  Require(protocol::IsAcceptableName(hazard.class_name, 64));
  Require(IsShare(hazard.confidence) && IsShare(hazard.presence));
  Require(hazard.covariance_m2.allFinite() && hazard.sequence <= region::kMaxZoneSequence);
  for (const std::int64_t stamp_ns :
       {hazard.first_seen_ns, hazard.last_seen_ns, hazard.updated_ns}) {
    Require(stamp_ns >= 0 && stamp_ns < kAnswerNowNs + 86'401'000'000'000);
  }
  for (const std::string& words : {told.words.street, told.words.near, told.words.direction}) {
    Require(words.empty() || protocol::IsAcceptableText(words, 256));
  }
  static const protocol::HazardCatalogue catalogue;
  const std::string kept = web::ToText(web::HazardFeature(hazard, catalogue, told.words));
  const region::ToldHazard again = region::ParseToldHazard(kept, kAnswerNowNs);
  Require(again.hazard.uuid == hazard.uuid && again.hazard.class_name == hazard.class_name);
  Require(web::ToText(web::HazardFeature(again.hazard, catalogue, again.words)) == kept);
}

void CheckAnswer(const std::string& text) {
  const region::ZoneAnswer answer = region::ParseZoneAnswer(text, 5, kAnswerNowNs);
  Require(!answer.is_truncated || answer.sequence > 5);
  Require(answer.hazards.size() + answer.refused <= region::kHazardsPerAnswer);
  Require((answer.refused == 0) == answer.refusal.empty());
  for (const region::ToldHazard& told : answer.hazards) CheckTold(told);
  region::RegionMap map(protocol::HazardCatalogue(), 0, std::nullopt);
  map.Apply("north", answer.hazards);
  map.Apply("south", answer.hazards);
  map.Remove("north", map.NotAmong("north", {}));
  Require(map.CountOf("north") == 0 && map.hidden() == 0);
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    livemap::fuzz::CheckAnswer(std::string(reinterpret_cast<const char*>(data), size));
  } catch (const livemap::Error&) {
  }
  return 0;
}
