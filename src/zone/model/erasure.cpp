#include "zone/model/erasure.h"

#include <cctype>
#include <string_view>
#include <utility>

#include "common/sha256.h"
#include "common/text.h"
#include "zone/model/presence_record.h"

namespace livemap::zone {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

/// Whether a name goes on with the character at `at`; a full stop that ends a sentence ends the
/// name, too.
bool IsOfName(std::string_view text, std::size_t at) {
  if (at >= text.size()) return false;
  const char c = text[at];
  if (c == '.')
    return at + 1 < text.size() && std::isalnum(static_cast<unsigned char>(text[at + 1]));
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_';
}

}  // namespace

Pseudonyms::Pseudonyms(std::string vehicle_id, std::string secret)
    : vehicle_id_(std::move(vehicle_id)),
      secret_(std::move(secret)),
      key_(VehicleKey(vehicle_id_)),
      key_digits_(std::to_string(key_)) {}

std::string Pseudonyms::IdFor(const std::string& about) const {
  return "forgotten-" + Sha256Hex(secret_ + " " + about).substr(0, 16);
}

std::uint64_t Pseudonyms::KeyFor(const std::string& about) const {
  return VehicleKey(IdFor(about));
}

bool Pseudonyms::ReplaceName(std::string& text, const std::string& about,
                             std::size_t max_bytes) const {
  bool is_found = false;
  const std::string pseudonym = IdFor(about);
  for (std::size_t at = text.find(vehicle_id_); at != std::string::npos;
       at = text.find(vehicle_id_, at)) {
    const bool stands_alone =
        (at == 0 || !IsOfName(text, at - 1)) && !IsOfName(text, at + vehicle_id_.size());
    if (!stands_alone) {
      ++at;
      continue;
    }
    text.replace(at, vehicle_id_.size(), pseudonym);
    at += pseudonym.size();
    is_found = true;
  }
  if (is_found) text = CutUtf8(std::move(text), max_bytes);
  return is_found;
}

bool Pseudonyms::ReplaceKey(std::string& line, const std::string& about) const {
  bool is_found = false;
  for (std::size_t at = line.find(key_digits_); at != std::string::npos;
       at = line.find(key_digits_, at)) {
    const std::size_t end = at + key_digits_.size();
    if ((at > 0 && IsDigit(line[at - 1])) || (end < line.size() && IsDigit(line[end]))) {
      ++at;
      continue;
    }
    const std::string replacement = std::to_string(KeyFor(about));
    line.replace(at, key_digits_.size(), replacement);
    at += replacement.size();
    is_found = true;
  }
  return is_found;
}

}  // namespace livemap::zone
