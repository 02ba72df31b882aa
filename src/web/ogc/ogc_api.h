#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "web/feeds/change_tags.h"
#include "web/feeds/feed_source.h"
#include "web/feeds/gathering_slots.h"
#include "web/http/http_message.h"
#include "web/http/request_target.h"
#include "web/http/site.h"
#include "web/ogc/ogc_document.h"
#include "web/ogc/ogc_query.h"

namespace livemap::web {

/// The landing page; everything else stands below it.
constexpr const char* kOgcAddress = "/ogc";

/// Answers hazards, map changes and streets with hazards by OGC API - Features - Part 1: Core
/// (OGC 17-069r4), in CRS84 (docs/reference/feeds.md). Whoever may not see a collection is not told
/// of it. Thread-safe; store failures and bad requests come out as exceptions.
class OgcApi {
 public:
  explicit OgcApi(FeedSource source);

  /// `target.path` starts with kOgcAddress. A bad request is answered as the standard says, 400
  /// with `{"code", "description"}`.
  HttpResponse Answer(const RequestTarget& target, const HttpRequest& question,
                      const Visibility& sees) const;

 private:
  /// A request within one answer.
  struct Asked {
    const RequestTarget& target;
    const Visibility& sees;
    std::string server;  ///< Address of the server.
    std::string base;    ///< Address of the landing page.
    std::string self;    ///< Address that was asked for.
    std::int64_t now_ns;
  };

  HttpResponse Route(const Asked& asked) const;
  HttpResponse RouteCollection(const Asked& asked, const std::string& rest) const;
  HttpResponse Items(const Asked& asked, const std::string& collection) const;
  HttpResponse Hazards(const Asked& asked, const OgcQuery& query) const;
  HttpResponse MapChanges(const Asked& asked, const OgcQuery& query) const;
  HttpResponse Streets(const Asked& asked, const OgcQuery& query) const;
  HttpResponse Item(const Asked& asked, const std::string& collection, const std::string& id) const;
  /// Null: there is none.
  Json FindItem(const Asked& asked, const std::string& collection, const std::string& id) const;
  Json FindHazard(const Asked& asked, const std::string& id) const;
  Json FindStreet(const Asked& asked, const std::string& id) const;
  /// What whoever asks may see.
  std::vector<OgcCollection> Collections(const Visibility& sees) const;
  /// A walk over the hazards that whoever asks may see.
  zone::Walk<zone::HazardState> HazardWalk(const Visibility& sees) const;
  bool MaySee(const zone::Hazard& hazard, const Visibility& sees) const;

  const FeedSource source_;
  const ChangeTags tags_;
  mutable GatheringSlots slots_;
};

}  // namespace livemap::web
