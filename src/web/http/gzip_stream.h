#pragma once

#include <zlib.h>

#include <string>
#include <string_view>

namespace livemap::web {

/// Compresses one answer, piece by piece, in gzip's format (RFC 1952), fast rather than small: a
/// stream holds about 70 kB.
class GzipStream {
 public:
  /// Throws Error when there is no memory.
  GzipStream();
  ~GzipStream();
  GzipStream(const GzipStream&) = delete;
  GzipStream& operator=(const GzipStream&) = delete;

  /// The compressed bytes that are ready after `piece`; they may be none before the last piece.
  std::string Compress(std::string_view piece, bool is_last);

 private:
  z_stream stream_{};
};

/// Whether a client with this Accept-Encoding header takes gzip (RFC 9110 section 12.5.3): it names
/// gzip or x-gzip, or "*", and does not give it the weight 0.
bool AcceptsGzip(std::string_view accept_encoding);

}  // namespace livemap::web
