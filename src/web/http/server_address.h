#pragma once

#include <string>

#include "web/http/http_message.h"
#include "web/http/web_config.h"

namespace livemap::web {

/// The server's address as whoever asks reaches it, without a last '/': the option `public_url`,
/// else "http://" and the request's Host. A Host that is none becomes "localhost", because it is
/// a stranger's text.
std::string ServerAddress(const WebConfig& options, const HttpRequest& question);

}  // namespace livemap::web
