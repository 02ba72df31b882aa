#include "protocol/text_rules.h"

#include <algorithm>
#include <array>

namespace livemap::protocol {
namespace {

struct Range {
  std::uint32_t first;
  std::uint32_t last;
};

template <std::size_t kCount>
bool IsIn(const std::array<Range, kCount>& ranges, std::uint32_t code_point) {
  return std::any_of(ranges.begin(), ranges.end(), [code_point](const Range& range) {
    return code_point >= range.first && code_point <= range.last;
  });
}

bool IsPrintable(std::uint32_t code_point) {
  // C0, DEL and C1; soft hyphen; zero width and direction marks; separators and embeddings;
  // invisible operators and isolates; byte order mark; interlinear annotation; tags; noncharacters.
  constexpr std::array<Range, 11> kHidden{{{0x00, 0x1f},
                                           {0x7f, 0x9f},
                                           {0xad, 0xad},
                                           {0x61c, 0x61c},
                                           {0x200b, 0x200f},
                                           {0x2028, 0x202e},
                                           {0x2060, 0x206f},
                                           {0xfeff, 0xfeff},
                                           {0xfff9, 0xfffb},
                                           {0xfffe, 0xffff},
                                           {0xe0000, 0xe0fff}}};
  return !IsIn(kHidden, code_point);
}

/// Unicode's White_Space that IsPrintable lets through, and what is drawn as a blank all the same:
/// Ogham's space, Hangul's fillers, the empty Braille pattern.
bool IsBlank(std::uint32_t code_point) {
  constexpr std::array<Range, 10> kBlanks{{{0x20, 0x20},
                                           {0xa0, 0xa0},
                                           {0x115f, 0x1160},
                                           {0x1680, 0x1680},
                                           {0x2000, 0x200a},
                                           {0x202f, 0x202f},
                                           {0x205f, 0x205f},
                                           {0x2800, 0x2800},
                                           {0x3000, 0x3000},
                                           {0x3164, 0x3164}}};
  return IsIn(kBlanks, code_point) || code_point == 0xffa0;
}

/// Shows nothing by itself, or means nothing: grapheme joiner, Hangul's fillers, Khmer's inherent
/// vowels, Mongolian variation selectors, the replacement characters, formats of music and
/// shorthand, private use.
bool IsMeaningless(std::uint32_t code_point) {
  constexpr std::array<Range, 11> kMeaningless{{{0x34f, 0x34f},
                                                {0x115f, 0x1160},
                                                {0x17b4, 0x17b5},
                                                {0x180b, 0x180f},
                                                {0x3164, 0x3164},
                                                {0xe000, 0xf8ff},
                                                {0xffa0, 0xffa0},
                                                {0xfffc, 0xfffd},
                                                {0x1bca0, 0x1bca3},
                                                {0x1d173, 0x1d17a},
                                                {0xf0000, 0x10ffff}}};
  return IsIn(kMeaningless, code_point);
}

/// Shows nothing, but says how the character before it is drawn: pictographs have it.
bool IsSelector(std::uint32_t code_point) { return code_point >= 0xfe00 && code_point <= 0xfe0f; }

bool IsCombining(std::uint32_t code_point) {
  constexpr std::array<Range, 6> kCombining{{{0x300, 0x36f},
                                             {0x483, 0x489},
                                             {0x1ab0, 0x1aff},
                                             {0x1dc0, 0x1dff},
                                             {0x20d0, 0x20ff},
                                             {0xfe20, 0xfe2f}}};
  return IsIn(kCombining, code_point);
}

/// A character of ASCII that shows something.
bool IsGraphic(char c) { return c > ' ' && c < '\x7f'; }

/// Most texts are of ASCII without control characters: then no table is asked.
bool IsPlain(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c == ' ' || IsGraphic(c); });
}

}  // namespace

std::optional<std::uint32_t> TakeCodePoint(std::string_view& text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(0);
  if (lead < 0x80) {
    text.remove_prefix(1);
    return lead;
  }
  const std::size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) return std::nullopt;
  std::uint32_t code_point = lead & (0x7fU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return std::nullopt;
    code_point = code_point << 6 | (byte(i) & 0x3fU);
  }
  constexpr std::array<std::uint32_t, 5> kMinOfLength{0, 0, 0x80, 0x800, 0x10000};
  if (code_point < kMinOfLength[length] || code_point > 0x10ffff) return std::nullopt;
  if (code_point >= 0xd800 && code_point <= 0xdfff) return std::nullopt;
  text.remove_prefix(length);
  return code_point;
}

bool IsPrintableText(std::string_view text, std::size_t max_bytes) {
  if (text.empty() || text.size() > max_bytes) return false;
  if (IsPlain(text)) return true;
  while (!text.empty()) {
    const auto code_point = TakeCodePoint(text);
    if (!code_point || !IsPrintable(*code_point)) return false;
  }
  return true;
}

bool IsAcceptableText(std::string_view text, std::size_t max_bytes) {
  constexpr int kMaxPile = 4;
  if (!IsPrintableText(text, max_bytes)) return false;
  if (IsPlain(text)) return std::any_of(text.begin(), text.end(), IsGraphic);
  bool shows_something = false;
  for (int pile = 0; !text.empty();) {
    const std::uint32_t code_point = *TakeCodePoint(text);
    if (IsMeaningless(code_point)) return false;
    pile = IsCombining(code_point) ? pile + 1 : 0;
    if (pile > kMaxPile) return false;
    shows_something =
        shows_something || (pile == 0 && !IsBlank(code_point) && !IsSelector(code_point));
  }
  return shows_something;
}

bool IsAcceptableName(std::string_view text, std::size_t max_bytes) {
  if (!IsAcceptableText(text, max_bytes)) return false;
  if (IsPlain(text)) return IsGraphic(text.front()) && IsGraphic(text.back());
  if (Trimmed(text).size() != text.size()) return false;
  while (!text.empty()) {
    if (IsSelector(*TakeCodePoint(text))) return false;
  }
  return true;
}

std::string Trimmed(std::string_view text) {
  if (!text.empty() && IsGraphic(text.front()) && IsGraphic(text.back())) return std::string(text);
  std::size_t begin = text.size();
  std::size_t end = 0;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t at = text.size() - rest.size();
    const auto code_point = TakeCodePoint(rest);
    if (!code_point) return std::string(text);
    if (IsBlank(*code_point)) continue;
    begin = std::min(begin, at);
    end = text.size() - rest.size();
  }
  return begin < end ? std::string(text.substr(begin, end - begin)) : std::string();
}

}  // namespace livemap::protocol
