#pragma once

#include <cstddef>
#include <string>

namespace livemap {

/// The text itself, or its beginning where it has more than `max_bytes`. UTF-8 is cut where a
/// character begins.
inline std::string CutUtf8(std::string text, std::size_t max_bytes) {
  if (text.size() <= max_bytes) return text;
  std::size_t size = max_bytes;
  while (size > 0 && (static_cast<unsigned char>(text[size]) & 0xC0U) == 0x80U) --size;
  text.resize(size);
  return text;
}

/// What an image's pixels are, in words: "8 bits, three channels".
inline std::string PixelText(int bits, int channels) {
  const char* const words[] = {"no channel", "one channel", "two channels", "three channels",
                               "four channels"};
  return std::to_string(bits) + " bits, " +
         (channels >= 0 && channels <= 4 ? words[channels]
                                         : std::to_string(channels) + " channels");
}

}  // namespace livemap
