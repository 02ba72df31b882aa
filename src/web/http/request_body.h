#pragma once

#include <string>

#include "web/http/http_message.h"

namespace livemap::web {

/// "application/json", with or without parameters. A page of another origin cannot send it without
/// asking first, which this server never allows.
inline bool IsJsonType(const std::string& content_type) {
  const std::string type = content_type.substr(0, content_type.find(';'));
  return type == "application/json" || type == "application/json ";
}

/// Status 415, for a body of another type.
inline HttpResponse WrongBodyType() {
  return MakeErrorAnswer(415, "the body's type is not accepted, accepted is application/json");
}

}  // namespace livemap::web
