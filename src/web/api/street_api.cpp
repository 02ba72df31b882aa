#include "web/api/street_api.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/sha256.h"
#include "web/http/page_answer.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

/// Some 700 kB before compression.
constexpr std::size_t kMaxStreetPoints = 30'000;

constexpr std::array<const char*, 7> kKindNames{"motorway", "trunk",       "primary", "secondary",
                                                "tertiary", "residential", "service"};

/// A coordinate to 1e-6 degrees, a tenth of a metre. By hand: an answer has tens of thousands.
void AppendDegrees(std::string& text, double degrees) {
  std::array<char, 32> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), degrees,
                                 std::chars_format::fixed, 6);
  text.append(buffer.data(), end.ptr);
}

void AppendLine(std::string& text, const streets::StreetMap& map, const streets::StreetLine& line) {
  const streets::Street& street = map.StreetOf(line.segment);
  text += R"({"type":"Feature","properties":{"way":)" + std::to_string(street.id) + R"(,"name":)";
  const std::string& name = map.NameOf(street);
  text += name.empty() ? "null" : ToText(name);
  text += R"(,"class":")";
  text += kKindNames[static_cast<std::size_t>(street.kind)];
  text += R"(","link":)";
  text += street.link ? "true" : "false";
  text += R"(,"one_way":)";
  text += street.one_way() ? "true" : "false";
  text += R"(,"layer":)" + std::to_string(static_cast<int>(street.layer));
  text += R"(},"geometry":{"type":"LineString","coordinates":[)";
  for (const geo::GeoPoint& point : line.points) {
    text += &point == line.points.data() ? "[" : ",[";
    AppendDegrees(text, point.longitude_deg);
    text += ',';
    AppendDegrees(text, point.latitude_deg);
    text += ']';
  }
  text += "]}}";
}

}  // namespace

StreetApi::StreetApi(const streets::StreetMap* map) {
  if (map == nullptr) return;
  lines_.emplace(*map);
  bounds_ = map->Bounds();
}

HttpResponse StreetApi::Answer(const RequestTarget& target, const HttpRequest& question) const {
  const StreetQuery query = ParseStreetQuery(target);
  if (!lines_) return MakeErrorAnswer(404, "the zone has no street file");
  const auto drawing = lines_->Find(query.box, query.zoom, kMaxStreetPoints);
  std::string text = R"({"type":"FeatureCollection","features":[)";
  for (const streets::StreetLine& line : drawing.lines) {
    if (&line != drawing.lines.data()) text += ',';
    AppendLine(text, lines_->map(), line);
  }
  text += R"(],"truncated":)";
  text += drawing.is_truncated ? "true}" : "false}";
  const std::string etag = '"' + Sha256Hex(text.data(), text.size()).substr(0, 32) + '"';
  return CacheableAnswer(
      std::make_shared<const std::vector<std::uint8_t>>(text.begin(), text.end()),
      "application/geo+json", etag, "public, max-age=300", question);
}

}  // namespace livemap::web
