#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <deque>
#include <initializer_list>
#include <optional>
#include <string>
#include <unordered_set>
#include <variant>
#include <vector>

#include "zone/store/dialect.h"
#include "zone/store/postgresql_column.h"

namespace livemap::zone {

/// A place that a WriteStatement reads each time when it is run. The place outlives the statement.
struct BoundPlace {
  // Not explicit: statements list their places.
  BoundPlace(std::string& text) : value(&text) {}
  BoundPlace(double& number) : value(&number) {}
  BoundPlace(long long& number) : value(&number) {}
  BoundPlace(int& number) : value(&number) {}
  BoundPlace(int& number, soci::indicator& is_there) : value(&number), indicator(&is_there) {}

  std::variant<std::string*, double*, long long*, int*> value;
  soci::indicator* indicator = nullptr;  ///< Null where the value is always there.
};

/// A connection to the zone's database, SQLite's or PostgreSQL's. Not thread-safe.
///
/// What WriteStatement writes to PostgreSQL is sent at once for many rows: it is queued until
/// something else is asked of the connection, and its errors are thrown there. Rows that one
/// statement inserts one after the other become one statement of many rows. Everything that reads
/// goes through session(), or calls Flush first.
class StoreConnection {
 public:
  enum class Use { kWrite, kRead };

  /// Opens `database`; a SQLite file is made where there is none. Sets what makes a commit last:
  /// WAL and synchronous=FULL, or synchronous_commit=on. Throws soci_error, and StoreError for a
  /// server that breaks the promise (fsync off) or that cannot hold the zone's text.
  StoreConnection(const std::string& database, Use use);
  StoreConnection(const StoreConnection&) = delete;
  StoreConnection& operator=(const StoreConnection&) = delete;

  const Dialect& dialect() const { return dialect_; }
  bool is_postgresql() const { return is_postgresql_; }
  /// With all that was queued written. Throws StoreError.
  soci::session& session() {
    Flush();
    return session_;
  }
  /// Runs a query of session() that returns rows, to be fetched.
  void Run(soci::statement& query) {
    Flush();
    query.execute();
  }
  /// Writes what was queued. Throws StoreError; then nothing of it is queued any more.
  void Flush();
  /// Forgets what was queued.
  void Discard() { queued_.clear(); }
  /// Whether the connection to the server has broken. SQLite's never does.
  bool IsLost() const;
  /// Asks the database for as little as can be. Throws StoreError, and soci_error: the server does
  /// not answer within 2 s, after which the connection is lost, or only reads (a replica); or
  /// SQLite's file was moved or removed. Not to be called in a transaction.
  void Ping();

 private:
  friend class WriteStatement;
  struct QueuedWrite {
    const char* statement;  ///< The name of a prepared one, which outlives the queue.
    bool takes_rows;
    std::vector<PostgresqlColumn> columns;      ///< One for each place.
    std::unordered_set<std::string> conflicts;  ///< What the rows have where a key may be there.
  };

  void SetUpSqlite(const std::string& path, Use use);
  void SetUpPostgresql(Use use);
  std::string TakeNextName();
  std::string SendQueued();
  void PingServer();
  void PingFile();

  bool is_postgresql_;
  Dialect dialect_;
  soci::session session_;
  std::deque<QueuedWrite> queued_;
  std::size_t names_ = 0;
  bool is_given_up_ = false;  ///< An answer did not come, and would be taken for another one.
};

/// A statement that returns no rows, made ready once and run often. Its text has a name with a
/// colon before it for each place, in their order. The columns of an ON CONFLICT are the first that
/// an INSERT names.
class WriteStatement {
 public:
  /// Keeps the connection and the places. Throws soci_error.
  WriteStatement(StoreConnection& connection, const std::string& sql,
                 std::initializer_list<BoundPlace> places);
  WriteStatement(const WriteStatement&) = delete;
  WriteStatement& operator=(const WriteStatement&) = delete;

  /// Runs it, or queues it (StoreConnection). Throws soci_error and StoreError.
  void Execute();

 private:
  void Queue();

  StoreConnection& connection_;
  std::vector<BoundPlace> places_;
  std::optional<soci::statement> statement_;  ///< Of SQLite.
  // Of PostgreSQL.
  std::string name_;
  bool takes_rows_ = false;
  std::size_t conflict_places_ = 0;  ///< So many of the first places are the key of an ON CONFLICT.
};

/// Why a database is not usable as it is, in the words that operators look for.
std::string WhyStoreDamaged(const std::string& path, const std::string& verdict);

}  // namespace livemap::zone
