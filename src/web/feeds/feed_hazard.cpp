#include "web/feeds/feed_hazard.h"

#include <algorithm>

#include "common/time.h"

namespace livemap::web {
namespace {

constexpr std::int64_t kLeastLifeNs = 600'000'000'000;

}  // namespace

std::string FeedHazard::Place() const {
  std::string place = words.street;
  if (!words.near.empty()) place += (place.empty() ? "near " : ", near ") + words.near;
  if (!words.direction.empty()) place += (place.empty() ? "" : ", ") + words.direction;
  return place;
}

std::string FeedHazard::Title() const {
  const std::string place = Place();
  return place.empty() ? label : label + ", " + place;
}

FeedHazard MakeFeedHazard(const zone::Hazard& hazard, const protocol::HazardCatalogue& catalogue,
                          const streets::StreetWords& words, std::int64_t now_ns) {
  const protocol::HazardClass hazard_class = catalogue.Get(hazard.class_name);
  FeedHazard made;
  made.hazard = hazard;
  made.id = hazard.uuid.ToString();
  made.label = hazard_class.label.empty() ? hazard.class_name : hazard_class.label;
  made.words = words;
  made.codes = CodesOf(hazard.class_name);
  made.expected_life_s = hazard_class.expected_life_s;
  const std::int64_t life_ns = Nanoseconds(std::clamp(hazard_class.expected_life_s, 0.0, 1e9));
  made.ends_ns = std::max(hazard.last_seen_ns + life_ns, now_ns + kLeastLifeNs);
  return made;
}

}  // namespace livemap::web
