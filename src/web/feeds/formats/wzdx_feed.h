#pragma once

#include <string>

#include "web/feeds/feed_format.h"
#include "web/feeds/formats/work_zones.h"

namespace livemap::web {

/// Work zones, found from the devices that vehicles saw, as a Work Zone Data Exchange feed 4.2
/// (https://github.com/usdot-jpo-ode/wzdx). It writes nothing but its beginning until all hazards
/// are there.
class WzdxFeed : public FeedFormat {
 public:
  static constexpr const char* kType = "application/geo+json";

  void Begin(const FeedHead& head, std::string& text) override;
  void Add(const FeedHazard& hazard, std::string& text) override;
  bool End(std::string& text) override;

 private:
  WorkZones zones_;
  bool is_closed_ = false;
  bool has_items_ = false;
};

}  // namespace livemap::web
