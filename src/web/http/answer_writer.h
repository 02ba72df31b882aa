#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "web/http/gzip_stream.h"
#include "web/http/http_message.h"

namespace livemap::web {

/// How one client takes an answer.
struct AnswerForm {
  bool keep_alive = true;
  bool head_only = false;  ///< The request was HEAD: no content.
  bool chunked = true;     ///< False for HTTP/1.0, where the connection's end is the content's end.
  bool gzip = false;       ///< The client takes it.
};

/// Turns an answer into the bytes of an HTTP/1.1 response (RFC 9112), part by part, so that at most
/// one part of about kPieceBytes is held however long the answer is. An answer whose first piece is
/// not the last goes chunked. Text of 1 kB and more is compressed where the client takes it.
///
/// Typical usage:
///   AnswerWriter writer(std::move(answer), form);
///   while (writer.Next(part)) Send(part);  // A part may be empty.
class AnswerWriter {
 public:
  AnswerWriter(HttpResponse answer, const AnswerForm& form);

  /// Replaces `part` by the next bytes, or by none while a piece is not full; false when there are
  /// no more. Looks for content once: it is short whatever the answer is. Throws what the answer's
  /// pieces throw: then the response cannot be finished.
  bool Next(std::string& part);
  /// All bytes were made: Next would say false.
  bool IsDone() const { return is_started_ && is_last_; }
  /// Whether the connection may serve another request afterwards.
  bool keep_alive() const { return keep_alive_; }
  /// Memory that it may hold at once, bytes: its content as far as it is made, and one part.
  /// Content that others hold counts, too: they may let go of it, as the pictures' cache does.
  std::size_t HeldBytes() const;

 private:
  /// Makes more of the next piece; false while it is not full.
  bool Gather();
  /// The header and the first piece.
  std::string Begin();
  /// The piece as it goes onto the wire.
  std::string Encode(std::string piece, bool is_last);

  HttpResponse answer_;
  const AnswerForm form_;
  bool keep_alive_;
  bool is_chunked_ = false;
  bool is_started_ = false;
  bool is_last_ = false;
  std::string gathered_;        ///< The next piece, as far as it is made.
  std::size_t sent_bytes_ = 0;  ///< Of content that is there as a whole.
  std::unique_ptr<GzipStream> gzip_;
};

}  // namespace livemap::web
