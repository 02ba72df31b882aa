#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/stamp_gate.h"
#include "receiver/receiver_clock.h"
#include "receiver/receiver_fix.h"

namespace livemap::receiver {

/// What is wrong with the receiver, if anything, from the outside to the inside: who has no gpsd
/// cannot know whether there is a receiver.
enum class ReceiverState {
  kNoGpsd,      ///< No gpsd answers.
  kNoReceiver,  ///< gpsd has no receiver, or not the one that is asked for, or cannot open it.
  kSilent,      ///< Nothing that gpsd understands comes from the receiver.
  kNoFix,       ///< The receiver does not know where it is.
  kClockWrong,  ///< Its time and this computer's are too far apart.
  kFix          ///< All is well.
};

/// "no gpsd", "no receiver", "receiver silent", "no fix", "clock wrong" or "fix".
const char* NameOf(ReceiverState state);

/// A receiver that gpsd knows.
struct GpsdDevice {
  std::string path;
  bool is_open = false;  ///< gpsd reads it.
};

/// Follows what gpsd says: which reports become fixes and velocities, and what is wrong. One
/// receiver is listened to at a time: the one that is asked for, else the first, until it falls
/// silent, or has no fix while another has. Clocks come in through arguments. Not thread-safe.
class ReceiverWatch {
 public:
  struct Config {
    std::string device;      ///< The only receiver to listen to; empty: any.
    double silence_s = 5.0;  ///< A receiver that says nothing for longer is silent, s.
    /// Fixes are withheld while the clocks are further apart than this, s.
    double max_clock_offset_s = 2.0;
    ReceiverConfig conversion;
  };

  /// The clocks when something came: of the system (ns since 1970), and one that nobody sets.
  struct Now {
    std::int64_t system_ns = 0;
    std::int64_t steady_ns = 0;
  };

  struct Counters {
    std::uint64_t connections = 0;         ///< To a gpsd that answered as one.
    std::uint64_t reports = 0;             ///< Of all receivers.
    std::uint64_t reports_of_others = 0;   ///< Of receivers that are not listened to.
    std::uint64_t fixes = 0;               ///< Given out.
    std::uint64_t velocities = 0;          ///< Given out.
    std::uint64_t no_fix = 0;              ///< Reports that say so themselves.
    std::uint64_t refused = 0;             ///< Reports whose position, time or certainty cannot be.
    std::uint64_t velocities_refused = 0;  ///< Reports whose speed or course cannot be.
    std::uint64_t withheld = 0;            ///< Fixes while the clocks are too far apart.
    std::uint64_t repeated = 0;            ///< Fixes not newer than the newest.
    std::uint64_t strays = 0;              ///< Fixes whose stamps fit neither clock nor neighbours.
    std::uint64_t jumps = 0;  ///< Fixes, given out, that no vehicle can have reached in time.
  };

  /// What one report gives.
  struct Taken {
    std::optional<ReceiverFix> fix;
    std::optional<ReceiverVelocity> velocity;
    bool says_no_fix = false;  ///< The receiver that is listened to has none.
  };

  explicit ReceiverWatch(Config config);

  /// gpsd answers, or does no longer: `reason` says why.
  void OnConnection(bool connected, const std::string& reason, const Now& now);
  /// All receivers that gpsd has now.
  void OnDevices(const std::vector<GpsdDevice>& devices);
  /// Satellites in the position and in view of the receiver `device`.
  void OnSatellites(const std::string& device, int used, int visible);
  Taken OnReport(const ReceiverReport& report, const Now& now);

  ReceiverState state(std::int64_t steady_ns) const;
  /// The state as a full sentence that says what is wrong and how to mend it.
  std::string Describe(std::int64_t steady_ns) const;
  /// The receiver that is listened to; empty: none.
  const std::string& device() const { return device_; }
  /// System's clock minus the receiver's, s; nothing where no fix told.
  std::optional<double> clock_offset_s() const { return clock_.offset_s(); }
  /// The newest fix that was given out.
  const std::optional<ReceiverFix>& newest() const { return newest_; }
  int satellites_used() const { return satellites_used_; }
  int satellites_visible() const { return satellites_visible_; }
  const Counters& counters() const { return counters_; }

 private:
  bool ListensTo(const ReceiverReport& report, FixVerdict verdict, std::int64_t steady_ns);
  bool IsSilent(std::int64_t steady_ns) const;
  bool IsClockWrong() const;
  Taken TakeFix(const ReceiverReport& report, const ReceiverFix& fix, const Now& now);
  void CountJump(const ReceiverFix& fix);
  void Forget();
  std::string DescribeAbsence() const;
  std::string DescribeClock() const;

  Config config_;
  bool connected_ = false;
  std::string reason_ = "it was not asked yet";  ///< Why there is no gpsd.
  std::vector<GpsdDevice> devices_;
  std::string device_;
  std::int64_t heard_ns_ = 0;  ///< Steady, of the newest report of device_, or of the connection.
  bool present_ = false;       ///< A receiver is there, by gpsd's list or by its own report.
  FixVerdict verdict_ = FixVerdict::kNoFix;  ///< Of the newest report.
  ReceiverClock clock_;
  StampGate gate_;
  std::optional<ReceiverFix> newest_;
  int satellites_used_ = 0;
  int satellites_visible_ = 0;
  Counters counters_;
};

}  // namespace livemap::receiver
