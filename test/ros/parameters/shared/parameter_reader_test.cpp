// ParameterReader by itself, and config/*.yaml through the readers that the nodes run.
#include "ros/parameters/shared/parameter_reader.h"

#include <gmock/gmock.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <map>
#include <regex>
#include <sstream>

#include "localization/localizer_config.h"
#include "ros/parameters/node_parameters.h"
#include "ros/parameters/positioning/geo_localization_parameters.h"

namespace livemap::ros_io {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;
using XmlRpc::XmlRpcValue;

/// As rosparam takes it: plain scalars by their look, quoted ones as texts.
XmlRpcValue ToValue(const YAML::Node& node) {
  XmlRpcValue value;
  if (node.IsMap()) {
    for (const auto& entry : node) value[entry.first.as<std::string>()] = ToValue(entry.second);
    return value;
  }
  if (node.IsSequence()) {
    for (std::size_t i = 0; i < node.size(); ++i) value[static_cast<int>(i)] = ToValue(node[i]);
    return value;
  }
  const auto text = node.as<std::string>();
  if (node.Tag() == "!") return XmlRpcValue(text);
  if (text == "true" || text == "false") return XmlRpcValue(text == "true");
  if (std::regex_match(text, std::regex("[-+]?[0-9]+"))) return XmlRpcValue(std::stoi(text));
  if (std::regex_match(text, std::regex(R"([-+]?[0-9]+\.[0-9]*([eE][-+][0-9]+)?)"))) {
    return XmlRpcValue(std::stod(text));
  }
  return XmlRpcValue(text);
}

std::string ToText(const XmlRpcValue& value) {
  std::ostringstream text;
  text.precision(17);
  value.write(text);
  return text.str();
}

XmlRpcValue One(const std::string& name, const XmlRpcValue& value) {
  XmlRpcValue values;
  values[name] = value;
  return values;
}

TEST(ParameterReader, KeepsTheDefaultsWhereNothingIsGiven) {
  ParameterReader reader("/node", {});
  double rate_hz = 3.5;
  std::string frame = "map";
  std::size_t count = 7;
  reader.Read("rate_hz", rate_hz, {0.1, 100}, "Images per second.", "Hz");
  reader.Read("frame", frame, "Frame.");
  reader.Read("count", count, {1, 10}, "Number.");
  reader.RejectUnknown();
  EXPECT_EQ(rate_hz, 3.5);
  EXPECT_EQ(frame, "map");
  EXPECT_EQ(count, 7u);
  ASSERT_EQ(reader.descriptions().size(), 3u);
  const ParameterDescription& rate = reader.descriptions()[0];
  EXPECT_EQ(rate.name, "rate_hz");
  EXPECT_EQ(rate.unit, "Hz");
  EXPECT_EQ(rate.range.min, 0.1);
  EXPECT_EQ(ToText(rate.standard), "3.5");
}

TEST(ParameterReader, TakesWhatIsGivenInTheFormsOfRoslaunch) {
  XmlRpcValue values;
  values["rate_hz"] = 4;  // A whole number is a number.
  values["id"] = 17;      // roslaunch turns a text of digits into a number.
  values["mode"] = "fast";
  values["delays"]["deer"] = 2;
  ParameterReader reader("/node", values);
  double rate_hz = 1;
  std::string id;
  int mode = 1;
  std::map<std::string, double> delays{{"debris", 0.0}};
  reader.Read("rate_hz", rate_hz, {0, 10}, "Rate.");
  reader.Read("id", id, "Id.");
  reader.ReadChoice<int>("mode", mode, {{"slow", 1}, {"fast", 2}}, "Mode.");
  reader.ReadMap("delays", delays, {0, 60}, "Delays.");
  EXPECT_EQ(rate_hz, 4);
  EXPECT_EQ(id, "17");
  EXPECT_EQ(mode, 2);
  EXPECT_EQ(delays, (std::map<std::string, double>{{"deer", 2.0}}));
}

TEST(ParameterReader, RefusesWithOneSentenceThatSaysWhatIsAccepted) {
  double number = 1;
  int whole = 1;
  bool flag = false;
  std::string text = "a";
  std::map<std::string, double> map;
  EXPECT_THAT(
      [&] {
        ParameterReader("/n", One("x", 11.5)).Read("x", number, {0, 10}, "");
      },
      ThrowsMessage<Error>("parameter '/n/x' is 11.5, accepted is a number from 0 to 10"));
  EXPECT_THAT(
      [&] {
        ParameterReader("/n", One("x", std::nan(""))).Read("x", number, {0, 10}, "");
      },
      ThrowsMessage<Error>(HasSubstr("accepted is a number from 0 to 10")));
  EXPECT_THAT(
      [&] {
        ParameterReader("/n", One("x", 2.5)).Read("x", whole, {0, 10}, "");
      },
      ThrowsMessage<Error>(HasSubstr("accepted is a whole number from 0 to 10")));
  EXPECT_THAT([&] { ParameterReader("/n", One("x", 1)).Read("x", flag, ""); },
              ThrowsMessage<Error>(HasSubstr("accepted is true or false")));
  EXPECT_THAT([&] { ParameterReader("/n", One("x", true)).Read("x", text, ""); },
              ThrowsMessage<Error>(HasSubstr("accepted is a text")));
  EXPECT_THAT(
      [&] {
        ParameterReader("/n", One("x", "c")).ReadChoice("x", text, {"a", "b"}, "");
      },
      ThrowsMessage<Error>(HasSubstr("accepted is one of: a, b")));
  EXPECT_THAT(
      [&] {
        ParameterReader("/n", One("x", One("deer", 61))).ReadMap("x", map, {0, 60}, "");
      },
      ThrowsMessage<Error>(HasSubstr("accepted is a map from names to numbers from 0 to 60")));
}

TEST(ParameterReader, RefusesAFormerNameWithThePresentOne) {
  const ParameterReader reader("/car/change_detection", One("most_mb", 5.0));
  EXPECT_THAT(
      [&] { reader.Renamed("most_mb", "max_mb"); },
      ThrowsMessage<Error>("parameter '/car/change_detection/most_mb' is now called 'max_mb'"));
  EXPECT_NO_THROW(reader.Renamed("most_cell_mb", "max_cell_mb"));
}

TEST(ParameterReader, RefusesAParameterThatIsGoneWithWhatHoldsInstead) {
  const ParameterReader reader("/car/hazard_reporting", One("pictures_on_demand", true));
  EXPECT_THAT(
      [&] { reader.Removed("pictures_on_demand", "it makes every picture itself"); },
      ThrowsMessage<Error>("parameter '/car/hazard_reporting/pictures_on_demand' is no longer "
                           "accepted: it makes every picture itself"));
  EXPECT_NO_THROW(reader.Removed("picture_frames", "nothing"));
}

TEST(ParameterReader, RefusesWhatNobodyReads) {
  ParameterReader reader("/n", One("rate_hs", 1.0));
  double rate_hz = 1;
  reader.Read("rate_hz", rate_hz, {0, 10}, "Rate.");
  reader.Foreign("image_transport", "raw", "Transport.");
  EXPECT_THAT([&] { reader.RejectUnknown(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("unknown parameter '/n/rate_hs'"),
                                         HasSubstr("image_transport, rate_hz"))));
  EXPECT_NO_THROW(reader.RejectUnknown({"rate_hs"}));
}

TEST(ParameterReader, ARequiredParameterHasAnExampleAndNoDefault) {
  ParameterReader reader("/n", {});
  std::string model;
  reader.ReadRequired("model", model, "models/NAME.yaml", "Model.");
  EXPECT_TRUE(model.empty());
  reader.UseExamples();
  reader.ReadRequired("model", model, "models/NAME.yaml", "Model.");
  EXPECT_EQ(model, "models/NAME.yaml");
}

class NodeParametersTest : public testing::TestWithParam<NodeParameters> {
 protected:
  const std::string root_ = LIVEMAP_SOURCE_DIR;

  XmlRpcValue File() const {
    return ToValue(YAML::LoadFile(root_ + "/config/" + GetParam().name + ".yaml"));
  }
};

TEST_P(NodeParametersTest, TheFileHoldsTheDefaultsOfTheReader) {
  ParameterReader reader("/" + GetParam().node, File());
  reader.UseExamples();
  ReadNodeParameters(GetParam(), reader, root_);
  const XmlRpcValue file = File();
  std::map<std::string, std::string> defaults;
  for (const ParameterDescription& parameter : DescribeNodeParameters(GetParam(), root_)) {
    defaults[parameter.name] = ToText(parameter.standard);
  }
  ASSERT_EQ(reader.descriptions().size(), defaults.size());
  for (const ParameterDescription& parameter : reader.descriptions()) {
    const bool in_file = file.hasMember(parameter.name);
    if (parameter.presence == ParameterDescription::Presence::kDefault &&
        GetParam().given.count(parameter.name) == 0) {
      EXPECT_TRUE(in_file) << parameter.name;
      EXPECT_EQ(ToText(parameter.value), defaults.at(parameter.name)) << parameter.name;
      EXPECT_EQ(parameter.value.getType(), parameter.standard.getType()) << parameter.name;
    } else {
      const bool given = GetParam().given.count(parameter.name) != 0 || parameter.type == "list";
      EXPECT_EQ(in_file, given) << parameter.name;
    }
  }
}

TEST_P(NodeParametersTest, EveryParameterHasAMeaningAndAnAcceptedDefault) {
  for (const ParameterDescription& parameter : DescribeNodeParameters(GetParam(), root_)) {
    EXPECT_THAT(parameter.meaning, testing::MatchesRegex("[^ ].*[.]")) << parameter.name;
    EXPECT_EQ(parameter.meaning.find("  "), std::string::npos) << parameter.name;
    double standard = parameter.range.min;
    if (parameter.type == "number") standard = static_cast<double>(XmlRpcValue(parameter.standard));
    if (parameter.type == "integer") standard = static_cast<int>(XmlRpcValue(parameter.standard));
    EXPECT_GE(standard, parameter.range.min) << parameter.name;
    EXPECT_LE(standard, parameter.range.max) << parameter.name;
  }
}

INSTANTIATE_TEST_SUITE_P(All, NodeParametersTest, testing::ValuesIn(AllNodeParameters()),
                         [](const auto& tested) { return tested.param.name; });

TEST(FormerNames, AreRefusedByTheNodesWithThePresentOnes) {
  const std::map<std::string, std::map<std::string, std::string>> renamed{
      {"change_detection",
       {{"most_position_sigma_m", "max_position_sigma_m"},
        {"most_cell_mb", "max_cell_mb"},
        {"most_mb", "max_mb"},
        {"most_cached_mb", "max_cached_mb"},
        {"most_distance_m", "max_distance_m"},
        {"most_heading_difference_rad", "max_heading_difference_rad"},
        {"least_region_px", "min_region_px"},
        {"least_seen", "min_seen"},
        {"least_travel_m", "min_travel_m"},
        {"least_share", "min_share"},
        {"most_range_m", "max_range_m"}}},
      {"edge_vo",
       {{"least_gradient", "min_gradient"}, {"keyframe_most_motion", "keyframe_max_motion"}}},
      {"geo_localization", {{"least_sigma_m", "min_sigma_m"}}},
      {"zone_cloudlet",
       {{"surest_presence", "max_presence"},
        {"denials", "denying_vehicles"},
        {"hostile_share", "malicious_share"},
        {"sure_above", "settled_above"}}}};
  for (const NodeParameters& node : AllNodeParameters()) {
    const auto names = renamed.find(node.name);
    if (names == renamed.end()) continue;
    for (const auto& [former, present] : names->second) {
      ParameterReader reader("/n", One(former, 1.0));
      reader.UseExamples();
      EXPECT_THAT(
          [&] { ReadNodeParameters(node, reader, LIVEMAP_SOURCE_DIR); },
          ThrowsMessage<Error>("parameter '/n/" + former + "' is now called '" + present + "'"));
    }
  }
}

/// The localizer checks its settings by itself, for programs without parameters.
TEST(GeoLocalizationParameters, TheLocalizerAcceptsWhatTheReaderAccepts) {
  ParameterReader described("/n", {});
  ReadGeoLocalizationConfig(described);
  for (const ParameterDescription& parameter : described.descriptions()) {
    if (parameter.type != "number" && parameter.type != "integer") continue;
    for (const double limit : {parameter.range.min, parameter.range.max}) {
      XmlRpcValue values;
      values[parameter.name] =
          parameter.type == "integer" ? XmlRpcValue(static_cast<int>(limit)) : XmlRpcValue(limit);
      if (parameter.name == "node_spacing_s") values["idle_spacing_s"] = 10.0;
      if (parameter.name == "idle_spacing_s") values["node_spacing_s"] = 0.05;
      ParameterReader reader("/n", values);
      EXPECT_NO_THROW(localization::Check(ReadGeoLocalizationConfig(reader).localizer))
          << parameter.name << " " << limit;
    }
  }
}

}  // namespace
}  // namespace livemap::ros_io
