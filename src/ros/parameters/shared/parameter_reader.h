#pragma once

#include <ros/node_handle.h>

#include <limits>
#include <map>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/error.h"

namespace livemap::ros_io {

/// Closed interval of accepted values.
struct ParameterRange {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};

/// What the reference says about one parameter. The reader's calls are the only list of them.
struct ParameterDescription {
  /// Whether the node has a value where none is given.
  enum class Presence {
    kDefault,   ///< `standard` holds.
    kRequired,  ///< The node refuses to start without it; `standard` is an example.
    kOptional   ///< Something else happens without it; `standard` is an example.
  };

  std::string section;       ///< Title of the section it stands in; may be empty.
  std::string section_note;  ///< What holds for the whole section.
  std::string name;
  std::string type;  ///< "text", "boolean", "number", "integer", "map" or "list".
  std::string unit;  ///< SI symbol or word; empty: none.
  ParameterRange range;
  std::vector<std::string> choices;  ///< Accepted words; empty: any.
  std::string meaning;               ///< Full sentences.
  Presence presence = Presence::kDefault;
  XmlRpc::XmlRpcValue standard;
  XmlRpc::XmlRpcValue value;  ///< In effect: given, or `standard`. Not set where neither holds.
};

/// Reads the private parameters of a nodelet or node into its struct of defaults. Each call states
/// name, variable, accepted values, meaning and unit once: config/*.yaml and the tables under
/// docs/reference/nodes are generated from these calls, in their order (scripts/livemap_reference).
///
/// Typical usage:
///
///   ParameterReader parameters(private_handle);
///   parameters.Section("Rate");
///   parameters.Read("rate_hz", config.rate_hz, {0.1, 100.0}, "Images per second.", "Hz");
///   parameters.RejectUnknown();
///
/// The default is what the variable holds before the call. Throws livemap::Error with one sentence
/// that names the parameter, its value and what is accepted.
class ParameterReader {
 public:
  /// Takes all values of the handle's namespace from the parameter server.
  explicit ParameterReader(const ros::NodeHandle& private_handle);
  /// Takes `values`, a map, as the parameters of `name_space`; needs no ROS master.
  ParameterReader(std::string name_space, const XmlRpc::XmlRpcValue& values);

  /// A required parameter that is not given takes its example from now on, so that a reader can be
  /// run for its descriptions.
  void UseExamples() { use_examples_ = true; }

  /// The parameters that follow belong together.
  void Section(const std::string& title, const std::string& note = "");

  void Read(const std::string& name, std::string& value, const std::string& meaning);
  void Read(const std::string& name, bool& value, const std::string& meaning);
  void Read(const std::string& name, double& value, ParameterRange range,
            const std::string& meaning, const std::string& unit = "");
  void Read(const std::string& name, float& value, ParameterRange range, const std::string& meaning,
            const std::string& unit = "");
  void Read(const std::string& name, int& value, ParameterRange range, const std::string& meaning,
            const std::string& unit = "");
  /// Of any other type of whole numbers; `range` stays within int.
  template <typename Integer, typename = std::enable_if_t<std::is_integral_v<Integer>>>
  void Read(const std::string& name, Integer& value, ParameterRange range,
            const std::string& meaning, const std::string& unit = "") {
    int number = static_cast<int>(value);
    Read(name, number, range, meaning, unit);
    value = static_cast<Integer>(number);
  }
  /// A text without default. The caller refuses an empty one where it is needed, with a sentence
  /// that says what for.
  void ReadRequired(const std::string& name, std::string& value, const std::string& example,
                    const std::string& meaning);
  /// One of `accepted`.
  void ReadChoice(const std::string& name, std::string& value,
                  const std::vector<std::string>& accepted, const std::string& meaning);
  /// One of the words of `accepted`, as the value that it stands for.
  template <typename Value>
  void ReadChoice(const std::string& name, Value& value,
                  const std::vector<std::pair<std::string, Value>>& accepted,
                  const std::string& meaning) {
    std::vector<std::string> words;
    std::string word;
    for (const auto& choice : accepted) {
      words.push_back(choice.first);
      if (choice.second == value) word = choice.first;
    }
    ReadChoice(name, word, words, meaning);
    for (const auto& choice : accepted) {
      if (choice.first == word) value = choice.second;
    }
  }
  /// A map from names to numbers; one that is given replaces the default as a whole.
  void ReadMap(const std::string& name, std::map<std::string, double>& value, ParameterRange range,
               const std::string& meaning, const std::string& unit = "");
  /// A list without default that the caller parses; invalid when it is not given.
  XmlRpc::XmlRpcValue ReadList(const std::string& name, const std::string& meaning);

  /// Accepts a parameter that another library reads, such as image_transport's.
  void Foreign(const std::string& name, const std::string& example, const std::string& meaning);

  /// Refuses the former name of a parameter with a sentence that says the present one.
  void Renamed(const std::string& former, const std::string& present) const;
  /// Refuses a parameter that no longer exists with a sentence that ends in `instead`: what holds
  /// now, without full stop.
  void Removed(const std::string& former, const std::string& instead) const;

  /// Call last: throws when the namespace holds a key that nothing above read, so that a misspelt
  /// parameter cannot go unnoticed. `foreign` names keys of other libraries that need no mention.
  void RejectUnknown(const std::set<std::string>& foreign = {}) const;

  /// All that was read, in the order of the calls.
  const std::vector<ParameterDescription>& descriptions() const { return descriptions_; }

 private:
  ParameterDescription& Describe(const std::string& name, const std::string& type,
                                 const std::string& meaning, const XmlRpc::XmlRpcValue& standard);
  bool Find(const std::string& name, XmlRpc::XmlRpcValue& value);
  double ReadNumber(const std::string& name, double standard, ParameterRange range,
                    const std::string& meaning, const std::string& unit);
  std::string FullName(const std::string& name) const;
  bool Has(const std::string& name) const;
  [[noreturn]] void Refuse(const std::string& name, const XmlRpc::XmlRpcValue& value,
                           const std::string& accepted) const;

  std::string name_space_;
  XmlRpc::XmlRpcValue values_;
  bool use_examples_ = false;
  std::string section_;
  std::string section_note_;
  std::vector<ParameterDescription> descriptions_;
};

}  // namespace livemap::ros_io
