#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "orders/order.h"

namespace livemap::orders {

/// Whether the text is a mail address as this program takes it: NAME@DOMAIN of 3 to 254 characters
/// of letters, digits and a few marks, which no server or header takes for anything else.
bool IsMailAddress(std::string_view text);

/// The order as a message (RFC 5322, MIME). Sent again it is the same, byte by byte: its Message-ID
/// and its date are the order's, so that a mailbox can drop the repeat. What it says stands in
/// base64, so that no text of a stranger can become a header or a command. Throws Error for an
/// address that is none (IsMailAddress).
std::string MailMessage(const Order& order, const std::string& from,
                        const std::vector<std::string>& to);

}  // namespace livemap::orders
