#pragma once

#include <string>

#include "web/feeds/feed_format.h"

namespace livemap::web {

/// Hazards as an Atom feed (RFC 4287) with GeoRSS-Simple points (OGC 17-002r1), for feed readers.
class GeoRssFeed : public FeedFormat {
 public:
  static constexpr const char* kType = "application/atom+xml";

  void Begin(const FeedHead& head, std::string& text) override;
  void Add(const FeedHazard& hazard, std::string& text) override;
  bool End(std::string& text) override;

 private:
  std::string base_;
};

}  // namespace livemap::web
