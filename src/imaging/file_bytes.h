#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace livemap::imaging {

/// A file's bytes that can only be read within their bounds. Refers to the bytes, does not own
/// them.
class FileBytes {
 public:
  FileBytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::size_t size() const { return size_; }
  /// Whether `count` bytes from `offset` on are there.
  bool Has(std::size_t offset, std::size_t count) const {
    return offset <= size_ && count <= size_ - offset;
  }
  /// Whether `text` stands at `offset`.
  bool Matches(std::size_t offset, std::string_view text) const {
    return Has(offset, text.size()) && std::memcmp(data_ + offset, text.data(), text.size()) == 0;
  }
  /// `count` bytes, at most 4, which must be there.
  std::uint32_t BigEndian(std::size_t offset, std::size_t count) const {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value = value << 8 | data_[offset + i];
    return value;
  }
  /// The same with the lowest byte first.
  std::uint32_t LittleEndian(std::size_t offset, std::size_t count) const {
    std::uint32_t value = 0;
    for (std::size_t i = count; i-- > 0;) value = value << 8 | data_[offset + i];
    return value;
  }
  /// The bytes from `offset` on, `count` of them or as many as there are.
  FileBytes From(std::size_t offset, std::size_t count) const {
    if (offset > size_) return {data_, 0};
    return {data_ + offset, count < size_ - offset ? count : size_ - offset};
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

}  // namespace livemap::imaging
