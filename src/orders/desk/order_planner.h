#pragma once

#include <string>
#include <vector>

#include "orders/desk/order_book.h"
#include "orders/desk/order_rule.h"
#include "protocol/hazard_catalogue.h"
#include "zone/service/zone_service.h"

namespace livemap::orders {

/// Makes orders of what has happened in the zone, by the rules: of every decision and every event
/// once, in their order. What a restart finds in the zone's history and not in the book is made
/// then. Not thread-safe.
class OrderPlanner {
 public:
  /// Keeps references. A new book begins with what happens from now on; so does one that is ahead
  /// of the zone, whose store was put back. Throws StoreError.
  OrderPlanner(std::vector<OrderRule> rules, const zone::ZoneService& zone,
               const protocol::HazardCatalogue& catalogue, OrderBook& book);

  /// Looks at the next of the zone's decisions and events; false where nothing followed from them.
  /// Throws StoreError: then they are looked at again.
  bool Plan(std::int64_t now_ns);

 private:
  OrderStep StepOf(const zone::DecisionRecord& decision) const;
  OrderStep StepOf(const zone::StoredEvent& event) const;
  void Add(OrderRule::When when, const Uuid& hazard, const OrderContent& known,
           OrderStep& step) const;

  const std::vector<OrderRule> rules_;
  const zone::ZoneService& zone_;
  const protocol::HazardCatalogue& catalogue_;
  OrderBook& book_;
  OrderCursor cursor_;  ///< How far the zone's history has been read...
  OrderCursor kept_;    ///< ...and how far by the book.
};

}  // namespace livemap::orders
