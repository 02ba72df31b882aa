#pragma once

#include <string>

#include "web/feeds/feed_format.h"

namespace livemap::web {

/// Hazards as incidents of Waze's Closure and Incident Feed Specification, in JSON
/// (https://developers.google.com/waze/data-feed/cifs-specification).
class CifsFeed : public FeedFormat {
 public:
  static constexpr const char* kType = "application/json";

  void Begin(const FeedHead& head, std::string& text) override;
  void Add(const FeedHazard& hazard, std::string& text) override;
  bool End(std::string& text) override;

 private:
  bool has_items_ = false;
};

}  // namespace livemap::web
