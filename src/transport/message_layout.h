#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "transport/byte_view.h"

namespace livemap::transport {

/// How long a string and how many elements a variable array of an untrusted message may have.
struct LayoutLimits {
  std::size_t max_string_bytes = 1024;
  std::size_t max_array_elements = 1024;
  /// Other limits for single fields by their dotted path ("image.data", "detections.class_name"):
  /// bytes for a string, elements for an array.
  std::map<std::string, std::size_t> fields;
};

/// The shape of one ROS message type, from the text of its definition, and a check that serialised
/// bytes have that shape. ROS's deserialiser resizes strings and arrays to whatever length the
/// bytes announce before it looks whether they are there, so untrusted bytes must pass this check
/// first: afterwards deserialising neither throws nor allocates more than the limits allow.
///
/// The check is structural. Whether numbers make sense (NaN, ranges) is for the receiver.
class MessageLayout {
 public:
  /// `type` is "package/Name"; `definition` is what ros::message_traits::Definition gives: the .msg
  /// text, followed by the texts of all types that it uses under lines of "=" and "MSG:
  /// package/Name". Throws Error for a definition that cannot be read, lacks a type, nests too
  /// deeply or recurses, and for a limit on a field that the type does not have.
  MessageLayout(const std::string& type, const std::string& definition,
                const LayoutLimits& limits = {});

  /// Nothing when `payload` is one whole message within the limits, else the sentence that names
  /// the field and what is wrong. Reads `payload` once and allocates only for the sentence.
  std::optional<std::string> Check(ByteView payload) const;

 private:
  friend class LayoutBuilder;

  enum class Repeat : std::uint8_t { kOnce, kFixed, kVariable };

  /// One field, or one string as an element. Compounds point to their run of children.
  struct Field {
    std::string path;  ///< Dotted, for the messages and limits.
    Repeat repeat = Repeat::kOnce;
    std::size_t fixed_count = 1;        ///< Elements of a fixed array.
    std::size_t max_count = 0;          ///< Elements of a variable array at most.
    std::size_t element_bytes = 0;      ///< Size of one element, when every element has the same.
    std::size_t min_element_bytes = 0;  ///< What one element takes at least.
    bool is_string = false;
    std::size_t max_string_bytes = 0;
    std::vector<std::size_t> children;  ///< Indices into fields_ when it is a compound.
  };
  class Walker;

  std::vector<Field> fields_;
  std::vector<std::size_t> roots_;
};

}  // namespace livemap::transport
