#include "web/http/gzip_stream.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>

#include "common/error.h"

namespace livemap::web {
namespace {

constexpr int kLevel = 1;
/// A window of 8 KiB and as much memory as goes with it; 16 asks for gzip's header.
constexpr int kWindowBits = 13 + 16;
constexpr int kMemoryLevel = 6;

std::string_view Trimmed(std::string_view text) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

bool EqualsIgnoringCase(std::string_view text, std::string_view lower_case) {
  return std::equal(text.begin(), text.end(), lower_case.begin(), lower_case.end(),
                    [](char a, char b) {
                      return static_cast<char>(std::tolower(static_cast<unsigned char>(a))) == b;
                    });
}

/// Whether the parameters of a coding, ";q=0.5", give it a weight above 0.
bool HasWeight(std::string_view parameters) {
  const std::size_t equals = parameters.find('=');
  if (equals == std::string_view::npos) return true;
  const std::string_view weight = Trimmed(parameters.substr(equals + 1));
  return weight.find_first_of("123456789") != std::string_view::npos;
}

}  // namespace

GzipStream::GzipStream() {
  if (deflateInit2(&stream_, kLevel, Z_DEFLATED, kWindowBits, kMemoryLevel, Z_DEFAULT_STRATEGY) !=
      Z_OK) {
    throw Error("no memory to compress an answer");
  }
}

GzipStream::~GzipStream() { deflateEnd(&stream_); }

std::string GzipStream::Compress(std::string_view piece, bool is_last) {
  std::string compressed;
  std::array<char, 16 << 10> buffer;
  stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(piece.data()));
  stream_.avail_in = static_cast<uInt>(piece.size());
  do {
    stream_.next_out = reinterpret_cast<Bytef*>(buffer.data());
    stream_.avail_out = static_cast<uInt>(buffer.size());
    deflate(&stream_, is_last ? Z_FINISH : Z_NO_FLUSH);
    compressed.append(buffer.data(), buffer.size() - stream_.avail_out);
  } while (stream_.avail_out == 0);
  return compressed;
}

bool AcceptsGzip(std::string_view accept_encoding) {
  std::optional<bool> named;
  bool any = false;
  for (;;) {
    const std::size_t comma = accept_encoding.find(',');
    const std::string_view entry = accept_encoding.substr(0, comma);
    const std::size_t semicolon = entry.find(';');
    const std::string_view coding = Trimmed(entry.substr(0, semicolon));
    const bool wanted =
        semicolon == std::string_view::npos || HasWeight(entry.substr(semicolon + 1));
    if (EqualsIgnoringCase(coding, "gzip") || EqualsIgnoringCase(coding, "x-gzip")) named = wanted;
    if (coding == "*") any = wanted;
    if (comma == std::string_view::npos) return named.value_or(any);
    accept_encoding.remove_prefix(comma + 1);
  }
}

}  // namespace livemap::web
