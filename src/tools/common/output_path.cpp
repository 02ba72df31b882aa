#include "tools/common/output_path.h"

#include <filesystem>
#include <system_error>

#include "common/error.h"

namespace livemap::tools {
namespace {

namespace fs = std::filesystem;

/// Where a path leads, whether or not something is there.
fs::path WholeOutputPath(const std::string& path) {
  std::error_code unknown;
  const fs::path whole = fs::weakly_canonical(fs::absolute(path, unknown), unknown);
  return whole.has_filename() ? whole : whole.parent_path();  // It ended in a slash.
}

}  // namespace

void CheckOutputFile(const std::string& what, const std::string& output,
                     const std::vector<std::string>& inputs) {
  const fs::path target = WholeOutputPath(output);
  std::error_code unknown;
  for (const std::string& input : inputs) {
    const fs::path source = WholeOutputPath(input);
    if (target == source) {
      throw Error(what + " is '" + output + "', which is read, accepted is another file");
    }
    if (!fs::is_regular_file(target, unknown) || target.extension() == ".bag") continue;
    const std::string folder = source.string() + "/";
    if (!fs::is_directory(source, unknown) ||
        target.string().compare(0, folder.size(), folder) != 0)
      continue;
    throw Error(what + " is '" + output + "', which exists in '" + input +
                "' and would be overwritten, accepted is a new file or one elsewhere");
  }
}

void CheckOutputFolder(const std::string& what, const std::string& output,
                       const std::vector<std::string>& inputs) {
  const fs::path target = WholeOutputPath(output);
  for (const std::string& input : inputs) {
    if (WholeOutputPath(input).parent_path() != target) continue;
    throw Error(what + " is '" + output + "', which holds '" + input +
                "', accepted is a folder without the files that are read");
  }
}

}  // namespace livemap::tools
