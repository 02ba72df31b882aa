#include "zone/service/ageing.h"

#include <algorithm>
#include <cstddef>

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxDueAtOnce = 2000;

}  // namespace

Ageing::Ageing(ZoneState& state, HazardSteps& steps) : state_(state), steps_(steps) {}

std::int64_t Ageing::NextChangeNs(Slot slot) const {
  return steps_.lifecycle().NextChangeNs(steps_.ClassOf(slot), state_.hazards.Record(slot).life);
}

void Ageing::Schedule(Slot slot) { due_.Set(slot, NextChangeNs(slot)); }

std::vector<Ageing::Slot> Ageing::TakeDue(std::int64_t now_ns) {
  return due_.Take(now_ns, kMaxDueAtOnce);
}

void Ageing::Apply(const std::vector<Slot>& due, ZoneTransaction& transaction) {
  for (const Slot slot : due) steps_.PassTime(slot, transaction);
}

void Ageing::PutBack(const std::vector<Slot>& due, std::int64_t now_ns) {
  for (const Slot slot : due) due_.Set(slot, now_ns);
}

void Ageing::Reschedule(const std::vector<Slot>& due, std::int64_t now_ns) {
  // A second at least: what is learned may put off what was due.
  for (const Slot slot : due) due_.Set(slot, std::max(NextChangeNs(slot), now_ns + 1'000'000'000));
}

}  // namespace livemap::zone
