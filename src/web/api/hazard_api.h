#pragma once

#include <string>

#include "protocol/hazard_catalogue.h"
#include "web/api/query.h"
#include "web/http/http_message.h"
#include "zone/service/map_reader.h"

namespace livemap::web {

/// The list of hazards; "/points", "/UUID" and "/UUID/events" stand below it.
constexpr const char* kHazardAddress = "/api/v1/hazards";

/// Answers what may be read of hazards (docs/reference/http-api.md). Thread-safe; store failures
/// and bad requests come out as exceptions.
class HazardApi {
 public:
  /// Keeps the references.
  HazardApi(const zone::MapReader& zone, const protocol::HazardCatalogue& catalogue)
      : zone_(zone), catalogue_(catalogue) {}

  /// `target.path` starts with kHazardAddress and is no decision's. Without `all` only of hazards
  /// that drivers are told of, and nothing of their history, in which officials are named.
  HttpResponse Answer(const RequestTarget& target, bool all) const;

 private:
  HttpResponse List(HazardQuery query, bool all) const;
  HttpResponse Points(PointsQuery query, bool all) const;
  HttpResponse One(const std::string& id, bool all) const;
  HttpResponse Events(const std::string& id, std::size_t limit) const;

  const zone::MapReader& zone_;
  const protocol::HazardCatalogue& catalogue_;
};

}  // namespace livemap::web
