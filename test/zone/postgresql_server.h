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
    namespace fs = std::filesystem;
    std::string pattern = (RoomyFolder() / "livemap_postgresql_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    if (const passwd* user = Somebody()) {
      if (chown(folder_.c_str(), user->pw_uid, user->pw_gid) != 0) Fail("no folder");
    }
    fs::permissions(folder_, fs::perms(0755));
    const std::string log = " > '" + folder_ + "/initdb.log' 2>&1";
    const std::string make = AsSomebody() + "'" + *Programs() + "/initdb' -D '" + folder_ +
                             "/data' -U livemap -A trust -E UTF8 --locale=C.UTF-8 -N" + log;
    if (std::system(make.c_str()) != 0) Fail("initdb failed, see " + folder_);
    Start();
  }
  ~PostgresqlServer() {
    Kill(SIGQUIT);
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  PostgresqlServer(const PostgresqlServer&) = delete;
  PostgresqlServer& operator=(const PostgresqlServer&) = delete;

  /// Starts the server again after Kill, with these settings beside its own, e.g. "-c fsync=off".
  void Start(const std::string& settings = "") {
    const std::string command = "exec " + AsSomebody() + "'" + *Programs() + "/postgres' -D '" +
                                folder_ + "/data' -k '" + folder_ +
                                "' -c listen_addresses='' -c shared_buffers=32MB " + settings +
                                " >> '" + folder_ + "/server.log' 2>&1";
    for (int i = 0; i < 600; ++i) {
      // It ends at once while processes of a killed one are attached to their common memory.
      if (process_ < 0 || waitpid(process_, nullptr, WNOHANG) == process_)
        process_ = Spawn(command);
      if (PQping(Url("postgres").c_str()) == PQPING_OK) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    Fail("the server does not start, see " + folder_ + "/server.log");
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
    return "postgresql://livemap@/" + database + "?host=" + folder_;
  }
  /// The URL of a new, empty database.
  std::string MakeDatabase() {
    const std::string name = "zone_" + std::to_string(++databases_);
    Run("CREATE DATABASE " + name);
    return Url(name);
  }
  void DropDatabase(const std::string& url) {
    const std::string begin = "postgresql://livemap@/";
    const std::size_t end = url.find('?');
    Run("DROP DATABASE IF EXISTS " + url.substr(begin.size(), end - begin.size()) +
        " WITH (FORCE)");
  }

 private:
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

  /// In memory where that has room: each database that is dropped waits until all is on disk, which
  /// no test looks at.
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

  void Run(const std::string& sql) const {
    PGconn* connection = PQconnectdb(Url("postgres").c_str());
    PGresult* result = PQexec(connection, sql.c_str());
    const bool done = PQresultStatus(result) == PGRES_COMMAND_OK;
    const std::string why = PQerrorMessage(connection);
    PQclear(result);
    PQfinish(connection);
    if (!done) Fail(sql + ": " + why);
  }

  std::string folder_;
  pid_t process_ = -1;
  int databases_ = 0;
};

}  // namespace livemap::test
