#pragma once

#include <string>

#include "web/api/query.h"
#include "web/http/http_message.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// The list of map changes; "/UUID" and "/UUID/events" stand below it.
constexpr const char* kMapChangeAddress = "/api/v1/changes";

/// Answers what may be read of map changes (docs/reference/http-api.md). Thread-safe; store
/// failures and bad requests come out as exceptions.
class MapChangeApi {
 public:
  /// Keeps the reference.
  explicit MapChangeApi(zone::ZoneService& zone) : zone_(zone) {}

  /// `target.path` starts with kMapChangeAddress.
  HttpResponse Answer(const RequestTarget& target) const;

 private:
  HttpResponse List(const MapChangeQuery& query) const;
  HttpResponse One(const std::string& id) const;
  HttpResponse Events(const std::string& id, std::size_t limit) const;

  zone::ZoneService& zone_;
};

}  // namespace livemap::web
