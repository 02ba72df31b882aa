#pragma once

#include <cstdint>
#include <string>

#include "web/feeds/feed_hazard.h"

namespace livemap::web {

/// What a feed says of itself.
struct FeedHead {
  std::string base;         ///< Address of the server without a last '/', "https://map.example".
  std::string self;         ///< Address of the feed.
  std::string publisher;    ///< Who publishes it, for people.
  std::string country;      ///< ISO 3166-1 alpha-2 in lower case; "zz": not said.
  std::int64_t now_ns = 0;  ///< When it is made, UTC ns since 1970.
};

/// Writes hazards in one format: Begin once, Add for each hazard, then End until it says false.
/// Each call appends to the text what is ready, so that no document is ever held as a whole. Used
/// by one thread at a time.
class FeedFormat {
 public:
  FeedFormat() = default;
  virtual ~FeedFormat() = default;
  FeedFormat(const FeedFormat&) = delete;
  FeedFormat& operator=(const FeedFormat&) = delete;

  virtual void Begin(const FeedHead& head, std::string& text) = 0;
  virtual void Add(const FeedHazard& hazard, std::string& text) = 0;
  /// True while there is more.
  virtual bool End(std::string& text) = 0;
};

}  // namespace livemap::web
