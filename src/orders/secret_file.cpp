#include "orders/secret_file.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "common/error.h"
#include "common/text_file.h"

namespace livemap::orders {
namespace {

constexpr std::size_t kMaxSecretFileBytes = 4096;
constexpr std::size_t kMaxSecretBytes = 512;

bool IsSecretCharacter(char c) { return c > ' ' && c < '\x7f'; }

}  // namespace

std::string ReadSecretFile(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) {
    throw Error("secret file '" + path + "' cannot be read: " + std::strerror(errno));
  }
  if (!S_ISREG(status.st_mode)) throw Error("secret file '" + path + "' is no regular file");
  if ((status.st_mode & (S_IROTH | S_IWOTH)) != 0) {
    throw Error("secret file '" + path +
                "' may be read or written by everybody, accepted is mode 0600 or 0640");
  }
  std::string secret = ReadTextFile(path, kMaxSecretFileBytes);
  secret.resize(std::min(secret.find_first_of("\r\n"), secret.size()));
  if (secret.empty() || secret.size() > kMaxSecretBytes ||
      !std::all_of(secret.begin(), secret.end(), IsSecretCharacter)) {
    throw Error("the first line of secret file '" + path + "' is not accepted, accepted are 1 to " +
                std::to_string(kMaxSecretBytes) + " printable characters of ASCII without blanks");
  }
  return secret;
}

std::string WithoutSecret(std::string text, const std::string& secret) {
  if (secret.empty()) return text;
  for (std::size_t at = text.find(secret); at != std::string::npos; at = text.find(secret, at)) {
    text.replace(at, secret.size(), "***");
    at += 3;
  }
  return text;
}

}  // namespace livemap::orders
