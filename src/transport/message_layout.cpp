#include "transport/message_layout.h"

#include <algorithm>
#include <set>

#include "common/error.h"
#include "transport/message_definition.h"

namespace livemap::transport {
namespace {

constexpr std::size_t kMaxDepth = 16;
constexpr std::size_t kLengthBytes = 4;

}  // namespace

/// Flattens the types of a definition into the fields of one layout.
class LayoutBuilder {
 public:
  LayoutBuilder(const MessageDefinition& definition, const LayoutLimits& limits,
                MessageLayout& layout)
      : definition_(definition), limits_(limits), layout_(layout) {}

  void Build() {
    layout_.roots_ = AddType(definition_.root, "", 0);
    for (const auto& limit : limits_.fields) {
      if (used_limits_.count(limit.first) == 0) {
        throw Error("a limit is set for field '" + limit.first + "' of '" + definition_.root +
                    "', which is no string or variable array of it");
      }
    }
  }

 private:
  using Field = MessageLayout::Field;
  using Repeat = MessageLayout::Repeat;

  std::vector<std::size_t> AddType(const std::string& type, const std::string& prefix,
                                   std::size_t depth) {
    if (depth > kMaxDepth) {
      throw Error("message type '" + definition_.root + "' nests deeper than " +
                  std::to_string(kMaxDepth) + " levels at '" + prefix + "'");
    }
    const auto found = definition_.types.find(type);
    if (found == definition_.types.end()) {
      throw Error("the definition of '" + definition_.root + "' lacks the type '" + type + "'");
    }
    std::vector<std::size_t> indices;
    for (const DefinedField& defined : found->second) {
      const std::string path = prefix.empty() ? defined.name : prefix + "." + defined.name;
      indices.push_back(AddField(defined, path, depth));
    }
    return indices;
  }

  std::size_t AddField(const DefinedField& defined, const std::string& path, std::size_t depth) {
    Field field;
    field.path = path;
    if (defined.is_array) {
      field.repeat = defined.fixed_count ? Repeat::kFixed : Repeat::kVariable;
      field.fixed_count = defined.fixed_count.value_or(0);
      field.max_count = Limit(path, limits_.max_array_elements, !defined.fixed_count);
    }
    const std::optional<std::size_t> primitive = PrimitiveBytes(defined.type);
    if (defined.type == "string") {
      field.is_string = true;
      field.min_element_bytes = kLengthBytes;
      // The limit of an array of strings is its elements; the strings keep the general one.
      field.max_string_bytes = Limit(path, limits_.max_string_bytes, !defined.is_array);
    } else if (primitive) {
      field.element_bytes = *primitive;
      field.min_element_bytes = *primitive;
    } else {
      field.children = AddType(defined.type, path, depth + 1);
      SumChildren(field);
    }
    layout_.fields_.push_back(std::move(field));
    return layout_.fields_.size() - 1;
  }

  /// A compound whose children all have one size has one size itself.
  void SumChildren(Field& field) const {
    bool fixed = !field.children.empty();
    for (const std::size_t index : field.children) {
      const Field& child = layout_.fields_[index];
      const bool variable = child.repeat == Repeat::kVariable;
      fixed = fixed && !variable && child.element_bytes > 0;
      field.element_bytes += child.fixed_count * child.element_bytes;
      field.min_element_bytes +=
          variable ? kLengthBytes : child.fixed_count * child.min_element_bytes;
    }
    if (!fixed) field.element_bytes = 0;
  }

  std::size_t Limit(const std::string& path, std::size_t general, bool applies) {
    const auto found = limits_.fields.find(path);
    if (!applies || found == limits_.fields.end()) return general;
    used_limits_.insert(path);
    return found->second;
  }

  const MessageDefinition& definition_;
  const LayoutLimits& limits_;
  MessageLayout& layout_;
  std::set<std::string> used_limits_;
};

/// One pass over one payload.
class MessageLayout::Walker {
 public:
  Walker(const std::vector<Field>& fields, ByteView payload)
      : fields_(fields), next_(payload.data), remaining_(payload.size) {}

  bool Walk(const std::vector<std::size_t>& indices) {
    return std::all_of(indices.begin(), indices.end(),
                       [this](std::size_t index) { return WalkField(fields_[index]); });
  }

  bool AtEnd() {
    if (remaining_ == 0) return true;
    fault_ = std::to_string(remaining_) + " bytes follow the end of the message";
    return false;
  }

  const std::string& fault() const { return fault_; }

 private:
  bool WalkField(const Field& field) {
    std::size_t count = field.fixed_count;
    if (field.repeat == Repeat::kVariable) {
      if (!ReadLength(field, count)) return false;
      if (count > field.max_count) return TooMany(field, count, field.max_count, "elements");
    }
    // By division: the product of two hostile numbers could wrap.
    if (field.min_element_bytes > 0 && count > remaining_ / field.min_element_bytes) {
      return CutOff(field);
    }
    if (field.element_bytes > 0) {
      Skip(count * field.element_bytes);
      return true;
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (!(field.is_string ? WalkString(field) : Walk(field.children))) return false;
    }
    return true;
  }

  bool WalkString(const Field& field) {
    std::size_t length = 0;
    if (!ReadLength(field, length)) return false;
    if (length > field.max_string_bytes) {
      return TooMany(field, length, field.max_string_bytes, "bytes");
    }
    if (length > remaining_) return CutOff(field);
    Skip(length);
    return true;
  }

  bool ReadLength(const Field& field, std::size_t& length) {
    if (remaining_ < kLengthBytes) return CutOff(field);
    length = static_cast<std::size_t>(next_[0]) | static_cast<std::size_t>(next_[1]) << 8 |
             static_cast<std::size_t>(next_[2]) << 16 | static_cast<std::size_t>(next_[3]) << 24;
    Skip(kLengthBytes);
    return true;
  }

  void Skip(std::size_t bytes) {
    next_ += bytes;
    remaining_ -= bytes;
  }

  bool CutOff(const Field& field) {
    fault_ = "the message is cut off in field '" + field.path + "'";
    return false;
  }

  bool TooMany(const Field& field, std::size_t found, std::size_t accepted,
               const std::string& unit) {
    fault_ = "field '" + field.path + "' has " + std::to_string(found) + " " + unit + ", at most " +
             std::to_string(accepted) + " are accepted";
    return false;
  }

  const std::vector<Field>& fields_;
  const std::uint8_t* next_;
  std::size_t remaining_;
  std::string fault_;
};

MessageLayout::MessageLayout(const std::string& type, const std::string& definition,
                             const LayoutLimits& limits) {
  const MessageDefinition parsed = ParseMessageDefinition(type, definition);
  LayoutBuilder(parsed, limits, *this).Build();
}

std::optional<std::string> MessageLayout::Check(ByteView payload) const {
  Walker walker(fields_, payload);
  if (walker.Walk(roots_) && walker.AtEnd()) return std::nullopt;
  return walker.fault();
}

}  // namespace livemap::transport
