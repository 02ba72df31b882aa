#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/error.h"
#include "geo/geo_box.h"

namespace livemap::web {

/// A request that the client must mend; answered with status 400 and this sentence.
class BadRequest : public Error {
 public:
  using Error::Error;
};

/// An HTTP request target in origin form, percent-decoded.
struct RequestTarget {
  std::string path;  ///< Starts with '/'; may hold any byte but NUL.
  std::vector<std::pair<std::string, std::string>> parameters;  ///< In the order of the query.
};

/// Splits and decodes "/path?key=value&...". Throws BadRequest when it does not start with '/', has
/// a malformed %-escape, a NUL byte, more than 32 parameters, or is longer than 4096 bytes.
RequestTarget ParseTarget(std::string_view target);

/// Throws BadRequest when the target has any parameter.
void RefuseQueryParameters(const RequestTarget& target);

/// Throws BadRequest when a parameter is given twice.
void RefuseRepeated(const RequestTarget& target);

/// Throws BadRequest: the parameter is unknown, and `accepted` says which are known.
[[noreturn]] void RefuseUnknown(const std::string& name, const std::string& accepted);

/// A client's text in quotes as part of an error sentence: short, so that the answer stays small.
std::string Quoted(std::string_view text);

/// The whole text as a number, none where it is anything else: no sign but a minus, no exponent.
std::optional<double> FiniteNumber(std::string_view text);

/// The whole text as a number from 0, of digits alone; none where it is anything else.
std::optional<std::uint64_t> WholeNumber(std::string_view text);

/// Reads "minLon,minLat,maxLon,maxLat" in degrees (RFC 7946, section 5); a box may cross the
/// antimeridian. Throws BadRequest that names the value and what is accepted.
geo::GeoBox ParseBox(const std::string& text);

/// Calls `take` with each piece of `text` between separators; an empty text has one empty piece.
template <typename Take>
void Split(std::string_view text, char separator, Take take) {
  for (;;) {
    const std::size_t end = text.find(separator);
    take(text.substr(0, end));
    if (end == std::string_view::npos) return;
    text.remove_prefix(end + 1);
  }
}

}  // namespace livemap::web
