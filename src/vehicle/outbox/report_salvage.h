#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "common/sqlite.h"
#include "vehicle/outbox/report_table.h"

namespace livemap::vehicle {

/// What could be read of a damaged store.
struct Salvage {
  std::size_t reports = 0;  ///< Read whole and handed on.
  std::size_t unreadable =
      0;              ///< At most so many more were there; finished ones may be among them.
  std::string error;  ///< Why nothing at all could be tried; else empty.
};

/// Reads the unfinished reports of the damaged store `path` row by row, from both ends and around
/// what is damaged, and hands each sound one to `accept`. `path` and its log stay as they are: the
/// work is done on a copy beside it. `fresh` is a sound store of the same schema, checkpointed: its
/// first page stands in when that of the copy is destroyed. Throws only what `accept` throws.
Salvage SalvageReports(const std::string& path, const std::string& fresh,
                       const std::function<void(const StoredReport&)>& accept);

}  // namespace livemap::vehicle
