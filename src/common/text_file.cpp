#include "common/text_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <utility>

#include "common/error.h"

namespace livemap {
namespace {

constexpr std::string_view kUtf8Mark("\xef\xbb\xbf");

/// The longer marks first: UTF-32's begins as UTF-16's.
constexpr std::array<std::pair<std::string_view, const char*>, 4> kForeignMarks = {
    {{std::string_view("\xff\xfe\0\0", 4), "UTF-32"},
     {std::string_view("\0\0\xfe\xff", 4), "UTF-32"},
     {std::string_view("\xff\xfe"), "UTF-16"},
     {std::string_view("\xfe\xff"), "UTF-16"}}};

[[noreturn]] void Refuse(const std::string& name, const std::string& found) {
  throw Error("'" + name + "' " + found + ", accepted is text in UTF-8 or ASCII");
}

void RefuseForeign(std::string_view bytes, const std::string& name) {
  for (const auto& [mark, encoding] : kForeignMarks) {
    if (bytes.substr(0, mark.size()) == mark) {
      Refuse(name, std::string("begins with the byte order mark of ") + encoding);
    }
  }
  const std::size_t zero = bytes.find('\0');
  if (zero != std::string_view::npos) {
    Refuse(name, "has a zero byte at offset " + std::to_string(zero) +
                     " as text in UTF-16 and files that are no text have");
  }
}

/// Without the marks at the beginning of lines; in place, in one pass.
void RemoveMarks(std::string& text) {
  if (text.find(kUtf8Mark) == std::string::npos) return;
  std::size_t written = 0;
  bool at_line_start = true;
  for (std::size_t read = 0; read < text.size();) {
    if (at_line_start && text.compare(read, kUtf8Mark.size(), kUtf8Mark) == 0) {
      read += kUtf8Mark.size();
      continue;
    }
    at_line_start = text[read] == '\n';
    text[written++] = text[read++];
  }
  text.resize(written);
}

/// 0, or the number of what went wrong.
int WriteToDisk(const std::string& path, const std::string& text) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return errno;
  int error = 0;
  std::size_t written = 0;
  while (error == 0 && written < text.size()) {
    const ssize_t count = write(file, text.data() + written, text.size() - written);
    if (count < 0 && errno != EINTR) error = errno;
    if (count > 0) written += static_cast<std::size_t>(count);
  }
  if (error == 0 && fsync(file) != 0) error = errno;
  if (close(file) != 0 && error == 0) error = errno;
  return error;
}

}  // namespace

std::string DecodeText(std::string bytes, const std::string& name) {
  RefuseForeign(bytes, name);
  if (bytes.find('\n') == std::string::npos) std::replace(bytes.begin(), bytes.end(), '\r', '\n');
  RemoveMarks(bytes);
  return bytes;
}

std::string ReadTextFile(const std::string& path, std::size_t max_bytes) {
  return DecodeText(ReadFile(path, max_bytes), path);
}

void ReplaceTextFile(const std::string& path, const std::string& text) {
  const std::string unfinished = path + ".tmp";
  int error = WriteToDisk(unfinished, text);
  if (error == 0 && std::rename(unfinished.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    unlink(unfinished.c_str());
    throw Error("'" + path + "' cannot be written: " + std::strerror(error));
  }
  // The name, too. Where a folder cannot be opened, the file is there after all.
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const int directory = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory < 0) return;
  fsync(directory);
  close(directory);
}

}  // namespace livemap
