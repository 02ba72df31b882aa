#include "web/feeds/formats/denm_feed.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "geo/wgs84.h"

namespace livemap::web {
namespace {

/// TimestampIts counts milliseconds of TAI since 2004, UTC's leap seconds since then included.
constexpr std::int64_t kItsEpochMs = 1'072'915'200'000;
constexpr std::int64_t kLeapMsSince2004 = 5000;
constexpr int kUnavailableAltitude = 800'001;
constexpr int kUnavailableHeading = 3601;
constexpr int kMaxSemiAxisCm = 4093;
constexpr int kSemiAxisOutOfRange = 4094;
constexpr int kSemiAxisUnavailable = 4095;
constexpr int kRoadSideUnit = 15;
constexpr std::int64_t kMaxValidityS = 86'400;

std::int64_t TimestampIts(std::int64_t time_ns) {
  return std::max<std::int64_t>(0, time_ns / 1'000'000 - kItsEpochMs + kLeapMsSince2004);
}

/// A tenth of a microdegree.
std::int64_t ItsDegrees(double degrees) { return std::llround(degrees * 1e7); }

/// A tenth of a degree clockwise from north, 0 to 3599.
int ItsHeading(double radians) {
  const double turn = std::fmod(std::fmod(radians / (2 * M_PI), 1.0) + 1.0, 1.0);
  return static_cast<int>(std::lround(turn * 3600)) % 3600;
}

int SemiAxis(double sigma_m) {
  // 95 % of a normal distribution along the axis.
  const double cm = std::ceil(1.96 * sigma_m * 100);
  return cm > kMaxSemiAxisCm ? kSemiAxisOutOfRange : std::max(1, static_cast<int>(cm));
}

Json ConfidenceEllipse(const Eigen::Matrix2d& covariance_m2) {
  Json ellipse{{"semiMajorConfidence", kSemiAxisUnavailable},
               {"semiMinorConfidence", kSemiAxisUnavailable},
               {"semiMajorOrientation", kUnavailableHeading}};
  if (!covariance_m2.allFinite()) return ellipse;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance_m2);
  const Eigen::Vector2d& variances = solver.eigenvalues();
  if (!(variances(1) > 0) || variances(0) < 0) return ellipse;
  const Eigen::Vector2d axis = solver.eigenvectors().col(1);
  ellipse["semiMajorConfidence"] = SemiAxis(std::sqrt(variances(1)));
  ellipse["semiMinorConfidence"] = SemiAxis(std::sqrt(variances(0)));
  // East and north: the angle is clockwise from north.
  ellipse["semiMajorOrientation"] = ItsHeading(std::atan2(axis.x(), axis.y()));
  return ellipse;
}

/// An identifier of a station has 32 bits and its count of events 16: together they take 48 bits of
/// the hazard's id, so that no two of a zone are the same.
Json ActionId(const Uuid& uuid) {
  std::uint32_t station = 0;
  for (std::size_t i = 0; i < 4; ++i) station = station << 8U | uuid.bytes[i];
  const auto number = static_cast<std::uint32_t>(uuid.bytes[14] << 8U | uuid.bytes[15]);
  return {{"originatingStationID", station}, {"sequenceNumber", number}};
}

/// 1 (lowest) to 7 by the probability that it is there.
int InformationQuality(float presence) {
  return 1 + static_cast<int>(std::lround(6 * std::clamp(static_cast<double>(presence), 0.0, 1.0)));
}

Json Management(const FeedHazard& hazard) {
  const zone::Hazard& fact = hazard.hazard;
  Json management;
  management["actionID"] = ActionId(fact.uuid);
  management["detectionTime"] = TimestampIts(fact.last_seen_ns);
  management["referenceTime"] = TimestampIts(fact.updated_ns);
  if (!zone::IsTold(fact.state)) {
    const bool is_negated = fact.state == zone::HazardState::kRejected;
    management["termination"] = is_negated ? "isNegation" : "isCancellation";
  }
  management["eventPosition"] = {
      {"latitude", ItsDegrees(fact.position.latitude_deg)},
      {"longitude", ItsDegrees(fact.position.longitude_deg)},
      {"positionConfidenceEllipse", ConfidenceEllipse(fact.covariance_m2)},
      {"altitude",
       {{"altitudeValue", kUnavailableAltitude}, {"altitudeConfidence", "unavailable"}}}};
  management["validityDuration"] = std::clamp<std::int64_t>(
      std::llround(std::clamp(hazard.expected_life_s, 0.0, 1e9)), 1, kMaxValidityS);
  management["stationType"] = kRoadSideUnit;
  return management;
}

Json Location(const zone::Hazard& hazard) {
  Json location;
  if (std::isfinite(hazard.course_rad)) {
    constexpr int kUnavailableConfidence = 127;
    location["eventPositionHeading"] = {{"headingValue", ItsHeading(hazard.course_rad)},
                                        {"headingConfidence", kUnavailableConfidence}};
  }
  // At least one trace belongs there; it may be empty.
  location["traces"] = Json::array({Json::array()});
  return location;
}

}  // namespace

Json DenmJson(const FeedHazard& hazard) {
  Json message;
  const Json id = ActionId(hazard.hazard.uuid);
  message["header"] = {
      {"protocolVersion", 2}, {"messageID", 1}, {"stationID", id["originatingStationID"]}};
  Json& denm = message["denm"];
  denm["management"] = Management(hazard);
  // A termination has no further containers.
  if (denm["management"].contains("termination")) return message;
  denm["situation"] = {
      {"informationQuality", InformationQuality(hazard.hazard.presence)},
      {"eventType",
       {{"causeCode", hazard.codes.cause_code}, {"subCauseCode", hazard.codes.sub_cause_code}}}};
  denm["location"] = Location(hazard.hazard);
  return message;
}

void DenmFeed::Begin(const FeedHead& /*head*/, std::string& /*text*/) {}

void DenmFeed::Add(const FeedHazard& hazard, std::string& text) {
  text += ToText({{"id", hazard.id}, {"message", DenmJson(hazard)}}) + '\n';
}

bool DenmFeed::End(std::string& /*text*/) { return false; }

}  // namespace livemap::web
