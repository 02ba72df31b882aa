// livemap region: many zones as one map.
#include <pthread.h>

#include <charconv>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "common/clock.h"
#include "common/error.h"
#include "common/mutex.h"
#include "common/utc_text.h"
#include "directory/directory_file.h"
#include "nodes/word_program.h"
#include "protocol/hazard_catalogue.h"
#include "region/region.h"
#include "region/region_server.h"
#include "region/zone_list.h"
#include "web/http/web_config.h"

namespace livemap::nodes {
namespace {

constexpr char kRegionHelp[] =
    R"(usage: ./livemap region --zone NAME=URL... [--directory FILE --authority CA] [FLAGS]

Serves the hazards of many zones as one map, with the open feeds. It follows each zone's log, and
shows a zone that is down with its last state, which it keeps on disk. Without accounts it can only be
read; with them officials log in, and decide by way of the zones. docs/how-to/run-a-region.md has all
of it.

  --zone NAME=URL          a zone and the address of its live map, such as north=https://north.example;
                           once for each zone
  --directory FILE         the signed directory of the zones: their areas, names and addresses
  --authority CA           the certificate of the authority that signed it, ca.pem of an identity's folder
  --token NAME=FILE        a file (mode 0600) with an official's bearer token for a zone that does not
                           show its hazards to everybody, or in which the region's officials decide;
                           once for each such zone
  --accounts DIR           folder of the region's own accounts (livemap zone user --directory DIR):
                           officials log in here, see candidates, and decide (default: nobody does)
  --ca FILE                certificates that are trusted for https (default: the system's)
  --store DIR              folder of the last states (default ~/.livemap/region)
  --ask-every-s SECONDS    between two questions to a zone, 0.1 to 3600 (default 2)
  --timeout-s SECONDS      for a zone's answer, 0.1 to 600 (default 10)
  --address ADDRESS        where to listen, 0.0.0.0 for the whole network (default 127.0.0.1)
  --port PORT              0 to 65535; 0 takes a free one (default 8090)
  --certificate FILE       PEM, for HTTPS; with --key (default: plain HTTP)
  --key FILE               PEM, its private key
  --public-url URL         of this server as others reach it, for links in feeds
  --title TEXT             of the page (default LiveMap)
  --publisher TEXT         of the feeds (default: the title)
  --country CODE           of the publisher, two lower-case letters (default zz: not said)
  --tile-url URL           of a background map, with {z}, {x} and {y} (default: none)
  --tile-file FILE         a background map of one file, MBTiles (default: none)
  --tile-attribution TEXT  whose map it is
  --proxy ADDRESS          a proxy whose X-Forwarded-For counts; once for each
  --catalogue FILE         classes of hazards (default: what LiveMap brings)
  --web-root DIR           folder of the page (default: what LiveMap brings)
)";

struct RegionArguments {
  region::ZoneList list;
  std::string directory;
  std::string authority;
  std::string catalogue;
  std::string accounts;
  region::Region::Config region;
  web::WebConfig web;
};

double RequireSeconds(const std::string& flag, const std::string& text) {
  double number = 0;
  const char* const end = text.data() + text.size();
  const auto [read, fault] = std::from_chars(text.data(), end, number);
  if (fault == std::errc() && read == end) return number;
  throw Error(flag + " is '" + text + "', accepted is a number of seconds");
}

int RequirePort(const std::string& flag, const std::string& text) {
  int port = -1;
  const char* const end = text.data() + text.size();
  const auto [read, fault] = std::from_chars(text.data(), end, port);
  if (fault == std::errc() && read == end && port >= 0 && port <= 65535) return port;
  throw Error(flag + " is '" + text + "', accepted is 0 to 65535");
}

void AddNamed(std::map<std::string, std::string>& all, const std::string& flag,
              const std::string& text) {
  auto [name, value] = region::SplitNamed(flag, text);
  if (all.emplace(name, std::move(value)).second) return;
  throw Error(flag + " names zone '" + name + "' twice, accepted is each zone once");
}

/// False for a flag that is none of these.
bool TakeWebFlag(const std::string& flag, const std::string& value, web::WebConfig& web) {
  if (flag == "--address") {
    web.address = value;
  } else if (flag == "--port") {
    web.port = RequirePort(flag, value);
  } else if (flag == "--certificate") {
    web.certificate_file = value;
  } else if (flag == "--key") {
    web.key_file = value;
  } else if (flag == "--public-url") {
    web.public_url = value;
  } else if (flag == "--title") {
    web.title = value;
  } else if (flag == "--publisher") {
    web.feed_publisher = value;
  } else if (flag == "--country") {
    web.feed_country = value;
  } else if (flag == "--tile-url") {
    web.tile_url = value;
  } else if (flag == "--tile-file") {
    web.tile_file = value;
  } else if (flag == "--tile-attribution") {
    web.tile_attribution = value;
  } else if (flag == "--proxy") {
    web.proxies.push_back(value);
  } else if (flag == "--web-root") {
    web.web_root = value;
  } else {
    return false;
  }
  return true;
}

void TakeRegionFlag(const std::string& flag, const std::string& value, RegionArguments& arguments) {
  if (flag == "--zone") {
    AddNamed(arguments.list.urls, flag, value);
  } else if (flag == "--token") {
    AddNamed(arguments.list.token_files, flag, value);
  } else if (flag == "--directory") {
    arguments.directory = value;
  } else if (flag == "--authority") {
    arguments.authority = value;
  } else if (flag == "--accounts") {
    arguments.accounts = value;
  } else if (flag == "--ca") {
    arguments.region.ca_file = value;
  } else if (flag == "--store") {
    arguments.region.directory = value;
  } else if (flag == "--ask-every-s") {
    arguments.region.ask_every_s = RequireSeconds(flag, value);
  } else if (flag == "--timeout-s") {
    arguments.region.timeout_s = RequireSeconds(flag, value);
  } else if (flag == "--catalogue") {
    arguments.catalogue = value;
  } else {
    throw Error("unknown flag '" + flag + "' (see --help)");
  }
}

/// Throws Error for what is not accepted.
RegionArguments ParseRegionArguments(const std::vector<std::string>& words) {
  RegionArguments arguments;
  arguments.web.port = 8090;
  for (std::size_t i = 0; i < words.size(); i += 2) {
    const std::string& flag = words[i];
    if (flag.compare(0, 2, "--") != 0) {
      throw Error("'" + flag + "' is not accepted, accepted are flags (see --help)");
    }
    if (i + 1 == words.size()) throw Error(flag + " needs a value (see --help)");
    if (!TakeWebFlag(flag, words[i + 1], arguments.web)) {
      TakeRegionFlag(flag, words[i + 1], arguments);
    }
  }
  if (arguments.directory.empty() != arguments.authority.empty()) {
    throw Error("--directory is '" + arguments.directory + "' and --authority is '" +
                arguments.authority + "', accepted are both or none");
  }
  if (arguments.directory.empty() && arguments.list.urls.empty()) {
    throw Error("no zone is given, accepted is --zone NAME=URL or --directory FILE (see --help)");
  }
  if (arguments.region.directory.empty()) {
    const char* const home = std::getenv("HOME");
    if (home == nullptr) throw Error("--store is missing: there is no home folder");
    arguments.region.directory = std::string(home) + "/.livemap/region";
  }
  return arguments;
}

/// Null where no directory is given.
std::shared_ptr<const directory::ZoneDirectory> ReadDirectory(const RegionArguments& arguments) {
  if (arguments.directory.empty()) return nullptr;
  directory::DirectoryFile file(directory::TrustedAuthority::Read(arguments.authority),
                                arguments.directory);
  const bool is_there = file.ReadIfChanged();
  if (!file.damage().empty()) throw Error(file.damage());
  auto zones = is_there ? file.directory() : nullptr;
  if (!zones) {
    throw Error("the directory '" + arguments.directory +
                "' cannot be read or has expired, accepted is a signed one that is valid now");
  }
  return zones;
}

/// Lines of several threads do not mix.
void SayLine(const std::string& line) {
  static Mutex mutex;
  const MutexLock lock(mutex);
  std::cerr << Rfc3339Seconds(SystemNs()) << " livemap region: " << line << std::endl;
}

/// Officials see candidates, so these are followed.
void TakeAccounts(RegionArguments& arguments) {
  // Not made: what was mistyped would look like a region without accounts.
  if (!std::filesystem::is_directory(arguments.accounts)) {
    throw Error("--accounts is '" + arguments.accounts + "', accepted is a folder that there is");
  }
  arguments.web.accounts_file = arguments.accounts + "/accounts.sqlite";
  for (region::RegionZone& zone : arguments.region.zones) {
    zone.with_candidates = true;
    if (!zone.token.empty()) continue;
    SayLine("zone '" + zone.id + "' has no --token: the region's officials cannot decide there");
  }
}

void Serve(RegionArguments arguments) {
  // Before there are threads: they inherit it, and the signal waits for sigwait.
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  const auto catalogue = arguments.catalogue.empty()
                             ? protocol::HazardCatalogue()
                             : protocol::HazardCatalogue::Load(arguments.catalogue);
  arguments.region.zones = region::ZonesOf(arguments.list, ReadDirectory(arguments).get());
  if (!arguments.accounts.empty()) TakeAccounts(arguments);
  web::Validate(arguments.web);
  region::Region region(arguments.region, catalogue, SystemNs, SayLine);
  const region::RegionServer server(arguments.web, region, catalogue);
  const char* const scheme = arguments.web.certificate_file.empty() ? "http://" : "https://";
  SayLine("ready with " + std::to_string(region.zones()) + " zones: live map at " + scheme +
          arguments.web.address + ':' + std::to_string(server.port()) + '/');
  int signal = 0;
  sigwait(&ends, &signal);
}

}  // namespace
}  // namespace livemap::nodes

int main(int argc, char** argv) {
  using namespace livemap::nodes;
  return RunWordProgram(
      "livemap region", kRegionHelp, argc, argv,
      [](const std::vector<std::string>& words) { Serve(ParseRegionArguments(words)); });
}
