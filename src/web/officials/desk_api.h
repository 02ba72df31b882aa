#pragma once

#include <optional>
#include <string>

#include "protocol/hazard_catalogue.h"
#include "web/api/query.h"
#include "web/http/http_message.h"
#include "web/json/json.h"
#include "zone/desk/desk_statistics.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// Answers what officials read beside the map: who mends what, what was counted, every sighting of
/// a hazard, what became of a request for a whole frame (docs/reference/http-api.md). Thread-safe;
/// store failures and bad requests come out as exceptions.
class DeskApi {
 public:
  /// Keeps the references.
  DeskApi(zone::ZoneService& zone, const protocol::HazardCatalogue& catalogue)
      : zone_(zone), catalogue_(catalogue) {}

  /// Whether the address is one of these: "/api/v1/assignments", "/api/v1/statistics",
  /// "/api/v1/hazards/UUID/sightings" or "/api/v1/hazards/UUID/frame".
  static bool Has(const std::string& path);
  /// Answers a GET of such an address.
  HttpResponse Answer(const RequestTarget& target) const;

 private:
  HttpResponse Assignments() const;
  HttpResponse Statistics(std::size_t weeks) const;
  HttpResponse Sightings(const std::string& id) const;
  HttpResponse Frame(const std::string& id) const;
  Json PictureOf(const zone::AnswerPicture& picture) const;
  void CountHazards(zone::DeskStatistics& statistics, std::int64_t from_ns) const;

  zone::ZoneService& zone_;
  const protocol::HazardCatalogue& catalogue_;
};

}  // namespace livemap::web
