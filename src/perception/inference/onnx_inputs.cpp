#include "perception/inference/onnx_inputs.h"

#include "common/error.h"

namespace livemap::perception {
namespace {

/// One field of a Protocol Buffers message: https://protobuf.dev/programming-guides/encoding/
struct Field {
  std::uint64_t number = 0;
  std::uint64_t varint = 0;  // of a field that holds a number
  std::string_view bytes;    // of a field that holds a message or a text
};

/// Walks over the fields of one message.
class OnnxInputMessage {
 public:
  explicit OnnxInputMessage(std::string_view bytes) : rest_(bytes) {}

  /// False at the end.
  bool Next(Field& field) {
    if (rest_.empty()) return false;
    const std::uint64_t key = Varint();
    field = {key >> 3U, 0, {}};
    switch (key & 7U) {
      case 0:
        field.varint = Varint();
        break;
      case 1:
        Take(8);
        break;
      case 2:
        field.bytes = Take(Varint());
        break;
      case 5:
        Take(4);
        break;
      default:
        Refuse();
    }
    return true;
  }

 private:
  [[noreturn]] static void Refuse() {
    throw Error("the file is cut off or damaged, accepted is an ONNX model");
  }

  std::string_view Take(std::uint64_t size) {
    if (size > rest_.size()) Refuse();
    const std::string_view taken = rest_.substr(0, static_cast<std::size_t>(size));
    rest_.remove_prefix(taken.size());
    return taken;
  }

  std::uint64_t Varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      const auto byte = static_cast<std::uint8_t>(Take(1)[0]);
      value |= static_cast<std::uint64_t>(byte & 0x7FU) << shift;
      if ((byte & 0x80U) == 0) return value;
    }
    Refuse();
  }

  std::string_view rest_;
};

/// Calls `visit(field)` for each field `number` of `message`.
template <typename Visit>
void ForEachOnnxField(std::string_view message, std::uint64_t number, Visit visit) {
  OnnxInputMessage fields(message);
  Field field;
  while (fields.Next(field)) {
    if (field.number == number) visit(field);
  }
}

OnnxInput ReadOnnxInput(std::string_view value_info) {
  OnnxInput input;
  ForEachOnnxField(value_info, 1, [&](const Field& name) { input.name = std::string(name.bytes); });
  ForEachOnnxField(value_info, 2, [&](const Field& type) {
    ForEachOnnxField(type.bytes, 1, [&](const Field& tensor) {
      ForEachOnnxField(tensor.bytes, 2, [&](const Field& shape) {
        ForEachOnnxField(shape.bytes, 1, [&](const Field& dimension) {
          input.shape.push_back(-1);
          ForEachOnnxField(dimension.bytes, 1, [&](const Field& value) {
            input.shape.back() = static_cast<std::int64_t>(value.varint);
          });
        });
      });
    });
  });
  return input;
}

}  // namespace

std::vector<OnnxInput> ReadOnnxInputs(std::string_view model) {
  std::vector<OnnxInput> inputs;
  ForEachOnnxField(model, 7, [&](const Field& graph) {
    ForEachOnnxField(graph.bytes, 11,
                     [&](const Field& input) { inputs.push_back(ReadOnnxInput(input.bytes)); });
  });
  return inputs;
}

}  // namespace livemap::perception
