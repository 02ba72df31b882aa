#pragma once

#include <mosquitto.h>
#include <openssl/ssl.h>

#include <memory>
#include <string>

#include "transport/mqtt_client.h"

namespace livemap::transport {

struct MosquittoDeleter {
  void operator()(mosquitto* handle) const { mosquitto_destroy(handle); }
};
using MosquittoHandle = std::unique_ptr<mosquitto, MosquittoDeleter>;

/// Throws Error naming the first option that is out of range.
void CheckMqttOptions(const MqttConfig& options);

/// "cannot read FILE, the bridge's key_file: No such file or directory" for the first TLS file that
/// cannot be read now, or a sentence about the first one that is torn; empty when all are whole.
/// The library's own words do not name the file.
std::string UnreadableTlsFile(const MqttTlsConfig& tls);

/// A library handle that speaks MQTT v5 with the login of `options` and hands `user_data` to its
/// callbacks. With TLS its connections are made from `tls_context`. Throws Error when the library
/// refuses an option.
MosquittoHandle MakeMosquittoHandle(const MqttConfig& options, SSL_CTX* tls_context,
                                    void* user_data);

/// One blocking connection attempt to the broker, at an address that was just seen to answer; 0 or
/// a library code.
int ConnectMosquitto(mosquitto* handle, const MqttConfig& options, const MqttAddress& broker,
                     const std::string& numeric_address);

/// The library's result code in words without a full stop, with the system's own error where that
/// is the cause.
std::string DescribeMosquittoError(int code);

/// OpenSSL's words in a line that the library logs, e.g. "sslv3 alert certificate revoked"; empty
/// when the line is about something else.
std::string TlsErrorIn(const std::string& log_line);

/// "Not authorized (MQTT reason 135)".
std::string DescribeReason(int reason_code);

}  // namespace livemap::transport
