#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/error.h"

struct sqlite3;
struct sqlite3_stmt;

namespace livemap {

/// Failure of the store at run time (disk full, corrupt file); the message carries SQLite's own
/// words.
class StoreError : public Error {
 public:
  using Error::Error;
};

/// Whether these are SQLite's words for a damaged file.
bool IsCorruption(const StoreError& error);
/// Renames a corrupt database and the files beside it to `<path>.corrupt-<now_ns>`, and returns
/// that name. Throws StoreError.
std::string QuarantineDatabase(const std::string& path, std::int64_t now_ns);

/// One prepared statement. Bind indexes start at 1 and columns at 0, as in SQLite. Not thread-safe.
class SqliteStatement {
 public:
  SqliteStatement(sqlite3* database, const std::string& sql);
  ~SqliteStatement();
  SqliteStatement(SqliteStatement&& other) noexcept;
  SqliteStatement& operator=(SqliteStatement&&) = delete;

  SqliteStatement& Bind(int index, std::int64_t value);
  SqliteStatement& Bind(int index, double value);
  SqliteStatement& Bind(int index, const std::string& text);
  SqliteStatement& BindBlob(int index, const void* data, std::size_t size);

  /// Advances to the next row; false at the end, when the statement is reset and reusable.
  bool Step();
  /// Runs a statement that returns no row.
  void Execute();
  void Reset();

  std::int64_t Int(int column) const;
  double Real(int column) const;
  std::string Text(int column) const;
  std::vector<std::uint8_t> Blob(int column) const;

 private:
  sqlite3_stmt* statement_ = nullptr;
};

/// A SQLite database in WAL mode. `durable` means synchronous=FULL: a committed transaction
/// survives kill -9 and power loss. One object per thread.
class SqliteDatabase {
 public:
  SqliteDatabase(const std::string& path, bool durable);
  ~SqliteDatabase();
  SqliteDatabase(const SqliteDatabase&) = delete;
  SqliteDatabase& operator=(const SqliteDatabase&) = delete;

  /// Reads all pages; throws StoreError, which IsCorruption, when one is damaged.
  void CheckPages();
  void Execute(const std::string& sql);
  SqliteStatement Prepare(const std::string& sql);
  /// Runs `body` as one transaction; rolls back and rethrows when it throws.
  void Transaction(const std::function<void()>& body);

  /// Brings the schema to `migrations.size()`, each step in its own transaction; PRAGMA
  /// user_version holds the version. Throws StoreError when the file is newer than this program.
  void Migrate(const std::vector<std::string>& migrations);

 private:
  sqlite3* database_ = nullptr;
  std::string path_;
};

}  // namespace livemap
