#pragma once

#include <cstddef>
#include <string>

namespace livemap::perception {

/// What a gzip file (RFC 1952) holds; bytes that do not begin as one are given back as they are.
/// Large models are shipped packed. Throws Error naming `file` when it is damaged, is followed by
/// something else, or holds more than `most` bytes; no more than that is ever allocated for it.
std::string Unpacked(std::string bytes, const std::string& file, std::size_t most);

}  // namespace livemap::perception
