#pragma once

#include <cstdint>
#include <functional>

#include "common/clock.h"
#include "protocol/hazard_catalogue.h"
#include "web/http/web_config.h"
#include "zone/service/map_reader.h"

namespace livemap::web {

/// What answers to other systems are made of. The references outlive it.
struct FeedSource {
  const WebConfig& options;
  const zone::MapReader& zone;
  const protocol::HazardCatalogue& catalogue;
  std::function<std::int64_t()> now_ns = SystemNs;  ///< UTC, ns since 1970.
};

}  // namespace livemap::web
