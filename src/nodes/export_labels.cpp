// livemap zone export-labels: what officials decided, as labelled pictures.
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include "common/error.h"
#include "nodes/word_program.h"
#include "zone/labels/label_export.h"
#include "zone/store/postgresql_url.h"

namespace livemap::nodes {
namespace {

constexpr char kExportHelp[] =
    R"(usage: ./livemap zone export-labels DIR [--directory DIRECTORY] [--store-url URL]

Writes the pictures of hazards about which officials decided, with labels, as training/train_detector.py
--own DIR takes them. A confirmed hazard is labelled by its box. A rejected one is background. One in the
same picture about which nobody has decided counts as neither. decisions.csv beside them says who decided
what of which picture, and when. The zone may be running; nothing in its store is changed. Vehicles draw
boxes into the pictures that they send, unless hazard_reporting's draw_boxes is false; a network can learn
the drawn lines.

  DIR                    a new or an empty folder
  --directory DIRECTORY  folder of the zone's store, as the zone's directory:=DIR (default ~/.livemap/zone)
  --store-url URL        database of PostgreSQL that keeps the store, as the zone's store_url:=URL
)";

struct ExportArguments {
  std::string out;
  std::string directory;
  std::string store_url;
};

/// Throws Error for what is not accepted.
ExportArguments ParseExport(const std::vector<std::string>& words) {
  ExportArguments arguments;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == "--directory" || words[i] == "--store-url") {
      const std::string& flag = words[i];
      if (i + 1 == words.size()) throw livemap::Error(flag + " needs a value");
      (flag == "--directory" ? arguments.directory : arguments.store_url) = words[++i];
    } else if (words[i].compare(0, 2, "--") == 0) {
      throw livemap::Error("unknown flag '" + words[i] +
                           "', accepted are --directory and --store-url");
    } else if (!arguments.out.empty()) {
      throw livemap::Error("'" + words[i] + "' was given too, accepted is one folder");
    } else {
      arguments.out = words[i];
    }
  }
  if (arguments.out.empty()) {
    throw livemap::Error("no folder was given, accepted is one to write to (see --help)");
  }
  if (arguments.directory.empty()) {
    const char* const home = std::getenv("HOME");
    arguments.directory = std::string(home == nullptr ? "" : home) + "/.livemap/zone";
  }
  if (!arguments.store_url.empty()) livemap::zone::CheckedPostgresqlUrl(arguments.store_url);
  return arguments;
}

void Tell(const livemap::zone::LabelExport& done, const std::string& out) {
  std::cout << done.pictures << " pictures with " << done.boxes << " boxes in '" << out << "', "
            << done.backgrounds << " of them background\n";
  if (done.no_picture > 0) {
    std::cout << done.no_picture << " pictures are no longer on disk\n";
  }
  if (done.no_box > 0) {
    std::cout << done.no_box << " decided hazards have no picture whose box is known\n";
  }
  if (done.odd_classes > 0) {
    std::cout << done.odd_classes << " decided hazards are of classes that no detector can have\n";
  }
}

}  // namespace
}  // namespace livemap::nodes

int main(int argc, char** argv) {
  using namespace livemap::nodes;
  return RunWordProgram(
      "livemap zone export-labels", kExportHelp, argc, argv,
      [](const std::vector<std::string>& words) {
        const ExportArguments arguments = ParseExport(words);
        Tell(livemap::zone::ExportLabels(arguments.directory, arguments.out, arguments.store_url),
             arguments.out);
      });
}
