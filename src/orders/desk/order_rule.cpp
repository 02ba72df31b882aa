#include "orders/desk/order_rule.h"

namespace livemap::orders {

bool OrderRule::Matches(const zone::Hazard& hazard) const {
  if (!classes.empty() && classes.count(hazard.class_name) == 0) return false;
  // Written so that a confidence that is no number matches no rule.
  if (!(static_cast<double>(hazard.confidence) >= min_confidence)) return false;
  return !area || area->Contains(hazard.position);
}

}  // namespace livemap::orders
