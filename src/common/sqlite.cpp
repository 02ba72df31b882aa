#include "common/sqlite.h"

#include <sqlite3.h>

#include <filesystem>
#include <system_error>
#include <utility>

namespace livemap {
namespace {

void CheckSqlite(int code, sqlite3* database, const std::string& doing) {
  if (code == SQLITE_OK || code == SQLITE_DONE || code == SQLITE_ROW) return;
  throw StoreError("store: " + doing + " failed: " +
                   (database != nullptr ? sqlite3_errmsg(database) : sqlite3_errstr(code)));
}

}  // namespace

bool IsCorruption(const StoreError& error) {
  const std::string sentence = error.what();
  return sentence.find("malformed") != std::string::npos ||
         sentence.find("not a database") != std::string::npos;
}

std::string QuarantineDatabase(const std::string& path, std::int64_t now_ns) {
  std::string target = path + ".corrupt-" + std::to_string(now_ns);
  for (const char* companion : {"", "-wal", "-shm"}) {
    std::error_code error;
    std::filesystem::rename(path + companion, target + companion, error);
    if (error && error != std::errc::no_such_file_or_directory) {
      throw StoreError("store '" + path + "' is corrupt and cannot be renamed to '" + target +
                       "': " + error.message());
    }
  }
  return target;
}

SqliteStatement::SqliteStatement(sqlite3* database, const std::string& sql) {
  CheckSqlite(
      sqlite3_prepare_v2(database, sql.c_str(), static_cast<int>(sql.size()), &statement_, nullptr),
      database, "preparing '" + sql + "'");
}

SqliteStatement::~SqliteStatement() { sqlite3_finalize(statement_); }

SqliteStatement::SqliteStatement(SqliteStatement&& other) noexcept
    : statement_(std::exchange(other.statement_, nullptr)) {}

SqliteStatement& SqliteStatement::Bind(int index, std::int64_t value) {
  CheckSqlite(sqlite3_bind_int64(statement_, index, value), sqlite3_db_handle(statement_),
              "binding");
  return *this;
}

SqliteStatement& SqliteStatement::Bind(int index, double value) {
  CheckSqlite(sqlite3_bind_double(statement_, index, value), sqlite3_db_handle(statement_),
              "binding");
  return *this;
}

SqliteStatement& SqliteStatement::Bind(int index, const std::string& text) {
  CheckSqlite(sqlite3_bind_text64(statement_, index, text.data(), text.size(), SQLITE_TRANSIENT,
                                  SQLITE_UTF8),
              sqlite3_db_handle(statement_), "binding");
  return *this;
}

SqliteStatement& SqliteStatement::BindBlob(int index, const void* data, std::size_t size) {
  // A null pointer would bind NULL; an empty blob must stay an empty blob.
  const void* bytes = size == 0 ? "" : data;
  CheckSqlite(sqlite3_bind_blob64(statement_, index, bytes, size, SQLITE_TRANSIENT),
              sqlite3_db_handle(statement_), "binding");
  return *this;
}

bool SqliteStatement::Step() {
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  sqlite3* database = sqlite3_db_handle(statement_);
  const int reset_code = sqlite3_reset(statement_);
  CheckSqlite(code == SQLITE_DONE ? reset_code : code, database, "running a statement");
  return false;
}

void SqliteStatement::Execute() {
  while (Step()) {
  }
}

void SqliteStatement::Reset() { sqlite3_reset(statement_); }

std::int64_t SqliteStatement::Int(int column) const {
  return sqlite3_column_int64(statement_, column);
}

double SqliteStatement::Real(int column) const { return sqlite3_column_double(statement_, column); }

std::string SqliteStatement::Text(int column) const {
  const auto blob = Blob(column);
  return std::string(blob.begin(), blob.end());
}

std::vector<std::uint8_t> SqliteStatement::Blob(int column) const {
  const auto* data = static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_, column));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
  return data == nullptr ? std::vector<std::uint8_t>{}
                         : std::vector<std::uint8_t>(data, data + size);
}

SqliteDatabase::SqliteDatabase(const std::string& path, bool durable) : path_(path) {
  const int code = sqlite3_open_v2(path.c_str(), &database_,
                                   SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  try {
    CheckSqlite(code, database_, "opening '" + path + "'");
    sqlite3_busy_timeout(database_, 5000);
    Execute("PRAGMA journal_mode=WAL");
    Execute(durable ? "PRAGMA synchronous=FULL" : "PRAGMA synchronous=NORMAL");
    Execute("PRAGMA foreign_keys=ON");
  } catch (...) {
    sqlite3_close(database_);
    throw;
  }
}

SqliteDatabase::~SqliteDatabase() { sqlite3_close_v2(database_); }

void SqliteDatabase::Execute(const std::string& sql) {
  CheckSqlite(sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, nullptr), database_,
              "'" + sql + "' on '" + path_ + "'");
}

SqliteStatement SqliteDatabase::Prepare(const std::string& sql) {
  return SqliteStatement(database_, sql);
}

void SqliteDatabase::CheckPages() {
  SqliteStatement check = Prepare("PRAGMA quick_check(1)");
  if (!check.Step() || check.Text(0) != "ok") {
    throw StoreError("store '" + path_ + "' is malformed: " + check.Text(0));
  }
}

void SqliteDatabase::Transaction(const std::function<void()>& body) {
  Execute("BEGIN IMMEDIATE");
  try {
    body();
    Execute("COMMIT");
  } catch (...) {
    // After a full disk SQLite may already have rolled back; the first error is the one to tell.
    sqlite3_exec(database_, "ROLLBACK", nullptr, nullptr, nullptr);
    throw;
  }
}

void SqliteDatabase::Migrate(const std::vector<std::string>& migrations) {
  SqliteStatement query = Prepare("PRAGMA user_version");
  query.Step();
  const auto version = static_cast<std::size_t>(query.Int(0));
  query.Reset();
  if (version > migrations.size()) {
    throw StoreError("store '" + path_ + "' has schema version " + std::to_string(version) +
                     ", this program knows versions up to " + std::to_string(migrations.size()));
  }
  for (std::size_t i = version; i < migrations.size(); ++i) {
    Transaction([&] {
      Execute(migrations[i]);
      Execute("PRAGMA user_version=" + std::to_string(i + 1));
    });
  }
}

}  // namespace livemap
