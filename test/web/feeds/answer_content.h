#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include "web/http/http_message.h"

namespace livemap::web {

/// An answer's content as a client gets it.
struct AnswerContent {
  std::string text;
  std::size_t pieces = 0;
  std::size_t longest_piece = 0;  ///< Bytes.
};

/// Makes the pieces of an answer one by one.
inline AnswerContent ContentOf(const HttpResponse& answer) {
  AnswerContent content{answer.content};
  for (bool has_more = static_cast<bool>(answer.pieces); has_more; ++content.pieces) {
    std::string piece;
    has_more = answer.pieces(piece);
    content.longest_piece = std::max(content.longest_piece, piece.size());
    content.text += piece;
  }
  return content;
}

}  // namespace livemap::web
