#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace livemap::fuzz {

/// The fuzzer's input, taken bit by bit; zeros when it is used up.
class FuzzBytes {
 public:
  FuzzBytes(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}

  bool empty() const { return at_ == end_; }
  std::uint8_t Byte() { return empty() ? std::uint8_t{0} : *at_++; }
  std::size_t Below(std::size_t limit) { return Byte() % limit; }
  /// As long as the next byte says, at most `most`.
  std::string Text(std::size_t most = 255) {
    const std::size_t wanted = std::min<std::size_t>(Byte(), most);
    const std::size_t size = std::min(wanted, static_cast<std::size_t>(end_ - at_));
    std::string text(at_, at_ + size);
    at_ += size;
    return text;
  }
  template <typename Number>
  Number Any() {
    std::uint8_t bytes[sizeof(Number)];
    for (std::uint8_t& byte : bytes) byte = Byte();
    Number number;
    std::memcpy(&number, bytes, sizeof number);
    return number;
  }
  /// What has not been taken.
  std::vector<std::uint8_t> Rest() const { return {at_, end_}; }

 private:
  const std::uint8_t* at_;
  const std::uint8_t* end_;
};

}  // namespace livemap::fuzz
