#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/uuid.h"
#include "web/http/http_message.h"
#include "zone/model/page.h"

namespace livemap::web {

/// So many items are read from the zone at a time.
constexpr std::size_t kItemsPerRead = 128;

/// Answers with what the zone knows, of hazards or of map changes, as a GeoJSON FeatureCollection
/// of at most `limit` Features, one read at a time. `walk.until` is the zone's sequence before the
/// first read: what changes while the answer is written has a newer one and is told to whoever asks
/// for what came since, `log` names the sequence (zone::MapReader::LogId). `read(walk, limit)`
/// gives the next zone::Page, `to_feature` makes an item's Feature.
template <typename State, typename Read, typename ToFeature>
HttpResponse ListAnswer(zone::Walk<State> walk, std::size_t limit, const Uuid& log, Read read,
                        ToFeature to_feature) {
  auto pieces = [walk = std::move(walk), left = limit, log, read = std::move(read),
                 to_feature = std::move(to_feature), is_begun = false,
                 has_items = false](std::string& piece) mutable {
    if (!is_begun) piece += R"({"type":"FeatureCollection","features":[)";
    is_begun = true;
    const auto page = read(walk, std::min(left, kItemsPerRead));
    for (const auto& item : page.items) {
      if (has_items) piece += ',';
      has_items = true;
      piece += ToText(to_feature(item));
    }
    left -= page.items.size();
    walk.after = page.sequence;
    if (left > 0 && !page.is_last) return true;
    const bool is_truncated = left == 0;
    // A cut list is complete up to its last item.
    const std::uint64_t sequence = is_truncated ? page.items.back().sequence : walk.until;
    piece += R"(],"sequence":)" + std::to_string(sequence) + R"(,"truncated":)" +
             (is_truncated ? "true" : "false") + R"(,"log":")" + log.ToString() + "\"}";
    return false;
  };
  return PiecesAnswer(std::move(pieces), "application/geo+json");
}

/// The id in "/ID/events", which stands behind the list's address; none in anything else.
inline std::optional<std::string> IdOfHistory(const std::string& rest) {
  constexpr std::string_view kEnding = "/events";
  if (rest.size() < kEnding.size() + 1) return std::nullopt;
  const std::size_t end = rest.size() - kEnding.size();
  if (rest.compare(end, std::string::npos, kEnding.data()) != 0) return std::nullopt;
  return rest.substr(1, end - 1);
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
