#pragma once

#include <string>

#include "web/feeds/feed_format.h"

namespace livemap::web {

/// Hazards of the categories of safety-related traffic information as a DATEX II v3
/// SituationPublication (CEN EN 16157-3, https://docs.datex2.eu): animals, obstacles, unprotected
/// accidents, short-term road works. Hazards of no category are left out.
class DatexFeed : public FeedFormat {
 public:
  static constexpr const char* kType = "application/xml";

  void Begin(const FeedHead& head, std::string& text) override;
  void Add(const FeedHazard& hazard, std::string& text) override;
  bool End(std::string& text) override;
};

}  // namespace livemap::web
