#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "protocol/hazard_catalogue.h"
#include "protocol/poll.h"
#include "streets/address_map.h"
#include "streets/street_map.h"
#include "zone/admission/report_validation.h"
#include "zone/admission/speed_rule.h"
#include "zone/admission/vehicle_allowance.h"
#include "zone/belief/hazard_lifecycle.h"
#include "zone/belief/survival_model.h"
#include "zone/belief/vehicle_trust.h"
#include "zone/pictures/picture_allowance.h"
#include "zone/polling/poll_scheduler.h"
#include "zone/registry/map_change_registry.h"
#include "zone/registry/vehicle_track.h"
#include "zone/store/zone_lease.h"

namespace livemap::zone {

/// Settings of a zone, with the rules of all its parts.
struct ZoneConfig {
  std::string directory;  ///< Holds zone.sqlite3 and images/; made when missing.
  std::string store_url;  ///< Of PostgreSQL, in place of zone.sqlite3 (ZoneStore).
  /// Under which the store is written, of store_url; null: no other process waits to take over.
  std::shared_ptr<const ZoneLease> lease;
  double image_cap_bytes = 2e9;       ///< Pictures on disk; the oldest go beyond it.
  double picture_days = 0;            ///< Pictures go so long after they came; 0: never.
  double vehicle_retention_s = 600;   ///< A vehicle not heard of for this long is forgotten.
  std::size_t max_vehicles = 10000;   ///< The longest silent one goes beyond it.
  std::size_t max_hazards = 5000000;  ///< On the map; new ones beyond it are refused.
  /// On the map by one vehicle's word alone; new ones of that vehicle beyond it are refused.
  std::size_t max_hazards_by_one_vehicle = 2000;
  protocol::PollPicture poll_picture =
      protocol::PollPicture::kCrop;  ///< What polls ask for, where they want one.
  ReportLimits limits;
  UnknownClasses unknown_classes = UnknownClasses::kOther;
  SpeedRule speed;
  VehicleAllowance::Config allowance;  ///< Of one vehicle; further reports must wait.
  PictureAllowance::Config pictures;
  HazardLifecycle::Config life;
  SurvivalModel::Config survival;
  VehicleTrust::Config trust;  ///< `malicious_share` is that of `life`.
  PollScheduler::Config polls;
  MapChangeRegistry::Rule map_changes;
  double map_changes_per_hour = 240;  ///< Of one vehicle, >= 1; further ones must wait.
  SightRule sight;                    ///< Whose answer to a poll counts.
  /// Officials' requests for whole frames of polls.frame_bytes: how long one is open, s, and how
  /// many one official may make in an hour, >= 1.
  double frame_timeout_s = 4 * 3600.0;
  double frames_per_hour = 30;
  /// Drives are played back: what vehicles say is as old as its arrival, whatever its stamps say,
  /// and max_age_s does not hold. Never in a zone that drivers rely on: it lets old reports in.
  bool replay = false;
  /// Vehicles are told how others passed hazards (Hazard::trails), up to 300 m of their ways,
  /// without their names.
  bool hazard_trails = true;
  protocol::HazardCatalogue catalogue;
  /// Those of the zone, by which places have names and carriageways; null: the zone knows none.
  std::shared_ptr<const streets::StreetMap> streets;
  /// The house numbers of the same file; null: none are said.
  std::shared_ptr<const streets::AddressMap> addresses;
};

/// The settings as the zone works by them: what one part takes over from another is filled in.
/// Throws Error that names the value that is out of range; parts check their own settings.
ZoneConfig CheckedConfig(ZoneConfig config);

}  // namespace livemap::zone
