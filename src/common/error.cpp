#include "common/error.h"

#include <filesystem>
#include <fstream>
#include <system_error>

namespace livemap {

Error::Error(const std::string& sentence) : std::runtime_error(sentence) {}

std::string ReadFile(const std::string& path, std::size_t max_bytes) {
  std::error_code unknown;
  if (std::filesystem::is_directory(path, unknown)) {
    throw Error("'" + path + "' is a folder, accepted is a file");
  }
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = file ? static_cast<std::streamoff>(file.tellg()) : -1;
  if (size < 0) throw Error("cannot read file '" + path + "'");
  if (static_cast<std::uintmax_t>(size) > max_bytes) {
    throw Error("file '" + path + "' has " + std::to_string(size) + " bytes, at most " +
                std::to_string(max_bytes) + " are accepted");
  }
  std::string bytes(static_cast<std::size_t>(size), '\0');
  file.seekg(0);
  if (!file.read(bytes.data(), size)) throw Error("cannot read file '" + path + "' to its end");
  return bytes;
}

}  // namespace livemap
