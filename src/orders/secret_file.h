#pragma once

#include <string>

namespace livemap::orders {

/// The first line of a file that holds a password or key: 1 to 512 printable ASCII characters
/// without blanks. Throws Error that names the file, and never what it says, for anything else and
/// for a file that others than its owner and group may read or write.
std::string ReadSecretFile(const std::string& path);

/// The text with "***" wherever it holds the secret: a server may repeat what it was sent.
std::string WithoutSecret(std::string text, const std::string& secret);

}  // namespace livemap::orders
