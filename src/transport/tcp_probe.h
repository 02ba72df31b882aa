#pragma once

#include <string>

namespace livemap::transport {

/// What a probe found: the numeric address that accepted a connection, or why there is none.
struct TcpProbeResult {
  std::string numeric_address;  ///< Empty when none answered.
  std::string error;            ///< One sentence, empty when one answered.
};

/// Opens and closes a TCP connection to `host`:`port` without ever blocking longer than
/// `timeout_s` per address, and gives up at once when `cancel_fd` becomes readable. The resolver of
/// the C library alone can take longer, by its own timeout.
TcpProbeResult ProbeTcp(const std::string& host, int port, double timeout_s, int cancel_fd);

}  // namespace livemap::transport
