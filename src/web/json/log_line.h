#pragma once

#include <cstdint>
#include <string>

namespace livemap::web {

/// What a program's log says at a moment.
struct LogRecord {
  std::int64_t time_ns = 0;  ///< UTC, ns since 1970.
  std::string level;         ///< "debug", "info", "warning", "error" or "fatal".
  std::string message;
  std::string node;  ///< Whose log it is.
  std::string file;  ///< Of the source, with its line; empty: not known.
  int line = 0;
};

/// The record as one line of JSON, `{"time", "level", "message", "fields"}`, without its end:
/// whatever the message holds, there is no line end in it.
std::string LogLine(const LogRecord& record);

}  // namespace livemap::web
