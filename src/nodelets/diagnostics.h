#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>

#include <cstdint>
#include <functional>
#include <string>

namespace livemap::nodelets {

/// A nodelet's line on /diagnostics, published once a period. The period is steady time, unlike
/// that of the updater's own timer: a replay that stands still does not silence the nodelet. The
/// line is described in the queue of `node`. After the destructor nothing describes any more.
///
/// Typical usage: the last step of a nodelet's start makes a std::unique_ptr<Diagnostics>, and the
/// first step of its destructor resets it.
class Diagnostics {
 public:
  using Status = diagnostic_updater::DiagnosticStatusWrapper;
  /// Fills in the level, the summary and the values of the line.
  using Describe = std::function<void(Status& status)>;

  struct Config {
    std::string nodelet_name;
    std::string hardware_id;
    std::string line;     ///< Its name on /diagnostics, after the nodelet's.
    double period_s = 1;  ///< s
  };

  Diagnostics(const ros::NodeHandle& node, const ros::NodeHandle& private_node,
              const Config& config, Describe describe);
  ~Diagnostics();
  Diagnostics(const Diagnostics&) = delete;
  Diagnostics& operator=(const Diagnostics&) = delete;

 private:
  diagnostic_updater::Updater updater_;
  ros::SteadyTimer timer_;
};

/// Tells of a counter that never falls whether it has risen since the line before. Not thread-safe.
class CounterWatch {
 public:
  /// Whether `count` is above that of the last call; above 0 at the first.
  bool HasRisen(std::uint64_t count) {
    const bool risen = count > last_;
    last_ = count;
    return risen;
  }

 private:
  std::uint64_t last_ = 0;
};

}  // namespace livemap::nodelets
