#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace livemap::transport {

/// One field of a .msg text; constants are left out, they do not travel.
struct DefinedField {
  std::string type;  ///< A primitive, "string", or a full "package/Name".
  std::string name;
  bool is_array = false;
  std::optional<std::size_t> fixed_count;  ///< Of "type[n]"; empty for "type[]".
};

/// A ROS message definition with all the types that it uses, by full name.
struct MessageDefinition {
  std::string root;
  std::map<std::string, std::vector<DefinedField>> types;
};

/// Serialised size of a primitive type in bytes ("float64": 8, "time": 8); nullopt for strings and
/// compound types.
std::optional<std::size_t> PrimitiveBytes(const std::string& type);

/// Reads the text that ros::message_traits::Definition gives for `type` ("package/Name"). Throws
/// Error naming the line that cannot be read.
MessageDefinition ParseMessageDefinition(const std::string& type, const std::string& definition);

}  // namespace livemap::transport
