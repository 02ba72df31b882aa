#include "common/sha256.h"

#include <openssl/sha.h>

#include "common/number_text.h"

namespace livemap {

std::string Sha256Hex(const void* data, std::size_t size) {
  unsigned char digest[SHA256_DIGEST_LENGTH];
  SHA256(static_cast<const unsigned char*>(data), size, digest);
  std::string hex;
  hex.reserve(2 * sizeof(digest));
  for (const unsigned char byte : digest) AppendHex(hex, byte);
  return hex;
}

}  // namespace livemap
