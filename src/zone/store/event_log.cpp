#include "zone/store/event_log.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "zone/store/event_walk.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kActions = 3;

constexpr char kSoundEvent[] =
    "typeof(previous_sequence) = 'integer' AND typeof(action) = 'integer' AND "
    "typeof(from_state) IN ('integer', 'null') AND typeof(to_state) = 'integer' AND "
    "typeof(reason) = 'text' AND length(CAST(reason AS BLOB)) <= 200 AND typeof(at_ns) = 'integer'";

}  // namespace

EventLog::EventLog(soci::session& session)
    : session_(session),
      find_((session.prepare << "SELECT previous_sequence, action, from_state, to_state, "
                                "announced <> 0, reason, at_ns FROM events WHERE sequence = :s AND "
                             << kSoundEvent,
             soci::use(row_.sequence), soci::into(row_.previous_sequence), soci::into(row_.action),
             soci::into(row_.from_state, row_.has_from), soci::into(row_.state),
             soci::into(row_.announced), soci::into(row_.reason), soci::into(row_.updated_ns))),
      write_((session.prepare << "INSERT INTO events (sequence, hazard_id, previous_sequence, "
                                 "action, from_state, to_state, announced, reason, at_ns) "
                                 "VALUES (:s, :h, :p, :a, :f, :t, :an, :r, :at)",
              soci::use(row_.sequence), soci::use(row_.hazard_id),
              soci::use(row_.previous_sequence), soci::use(row_.action),
              soci::use(row_.from_state, row_.has_from), soci::use(row_.state),
              soci::use(row_.announced), soci::use(row_.reason), soci::use(row_.updated_ns))) {}

std::vector<StoredEvent> EventLog::Load(const Uuid& hazard, std::uint64_t sequence,
                                        std::size_t limit) {
  return ExplainStore("reading events", [&] {
    return WalkEvents(sequence, limit, find_, row_, [&](const auto& read) {
      auto event = EventOf<StoredEvent>(read, kHazardStates);
      if (!event || !IsIndex(read.action, kActions)) return std::optional<StoredEvent>();
      event->hazard = hazard;
      event->action = static_cast<HazardAction>(read.action);
      event->announced = read.announced != 0;
      return event;
    });
  });
}

std::vector<StoredEvent> EventLog::LoadTurnsAfter(std::uint64_t sequence, std::size_t limit) {
  return ExplainStore("reading what happened", [&] {
    row_.sequence = static_cast<long long>(std::min<std::uint64_t>(sequence, kMaxSequence));
    long long after = row_.sequence;
    soci::statement find =
        (session_.prepare << "SELECT e.sequence, substr(h.uuid, 1, 37), action, from_state, "
                             "to_state, announced <> 0, reason, at_ns FROM events e JOIN hazards h "
                             "ON h.id = e.hazard_id WHERE e.sequence > :s AND typeof(h.uuid) = "
                             "'text' AND (to_state IN (3, 4) OR (to_state IN (1, 2) AND "
                             "coalesce(from_state, 0) NOT IN (1, 2))) AND "
                          << kSoundEvent << " ORDER BY e.sequence",
         soci::use(after), soci::into(row_.sequence), soci::into(row_.hazard_uuid),
         soci::into(row_.action), soci::into(row_.from_state, row_.has_from),
         soci::into(row_.state), soci::into(row_.announced), soci::into(row_.reason),
         soci::into(row_.updated_ns));
    std::vector<StoredEvent> events;
    find.execute();
    while (events.size() < limit && find.fetch()) {
      auto event = EventOf<StoredEvent>(row_, kHazardStates);
      const auto hazard = Uuid::Parse(row_.hazard_uuid);
      if (!event || !hazard || !IsIndex(row_.action, kActions)) continue;
      event->hazard = *hazard;
      event->action = static_cast<HazardAction>(row_.action);
      event->announced = row_.announced != 0;
      events.push_back(*std::move(event));
    }
    return events;
  });
}

void EventLog::Write(const HazardEvent& event, std::uint64_t hazard_id,
                     std::uint64_t previous_sequence) {
  ExplainStore("writing an event", [&] {
    row_.sequence = static_cast<long long>(event.hazard.sequence);
    row_.hazard_id = static_cast<long long>(hazard_id);
    row_.previous_sequence = static_cast<long long>(previous_sequence);
    row_.action = static_cast<int>(event.action);
    row_.has_from = event.from ? soci::i_ok : soci::i_null;
    row_.from_state = event.from ? static_cast<int>(*event.from) : 0;
    row_.state = static_cast<int>(event.hazard.state);
    row_.announced = event.announced ? 1 : 0;
    row_.reason = event.reason;
    row_.updated_ns = event.hazard.updated_ns;
    write_.execute(true);
  });
}

}  // namespace livemap::zone
