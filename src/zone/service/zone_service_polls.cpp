// Polls: who is asked, and whose answer counts.
#include <cmath>
#include <utility>

#include "imaging/image_header.h"
#include "zone/service/zone_service_state.h"

namespace livemap::zone {
namespace {

EvidenceKind KindOf(protocol::PollAnswer::Answer answer) {
  switch (answer) {
    case protocol::PollAnswer::Answer::kYes:
      return EvidenceKind::kAnswerYes;
    case protocol::PollAnswer::Answer::kNo:
      return EvidenceKind::kAnswerNo;
    case protocol::PollAnswer::Answer::kCantSee:
      return EvidenceKind::kCantSee;
  }
  return EvidenceKind::kCantSee;
}

}  // namespace

std::vector<protocol::Poll> ZoneService::Implementation::TakeDuePolls() {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  const std::int64_t now_ns = now_ns_();
  std::vector<PollChoice> choices;
  {
    const std::lock_guard<std::mutex> lock(polls_mutex_);
    choices = scheduler_.TakeDue(now_ns);
  }
  std::vector<protocol::Poll> polls;
  polls.reserve(choices.size());
  for (PollChoice& choice : choices) {
    const auto slot = static_cast<Slot>(choice.hazard);
    const HazardRecord& record = registry_.Record(slot);
    protocol::Poll poll;
    poll.poll = choice.poll;
    poll.hazard = record.uuid;
    poll.stamp_ns = now_ns;
    poll.vehicle_id = std::move(choice.vehicle_id);
    poll.class_name = registry_.ClassName(slot);
    poll.position = record.estimate.position;
    poll.covariance_m2 = record.estimate.covariance_m2;
    poll.expires_ns = choice.expires_ns;
    poll.picture = choice.picture_wanted ? config_.poll_picture : protocol::PollPicture::kNone;
    poll.max_picture_bytes =
        choice.picture_wanted ? static_cast<std::uint32_t>(config_.polls.picture_bytes) : 0;
    polls.push_back(std::move(poll));
  }
  const std::unique_lock<std::shared_mutex> lock(data_mutex_);
  statistics_.polls += polls.size();
  return polls;
}

bool ZoneService::Implementation::HandleAnswer(const protocol::PollAnswer& answer) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  const std::int64_t now_ns = now_ns_();
  const std::optional<PollScheduler::OpenPoll> poll = FindOpenPoll(answer.poll, now_ns);
  if (!poll || !IsAcceptable(answer, *poll, now_ns) ||
      !allowance_.TakeEvidence(answer.vehicle_id, now_ns)) {
    CountAnswer(false);
    return false;
  }
  const auto slot = static_cast<Slot>(poll->hazard);
  const Change change = CommitAnswer(answer, slot);
  CountAnswer(true);
  {
    const std::lock_guard<std::mutex> lock(polls_mutex_);
    const auto bytes = static_cast<double>(answer.image.size());
    scheduler_.Answered(answer.poll, config_.polls.poll_bytes + bytes, now_ns);
  }
  Settle(change);
  Schedule(slot, now_ns);
  return true;
}

std::optional<PollScheduler::OpenPoll> ZoneService::Implementation::FindOpenPoll(
    const Uuid& poll, std::int64_t now_ns) {
  const std::lock_guard<std::mutex> lock(polls_mutex_);
  return scheduler_.FindOpen(poll, now_ns);
}

/// The answer is believed as far as the zone can check it by itself.
bool ZoneService::Implementation::IsAcceptable(const protocol::PollAnswer& answer,
                                               const PollScheduler::OpenPoll& poll,
                                               std::int64_t now_ns) const {
  const HazardRecord& record = registry_.Record(static_cast<Slot>(poll.hazard));
  if (answer.vehicle_id != poll.vehicle_id || answer.hazard != record.uuid) return false;
  // Of an image taken since the poll, by a clock that is nearly right.
  const auto window_ns = static_cast<std::int64_t>(config_.sight.window_s * 1e9);
  const std::int64_t seen_ns = SeenNs(answer.stamp_ns, now_ns);
  if (seen_ns < poll.asked_ns - window_ns || seen_ns > now_ns + window_ns) return false;
  if (!answer.reason.empty() && !IsPrintableText(answer.reason, config_.limits.max_text_bytes)) {
    return false;
  }
  if (!(answer.confidence >= 0 && answer.confidence <= 1)) return false;
  if (!answer.image.empty() && WhyPictureRefused(answer.image, config_.limits)) return false;
  if (answer.answer == protocol::PollAnswer::Answer::kCantSee) return true;
  return CouldSee(vehicles_.Track(answer.vehicle_id), seen_ns, record.estimate.position,
                  config_.sight);
}

ZoneService::Implementation::Change ZoneService::Implementation::CommitAnswer(
    const protocol::PollAnswer& answer, Slot slot) {
  PictureName picture;
  if (answer.answer == protocol::PollAnswer::Answer::kYes && !answer.image.empty()) {
    picture.format = imaging::FormatName(
        imaging::ReadImageHeader(answer.image.data(), answer.image.size())->format);
    picture.sha256 = images_.Put(answer.image, picture.format);
    images_.Publish();
  }
  const std::unique_lock<std::shared_mutex> lock(data_mutex_);
  Change change = NewChange();
  InTransaction(change, [&] {
    change.answer = &answer;
    change.answered_id = registry_.Record(slot).id;
    PassTime(slot, change);
    PresenceRecord life = registry_.Record(slot).life;
    const Evidence evidence =
        EvidenceOf(KindOf(answer.answer), answer.vehicle_id, answer.stamp_ns, change.now_ns);
    const LifecycleUpdate step = life_.Apply(ClassOf(slot), evidence, change.now_ns, life);
    if (!step.counted && !step.transition) return;
    const Before before = BeforeOf(slot);
    if (!picture.sha256.empty()) registry_.SetPicture(slot, picture);
    const bool yes = answer.answer == protocol::PollAnswer::Answer::kYes;
    const std::string reason = step.transition ? step.transition->reason
                               : yes           ? "a vehicle was asked and saw it"
                                               : "a vehicle was asked and did not see it";
    Step(slot, life, step, reason, before, change);
  });
  return change;
}

void ZoneService::Implementation::CountAnswer(bool accepted) {
  const std::unique_lock<std::shared_mutex> lock(data_mutex_);
  ++(accepted ? statistics_.answers : statistics_.answers_refused);
}

}  // namespace livemap::zone
