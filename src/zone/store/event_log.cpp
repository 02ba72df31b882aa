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

std::string IsSoundEvent(const Dialect& dialect) {
  return dialect.AreIntegers({"previous_sequence", "action", "to_state", "at_ns"}) + " AND " +
         dialect.IsIntegerOrNull("from_state") + " AND " + dialect.AreTexts({{"reason", 200}});
}
/// As SOCI fetches it as a number from both databases.
constexpr char kIsAnnounced[] = "CASE WHEN announced <> 0 THEN 1 ELSE 0 END";

}  // namespace

EventLog::EventLog(StoreConnection& connection)
    : connection_(connection),
      find_((connection.session().prepare
                 << "SELECT previous_sequence, action, from_state, to_state, " << kIsAnnounced
                 << ", reason, at_ns FROM events WHERE sequence = :s AND "
                 << IsSoundEvent(connection.dialect()),
             soci::use(row_.sequence), soci::into(row_.previous_sequence), soci::into(row_.action),
             soci::into(row_.from_state, row_.has_from), soci::into(row_.state),
             soci::into(row_.announced), soci::into(row_.reason), soci::into(row_.updated_ns))),
      write_(connection,
             "INSERT INTO events (sequence, hazard_id, previous_sequence, "
             "action, from_state, to_state, announced, reason, at_ns) "
             "VALUES (:s, :h, :p, :a, :f, :t, :an, :r, :at)",
             {row_.sequence, row_.hazard_id, row_.previous_sequence, row_.action,
              BoundPlace(row_.from_state, row_.has_from), row_.state, row_.announced, row_.reason,
              row_.updated_ns}) {}

std::vector<StoredEvent> EventLog::Load(const Uuid& hazard, std::uint64_t sequence,
                                        std::size_t limit) {
  return ExplainStore("reading events", [&] {
    return WalkEvents(connection_, sequence, limit, find_, row_, [&](const auto& read) {
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
    long long most = 0;
    soci::statement find =
        (connection_.session().prepare
             << "SELECT e.sequence, substr(h.uuid, 1, 37), action, from_state, "
                "to_state, "
             << kIsAnnounced
             << ", reason, at_ns FROM events e JOIN hazards h "
                "ON h.id = e.hazard_id WHERE e.sequence > :s AND "
             << connection_.dialect().AreTexts({{"h.uuid", 64}})
             << " AND (to_state IN (3, 4) OR (to_state IN (1, 2) AND "
                "coalesce(from_state, 0) NOT IN (1, 2))) AND "
             << IsSoundEvent(connection_.dialect()) << " ORDER BY e.sequence LIMIT :l",
         soci::use(after), soci::use(most), soci::into(row_.sequence), soci::into(row_.hazard_uuid),
         soci::into(row_.action), soci::into(row_.from_state, row_.has_from),
         soci::into(row_.state), soci::into(row_.announced), soci::into(row_.reason),
         soci::into(row_.updated_ns));
    std::vector<StoredEvent> events;
    // Broken rows make a page shorter than it was asked to be: another one follows.
    for (bool is_end = false; !is_end && events.size() < limit;) {
      most = static_cast<long long>(limit - events.size());
      long long rows = 0;
      connection_.Run(find);
      for (; find.fetch(); ++rows) {
        after = row_.sequence;
        auto event = EventOf<StoredEvent>(row_, kHazardStates);
        const auto hazard = Uuid::Parse(row_.hazard_uuid);
        if (!event || !hazard || !IsIndex(row_.action, kActions)) continue;
        event->hazard = *hazard;
        event->action = static_cast<HazardAction>(row_.action);
        event->announced = row_.announced != 0;
        events.push_back(*std::move(event));
      }
      is_end = rows < most;
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
    write_.Execute();
  });
}

}  // namespace livemap::zone
