#include "transport/mosquitto_handle.h"

#include <mqtt_protocol.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <system_error>

#include "common/error.h"

namespace livemap::transport {
namespace {

constexpr int kMinKeepaliveS = 5;  // libmosquitto refuses less.
constexpr int kMaxKeepaliveS = 65535;
constexpr int kMaxInflight = 65535;

void RequireMqttOption(bool holds, const std::string& name, const std::string& value,
                       const std::string& accepted) {
  if (!holds) throw Error("MQTT " + name + " is '" + value + "', accepted is " + accepted);
}

void RequireMosquittoSuccess(int code, const std::string& what) {
  if (code != MOSQ_ERR_SUCCESS) throw Error(what + ": " + DescribeMosquittoError(code));
}

void InitializeMosquittoOnce() {
  static std::once_flag once;
  std::call_once(once, [] { mosquitto_lib_init(); });
}

void CheckMosquittoTlsOptions(const MqttTlsConfig& tls) {
  for (const auto& [name, path] : {std::pair{"ca_file", tls.ca_file},
                                   {"certificate_file", tls.certificate_file},
                                   {"key_file", tls.key_file}}) {
    std::error_code ignored;
    RequireMqttOption(
        std::filesystem::is_regular_file(path, ignored) && access(path.c_str(), R_OK) == 0, name,
        path, "a PEM file that can be read");
  }
}

/// Whether a file begins no PEM block or does not end it, as after a power loss in mid-copy.
bool IsTornPem(const std::string& path) {
  constexpr std::size_t kMostBytes = 1 << 20;  // No certificate or key is as long.
  std::string content(kMostBytes, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(content.data(), static_cast<std::streamsize>(content.size()));
  content.resize(static_cast<std::size_t>(file.gcount()));
  const std::size_t begin = content.find("-----BEGIN ");
  return begin == std::string::npos || content.find("-----END ", begin) == std::string::npos;
}

void CheckMosquittoAddress(const MqttAddress& address, bool has_tls) {
  RequireMqttOption(!address.host.empty(), "host", address.host, "a host name or an address");
  RequireMqttOption(address.port > 0 && address.port <= 65535, "port", std::to_string(address.port),
                    "1 to 65535");
  if (address.fingerprint.empty()) return;
  const std::string name =
      "fingerprint of the broker " + address.host + ":" + std::to_string(address.port);
  // Without TLS no certificate is shown that it could be compared with.
  RequireMqttOption(has_tls, name, address.fingerprint,
                    "none where ca_file, certificate_file and key_file are not set");
  constexpr std::size_t kHexDigits = 64;
  RequireMqttOption(
      address.fingerprint.size() == kHexDigits &&
          address.fingerprint.find_first_not_of("0123456789abcdef") == std::string::npos,
      name, address.fingerprint, "64 hex digits in lower case (SHA-256)");
}

}  // namespace

void CheckMqttOptions(const MqttConfig& options) {
  CheckMosquittoAddress({options.host, options.port, options.fingerprint}, options.tls.has_value());
  RequireMqttOption(!options.client_id.empty(), "client id", options.client_id, "a text");
  RequireMqttOption(options.keepalive_s >= kMinKeepaliveS && options.keepalive_s <= kMaxKeepaliveS,
                    "keepalive_s", std::to_string(options.keepalive_s), "5 to 65535");
  RequireMqttOption(options.connect_timeout_s > 0 && options.connect_timeout_s <= 3600,
                    "connect_timeout_s", std::to_string(options.connect_timeout_s),
                    "above 0 and at most 3600");
  RequireMqttOption(options.max_inflight > 0 && options.max_inflight <= kMaxInflight,
                    "max_inflight", std::to_string(options.max_inflight), "1 to 65535");
  RequireMqttOption(options.max_packet_bytes > 0, "max_packet_bytes",
                    std::to_string(options.max_packet_bytes), "above 0");
  for (const MqttAddress& fallback : options.fallbacks) {
    CheckMosquittoAddress(fallback, options.tls.has_value());
  }
  if (options.tls) CheckMosquittoTlsOptions(*options.tls);
}

MosquittoHandle MakeMosquittoHandle(const MqttConfig& options, SSL_CTX* tls_context,
                                    void* user_data) {
  InitializeMosquittoOnce();
  MosquittoHandle handle(mosquitto_new(options.client_id.c_str(), options.clean_start, user_data));
  if (!handle) throw Error("cannot create an MQTT client with id '" + options.client_id + "'");
  RequireMosquittoSuccess(
      mosquitto_int_option(handle.get(), MOSQ_OPT_PROTOCOL_VERSION, MQTT_PROTOCOL_V5),
      "cannot choose MQTT v5");
  RequireMosquittoSuccess(
      mosquitto_int_option(handle.get(), MOSQ_OPT_SEND_MAXIMUM, options.max_inflight),
      "cannot set the number of messages in flight");
  RequireMosquittoSuccess(mosquitto_int_option(handle.get(), MOSQ_OPT_TCP_NODELAY, 1),
                          "cannot set TCP_NODELAY");
  if (!options.user.empty()) {
    RequireMosquittoSuccess(
        mosquitto_username_pw_set(handle.get(), options.user.c_str(), options.password.c_str()),
        "cannot set MQTT user '" + options.user + "'");
  }
  if (options.tls) {
    RequireMosquittoSuccess(mosquitto_void_option(handle.get(), MOSQ_OPT_SSL_CTX, tls_context),
                            "cannot set the context of TLS");
    // Else the library would put its own check of the certificate into the context.
    RequireMosquittoSuccess(mosquitto_int_option(handle.get(), MOSQ_OPT_SSL_CTX_WITH_DEFAULTS, 0),
                            "cannot keep the context of TLS as it is");
  }
  return handle;
}

int ConnectMosquitto(mosquitto* handle, const MqttConfig& options, const MqttAddress& broker,
                     const std::string& numeric_address) {
  // The certificate is checked against the name that was asked for, so TLS resolves it again.
  const std::string& host = options.tls ? broker.host : numeric_address;
  mosquitto_property* properties = nullptr;
  int code = mosquitto_property_add_int32(&properties, MQTT_PROP_SESSION_EXPIRY_INTERVAL,
                                          options.session_expiry_s);
  if (code == MOSQ_ERR_SUCCESS) {
    code = mosquitto_property_add_int32(&properties, MQTT_PROP_MAXIMUM_PACKET_SIZE,
                                        options.max_packet_bytes);
  }
  if (code == MOSQ_ERR_SUCCESS) {
    code = mosquitto_connect_bind_v5(handle, host.c_str(), broker.port, options.keepalive_s,
                                     nullptr, properties);
  }
  const int system_error = errno;  // Explains MOSQ_ERR_ERRNO.
  mosquitto_property_free_all(&properties);
  errno = system_error;
  return code;
}

std::string DescribeMosquittoError(int code) {
  if (code == MOSQ_ERR_ERRNO) return std::generic_category().message(errno);
  std::string words = mosquitto_strerror(code);
  if (!words.empty() && words.back() == '.') words.pop_back();
  return words;
}

std::string UnreadableTlsFile(const MqttTlsConfig& tls) {
  for (const auto& [name, path] : {std::pair{"ca_file", tls.ca_file},
                                   {"certificate_file", tls.certificate_file},
                                   {"key_file", tls.key_file}}) {
    if (access(path.c_str(), R_OK) != 0) {
      return "cannot read " + path + ", the bridge's " + name + ": " +
             std::generic_category().message(errno);
    }
    if (IsTornPem(path)) {
      return path + ", the bridge's " + name +
             ", is torn or no PEM file: copy it from the zone again (livemap zone enroll made it)";
    }
  }
  return "";
}

std::string TlsErrorIn(const std::string& log_line) {
  if (log_line.rfind("OpenSSL Error", 0) != 0) return "";
  return log_line.substr(log_line.rfind(':') + 1);
}

std::string DescribeReason(int reason_code) {
  return std::string(mosquitto_reason_string(reason_code)) + " (MQTT reason " +
         std::to_string(reason_code) + ")";
}

}  // namespace livemap::transport
