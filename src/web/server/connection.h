#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>

#include "protocol/hazard_catalogue.h"
#include "web/api/event_hub.h"
#include "web/http/client_name.h"
#include "web/http/site.h"
#include "web/http/web_config.h"
#include "web/server/connection_table.h"
#include "web/server/tls_certificate.h"
#include "web/server/work_queue.h"

namespace livemap::web {

/// What the live stream tells.
struct LiveSource {
  zone::MapReader& zone;
  const protocol::HazardCatalogue& catalogue;
  EventHub& hub;
};

/// What all connections share; outlives them.
struct WebContext {
  const WebConfig& options;
  Site& site;
  const LiveSource* live;  ///< None: the site has no live stream.
  ConnectionTable& table;
  /// Makes answers, so that the threads that read and write sockets never wait for the store.
  WorkQueue& work;
  const TrustedProxies& proxies;
  const TlsCertificate* certificate = nullptr;  ///< None: plain HTTP is spoken.
  int https_port = 0;                           ///< Where HTTPS is spoken; 0: nowhere.
  std::atomic<std::uint64_t> failed_handshakes{0};
  std::atomic<std::size_t> held_bytes{0};  ///< Of the answers that are being written.
};

/// One open connection's place in the table for as long as it lives; it moves from the HTTP to the
/// WebSocket session.
class ConnectionSlot {
 public:
  ConnectionSlot(WebContext& context, ConnectionTable::Id id) : context_(&context), id_(id) {}
  ~ConnectionSlot() {
    if (context_ != nullptr) context_->table.Remove(id_);
  }
  ConnectionSlot(ConnectionSlot&& other) noexcept : context_(other.context_), id_(other.id_) {
    other.context_ = nullptr;
  }
  ConnectionSlot& operator=(ConnectionSlot&&) = delete;

  /// False once it has moved on to another session.
  bool is_held() const { return context_ != nullptr; }
  WebContext& context() const { return *context_; }
  ConnectionTable::Id id() const { return id_; }

 private:
  WebContext* context_;
  ConnectionTable::Id id_;
};

}  // namespace livemap::web
