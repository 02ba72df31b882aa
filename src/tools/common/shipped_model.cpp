#include "tools/common/shipped_model.h"

#include <filesystem>

namespace livemap::tools {

std::string ShippedModel(const std::string& name) {
  namespace fs = std::filesystem;
  const std::string file = "models/" + name + ".yaml";
  const fs::path program = fs::read_symlink("/proc/self/exe");
  const fs::path installed = program.parent_path() / "../../share/livemap" / file;
  if (fs::exists(installed)) return installed.lexically_normal().string();
  return LIVEMAP_SOURCE_DIR "/" + file;
}

}  // namespace livemap::tools
