// What readers of folders and texts share: names of pictures in natural order and their numbers,
// the lines that belong to them, and text as other systems write it. The first byte chooses; names
// are separated by newlines.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <set>
#include <string>
#include <vector>

#include "common/error.h"
#include "common/picture_folder.h"
#include "common/text_file.h"
#include "datasets/sequences.h"
#include "datasets/text_parsing.h"

namespace livemap::fuzz {
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

/// Every two names have an order, which does not depend on where it begins.
void CheckOrder(std::vector<std::string> names) {
  if (names.size() > 24) names.resize(24);
  for (const std::string& a : names) {
    Require(!NaturalLess(a, a));
    const std::string plain = WithoutLeadingZeros(a);
    Require(WithoutLeadingZeros(plain) == plain);
    Require(plain.size() <= a.size());
    NumberOf(a);
    HasPictureExtension(a);
    for (const std::string& b : names) {
      Require(a == b || NaturalLess(a, b) != NaturalLess(b, a));
      for (const std::string& c : names) {
        if (NaturalLess(a, b) && NaturalLess(b, c)) Require(NaturalLess(a, c));
      }
    }
  }
}

/// What lines say belongs to a picture is in the files, each line at most once.
void CheckLines(std::vector<std::string> names, std::size_t lines) {
  if (names.empty()) return;
  std::sort(names.begin(), names.end(),
            [](const std::string& a, const std::string& b) { return NaturalLess(a, b); });
  const std::vector<std::size_t> found = datasets::LinesOfPictures(names, {{"poses", lines}});
  Require(found.size() == names.size());
  Require(std::is_sorted(found.begin(), found.end()));
  Require(found.back() < lines);
  Require(std::set<std::size_t>(found.begin(), found.end()).size() == found.size());
  Require(datasets::LinesOfPictures(names, {}).size() == names.size());
}

void CheckText(const std::string& bytes) {
  const std::string text = DecodeText(bytes, "input");
  Require(text.size() <= bytes.size());
  Require(text.find('\0') == std::string::npos);
  for (const std::string& line : datasets::Lines(text)) {
    Require(line.compare(0, 3, "\xef\xbb\xbf") != 0);
    datasets::SeparatorHint(line);
    datasets::StampHint(line);
  }
}

void FuzzOne(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return;
  const std::string rest(reinterpret_cast<const char*>(data) + 2, size - 2);
  try {
    switch (data[0] % 3) {
      case 0:
        CheckOrder(datasets::Split(rest, '\n'));
        break;
      case 1:
        CheckLines(datasets::Split(rest, '\n'), data[1]);
        break;
      default:
        CheckText(rest);
    }
  } catch (const Error& error) {
    Require(error.what()[0] != '\0');
  }
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzOne(data, size);
  return 0;
}
