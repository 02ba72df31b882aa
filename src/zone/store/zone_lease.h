#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "common/sqlite.h"

namespace livemap::zone {

class StoreConnection;

/// The process is not the active one of its zone any more: another one has the lease.
class LeaseLost : public StoreError {
 public:
  using StoreError::StoreError;
};

/// Which of the processes of a zone may write to its PostgreSQL database: the one that holds the
/// lease. The lease is a row in that database with the holder, the epoch, which rises with every
/// holder, and the time until which it is valid by the database's clock. ZoneStore has each of its
/// commits refused whose epoch is not the row's, so that a holder that stood still and lost the
/// lease meanwhile writes nothing.
///
/// One thread takes, renews and gives back the lease; any thread may call the functions that are
/// const.
///
/// Typical usage:
///   ZoneLease lease({url, "host-a", 3.0});
///   while (!lease.TryTake()) Wait();
///   ZoneStore store(url, lease.epoch());
///   while (lease.Renew()) Wait();
class ZoneLease {
 public:
  struct Config {
    std::string database;   ///< URL of PostgreSQL.
    std::string holder;     ///< Names this process, for people; 1 to 200 bytes.
    double duration_s = 3;  ///< The lease is valid for so long after it was taken or renewed.
  };

  /// Connects and makes the row where there is none. Throws Error for a database or name that is
  /// not accepted and StoreError when the server does not answer.
  explicit ZoneLease(Config config);
  /// Leaves the lease as it is: it ends by itself.
  ~ZoneLease();
  ZoneLease(const ZoneLease&) = delete;
  ZoneLease& operator=(const ZoneLease&) = delete;

  /// Takes the lease where nobody's is valid, under the next epoch, and ends the connection over
  /// which the former holder wrote, with the transaction that it left open. False while somebody
  /// holds it. Throws StoreError when the server does not answer; the next call connects again.
  bool TryTake();
  /// Makes the lease that was taken valid for another `duration_s`, even when that time was over
  /// but nobody has taken it since. False when somebody has: then it is lost for good. Throws
  /// StoreError when the server does not answer; the next call connects again.
  bool Renew();
  /// Ends the lease at once, so that a standby need not wait. Never throws: an end that the server
  /// did not hear of comes by itself.
  void GiveBack() noexcept;

  /// Whether the lease is surely valid now: by this machine's clock, which goes on while the
  /// process or the machine stands still, `duration_s` have not passed since the last renewal was
  /// asked for.
  bool IsHeld() const;
  /// Of the lease that was taken last; 0 before.
  std::uint64_t epoch() const { return epoch_; }
  /// Time since the lease was taken or renewed last, in s; 0 before.
  double AgeS() const;
  const Config& config() const { return config_; }

  /// The row as it is in the database.
  struct Row {
    std::string holder;       ///< "" when nobody has held it yet.
    std::uint64_t epoch = 0;  ///< 0 when nobody has held it yet.
    double valid_s = 0;       ///< From now, by the database's clock; negative: it is over.
  };
  /// Throws StoreError when the server does not answer.
  Row Read();

 private:
  StoreConnection& Connection();
  void MakeRow();
  void EndFormerWriter();
  template <typename Body>
  auto Ask(const std::string& doing, const Body& body);

  const Config config_;
  std::unique_ptr<StoreConnection> connection_;  ///< Null between two connections.
  std::atomic<std::uint64_t> epoch_{0};
  std::atomic<std::int64_t> asked_ns_{0};  ///< When the valid one was asked for; 0: there is none.
};

}  // namespace livemap::zone
