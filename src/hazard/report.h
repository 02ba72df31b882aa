#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "base/uuid.h"
#include "geo/wgs84.h"

namespace livemap {

/// Class names of detectors and of the zone may be this long.
constexpr std::size_t kMaxClassNameBytes = 64;

/// A rectangle in an image: edges in pixels, x to the right and y down, (0, 0) the outer corner of
/// the first pixel, min < max.
struct Box {
  float x_min = 0;
  float y_min = 0;
  float x_max = 0;
  float y_max = 0;
};

/// A part of an image in whole pixels. Without width or height it stands for the whole image.
struct PixelRegion {
  std::uint32_t x = 0;  ///< Left edge.
  std::uint32_t y = 0;  ///< Upper edge.
  std::uint32_t width = 0;
  std::uint32_t height = 0;

  bool IsWholeImage() const { return width == 0 && height == 0; }
};

/// One hazard that one vehicle asks the zone to put on the map (HazardReport.msg without ROS).
/// Everything that handles reports is idempotent by `uuid`.
struct Report {
  Uuid uuid;               ///< Version 4, made by the vehicle.
  std::string vehicle_id;  ///< Empty on the vehicle; the zone's bridge writes the proven identity.
  std::string drive_id;
  std::int64_t stamp_ns = 0;  ///< Of the image, vehicle clock (UTC), ns since 1970.
  std::string class_name;
  float confidence = 0;  ///< 0..1.
  Box box;               ///< In the original image.
  GeoPoint position;     ///< Of the hazard itself on the ground.
  /// Of the horizontal position, local east-north axes, m^2; symmetric, positive definite.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();
  std::uint32_t image_width = 0;  ///< Of the original image, pixels.
  std::uint32_t image_height = 0;
  std::string image_frame_id;       ///< Optical frame of the original image.
  std::string image_format;         ///< "jpeg", or empty when there is no picture.
  std::vector<std::uint8_t> image;  ///< Annotated picture as a compressed file; may be empty.
  PixelRegion shown;                ///< What of the original image the picture shows.
};

/// The zone's answer to one report.
struct Receipt {
  enum class Status {
    kCommitted,  ///< Durably stored by the zone.
    kRefused,    ///< Will never be accepted; see `reason`.
  };
  Status status = Status::kRefused;
  Uuid report_uuid;
  Uuid hazard_uuid;        ///< The hazard it became or was merged into; nil when refused.
  std::string vehicle_id;  ///< Addressee.
  std::string reason;      ///< One sentence, empty when committed.
};

/// The zone tells vehicles what changed on its map (HazardNotice.msg without ROS).
struct Notice {
  enum class Action { kAdded, kUpdated, kRemoved, kCaughtUp };
  Action action = Action::kAdded;
  std::uint64_t sequence = 0;  ///< Of the zone's event log, strictly increasing.
  /// To everybody: of the announcement before; 0: there was none. With kCaughtUp: where the telling
  /// began, see HazardNotice.msg.
  std::uint64_t previous_sequence = 0;
  std::string vehicle_id;     ///< Addressee; empty: everybody.
  Uuid hazard_uuid;           ///< Nil with kCaughtUp.
  std::int64_t stamp_ns = 0;  ///< When the zone decided, zone clock (UTC).
  std::string class_name;
  float confidence = 0;  ///< 0..1.
  GeoPoint position;     ///< With kCaughtUp: the middle of what was told.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< As in Report.
  std::uint32_t sightings = 0;                              ///< Reports merged so far.
  std::int64_t first_seen_ns = 0;                           ///< Image stamp of the first report.
  std::int64_t last_seen_ns = 0;                            ///< Image stamp of the newest report.
  double radius_m = 0;                                      ///< kCaughtUp: around `position`.
  std::uint32_t told = 0;           ///< kCaughtUp: hazards told since the kCaughtUp before.
  std::string image_format;         ///< "jpeg", or empty when there is no picture.
  std::vector<std::uint8_t> image;  ///< Small annotated picture; may be empty.
};

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
  GeoPoint position;                                        ///< Of the hazard.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< As in Report.
  PollPicture picture = PollPicture::kNone;
  std::uint32_t max_picture_bytes = 0;
};

/// What a vehicle saw at a hazard's place (HazardPollAnswer.msg without ROS).
struct PollReply {
  enum class Answer { kYes, kNo, kCantSee };
  Uuid poll;
  Uuid hazard;
  std::string vehicle_id;  ///< Empty on the vehicle; the zone's bridge writes the proven identity.
  std::string drive_id;
  std::int64_t stamp_ns = 0;  ///< Of the image that decided, vehicle clock (UTC).
  Answer answer = Answer::kCantSee;
  std::string reason;         ///< One sentence, why kCantSee; else empty.
  float confidence = 0;       ///< 0..1, of kYes and kNo.
  GeoPoint vehicle_position;  ///< At `stamp_ns`.
  double course_rad = 0;      ///< Clockwise from true north; NaN when standing.
  std::string image_format;   ///< "jpeg", or empty when there is no picture.
  std::vector<std::uint8_t> image;
};

}  // namespace livemap
