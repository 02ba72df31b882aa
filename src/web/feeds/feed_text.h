#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace livemap::web {

/// Text of anybody as the content of an XML element or of an attribute in double quotes: what is no
/// UTF-8, and characters that XML 1.0 does not have, become U+FFFD.
std::string XmlText(std::string_view text);

/// Appends "<name>text</name>", the text escaped.
void AppendElement(std::string& xml, std::string_view name, std::string_view text);

/// Appends a coordinate or angle to 1e-7 degrees, without an exponent.
void AppendCoordinate(std::string& text, double degrees);

/// Appends a number with so many digits after the point, without an exponent.
void AppendFixed(std::string& text, double number, int digits);

/// Text of anybody as one field of a CSV file (RFC 4180), quoted where it must be. A field that a
/// spreadsheet would take for a formula begins with an apostrophe.
std::string CsvText(std::string_view text);

}  // namespace livemap::web
