#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "common/uuid.h"
#include "geo/wgs84.h"

namespace livemap::orders {

/// Where a work order stands, as stored: the numbers never change.
enum class OrderState : std::uint8_t {
  kWaiting = 0,    ///< To be sent, or to be sent again.
  kSent = 1,       ///< Its recipient has taken it.
  kClosed = 2,     ///< The work is done, by the recipient's word or an official's.
  kFailed = 3,     ///< Given up: an official may have it sent again.
  kCancelled = 4,  ///< The hazard was taken back before anything was sent.
};
constexpr std::size_t kOrderStates = 5;

/// "waiting", "sent", "closed", "failed" or "cancelled".
constexpr const char* OrderStateName(OrderState state) {
  switch (state) {
    case OrderState::kWaiting:
      return "waiting";
    case OrderState::kSent:
      return "sent";
    case OrderState::kClosed:
      return "closed";
    case OrderState::kFailed:
      return "failed";
    case OrderState::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

/// What a work order says. It is fixed when the order is made, so that an order that is sent again
/// says the same.
struct OrderContent {
  Uuid hazard;
  std::string class_name;
  std::string label;              ///< Of the class, as people read it.
  geo::GeoPoint position;         ///< Of the hazard, WGS84 degrees.
  double confidence = 0;          ///< 0..1, of the hazard's detections together.
  std::string place;              ///< "Forbes Ave, near S Craig St, eastbound"; empty: not known.
  std::string official;           ///< Who confirmed the hazard; empty: vehicles alone did.
  std::string reason;             ///< The official's words; may be empty.
  std::int64_t confirmed_ns = 0;  ///< Zone clock, UTC ns since 1970.
};

/// One work order to one recipient.
struct Order {
  std::uint64_t id = 0;   ///< Rises from 1; the book gives it.
  Uuid uuid;              ///< By which the recipient knows it again, however often it is sent.
  std::string recipient;  ///< Name in the file of work orders.
  OrderContent content;
  OrderState state = OrderState::kWaiting;
  std::int64_t created_ns = 0;
  std::int64_t since_ns = 0;   ///< When it was made, or an official had it sent again.
  std::int64_t next_ns = 0;    ///< When it is sent next, or its recipient asked for its status.
  std::uint32_t attempts = 0;  ///< How often it was sent.
  /// When the first attempt began of which it is not known whether it arrived; 0: of all it is.
  std::int64_t uncertain_ns = 0;
  std::int64_t sent_ns = 0;    ///< When the recipient took it; 0: it has not.
  std::int64_t closed_ns = 0;  ///< When the work was done; 0: it is not.
  std::string closed_by;       ///< By whose word: "its recipient", or an official's name.
  std::string reference;       ///< The recipient's own id of it; empty: it gave none.
  std::string token;           ///< What the recipient gave in place of that, for the time being.
  std::string error;           ///< Why the newest attempt failed; empty: it did not.
};

/// Which orders are listed: those that all of its members accept.
struct OrderFilter {
  std::uint64_t before = UINT64_MAX;  ///< Only lower ids.
  std::size_t limit = 100;            ///< The newest ones.
  std::optional<OrderState> state;    ///< None: any.
  std::string recipient;              ///< Name in the file of work orders; empty: any.
  std::optional<Uuid> hazard;         ///< None: any.
};

/// How many orders there are and how old the oldest that waits is.
struct OrderCounts {
  std::array<std::uint64_t, kOrderStates> by_state{};  ///< By OrderState.
  std::int64_t oldest_waiting_ns = 0;                  ///< When it was made; 0: none waits.
};

}  // namespace livemap::orders
