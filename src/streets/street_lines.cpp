#include "streets/street_lines.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace livemap::streets {
namespace {

constexpr std::size_t kLineKinds = static_cast<std::size_t>(StreetKind::kService) + 1;
constexpr double kLineUnits = 1e7;           // Per degree.
constexpr std::int64_t kLineCell = 200'000;  // 0.02 degrees, some 2 km.
constexpr std::uint64_t kMaxCellsPerLine = 400;
/// Up to this zoom chains are drawn, of classes up to the one that is drawn there.
constexpr int kChainZoom = 11;
constexpr std::size_t kMaxParts = 64;  // Of a chain: longer ones would be drawn where none is seen.
constexpr std::uint32_t kNoJoint = 0xffffffff;
constexpr std::size_t kLinePiece = 128;  // Points that are simplified together.
constexpr double kTolerancePx = 0.5;
constexpr double kTilePx = 256;

std::int32_t UnitsOf(double degrees) {
  return static_cast<std::int32_t>(std::lround(degrees * kLineUnits));
}

/// Of a coordinate in units; never negative.
std::uint64_t LineCellOf(std::int32_t units) {
  return static_cast<std::uint64_t>((static_cast<std::int64_t>(units) + 1'800'000'000) / kLineCell);
}

std::uint64_t LineKeyOf(std::uint64_t row, std::uint64_t column) { return row << 32U | column; }

/// How far `point` lies beside the straight line between two others, degrees of latitude.
double BesideDeg(const geo::GeoPoint& from, const geo::GeoPoint& to, const geo::GeoPoint& point,
                 double east_scale) {
  const double x = east_scale * (to.longitude_deg - from.longitude_deg);
  const double y = to.latitude_deg - from.latitude_deg;
  const double px = east_scale * (point.longitude_deg - from.longitude_deg);
  const double py = point.latitude_deg - from.latitude_deg;
  const double squared = x * x + y * y;
  const double share = squared > 0 ? std::clamp((px * x + py * y) / squared, 0.0, 1.0) : 0;
  return std::hypot(px - share * x, py - share * y);
}

/// Appends what Douglas and Peucker's algorithm keeps of points[first..last], without the first. A
/// piece is short, so that no line costs more than its length times that.
void AppendSimplified(const std::vector<geo::GeoPoint>& points, std::size_t first, std::size_t last,
                      double tolerance_deg, double east_scale, std::vector<geo::GeoPoint>& kept) {
  std::size_t furthest = first;
  double most_deg = tolerance_deg;
  for (std::size_t i = first + 1; i < last; ++i) {
    const double beside_deg = BesideDeg(points[first], points[last], points[i], east_scale);
    if (beside_deg > most_deg) {
      most_deg = beside_deg;
      furthest = i;
    }
  }
  if (furthest != first) {
    AppendSimplified(points, first, furthest, tolerance_deg, east_scale, kept);
    AppendSimplified(points, furthest, last, tolerance_deg, east_scale, kept);
  } else {
    kept.push_back(points[last]);
  }
}

std::vector<geo::GeoPoint> Simplified(const std::vector<geo::GeoPoint>& points,
                                      double tolerance_deg) {
  const double east_scale = std::cos(points.front().latitude_deg * geo::kRadiansPerDegree);
  std::vector<geo::GeoPoint> kept{points.front()};
  for (std::size_t first = 0; first + 1 < points.size(); first += kLinePiece) {
    const std::size_t last = std::min(points.size() - 1, first + kLinePiece);
    AppendSimplified(points, first, last, tolerance_deg, east_scale, kept);
  }
  return kept;
}

bool GoOnAlike(const Street& a, const Street& b) {
  return a.name == b.name && a.kind == b.kind && a.link == b.link && a.forward == b.forward &&
         a.backward == b.backward;
}

}  // namespace

void StreetLines::Box::Include(const Box& other) {
  south = std::min(south, other.south);
  west = std::min(west, other.west);
  north = std::max(north, other.north);
  east = std::max(east, other.east);
}

void StreetLines::Index::Add(std::uint32_t number, const Box& box) {
  const std::uint64_t rows = LineCellOf(box.north) - LineCellOf(box.south) + 1;
  const std::uint64_t columns = LineCellOf(box.east) - LineCellOf(box.west) + 1;
  if (rows * columns > kMaxCellsPerLine) {
    large.push_back(number);
    return;
  }
  for (std::uint64_t row = LineCellOf(box.south); row <= LineCellOf(box.north); ++row) {
    for (std::uint64_t column = LineCellOf(box.west); column <= LineCellOf(box.east); ++column) {
      cells.emplace_back(LineKeyOf(row, column), number);
    }
  }
}

void StreetLines::Index::Sort() {
  std::sort(cells.begin(), cells.end());
  cells.shrink_to_fit();
}

std::vector<std::uint32_t> StreetLines::Index::In(const Box& box) const {
  std::vector<std::uint32_t> found = large;
  for (std::uint64_t row = LineCellOf(box.south); row <= LineCellOf(box.north); ++row) {
    const std::pair<std::uint64_t, std::uint32_t> begin{LineKeyOf(row, LineCellOf(box.west)), 0};
    const std::uint64_t last = LineKeyOf(row, LineCellOf(box.east));
    auto cell = std::lower_bound(cells.begin(), cells.end(), begin);
    for (; cell != cells.end() && cell->first <= last; ++cell) found.push_back(cell->second);
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

StreetLines::StreetLines(const StreetMap& map)
    : map_(map), run_index_(kLineKinds), chain_index_(kLineKinds) {
  std::uint32_t first = 0;
  for (std::uint32_t i = 1; i <= map_.segments(); ++i) {
    const bool goes_on = i < map_.segments() &&
                         map_.SegmentAt(i).street == map_.SegmentAt(first).street &&
                         map_.SegmentAt(i).from == map_.SegmentAt(i - 1).to;
    if (goes_on) continue;
    AddRun(first, i);
    first = i;
  }
  runs_.shrink_to_fit();
  AddChains();
  for (Index& index : run_index_) index.Sort();
  for (Index& index : chain_index_) index.Sort();
}

void StreetLines::AddRun(std::uint32_t first, std::uint32_t end) {
  if (first == end) return;
  Run run{first, end - first, {}};
  const auto include = [&](std::uint32_t node) {
    const geo::GeoPoint place = map_.PlaceOf(node);
    const std::int32_t latitude = UnitsOf(place.latitude_deg);
    const std::int32_t longitude = UnitsOf(place.longitude_deg);
    run.box.Include({latitude, longitude, latitude, longitude});
  };
  include(map_.SegmentAt(first).from);
  for (std::uint32_t i = first; i < end; ++i) include(map_.SegmentAt(i).to);
  const auto kind = static_cast<std::size_t>(map_.StreetOf(first).kind);
  run_index_[kind].Add(static_cast<std::uint32_t>(runs_.size()), run.box);
  runs_.push_back(run);
}

/// Two ends are joined where no third one of their name and class is at that node. A one-way street
/// goes on only in its direction.
StreetLines::Joints StreetLines::FindJoints() const {
  struct End {
    std::uint32_t node;
    std::uint32_t name;
    std::uint32_t number;
  };
  std::vector<End> ends;
  for (std::uint32_t i = 0; i < runs_.size(); ++i) {
    const Run& run = runs_[i];
    const Street& street = map_.StreetOf(run.first);
    if (street.kind > LeastKindAt(kChainZoom)) continue;
    ends.push_back({map_.SegmentAt(run.first).from, street.name, 2 * i});
    ends.push_back({map_.SegmentAt(run.first + run.count - 1).to, street.name, 2 * i + 1});
  }
  std::sort(ends.begin(), ends.end(), [](const End& a, const End& b) {
    return std::tie(a.node, a.name, a.number) < std::tie(b.node, b.name, b.number);
  });
  Joints joints(2 * runs_.size(), kNoJoint);
  for (std::size_t first = 0; first < ends.size();) {
    std::size_t last = first;
    while (last < ends.size() && ends[last].node == ends[first].node &&
           ends[last].name == ends[first].name) {
      ++last;
    }
    if (last - first == 2) {
      const std::uint32_t a = ends[first].number;
      const std::uint32_t b = ends[first + 1].number;
      const Street& street = map_.StreetOf(runs_[a / 2].first);
      const bool fits = GoOnAlike(street, map_.StreetOf(runs_[b / 2].first)) && a / 2 != b / 2;
      if (fits && (!street.one_way() || a % 2 != b % 2)) {
        joints[a] = b;
        joints[b] = a;
      }
    }
    first = last;
  }
  return joints;
}

void StreetLines::AddChains() {
  const Joints joints = FindJoints();
  std::vector<bool> used(runs_.size(), false);
  const auto add_from = [&](std::uint32_t run, bool reversed) {
    Chain chain{static_cast<std::uint32_t>(parts_.size()), 0, {}};
    while (!used[run]) {
      used[run] = true;
      parts_.push_back({run, reversed});
      chain.box.Include(runs_[run].box);
      const std::uint32_t next = joints[2 * run + (reversed ? 0 : 1)];
      if (next == kNoJoint || parts_.size() - chain.begin == kMaxParts) break;
      run = next / 2;
      reversed = next % 2 == 1;
    }
    chain.end = static_cast<std::uint32_t>(parts_.size());
    const Street& street = map_.StreetOf(runs_[parts_[chain.begin].run].first);
    chain_index_[static_cast<std::size_t>(street.kind)].Add(
        static_cast<std::uint32_t>(chains_.size()), chain.box);
    chains_.push_back(chain);
  };
  // From where they begin; then what goes in rings, and what was cut for its length.
  for (const bool only_ends : {true, false}) {
    for (std::uint32_t run = 0; run < runs_.size(); ++run) {
      if (used[run] || map_.StreetOf(runs_[run].first).kind > LeastKindAt(kChainZoom)) continue;
      const bool begins = joints[2 * run] == kNoJoint;
      const bool ends = joints[2 * run + 1] == kNoJoint;
      if (only_ends && !begins && !ends) continue;
      add_from(run, !begins && ends);
    }
  }
}

StreetKind StreetLines::LeastKindAt(int zoom) {
  if (zoom >= 15) return StreetKind::kService;
  if (zoom >= 13) return StreetKind::kResidential;
  if (zoom >= 12) return StreetKind::kTertiary;
  if (zoom >= 11) return StreetKind::kSecondary;
  return zoom >= 9 ? StreetKind::kPrimary : StreetKind::kTrunk;
}

/// Appends the run's points but for the first, which is there already unless there is none.
void StreetLines::AddPoints(const Run& run, bool reversed,
                            std::vector<geo::GeoPoint>& points) const {
  const auto node = [&](std::uint32_t i) {
    const std::uint32_t at = reversed ? run.count - i : i;
    return at < run.count ? map_.SegmentAt(run.first + at).from
                          : map_.SegmentAt(run.first + at - 1).to;
  };
  for (std::uint32_t i = points.empty() ? 0 : 1; i <= run.count; ++i) {
    points.push_back(map_.PlaceOf(node(i)));
  }
}

StreetLines::Drawing StreetLines::Find(const geo::GeoBox& box, int zoom,
                                       std::size_t max_points) const {
  const Box units{UnitsOf(box.south_west.latitude_deg), UnitsOf(box.south_west.longitude_deg),
                  UnitsOf(box.north_east.latitude_deg), UnitsOf(box.north_east.longitude_deg)};
  const auto lies_beside = [&](const Box& other) {
    return other.south > units.north || other.north < units.south || other.west > units.east ||
           other.east < units.west;
  };
  // Of longitude at the equator; towards the poles a pixel is less of a degree.
  const double px_deg = 360 / (kTilePx * std::pow(2, zoom));
  const double middle_deg = 0.5 * (box.south_west.latitude_deg + box.north_east.latitude_deg);
  const double tolerance_deg =
      kTolerancePx * px_deg * std::cos(middle_deg * geo::kRadiansPerDegree);
  const bool from_afar = zoom <= kChainZoom;
  Drawing drawing;
  std::size_t count = 0;
  for (std::size_t kind = 0; kind <= static_cast<std::size_t>(LeastKindAt(zoom)); ++kind) {
    for (const std::uint32_t number : (from_afar ? chain_index_ : run_index_)[kind].In(units)) {
      if (lies_beside(from_afar ? chains_[number].box : runs_[number].box)) continue;
      std::vector<geo::GeoPoint> points;
      StreetLine line;
      if (from_afar) {
        const Chain& chain = chains_[number];
        line.segment = runs_[parts_[chain.begin].run].first;
        for (std::uint32_t i = chain.begin; i < chain.end; ++i) {
          AddPoints(runs_[parts_[i].run], parts_[i].reversed, points);
        }
      } else {
        line.segment = runs_[number].first;
        AddPoints(runs_[number], false, points);
      }
      line.points = Simplified(points, tolerance_deg);
      count += line.points.size();
      if (count > max_points) {
        drawing.is_truncated = true;
        return drawing;
      }
      drawing.lines.push_back(std::move(line));
    }
  }
  return drawing;
}

}  // namespace livemap::streets
