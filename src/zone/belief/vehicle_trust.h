#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace livemap::zone {

/// What became of one word that a vehicle said of a hazard, once others have settled the matter;
/// made by HazardLifecycle.
struct Verdict {
  std::uint64_t vehicle = 0;  ///< VehicleKey of who said it.
  /// ln(P(word | a vehicle that says what it likes) / P(word | an honest one)): > 0 the word was
  /// contradicted, < 0 it was borne out.
  double log_ratio = 0;
  std::uint64_t voucher = 0;  ///< Who bore it out; 0: an official.
};

/// What is held against one vehicle; a plain value, to be stored as it is.
struct TrustRecord {
  double suspicion = 0;    ///< Log odds above a newcomer's, of saying what it likes; >= 0.
  std::int64_t at_ns = 0;  ///< `suspicion` is of this moment, zone clock.
  /// The last vehicles that bore out its words, in a ring; 0: none.
  std::array<std::uint64_t, 8> vouchers{};
  std::uint8_t next = 0;  ///< Place of the next one.
};

/// How far each vehicle is believed, learned from what became of its words.
///
/// Two kinds of vehicles: honest ones, who err at the rates of the class, and a share h of others,
/// who say what they like. The posterior odds that a vehicle is of the second kind are the prior's
/// times the likelihood ratio of every word that was judged: the sequential probability ratio test
/// (A. Wald, 1945), with the odds kept from falling below the prior's (E. Page's CUSUM, Biometrika
/// 41, 1954). So trust can be lost and won back, but not saved up: nobody is ever believed more
/// than a newcomer, whoever vouches for it. Suspicion fades with time. A word that is borne out
/// counts only when none of the last eight such words had the same voucher: a clique smaller than
/// that cannot clear its members.
///
/// Knows no clock; not thread-safe. Memory: 120 bytes per vehicle that something is held against.
class VehicleTrust {
 public:
  struct Config {
    double malicious_share = 0.05;     ///< h: of vehicles that say what they like; above 0, < 0.5.
    double memory_s = 10 * 86400.0;    ///< Suspicion fades to 1/e in this time; > 0.
    double max_suspicion = 6;          ///< Log odds; more is not held against anybody; > 0.
    std::size_t max_vehicles = 50000;  ///< Beyond it the least suspected one is forgotten.
  };

  VehicleTrust() : VehicleTrust(Config()) {}
  /// Throws Error naming the value that is out of range.
  explicit VehicleTrust(const Config& config);

  /// Probability that the vehicle says what it likes; the share h of one that nothing is known of.
  double MaliciousProbability(std::uint64_t vehicle, std::int64_t now_ns) const;
  /// Takes a verdict in; one whose ratio is not finite counts nothing.
  void Judge(const Verdict& verdict, std::int64_t now_ns);

  /// What is held against the vehicle at `now_ns`, log odds.
  double Suspicion(std::uint64_t vehicle, std::int64_t now_ns) const;
  /// Takes back what was added (or cleared, if negative) at `at_ns`, as far as it has not faded.
  void TakeBack(std::uint64_t vehicle, double added, std::int64_t at_ns, std::int64_t now_ns);

  /// Holds as much against the vehicle as is held against anybody; it fades like any suspicion.
  void Distrust(std::uint64_t vehicle, std::int64_t now_ns);

  /// What is held against the vehicle; a fresh record when nothing is.
  TrustRecord Get(std::uint64_t vehicle) const;
  /// Takes in what the store kept. False, and nothing is taken in, when it is no such record.
  bool Restore(std::uint64_t vehicle, const TrustRecord& record);
  /// Nothing is held against the vehicle any more, and what it vouched for stands under another
  /// key.
  void Forget(std::uint64_t vehicle, std::uint64_t pseudonym);
  std::size_t vehicles() const { return records_.size(); }
  /// Vehicles that are malicious with at least this probability.
  std::size_t Count(double malicious_above, std::int64_t now_ns) const;

 private:
  double Faded(const TrustRecord& record, std::int64_t now_ns) const;
  TrustRecord& Find(std::uint64_t vehicle, std::int64_t now_ns);

  Config config_;
  double prior_log_odds_;
  std::map<std::uint64_t, TrustRecord> records_;
};

/// The whole record as one line of plain numbers, at most 300 bytes; exact.
std::string PackTrust(const TrustRecord& record);
/// Inverse of PackTrust; none when `text` is anything else.
std::optional<TrustRecord> UnpackTrust(const std::string& text);

/// One line of plain numbers, at most 200 bytes, to be stored.
std::string PackVouchers(const TrustRecord& record);
/// Inverse of PackVouchers; false, and nothing is changed, when `text` is anything else.
bool UnpackVouchers(const std::string& text, TrustRecord& record);

}  // namespace livemap::zone
