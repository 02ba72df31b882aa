#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "placement/hazard_sights.h"
#include "protocol/hazard_catalogue.h"

namespace livemap::vehicle {

/// The hazards that the vehicle passes now, each with its sights. It says which sight is of which
/// hazard: the nearest one of its class that it fits, one sight per hazard and image. Not
/// thread-safe.
class PassSights {
 public:
  /// Of a hazard of this pass, never used again; 0: none.
  using Id = std::uint64_t;

  struct Config {
    placement::HazardSights::Config sights;
    /// Greatest squared Mahalanobis distance of a sight from its hazard (two degrees of freedom).
    double gate = 13.8;
    /// Greatest distance of a sight's own place from its hazard, duplicate radii of the class.
    double gate_radii = 1.0;
    /// Both where nothing can be mistaken: the image shows one thing of the class, and one was seen
    /// within `lone_s`, no nearer than now. Courses by fixes are worse than they say.
    double lone_gate = 60;
    double lone_radii = 1.0;
    double lone_s = 1.0;
    /// A hazard that has not been seen for so long is passed, s.
    double keep_s = 5.0;
    /// Hazards at once; beyond it the one longest unseen goes.
    int max_hazards = 200;
  };

  /// A sight and the class that it shows.
  struct Seen {
    std::string class_name;
    placement::HazardSight sight;
  };

  PassSights(const Config& config, const protocol::HazardCatalogue& catalogue)
      : config_(config), catalogue_(catalogue) {}

  /// The sights of one image. Returns the hazard of each; 0 for a sight that is unusable.
  std::vector<Id> Add(const std::vector<Seen>& image);
  /// Where the hazard is by all its sights so far; none once it is forgotten.
  std::optional<placement::SightsPlace> Place(Id id) const;
  /// The hazard is reported or known already: further sights of it are no news.
  void MarkKnown(Id id);
  bool IsKnown(Id id) const;
  /// Forgets all: the clock was set back.
  void Reset() { passing_.clear(); }
  std::size_t size() const { return passing_.size(); }

 private:
  struct Passing {
    std::string class_name;
    placement::HazardSights sights;
    std::int64_t seen_ns = 0;
    double range_m = 0;  // Of the newest sight, from base_link.
    bool is_known = false;
  };
  /// A sight that may be of a hazard.
  struct Pair {
    double distance2 = 0;
    std::size_t sight = 0;
    Id id = 0;
  };

  std::vector<Pair> PossiblePairs(const std::vector<Seen>& image) const;
  bool IsLone(const Seen& seen, const std::vector<Seen>& image) const;
  Id Begin(const Seen& seen);
  void ForgetPassed(std::int64_t now_ns);

  Config config_;
  protocol::HazardCatalogue catalogue_;
  std::map<Id, Passing> passing_;
  Id last_id_ = 0;
};

}  // namespace livemap::vehicle
