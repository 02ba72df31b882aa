// Polls as vehicles hear them, answers as the zone hears them, with any values: CheckPoll,
// CheckAnswer, and what the zone does with an answer to a poll that it asked.
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "common/error.h"
#include "protocol/poll_validation.h"
#include "test/fuzz/store_script.h"
#include "zone/service/zone_service.h"

namespace livemap::fuzz {
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void Fill(Uuid& uuid, FuzzBytes& bytes) {
  if (bytes.Below(8) == 0) return;
  uuid.bytes[0] = static_cast<std::uint8_t>(bytes.Byte() | 1U);
}

double Number(FuzzBytes& bytes, double usual) {
  return bytes.Below(3) == 0 ? bytes.Any<double>() : usual;
}

void FuzzPoll(FuzzBytes& bytes) {
  protocol::Poll poll;
  Fill(poll.poll, bytes);
  Fill(poll.hazard, bytes);
  poll.stamp_ns = bytes.Any<std::int64_t>();
  poll.expires_ns = bytes.Any<std::int64_t>();
  poll.class_name = bytes.Text();
  poll.position = {Number(bytes, 40), Number(bytes, 8)};
  const double covariance = Number(bytes, 0);
  poll.covariance_m2 << Number(bytes, 1), covariance, covariance, Number(bytes, 1);
  try {
    protocol::CheckPoll(poll);
  } catch (const Error& error) {
    Require(std::string(error.what()).size() < 900);
    return;
  }
  Require(!poll.poll.IsNil() && !poll.hazard.IsNil() && geo::IsValid(poll.position));
  Require(!poll.class_name.empty() && poll.class_name.size() <= protocol::kMaxClassNameBytes);
  Require(poll.expires_ns > poll.stamp_ns && poll.covariance_m2.allFinite());
  Require(poll.covariance_m2(0, 0) > 0 && poll.covariance_m2(1, 1) > 0);
}

void FuzzReply(FuzzBytes& bytes) {
  protocol::PollAnswer reply;
  Fill(reply.poll, bytes);
  Fill(reply.hazard, bytes);
  reply.confidence = static_cast<float>(Number(bytes, 0.5));
  reply.vehicle_position = {Number(bytes, 40), Number(bytes, 8)};
  reply.course_rad = Number(bytes, 1);
  reply.reason = bytes.Text();
  reply.drive_id = bytes.Text();
  reply.image_format = bytes.Text();
  try {
    protocol::CheckAnswer(reply);
  } catch (const Error& error) {
    Require(std::string(error.what()).size() < 900);
    return;
  }
  Require(!reply.poll.IsNil() && reply.confidence >= 0 && reply.confidence <= 1);
  Require(geo::IsValid(reply.vehicle_position) && !std::isinf(reply.course_rad));
  Require(reply.reason.size() <= 64 && reply.drive_id.size() <= 64);
}

/// A zone that asks: a candidate, and cars that drive past it.
class AskingZone {
 public:
  AskingZone() {
    zone::ZoneService::Config config;
    config.directory = folder_ + "/zone";
    config.polls.bytes_per_hour = 1e12;
    config.allowance.evidence_per_hour = 1e9;
    zone_ = std::make_unique<zone::ZoneService>(
        config, [this] { return now_ns_; }, 1);
  }
  ~AskingZone() {
    zone_.reset();
    std::filesystem::remove_all(folder_);
  }

  /// A poll about a hazard of its own, to a vehicle that drives up to it.
  protocol::Poll Ask() {
    now_ns_ += std::int64_t{3600} * 1'000'000'000;
    protocol::Report report;
    report.uuid.bytes[0] = 1;
    report.uuid.bytes[15] = static_cast<std::uint8_t>(count_);
    report.uuid.bytes[14] = static_cast<std::uint8_t>(count_ >> 8);
    report.vehicle_id = "reporter-" + std::to_string(count_);
    report.stamp_ns = now_ns_;
    report.class_name = "traffic_cone";
    report.confidence = 0.5F;
    report.box = {1, 1, 2, 2};
    report.position = {-60 + 0.01 * count_, 8};
    report.covariance_m2 = Eigen::Matrix2d::Identity();
    report.image_width = report.image_height = 10;
    zone_->Handle(report);
    now_ns_ += std::int64_t{7200} * 1'000'000'000;
    const std::string vehicle = "car-" + std::to_string(count_++);
    // 50 m south of it, northwards.
    zone_->UpdateVehicle(
        {vehicle, "", {report.position.latitude_deg - 0.00045, 8}, 0, 10, now_ns_, 0});
    for (protocol::Poll& order : zone_->TakeDuePolls()) {
      if (order.vehicle_id == vehicle) return order;
    }
    std::abort();
  }

  zone::ZoneService& zone() { return *zone_; }
  std::int64_t now_ns() const { return now_ns_; }
  int count() const { return count_; }

 private:
  const std::string folder_ = FuzzFolder("poll_fuzz");
  std::int64_t now_ns_ = 1'700'000'000'000'000'000;
  int count_ = 0;
  std::unique_ptr<zone::ZoneService> zone_;
};

void FuzzAnswer(FuzzBytes& bytes) {
  static std::unique_ptr<AskingZone> asking;
  if (!asking || asking->count() >= 200) asking = std::make_unique<AskingZone>();
  const protocol::Poll order = asking->Ask();
  protocol::PollAnswer answer;
  answer.poll = order.poll;
  answer.hazard = order.hazard;
  answer.vehicle_id = order.vehicle_id;
  if (bytes.Below(16) == 0) Fill(answer.poll, bytes);
  if (bytes.Below(16) == 0) Fill(answer.hazard, bytes);
  if (bytes.Below(16) == 0) answer.vehicle_id = bytes.Text();
  answer.answer = static_cast<protocol::PollAnswer::Answer>(bytes.Below(3));
  answer.stamp_ns = bytes.Below(3) == 0 ? bytes.Any<std::int64_t>() : asking->now_ns();
  answer.confidence = static_cast<float>(Number(bytes, 0.5));
  answer.vehicle_position = {Number(bytes, 40), Number(bytes, 8)};
  answer.reason = bytes.Below(2) == 0 ? bytes.Text() : "";
  answer.image_format = bytes.Text();
  const std::string image = bytes.Below(2) == 0 ? bytes.Text() : "";
  answer.image.assign(image.begin(), image.end());
  const zone::ZoneStatistics before = asking->zone().Statistics();
  const bool counted = asking->zone().HandleAnswer(answer);
  const zone::ZoneStatistics after = asking->zone().Statistics();
  Require(after.answers == before.answers + (counted ? 1 : 0));
  Require(after.answers_refused == before.answers_refused + (counted ? 0 : 1));
  if (counted) {
    Require(answer.poll == order.poll && answer.vehicle_id == order.vehicle_id);
    Require(answer.confidence >= 0 && answer.confidence <= 1);
    Require(!asking->zone().HandleAnswer(answer));
  }
  const auto hazard = asking->zone().Find(order.hazard);
  Require(hazard && hazard->presence >= 0 && hazard->presence <= 1);
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzBytes bytes(data, size);
  livemap::fuzz::FuzzPoll(bytes);
  livemap::fuzz::FuzzReply(bytes);
  livemap::fuzz::FuzzAnswer(bytes);
  return 0;
}
