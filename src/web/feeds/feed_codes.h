#pragma once

#include <string_view>

namespace livemap::web {

/// What a class of hazards is in safety-related traffic information (Delegated Regulation (EU) No
/// 886/2013, Article 3).
enum class SrtiKind {
  kNone,      ///< It belongs to no category.
  kAnimal,    ///< (b) animals on the road.
  kObstacle,  ///< (b) obstacles and debris on the road.
  kAccident,  ///< (c) unprotected accident area.
  kRoadworks  ///< (d) short-term road works.
};

/// What a class of hazards says of a work zone.
enum class WorkDeviceKind {
  kNone,     ///< Nothing.
  kChannel,  ///< A device that leads traffic: a cone. One alone makes no work zone.
  kBarrier,  ///< A barrier.
  kSign,     ///< A sign.
  kMachine   ///< A machine at work.
};

/// What the standards call a class of hazards. docs/reference/feeds.md has the whole table.
struct FeedCodes {
  /// CauseCodeType and the sub-cause of it, of ETSI TS 102 894-2 V1.3.1, A.10 and following.
  int cause_code = 10;
  int sub_cause_code = 0;
  const char* cifs_type = "HAZARD";  ///< Type and subtype of Waze's CIFS.
  const char* cifs_subtype = "HAZARD_ON_ROAD";
  SrtiKind srti = SrtiKind::kObstacle;
  /// DATEX II v3: obstructionType, animalPresenceType or roadMaintenanceType, by `srti`.
  const char* datex_type = "hazardsOnTheRoad";
  WorkDeviceKind work = WorkDeviceKind::kNone;
};

/// The codes of a class of the shipped catalogue; of any other name those of an unspecified hazard
/// on the road.
FeedCodes CodesOf(std::string_view class_name);

}  // namespace livemap::web
