#include "accounts/account_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "accounts/password.h"
#include "common/sha256.h"
#include "common/sqlite.h"
#include "common/time.h"
#include "protocol/text_rules.h"

namespace livemap::accounts {
namespace {

constexpr std::array<Role, 3> kRoles{Role::kViewer, Role::kOfficial, Role::kAdmin};
constexpr std::array<AccountEventKind, 10> kAccountEventKinds{
    AccountEventKind::kLogIn, AccountEventKind::kWrongPassword, AccountEventKind::kLogOut,
    AccountEventKind::kLock,  AccountEventKind::kUnlock,        AccountEventKind::kEndSessions,
    AccountEventKind::kAdd,   AccountEventKind::kRole,          AccountEventKind::kSetPassword,
    AccountEventKind::kRemove};
constexpr std::size_t kTokenBytes = 32;
const std::vector<std::string>& Migrations() {
  // Two programs that open a new file at once both make its tables.
  static const std::vector<std::string> migrations{
      "CREATE TABLE IF NOT EXISTS zone (id TEXT NOT NULL);"
      "CREATE TABLE IF NOT EXISTS accounts (name TEXT PRIMARY KEY, role TEXT NOT NULL, "
      "password_hash TEXT NOT "
      "NULL, created_ns INTEGER NOT NULL, password_ns INTEGER NOT NULL, last_log_in_ns INTEGER) "
      "WITHOUT ROWID;"
      "CREATE TABLE IF NOT EXISTS sessions (token_sha256 TEXT PRIMARY KEY, name TEXT NOT NULL "
      "REFERENCES "
      "accounts (name) ON DELETE CASCADE, opened_ns INTEGER NOT NULL) WITHOUT ROWID;"
      "CREATE INDEX IF NOT EXISTS sessions_by_name ON sessions (name, opened_ns);",
      "CREATE TABLE IF NOT EXISTS locked (name TEXT PRIMARY KEY REFERENCES accounts (name) ON "
      "DELETE CASCADE) WITHOUT ROWID;"
      "CREATE TABLE IF NOT EXISTS account_events (id INTEGER PRIMARY KEY, kind TEXT NOT NULL, name "
      "TEXT NOT NULL, done_by TEXT NOT NULL, client TEXT NOT NULL, at_ns INTEGER NOT NULL);",
      "CREATE TABLE IF NOT EXISTS account_event_roles (id INTEGER PRIMARY KEY REFERENCES "
      "account_events (id) ON DELETE CASCADE, role TEXT NOT NULL);"};
  return migrations;
}

/// Before SQLite makes it with the mode that the process happens to have.
const std::string& MakePrivate(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) {
    throw StoreError("accounts '" + path + "' cannot be opened: " + std::strerror(errno));
  }
  close(file);
  return path;
}

void RequireName(const std::string& name) {
  if (protocol::IsAcceptableName(name, AccountStore::kMaxNameBytes)) return;
  throw Error("the name is not accepted, accepted are 1 to " +
              std::to_string(AccountStore::kMaxNameBytes) +
              " bytes of printable text without blanks at its ends");
}

void RequirePassword(const std::string& password) {
  if (IsAcceptablePassword(password)) return;
  throw Error("the password is not accepted, accepted are " + std::to_string(kMinPasswordBytes) +
              " to " + std::to_string(kMaxPasswordBytes) + " bytes of printable text");
}

/// As the file has it; what it has beside is somebody else's doing.
Role StoredRole(const std::string& name) {
  const auto role = RoleOf(name);
  if (!role) throw StoreError("accounts: '" + name + "' is stored as a role and is none");
  return *role;
}

}  // namespace

const char* RoleName(Role role) {
  switch (role) {
    case Role::kViewer:
      return "viewer";
    case Role::kOfficial:
      return "official";
    case Role::kAdmin:
      return "admin";
  }
  return "unknown";
}

std::optional<Role> RoleOf(const std::string& name) {
  for (const Role role : kRoles) {
    if (name == RoleName(role)) return role;
  }
  return std::nullopt;
}

const char* AccountEventName(AccountEventKind kind) {
  switch (kind) {
    case AccountEventKind::kLogIn:
      return "log_in";
    case AccountEventKind::kWrongPassword:
      return "wrong_password";
    case AccountEventKind::kLogOut:
      return "log_out";
    case AccountEventKind::kLock:
      return "lock";
    case AccountEventKind::kUnlock:
      return "unlock";
    case AccountEventKind::kEndSessions:
      return "end_sessions";
    case AccountEventKind::kAdd:
      return "add";
    case AccountEventKind::kRole:
      return "role";
    case AccountEventKind::kSetPassword:
      return "set_password";
    case AccountEventKind::kRemove:
      return "remove";
  }
  return "unknown";
}

AccountStore::AccountStore(const std::string& path, const Config& config)
    : config_(config), database_(std::make_unique<SqliteDatabase>(MakePrivate(path), true)) {
  const MutexLock lock(mutex_);
  database_->Migrate(Migrations());
  database_->Prepare("INSERT INTO zone SELECT ? WHERE NOT EXISTS (SELECT 1 FROM zone)")
      .Bind(1, RandomHex(4))
      .Execute();
  auto query = database_->Prepare("SELECT id FROM zone LIMIT 1");
  if (query.Step()) id_ = query.Text(0);
}

AccountStore::~AccountStore() = default;

void AccountStore::RequireChange(const std::string& name) const {
  auto changes = database_->Prepare("SELECT changes()");
  if (changes.Step() && changes.Int(0) > 0) return;
  throw Error("there is no account '" + name + "'");
}

void AccountStore::Add(const std::string& name, Role role, const std::string& password,
                       std::int64_t now_ns) {
  RequireName(name);
  RequirePassword(password);
  const std::string hash = HashPassword(password);
  const MutexLock lock(mutex_);
  database_->Transaction([&] {
    mutex_.AssertHeld();
    auto count = database_->Prepare("SELECT count(*) FROM accounts");
    if (count.Step() && count.Int(0) >= static_cast<std::int64_t>(kMaxAccounts)) {
      throw Error("there are " + std::to_string(kMaxAccounts) + " accounts already");
    }
    auto there = database_->Prepare("SELECT 1 FROM accounts WHERE name = ?");
    if (there.Bind(1, name).Step()) throw Error("there is an account '" + name + "' already");
    database_
        ->Prepare(
            "INSERT INTO accounts (name, role, password_hash, created_ns, password_ns) VALUES (?, "
            "?, ?, ?, ?)")
        .Bind(1, name)
        .Bind(2, std::string(RoleName(role)))
        .Bind(3, hash)
        .Bind(4, now_ns)
        .Bind(5, now_ns)
        .Execute();
  });
}

void AccountStore::SetPassword(const std::string& name, const std::string& password,
                               std::int64_t now_ns) {
  RequirePassword(password);
  const std::string hash = HashPassword(password);
  const MutexLock lock(mutex_);
  database_->Transaction([&] {
    mutex_.AssertHeld();
    database_->Prepare("UPDATE accounts SET password_hash = ?, password_ns = ? WHERE name = ?")
        .Bind(1, hash)
        .Bind(2, now_ns)
        .Bind(3, name)
        .Execute();
    RequireChange(name);
    database_->Prepare("DELETE FROM sessions WHERE name = ?").Bind(1, name).Execute();
  });
}

void AccountStore::SetRole(const std::string& name, Role role) {
  const MutexLock lock(mutex_);
  database_->Prepare("UPDATE accounts SET role = ? WHERE name = ?")
      .Bind(1, std::string(RoleName(role)))
      .Bind(2, name)
      .Execute();
  RequireChange(name);
}

void AccountStore::Remove(const std::string& name) {
  const MutexLock lock(mutex_);
  database_->Prepare("DELETE FROM accounts WHERE name = ?").Bind(1, name).Execute();
  RequireChange(name);
}

void AccountStore::SetLocked(const std::string& name, bool locked) {
  const MutexLock lock(mutex_);
  database_->Transaction([&] {
    mutex_.AssertHeld();
    auto there = database_->Prepare("SELECT 1 FROM accounts WHERE name = ?");
    if (!there.Bind(1, name).Step()) throw Error("there is no account '" + name + "'");
    there.Reset();
    database_->Prepare("DELETE FROM locked WHERE name = ?").Bind(1, name).Execute();
    if (!locked) return;
    database_->Prepare("INSERT INTO locked VALUES (?)").Bind(1, name).Execute();
    database_->Prepare("DELETE FROM sessions WHERE name = ?").Bind(1, name).Execute();
  });
}

std::size_t AccountStore::EndSessions(const std::string& name) {
  const MutexLock lock(mutex_);
  std::int64_t ended = 0;
  database_->Transaction([&] {
    mutex_.AssertHeld();
    auto there = database_->Prepare("SELECT 1 FROM accounts WHERE name = ?");
    if (!there.Bind(1, name).Step()) throw Error("there is no account '" + name + "'");
    there.Reset();
    database_->Prepare("DELETE FROM sessions WHERE name = ?").Bind(1, name).Execute();
    auto changes = database_->Prepare("SELECT changes()");
    if (changes.Step()) ended = changes.Int(0);
  });
  return static_cast<std::size_t>(ended);
}

std::map<std::string, std::size_t> AccountStore::CountSessions(std::int64_t now_ns) const {
  const MutexLock lock(mutex_);
  std::map<std::string, std::size_t> counts;
  auto query =
      database_->Prepare("SELECT name, count(*) FROM sessions WHERE opened_ns > ? GROUP BY name");
  query.Bind(1, now_ns - Nanoseconds(config_.session_s));
  while (query.Step()) counts[query.Text(0)] = static_cast<std::size_t>(query.Int(1));
  return counts;
}

void AccountStore::Note(const AccountEvent& event) {
  const MutexLock lock(mutex_);
  database_->Transaction([&] {
    mutex_.AssertHeld();
    database_
        ->Prepare(
            "INSERT INTO account_events (kind, name, done_by, client, at_ns) VALUES (?, ?, ?, ?, "
            "?)")
        .Bind(1, std::string(AccountEventName(event.kind)))
        .Bind(2, event.name)
        .Bind(3, event.by)
        .Bind(4, event.client)
        .Bind(5, event.at_ns)
        .Execute();
    if (event.role) {
      database_->Prepare("INSERT INTO account_event_roles VALUES (last_insert_rowid(), ?)")
          .Bind(1, std::string(RoleName(*event.role)))
          .Execute();
    }
    database_
        ->Prepare("DELETE FROM account_events WHERE id <= (SELECT max(id) FROM account_events) - ?")
        .Bind(1, static_cast<std::int64_t>(kMaxEvents))
        .Execute();
  });
}

std::vector<AccountEvent> AccountStore::Events(std::uint64_t before, std::size_t limit) const {
  const auto most = static_cast<std::uint64_t>(INT64_MAX);
  const MutexLock lock(mutex_);
  std::vector<AccountEvent> events;
  auto query = database_->Prepare(
      "SELECT id, kind, name, done_by, client, at_ns, coalesce(role, '') FROM account_events LEFT "
      "JOIN account_event_roles USING (id) WHERE id < ? ORDER BY id DESC LIMIT ?");
  query.Bind(1, static_cast<std::int64_t>(std::min(before, most)))
      .Bind(2, static_cast<std::int64_t>(std::min<std::uint64_t>(limit, most)));
  while (query.Step()) {
    const std::string kind = query.Text(1);
    const auto known =
        std::find_if(kAccountEventKinds.begin(), kAccountEventKinds.end(),
                     [&](AccountEventKind one) { return kind == AccountEventName(one); });
    if (known == kAccountEventKinds.end()) continue;  // A newer version's.
    events.push_back({static_cast<std::uint64_t>(query.Int(0)), *known, query.Text(2),
                      query.Text(3), query.Text(4), query.Int(5), RoleOf(query.Text(6))});
  }
  return events;
}

std::vector<Account> AccountStore::List() const {
  const MutexLock lock(mutex_);
  std::vector<Account> accounts;
  auto query = database_->Prepare(
      "SELECT name, role, created_ns, password_ns, coalesce(last_log_in_ns, 0), name IN (SELECT "
      "name FROM locked) FROM accounts ORDER BY name");
  while (query.Step()) {
    Account account;
    account.name = query.Text(0);
    account.role = StoredRole(query.Text(1));
    account.created_ns = query.Int(2);
    account.password_ns = query.Int(3);
    if (query.Int(4) != 0) account.last_log_in = query.Int(4);
    account.locked = query.Int(5) != 0;
    accounts.push_back(std::move(account));
  }
  return accounts;
}

bool AccountStore::HasAccounts() const {
  const MutexLock lock(mutex_);
  return database_->Prepare("SELECT 1 FROM accounts LIMIT 1").Step();
}

bool AccountStore::Has(const std::string& name) const {
  const MutexLock lock(mutex_);
  return database_->Prepare("SELECT 1 FROM accounts WHERE name = ?").Bind(1, name).Step();
}

std::optional<std::pair<std::string, Role>> AccountStore::FindHash(const std::string& name) const {
  const MutexLock lock(mutex_);
  auto query = database_->Prepare(
      "SELECT password_hash, role FROM accounts WHERE name = ? AND name NOT IN (SELECT name FROM "
      "locked)");
  if (!query.Bind(1, name).Step()) return std::nullopt;
  return std::pair(query.Text(0), StoredRole(query.Text(1)));
}

std::optional<Person> AccountStore::CheckPassword(const std::string& name,
                                                  const std::string& password) const {
  if (password.size() > kMaxPasswordBytes) return std::nullopt;
  const auto found = FindHash(name);
  const bool is_right = IsPasswordOf(password, found ? found->first : kNobodysHash);
  if (!found || !is_right) return std::nullopt;
  return Person{name, found->second};
}

std::string AccountStore::OpenSession(const std::string& name, std::int64_t now_ns) {
  std::string token = RandomHex(kTokenBytes);
  const MutexLock lock(mutex_);
  database_->Transaction([&] {
    mutex_.AssertHeld();
    database_->Prepare("DELETE FROM sessions WHERE opened_ns <= ?")
        .Bind(1, now_ns - Nanoseconds(config_.session_s))
        .Execute();
    database_->Prepare("INSERT INTO sessions VALUES (?, ?, ?)")
        .Bind(1, Sha256Hex(token))
        .Bind(2, name)
        .Bind(3, now_ns)
        .Execute();
    database_
        ->Prepare(
            "DELETE FROM sessions WHERE name = ?1 AND token_sha256 NOT IN (SELECT token_sha256 "
            "FROM sessions WHERE name = ?1 ORDER BY opened_ns DESC LIMIT ?2)")
        .Bind(1, name)
        .Bind(2, static_cast<std::int64_t>(kMaxSessionsOfOne))
        .Execute();
    database_->Prepare("UPDATE accounts SET last_log_in_ns = ? WHERE name = ?")
        .Bind(1, now_ns)
        .Bind(2, name)
        .Execute();
  });
  return token;
}

std::optional<Person> AccountStore::FindSession(const std::string& token,
                                                std::int64_t now_ns) const {
  if (token.size() != 2 * kTokenBytes) return std::nullopt;
  const std::string hash = Sha256Hex(token);
  const MutexLock lock(mutex_);
  auto query = database_->Prepare(
      "SELECT name, role FROM sessions JOIN accounts USING (name) WHERE token_sha256 = ? AND "
      "opened_ns > ? AND name NOT IN (SELECT name FROM locked)");
  if (!query.Bind(1, hash).Bind(2, now_ns - Nanoseconds(config_.session_s)).Step()) {
    return std::nullopt;
  }
  return Person{query.Text(0), StoredRole(query.Text(1))};
}

void AccountStore::CloseSession(const std::string& token) {
  const MutexLock lock(mutex_);
  database_->Prepare("DELETE FROM sessions WHERE token_sha256 = ?")
      .Bind(1, Sha256Hex(token))
      .Execute();
}

}  // namespace livemap::accounts
