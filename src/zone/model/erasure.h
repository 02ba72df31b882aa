#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

namespace livemap::zone {

/// A vehicle that is to be forgotten, and the names that stand in its place: a different one for
/// each hazard and map change, so that distinct vehicles stay distinct there while nobody can tell
/// any more which of them were one vehicle's. They are derived from a secret of the erasure, which
/// is thrown away with it; until then an erasure that was cut off goes on under the same names.
class Pseudonyms {
 public:
  /// `secret`: random, at least 16 bytes.
  Pseudonyms(std::string vehicle_id, std::string secret);

  const std::string& vehicle_id() const { return vehicle_id_; }
  std::uint64_t key() const { return key_; }  ///< VehicleKey.
  /// "forgotten-" and 16 hexadecimal digits; `about` is the UUID of the hazard or map change, or
  /// any other text.
  std::string IdFor(const std::string& about) const;
  /// VehicleKey of IdFor.
  std::uint64_t KeyFor(const std::string& about) const;
  /// Puts the pseudonym in the place of the vehicle's name where that stands alone in free text of
  /// at most `max_bytes`. Whether it stood there.
  bool ReplaceName(std::string& text, const std::string& about, std::size_t max_bytes) const;
  /// The same of the vehicle's key in a line of numbers.
  bool ReplaceKey(std::string& line, const std::string& about) const;

 private:
  const std::string vehicle_id_;
  const std::string secret_;
  const std::uint64_t key_;
  const std::string key_digits_;
};

/// What an erasure has done so far.
struct ErasureCounts {
  std::uint64_t reports = 0;   ///< Of hazards and of map changes.
  std::uint64_t answers = 0;   ///< To polls.
  std::uint64_t hazards = 0;   ///< With the vehicle's evidence, or a map change with it.
  std::uint64_t pictures = 0;  ///< Deleted.
  std::uint64_t places = 0;    ///< Where the vehicle was.

  std::uint64_t rows() const { return reports + answers + hazards + places; }
};

/// How far an erasure has come in the store: it goes through the tables page by page, so that the
/// writer does other work in between.
struct ErasureWalk {
  /// In this order: what a later part needs of a row is found before the row is changed, so that an
  /// erasure that was cut off begins anew and misses nothing.
  enum class Part {
    kFindAnswers,
    kReports,
    kAnswers,
    kMapChangeReports,
    kEvents,
    kMapChangeEvents,
    kDecisions,
    kWithdrawals,
    kTrust,
    kPlaces,
    kDone
  };
  Part part = Part::kFindAnswers;
  std::string after_text;              ///< The last row's key that was looked at: its text,
  long long after_number = INT64_MIN;  ///< and its number.
  std::set<long long> answered;        ///< Rows of hazards about which the vehicle answered polls.
  /// Pictures of reports of those: the others that such hazards show came with answers.
  std::set<std::string> reported_pictures;
  std::vector<std::string> pictures;  ///< Found by the newest step: that the vehicle sent.
  ErasureCounts counts;
};

}  // namespace livemap::zone
