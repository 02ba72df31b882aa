#pragma once

#include <atomic>
#include <cstddef>
#include <memory>

#include "protocol/hazard_catalogue.h"
#include "web/api/api.h"
#include "web/api/event_hub.h"
#include "web/http/web_config.h"

namespace livemap::web {

/// What all connections share; outlives them.
struct WebContext {
  const WebConfig& options;
  zone::ZoneService& zone;
  const protocol::HazardCatalogue& catalogue;
  Api& api;
  EventHub& hub;
  std::atomic<std::size_t> connections{0};
};

/// Counts one open connection for as long as it lives; it moves from the HTTP to the WebSocket
/// session.
class ConnectionSlot {
 public:
  explicit ConnectionSlot(WebContext& context) : context_(&context) { ++context.connections; }
  ~ConnectionSlot() {
    if (context_ != nullptr) --context_->connections;
  }
  ConnectionSlot(ConnectionSlot&& other) noexcept : context_(other.context_) {
    other.context_ = nullptr;
  }
  ConnectionSlot& operator=(ConnectionSlot&&) = delete;

  WebContext& context() const { return *context_; }

 private:
  WebContext* context_;
};

}  // namespace livemap::web
