// What the zone of the study makes of vehicles' words, and the figures of it.
#include <algorithm>

#include "zone_life/study_state.h"

namespace livemap::bench {

void Study::Tell(std::size_t vehicle, std::size_t index, zone::EvidenceKind kind, double t) {
  const std::int64_t now_ns = Stamp(t);
  if (!allowance_.TakeEvidence(names_[vehicle], now_ns)) {
    ++figures_.refused_by_allowance;
    return;
  }
  Thing& thing = things_[index];
  const zone::ClassModel entry = ClassOf(thing);
  zone::Evidence evidence{kind, keys_[vehicle], now_ns};
  if (config_.trust) evidence.malicious = trust_.MaliciousProbability(evidence.vehicle, now_ns);
  const bool against = kind == zone::EvidenceKind::kAnswerNo;
  zone::LifecycleUpdate step;
  if (thing.item == kNone) {
    if (against) return;
    thing.item = items_.size();
    items_.emplace_back();
    items_.back().thing = index;
    items_.back().reporters.insert(vehicle);
    step = rules_.Begin(entry, evidence, now_ns, items_.back().life);
    if (config_.telling == TellingRule::kCount) {
      items_.back().life.state = zone::HazardState::kCandidate;
      Count(items_.back(), kind, step, t);
    }
  } else {
    Item& item = items_[thing.item];
    if (!against) item.reporters.insert(vehicle);
    if (config_.telling == TellingRule::kCount) {
      Count(item, kind, step, t);
    } else {
      step = rules_.Apply(entry, evidence, now_ns, item.life);
    }
  }
  Follow(thing.item, step, against, t);
}

void Study::Count(Item& item, zone::EvidenceKind kind, zone::LifecycleUpdate& step, double t) {
  constexpr int kMaxScore = 5;
  const bool against = kind == zone::EvidenceKind::kAnswerNo;
  const zone::ClassModel entry = ClassOf(things_[item.thing]);
  item.score = std::min(kMaxScore, item.score + (against ? -1 : 1));
  if (!against) item.life.last_yes_ns = Stamp(t);
  zone::HazardState to = item.life.state;
  if (item.score >= static_cast<int>(entry.confirmations)) to = zone::HazardState::kActive;
  if (item.score <= 0) to = zone::HazardState::kGone;
  step.transition.reset();
  if (to == item.life.state) return;
  step.transition = zone::LifecycleTransition{item.life.state, to, "counted"};
  item.life.state = to;
}

void Study::Follow(std::size_t index, const zone::LifecycleUpdate& step, bool denied, double t) {
  Item& item = items_[index];
  Thing& thing = things_[item.thing];
  const char* name = kNature[thing.kind].name;
  if (config_.telling == TellingRule::kLife && (step.lesson.ended || step.lesson.stood_s > 0)) {
    survival_.Learn(name, step.lesson);
    classes_[thing.kind].survival = survival_.Of(name);
  }
  for (const zone::Verdict& verdict : step.verdicts) trust_.Judge(verdict, Stamp(t));
  if (step.transition) Enter(item, *step.transition, t);
  polling_.SetHazard(index, PlaceOf(thing), ClassOf(thing), item.life, denied, Stamp(t));
  ++item.version;
  if (!zone::IsOnMap(item.life.state)) return;
  double next_s = 0;
  if (config_.telling == TellingRule::kLife) {
    next_s = Seconds(rules_.NextChangeNs(ClassOf(thing), item.life) - kEpochNs);
  } else {
    // Not heard of for three expected lives the naive rule forgets it.
    next_s = Seconds(item.life.last_yes_ns - kEpochNs) + 3 * catalogue_.Get(name).expected_life_s;
    if (t + 1 >= next_s) {
      Enter(item, {item.life.state, zone::HazardState::kGone, "old"}, t);
      item.life.state = zone::HazardState::kGone;
      polling_.SetHazard(index, PlaceOf(thing), ClassOf(thing), item.life, denied, Stamp(t));
      return;
    }
  }
  Push(std::max(t, next_s), Happening::kAdvances, index, 0, item.version);
}

void Study::Enter(Item& item, const zone::LifecycleTransition& transition, double t) {
  Thing& thing = things_[item.thing];
  ClassFigures& figures = FiguresOf(thing);
  const bool was_told = transition.from && zone::IsTold(*transition.from);
  const bool stands = thing.Stands(t);
  if (!was_told && zone::IsTold(transition.to)) {
    item.told_s = t;
    if (!stands && Measured(t) && !thing.false_counted) {
      ++figures.false_told;
      thing.false_counted = true;
    }
    if (stands) {
      if (thing.first_told_s < 0) {
        thing.first_told_s = t;
        if (Measured(thing.begins_s)) ++figures.told;
      }
      if (thing.noticeable_s >= 0) thing.missing_s += t - thing.noticeable_s;
      thing.noticeable_s = -1;
    }
  }
  if (transition.to != zone::HazardState::kGone) return;
  if (was_told) StopTelling(item, thing, t);
  thing.item = kNone;
}

void Study::StopTelling(Item& item, Thing& thing, double t) {
  ClassFigures& figures = FiguresOf(thing);
  if (thing.Stands(t)) {
    if (Measured(t)) ++figures.dropped;
    thing.noticeable_s = t;
    return;
  }
  // `told_s` is when it became wrong.
  if (!Measured(item.told_s)) return;
  figures.wrong_s += t - item.told_s;
  if (thing.real) figures.minutes_until_gone.push_back((t - item.told_s) / 60);
}

void Study::Finish() {
  for (Thing& thing : things_) {
    ClassFigures& figures = FiguresOf(thing);
    const bool on_map = thing.item != kNone;
    if (on_map && zone::IsTold(items_[thing.item].life.state) && !thing.Stands(last_s_)) {
      StopTelling(items_[thing.item], thing, last_s_);
    }
    if (!thing.real || !Measured(thing.begins_s)) continue;
    const bool noticeable = thing.honest.size() >= ClassOf(thing).confirmations;
    figures.noticeable += noticeable ? 1 : 0;
    figures.untold += noticeable && thing.first_told_s < 0 ? 1 : 0;
    figures.missing_s += thing.missing_s;
  }
  for (auto& [name, of_class] : figures_.classes) {
    of_class.learned_life_s = survival_.Of(name).MeanLifeS();
  }
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    figures_.hostile += hostile_[i] ? 1 : 0;
    if (trust_.MaliciousProbability(keys_[i], Stamp(last_s_)) < rules_.config().suspect_above)
      continue;
    ++(hostile_[i] ? figures_.hostile_suspects : figures_.honest_suspects);
  }
  figures_.polls = polling_.polls();
  figures_.poll_bytes = polling_.bytes();
  figures_.measured_days = (end_s_ - begin_s_) / kDayS;
}

}  // namespace livemap::bench
