#include "common/text_file.h"

#include <algorithm>
#include <array>
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

}  // namespace livemap
