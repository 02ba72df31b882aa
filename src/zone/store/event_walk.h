#pragma once

// How the tables of ZoneStore read the history of a hazard or of a map change; nobody else includes
// this.
#include <soci/soci.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "common/time.h"
#include "protocol/text_rules.h"
#include "zone/model/hazard.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

namespace livemap::zone {

/// The values that every kind of event has, from the row that was just fetched. None for a row that
/// the program cannot have written. `states` is the number of states that there are.
template <typename Event, typename Row>
std::optional<Event> EventOf(const Row& row, std::size_t states) {
  using State = decltype(Event::to);
  const bool has_from = row.has_from == soci::i_ok;
  const bool valid =
      IsIndex(row.state, states) && (!has_from || IsIndex(row.from_state, states)) &&
      IsStamp(row.updated_ns) &&
      (row.reason.empty() || protocol::IsPrintableText(row.reason, kMaxEventReasonBytes));
  if (!valid) return std::nullopt;
  Event event;
  event.sequence = static_cast<std::uint64_t>(row.sequence);
  if (has_from) event.from = static_cast<State>(row.from_state);
  event.to = static_cast<State>(row.state);
  event.reason = row.reason;
  event.at_ns = row.updated_ns;
  return event;
}

/// Follows a history from its event `sequence` back through at most `limit` rows; oldest first.
/// `find` fetches the event `row.sequence` into `row`, of which `read` makes an event, or none for
/// a broken row, which is left out.
template <typename Row, typename Read>
auto WalkEvents(StoreConnection& connection, std::uint64_t sequence, std::size_t limit,
                soci::statement& find, Row& row, const Read& read) {
  std::vector<typename decltype(read(row))::value_type> events;
  for (std::size_t looked_at = 0; sequence != 0 && looked_at < limit; ++looked_at) {
    row.sequence = static_cast<long long>(sequence);
    if (!FetchOne(connection, find)) break;
    if (auto event = read(row)) events.push_back(*std::move(event));
    // Downwards only, whatever stands in the file.
    const auto previous = static_cast<std::uint64_t>(std::max(row.previous_sequence, 0LL));
    sequence = previous < sequence ? previous : 0;
  }
  std::reverse(events.begin(), events.end());
  return events;
}

}  // namespace livemap::zone
