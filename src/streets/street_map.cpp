#include "streets/street_map.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "common/error.h"
#include "common/text.h"

namespace livemap::streets {
namespace {

constexpr double kUnitsPerDegree = 1e7;
constexpr double kMaxLatitudeDeg = 85;
constexpr double kCellDeg = 0.002;  // Some 200 m.
constexpr double kMetresPerDegree = 111'000;
constexpr double kMaxRadiusM = 5000;
constexpr double kLaneM = 3.5;
constexpr std::size_t kMaxChoices = 64;
constexpr std::size_t kMaxNameBytes = 256;
constexpr std::size_t kMaxCellsPerSegment = 8;  // On average over the map.
constexpr std::size_t kMaxNear = 20'000;        // A cell of a city has some hundreds.

std::int64_t RowOf(double latitude_deg) {
  return static_cast<std::int64_t>(std::floor((latitude_deg + 90) / kCellDeg));
}

std::int64_t ColumnOf(double longitude_deg) {
  return static_cast<std::int64_t>(std::floor((longitude_deg + 180) / kCellDeg));
}

std::uint64_t KeyOf(std::int64_t row, std::int64_t column) {
  return static_cast<std::uint64_t>(row) << 32U | static_cast<std::uint64_t>(column);
}

void CheckCount(const char* what, std::size_t count, std::size_t most) {
  if (count <= most) return;
  throw Error("there are more than " + std::to_string(most) + " " + what +
              ", accepted are at most so many");
}

/// The cells that the straight line between two places comes through, and some beside it.
void AddCellsOf(const geo::GeoPoint& a, const geo::GeoPoint& b, std::vector<std::uint64_t>& keys) {
  keys.clear();
  const double span_deg = std::max(std::abs(a.latitude_deg - b.latitude_deg),
                                   std::abs(a.longitude_deg - b.longitude_deg));
  // Pieces shorter than a cell: the cells of both ends' box are all that one touches.
  const int pieces = static_cast<int>(span_deg / kCellDeg) + 1;
  const auto at = [&](int i) {
    const double share = static_cast<double>(i) / pieces;
    return geo::GeoPoint{a.latitude_deg + share * (b.latitude_deg - a.latitude_deg),
                         a.longitude_deg + share * (b.longitude_deg - a.longitude_deg)};
  };
  for (int i = 0; i < pieces; ++i) {
    const geo::GeoPoint p = at(i);
    const geo::GeoPoint q = at(i + 1);
    const auto [row, last_row] = std::minmax({RowOf(p.latitude_deg), RowOf(q.latitude_deg)});
    const auto [column, last_column] =
        std::minmax({ColumnOf(p.longitude_deg), ColumnOf(q.longitude_deg)});
    for (std::int64_t r = row; r <= last_row; ++r) {
      for (std::int64_t c = column; c <= last_column; ++c) keys.push_back(KeyOf(r, c));
    }
  }
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
}

template <typename Value>
std::size_t BytesOf(const std::vector<Value>& values) {
  return values.capacity() * sizeof(Value);
}

}  // namespace

double Street::HalfWidthM() const {
  if (width_m > 0) return 0.5 * static_cast<double>(width_m);
  if (lanes > 0) return 0.5 * kLaneM * lanes;
  const bool narrow = one_way() && (link || roundabout || kind == StreetKind::kService);
  return narrow ? 0.5 * kLaneM : kLaneM;
}

std::size_t StreetMap::bytes() const {
  std::size_t names = BytesOf(names_);
  for (const std::string& name : names_) names += name.capacity();
  return names + BytesOf(streets_) + BytesOf(places_) + BytesOf(segments_) +
         BytesOf(incident_begin_) + BytesOf(incident_) + BytesOf(cells_) + BytesOf(cell_begin_) +
         BytesOf(in_cells_) + BytesOf(restricted_);
}

geo::GeoBox StreetMap::Bounds() const {
  if (segments_.empty()) return {};
  const geo::GeoPoint first = PlaceOf(segments_.front().from);
  geo::GeoBox box{first, first};
  for (const Segment& segment : segments_) {
    for (const std::uint32_t node : {segment.from, segment.to}) {
      const geo::GeoPoint place = PlaceOf(node);
      box.south_west.latitude_deg = std::min(box.south_west.latitude_deg, place.latitude_deg);
      box.south_west.longitude_deg = std::min(box.south_west.longitude_deg, place.longitude_deg);
      box.north_east.latitude_deg = std::max(box.north_east.latitude_deg, place.latitude_deg);
      box.north_east.longitude_deg = std::max(box.north_east.longitude_deg, place.longitude_deg);
    }
  }
  return box;
}

geo::GeoPoint StreetMap::PlaceOf(std::uint32_t node) const {
  return {places_[node].latitude / kUnitsPerDegree, places_[node].longitude / kUnitsPerDegree};
}

std::vector<std::uint32_t> StreetMap::SegmentsNear(const geo::GeoPoint& place,
                                                   double radius_m) const {
  std::vector<std::uint32_t> near;
  const bool valid = geo::IsValid(place) && std::abs(place.latitude_deg) <= kMaxLatitudeDeg &&
                     radius_m >= 0 && radius_m <= kMaxRadiusM;
  if (!valid) return near;
  const double up_deg = radius_m / kMetresPerDegree;
  const double nearer_pole_deg = std::abs(place.latitude_deg) + up_deg;
  const double aside_deg = up_deg / std::cos(nearer_pole_deg * geo::kRadiansPerDegree);
  const std::int64_t last_column = ColumnOf(place.longitude_deg + aside_deg);
  for (std::int64_t row = std::max<std::int64_t>(0, RowOf(place.latitude_deg - up_deg));
       row <= RowOf(place.latitude_deg + up_deg); ++row) {
    const std::int64_t first_column =
        std::max<std::int64_t>(0, ColumnOf(place.longitude_deg - aside_deg));
    const auto first = std::lower_bound(cells_.begin(), cells_.end(), KeyOf(row, first_column));
    for (auto cell = first; cell != cells_.end() && *cell <= KeyOf(row, last_column); ++cell) {
      if (near.size() >= kMaxNear) break;
      const auto number = static_cast<std::size_t>(cell - cells_.begin());
      const std::size_t count = cell_begin_[number + 1] - cell_begin_[number];
      const auto begin = in_cells_.begin() + cell_begin_[number];
      near.insert(near.end(), begin,
                  begin + static_cast<std::ptrdiff_t>(std::min(count, kMaxNear - near.size())));
    }
  }
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  return near;
}

std::vector<std::uint32_t> StreetMap::SegmentsAt(std::uint32_t node) const {
  const std::size_t count = incident_begin_[node + 1] - incident_begin_[node];
  const auto begin = incident_.begin() + incident_begin_[node];
  return {begin, begin + static_cast<std::ptrdiff_t>(std::min(count, kMaxChoices))};
}

std::vector<Travel> StreetMap::Continuations(const Travel& travel) const {
  std::vector<Travel> onwards;
  const std::uint32_t node = EndOf(travel);
  const std::size_t incident = incident_begin_[node + 1] - incident_begin_[node];
  const auto end =
      static_cast<std::uint32_t>(incident_begin_[node] + std::min(incident, kMaxChoices));
  for (std::uint32_t i = incident_begin_[node]; i < end; ++i) {
    if (incident_[i] == travel.segment) continue;
    const Travel next{incident_[i], segments_[incident_[i]].from == node};
    const std::uint32_t from = segments_[travel.segment].street;
    if (!IsLegal(next) || IsForbidden(node, from, segments_[next.segment].street)) continue;
    onwards.push_back(next);
  }
  const Travel back{travel.segment, !travel.forward};
  if (onwards.empty() && IsLegal(back)) onwards.push_back(back);
  return onwards;
}

bool StreetMap::IsForbidden(std::uint32_t node, std::uint32_t from, std::uint32_t to) const {
  const auto before = [](const Restricted& each,
                         const std::pair<std::uint32_t, std::uint32_t>& key) {
    return std::tie(each.via, each.from) < std::tie(key.first, key.second);
  };
  const std::pair<std::uint32_t, std::uint32_t> key(node, from);
  bool only_others = false;
  for (auto each = std::lower_bound(restricted_.begin(), restricted_.end(), key, before);
       each != restricted_.end() && each->via == node && each->from == from; ++each) {
    if (each->to == to) return !each->only;
    only_others = only_others || each->only;
  }
  return only_others;
}

Travel StreetMap::OnlyContinuation(const Travel& travel) const {
  const std::uint32_t node = EndOf(travel);
  const std::uint32_t begin = incident_begin_[node];
  if (incident_begin_[node + 1] - begin != 2) return travel;
  const std::uint32_t other =
      incident_[begin] == travel.segment ? incident_[begin + 1] : incident_[begin];
  return {other, segments_[other].from == node};
}

void StreetMapBuilder::AddStreet(const Street& street, const std::string& name,
                                 const std::vector<std::int64_t>& nodes) {
  if (sorted_) throw Error("a street map takes no more streets after the first place of a node");
  CheckCount("streets", map_.streets_.size() + 1, limits_.max_streets);
  CheckCount("nodes in the streets", street_nodes_.size() + nodes.size(), limits_.max_nodes);
  Street kept = street;
  kept.name = 0;
  if (!name.empty()) {
    const auto [entry, is_new] = name_numbers_.emplace(
        CutUtf8(name, kMaxNameBytes), static_cast<std::uint32_t>(map_.names_.size()));
    if (is_new) map_.names_.push_back(entry->first);
    kept.name = entry->second;
  }
  map_.streets_.push_back(kept);
  street_nodes_.insert(street_nodes_.end(), nodes.begin(), nodes.end());
  street_ends_.push_back(street_nodes_.size());
}

void StreetMapBuilder::AddRestriction(const TurnRestriction& restriction) {
  CheckCount("restrictions of turns", restrictions_.size() + 1, limits_.max_restrictions);
  restrictions_.push_back(restriction);
}

void StreetMapBuilder::SortNodes() {
  sorted_ = true;
  node_ids_ = street_nodes_;
  std::sort(node_ids_.begin(), node_ids_.end());
  node_ids_.erase(std::unique(node_ids_.begin(), node_ids_.end()), node_ids_.end());
  node_ids_.shrink_to_fit();
  map_.places_.resize(node_ids_.size());
  placed_.assign(node_ids_.size(), false);
}

void StreetMapBuilder::SetPlace(std::int64_t node, const geo::GeoPoint& place) {
  if (!sorted_) SortNodes();
  const auto found = std::lower_bound(node_ids_.begin(), node_ids_.end(), node);
  if (found == node_ids_.end() || *found != node) return;
  const auto number = static_cast<std::size_t>(found - node_ids_.begin());
  if (placed_[number] || !geo::IsValid(place)) return;
  if (std::abs(place.latitude_deg) > kMaxLatitudeDeg) {
    ++map_.counters_.off_range;
    return;
  }
  placed_[number] = true;
  map_.places_[number] = {
      static_cast<std::int32_t>(std::lround(place.latitude_deg * kUnitsPerDegree)),
      static_cast<std::int32_t>(std::lround(place.longitude_deg * kUnitsPerDegree))};
}

void StreetMapBuilder::MakeSegments() {
  constexpr std::uint32_t kNone = 0xffffffff;
  std::size_t at = 0;
  for (std::uint32_t street = 0; street < street_ends_.size(); ++street) {
    std::uint32_t before = kNone;
    for (; at < street_ends_[street]; ++at) {
      const auto found = std::lower_bound(node_ids_.begin(), node_ids_.end(), street_nodes_[at]);
      const auto node = static_cast<std::uint32_t>(found - node_ids_.begin());
      if (!placed_[node]) {
        ++map_.counters_.missing_nodes;
        before = kNone;
        continue;
      }
      const std::uint32_t from = std::exchange(before, node);
      // Two nodes at one place: the street goes on at the second all the same.
      if (from == kNone || from == node) continue;
      const geo::GeoPoint a = map_.PlaceOf(from);
      const geo::GeoPoint b = map_.PlaceOf(node);
      const bool around = std::abs(a.longitude_deg - b.longitude_deg) > 180;
      if (around || geo::GeodesicDistanceM(a, b) > limits_.max_segment_m) {
        ++map_.counters_.long_segments;
        continue;
      }
      CheckCount("segments of streets", map_.segments_.size() + 1, limits_.max_segments);
      map_.segments_.push_back({from, node, street});
    }
  }
}

void StreetMapBuilder::IndexNodes() {
  map_.incident_begin_.assign(map_.places_.size() + 1, 0);
  for (const StreetMap::Segment& segment : map_.segments_) {
    ++map_.incident_begin_[segment.from + 1];
    ++map_.incident_begin_[segment.to + 1];
  }
  for (std::size_t i = 1; i < map_.incident_begin_.size(); ++i) {
    map_.incident_begin_[i] += map_.incident_begin_[i - 1];
  }
  map_.incident_.resize(2 * map_.segments_.size());
  std::vector<std::uint32_t> next(map_.incident_begin_);
  for (std::uint32_t i = 0; i < map_.segments_.size(); ++i) {
    map_.incident_[next[map_.segments_[i].from]++] = i;
    map_.incident_[next[map_.segments_[i].to]++] = i;
  }
}

void StreetMapBuilder::IndexRestrictions() {
  if (restrictions_.empty()) return;
  std::unordered_map<std::int64_t, std::uint32_t> streets;
  for (std::uint32_t i = 0; i < map_.streets_.size(); ++i) streets.emplace(map_.streets_[i].id, i);
  for (const TurnRestriction& each : restrictions_) {
    const auto from = streets.find(each.from);
    const auto to = streets.find(each.to);
    const auto via = std::lower_bound(node_ids_.begin(), node_ids_.end(), each.via);
    const bool known = via != node_ids_.end() && *via == each.via;
    if (from == streets.end() || to == streets.end() || !known) continue;
    map_.restricted_.push_back(
        {static_cast<std::uint32_t>(via - node_ids_.begin()), from->second, to->second, each.only});
  }
  std::sort(map_.restricted_.begin(), map_.restricted_.end(),
            [](const StreetMap::Restricted& a, const StreetMap::Restricted& b) {
              return std::tie(a.via, a.from, a.to, a.only) < std::tie(b.via, b.from, b.to, b.only);
            });
}

void StreetMapBuilder::IndexCells() {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> entries;
  std::vector<std::uint64_t> keys;
  // Every segment may be short and touch four, some may be long: a map of long ones is no map.
  const std::size_t most = kMaxCellsPerSegment * map_.segments_.size() + 100'000;
  for (std::uint32_t i = 0; i < map_.segments_.size(); ++i) {
    AddCellsOf(map_.PlaceOf(map_.segments_[i].from), map_.PlaceOf(map_.segments_[i].to), keys);
    CheckCount("cells of 0.002 degrees with segments of streets", entries.size() + keys.size(),
               most);
    for (const std::uint64_t key : keys) entries.emplace_back(key, i);
  }
  std::sort(entries.begin(), entries.end());
  map_.in_cells_.reserve(entries.size());
  for (const auto& [key, segment] : entries) {
    if (map_.cells_.empty() || map_.cells_.back() != key) {
      map_.cells_.push_back(key);
      map_.cell_begin_.push_back(static_cast<std::uint32_t>(map_.in_cells_.size()));
    }
    map_.in_cells_.push_back(segment);
  }
  map_.cell_begin_.push_back(static_cast<std::uint32_t>(map_.in_cells_.size()));
}

StreetMap StreetMapBuilder::Build() {
  if (!sorted_) SortNodes();
  MakeSegments();
  IndexNodes();
  IndexRestrictions();
  IndexCells();
  StreetMap built = std::move(map_);
  *this = StreetMapBuilder(limits_);
  return built;
}

}  // namespace livemap::streets
