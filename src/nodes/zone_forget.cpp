// livemap zone forget: erases all that leads to one vehicle from a zone's store.
#include <pwd.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/clock.h"
#include "common/error.h"
#include "common/sqlite.h"
#include "nodes/word_program.h"
#include "zone/pictures/owned_directory.h"
#include "zone/service/erasure_desk.h"
#include "zone/service/zone_service.h"
#include "zone/store/erasure_requests.h"
#include "zone/store/postgresql_url.h"
#include "zone/store/zone_store.h"

namespace livemap::nodes {
namespace {

using livemap::Error;
using livemap::zone::ErasureCounts;
using livemap::zone::ErasureRequests;

constexpr char kHelp[] =
    R"(usage: ./livemap zone forget VEHICLE [--directory DIR] [--store-url URL] [--by NAME]

Erases all that leads to the vehicle from the zone's store, also while the zone runs: its name in
reports, answers and decisions gives way to random ones, where it was is dropped, and its pictures
are deleted. Hazards stay, and count the vehicle as before. It cannot be taken back. Lock the
vehicle out first (livemap zone revoke): what it tells afterwards is a new vehicle's.

  --by NAME         who asks, for the audit trail (default: the user who calls)
  --directory DIR   folder of the zone's store, as the zone's directory:=DIR (default ~/.livemap/zone)
  --store-url URL   database of PostgreSQL that keeps the store, as the zone's store_url:=URL; a
                    running zone knows its own
)";

struct Arguments {
  std::string vehicle;
  std::string directory;
  std::string store_url;
  std::string by;
};

std::string Caller() {
  const char* const sudo = std::getenv("SUDO_USER");
  if (sudo != nullptr && *sudo != '\0') return sudo;
  const passwd* const user = getpwuid(geteuid());
  return user == nullptr ? std::to_string(geteuid()) : user->pw_name;
}

/// Throws Error for what is not accepted.
Arguments Parse(const std::vector<std::string>& words) {
  Arguments arguments;
  std::vector<std::string> places;
  for (std::size_t i = 0; i < words.size(); ++i) {
    std::string* value = nullptr;
    if (words[i] == "--by") value = &arguments.by;
    if (words[i] == "--directory") value = &arguments.directory;
    if (words[i] == "--store-url") value = &arguments.store_url;
    if (value == nullptr) {
      if (words[i].compare(0, 2, "--") == 0) {
        throw Error("unknown flag '" + words[i] +
                    "', accepted are --by, --directory and --store-url");
      }
      places.push_back(words[i]);
      continue;
    }
    if (i + 1 == words.size()) throw Error(words[i] + " needs a value");
    *value = words[++i];
  }
  if (places.size() != 1) {
    throw Error(std::to_string(places.size()) + " vehicles were given, accepted is one");
  }
  arguments.vehicle = places[0];
  if (arguments.directory.empty()) {
    const char* const home = std::getenv("HOME");
    arguments.directory = std::string(home == nullptr ? "" : home) + "/.livemap/zone";
  }
  if (arguments.by.empty()) arguments.by = Caller();
  if (!arguments.store_url.empty()) {
    arguments.store_url = livemap::zone::CheckedPostgresqlUrl(arguments.store_url);
  }
  return arguments;
}

/// Throws Error where there is neither a store nor a running zone: what was mistyped would look
/// like a zone that has forgotten.
void RequireStore(const Arguments& arguments) {
  const std::string& directory = arguments.directory;
  if (!std::filesystem::is_directory(directory)) {
    throw Error("there is no folder '" + directory +
                "', accepted is the folder of the zone's store");
  }
  if (!arguments.store_url.empty()) {
    if (livemap::zone::HoldsStore(arguments.store_url)) return;
    throw Error("'" + arguments.store_url + "' holds no store, accepted is the zone's store_url");
  }
  if (livemap::zone::HoldsStore(directory + "/zone.sqlite3")) return;
  throw Error("there is no zone.sqlite3 in '" + directory +
              "' and no zone runs in it; accepted is the folder of the zone's store, with "
              "--store-url where PostgreSQL keeps it");
}

/// Null while a zone has the folder for itself. Throws Error where there is no store.
std::unique_ptr<livemap::zone::ZoneService> OpenStore(const Arguments& arguments) {
  RequireStore(arguments);
  livemap::zone::ZoneConfig config;
  config.directory = arguments.directory;
  config.store_url = arguments.store_url;
  // Nothing goes for other reasons.
  config.image_cap_bytes = 1e15;
  try {
    return std::make_unique<livemap::zone::ZoneService>(config, livemap::SystemNs, 1);
  } catch (const livemap::zone::DirectoryInUse&) {
    return nullptr;
  }
}

/// Only what there is already is looked at: asking leaves nothing in a mistyped folder.
bool ZoneRunsIn(const std::string& directory) {
  if (!std::filesystem::exists(directory + "/zone.lock")) return false;
  try {
    const livemap::zone::OwnedDirectory free(directory);
    return false;
  } catch (const livemap::zone::DirectoryInUse&) {
    return true;
  }
}

ErasureRequests::Outcome AwaitZone(const ErasureRequests& requests, std::int64_t id) {
  std::cerr << "livemap zone forget: the running zone does it; the request stays if you stop "
               "waiting\n";
  for (;;) {
    if (auto outcome = requests.Find(id)) return *outcome;
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
}

ErasureRequests::Outcome Forget(const Arguments& arguments) {
  auto zone = ZoneRunsIn(arguments.directory) ? nullptr : OpenStore(arguments);
  ErasureRequests requests(ErasureRequests::PathIn(arguments.directory));
  const std::int64_t id = requests.Add(arguments.vehicle, arguments.by, livemap::SystemNs());
  if (!zone) return AwaitZone(requests, id);
  while (!requests.Find(id)) {
    livemap::zone::WorkOffErasure(requests, *zone, livemap::SystemNs());
  }
  zone.reset();
  if (arguments.store_url.empty()) {
    // What an older version dropped may still stand in free pages.
    livemap::SqliteDatabase database(arguments.directory + "/zone.sqlite3", true);
    database.Execute("VACUUM");
    database.Execute("PRAGMA wal_checkpoint(TRUNCATE)");
  }
  return *requests.Find(id);
}

void Run(const Arguments& arguments) {
  const ErasureRequests::Outcome outcome = Forget(arguments);
  if (!outcome.refusal.empty()) throw Error(outcome.refusal);
  const ErasureCounts& counts = outcome.counts;
  if (counts.rows() == 0 && counts.pictures == 0) {
    std::cout << "the store has nothing of such a vehicle\n";
    return;
  }
  std::cout << "forgotten: " << counts.reports << " reports, " << counts.answers << " answers, "
            << counts.hazards << " hazards and map changes, " << counts.pictures << " pictures, "
            << counts.places << " places\n";
}

}  // namespace
}  // namespace livemap::nodes

int main(int argc, char** argv) {
  using namespace livemap::nodes;
  return RunWordProgram("livemap zone forget", kHelp, argc, argv,
                        [](const std::vector<std::string>& words) { Run(Parse(words)); });
}
