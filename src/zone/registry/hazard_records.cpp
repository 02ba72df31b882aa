#include "zone/registry/hazard_records.h"

#include <algorithm>

#include "common/number_text.h"

namespace livemap::zone {
namespace {

constexpr std::array<const char*, 3> kFormats{"jpeg", "png", "webp"};

}  // namespace

PackedPicture::PackedPicture(const std::string& sha256, const std::string& format) {
  const auto known = std::find(kFormats.begin(), kFormats.end(), format);
  if (known == kFormats.end() || sha256.size() != 64) return;
  std::array<std::uint8_t, 32> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const int high = HexValue(sha256[2 * i]);
    const int low = HexValue(sha256[2 * i + 1]);
    if (high < 0 || low < 0) return;
    bytes[i] = static_cast<std::uint8_t>(16 * high + low);
  }
  sha256_ = bytes;
  format_ = static_cast<std::uint8_t>(1 + (known - kFormats.begin()));
}

std::string PackedPicture::Sha256() const {
  std::string text;
  if (empty()) return text;
  text.reserve(64);
  for (const std::uint8_t byte : sha256_) AppendHex(text, byte);
  return text;
}

std::string PackedPicture::Format() const { return empty() ? "" : kFormats[format_ - 1U]; }

}  // namespace livemap::zone
