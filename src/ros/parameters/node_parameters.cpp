#include "ros/parameters/node_parameters.h"

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "ros/parameters/camera_ingest_parameters.h"
#include "ros/parameters/candidate_intake_parameters.h"
#include "ros/parameters/change_detection_parameters.h"
#include "ros/parameters/driver_alert_parameters.h"
#include "ros/parameters/driver_page_parameters.h"
#include "ros/parameters/driver_speech_parameters.h"
#include "ros/parameters/early_discard_parameters.h"
#include "ros/parameters/hazard_detection_parameters.h"
#include "ros/parameters/hazard_reporting_parameters.h"
#include "ros/parameters/mqtt_bridge_parameters.h"
#include "ros/parameters/positioning/edge_vo_parameters.h"
#include "ros/parameters/positioning/geo_localization_parameters.h"
#include "ros/parameters/positioning/gps_receiver_parameters.h"
#include "ros/parameters/zone_cloudlet_parameters.h"

namespace livemap::ros_io {
namespace {

using Json = nlohmann::ordered_json;
using Reader = std::function<void(ParameterReader&, const std::string& package_path)>;

/// Drives are named by their start where no parameter does; any time will do here.
constexpr std::int64_t kNowNs = 0;

const std::map<std::string, Reader>& Readers() {
  using P = ParameterReader;
  using S = std::string;
  static const std::map<std::string, Reader> readers{
      {"camera_ingest", [](P& p, const S&) { ReadIngestConfig(p); }},
      {"candidate_intake", [](P& p, const S&) { ReadCandidateIntakeConfig(p); }},
      {"change_detection", [](P& p, const S&) { ReadChangeDetectionConfig(p, kNowNs); }},
      {"driver_alert", [](P& p, const S&) { ReadDriverAlertConfig(p); }},
      {"driver_page", [](P& p, const S&) { ReadDriverPageConfig(p); }},
      {"driver_speech", [](P& p, const S&) { ReadDriverSpeechConfig(p); }},
      {"early_discard", [](P& p, const S&) { ReadEarlyDiscardConfig(p, kNowNs); }},
      {"edge_vo", [](P& p, const S&) { ReadEdgeVoConfig(p); }},
      {"geo_localization", [](P& p, const S&) { ReadGeoLocalizationConfig(p); }},
      {"gps_receiver", [](P& p, const S&) { ReadGpsReceiverConfig(p); }},
      {"hazard_detection", [](P& p, const S&) { ReadHazardDetectionConfig(p); }},
      {"hazard_reporting", [](P& p, const S&) { ReadHazardReportingConfig(p, kNowNs); }},
      {"mqtt_bridge", [](P& p, const S&) { ReadBridgeConfig(p); }},
      {"zone_cloudlet", [](P& p, const S& path) { ReadZoneCloudletConfig(p, path); }}};
  return readers;
}

/// An entry that the bridge of either side accepts; the lists themselves stand in config/.
XmlRpc::XmlRpcValue ExampleTopics() {
  XmlRpc::XmlRpcValue entry;
  entry["name"] = "example";
  entry["ros_topic"] = "hazard/report";
  entry["type"] = "livemap/HazardReport";
  entry["direction"] = "out";
  entry["mqtt_topic"] = "livemap/v1/{zone}/vehicle/{vehicle}/report";
  XmlRpc::XmlRpcValue list;
  list[0] = entry;
  return list;
}

Json ToJson(const XmlRpc::XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return static_cast<bool>(value);
    case XmlRpc::XmlRpcValue::TypeInt:
      return static_cast<int>(value);
    case XmlRpc::XmlRpcValue::TypeDouble:
      return static_cast<double>(value);
    case XmlRpc::XmlRpcValue::TypeString:
      return static_cast<std::string>(value);
    case XmlRpc::XmlRpcValue::TypeStruct: {
      Json map = Json::object();
      for (const auto& [key, entry] : value) map[key] = ToJson(entry);
      return map;
    }
    default:
      return nullptr;
  }
}

const char* ToText(ParameterDescription::Presence presence) {
  if (presence == ParameterDescription::Presence::kRequired) return "required";
  return presence == ParameterDescription::Presence::kOptional ? "optional" : "default";
}

Json ToJson(const ParameterDescription& description, const NodeParameters& parameters) {
  Json json{{"name", description.name},
            {"section", description.section},
            {"section_note", description.section_note},
            {"type", description.type},
            {"unit", description.unit},
            {"choices", description.choices},
            {"meaning", description.meaning},
            {"presence", ToText(description.presence)},
            {"standard", ToJson(description.standard)}};
  if (std::isfinite(description.range.min)) {
    json["range"] = {description.range.min, description.range.max};
  }
  const auto given = parameters.given.find(description.name);
  if (given != parameters.given.end()) json["given"] = given->second;
  return json;
}

}  // namespace

const std::vector<NodeParameters>& AllNodeParameters() {
  static const std::vector<NodeParameters> all{
      {"camera_ingest", "camera_ingest", "camera_ingest_parameters.cpp", {}},
      {"candidate_intake", "candidate_intake", "candidate_intake_parameters.cpp", {}},
      {"change_detection", "change_detection", "change_detection_parameters.cpp", {}},
      {"driver_alert", "driver_alert", "driver_alert_parameters.cpp", {}},
      {"driver_page", "driver_page", "driver_page_parameters.cpp", {}},
      {"driver_speech", "driver_speech", "driver_speech_parameters.cpp", {}},
      {"early_discard", "early_discard", "early_discard_parameters.cpp", {}},
      {"edge_vo", "edge_vo", "positioning/edge_vo_parameters.cpp", {}},
      {"geo_localization", "geo_localization", "positioning/geo_localization_parameters.cpp", {}},
      {"gps_receiver", "gps_receiver", "positioning/gps_receiver_parameters.cpp", {}},
      {"hazard_detection", "hazard_detection", "hazard_detection_parameters.cpp", {}},
      {"hazard_reporting", "hazard_reporting", "hazard_reporting_parameters.cpp", {}},
      {"mqtt_bridge_vehicle", "mqtt_bridge", "mqtt_bridge_parameters.cpp", {{"role", "vehicle"}}},
      {"mqtt_bridge_zone",
       "mqtt_bridge",
       "mqtt_bridge_parameters.cpp",
       {{"role", "zone"}, {"user", "zone"}}},
      {"zone_cloudlet", "zone_cloudlet", "zone_cloudlet_parameters.cpp", {}}};
  return all;
}

void ReadNodeParameters(const NodeParameters& parameters, ParameterReader& reader,
                        const std::string& package_path) {
  Readers().at(parameters.node)(reader, package_path);
}

std::vector<ParameterDescription> DescribeNodeParameters(const NodeParameters& parameters,
                                                         const std::string& package_path) {
  XmlRpc::XmlRpcValue given;
  for (const auto& [name, value] : parameters.given) given[name] = value;
  if (parameters.node == "mqtt_bridge") given["topics"] = ExampleTopics();
  ParameterReader reader("/" + parameters.node, given);
  reader.UseExamples();
  ReadNodeParameters(parameters, reader, package_path);
  return reader.descriptions();
}

std::string NodeParametersAsJson(const std::string& package_path) {
  Json all = Json::array();
  for (const NodeParameters& parameters : AllNodeParameters()) {
    Json list = Json::array();
    for (const ParameterDescription& description :
         DescribeNodeParameters(parameters, package_path)) {
      list.push_back(ToJson(description, parameters));
    }
    all.push_back({{"name", parameters.name},
                   {"node", parameters.node},
                   {"source", parameters.source},
                   {"parameters", list}});
  }
  return all.dump(1) + "\n";
}

}  // namespace livemap::ros_io
