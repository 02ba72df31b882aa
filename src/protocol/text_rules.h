#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace livemap::protocol {

/// Decodes the code point at the front of `text`, which is not empty, and removes it; none for
/// invalid UTF-8 (RFC 3629: overlong forms, surrogates, above U+10FFFF).
std::optional<std::uint32_t> TakeCodePoint(std::string_view& text);

/// Valid UTF-8 without control characters, line separators or invisible and direction-changing
/// format characters, and neither empty nor longer than `max_bytes`.
bool IsPrintableText(std::string_view text, std::size_t max_bytes);

/// What the zone accepts as a text of a stranger: printable text (IsPrintableText) of at most
/// `max_bytes` that shows something. Blanks of all scripts alone say nothing; fillers and selectors
/// that show nothing, characters without a meaning of their own (private use), and piles of more
/// than four combining marks are refused.
bool IsAcceptableText(std::string_view text, std::size_t max_bytes);

/// What the zone accepts as a name: acceptable text with no blank at either end and no variation
/// selector, so that two names that look the same are the same as far as what is not seen goes.
bool IsAcceptableName(std::string_view text, std::size_t max_bytes);

/// The text without the blanks, of all scripts, at both ends. Invalid UTF-8 comes back as it is.
std::string Trimmed(std::string_view text);

}  // namespace livemap::protocol
