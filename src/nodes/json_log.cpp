#include "nodes/json_log.h"

#include <ros/console.h>

#include <array>
#include <cstddef>
#include <cstdio>

#include "common/clock.h"
#include "web/json/log_line.h"

namespace livemap::nodes {
namespace {

/// rosconsole calls a plain function: what it needs stands here. Empty: the log is text.
std::string& JsonLogNode() {
  static std::string node;
  return node;
}

const char* LevelName(ros::console::Level level) {
  constexpr std::array<const char*, 5> kNames{"debug", "info", "warning", "error", "fatal"};
  const auto number = static_cast<std::size_t>(level);
  return number < kNames.size() ? kNames[number] : "info";
}

/// The name of the file without its folders, which are those of whoever built it.
std::string FileName(const char* path) {
  const std::string text = path == nullptr ? "" : path;
  return text.substr(text.rfind('/') + 1);
}

void PrintJson(void* /*logger*/, ros::console::Level level, const char* text, const char* file,
               const char* /*function*/, int line) {
  const std::string printed =
      web::LogLine({SystemNs(), LevelName(level), text, JsonLogNode(), FileName(file), line}) +
      '\n';
  std::FILE* const stream = level >= ros::console::levels::Warn ? stderr : stdout;
  std::fwrite(printed.data(), 1, printed.size(), stream);
  std::fflush(stream);
}

}  // namespace

void LogAsJson(const std::string& node) {
  JsonLogNode() = node;
  // It sets the function that is set anew here.
  ROSCONSOLE_AUTOINIT;
  ros::console::backend::function_print = PrintJson;
}

void LogTheEnd(const std::string& node, const std::string& sentence) {
  if (JsonLogNode().empty()) {
    std::fprintf(stderr, "%s: %s\n", node.c_str(), sentence.c_str());
    return;
  }
  PrintJson(nullptr, ros::console::levels::Fatal, sentence.c_str(), nullptr, nullptr, 0);
}

}  // namespace livemap::nodes
