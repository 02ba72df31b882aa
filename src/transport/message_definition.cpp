#include "transport/message_definition.h"

#include <algorithm>
#include <sstream>

#include "common/error.h"

namespace livemap::transport {
namespace {

// Far above any real message; bounds what a broken definition can make us compute.
constexpr std::size_t kMaxFixedCount = 1 << 20;

const std::map<std::string, std::size_t>& PrimitiveMessageTypes() {
  static const std::map<std::string, std::size_t> kBytes = {
      {"bool", 1},  {"char", 1},   {"byte", 1},    {"int8", 1},   {"uint8", 1},
      {"int16", 2}, {"uint16", 2}, {"int32", 4},   {"uint32", 4}, {"float32", 4},
      {"int64", 8}, {"uint64", 8}, {"float64", 8}, {"time", 8},   {"duration", 8}};
  return kBytes;
}

[[noreturn]] void RefuseDefinitionLine(const std::string& root, const std::string& line) {
  throw Error("the definition of message '" + root + "' has the line '" + line +
              "', which is no field");
}

/// "3" or "" between the brackets of an array.
std::optional<std::size_t> ParseArrayCount(const std::string& digits) {
  if (digits.empty() || digits.size() > 7 ||
      !std::all_of(digits.begin(), digits.end(), [](char c) { return c >= '0' && c <= '9'; })) {
    return std::nullopt;
  }
  const std::size_t count = std::stoul(digits);
  return count <= kMaxFixedCount ? std::optional<std::size_t>(count) : std::nullopt;
}

/// "Detection" within "livemap/..." is "livemap/Detection"; "Header" is always std_msgs'.
std::string FullMessageName(const std::string& type, const std::string& package) {
  if (type == "string" || PrimitiveBytes(type) || type.find('/') != std::string::npos) return type;
  if (type == "Header") return "std_msgs/Header";
  return package + "/" + type;
}

/// Nothing for blank lines, comments and constants.
std::optional<DefinedField> ParseDefinitionLine(const std::string& root, const std::string& line,
                                                const std::string& package) {
  std::istringstream words(line.substr(0, line.find('#')));
  std::string type;
  DefinedField field;
  if (!(words >> type)) return std::nullopt;
  if (!(words >> field.name)) RefuseDefinitionLine(root, line);
  std::string rest;
  std::getline(words, rest);
  // "uint8 ADDED=0", "uint8 ADDED = 0".
  if (field.name.find('=') != std::string::npos || rest.find('=') != std::string::npos) {
    return std::nullopt;
  }
  if (rest.find_first_not_of(" \t\r") != std::string::npos) RefuseDefinitionLine(root, line);
  const std::size_t bracket = type.find('[');
  if (bracket != std::string::npos) {
    if (type.back() != ']') RefuseDefinitionLine(root, line);
    field.is_array = true;
    const std::string digits = type.substr(bracket + 1, type.size() - bracket - 2);
    field.fixed_count = ParseArrayCount(digits);
    if (!digits.empty() && !field.fixed_count) RefuseDefinitionLine(root, line);
  }
  field.type = FullMessageName(type.substr(0, bracket), package);
  return field;
}

}  // namespace

std::optional<std::size_t> PrimitiveBytes(const std::string& type) {
  const auto found = PrimitiveMessageTypes().find(type);
  return found == PrimitiveMessageTypes().end() ? std::nullopt
                                                : std::optional<std::size_t>(found->second);
}

MessageDefinition ParseMessageDefinition(const std::string& type, const std::string& definition) {
  MessageDefinition parsed;
  parsed.root = type;
  std::string current = type;
  parsed.types[current] = {};
  std::istringstream lines(definition);
  std::string line;
  while (std::getline(lines, line)) {
    if (line.rfind("====", 0) == 0) continue;
    if (line.rfind("MSG: ", 0) == 0) {
      current = line.substr(5);
      current.erase(current.find_last_not_of(" \t\r") + 1);
      parsed.types[current] = {};
      continue;
    }
    const std::string package = current.substr(0, current.find('/'));
    if (const auto field = ParseDefinitionLine(type, line, package))
      parsed.types[current].push_back(*field);
  }
  return parsed;
}

}  // namespace livemap::transport
