#pragma once

#include <cstdint>
#include <string>

#include "protocol/hazard_catalogue.h"
#include "streets/street_place.h"
#include "web/feeds/feed_codes.h"
#include "zone/model/hazard.h"

namespace livemap::web {

/// A hazard as the feeds tell of it, whatever their format.
struct FeedHazard {
  zone::Hazard hazard;
  std::string id;              ///< `hazard.uuid` as text.
  std::string label;           ///< Its class in people's words.
  streets::StreetWords words;  ///< Where it lies on the streets.
  FeedCodes codes;             ///< What the standards call it.
  double expected_life_s = 0;  ///< How long hazards of its class stay, by the catalogue.
  std::int64_t ends_ns = 0;    ///< When it is expected to be over, UTC ns since 1970.

  /// "Forbes Ave, near S Craig St, eastbound", as far as that is known; may be empty.
  std::string Place() const;
  /// The label with the place.
  std::string Title() const;
};

/// `words` say where it lies (ZoneService::WordsOf). It is expected to end a life of its class
/// after it was last seen, and no earlier than ten minutes after `now_ns`, because the zone takes
/// it to be there.
FeedHazard MakeFeedHazard(const zone::Hazard& hazard, const protocol::HazardCatalogue& catalogue,
                          const streets::StreetWords& words, std::int64_t now_ns);

}  // namespace livemap::web
