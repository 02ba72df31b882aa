#include "web/feeds/feed_text.h"

#include <array>
#include <charconv>
#include <cstddef>

#include "web/json/json.h"

namespace livemap::web {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";

bool IsContinuation(char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80U; }

/// How many bytes the UTF-8 character has with which `text` begins; 0: it begins with none.
std::size_t Utf8Length(std::string_view text) {
  const auto first = static_cast<unsigned char>(text.front());
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xC2 && first <= 0xDF   ? 2
                             : first >= 0xE0 && first <= 0xEF ? 3
                             : first >= 0xF0 && first <= 0xF4 ? 4
                                                              : 0;
  if (length == 0 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if (!IsContinuation(text[i])) return 0;
  }
  const auto second = static_cast<unsigned char>(text[1]);
  const bool is_overlong = (first == 0xE0 && second < 0xA0) || (first == 0xF0 && second < 0x90);
  const bool is_surrogate = first == 0xED && second > 0x9F;
  const bool is_beyond = first == 0xF4 && second > 0x8F;
  return is_overlong || is_surrogate || is_beyond ? 0 : length;
}

/// Calls `take` with each character of a text, with U+FFFD for each byte that is no UTF-8.
template <typename Take>
void ForEachCharacter(std::string_view text, const Take& take) {
  while (!text.empty()) {
    const std::size_t length = Utf8Length(text);
    take(length == 0 ? kReplacement : text.substr(0, length));
    text.remove_prefix(length == 0 ? 1 : length);
  }
}

bool IsXmlCharacter(std::string_view character) {
  const auto first = static_cast<unsigned char>(character.front());
  if (character.size() == 1) {
    return first == '\t' || first == '\n' || first == '\r' || (first >= 0x20 && first != 0x7F);
  }
  // U+FFFE and U+FFFF.
  return character != "\xEF\xBF\xBE" && character != "\xEF\xBF\xBF";
}

std::string_view XmlEscape(char character) {
  switch (character) {
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '&':
      return "&amp;";
    case '"':
      return "&quot;";
    case '\'':
      return "&apos;";
    case '\r':
      return "&#13;";
    default:
      return {};
  }
}

}  // namespace

std::string XmlText(std::string_view text) {
  std::string xml;
  xml.reserve(text.size());
  ForEachCharacter(text, [&](std::string_view character) {
    const std::string_view escape = XmlEscape(character.front());
    if (!IsXmlCharacter(character)) {
      xml += kReplacement;
    } else {
      xml += escape.empty() ? character : escape;
    }
  });
  return xml;
}

void AppendElement(std::string& xml, std::string_view name, std::string_view text) {
  xml.append("<").append(name).append(">").append(XmlText(text));
  xml.append("</").append(name).append(">");
}

void AppendFixed(std::string& text, double number, int digits) {
  std::array<char, 64> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number,
                                 std::chars_format::fixed, digits);
  text.append(buffer.data(), static_cast<std::size_t>(end.ptr - buffer.data()));
}

void AppendCoordinate(std::string& text, double degrees) { AppendFixed(text, degrees, 7); }

std::string CsvText(std::string_view text) {
  // Spreadsheets run what begins so (OWASP, CSV injection), also behind blanks.
  const std::size_t begin = text.find_first_not_of(' ');
  const bool is_formula =
      begin != std::string_view::npos &&
      std::string_view("=+-@\t\r\n|").find(text[begin]) != std::string_view::npos;
  std::string field = is_formula ? "'" : "";
  bool must_quote = is_formula;
  ForEachCharacter(text, [&](std::string_view character) {
    if (character == "\"") field += '"';
    // Left out, it would bring what stands behind it to the front.
    field += character.front() == '\0' ? kReplacement : character;
    must_quote =
        must_quote || std::string_view("\",;\r\n ").find(character) != std::string_view::npos;
  });
  return must_quote ? '"' + field + '"' : field;
}

}  // namespace livemap::web
