// livemap zone directory: looks at an authority's list of zones, before and after it is signed.
#include "directory/zone_directory.h"

#include <charconv>
#include <cstddef>
#include <iomanip>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "common/clock.h"
#include "common/error.h"
#include "common/utc_text.h"
#include "directory/directory_keeper.h"
#include "directory/signed_document.h"
#include "nodes/word_program.h"

namespace livemap::nodes {
namespace {

using livemap::Error;
using livemap::directory::DirectoryKeeper;
using livemap::directory::ZoneDirectory;
using livemap::directory::ZoneEntry;
using livemap::geo::GeoPoint;

constexpr double kDefaultMaxOverlapM = 500;
constexpr double kMaxGapM = livemap::directory::ZoneChoice::Config{}.max_gap_m;

constexpr char kDirectoryHelp[] =
    R"(usage: ./livemap zone directory make FILE... --out FILE      (has --help)
       ./livemap zone directory show FILE --authority CA [--at LATITUDE LONGITUDE]
       ./livemap zone directory check FILE [--max-overlap-m METRES]
       ./livemap zone directory split FILE --zone ID --parts N --out FILE   (has --help)

make   signs the zones of GeoJSON files by the authority of this machine.
show   verifies a signed directory and lists its zones; with --at the zone that serves a place.
check  reads a directory's text before it is signed, and refuses one whose zones overlap too far.
split  cuts one zone of a directory's text into parts, each a zone of its own.

  --authority CA           the authority's certificate, ca.pem of any identity's folder
  --at LATITUDE LONGITUDE  degrees of WGS84
  --max-overlap-m METRES   so deep a zone's border may lie in another zone (default 500)
)";

struct DirectoryArguments {
  std::string command;
  std::string file;
  std::string authority;
  std::optional<GeoPoint> at;
  double max_overlap_m = kDefaultMaxOverlapM;
};

double RequireNumber(const std::string& flag, const std::string& text, double min, double max) {
  double number = 0;
  const char* const end = text.data() + text.size();
  const auto [read, fault] = std::from_chars(text.data(), end, number);
  // Written so that NaN is refused, too.
  if (fault == std::errc() && read == end && number >= min && number <= max) return number;
  std::ostringstream sentence;
  sentence << flag << " '" << text << "' is not accepted, accepted is a number from " << min
           << " to " << max;
  throw Error(sentence.str());
}

/// Throws Error for what is not accepted.
DirectoryArguments ParseDirectoryArguments(const std::vector<std::string>& words) {
  DirectoryArguments arguments;
  std::size_t next = 0;
  const auto take = [&](const std::string& flag) -> const std::string& {
    if (next >= words.size()) throw Error(flag + " needs a value (see --help)");
    return words[next++];
  };
  while (next < words.size()) {
    const std::string& word = words[next++];
    if (word == "--authority") {
      arguments.authority = take(word);
    } else if (word == "--at") {
      const double latitude_deg = RequireNumber(word, take(word), -90, 90);
      arguments.at = GeoPoint{latitude_deg, RequireNumber(word, take(word), -180, 180)};
    } else if (word == "--max-overlap-m") {
      arguments.max_overlap_m = RequireNumber(word, take(word), 0, 1e6);
    } else if (word.compare(0, 2, "--") == 0) {
      throw Error("unknown flag '" + word + "' (see --help)");
    } else if (arguments.command.empty()) {
      arguments.command = word;
    } else if (arguments.file.empty()) {
      arguments.file = word;
    } else {
      throw Error("'" + word + "' was given too, accepted is one file (see --help)");
    }
  }
  if (arguments.command != "show" && arguments.command != "check") {
    throw Error("'" + arguments.command +
                "' is not accepted, accepted are make, show, check and split");
  }
  if (arguments.file.empty()) throw Error("no file was given (see --help)");
  if (arguments.command == "show" && arguments.authority.empty()) {
    throw Error("--authority is missing: without it nobody knows whose signature counts");
  }
  return arguments;
}

std::string PlaceText(const GeoPoint& point) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(6) << point.latitude_deg << ", " << point.longitude_deg;
  return text.str();
}

void TellZone(const ZoneEntry& zone) {
  std::cout << zone.id;
  if (!zone.name.empty()) std::cout << " (" << zone.name << ")";
  for (const auto& broker : zone.brokers) std::cout << '\t' << broker.host << ':' << broker.port;
  std::cout << '\n';
}

void Check(const DirectoryArguments& arguments) {
  const ZoneDirectory directory = ZoneDirectory::Parse(
      livemap::ReadFile(arguments.file, ZoneDirectory::kMaxBytes), arguments.file);
  const auto overlaps = FindOverlaps(directory, arguments.max_overlap_m);
  if (overlaps.empty()) return;
  const auto& worst = overlaps.front();
  throw Error("zone '" + directory.zones()[worst.second].id + "' and zone '" +
              directory.zones()[worst.first].id + "' overlap by " +
              std::to_string(static_cast<int>(worst.depth_m)) + " m at " + PlaceText(worst.where) +
              ", accepted are at most " +
              std::to_string(static_cast<int>(arguments.max_overlap_m)) + " m (--max-overlap-m)");
}

void Show(const DirectoryArguments& arguments) {
  const auto authority = livemap::directory::TrustedAuthority::Read(arguments.authority);
  const std::string text =
      OpenSignedDocument(livemap::ReadFile(arguments.file, DirectoryKeeper::kMaxBytes), authority,
                         livemap::directory::kDirectorySigner, livemap::SystemNs(),
                         DirectoryKeeper::kMaxBytes, arguments.file);
  const ZoneDirectory directory = ZoneDirectory::Parse(text, arguments.file);
  if (arguments.at) {
    const auto found = directory.Find(*arguments.at, kMaxGapM);
    if (!found) {
      throw Error("no zone is within " + std::to_string(static_cast<int>(kMaxGapM)) + " m of " +
                  PlaceText(*arguments.at));
    }
    TellZone(directory.zones()[found->zone]);
    return;
  }
  std::cout << "authority " << directory.authority() << ", version " << directory.version()
            << ", issued " << livemap::Rfc3339Seconds(directory.issued_ns()) << ", expires "
            << livemap::Rfc3339Seconds(directory.expires_ns()) << '\n';
  for (const ZoneEntry& zone : directory.zones()) TellZone(zone);
}

}  // namespace
}  // namespace livemap::nodes

int main(int argc, char** argv) {
  using namespace livemap::nodes;
  return RunWordProgram("livemap zone directory", kDirectoryHelp, argc, argv,
                        [](const std::vector<std::string>& words) {
                          const DirectoryArguments arguments = ParseDirectoryArguments(words);
                          arguments.command == "check" ? Check(arguments) : Show(arguments);
                        });
}
