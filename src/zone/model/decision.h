#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/error.h"
#include "geo/wgs84.h"

namespace livemap::zone {

/// What an official decided, as stored: the numbers never change.
enum class DecisionKind : std::uint8_t {
  kConfirmHazard = 0,
  kRejectHazard = 1,
  kConfirmMapChange = 2,
  kDismissMapChange = 3,
  kDistrustVehicle = 4,
  kUndo = 5,            ///< Of the newest decision about a hazard or a map change.
  kTrustVehicle = 6,    ///< Takes all distrust of a vehicle back.
  kComment = 7,         ///< The reason is the comment.
  kAssign = 8,          ///< To a team, or to none.
  kCloseHazard = 9,     ///< It was there and is repaired.
  kReclassHazard = 10,  ///< It is of another class.
  kMoveHazard = 11,     ///< It lies elsewhere.
  kMergeHazard = 12,    ///< Another hazard is the same one, and gone from the map.
  kAskFrame = 13,       ///< The next vehicle that passes is asked for the whole frame.
  kForgetVehicle = 14,  ///< All that leads to a vehicle was erased; the subject is a pseudonym.
  kCloseOrder = 15,     ///< A work order of the hazard is done, by the official's word.
  kRetryOrder = 16,     ///< A work order of the hazard that was given up is sent again.
};
constexpr std::size_t kDecisionKinds = 17;

/// A decision's text, a comment's above all, has at most so many bytes of valid UTF-8.
constexpr std::size_t kMaxDecisionTextBytes = 500;

/// Whether the decision is about a work order of the hazard. What was sent cannot be taken back.
constexpr bool IsOfOrder(DecisionKind kind) {
  return kind == DecisionKind::kCloseOrder || kind == DecisionKind::kRetryOrder;
}

/// Whether the decision leaves alone whether the hazard is there (HazardDesk).
constexpr bool IsOfDesk(DecisionKind kind) {
  return kind == DecisionKind::kComment || kind == DecisionKind::kAssign ||
         kind == DecisionKind::kReclassHazard || kind == DecisionKind::kMoveHazard ||
         kind == DecisionKind::kMergeHazard || kind == DecisionKind::kAskFrame || IsOfOrder(kind);
}

/// "confirm", "reject", "confirm", "dismiss", "distrust", "undo", "trust", "comment", "assign",
/// "close", "class", "move", "merge", "frame", "forget", "close_order" or "retry_order".
constexpr const char* DecisionName(DecisionKind kind) {
  switch (kind) {
    case DecisionKind::kConfirmHazard:
    case DecisionKind::kConfirmMapChange:
      return "confirm";
    case DecisionKind::kRejectHazard:
      return "reject";
    case DecisionKind::kDismissMapChange:
      return "dismiss";
    case DecisionKind::kDistrustVehicle:
      return "distrust";
    case DecisionKind::kUndo:
      return "undo";
    case DecisionKind::kTrustVehicle:
      return "trust";
    case DecisionKind::kComment:
      return "comment";
    case DecisionKind::kAssign:
      return "assign";
    case DecisionKind::kCloseHazard:
      return "close";
    case DecisionKind::kReclassHazard:
      return "class";
    case DecisionKind::kMoveHazard:
      return "move";
    case DecisionKind::kMergeHazard:
      return "merge";
    case DecisionKind::kAskFrame:
      return "frame";
    case DecisionKind::kForgetVehicle:
      return "forget";
    case DecisionKind::kCloseOrder:
      return "close_order";
    case DecisionKind::kRetryOrder:
      return "retry_order";
  }
  return "unknown";
}

/// A decision that does not fit what is there now: its sentence says what stands in the way.
/// Nothing of it was done, and the official may decide anew.
class DecisionConflict : public Error {
 public:
  using Error::Error;
};

/// The official has done so too often for now: the sentence says how often one may.
class DecisionTooOften : public Error {
 public:
  using Error::Error;
};

/// What an official saw of a hazard before deciding about it.
struct SeenHazard {
  std::uint64_t sequence = 0;             ///< Of the hazard's newest event by then.
  std::optional<geo::GeoPoint> position;  ///< None: its place does not matter.
};

/// One decision of an official, with all that its undoing needs.
struct DecisionRecord {
  std::uint64_t id = 0;  ///< Rises from 1; the store gives it.
  DecisionKind kind = DecisionKind::kConfirmHazard;
  std::string subject;          ///< UUID of the hazard or the map change, or the vehicle's name.
  std::string official;         ///< Printable UTF-8 of at most 64 bytes.
  std::string reason;           ///< Of at most kMaxDecisionTextBytes; may be empty.
  std::string detail;           ///< What was changed into what, in words; may be empty.
  std::int64_t at_ns = 0;       ///< Zone clock.
  std::uint64_t hazards = 0;    ///< Of a vehicle's: how many it changed.
  std::uint64_t undone_by = 0;  ///< Id of the decision that took it back; 0: it stands.
  /// What was before, as one line of plain numbers: PackPresence of a hazard's life, PackBefore of
  /// a map change, PackTrust of a vehicle; of a desk's decision see HazardDesk.
  std::string before;
  /// What it did to vehicles and to the class: PackEffects; empty when nothing.
  std::string effects;
};

/// How much a decision added to the suspicion of one vehicle.
struct SuspicionChange {
  std::uint64_t vehicle = 0;  ///< VehicleKey.
  double added = 0;           ///< Log odds; negative when it cleared the vehicle.
};

/// What a decision about a hazard did beside the hazard itself.
struct DecisionEffects {
  std::vector<SuspicionChange> suspicions;
  double stood_s = 0;  ///< What the class's lifetime learned, seconds.
};

/// One line of plain numbers, at most 500 bytes; exact.
std::string PackEffects(const DecisionEffects& effects);
/// Inverse of PackEffects; none when `text` is anything else.
std::optional<DecisionEffects> UnpackEffects(const std::string& text);

/// What `distrust` would do to one hazard.
struct DistrustExample {
  std::string hazard;      ///< UUID.
  std::string class_name;  ///< Of the hazard.
  std::string from;        ///< State before.
  std::string to;          ///< State afterwards.
};

/// What `distrust` of a vehicle would do now.
struct DistrustPreview {
  bool is_distrusted = false;    ///< A distrust of the vehicle stands.
  std::size_t hazards = 0;       ///< About which its word counts.
  std::size_t would_change = 0;  ///< Of those, how many would get another state,
  std::size_t would_vanish = 0;  ///< and of these, how many would be gone.
  std::vector<DistrustExample>
      examples;  ///< Some of those that would change, vanishing ones first.
  std::vector<DecisionRecord> decisions;  ///< The newest about the vehicle, the newest first.
};

}  // namespace livemap::zone
