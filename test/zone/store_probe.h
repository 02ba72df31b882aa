#pragma once

#include <libpq-fe.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "common/sqlite.h"
#include "zone/store/postgresql_url.h"

namespace livemap::zone {

/// What tests read from, and write into, a zone's store behind the zone's back, of either database.
class StoreProbe {
 public:
  /// The path of the file or the URL, as ZoneStore takes it.
  explicit StoreProbe(const std::string& database) {
    if (IsPostgresqlUrl(database)) {
      server_.reset(PQconnectdb(database.c_str()));
      if (PQstatus(server_.get()) != CONNECTION_OK) throw StoreError(PQerrorMessage(server_.get()));
    } else {
      file_ = std::make_unique<SqliteDatabase>(database, true);
    }
  }

  /// Statements with `;` between them. Throws StoreError.
  void Execute(const std::string& sql) {
    if (file_) {
      file_->Execute(sql);
    } else {
      Ask(sql);
    }
  }
  /// The first column of a query's rows, with a blank between them.
  std::string Text(const std::string& sql) {
    std::string text;
    const auto add = [&text](const std::string& value) {
      text += (text.empty() ? "" : " ") + value;
    };
    if (file_) {
      SqliteStatement query = file_->Prepare(sql);
      while (query.Step()) add(query.Text(0));
      return text;
    }
    const Result result = Ask(sql);
    for (int row = 0; row < PQntuples(result.get()); ++row) add(PQgetvalue(result.get(), row, 0));
    return text;
  }
  double Number(const std::string& sql) { return std::strtod(Text(sql).c_str(), nullptr); }

  /// Each `change` (INSERT or UPDATE) of the table fails from now on with this message; with a
  /// condition on the row NEW, only those that fulfil it.
  void Refuse(const std::string& change, const std::string& table, const std::string& message,
              const std::string& condition = "") {
    const std::string when = condition.empty() ? "" : " WHEN (" + condition + ")";
    const std::string trigger =
        "CREATE TRIGGER refused BEFORE " + change + " ON " + table + " FOR EACH ROW" + when;
    if (file_) {
      Execute(trigger + " BEGIN SELECT RAISE(ABORT, '" + message + "'); END");
    } else {
      Execute(
          "CREATE OR REPLACE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS "
          "$$BEGIN RAISE EXCEPTION '" +
          message + "'; END$$; " + trigger + " EXECUTE FUNCTION refuse()");
    }
  }
  /// Undoes Refuse.
  void Accept(const std::string& table) {
    Execute(file_ ? "DROP TRIGGER refused" : "DROP TRIGGER refused ON " + table);
  }

  /// Until Release, whoever writes waits, as for a slow disk.
  void HoldWriters() {
    Execute(file_ ? "BEGIN IMMEDIATE" : "BEGIN; LOCK TABLE hazards IN EXCLUSIVE MODE");
  }
  void Release() { Execute("ROLLBACK"); }

 private:
  struct Free {
    void operator()(PGconn* connection) const { PQfinish(connection); }
    void operator()(PGresult* result) const { PQclear(result); }
  };
  using Result = std::unique_ptr<PGresult, Free>;

  Result Ask(const std::string& sql) {
    Result result(PQexec(server_.get(), sql.c_str()));
    const ExecStatusType status = PQresultStatus(result.get());
    if (status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK) return result;
    throw StoreError(sql + ": " + PQerrorMessage(server_.get()));
  }

  std::unique_ptr<SqliteDatabase> file_;
  std::unique_ptr<PGconn, Free> server_;
};

}  // namespace livemap::zone
