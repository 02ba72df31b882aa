#include "zone/store/store_connection.h"

#include <libpq-fe.h>
#include <soci/postgresql/soci-postgresql.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <array>
#include <cctype>
#include <charconv>
#include <memory>
#include <utility>

#include "common/sqlite.h"
#include "zone/store/postgresql_url.h"

namespace livemap::zone {
namespace {

constexpr int kOldestPostgresql = 120000;

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

/// The text of a double that reads back as the same one.
std::string TextOfNumber(double number) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number);
  return std::string(text.data(), end.ptr);
}

struct TextOfPlace {
  std::string operator()(const std::string* text) const {
    if (text->find('\0') != std::string::npos) {
      throw StoreError("store: a text holds a zero byte, which PostgreSQL does not keep");
    }
    return *text;
  }
  std::string operator()(const double* number) const { return TextOfNumber(*number); }
  std::string operator()(const long long* number) const { return std::to_string(*number); }
  std::string operator()(const int* number) const { return std::to_string(*number); }
};

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
  auto& session = const_cast<soci::session&>(session_);  // SOCI has no const access.
  return PQstatus(ConnectionOf(session)) != CONNECTION_OK;
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
  for (const QueuedWrite& write : queued_) {
    values.clear();
    for (const auto& value : write.values) values.push_back(value ? value->c_str() : nullptr);
    if (PQsendQueryPrepared(connection, write.statement, static_cast<int>(values.size()),
                            values.data(), nullptr, nullptr, 0) != 1) {
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
    const PostgresqlResult result(PQprepare(server, name_.c_str(), WithNumberedPlaces(sql).c_str(),
                                            static_cast<int>(places_.size()), nullptr));
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
  StoreConnection::QueuedWrite write{name_.c_str(), {}};
  write.values.reserve(places_.size());
  for (const BoundPlace& place : places_) {
    const bool is_null = place.indicator != nullptr && *place.indicator == soci::i_null;
    if (is_null) {
      write.values.emplace_back();
    } else {
      write.values.emplace_back(std::visit(TextOfPlace{}, place.value));
    }
  }
  connection_.queued_.push_back(std::move(write));
}

}  // namespace livemap::zone
