#pragma once

#include <optional>
#include <set>
#include <string>

#include "geo/geo_polygon.h"
#include "zone/model/hazard.h"

namespace livemap::orders {

/// Which hazards become a work order, and to whom it goes.
struct OrderRule {
  /// What makes the order.
  enum class When {
    kConfirmed,  ///< An official confirms the hazard.
    kActive,     ///< Drivers are told of it, whoever confirmed it.
  };

  std::string recipient;                ///< Name of the recipient.
  std::set<std::string> classes;        ///< Of hazards; empty: all.
  std::optional<geo::GeoPolygon> area;  ///< Where the hazard lies; none: everywhere.
  double min_confidence = 0;            ///< 0..1, least confidence of the hazard.
  When when = When::kConfirmed;
  double delay_s = 60;  ///< From the decision to the first attempt: it may be undone until then.

  /// Whether the hazard is one of them.
  bool Matches(const zone::Hazard& hazard) const;
};

}  // namespace livemap::orders
