#include "zone/store/store_connection.h"

#include <libpq-fe.h>
#include <poll.h>
#include <soci/postgresql/soci-postgresql.h>
#include <soci/sqlite3/soci-sqlite3.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <memory>
#include <utility>

#include "common/sqlite.h"
#include "zone/store/postgresql_url.h"

namespace livemap::zone {
namespace {

constexpr int kOldestPostgresql = 120000;
/// Of a ping, which waits for no disk.
constexpr std::chrono::milliseconds kPingPatience{2000};

struct FreeResult {
  void operator()(PGresult* result) const { PQclear(result); }
};
using PostgresqlResult = std::unique_ptr<PGresult, FreeResult>;

PGconn* ConnectionOf(soci::session& session) {
  return static_cast<soci::postgresql_session_backend*>(session.get_backend())->conn_;
}

std::string SqliteConnectionText(const std::string& path) {
  if (path.find('"') != std::string::npos) {
    throw StoreError("store: path '" + path + "' holds a quotation mark, which is not accepted");
  }
  return "db=\"" + path + "\" timeout=10";
}

std::string PostgresqlSetting(soci::session& session, const std::string& name) {
  std::string value;
  session << "SHOW " << name, soci::into(value);
  return value;
}

/// With so many rows, or so much in one of its columns, a group takes no further row.
constexpr int kMostRowsAtOnce = 1000;
constexpr std::size_t kMostColumnBytes = 1 << 20;

PostgresqlType TypeOfPlace(const BoundPlace& place) {
  constexpr std::array kTypes{PostgresqlType::kText, PostgresqlType::kDouble,
                              PostgresqlType::kInteger64, PostgresqlType::kInteger32};
  return kTypes.at(place.value.index());
}

void AddPlace(const BoundPlace& place, PostgresqlColumn& column) {
  if (place.indicator != nullptr && *place.indicator == soci::i_null) {
    column.AddNull();
  } else {
    std::visit([&](const auto* value) { column.Add(*value); }, place.value);
  }
}

/// `:a, :b` as libpq writes it, `$1, $2`.
std::string WithNumberedPlaces(const std::string& sql) {
  std::string numbered;
  int count = 0;
  for (std::size_t i = 0; i < sql.size(); ++i) {
    if (sql[i] != ':') {
      numbered += sql[i];
      continue;
    }
    while (i + 1 < sql.size() && std::isalnum(static_cast<unsigned char>(sql[i + 1])) != 0) ++i;
    numbered += "$" + std::to_string(++count);
  }
  return numbered;
}

/// Where an INSERT's values stand, `VALUES (...)`: from its first to behind its last character.
/// Empty where the statement is another one, or makes its values of more than places.
std::pair<std::size_t, std::size_t> ValuesOfInsert(const std::string& sql) {
  const std::size_t begin = sql.find("VALUES (");
  if (sql.rfind("INSERT INTO ", 0) != 0 || begin == std::string::npos) return {};
  std::size_t end = begin + std::string("VALUES (").size();
  const auto is_of_places = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == ':' || c == ',' || c == ' ';
  };
  while (end < sql.size() && is_of_places(sql[end])) ++end;
  if (end == sql.size() || sql[end] != ')') return {};
  return {begin, end + 1};
}

/// The INSERT that takes an array for each place and inserts a row for each of their elements.
std::string InsertOfRows(const std::string& sql, const std::vector<BoundPlace>& places) {
  const auto [begin, end] = ValuesOfInsert(sql);
  std::string rows = "SELECT * FROM unnest(";
  for (std::size_t i = 0; i < places.size(); ++i) {
    rows += (i == 0 ? "CAST($" : ", CAST($") + std::to_string(i + 1) + " AS " +
            NameOf(TypeOfPlace(places[i])) + "[])";
  }
  return sql.substr(0, begin) + rows + ")" + sql.substr(end);
}

/// How many columns the key of an `ON CONFLICT (...) DO UPDATE` has. PostgreSQL refuses rows of one
/// statement that meet there.
std::size_t ConflictColumns(const std::string& sql) {
  const std::string mark = "ON CONFLICT (";
  const std::size_t begin = sql.find(mark);
  if (begin == std::string::npos || sql.find("DO UPDATE", begin) == std::string::npos) return 0;
  const auto from = sql.begin() + static_cast<std::ptrdiff_t>(begin + mark.size());
  return 1 + static_cast<std::size_t>(std::count(from, std::find(from, sql.end(), ')'), ','));
}

}  // namespace

std::string WhyStoreDamaged(const std::string& path, const std::string& verdict) {
  return "store: database '" + path + "' is damaged and left alone: " + verdict +
         "; how to recover what it holds stands in docs/how-to/recover-a-store.md";
}

StoreConnection::StoreConnection(const std::string& database, Use use)
    : is_postgresql_(IsPostgresqlUrl(database)), dialect_(is_postgresql_) {
  if (is_postgresql_) {
    session_.open(soci::postgresql, CheckedPostgresqlUrl(database));
    SetUpPostgresql(use);
  } else {
    session_.open(soci::sqlite3, SqliteConnectionText(database));
    SetUpSqlite(database, use);
  }
}

void StoreConnection::SetUpSqlite(const std::string& path, Use use) {
  if (use == Use::kRead) {
    session_ << "PRAGMA query_only=ON";
    return;
  }
  session_ << "PRAGMA synchronous=FULL";
  std::string mode;
  session_ << "PRAGMA journal_mode=WAL", soci::into(mode);
  session_ << "PRAGMA foreign_keys=ON";
  // What is erased or overwritten leaves nothing in the pages.
  int erases = 0;
  session_ << "PRAGMA secure_delete=ON", soci::into(erases);
  // 64 MB of pages stay in memory; the log is taken over after 40 MB, so that a page that many
  // commits touch is written to its place once for all of them.
  session_ << "PRAGMA cache_size=-65536";
  int pages = 0;
  session_ << "PRAGMA wal_autocheckpoint=10000", soci::into(pages);
  std::string verdict;
  session_ << "PRAGMA quick_check(1)", soci::into(verdict);
  if (verdict != "ok") throw StoreError(WhyStoreDamaged(path, verdict));
}

void StoreConnection::SetUpPostgresql(Use use) {
  const int version = PQserverVersion(ConnectionOf(session_));
  if (version < kOldestPostgresql) {
    throw StoreError("store: the PostgreSQL server has version " + std::to_string(version / 10000) +
                     ", accepted are 12 and later");
  }
  const std::string encoding = PostgresqlSetting(session_, "server_encoding");
  if (encoding != "UTF8") {
    throw StoreError("store: the database has the encoding " + encoding +
                     ", accepted is UTF8: createdb --encoding=UTF8 --template=template0");
  }
  session_ << "SET client_encoding = 'UTF8'";
  session_ << "SET client_min_messages = warning";
  if (use == Use::kRead) {
    session_ << "SET default_transaction_read_only = on";
    return;
  }
  for (const char* setting : {"fsync", "full_page_writes"}) {
    if (PostgresqlSetting(session_, setting) == "on") continue;
    throw StoreError(std::string("store: the PostgreSQL server has ") + setting +
                     " = off, with which a power cut loses what was committed; accepted is on");
  }
  const std::string commit = PostgresqlSetting(session_, "synchronous_commit");
  if (commit == "off") session_ << "SET synchronous_commit = on";
}

bool StoreConnection::IsLost() const {
  if (!is_postgresql_) return false;
  if (is_given_up_) return true;
  auto& session = const_cast<soci::session&>(session_);  // SOCI has no const access.
  return PQstatus(ConnectionOf(session)) != CONNECTION_OK;
}

void StoreConnection::Ping() {
  Flush();
  if (is_postgresql_) {
    PingServer();
  } else {
    PingFile();
  }
}

/// Not by SOCI, which waits as long as it takes.
void StoreConnection::PingServer() {
  PGconn* connection = ConnectionOf(session_);
  const auto end = std::chrono::steady_clock::now() + kPingPatience;
  if (PQsendQuery(connection, "SELECT pg_is_in_recovery()") != 1) {
    throw StoreError(std::string("store: the server is not asked: ") + PQerrorMessage(connection));
  }
  while (PQisBusy(connection) == 1) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        end - std::chrono::steady_clock::now());
    pollfd answer{PQsocket(connection), POLLIN, 0};
    if (left.count() <= 0 || poll(&answer, 1, static_cast<int>(left.count())) == 0) {
      is_given_up_ = true;
      // Statements that are ended with the session ask the server once more, and wait for ever.
      shutdown(PQsocket(connection), SHUT_RDWR);
      throw StoreError("store: the server has not answered within " +
                       std::to_string(kPingPatience.count()) + " ms");
    }
    if (PQconsumeInput(connection) != 1) break;
  }
  std::string error;
  bool only_reads = false;
  for (;;) {
    const PostgresqlResult result(PQgetResult(connection));
    if (result == nullptr) break;
    if (PQresultStatus(result.get()) != PGRES_TUPLES_OK) {
      error = PQresultErrorMessage(result.get());
    } else {
      only_reads = *PQgetvalue(result.get(), 0, 0) == 't';
    }
  }
  if (error.empty() && IsLost()) error = "the connection to the server is lost";
  if (!error.empty()) throw StoreError("store: the server does not answer: " + error);
  if (only_reads) throw StoreError("store: the server is a replica that only reads");
}

/// What is written to a file without a name is lost.
void StoreConnection::PingFile() {
  auto* file = static_cast<soci::sqlite3_session_backend*>(session_.get_backend())->conn_;
  int has_moved = 0;
  if (sqlite_api::sqlite3_file_control(file, "main", SQLITE_FCNTL_HAS_MOVED, &has_moved) ==
          SQLITE_OK &&
      has_moved != 0) {
    throw StoreError("store: the database's file was moved or removed");
  }
  int version = 0;
  session_ << "PRAGMA schema_version", soci::into(version);
}

std::string StoreConnection::TakeNextName() { return "livemap_" + std::to_string(++names_); }

void StoreConnection::Flush() {
  if (queued_.empty()) return;
  const std::string error = SendQueued();
  queued_.clear();
  if (!error.empty()) throw StoreError("store: writing failed: " + error);
}

/// In a pipeline: one wait for all. The first error in the server's words; empty without.
std::string StoreConnection::SendQueued() {
  PGconn* connection = ConnectionOf(session_);
  if (PQenterPipelineMode(connection) != 1) return PQerrorMessage(connection);
  std::string error;
  std::vector<const char*> values;
  std::vector<int> sizes;
  std::vector<int> formats;
  for (QueuedWrite& write : queued_) {
    values.clear();
    sizes.clear();
    for (PostgresqlColumn& column : write.columns) {
      const auto sent = write.takes_rows ? column.Array() : column.Only();
      values.push_back(sent.bytes);
      sizes.push_back(sent.size);
    }
    formats.assign(values.size(), 1);  // All are binary.
    if (PQsendQueryPrepared(connection, write.statement, static_cast<int>(values.size()),
                            values.data(), sizes.data(), formats.data(), 0) != 1) {
      error = PQerrorMessage(connection);
      break;
    }
  }
  if (PQpipelineSync(connection) != 1 && error.empty()) error = PQerrorMessage(connection);
  // Each statement's result is followed by a null pointer; a broken connection gives only those.
  for (int nothing = 0; nothing < 2;) {
    const PostgresqlResult result(PQgetResult(connection));
    if (result == nullptr) {
      ++nothing;
      continue;
    }
    nothing = 0;
    const ExecStatusType status = PQresultStatus(result.get());
    if (status == PGRES_PIPELINE_SYNC) break;
    if (status == PGRES_FATAL_ERROR && error.empty()) error = PQresultErrorMessage(result.get());
  }
  if (PQexitPipelineMode(connection) != 1 && error.empty()) error = PQerrorMessage(connection);
  if (error.empty() && IsLost()) error = "the connection to the server is lost";
  return error;
}

WriteStatement::WriteStatement(StoreConnection& connection, const std::string& sql,
                               std::initializer_list<BoundPlace> places)
    : connection_(connection), places_(places) {
  if (connection.is_postgresql()) {
    PGconn* server = ConnectionOf(connection.session_);
    name_ = connection.TakeNextName();
    takes_rows_ = ValuesOfInsert(sql).second != 0;
    conflict_places_ = ConflictColumns(sql);
    // What is not given as an array has the type in which it is sent.
    std::vector<Oid> types(places_.size(), 0);
    if (!takes_rows_) {
      std::transform(places_.begin(), places_.end(), types.begin(),
                     [](const BoundPlace& place) { return static_cast<Oid>(TypeOfPlace(place)); });
    }
    const std::string text = takes_rows_ ? InsertOfRows(sql, places_) : WithNumberedPlaces(sql);
    const PostgresqlResult result(PQprepare(server, name_.c_str(), text.c_str(),
                                            static_cast<int>(places_.size()), types.data()));
    if (PQresultStatus(result.get()) != PGRES_COMMAND_OK) {
      throw StoreError("store: preparing '" + sql + "' failed: " + PQerrorMessage(server));
    }
    return;
  }
  statement_.emplace(connection.session_);
  for (const BoundPlace& place : places_) {
    std::visit(
        [&](auto* value) {
          if (place.indicator != nullptr) {
            statement_->exchange(soci::use(*value, *place.indicator));
          } else {
            statement_->exchange(soci::use(*value));
          }
        },
        place.value);
  }
  statement_->alloc();
  statement_->prepare(sql);
  statement_->define_and_bind();
}

void WriteStatement::Execute() {
  if (statement_) {
    statement_->execute(true);
    return;
  }
  Queue();
}

/// Beside the row before, where that is of this statement and PostgreSQL takes both at once.
void WriteStatement::Queue() {
  auto& queued = connection_.queued_;
  std::string conflict;
  if (conflict_places_ > 0) {
    std::vector<PostgresqlColumn> key;
    for (std::size_t i = 0; i < conflict_places_; ++i) {
      AddPlace(places_[i], key.emplace_back(TypeOfPlace(places_[i])));
      conflict += key.back().elements();
    }
  }
  const bool joins =
      takes_rows_ && !queued.empty() && queued.back().statement == name_.c_str() &&
      queued.back().conflicts.count(conflict) == 0 &&
      std::all_of(queued.back().columns.begin(), queued.back().columns.end(),
                  [](const auto& column) {
                    return column.rows() < kMostRowsAtOnce && column.bytes() < kMostColumnBytes;
                  });
  if (!joins) {
    auto& write = queued.emplace_back();
    write.statement = name_.c_str();
    write.takes_rows = takes_rows_;
    for (const BoundPlace& place : places_) write.columns.emplace_back(TypeOfPlace(place));
  }
  StoreConnection::QueuedWrite& write = queued.back();
  for (std::size_t i = 0; i < places_.size(); ++i) AddPlace(places_[i], write.columns[i]);
  if (conflict_places_ > 0) write.conflicts.insert(std::move(conflict));
}

}  // namespace livemap::zone
