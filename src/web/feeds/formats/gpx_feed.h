#pragma once

#include <string>

#include "web/feeds/feed_format.h"

namespace livemap::web {

/// Hazards as the waypoints of a GPX 1.1 file (https://www.topografix.com/GPX/1/1/), for navigation
/// devices.
class GpxFeed : public FeedFormat {
 public:
  static constexpr const char* kType = "application/gpx+xml";

  void Begin(const FeedHead& head, std::string& text) override;
  void Add(const FeedHazard& hazard, std::string& text) override;
  bool End(std::string& text) override;
};

}  // namespace livemap::web
