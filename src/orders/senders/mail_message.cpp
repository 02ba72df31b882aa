#include "orders/senders/mail_message.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <ctime>

#include "common/error.h"
#include "common/text.h"
#include "orders/order_text.h"

namespace livemap::orders {
namespace {

constexpr std::size_t kMaxAddressBytes = 254;

std::string Base64(std::string_view bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned int bits = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      bits = bits << 8U | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k > bytes.size() ? '=' : kDigits[bits >> (18 - 6 * k) & 63U];
    }
  }
  return text;
}

/// Encoded words of at most 75 characters (RFC 2047), a line each.
std::string EncodedHeader(std::string text) {
  constexpr std::size_t kBytesPerWord = 39;
  std::string words;
  while (!text.empty()) {
    const std::string word = CutUtf8(text, kBytesPerWord);
    text.erase(0, std::max<std::size_t>(word.size(), 1));
    words += (words.empty() ? "=?UTF-8?B?" : "\r\n =?UTF-8?B?") + Base64(word) + "?=";
  }
  return words;
}

/// In English whatever the locale is (RFC 5322).
std::string MailDate(std::int64_t time_ns) {
  constexpr std::array<const char*, 7> kDays{"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  constexpr std::array<const char*, 12> kMonths{"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                                "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  const std::time_t seconds = time_ns / 1'000'000'000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  std::array<char, 32> rest{};
  std::strftime(rest.data(), rest.size(), " %Y %H:%M:%S +0000", &utc);
  return std::string(kDays.at(static_cast<std::size_t>(utc.tm_wday))) + ", " +
         std::to_string(utc.tm_mday) + ' ' + kMonths.at(static_cast<std::size_t>(utc.tm_mon)) +
         rest.data();
}

std::string MailBody(const Order& order) {
  std::string body = DescriptionOf(order);
  if (!order.content.official.empty()) body += "Confirmed by: " + order.content.official + "\n";
  if (!order.content.reason.empty()) body += "Reason: " + order.content.reason + "\n";
  const std::string encoded = Base64(body);
  std::string lines;
  for (std::size_t at = 0; at < encoded.size(); at += 76) lines += encoded.substr(at, 76) + "\r\n";
  return lines;
}

void RequireMailAddress(const std::string& address) {
  if (IsMailAddress(address)) return;
  throw Error("'" + OneLine(address, kMaxAddressBytes) +
              "' is no mail address, accepted is NAME@DOMAIN");
}

}  // namespace

bool IsMailAddress(std::string_view text) {
  const std::size_t at = text.find('@');
  if (text.size() > kMaxAddressBytes || at == std::string_view::npos || at == 0) return false;
  const auto is_of = [](std::string_view part, std::string_view marks) {
    return !part.empty() && part.front() != '.' && part.front() != '-' && part.back() != '.' &&
           std::all_of(part.begin(), part.end(), [&](char c) {
             const bool is_ascii = static_cast<unsigned char>(c) < 0x80;
             return (is_ascii && std::isalnum(static_cast<unsigned char>(c)) != 0) ||
                    marks.find(c) != std::string_view::npos;
           });
  };
  return is_of(text.substr(0, at), "._+-=&'/") && is_of(text.substr(at + 1), ".-");
}

std::string MailMessage(const Order& order, const std::string& from,
                        const std::vector<std::string>& to) {
  RequireMailAddress(from);
  std::string recipients;
  for (const std::string& address : to) {
    RequireMailAddress(address);
    recipients += (recipients.empty() ? "" : ",\r\n ") + address;
  }
  return "Date: " + MailDate(order.created_ns) + "\r\nFrom: " + from + "\r\nTo: " + recipients +
         "\r\nMessage-ID: <" + order.uuid.ToString() + "@" + from.substr(from.find('@') + 1) +
         ">\r\nSubject: " + EncodedHeader(TitleOf(order)) +
         "\r\nX-LiveMap-Order: " + order.uuid.ToString() +
         "\r\nAuto-Submitted: auto-generated\r\nMIME-Version: 1.0\r\n"
         "Content-Type: text/plain; charset=utf-8\r\nContent-Transfer-Encoding: base64\r\n\r\n" +
         MailBody(order);
}

}  // namespace livemap::orders
