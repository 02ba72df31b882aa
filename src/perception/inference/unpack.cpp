#include "perception/inference/unpack.h"

#include <zlib.h>

#include <algorithm>
#include <utility>

#include "common/error.h"

namespace livemap::perception {
namespace {

constexpr int kGzipOnly = 15 + 16;  // inflateInit2: the largest window, and gzip's header.
constexpr std::size_t kStepBytes = std::size_t{1} << 20;

bool IsGzipToUnpack(const std::string& bytes) {
  return bytes.size() >= 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b';
}

class UnpackInflater {
 public:
  explicit UnpackInflater(std::string& bytes) {
    stream_.next_in = reinterpret_cast<Bytef*>(bytes.data());
    stream_.avail_in = static_cast<uInt>(bytes.size());
    if (inflateInit2(&stream_, kGzipOnly) != Z_OK) throw Error("zlib cannot begin");
  }
  ~UnpackInflater() { inflateEnd(&stream_); }
  UnpackInflater(const UnpackInflater&) = delete;
  UnpackInflater& operator=(const UnpackInflater&) = delete;

  /// Appends at most `most` bytes; zlib's answer.
  int Append(std::size_t most, std::string& unpacked) {
    const std::size_t before = unpacked.size();
    unpacked.resize(before + most);
    stream_.next_out = reinterpret_cast<Bytef*>(&unpacked[before]);
    stream_.avail_out = static_cast<uInt>(most);
    const int answer = inflate(&stream_, Z_NO_FLUSH);
    unpacked.resize(unpacked.size() - stream_.avail_out);
    return answer;
  }
  bool at_end_of_input() const { return stream_.avail_in == 0; }

 private:
  z_stream stream_{};
};

}  // namespace

std::string Unpacked(std::string bytes, const std::string& file, std::size_t most) {
  if (!IsGzipToUnpack(bytes)) return bytes;
  UnpackInflater inflater(bytes);
  std::string unpacked;
  int answer = Z_OK;
  while (answer == Z_OK && unpacked.size() <= most) {
    answer = inflater.Append(std::min(kStepBytes, most + 1 - unpacked.size()), unpacked);
  }
  if (unpacked.size() > most) {
    throw Error("packed file '" + file + "' holds more than the " + std::to_string(most) +
                " bytes that are accepted");
  }
  if (answer != Z_STREAM_END || !inflater.at_end_of_input()) {
    throw Error("packed file '" + file + "' is damaged or cut off");
  }
  return unpacked;
}

}  // namespace livemap::perception
