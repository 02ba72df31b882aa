#pragma once

#include <cstddef>
#include <string>

namespace livemap {

/// Text files as editors and spreadsheets of all systems write them, for every reader of text.

/// The text of `bytes` in UTF-8 with lines that end in "\n" or "\r\n". The byte order mark of UTF-8
/// is left out at the beginning of each line (files that were joined have several), and lines that
/// end in "\r" alone get "\n" instead. Throws Error naming `name`, the encoding that was found and
/// UTF-8 as what is accepted, for text in UTF-16 or UTF-32: by its byte order mark, or by zero
/// bytes, which no text in UTF-8 has.
std::string DecodeText(std::string bytes, const std::string& name);

/// ReadFile and DecodeText in one. Throws Error naming `path` as both do.
std::string ReadTextFile(const std::string& path, std::size_t max_bytes);

/// Writes `text` to `path`, or leaves what was there: to a file beside it (`path`.tmp), which is
/// brought to disk and then renamed, so that a kill or a power cut at any moment leaves the old
/// file or the new one. Throws Error naming `path` and what the system says.
void ReplaceTextFile(const std::string& path, const std::string& text);

}  // namespace livemap
