#pragma once

#include <optional>

#include "geo/geo_box.h"
#include "streets/street_lines.h"
#include "streets/street_map.h"
#include "web/api/query.h"
#include "web/http/http_message.h"

namespace livemap::web {

/// The streets to be drawn under the hazards.
constexpr const char* kStreetAddress = "/api/v1/streets";

/// Answers which streets are to be drawn where (docs/reference/http-api.md). Thread-safe; bad
/// requests come out as exceptions.
class StreetApi {
 public:
  /// Keeps the pointer; null: the zone knows no streets, and every request is answered 404.
  explicit StreetApi(const streets::StreetMap* map);

  /// `target.path` is kStreetAddress.
  HttpResponse Answer(const RequestTarget& target, const HttpRequest& question) const;
  /// Where the streets are; none without streets.
  const std::optional<geo::GeoBox>& bounds() const { return bounds_; }

 private:
  std::optional<streets::StreetLines> lines_;
  std::optional<geo::GeoBox> bounds_;
};

}  // namespace livemap::web
