#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace livemap::datasets {

/// Longer tables of a data set (one line per frame) are refused.
constexpr std::size_t kMaxTableBytes = 64U << 20U;
/// Longer lists, poses and trajectories are refused.
constexpr std::size_t kMaxTextBytes = 256U << 20U;

/// The whole of `text`, surrounding blanks aside, as a finite decimal number; none otherwise. The
/// point is the decimal mark whatever the locale.
std::optional<double> ParseFinite(const std::string& text);

/// Splits at `separator`; "a,,b" has three parts.
std::vector<std::string> Split(const std::string& line, char separator);

/// Splits at runs of blanks and tabs; no empty parts.
std::vector<std::string> SplitBlanks(const std::string& line);

/// Lines without their ends ("\n" or "\r\n") and the blanks before these; empty lines at the end
/// of the text do not count.
std::vector<std::string> Lines(const std::string& text);

/// What to add to the refusal of a line whose columns blanks should separate: that it has commas or
/// semicolons; empty where it has none.
std::string SeparatorHint(const std::string& line);

/// What to add to the refusal of a stamp that should be in seconds: that it looks like
/// milliseconds, microseconds or nanoseconds since 1970, or is negative; empty for any other text.
std::string StampHint(const std::string& stamp);

}  // namespace livemap::datasets
