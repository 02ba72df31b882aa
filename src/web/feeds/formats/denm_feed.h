#pragma once

#include <string>

#include "web/feeds/feed_format.h"
#include "web/json/json.h"

namespace livemap::web {

/// The hazard as a Decentralized Environmental Notification Message (ETSI EN 302 637-3 V1.3.1, its
/// types in TS 102 894-2 V1.3.1), in JSON with the names and units of its ASN.1. One of which
/// drivers are no longer told is cancelled, one that an official rejected is negated.
Json DenmJson(const FeedHazard& hazard);

/// Hazards as lines of these messages, `{"id": UUID, "message": DENM}` each.
class DenmFeed : public FeedFormat {
 public:
  static constexpr const char* kType = "application/x-ndjson";

  void Begin(const FeedHead& head, std::string& text) override;
  void Add(const FeedHazard& hazard, std::string& text) override;
  bool End(std::string& text) override;
};

}  // namespace livemap::web
