#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "web/feeds/change_tags.h"
#include "web/feeds/feed_format.h"
#include "web/feeds/feed_query.h"
#include "web/feeds/feed_source.h"
#include "web/feeds/gathering_slots.h"
#include "web/http/http_message.h"
#include "web/http/request_target.h"
#include "web/http/site.h"

namespace livemap::web {

/// The list of feeds; each feed stands below it.
constexpr const char* kFeedAddress = "/feeds";

/// Answers hazards in the formats of other systems (docs/reference/feeds.md), hazard by hazard
/// while the client reads. Feeds that go to drivers tell only of hazards that drivers are told of.
/// Thread-safe; store failures and bad requests come out as exceptions.
class FeedApi {
 public:
  explicit FeedApi(FeedSource source);

  /// `target.path` starts with kFeedAddress.
  HttpResponse Answer(const RequestTarget& target, const HttpRequest& question,
                      const Visibility& sees) const;

 private:
  HttpResponse List(const HttpRequest& question) const;
  HttpResponse OneDenm(const std::string& id) const;
  /// The hazards that the query selects, written by `format`, which holds `slot` so long.
  HttpResponse Stream(std::shared_ptr<FeedFormat> format, const char* type, const FeedHead& head,
                      FeedQuery query, bool all, std::shared_ptr<void> slot) const;
  FeedHead HeadOf(const HttpRequest& question) const;
  FeedHazard MakeHazard(const zone::Hazard& hazard, std::int64_t now_ns) const;

  const FeedSource source_;
  const ChangeTags tags_;
  mutable GatheringSlots slots_;
};

}  // namespace livemap::web
