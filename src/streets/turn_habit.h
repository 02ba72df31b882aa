#pragma once

namespace livemap::streets {

/// How often the driver turns off at junctions, as far as this drive tells: who follows a main road
/// passes one crossing after the other, who looks for an address turns at many.
///
/// The driver's odds to turn are estimated from the junctions passed, of which later ones count
/// more, and from what is known of all drivers, which counts as much as a few junctions.
class TurnHabit {
 public:
  struct Config {
    double usual_share = 0.375;    ///< Of junctions at which drivers turn, before any is passed.
    double usual_junctions = 3;    ///< So many junctions the usual share counts for.
    double later_junctions = 0.9;  ///< Weight of a junction against the one passed after it.
  };

  explicit TurnHabit(const Config& config) : config_(config) {}

  /// Notes a junction at which the vehicle could have turned or gone straight on.
  void Passed(bool turned);
  /// Forgets the junctions.
  void Reset();
  /// The odds that the driver turns against those of all drivers; 1 before any junction.
  double factor() const;

 private:
  Config config_;
  double turned_ = 0;
  double straight_ = 0;
};

}  // namespace livemap::streets
