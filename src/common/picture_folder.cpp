#include "common/picture_folder.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <system_error>

#include "common/error.h"

namespace livemap {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 5> kRead = {".jpg", ".jpeg", ".jpe", ".jfif", ".png"};
/// Pictures for people, and therefore not to be passed over in silence.
constexpr std::array<std::string_view, 15> kNotRead = {".bmp",  ".tif", ".tiff", ".webp", ".gif",
                                                       ".pgm",  ".ppm", ".pnm",  ".heic", ".heif",
                                                       ".avif", ".jp2", ".exr",  ".hdr",  ".jxl"};

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

template <typename Extensions>
bool IsOneOf(const std::string& extension, const Extensions& extensions) {
  return std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
}

/// The end of the run of digits that begins at `begin`.
std::size_t EndOfDigits(std::string_view name, std::size_t begin) {
  while (begin < name.size() && IsDigit(name[begin])) ++begin;
  return begin;
}

/// The digits from `begin` to `end` without leading zeros; empty for zero.
std::string_view Significant(std::string_view name, std::size_t begin, std::size_t end) {
  while (begin < end && name[begin] == '0') ++begin;
  return name.substr(begin, end - begin);
}

[[noreturn]] void RefuseTwins(const std::string& first, const std::string& second,
                              const std::string& what) {
  throw Error("'" + first + "' and '" + second + "' have one " + what +
              ", accepted is one picture of each");
}

}  // namespace

bool NaturalLess(std::string_view a, std::string_view b) {
  std::size_t i = 0;
  std::size_t k = 0;
  while (i < a.size() && k < b.size()) {
    if (!IsDigit(a[i]) || !IsDigit(b[k])) {
      if (a[i] != b[k]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[k]);
      ++i;
      ++k;
      continue;
    }
    const std::size_t end = EndOfDigits(a, i);
    const std::size_t other_end = EndOfDigits(b, k);
    const std::string_view number = Significant(a, i, end);
    const std::string_view other = Significant(b, k, other_end);
    if (number.size() != other.size()) return number.size() < other.size();
    if (number != other) return number < other;
    i = end;
    k = other_end;
  }
  const std::size_t left = a.size() - i;
  const std::size_t other_left = b.size() - k;
  if (left == 0 && other_left == 0) return a < b;
  return left < other_left;
}

std::string WithoutLeadingZeros(std::string_view name) {
  std::string plain;
  for (std::size_t i = 0; i < name.size();) {
    if (!IsDigit(name[i])) {
      plain.push_back(name[i++]);
      continue;
    }
    const std::size_t end = EndOfDigits(name, i);
    const std::string_view digits = Significant(name, i, end);
    plain += digits.empty() ? std::string_view("0") : digits;
    i = end;
  }
  return plain;
}

std::optional<std::uint64_t> NumberOf(std::string_view name) {
  std::size_t end = name.size();
  while (end > 0 && !IsDigit(name[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && IsDigit(name[begin - 1])) --begin;
  if (begin == end || end - begin > 18) return std::nullopt;
  std::uint64_t number = 0;
  for (std::size_t i = begin; i < end; ++i) {
    number = 10 * number + static_cast<std::uint64_t>(name[i] - '0');
  }
  return number;
}

std::string StemOf(const std::string& path) { return fs::path(path).stem().string(); }

std::string LowerExtension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return extension;
}

bool HasPictureExtension(const std::string& path) { return IsOneOf(LowerExtension(path), kRead); }

PictureFolder::PictureFolder(const std::string& directory, PictureNames names)
    : directory_(directory) {
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string path = entry->path().string();
    const std::string extension = LowerExtension(path);
    // A hidden file is another program's: macOS writes "._0001.png" beside each picture.
    if (entry->path().filename().string().front() == '.') continue;
    const bool read = IsOneOf(extension, kRead);
    if (!read && !IsOneOf(extension, kNotRead)) continue;
    std::error_code unknown;
    if (entry->is_directory(unknown)) continue;
    if (!entry->exists(unknown)) throw Error("'" + path + "' is a link that leads nowhere");
    if (!entry->is_regular_file(unknown)) continue;
    if (!read) {
      throw Error("the picture '" + path + "' would be passed over, accepted are JPEG and PNG");
    }
    paths_.push_back(path);
  }
  if (error) throw Error("the folder '" + directory + "' cannot be read: " + error.message());
  std::sort(paths_.begin(), paths_.end(),
            [](const std::string& a, const std::string& b) { return NaturalLess(a, b); });
  for (const std::string& path : paths_) {
    const std::string stem = StemOf(path);
    const auto [twin, is_new] = by_stem_.emplace(stem, path);
    if (!is_new) RefuseTwins(twin->second, path, "name");
    const std::string number = WithoutLeadingZeros(stem);
    const auto same = by_number_.find(number);
    if (names == PictureNames::kNumbered && same != by_number_.end()) {
      RefuseTwins(same->second, path, "number");
    }
    by_number_.emplace(number, path);
  }
}

std::optional<std::string> PictureFolder::Find(const std::string& stem) const {
  const auto exact = by_stem_.find(stem);
  if (exact != by_stem_.end()) return exact->second;
  const auto [first, end] = by_number_.equal_range(WithoutLeadingZeros(stem));
  if (first == end) return std::nullopt;
  if (std::next(first) != end) RefuseTwins(first->second, std::next(first)->second, "number");
  return first->second;
}

}  // namespace livemap
