#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"

namespace livemap {
class SqliteDatabase;
}

namespace livemap::accounts {

/// What somebody may do with a zone's map. Each may do what those before it may.
enum class Role {
  kViewer,    ///< Sees vehicles, their trails, and hazards that drivers are not told of.
  kOfficial,  ///< Decides about hazards, map changes and vehicles.
  kAdmin      ///< Also what is about the zone itself: who has accounts, and who logs in.
};
/// "viewer", "official" or "admin".
const char* RoleName(Role role);
std::optional<Role> RoleOf(const std::string& name);

/// Somebody who may log in.
struct Account {
  std::string name;
  Role role = Role::kViewer;
  std::int64_t created_ns = 0;              ///< System clock, UTC ns since 1970, as all here.
  std::int64_t password_ns = 0;             ///< When the password was set.
  std::optional<std::int64_t> last_log_in;  ///< None: never yet.
  bool locked = false;                      ///< Nobody may log in to it.
};

/// What is written down of log-ins and accounts.
enum class AccountEventKind {
  kLogIn,
  kWrongPassword,  ///< Also the right one of a locked account.
  kLogOut,
  kLock,
  kUnlock,
  kEndSessions,
  kAdd,
  kRole,
  kSetPassword,
  kRemove
};
/// "log_in", "wrong_password", "log_out", "lock", "unlock", "end_sessions", "add", "role",
/// "set_password" or "remove".
const char* AccountEventName(AccountEventKind kind);

/// One line of the trail of log-ins.
struct AccountEvent {
  std::uint64_t id = 0;  ///< Rises from 1; the store gives it.
  AccountEventKind kind = AccountEventKind::kLogIn;
  std::string name;    ///< Of the account; empty where a wrong name was tried.
  std::string by;      ///< Who did it: the account itself, or an admin.
  std::string client;  ///< From where: an address or its network; empty: this machine's shell.
  std::int64_t at_ns = 0;
  std::optional<Role> role =
      std::nullopt;  ///< What the account has been since; of kAdd and kRole alone.
};

/// Who has logged in.
struct Person {
  std::string name;
  Role role = Role::kViewer;
};

/// The people of a zone and their sessions, in a SQLite file that the server and `livemap zone
/// user` share: what one changes holds for the other at once. Of passwords the file has argon2id
/// hashes, of sessions SHA-256 hashes of random tokens. Thread-safe. Everything throws StoreError
/// when the file cannot be read or written.
///
/// Typical usage:
///   AccountStore accounts("/var/lib/livemap/zone/accounts.sqlite", {});
///   const auto person = accounts.CheckPassword(name, password);
///   if (person) answer.cookie = accounts.OpenSession(person->name, SystemNs());
class AccountStore {
 public:
  struct Config {
    double session_s = 12 * 3600;  ///< A session ends so long after it was opened.
  };
  static constexpr std::size_t kMaxNameBytes = 64;
  static constexpr std::size_t kMaxAccounts = 10'000;
  static constexpr std::size_t kMaxSessionsOfOne = 20;  ///< The oldest goes for one more.
  static constexpr std::size_t kMaxEvents = 100'000;

  /// Opens the file, or makes one that only its owner may read.
  AccountStore(const std::string& path, const Config& config);
  ~AccountStore();
  AccountStore(const AccountStore&) = delete;
  AccountStore& operator=(const AccountStore&) = delete;

  /// Throws Error naming what is accepted for a name, a password or too many accounts, and for a
  /// name that there is.
  void Add(const std::string& name, Role role, const std::string& password, std::int64_t now_ns);
  /// Ends all sessions of the account. These, SetLocked and EndSessions throw Error for a name that
  /// there is not.
  void SetPassword(const std::string& name, const std::string& password, std::int64_t now_ns);
  void SetRole(const std::string& name, Role role);
  void Remove(const std::string& name);
  /// A locked account's password is wrong, and its sessions end.
  void SetLocked(const std::string& name, bool locked);
  /// In the order of their names.
  std::vector<Account> List() const;
  bool HasAccounts() const;
  bool Has(const std::string& name) const;

  /// Whose name and password these are; none where they are wrong, and nobody can tell by the time
  /// it takes whether there is such a name. Slow (HashPassword).
  std::optional<Person> CheckPassword(const std::string& name, const std::string& password) const;
  /// A new session's token, 64 hexadecimal digits.
  std::string OpenSession(const std::string& name, std::int64_t now_ns);
  /// Whose session it is; none where it is none, has ended or was closed. Quick.
  std::optional<Person> FindSession(const std::string& token, std::int64_t now_ns) const;
  void CloseSession(const std::string& token);
  /// How many there were.
  std::size_t EndSessions(const std::string& name);
  /// How many sessions each account has at `now_ns`; none of those without one.
  std::map<std::string, std::size_t> CountSessions(std::int64_t now_ns) const;

  /// Writes the event down, whose id is given here; the oldest goes beyond kMaxEvents.
  void Note(const AccountEvent& event);
  /// The newest `limit` events whose id is below `before`, the newest first.
  std::vector<AccountEvent> Events(std::uint64_t before, std::size_t limit) const;

  /// Random, kept in the file: tells this zone's cookies from another's of the same host.
  const std::string& id() const { return id_; }
  const Config& config() const { return config_; }

 private:
  /// The hash of an account's password and its role; none where there is no such account.
  std::optional<std::pair<std::string, Role>> FindHash(const std::string& name) const;
  /// Throws Error where no row was changed.
  void RequireChange(const std::string& name) const REQUIRES(mutex_);

  const Config config_;
  mutable Mutex mutex_;
  const std::unique_ptr<SqliteDatabase> database_ PT_GUARDED_BY(mutex_);
  std::string id_;
};

}  // namespace livemap::accounts
