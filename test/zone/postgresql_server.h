#pragma once

#include <libpq-fe.h>
#include <pwd.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace livemap::test {

/// A server of PostgreSQL for this process: its data in a folder that it removes, reached by a
/// socket in it alone, with the settings of a fresh installation. It ends with the object, and with
/// the thread that started it, however that ends.
///
/// Typical usage:
///
///     if (!PostgresqlServer::IsInstalled()) GTEST_SKIP() << "skipped, no PostgreSQL server";
///     PostgresqlServer server;
///     const std::string url = server.MakeDatabase();
class PostgresqlServer {
 public:
  static bool IsInstalled() { return Programs().has_value(); }

  PostgresqlServer() {
    // A copy costs a tenth of making the same again.
    static const Installation installation;
    const std::string copy =
        AsSomebody() + "cp -a '" + installation.path() + "/data' '" + folder() + "/data'";
    if (std::system(copy.c_str()) != 0) Fail("no copy of " + installation.path());
    Start();
  }
  ~PostgresqlServer() { Kill(SIGQUIT); }
  PostgresqlServer(const PostgresqlServer&) = delete;
  PostgresqlServer& operator=(const PostgresqlServer&) = delete;

  /// Starts the server again after Kill, with these settings beside its own, e.g. "-c fsync=off".
  void Start(const std::string& settings = "") {
    const std::string command = "exec " + AsSomebody() + "'" + *Programs() + "/postgres' -D '" +
                                folder() + "/data' -k '" + folder() +
                                "' -c listen_addresses='' -c shared_buffers=32MB " + settings +
                                " >> '" + folder() + "/server.log' 2>&1";
    for (int i = 0; i < 600; ++i) {
      // It ends at once while processes of a killed one are attached to their common memory.
      if (process_ < 0 || waitpid(process_, nullptr, WNOHANG) == process_)
        process_ = Spawn(command);
      if (PQping(Url("postgres").c_str()) == PQPING_OK) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    Fail("the server does not start: " + TextOf(folder() + "/server.log"));
  }
  /// SIGKILL leaves it no time to finish anything. Waits until the processes that it had are gone,
  /// too, six seconds at most: until they notice, they go on to answer.
  void Kill(int signal) {
    if (process_ <= 0) return;
    const std::vector<pid_t> children = Children(process_);
    ::kill(process_, signal);
    waitpid(process_, nullptr, 0);
    process_ = -1;
    for (const pid_t child : children) {
      for (int i = 0; i < 600 && IsRunning(child); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  std::string Url(const std::string& database) const {
    return "postgresql://livemap@/" + database + "?host=" + folder();
  }
  /// The URL of an empty database that nobody uses.
  std::string MakeDatabase() {
    if (unused_.empty()) {
      const std::string name = "zone_" + std::to_string(++databases_);
      Run(Url("postgres"), "CREATE DATABASE " + name);
      return Url(name);
    }
    const std::string url = unused_.back();
    unused_.pop_back();
    return url;
  }
  /// Takes a database back, whoever is connected to it. It is emptied and used again: making one
  /// copies PostgreSQL's own, and dropping one waits until all that the server has is on disk.
  void TakeBack(const std::string& url) {
    Run(url,
        "SET synchronous_commit = off; SET client_min_messages = warning; "
        "SELECT pg_terminate_backend(pid, 10000) FROM pg_stat_activity "
        "WHERE datname = current_database() AND pid <> pg_backend_pid(); "
        "DROP SCHEMA public CASCADE; CREATE SCHEMA public");
    unused_.push_back(url);
  }

 private:
  /// A new folder, of the user whom PostgreSQL runs as, that goes away with the object.
  class Folder {
   public:
    Folder() {
      std::string pattern = (RoomyFolder() / "livemap_postgresql_XXXXXX").string();
      path_ = mkdtemp(pattern.data());
      if (const passwd* user = Somebody()) {
        if (chown(path_.c_str(), user->pw_uid, user->pw_gid) != 0) Fail("no folder");
      }
      std::filesystem::permissions(path_, std::filesystem::perms(0755));
    }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path_, ignored);
    }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
    const std::string& path() const { return path_; }

   private:
    std::string path_;
  };

  /// A folder with the data of a server that never ran.
  class Installation : public Folder {
   public:
    Installation() {
      const std::string make = AsSomebody() + "'" + *Programs() + "/initdb' -D '" + path() +
                               "/data' -U livemap -A trust -E UTF8 --locale=C.UTF-8 -N > '" +
                               path() + "/initdb.log' 2>&1";
      if (std::system(make.c_str()) != 0) Fail("initdb failed: " + TextOf(path() + "/initdb.log"));
    }
  };

  const std::string& folder() const { return folder_.path(); }

  static std::string TextOf(const std::string& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  static std::vector<pid_t> Children(pid_t process) {
    const std::string id = std::to_string(process);
    std::ifstream file("/proc/" + id + "/task/" + id + "/children");
    return {std::istream_iterator<pid_t>(file), std::istream_iterator<pid_t>()};
  }
  /// False for one that ended and that nobody has waited for.
  static bool IsRunning(pid_t process) {
    std::ifstream file("/proc/" + std::to_string(process) + "/stat");
    std::string stat;
    std::getline(file, stat);
    const std::size_t name_end = stat.rfind(')');
    return name_end != std::string::npos && stat.compare(name_end, 3, ") Z") != 0;
  }
  static pid_t Spawn(const std::string& command) {
    const pid_t process = fork();
    if (process != 0) return process;
    execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  [[noreturn]] static void Fail(const std::string& why) {
    throw std::runtime_error("PostgreSQL for tests: " + why);
  }

  /// In memory where that has room: each commit waits until it is on disk, which no test looks at.
  static std::filesystem::path RoomyFolder() {
    namespace fs = std::filesystem;
    constexpr std::uintmax_t kEnough = 1 << 30;
    const fs::path memory = "/dev/shm";
    std::error_code error;
    const fs::space_info space = fs::space(memory, error);
    const bool is_usable = !error && space.available >= kEnough && access("/dev/shm", W_OK) == 0;
    return is_usable ? memory : fs::temp_directory_path();
  }
  /// The folder of the newest version's programs.
  static std::optional<std::string> Programs() {
    namespace fs = std::filesystem;
    std::optional<std::string> newest;
    std::error_code error;
    double newest_version = 0;
    for (const auto& entry : fs::directory_iterator("/usr/lib/postgresql", error)) {
      const std::string programs = (entry.path() / "bin").string();
      const double version = std::atof(entry.path().filename().c_str());
      if (!fs::exists(programs + "/postgres") || version <= newest_version) continue;
      newest = programs;
      newest_version = version;
    }
    return newest;
  }

  /// PostgreSQL refuses to run as root: then it runs as this user; null for another user.
  static const passwd* Somebody() {
    if (geteuid() != 0) return nullptr;
    const passwd* user = getpwnam("postgres");
    return user != nullptr ? user : getpwnam("nobody");
  }
  static std::string AsSomebody() {
    std::string command = "setpriv --pdeathsig QUIT ";
    if (const passwd* user = Somebody()) {
      command += "--reuid " + std::to_string(user->pw_uid) + " --regid " +
                 std::to_string(user->pw_gid) + " --clear-groups ";
    }
    return command + "-- ";
  }

  static void Run(const std::string& url, const std::string& sql) {
    PGconn* connection = PQconnectdb(url.c_str());
    PGresult* result = PQexec(connection, sql.c_str());
    const bool done = PQresultStatus(result) == PGRES_COMMAND_OK;
    const std::string why = PQerrorMessage(connection);
    PQclear(result);
    PQfinish(connection);
    if (!done) Fail(sql + ": " + why);
  }

  const Folder folder_;
  pid_t process_ = -1;
  int databases_ = 0;
  std::vector<std::string> unused_;  ///< URLs of empty databases.
};

}  // namespace livemap::test
