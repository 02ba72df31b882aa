#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

namespace livemap::receiver {

/// How far this computer's clock is from the receiver's, of when reports come. A report comes some
/// time after its measurement: receiver, serial line and a busy computer hold it back, and nothing
/// brings it forward. The least of the last few differences is therefore the best that is known.
/// Not thread-safe.
class ReceiverClock {
 public:
  /// So many reports are remembered.
  static constexpr std::size_t kReports = 8;

  /// A report of `stamp_ns` came when the system's clock showed `system_ns`, and a clock that
  /// nobody sets `steady_ns`. When the system's clock was set since the last report, all before is
  /// forgotten.
  void Add(std::int64_t stamp_ns, std::int64_t system_ns, std::int64_t steady_ns);
  /// System's clock minus the receiver's, s; nothing before the first report.
  std::optional<double> offset_s() const;
  /// What was learnt no longer counts: another receiver.
  void Reset() { differences_ns_.clear(); }

 private:
  std::deque<std::int64_t> differences_ns_;
  std::int64_t system_minus_steady_ns_ = 0;
};

}  // namespace livemap::receiver
