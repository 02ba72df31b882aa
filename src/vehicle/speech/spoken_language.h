#pragma once

#include <map>
#include <string>

#include "protocol/hazard_catalogue.h"
#include "vehicle/alerts/driver_alerts.h"

namespace livemap::vehicle {

/// Below this distance a hazard is right ahead; no number is said, m.
constexpr double kNearM = 25;

/// A distance as people say it, m: tens up to 100 m, fifties up to 1 km, then hundreds.
int SpokenDistanceM(double distance_m);

/// What the driver hears in one language: sentences and the names of the classes, read from a text
/// file of lines `KEY = TEXT` (config/languages). `#` begins a line of comment. The keys are
///
///   language     the language's code for the speech synthesis (BCP 47), such as "pt"
///   ahead, left, right    sentences with {hazard} and {distance}, a whole number of metres
///   near         a sentence with {hazard}, for hazards nearer than kNearM
///   class NAME   what the class is called; `class other` serves classes without a line
class SpokenLanguage {
 public:
  /// Reads the file at `path`. Throws Error naming the file, the line, its text and what is
  /// accepted, or the key that is missing. Every class of the catalogue needs a line.
  static SpokenLanguage Load(const std::string& path, const protocol::HazardCatalogue& catalogue);
  /// The same from text; `source` names it in errors.
  static SpokenLanguage Parse(const std::string& text, const std::string& source,
                              const protocol::HazardCatalogue& catalogue);

  const std::string& code() const { return texts_.at("language"); }
  /// What is said of an approached hazard: of its class, side and distance.
  std::string SentenceOf(const HazardAlert& alert) const;

 private:
  std::map<std::string, std::string> texts_;  ///< By key, all of them.
};

}  // namespace livemap::vehicle
