#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "common/uuid.h"

namespace livemap::vehicle {

/// Says which unfinished reports are to be sent now: each at once, then again after a pause that
/// doubles, with jitter so that vehicles which lost the same link do not return in step. The first
/// answer after a silence shows that the way to the zone is open again: then the long pauses end
/// for all. Urgent classes go first, then older reports. A report may be held: it then waits for a
/// cheap link, or until its time is over. Times are steady seconds from any origin.
class ResendSchedule {
 public:
  struct Config {
    double first_pause_s = 1.0;
    double longest_pause_s = 30.0;
    double jitter = 0.2;  ///< A pause is drawn from (1 - jitter) to (1 + jitter) times its length.
  };

  ResendSchedule(const Config& config, std::mt19937_64 random);

  /// A report to send from `now_s` on, on a link that is not cheap from `hold_until_s` on.
  /// `urgency` as in HazardClass; `created_ns` orders equals. `was_sent`: at least once, before.
  void Add(const Uuid& report, int urgency, std::int64_t created_ns, double now_s,
           double hold_until_s = 0, bool was_sent = false);
  /// Whether held reports may go, too; true until told otherwise.
  void SetCheapLink(bool cheap) { cheap_ = cheap; }
  /// The report is finished: the zone answered. Unknown ones are ignored.
  void Remove(const Uuid& report);
  /// At most `limit` reports whose time has come, in the order to send them; plans their next time.
  std::vector<Uuid> TakeDue(double now_s, std::size_t limit);

  /// A report that TakeDue gave has been sent. Unknown ones are ignored.
  void MarkSent(const Uuid& report);
  /// Whether the next sending of a report repeats an earlier one; false for unknown ones.
  bool WasSent(const Uuid& report) const;

  std::size_t size() const { return entries_.size(); }
  /// Of the oldest unfinished report, the time of Add's `created_ns`; none: there is no report.
  std::optional<std::int64_t> OldestNs() const;
  /// How many wait while the link is not cheap.
  std::size_t Held(double now_s) const;

 private:
  struct Entry {
    int urgency;
    std::int64_t created_ns;
    double due_s;
    double pause_s;
    double sent_s;  ///< Last, if it was.
    double hold_until_s;
    bool was_sent;
  };

  void NoteAnswer(double now_s);

  Config config_;
  bool cheap_ = true;
  bool answered_ = false;                ///< Since the last TakeDue.
  std::optional<double> last_answer_s_;  ///< Or the first report's time, while there is none.
  std::mt19937_64 random_;
  std::map<Uuid, Entry> entries_;
};

}  // namespace livemap::vehicle
