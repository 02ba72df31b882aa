#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "common/histogram.h"
#include "orders/desk/order_desk.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// What the server itself counts.
struct ServerMetrics {
  std::size_t connections = 0;
  std::uint64_t connections_ended = 0;
  std::uint64_t connections_refused = 0;
  std::uint64_t held_bytes = 0;
  std::uint64_t failed_handshakes = 0;
  std::optional<std::int64_t> certificate_ends_ns;  ///< None: plain HTTP is spoken.
  DurationHistogram::Counts answers;  ///< Time from a request to its answer, without pictures.
};

/// Whether a process is the active one of its zone, where another one waits to take over.
struct LeaseMetrics {
  bool is_active = false;
  std::uint64_t epoch = 0;  ///< Of the lease as this process knows it.
  double age_s = 0;         ///< Since the process took or renewed it; 0: it is another's.
};

/// The metrics of a standby: those of the lease alone, as a zone with a lease has them, too.
std::string StandbyMetricsText(const LeaseMetrics& lease);

/// All metrics of the zone, with those of its work orders where it has some (`orders` is not null)
/// (docs/reference/metrics.md), in the text format of Prometheus. No metric names a vehicle or a
/// place.
std::string ZoneMetricsText(const zone::ZoneService& zone, const ServerMetrics& server,
                            const orders::OrderDesk* orders = nullptr);

}  // namespace livemap::web
