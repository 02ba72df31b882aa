#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "geo/fix_plausibility.h"
#include "geo/wgs84.h"

namespace livemap::localization {

/// Chooses the datum by fixes that agree: no single fix is believed, least of all the first. Two
/// fixes agree when a vehicle can have been at both. The datum is the first fix of the largest
/// group, once that is a majority. Not thread-safe.
class DatumElection {
 public:
  struct Config {
    /// So many fixes must agree.
    std::size_t min_fixes = 3;
    /// Over this time at least, s.
    double min_span_s = 0;
    /// After this time the largest group is enough, be it no majority, s.
    double max_wait_s = 30;
    /// Of the vehicle, m/s.
    double max_speed_mps = 80;
  };

  explicit DatumElection(const Config& config) : config_(config) {}

  /// The datum, once it is chosen. `fix` has a position on the earth. Its stamp is newer than that
  /// of the last one; else it does not count.
  std::optional<geo::GeoPoint> Add(const geo::ReceiverPoint& fix);
  void Reset();

 private:
  struct Candidate {
    geo::ReceiverPoint fix;
    std::size_t votes = 1;  ///< Of the candidates with which it agrees; itself among them.
  };

  void ForgetOldest();
  bool Agree(const Candidate& a, const Candidate& b) const {
    return geo::AreReachable(a.fix, b.fix, config_.max_speed_mps);
  }

  Config config_;
  std::int64_t begun_ns_ = 0;         ///< Stamp of the first fix; 0: none came.
  std::deque<Candidate> candidates_;  ///< Ascending stamps; the newest ones.
};

}  // namespace livemap::localization
