#include "tools/bags/bag_writer.h"

#include <unistd.h>

#include <filesystem>
#include <system_error>

#include "common/error.h"

namespace livemap::tools {

BagWriter::BagWriter(const std::string& path, Compression compression)
    : path_(path), unfinished_path_(path + ".unfinished-" + std::to_string(getpid())) {
  if (std::filesystem::is_directory(path)) {
    throw Error("the bag '" + path + "' cannot be written: it is a folder");
  }
  try {
    bag_.open(unfinished_path_, rosbag::bagmode::Write);
  } catch (const rosbag::BagException& exception) {
    throw Error("the bag '" + path + "' cannot be written: " + exception.what());
  }
  bag_.setCompression(compression == Compression::kLz4 ? rosbag::compression::LZ4
                                                       : rosbag::compression::Uncompressed);
}

BagWriter::~BagWriter() {
  if (finished_) return;
  try {
    bag_.close();
  } catch (const rosbag::BagException&) {
    // Nothing to save: the file goes anyway.
  }
  std::error_code ignored;
  std::filesystem::remove(unfinished_path_, ignored);
}

void BagWriter::Finish() {
  try {
    bag_.close();
    std::filesystem::rename(unfinished_path_, path_);
  } catch (const std::exception& exception) {
    throw Error("the bag '" + path_ + "' cannot be written: " + exception.what());
  }
  finished_ = true;
}

}  // namespace livemap::tools
