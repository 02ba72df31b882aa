#include "protocol/poll_validation.h"

#include <cmath>
#include <string>

#include "common/error.h"
#include "protocol/report.h"

namespace livemap::protocol {
namespace {

constexpr std::size_t kMaxReasonBytes = 64;
constexpr std::size_t kMaxNameBytes = 64;

void RequirePollIds(const Uuid& poll, const Uuid& hazard, const std::string& name) {
  if (!poll.IsNil() && !hazard.IsNil()) return;
  throw Error(name + " has a nil " + (poll.IsNil() ? "poll_uuid" : "hazard_uuid") +
              ", accepted is the uuid of one");
}

void RequirePollPosition(const geo::GeoPoint& position, const std::string& name) {
  if (geo::IsValid(position)) return;
  throw Error(name + " has position " + std::to_string(position.latitude_deg) + ", " +
              std::to_string(position.longitude_deg) + ", accepted are WGS84 degrees");
}

void RequireShortPollText(const std::string& text, std::size_t limit, const std::string& what) {
  if (text.size() <= limit) return;
  throw Error(what + " has " + std::to_string(text.size()) + " bytes, accepted are at most " +
              std::to_string(limit));
}

void RequirePollCovariance(const Eigen::Matrix2d& covariance_m2) {
  const double determinant =
      covariance_m2(0, 0) * covariance_m2(1, 1) - covariance_m2(0, 1) * covariance_m2(1, 0);
  const bool positive = covariance_m2.allFinite() && covariance_m2(0, 0) > 0 &&
                        covariance_m2(1, 1) > 0 && determinant > 0 && std::isfinite(determinant) &&
                        covariance_m2(0, 1) == covariance_m2(1, 0);
  if (positive) return;
  throw Error(
      "hazard poll has a covariance that is none, accepted is one that is finite, symmetric and "
      "positive definite");
}

}  // namespace

void CheckPoll(const Poll& poll) {
  RequirePollIds(poll.poll, poll.hazard, "hazard poll");
  RequirePollPosition(poll.position, "hazard poll");
  RequirePollCovariance(poll.covariance_m2);
  RequireShortPollText(poll.class_name, kMaxClassNameBytes, "class_name of a hazard poll");
  if (poll.class_name.empty()) {
    throw Error("hazard poll has no class_name, accepted is the hazard's class");
  }
  if (poll.expires_ns <= poll.stamp_ns) {
    throw Error("hazard poll expires before it was asked, accepted is a later moment");
  }
}

void CheckAnswer(const PollAnswer& answer) {
  RequirePollIds(answer.poll, answer.hazard, "poll answer");
  if (!(answer.confidence >= 0 && answer.confidence <= 1)) {
    throw Error("poll answer has confidence " + std::to_string(answer.confidence) +
                ", accepted is 0 to 1");
  }
  RequirePollPosition(answer.vehicle_position, "poll answer");
  if (std::isinf(answer.course_rad)) {
    throw Error("poll answer has an infinite course, accepted are radians, or NaN when standing");
  }
  RequireShortPollText(answer.reason, kMaxReasonBytes, "reason of a poll answer");
  RequireShortPollText(answer.drive_id, kMaxNameBytes, "drive_id of a poll answer");
  RequireShortPollText(answer.image_format, kMaxNameBytes, "image format of a poll answer");
}

}  // namespace livemap::protocol
