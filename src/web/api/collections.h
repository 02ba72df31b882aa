#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "common/uuid.h"
#include "web/http/http_message.h"

namespace livemap::web {

/// Answers with what the zone knows, of hazards or of map changes, as a GeoJSON FeatureCollection.
/// `items` come in ascending order of their sequence and are at most `limit`; `sequence` is the
/// zone's, read before them: an event that comes between the two is in the list and told again.
/// `to_feature` makes an item's Feature.
template <typename Item, typename ToFeature>
HttpResponse ListAnswer(std::uint64_t sequence, std::size_t limit, const std::vector<Item>& items,
                        const ToFeature& to_feature) {
  const bool truncated = items.size() == limit;
  Json features = Json::array();
  std::uint64_t newest = 0;
  for (const Item& item : items) {
    newest = std::max(newest, item.sequence);
    features.push_back(to_feature(item));
  }
  Json collection;
  collection["type"] = "FeatureCollection";
  // A cut list is complete up to its last item.
  collection["sequence"] = truncated ? newest : std::max(sequence, newest);
  collection["truncated"] = truncated;
  collection["features"] = std::move(features);
  return JsonAnswer(collection, "application/geo+json");
}

/// Answers with the history of one of them.
template <typename Event, typename ToJson>
HttpResponse EventsAnswer(const Uuid& id, const std::vector<Event>& events, const ToJson& to_json) {
  Json lines = Json::array();
  for (const Event& event : events) lines.push_back(to_json(event));
  Json answer;
  answer["id"] = id.ToString();
  answer["events"] = std::move(lines);
  return JsonAnswer(answer);
}

}  // namespace livemap::web
