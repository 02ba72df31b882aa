#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

#include "protocol/hazard_catalogue.h"
#include "vehicle/reporting/pass_sights.h"
#include "vehicle/reporting/waiting_frame.h"

namespace livemap::vehicle {

/// The hazards that are to be reported and wait for further sights first: each sight makes the
/// place surer, and the newest one's picture shows most. They wait while they are in view and their
/// place is not sure yet, `wait_s` at the longest; a hazard that is urgent does not wait.
///
/// Two clocks: `now_s` is the clock of the stamps (it may be a simulated one that pauses),
/// `steady_s` never pauses. They lie in memory alone. Not thread-safe.
class SettlingReports {
 public:
  struct Config {
    /// Longest wait, s: by the clock of the stamps, and by the steady one twice as long, as a bag's
    /// clock may stand still after its end; 0: nothing waits.
    double wait_s = 1.5;
    /// A place as sure as this, seen from the vehicle, does not wait: standard deviation along its
    /// worst axis, m.
    double sigma_m = 0.2;
  };
  /// Reports the hazard that alone is left in the frame. False: it cannot yet, as the picture is
  /// not there; it is asked again.
  using Report = std::function<bool(WaitingFrame& view)>;

  SettlingReports(const Config& config, const protocol::HazardCatalogue& catalogue)
      : config_(config), catalogue_(catalogue) {}

  /// Whether the hazard's report has to wait: it is of a pass, not urgent, and has not waited yet.
  bool HasToWait(const PlacedSighting& candidate) const;
  /// A sight of a hazard that has to wait: candidate `index` of `frame`. True when the hazard is
  /// new here. False when it waits already, by its pass or by class and place; then a newer sight
  /// of the same pass takes the place of the one before, unless that is being reported.
  bool Add(const WaitingFrame& frame, std::size_t index, const PassSights& passes, double now_s,
           double steady_s);
  /// The pictures of this order; false where no hazard here has ordered them. Moves from `pictures`
  /// only when true.
  bool AddPictures(std::uint64_t order, std::vector<imaging::CroppedPicture>& pictures);
  /// Has each hazard reported that has waited long enough, in the order of their first sights, and
  /// forgets those for which `report` is true. Images up to `shown_ns` have been looked through:
  /// what the newest of them do not show is out of view.
  void WorkOff(const PassSights& passes, std::int64_t shown_ns, double now_s, double steady_s,
               const Report& report);
  /// All of them, in the order of their first sights: there will be no further sights.
  std::vector<WaitingFrame> TakeAll();

  std::size_t size() const { return settling_.size(); }

 private:
  struct Settling {
    WaitingFrame view;          // The newest, with the hazard's sighting alone.
    double bottom_step_px = 0;  // How far the box's lower edge came down since the view before.
    double since_s = 0;
    double since_steady_s = 0;
    bool is_due = false;

    const PlacedSighting& hazard() const { return view.candidates.front(); }
  };

  Settling* Find(const PlacedSighting& candidate, const PassSights& passes);
  static bool IsOutOfView(const Settling& settling, std::int64_t shown_ns);
  bool IsSure(const Settling& settling, const PassSights& passes) const;
  bool HasWaited(Settling& settling, double now_s, double steady_s) const;

  Config config_;
  protocol::HazardCatalogue catalogue_;
  std::deque<Settling> settling_;  // In the order of their first sights.
};

}  // namespace livemap::vehicle
