#pragma once

#include <string>

#include "web/http/http_message.h"
#include "web/http/web_config.h"

namespace livemap::web {

/// The server's address as whoever asks reaches it, without a last '/': the option `public_url`,
/// else the request's Host, by https where the server has a certificate, else by http. A Host that
/// is none becomes "localhost", because it is a stranger's text.
std::string ServerAddress(const WebConfig& options, const HttpRequest& question);

/// The address by HTTPS of what was asked for by plain HTTP with this Host: the option `public_url`
/// where it is by https, else the host with the port at which the server speaks HTTPS. Empty where
/// the Host is none.
std::string HttpsAddress(const WebConfig& options, const std::string& host, int https_port);

}  // namespace livemap::web
