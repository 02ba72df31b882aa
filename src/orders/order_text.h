#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "orders/order.h"

namespace livemap::orders {

/// A stranger's text as one line of printable UTF-8 of at most `max_bytes`: what is none becomes
/// "?", and nothing acceptable becomes an empty text.
std::string OneLine(std::string_view text, std::size_t max_bytes);

/// "LM-<uuid>": by which a text that holds it is known to be of this order.
std::string ReferenceOf(const Order& order);
/// "Pothole: Forbes Ave, near S Craig St, eastbound"; the position where no street is known.
std::string TitleOf(const Order& order);
/// Some lines about the hazard, the last of them with ReferenceOf. It goes to the public (Open311)
/// too: no person is named.
std::string DescriptionOf(const Order& order);
/// The order as one JSON object (docs/reference/work-orders.md), with the official's name and
/// reason.
std::string JsonOf(const Order& order);

}  // namespace livemap::orders
