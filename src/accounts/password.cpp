#include "accounts/password.h"

#include <argon2.h>
#include <openssl/rand.h>

#include <array>
#include <vector>

#include "common/error.h"
#include "protocol/text_rules.h"

namespace livemap::accounts {
namespace {

constexpr std::uint32_t kPasses = 3;
constexpr std::uint32_t kMemoryKib = 64 << 10;
constexpr std::uint32_t kLanes = 4;
constexpr std::size_t kSaltBytes = 16;
constexpr std::size_t kHashBytes = 32;
/// A hash of the store may not ask for more memory than ours do: it would be a bomb.
constexpr char kPrefix[] = "$argon2id$v=19$m=65536,t=3,p=4$";

void FillWithRandom(void* bytes, std::size_t size) {
  if (RAND_bytes(static_cast<unsigned char*>(bytes), static_cast<int>(size)) != 1) {
    throw Error("the system has no random bytes");
  }
}

}  // namespace

bool IsAcceptablePassword(const std::string& password) {
  return password.size() >= kMinPasswordBytes &&
         protocol::IsPrintableText(password, kMaxPasswordBytes);
}

std::string HashPassword(const std::string& password) {
  std::array<std::uint8_t, kSaltBytes> salt{};
  FillWithRandom(salt.data(), salt.size());
  std::vector<char> encoded(
      argon2_encodedlen(kPasses, kMemoryKib, kLanes, kSaltBytes, kHashBytes, Argon2_id));
  const int failure =
      argon2id_hash_encoded(kPasses, kMemoryKib, kLanes, password.data(), password.size(),
                            salt.data(), salt.size(), kHashBytes, encoded.data(), encoded.size());
  if (failure != ARGON2_OK) {
    throw Error(std::string("the password cannot be hashed: ") + argon2_error_message(failure));
  }
  return encoded.data();
}

bool IsPasswordOf(const std::string& password, const std::string& hash) {
  if (hash.compare(0, sizeof(kPrefix) - 1, kPrefix) != 0) return false;
  return argon2id_verify(hash.c_str(), password.data(), password.size()) == ARGON2_OK;
}

std::string RandomHex(std::size_t bytes) {
  std::vector<unsigned char> random(bytes);
  FillWithRandom(random.data(), random.size());
  std::string text;
  for (const unsigned char byte : random) {
    constexpr char kDigits[] = "0123456789abcdef";
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

}  // namespace livemap::accounts
