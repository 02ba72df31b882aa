// What happens to hazards besides reports: officials, polls, time. And what every change has in
// common.
#include <algorithm>
#include <utility>

#include "zone/zone_service_state.h"

namespace livemap {
namespace {

constexpr std::size_t kMaxReasonBytes = 200;

/// Cut between two characters, so that it stays valid UTF-8.
std::string Shortened(std::string text) {
  if (text.size() <= kMaxReasonBytes) return text;
  std::size_t end = kMaxReasonBytes;
  while (end > 0 && (static_cast<std::uint8_t>(text[end]) & 0xc0U) == 0x80U) --end;
  text.resize(end);
  return text;
}

void CheckOfficial(const std::string& official, std::size_t max_bytes) {
  if (IsPrintableText(official, max_bytes)) return;
  throw Error("the official's name of " + std::to_string(official.size()) +
              " bytes is not accepted: it must be printable UTF-8 of 1 to " +
              std::to_string(max_bytes) + " bytes");
}

}  // namespace

ZoneService::Implementation::Change ZoneService::Implementation::NewChange() const {
  Change change;
  change.sequence = sequence_;
  change.announced = announced_;
  return change;
}

void ZoneService::Implementation::NoteEvent(Slot slot, HazardAction action,
                                            std::optional<HazardState> from, std::string reason,
                                            Change& change) {
  HazardEvent event;
  event.action = action;
  event.from = from;
  event.reason = Shortened(std::move(reason));
  event.previous_announced = change.announced;
  event.announced = DriversAction(from, registry_.Get(slot).state).has_value();
  if (event.announced) {
    registry_.MarkAnnounced(slot);
    change.announced = change.sequence;
  }
  event.hazard = registry_.Get(slot);
  store_.WriteEvent(event, event.reason);
  change.touched.push_back(slot);
  change.events.push_back(std::move(event));
}

/// Once per hazard, as it is in the end.
void ZoneService::Implementation::WriteTouched(Change& change) {
  std::vector<Slot>& touched = change.touched;
  std::sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  for (const Slot slot : touched) store_.WriteHazard(registry_.Get(slot));
}

void ZoneService::Implementation::Settle(const Change& change) {
  for (const auto& [before, after] : change.pictures) {
    images_.Retain(after);
    images_.Release(before);
  }
  images_.EvictBeyondCap();
  for (const HazardEvent& event : change.events) {
    ZoneEvent message;
    message.hazard = event;
    stream_.Publish(message);
  }
}

ZoneService::Implementation::Change ZoneService::Implementation::Decide(Slot slot,
                                                                        HazardState state,
                                                                        const std::string& reason) {
  Change change = NewChange();
  InTransaction(change, [&] {
    const Hazard before = registry_.Get(slot);
    registry_.SetState(slot, state, ++change.sequence, now_ns_());
    const bool leaves = IsOnMap(before.state) && !IsOnMap(state);
    const bool comes = !IsOnMap(before.state) && IsOnMap(state);
    const HazardAction action = leaves  ? HazardAction::kRemoved
                                : comes ? HazardAction::kAdded
                                        : HazardAction::kUpdated;
    NoteEvent(slot, action, before.state, reason, change);
    if (leaves) change.pictures.emplace_back(before.image_sha256, "");
    if (comes) change.pictures.emplace_back("", before.image_sha256);
  });
  return change;
}

bool ZoneService::Implementation::Reject(const Uuid&, const std::string& official,
                                         const std::string&) {
  CheckOfficial(official, config_.limits.max_text_bytes);
  return false;
}

bool ZoneService::Implementation::Confirm(const Uuid&, const std::string& official) {
  CheckOfficial(official, config_.limits.max_text_bytes);
  return false;
}

bool ZoneService::Implementation::Remove(const Uuid& uuid, const std::string& reason) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  Change change;
  {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    const auto slot = registry_.Find(uuid);
    if (!slot || !IsOnMap(registry_.Get(*slot).state)) return false;
    change = Decide(*slot, HazardState::kGone, reason);
  }
  Settle(change);
  return true;
}

std::vector<StoredEvent> ZoneService::Implementation::Events(const Uuid&, std::size_t) const {
  return {};
}

std::vector<PollOrder> ZoneService::Implementation::TakeDuePolls() { return {}; }

bool ZoneService::Implementation::HandleAnswer(const PollAnswer&) { return false; }

void ZoneService::Implementation::Advance() {}

}  // namespace livemap
