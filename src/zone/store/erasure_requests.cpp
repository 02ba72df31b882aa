#include "zone/store/erasure_requests.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <random>
#include <vector>

#include "common/error.h"
#include "common/number_text.h"
#include "common/sqlite.h"
#include "protocol/text_rules.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxErasureNameBytes = 64;
constexpr int kSecretBytes = 32;

const std::vector<std::string>& ErasureMigrations() {
  // Two programs that open a new file at once both make its table.
  static const std::vector<std::string> migrations{
      "CREATE TABLE IF NOT EXISTS erasures (id INTEGER PRIMARY KEY, vehicle_id TEXT NOT NULL, "
      "secret TEXT NOT NULL, asked_by TEXT NOT NULL, asked_ns INTEGER NOT NULL, done_ns INTEGER "
      "NOT NULL, reports INTEGER NOT NULL, answers INTEGER NOT NULL, hazards INTEGER NOT NULL, "
      "pictures INTEGER NOT NULL, places INTEGER NOT NULL, refusal TEXT NOT NULL);"};
  return migrations;
}

/// Before SQLite makes it with the mode that the process happens to have.
const std::string& MakeErasuresPrivate(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) {
    throw StoreError("erasures '" + path + "' cannot be opened: " + std::strerror(errno));
  }
  close(file);
  return path;
}

std::string RandomErasureSecret() {
  std::random_device source;  // The system's random numbers, on Linux.
  std::string secret;
  for (int i = 0; i < kSecretBytes; ++i) {
    AppendHex(secret, static_cast<std::uint8_t>(source() & 0xFFU));
  }
  return secret;
}

void RequireErasureName(const std::string& what, const std::string& name) {
  if (protocol::IsAcceptableName(name, kMaxErasureNameBytes)) return;
  throw Error(what + " is not accepted, accepted are 1 to " + std::to_string(kMaxErasureNameBytes) +
              " bytes of printable text without blanks at its ends");
}

}  // namespace

ErasureRequests::ErasureRequests(const std::string& path)
    : database_(std::make_unique<SqliteDatabase>(MakeErasuresPrivate(path), true)) {
  const MutexLock lock(mutex_);
  database_->Execute("PRAGMA secure_delete=ON");
  database_->Migrate(ErasureMigrations());
}

ErasureRequests::~ErasureRequests() = default;

std::int64_t ErasureRequests::Add(const std::string& vehicle_id, const std::string& by,
                                  std::int64_t now_ns) {
  RequireErasureName("the vehicle's name", vehicle_id);
  RequireErasureName("the name of who asks", by);
  const MutexLock lock(mutex_);
  std::int64_t id = 0;
  SqliteDatabase& database = *database_;
  database.Transaction([&] {
    database
        .Prepare(
            "INSERT INTO erasures (vehicle_id, secret, asked_by, asked_ns, done_ns, reports, "
            "answers, hazards, pictures, places, refusal) VALUES (?, ?, ?, ?, 0, 0, 0, 0, 0, 0, "
            "'')")
        .Bind(1, vehicle_id)
        .Bind(2, RandomErasureSecret())
        .Bind(3, by)
        .Bind(4, now_ns)
        .Execute();
    SqliteStatement query = database.Prepare("SELECT last_insert_rowid()");
    query.Step();
    id = query.Int(0);
  });
  return id;
}

std::optional<ErasureRequests::Request> ErasureRequests::Next() const {
  const MutexLock lock(mutex_);
  SqliteStatement query = database_->Prepare(
      "SELECT id, vehicle_id, secret, asked_by FROM erasures WHERE done_ns = 0 ORDER BY id LIMIT "
      "1");
  if (!query.Step()) return std::nullopt;
  return Request{query.Int(0), query.Text(1), query.Text(2), query.Text(3)};
}

void ErasureRequests::Finish(std::int64_t id, const Outcome& outcome, std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  const auto number = [](std::uint64_t value) { return static_cast<std::int64_t>(value); };
  database_
      ->Prepare(
          "UPDATE erasures SET vehicle_id = '', secret = '', done_ns = ?, reports = ?, answers = "
          "?, hazards = ?, pictures = ?, places = ?, refusal = ? WHERE id = ?")
      .Bind(1, now_ns)
      .Bind(2, number(outcome.counts.reports))
      .Bind(3, number(outcome.counts.answers))
      .Bind(4, number(outcome.counts.hazards))
      .Bind(5, number(outcome.counts.pictures))
      .Bind(6, number(outcome.counts.places))
      .Bind(7, outcome.refusal)
      .Bind(8, id)
      .Execute();
  // The log's end has the name, too.
  database_->Execute("PRAGMA wal_checkpoint(TRUNCATE)");
}

std::optional<ErasureRequests::Outcome> ErasureRequests::Find(std::int64_t id) const {
  const MutexLock lock(mutex_);
  SqliteStatement query = database_->Prepare(
      "SELECT reports, answers, hazards, pictures, places, refusal FROM erasures WHERE id = ? AND "
      "done_ns <> 0");
  query.Bind(1, id);
  if (!query.Step()) return std::nullopt;
  const auto number = [&](int column) { return static_cast<std::uint64_t>(query.Int(column)); };
  Outcome outcome;
  outcome.counts.reports = number(0);
  outcome.counts.answers = number(1);
  outcome.counts.hazards = number(2);
  outcome.counts.pictures = number(3);
  outcome.counts.places = number(4);
  outcome.refusal = query.Text(5);
  return outcome;
}

}  // namespace livemap::zone
