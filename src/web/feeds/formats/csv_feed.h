#pragma once

#include <string>

#include "web/feeds/feed_format.h"

namespace livemap::web {

/// Hazards as comma-separated values (RFC 4180) with a header line, in UTF-8.
class CsvFeed : public FeedFormat {
 public:
  static constexpr const char* kType = "text/csv; charset=utf-8; header=present";

  void Begin(const FeedHead& head, std::string& text) override;
  void Add(const FeedHazard& hazard, std::string& text) override;
  bool End(std::string& text) override;

 private:
  std::string base_;
};

}  // namespace livemap::web
