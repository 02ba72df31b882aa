#pragma once

#include <map>
#include <string>

namespace livemap::protocol {

/// What LiveMap knows about one class of hazards. The defaults serve classes that the catalogue
/// does not name.
struct HazardClass {
  std::string name;                 ///< As the detector says it, e.g. "pothole".
  std::string label;                ///< For people; the name where none is given.
  std::string icon = "hazard";      ///< Name of the map's icon.
  std::string colour = "#d62728";   ///< "#rrggbb".
  double duplicate_radius_m = 5.0;  ///< Same class within this distance is the same hazard.
  /// How far the middle of such a thing lies behind the edge of it that touches the road next to
  /// the camera, m: boxes end at that edge.
  double half_depth_m = 0;
  int urgency = 2;                 ///< Rank: 1 drivers must know at once, 2 soon, 3 can wait.
  double expected_life_s = 86400;  ///< Prior of how long such a hazard stays.
  int confirmations = 2;           ///< Distinct vehicles before drivers are told, 1 to 5.
  double hit_rate = 0.85;          ///< P(a vehicle that looks sees it | it is there), 0.5 to 0.99.
  double false_rate = 0.03;        ///< P(the same | it is not there), 0.001 to 0.4.
};

/// The heading under which all classes are counted that a catalogue does not name.
constexpr char kOtherClass[] = "other";

/// The classes of hazards and their properties, read from `config/hazards.yaml`.
class HazardCatalogue {
 public:
  /// Knows no class: every class gets the defaults.
  HazardCatalogue() = default;

  /// Reads the YAML file at `path`. Throws Error naming the file, the key, its value and what is
  /// accepted; unknown keys are refused too.
  static HazardCatalogue Load(const std::string& path);
  /// The same from text; `source` names it in errors.
  static HazardCatalogue Parse(const std::string& yaml, const std::string& source);

  /// The class's entry; the defaults, labelled with the name, where it has none.
  HazardClass Get(const std::string& class_name) const;
  /// Whether the file names the class, apart from blanks around the name. A catalogue that names no
  /// class at all takes every name.
  bool Names(const std::string& class_name) const;
  /// The name under which hazards of this class are kept: the file's own where it names the class,
  /// else kOtherClass. So nobody makes more classes than the file has, whatever names come.
  std::string HeadingOf(const std::string& class_name) const;
  /// Distance within which two hazards of this class are the same, metres.
  double DuplicateRadiusM(const std::string& class_name) const;
  /// The greatest duplicate radius of any class, the default for unknown classes included, metres.
  double MaxDuplicateRadiusM() const;
  /// Every class of the file by name.
  const std::map<std::string, HazardClass>& classes() const { return classes_; }

 private:
  HazardClass defaults_;
  std::map<std::string, HazardClass> classes_;
};

}  // namespace livemap::protocol
