#pragma once

// How the tables of ZoneStore run their statements; nobody else includes this.
#include <soci/soci.h>

#include <algorithm>
#include <functional>
#include <string>

#include "common/sqlite.h"
#include "zone/model/store_damage.h"
#include "zone/store/store_connection.h"

namespace livemap::zone {

/// PostgreSQL's words come in several lines.
inline std::string OneLine(std::string words) {
  while (!words.empty() && words.back() == '\n') words.pop_back();
  std::replace(words.begin(), words.end(), '\n', ' ');
  return words;
}

/// Runs `body` and turns the library's exceptions into the project's.
template <typename Body>
auto ExplainStore(const std::string& doing, const Body& body) -> decltype(body()) {
  try {
    return body();
  } catch (const soci::soci_error& error) {
    throw StoreError("store: " + doing + " failed: " + OneLine(error.get_error_message()));
  }
}

/// Runs a query for at most one row. Reads to the end: an unfinished query would keep its snapshot
/// and with it the whole log.
inline bool FetchOne(StoreConnection& connection, soci::statement& statement) {
  connection.Flush();
  if (!statement.execute(true)) return false;
  while (statement.fetch()) {
  }
  return true;
}

/// Calls `take_row` for every row of a prepared query; what it throws as Error is told. The query
/// finds those rows of `table` only whose values are of the right type and size; the others are
/// told too.
StoreDamage LoadRows(StoreConnection& connection, const std::string& table, soci::statement& query,
                     const std::function<void()>& take_row);

}  // namespace livemap::zone
