#include "imaging/video_orientation.h"

#include <array>
#include <cstddef>
#include <fstream>
#include <optional>
#include <string_view>

#include "imaging/file_bytes.h"
#include "imaging/orientation.h"

namespace livemap::imaging {
namespace {

constexpr std::uint64_t kMaxMovieBytes = 64U << 20U;
constexpr int kMaxTopBoxes = 10000;
constexpr std::int32_t kOne = 1 << 16;  // Fixed point, 16.16.

/// A box's content; `next` is where its successor begins.
struct MovieBox {
  std::string_view type;
  FileBytes content;
  std::size_t next;
};

/// The box at `at`; none where it is cut off or has no size of its own.
std::optional<MovieBox> BoxAt(const FileBytes& bytes, std::size_t at) {
  if (!bytes.Has(at, 8)) return std::nullopt;
  const std::size_t size = bytes.BigEndian(at, 4);
  if (size < 8 || !bytes.Has(at, size)) return std::nullopt;
  const auto type = [&](std::string_view name) { return bytes.Matches(at + 4, name); };
  for (const std::string_view name : {"trak", "tkhd", "mdia", "hdlr"}) {
    if (type(name)) return MovieBox{name, bytes.From(at + 8, size - 8), at + size};
  }
  return MovieBox{"", bytes.From(at + 8, size - 8), at + size};
}

/// The first box of that type.
std::optional<FileBytes> Find(const FileBytes& bytes, std::string_view type) {
  std::size_t at = 0;
  while (const std::optional<MovieBox> box = BoxAt(bytes, at)) {
    if (box->type == type) return box->content;
    at = box->next;
  }
  return std::nullopt;
}

bool IsVideo(const FileBytes& track) {
  const auto media = Find(track, "mdia");
  const auto handler = media ? Find(*media, "hdlr") : std::nullopt;
  return handler && handler->Matches(8, "vide");
}

/// Of a matrix {a, b, c, d}: a pixel (x, y) is shown at (a x + c y, b x + d y), moved.
int OrientationOfMatrix(const std::array<std::int32_t, 4>& m) {
  constexpr std::array<std::array<std::int32_t, 4>, 8> kMatrices = {{{1, 0, 0, 1},
                                                                     {-1, 0, 0, 1},
                                                                     {-1, 0, 0, -1},
                                                                     {1, 0, 0, -1},
                                                                     {0, 1, 1, 0},
                                                                     {0, 1, -1, 0},
                                                                     {0, -1, -1, 0},
                                                                     {0, -1, 1, 0}}};
  for (std::size_t i = 0; i < kMatrices.size(); ++i) {
    bool equal = true;
    for (std::size_t k = 0; k < 4; ++k) equal = equal && m[k] == kMatrices[i][k] * kOne;
    if (equal) return static_cast<int>(i) + 1;
  }
  return kUpright;
}

int OrientationOfHeader(const FileBytes& header) {
  // Version 1 has longer times.
  const std::size_t matrix = header.Has(0, 1) && header.BigEndian(0, 1) == 1 ? 52 : 40;
  if (!header.Has(matrix, 36)) return kUpright;
  const auto number = [&](std::size_t index) {
    return static_cast<std::int32_t>(header.BigEndian(matrix + 4 * index, 4));
  };
  // Rows of three: {a b u}, {c d v}, {x y w}.
  return OrientationOfMatrix({number(0), number(1), number(3), number(4)});
}

/// The content of the box "moov"; empty where there is none.
std::vector<std::uint8_t> ReadMovie(std::ifstream& file) {
  for (int i = 0; i < kMaxTopBoxes; ++i) {
    std::array<std::uint8_t, 16> head{};
    if (!file.read(reinterpret_cast<char*>(head.data()), 8)) return {};
    const FileBytes bytes(head.data(), head.size());
    std::uint64_t size = bytes.BigEndian(0, 4);
    std::uint64_t head_size = 8;
    if (size == 1) {  // A longer size follows.
      if (!file.read(reinterpret_cast<char*>(head.data()) + 8, 8)) return {};
      size = std::uint64_t{bytes.BigEndian(8, 4)} << 32U | bytes.BigEndian(12, 4);
      head_size = 16;
    }
    if (size < head_size) return {};
    const std::uint64_t content = size - head_size;
    if (bytes.Matches(4, "moov")) {
      if (content > kMaxMovieBytes) return {};
      std::vector<std::uint8_t> movie(static_cast<std::size_t>(content));
      file.read(reinterpret_cast<char*>(movie.data()), static_cast<std::streamsize>(content));
      movie.resize(static_cast<std::size_t>(file.gcount()));
      return movie;
    }
    if (content > static_cast<std::uint64_t>(INT64_MAX)) return {};
    if (!file.seekg(static_cast<std::streamoff>(content), std::ios::cur)) return {};
  }
  return {};
}

}  // namespace

int OrientationOfMovie(const std::vector<std::uint8_t>& moov) {
  const FileBytes bytes(moov.data(), moov.size());
  std::size_t at = 0;
  while (const std::optional<MovieBox> box = BoxAt(bytes, at)) {
    at = box->next;
    if (box->type != "trak" || !IsVideo(box->content)) continue;
    const auto header = Find(box->content, "tkhd");
    return header ? OrientationOfHeader(*header) : kUpright;
  }
  return kUpright;
}

int ReadVideoOrientation(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<std::uint8_t, 8> head{};
  if (!file.read(reinterpret_cast<char*>(head.data()), 8)) return kUpright;
  const FileBytes bytes(head.data(), head.size());
  // What a file of this family begins with; QuickTime's older ones lack "ftyp".
  bool known = false;
  for (const std::string_view type : {"ftyp", "moov", "mdat", "wide", "free", "skip"}) {
    known = known || bytes.Matches(4, type);
  }
  if (!known) return kUpright;
  file.seekg(0);
  return OrientationOfMovie(ReadMovie(file));
}

}  // namespace livemap::imaging
