#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/wgs84.h"
#include "zone/model/decision.h"

namespace livemap::zone {

/// Where a report goes that would match a hazard as it was before an official edited it: vehicles
/// go on reporting what they see, and must not undo what the official did.
struct Redirect {
  std::uint64_t decision = 0;                        ///< By which it stands and falls.
  DecisionKind kind = DecisionKind::kReclassHazard;  ///< Or kMoveHazard, kMergeHazard.
  std::string class_name;                            ///< Of the hazard before.
  geo::GeoPoint position{};                          ///< Of the hazard before.
  Uuid from;    ///< The hazard itself; of a merge the one that is gone.
  Uuid hazard;  ///< To which the reports belong.
};

/// All redirects of the zone: few, since each was made by hand. Not thread-safe.
class Redirects {
 public:
  void Add(Redirect redirect) { redirects_.push_back(std::move(redirect)); }
  void Drop(std::uint64_t decision);
  std::size_t size() const { return redirects_.size(); }

  /// The hazard to which a report of this class at this place belongs, if a redirect within
  /// `radius_m` (geodesic) leads to one for which `is_there` holds: the nearest. One that was
  /// merged away leads on to the hazard into which it was.
  std::optional<Uuid> Find(const std::string& class_name, const geo::GeoPoint& position,
                           double radius_m, const std::function<bool(const Uuid&)>& is_there) const;
  /// Whether the hazard is gone because it is another one.
  bool IsMergedAway(const Uuid& hazard) const;
  /// Whether an official has said where the hazard lies.
  bool IsPlaced(const Uuid& hazard) const;

 private:
  std::optional<Uuid> Follow(Uuid hazard, const std::function<bool(const Uuid&)>& is_there) const;

  std::vector<Redirect> redirects_;
};

}  // namespace livemap::zone
