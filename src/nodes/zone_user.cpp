// livemap zone user: the people who may log in to a zone's map.
#include <pwd.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "accounts/account_store.h"
#include "common/clock.h"
#include "common/error.h"
#include "common/utc_text.h"
#include "nodes/word_program.h"

namespace livemap::nodes {
namespace {

using livemap::Error;
using livemap::accounts::AccountEventKind;
using livemap::accounts::AccountStore;
using livemap::accounts::Role;

constexpr char kHelp[] =
    R"(usage: ./livemap zone user add NAME --role viewer|official|admin [--directory DIR]
       ./livemap zone user passwd NAME [--directory DIR]
       ./livemap zone user role NAME --role viewer|official|admin [--directory DIR]
       ./livemap zone user remove NAME [--directory DIR]
       ./livemap zone user lock | unlock NAME [--directory DIR]
       ./livemap zone user list [--directory DIR]

The people who may log in to the zone's map. A viewer sees vehicles and unconfirmed hazards, an
official also decides, an admin also sees who logs in and manages the accounts. What is changed holds
at once, also while the zone runs; a new password, a lock and a removal end all sessions. The
password is asked for twice, or read from the first line of standard input where that is no
terminal.

  --role ROLE       what the person may do
  --directory DIR   folder of the zone's store, as the zone's directory:=DIR (default ~/.livemap/zone)
)";

struct Arguments {
  std::string action;
  std::string name;
  std::string role;
  std::string directory;
};

/// Throws Error for what is not accepted.
Arguments Parse(const std::vector<std::string>& words) {
  Arguments arguments;
  std::vector<std::string> places;
  for (std::size_t i = 0; i < words.size(); ++i) {
    std::string* value = nullptr;
    if (words[i] == "--role") value = &arguments.role;
    if (words[i] == "--directory") value = &arguments.directory;
    if (value == nullptr) {
      if (words[i].compare(0, 2, "--") == 0) {
        throw Error("unknown flag '" + words[i] + "', accepted are --role and --directory");
      }
      places.push_back(words[i]);
      continue;
    }
    if (i + 1 == words.size()) throw Error(words[i] + " needs a value");
    *value = words[++i];
  }
  const std::vector<std::string> actions{"add",  "passwd", "role", "remove",
                                         "lock", "unlock", "list"};
  if (places.empty() || std::find(actions.begin(), actions.end(), places[0]) == actions.end()) {
    throw Error(
        (places.empty() ? "nothing" : "'" + places[0] + "'") +
        std::string(
            " was given, accepted are add, passwd, role, remove, lock, unlock and list (see "
            "--help)"));
  }
  arguments.action = places[0];
  const bool is_list = arguments.action == "list";
  if (places.size() != (is_list ? 1U : 2U)) {
    throw Error(arguments.action + (is_list ? " takes no name" : " takes one name"));
  }
  if (!is_list) arguments.name = places[1];
  return arguments;
}

/// What a terminal shows of what is typed comes back when it ends.
class SilentTerminal {
 public:
  SilentTerminal() {
    is_terminal_ = tcgetattr(STDIN_FILENO, &before_) == 0;
    termios silent = before_;
    silent.c_lflag &= ~static_cast<tcflag_t>(ECHO);
    if (is_terminal_) tcsetattr(STDIN_FILENO, TCSAFLUSH, &silent);
  }
  ~SilentTerminal() {
    if (is_terminal_) tcsetattr(STDIN_FILENO, TCSAFLUSH, &before_);
  }
  SilentTerminal(const SilentTerminal&) = delete;
  SilentTerminal& operator=(const SilentTerminal&) = delete;
  bool is_terminal() const { return is_terminal_; }

 private:
  termios before_{};
  bool is_terminal_ = false;
};

std::string ReadLine(const char* question, bool asks) {
  if (asks) std::cerr << question << std::flush;
  std::string line;
  std::getline(std::cin, line);
  if (asks) std::cerr << '\n';
  return line;
}

std::string ReadPassword() {
  const SilentTerminal terminal;
  std::string password = ReadLine("Password: ", terminal.is_terminal());
  if (terminal.is_terminal() && ReadLine("Again: ", true) != password) {
    throw Error("the two passwords differ");
  }
  return password;
}

Role RequireRole(const std::string& name) {
  const auto role = livemap::accounts::RoleOf(name);
  if (role) return *role;
  throw Error("role '" + name + "' is not accepted, accepted are viewer, official and admin");
}

void List(const AccountStore& accounts) {
  if (!accounts.HasAccounts()) std::cerr << "livemap zone user: there are no accounts\n";
  for (const auto& account : accounts.List()) {
    const std::string last =
        account.last_log_in ? livemap::Rfc3339Seconds(*account.last_log_in) : "never logged in";
    std::cout << account.name << '\t' << livemap::accounts::RoleName(account.role) << '\t' << last
              << (account.locked ? "\tlocked" : "") << '\n';
  }
}

std::string Caller() {
  const char* const sudo = std::getenv("SUDO_USER");
  if (sudo != nullptr && *sudo != '\0') return sudo;
  const passwd* const user = getpwuid(geteuid());
  return user == nullptr ? std::to_string(geteuid()) : user->pw_name;
}

AccountStore Open(const Arguments& arguments) {
  std::string directory = arguments.directory;
  if (directory.empty()) {
    const char* const home = std::getenv("HOME");
    directory = std::string(home == nullptr ? "" : home) + "/.livemap/zone";
    std::filesystem::create_directories(directory);
  }
  // Not made: what was mistyped would look like a zone without accounts.
  if (!std::filesystem::is_directory(directory)) {
    throw Error("there is no folder '" + directory +
                "', accepted is the folder of the zone's store");
  }
  return AccountStore(directory + "/accounts.sqlite", {});
}

void Run(const Arguments& arguments) {
  const std::int64_t now_ns = livemap::SystemNs();
  const std::string& name = arguments.name;
  if (arguments.action == "list") return List(Open(arguments));
  const bool has_role = arguments.action == "add" || arguments.action == "role";
  const std::optional<Role> role =
      has_role ? std::optional(RequireRole(arguments.role)) : std::nullopt;
  AccountStore accounts = Open(arguments);
  AccountEventKind done = AccountEventKind::kRemove;
  if (arguments.action == "add") {
    done = AccountEventKind::kAdd;
    accounts.Add(name, *role, ReadPassword(), now_ns);
    std::cout << "added " << name << " as " << arguments.role << '\n';
  } else if (arguments.action == "passwd") {
    done = AccountEventKind::kSetPassword;
    accounts.SetPassword(name, ReadPassword(), now_ns);
    std::cout << name << " has a new password\n";
  } else if (arguments.action == "role") {
    done = AccountEventKind::kRole;
    accounts.SetRole(name, *role);
    std::cout << name << " is " << arguments.role << " from now on\n";
  } else if (arguments.action == "remove") {
    accounts.Remove(name);
    std::cout << "removed " << name << '\n';
  } else {
    const bool locks = arguments.action == "lock";
    done = locks ? AccountEventKind::kLock : AccountEventKind::kUnlock;
    accounts.SetLocked(name, locks);
    std::cout << arguments.action << "ed " << name << '\n';
  }
  accounts.Note({0, done, name, Caller(), "", now_ns, role});
}

}  // namespace
}  // namespace livemap::nodes

int main(int argc, char** argv) {
  using namespace livemap::nodes;
  return RunWordProgram("livemap zone user", kHelp, argc, argv,
                        [](const std::vector<std::string>& words) { Run(Parse(words)); });
}
