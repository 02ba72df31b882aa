#pragma once

#include <cstdint>
#include <memory>

#include "web/http/web_config.h"

namespace livemap::web {

/// The web server of a process that waits to become the active one of its zone, at the address of
/// the live map. It says that it is alive (/healthz) and not ready (/readyz, status 503), and has
/// the metrics of the lease; all else is answered 503, so that a proxy asks the other server.
/// Nobody is told which one that is.
///
/// Typical usage:
///   StandbyServer server(options);
///   server.Tell(7);
class StandbyServer {
 public:
  /// Listens and serves from its own threads when it returns. Throws Error when an option is not
  /// accepted or the port cannot be opened.
  explicit StandbyServer(const WebConfig& options);
  /// Closes every connection and joins the threads.
  ~StandbyServer();
  StandbyServer(const StandbyServer&) = delete;
  StandbyServer& operator=(const StandbyServer&) = delete;

  /// The lease's epoch, as the metrics have it from now on; 0: not known. Any thread may.
  void Tell(std::uint64_t epoch);
  /// The port it listens on, also where the options asked for any.
  int port() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace livemap::web
