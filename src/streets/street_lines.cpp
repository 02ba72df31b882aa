#include "streets/street_lines.h"

#include <algorithm>
#include <cmath>

namespace livemap::streets {
namespace {

constexpr std::size_t kKinds = static_cast<std::size_t>(StreetKind::kService) + 1;
constexpr double kLineUnits = 1e7;           // Per degree.
constexpr std::int64_t kLineCell = 200'000;  // 0.02 degrees, some 2 km.
constexpr std::int64_t kMaxCellsPerRun = 400;
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

}  // namespace

StreetLines::StreetLines(const StreetMap& map) : map_(map), levels_(kKinds) {
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
  for (Level& level : levels_) {
    std::sort(level.cells.begin(), level.cells.end());
    level.cells.shrink_to_fit();
  }
}

void StreetLines::AddRun(std::uint32_t first, std::uint32_t end) {
  Run run{first, end - first, INT32_MAX, INT32_MAX, INT32_MIN, INT32_MIN};
  const auto include = [&](std::uint32_t node) {
    const geo::GeoPoint place = map_.PlaceOf(node);
    run.south = std::min(run.south, UnitsOf(place.latitude_deg));
    run.north = std::max(run.north, UnitsOf(place.latitude_deg));
    run.west = std::min(run.west, UnitsOf(place.longitude_deg));
    run.east = std::max(run.east, UnitsOf(place.longitude_deg));
  };
  include(map_.SegmentAt(first).from);
  for (std::uint32_t i = first; i < end; ++i) include(map_.SegmentAt(i).to);
  const auto number = static_cast<std::uint32_t>(runs_.size());
  runs_.push_back(run);
  Level& level = levels_[static_cast<std::size_t>(map_.StreetOf(first).kind)];
  const std::uint64_t rows = LineCellOf(run.north) - LineCellOf(run.south) + 1;
  const std::uint64_t columns = LineCellOf(run.east) - LineCellOf(run.west) + 1;
  if (rows * columns > kMaxCellsPerRun) {
    level.large.push_back(number);
    return;
  }
  for (std::uint64_t row = LineCellOf(run.south); row <= LineCellOf(run.north); ++row) {
    for (std::uint64_t column = LineCellOf(run.west); column <= LineCellOf(run.east); ++column) {
      level.cells.emplace_back(LineKeyOf(row, column), number);
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

std::vector<std::uint32_t> StreetLines::RunsIn(const Level& level, const Run& box) const {
  std::vector<std::uint32_t> found = level.large;
  for (std::uint64_t row = LineCellOf(box.south); row <= LineCellOf(box.north); ++row) {
    const std::pair<std::uint64_t, std::uint32_t> begin{LineKeyOf(row, LineCellOf(box.west)), 0};
    const std::uint64_t last = LineKeyOf(row, LineCellOf(box.east));
    auto cell = std::lower_bound(level.cells.begin(), level.cells.end(), begin);
    for (; cell != level.cells.end() && cell->first <= last; ++cell) found.push_back(cell->second);
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  const auto lies_beside = [&](std::uint32_t number) {
    const Run& run = runs_[number];
    return run.south > box.north || run.north < box.south || run.west > box.east ||
           run.east < box.west;
  };
  found.erase(std::remove_if(found.begin(), found.end(), lies_beside), found.end());
  return found;
}

StreetLine StreetLines::LineOf(const Run& run, double tolerance_deg) const {
  std::vector<geo::GeoPoint> points{map_.PlaceOf(map_.SegmentAt(run.first).from)};
  points.reserve(run.count + 1);
  for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
    points.push_back(map_.PlaceOf(map_.SegmentAt(i).to));
  }
  const double east_scale = std::cos(points.front().latitude_deg * geo::kRadiansPerDegree);
  StreetLine line;
  line.segment = run.first;
  line.points.push_back(points.front());
  for (std::size_t first = 0; first + 1 < points.size(); first += kLinePiece) {
    const std::size_t last = std::min(points.size() - 1, first + kLinePiece);
    AppendSimplified(points, first, last, tolerance_deg, east_scale, line.points);
  }
  return line;
}

StreetLines::Drawing StreetLines::Find(const geo::GeoBox& box, int zoom,
                                       std::size_t max_points) const {
  const Run units{0,
                  0,
                  UnitsOf(box.south_west.latitude_deg),
                  UnitsOf(box.south_west.longitude_deg),
                  UnitsOf(box.north_east.latitude_deg),
                  UnitsOf(box.north_east.longitude_deg)};
  // Of longitude at the equator; towards the poles a pixel is less of a degree.
  const double px_deg = 360 / (kTilePx * std::pow(2, zoom));
  const double middle_deg = 0.5 * (box.south_west.latitude_deg + box.north_east.latitude_deg);
  const double tolerance_deg =
      kTolerancePx * px_deg * std::cos(middle_deg * geo::kRadiansPerDegree);
  Drawing drawing;
  std::size_t points = 0;
  for (std::size_t kind = 0; kind <= static_cast<std::size_t>(LeastKindAt(zoom)); ++kind) {
    for (const std::uint32_t number : RunsIn(levels_[kind], units)) {
      StreetLine line = LineOf(runs_[number], tolerance_deg);
      points += line.points.size();
      if (points > max_points) {
        drawing.is_truncated = true;
        return drawing;
      }
      drawing.lines.push_back(std::move(line));
    }
  }
  return drawing;
}

}  // namespace livemap::streets
