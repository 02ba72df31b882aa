#include "web/feeds/formats/cifs_feed.h"

#include <cmath>

#include "common/utc_text.h"
#include "geo/wgs84.h"
#include "web/feeds/feed_text.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

/// Waze cannot tell a direction from one point.
constexpr double kCifsLineM = 20;

void AppendCifsPoint(std::string& polyline, const geo::GeoPoint& point) {
  if (!polyline.empty()) polyline += ' ';
  AppendCoordinate(polyline, point.latitude_deg);
  polyline += ' ';
  AppendCoordinate(polyline, point.longitude_deg);
}

/// ISO 8601 with an offset, as the specification's examples have it.
std::string CifsTime(std::int64_t time_ns) {
  std::string time = Rfc3339Seconds(time_ns);
  time.pop_back();
  return time + "+00:00";
}

}  // namespace

void CifsFeed::Begin(const FeedHead& /*head*/, std::string& text) { text += R"({"incidents":[)"; }

void CifsFeed::Add(const FeedHazard& hazard, std::string& text) {
  const zone::Hazard& fact = hazard.hazard;
  const bool has_course = std::isfinite(fact.course_rad);
  std::string polyline;
  AppendCifsPoint(polyline, fact.position);
  if (has_course) {
    AppendCifsPoint(polyline, geo::GeodesicDestination(fact.position, fact.course_rad, kCifsLineM));
  }
  Json incident;
  incident["id"] = hazard.id;
  incident["type"] = hazard.codes.cifs_type;
  if (*hazard.codes.cifs_subtype != '\0') incident["subtype"] = hazard.codes.cifs_subtype;
  incident["polyline"] = polyline;
  incident["street"] = hazard.words.street.empty() ? "unknown" : hazard.words.street;
  incident["direction"] = has_course ? "ONE_DIRECTION" : "BOTH_DIRECTIONS";
  incident["starttime"] = CifsTime(fact.first_seen_ns);
  incident["endtime"] = CifsTime(hazard.ends_ns);
  incident["creationtime"] = CifsTime(fact.first_seen_ns);
  incident["updatetime"] = CifsTime(fact.updated_ns);
  incident["description"] = hazard.label;
  if (has_items_) text += ',';
  has_items_ = true;
  text += ToText({{"incident", std::move(incident)}});
}

bool CifsFeed::End(std::string& text) {
  text += "]}\n";
  return false;
}

}  // namespace livemap::web
