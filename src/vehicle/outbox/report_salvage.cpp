#include "vehicle/outbox/report_salvage.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <vector>

#include "vehicle/outbox/report_table.h"
#include "vehicle/outbox/row_validation.h"

namespace livemap::vehicle {
namespace {

constexpr std::streamsize kPageBytes = 4096;  // SQLite's default, which every store of ours has.
constexpr std::size_t kPageCountAt = 28;      // In the file's header, big-endian.
constexpr std::size_t kFreeListAt = 32;       // Its first page and length.
constexpr std::int64_t kMaxProbes = 100000;   // Rows asked for one by one.

/// A copy of a store and its log that goes when it is no longer needed.
class ReportSalvageCopy {
 public:
  explicit ReportSalvageCopy(const std::string& path) : original_(path), path_(path + ".salvage") {
    Remove();
    Copy("");
    if (std::filesystem::exists(original_ + "-wal")) Copy("-wal");
  }
  ~ReportSalvageCopy() { Remove(); }
  ReportSalvageCopy(const ReportSalvageCopy&) = delete;
  ReportSalvageCopy& operator=(const ReportSalvageCopy&) = delete;

  const std::string& path() const { return path_; }

  /// Gives the copy the first page of `fresh`, with its own size and without a free list. The
  /// schema stands on that page; the same steps made both, so its tables begin at the same pages.
  void ReplaceFirstPage(const std::string& fresh) const {
    std::vector<char> page(static_cast<std::size_t>(kPageBytes));
    std::ifstream source(fresh, std::ios::binary);
    source.read(page.data(), kPageBytes);
    const auto pages = std::filesystem::file_size(path_) / static_cast<std::size_t>(kPageBytes);
    for (std::size_t i = 0; i < 4; ++i) {
      page[kPageCountAt + i] = static_cast<char>((pages >> (8 * (3 - i))) & 0xFF);
    }
    std::fill_n(page.begin() + kFreeListAt, 8, '\0');
    std::fstream target(path_, std::ios::binary | std::ios::in | std::ios::out);
    target.write(page.data(), kPageBytes);
    if (!source || !target.flush()) throw StoreError("store '" + path_ + "' cannot be mended");
  }

 private:
  void Copy(const char* companion) const {
    std::error_code error;
    std::filesystem::copy_file(original_ + companion, path_ + companion, error);
    if (error) {
      throw StoreError("store '" + original_ + "' cannot be copied: " + error.message());
    }
  }
  void Remove() const {
    for (const char* companion : {"", "-wal", "-shm"}) {
      std::error_code ignored;
      std::filesystem::remove(path_ + companion, ignored);
    }
  }

  const std::string original_;
  const std::string path_;
};

/// Row numbers in one direction, as far as the store can be read; true when that was to the end.
bool ListRowsToSalvage(SqliteDatabase& database, const char* order,
                       std::vector<std::int64_t>& rows) {
  try {
    SqliteStatement query = database.Prepare(
        std::string("SELECT rowid FROM pending NOT INDEXED ORDER BY rowid ") + order);
    while (query.Step()) rows.push_back(query.Int(0));
    return true;
  } catch (const StoreError&) {
    return false;
  }
}

struct Rows {
  std::vector<std::int64_t> numbers;
  std::int64_t last_listed = 0;  ///< Beyond it numbers are guesses.
};

/// Every row that may be there: what both ends show, and the numbers between them.
Rows CandidateRowsToSalvage(SqliteDatabase& database) {
  Rows rows;
  std::vector<std::int64_t>& numbers = rows.numbers;
  const bool complete = ListRowsToSalvage(database, "ASC", numbers);
  if (!numbers.empty()) rows.last_listed = numbers.back();
  if (complete) return rows;
  std::vector<std::int64_t> from_end;
  ListRowsToSalvage(database, "DESC", from_end);
  const std::int64_t first = rows.last_listed + 1;
  const std::int64_t last = from_end.empty() ? first + kMaxProbes : from_end.back() - 1;
  for (std::int64_t row = first; row <= std::min(last, first + kMaxProbes); ++row) {
    numbers.push_back(row);
  }
  numbers.insert(numbers.end(), from_end.begin(), from_end.end());
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  if (!from_end.empty()) rows.last_listed = std::max(rows.last_listed, from_end.front());
  return rows;
}

Salvage ReadSalvagedRows(SqliteDatabase& database,
                         const std::function<void(const StoredReport&)>& accept) {
  Salvage salvage;
  const Rows rows = CandidateRowsToSalvage(database);
  for (const std::int64_t row : rows.numbers) {
    std::optional<StoredReport> stored;
    try {
      stored = SelectReportOfRow(database, row);
      if (!stored) continue;
    } catch (const StoreError&) {
    }
    if (stored && IsSound(stored->report)) {
      DropInvalidPicture(stored->report);
      accept(*stored);
      ++salvage.reports;
    } else if (row <= rows.last_listed) {
      ++salvage.unreadable;
    }
  }
  return salvage;
}

std::unique_ptr<SqliteDatabase> OpenSalvageCopy(const ReportSalvageCopy& copy) {
  auto database = std::make_unique<SqliteDatabase>(copy.path(), /*durable=*/false);
  database->Prepare("SELECT rowid FROM pending WHERE rowid=0").Reset();
  try {
    database->Prepare("SELECT hold_until_ns FROM pending WHERE rowid=0").Reset();
  } catch (const StoreError&) {
    database->Execute(kAddShownRegionAndHold);  // Of an older LiveMap.
  }
  try {
    database->Prepare("SELECT zone FROM pending WHERE rowid=0").Reset();
  } catch (const StoreError&) {
    database->Execute(kAddZoneOfReport);  // The same.
  }
  return database;
}

}  // namespace

Salvage SalvageReports(const std::string& path, const std::string& fresh,
                       const std::function<void(const StoredReport&)>& accept) {
  std::optional<ReportSalvageCopy> copy;
  std::unique_ptr<SqliteDatabase> database;
  try {
    copy.emplace(path);
    try {
      database = OpenSalvageCopy(*copy);
    } catch (const StoreError&) {
      copy->ReplaceFirstPage(fresh);
      database = OpenSalvageCopy(*copy);
    }
  } catch (const std::exception& error) {
    Salvage nothing;
    nothing.error = error.what();
    return nothing;
  }
  return ReadSalvagedRows(*database, accept);
}

}  // namespace livemap::vehicle
