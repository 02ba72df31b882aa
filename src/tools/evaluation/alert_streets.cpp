#include "tools/evaluation/alert_streets.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "datasets/seeded_random.h"
#include "geo/polyline.h"

namespace livemap::tools {
namespace {

using DrawnLine = std::vector<Eigen::Vector2d>;

constexpr double kBendM = 0.5;       // Nearer to the drawn line a point needs no node.
constexpr double kSameM = 0.6;       // So near a point of a line is the junction.
constexpr std::size_t kSpan = 100;   // Points between two nodes at most.
constexpr std::size_t kPiece = 500;  // Points of a piece at most, about.

/// Marks the points that the line needs between two (D. Douglas, T. Peucker 1973).
void MarkBends(const DrawnLine& line, std::size_t first, std::size_t last,
               std::vector<bool>& marks) {
  double furthest_m = 0;
  std::size_t furthest = first;
  for (std::size_t i = first + 1; i < last; ++i) {
    const double off_m = geo::OffLineM(line[first], line[last], line[i]);
    if (off_m > furthest_m) {
      furthest_m = off_m;
      furthest = i;
    }
  }
  const bool bends = furthest_m > kBendM;
  const std::size_t middle = bends ? furthest : first + (last - first) / 2;
  if (!bends && last - first <= kSpan) return;
  marks[middle] = true;
  MarkBends(line, first, middle, marks);
  MarkBends(line, middle, last, marks);
}

/// Draws streets into a map.
class MapDrawer {
 public:
  MapDrawer(const std::vector<Eigen::Vector2d>& junctions_m, const geo::LocalFrame& frame,
            const StreetMapErrors& errors, std::uint64_t seed)
      : junctions_m_(junctions_m), frame_(frame), errors_(errors), random_(seed) {
    for (const Eigen::Vector2d& junction_m : junctions_m) NewNode(junction_m);
  }

  void Draw(const TrafficStreet& street) {
    std::size_t begin = 0;
    std::optional<std::int64_t> before = JunctionAt(street.line_m.front());
    for (std::size_t i = 1; i < street.line_m.size(); ++i) {
      const std::optional<std::int64_t> junction = JunctionNear(street.line_m, i);
      const bool last = i + 1 == street.line_m.size();
      // A junction right at the begin of a piece is that begin.
      const bool cut = i - begin >= kPiece && street.line_m.size() - i > kPiece / 4;
      if (!last && !cut && (!junction || junction == before)) continue;
      const std::int64_t node = junction ? *junction : NewNode(street.line_m[i]);
      DrawPiece(street, begin, i, before, node);
      begin = i;
      before = node;
    }
  }

  std::shared_ptr<const streets::StreetMap> Finish() {
    for (std::size_t i = 0; i < places_m_.size(); ++i) {
      builder_.SetPlace(static_cast<std::int64_t>(i), frame_.ToGeo(places_m_[i]));
    }
    return std::make_shared<const streets::StreetMap>(builder_.Build());
  }

 private:
  std::int64_t NewNode(const Eigen::Vector2d& true_m) {
    const double off_m =
        errors_.node_least_m + (errors_.node_most_m - errors_.node_least_m) * random_.Uniform();
    const double angle_rad = 2 * M_PI * random_.Uniform();
    places_m_.push_back(true_m + off_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)));
    return static_cast<std::int64_t>(places_m_.size()) - 1;
  }

  std::optional<std::int64_t> JunctionAt(const Eigen::Vector2d& place_m) const {
    for (std::size_t i = 0; i < junctions_m_.size(); ++i) {
      if ((junctions_m_[i] - place_m).norm() < kSameM) return static_cast<std::int64_t>(i);
    }
    return std::nullopt;
  }

  /// At the point of the line that is nearest to a junction.
  std::optional<std::int64_t> JunctionNear(const DrawnLine& line, std::size_t i) const {
    const std::optional<std::int64_t> junction = JunctionAt(line[i]);
    if (!junction || i + 1 == line.size()) return junction;
    const Eigen::Vector2d& place_m = junctions_m_[static_cast<std::size_t>(*junction)];
    const bool next_is_nearer = (line[i + 1] - place_m).norm() < (line[i] - place_m).norm();
    return next_is_nearer ? std::nullopt : junction;
  }

  void DrawPiece(const TrafficStreet& street, std::size_t first, std::size_t last,
                 const std::optional<std::int64_t>& from, std::int64_t to) {
    streets::Street drawn;
    drawn.id = ++ways_;
    drawn.backward = !street.one_way;
    drawn.bridge = street.bridge;
    drawn.layer = street.bridge ? 1 : 0;
    drawn.roundabout = street.roundabout;
    if (random_.Uniform() >= errors_.no_lanes_share) {
      drawn.lanes = static_cast<std::uint8_t>(street.lanes);
    }
    std::vector<bool> marks(street.line_m.size(), false);
    MarkBends(street.line_m, first, last, marks);
    std::vector<std::int64_t> nodes{from ? *from : NewNode(street.line_m[first])};
    for (std::size_t i = first + 1; i < last; ++i) {
      if (marks[i]) nodes.push_back(NewNode(street.line_m[i]));
    }
    nodes.push_back(to);
    if (random_.Uniform() >= errors_.absent_share) builder_.AddStreet(drawn, "", nodes);
  }

  const std::vector<Eigen::Vector2d>& junctions_m_;
  const geo::LocalFrame& frame_;
  StreetMapErrors errors_;
  datasets::SeededRandom random_;
  std::vector<Eigen::Vector2d> places_m_;
  std::int64_t ways_ = 0;
  streets::StreetMapBuilder builder_;
};

}  // namespace

std::shared_ptr<const streets::StreetMap> DrawStreetMap(
    const std::vector<TrafficStreet>& streets, const std::vector<Eigen::Vector2d>& junctions_m,
    const geo::LocalFrame& frame, const StreetMapErrors& errors, std::uint64_t seed) {
  MapDrawer drawer(junctions_m, frame, errors, seed);
  for (const TrafficStreet& street : streets) {
    if (street.line_m.size() > 1) drawer.Draw(street);
  }
  return drawer.Finish();
}

}  // namespace livemap::tools
