#pragma once

#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>

namespace livemap {

/// Appends a number to a line of numbers with one space between; exact, in no locale.
template <typename Number>
void AppendNumber(std::string& line, Number number) {
  char digits[32];
  const auto end = std::to_chars(std::begin(digits), std::end(digits), number).ptr;
  if (!line.empty()) line.push_back(' ');
  line.append(digits, end);
}

/// Reads what AppendNumber wrote; once something is wrong it stays so. `line` must outlive it.
class NumberReader {
 public:
  explicit NumberReader(std::string_view line) : rest_(line) {}

  template <typename Number>
  void Read(Number& number) {
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), number);
    if (error != std::errc()) return Fail();
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    if (rest_.empty()) return;
    if (rest_.front() != ' ' || rest_.size() == 1) return Fail();
    rest_.remove_prefix(1);
  }

  bool good() const { return good_; }
  bool done() const { return rest_.empty(); }

 private:
  void Fail() {
    good_ = false;
    rest_ = {};
  }

  std::string_view rest_;
  bool good_ = true;
};

/// The value of a hexadecimal digit of either case; -1 for any other character.
constexpr int HexValue(char digit) {
  if (digit >= '0' && digit <= '9') return digit - '0';
  if (digit >= 'a' && digit <= 'f') return digit - 'a' + 10;
  if (digit >= 'A' && digit <= 'F') return digit - 'A' + 10;
  return -1;
}

/// Appends the byte as two lower-case hexadecimal digits.
inline void AppendHex(std::string& text, std::uint8_t byte) {
  constexpr char kDigits[] = "0123456789abcdef";
  text += kDigits[byte >> 4];
  text += kDigits[byte & 15];
}

}  // namespace livemap
