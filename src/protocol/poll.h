#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/wgs84.h"

namespace livemap::protocol {

/// What picture an answer to a poll shall bring.
enum class PollPicture {
  kNone,
  kCrop,       ///< The hazard's place and its surroundings, as in a report.
  kFullFrame,  ///< The whole image that decided.
};

/// The zone asks one vehicle whether a hazard is still there (HazardPoll.msg without ROS).
struct Poll {
  Uuid poll;
  Uuid hazard;                  ///< The zone's id.
  std::string vehicle_id;       ///< Addressee.
  std::int64_t stamp_ns = 0;    ///< When the zone asked, zone clock (UTC).
  std::int64_t expires_ns = 0;  ///< An answer after this counts no more, zone clock.
  std::string class_name;
  geo::GeoPoint position;                                   ///< Of the hazard.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< As in Report.
  PollPicture picture = PollPicture::kNone;
  std::uint32_t max_picture_bytes = 0;
  std::string zone;  ///< Id of the zone that asks; empty at the zone.
};

/// What a vehicle saw at a hazard's place (HazardPollAnswer.msg without ROS).
struct PollAnswer {
  enum class Answer { kYes, kNo, kCantSee };
  Uuid poll;
  Uuid hazard;
  std::string vehicle_id;  ///< Empty on the vehicle; the zone's bridge writes the proven identity.
  std::string drive_id;
  std::int64_t stamp_ns = 0;  ///< Of the image that decided, vehicle clock (UTC).
  Answer answer = Answer::kCantSee;
  std::string reason;              ///< One sentence, why kCantSee; else empty.
  float confidence = 0;            ///< 0..1, of kYes and kNo.
  geo::GeoPoint vehicle_position;  ///< At `stamp_ns`.
  double course_rad = 0;           ///< Clockwise from true north; NaN when standing.
  std::string image_format;        ///< "jpeg", or empty when there is no picture.
  std::vector<std::uint8_t> image;
  std::string zone;  ///< Id of the zone that asked; empty at the zone.
};

}  // namespace livemap::protocol
