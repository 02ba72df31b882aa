#include "ros/parameters/shared/parameter_reader.h"

#include <ros/names.h>
#include <ros/param.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <sstream>

namespace livemap::ros_io {
namespace {

using Presence = ParameterDescription::Presence;

XmlRpc::XmlRpcValue AllParametersOf(const std::string& name_space) {
  XmlRpc::XmlRpcValue all;
  ros::param::get(name_space, all);
  return all;
}

std::string ToText(const XmlRpc::XmlRpcValue& value) {
  std::ostringstream text;
  value.write(text);
  return text.str();
}

std::string ToText(ParameterRange range) {
  std::ostringstream text;
  text << "from " << range.min << " to " << range.max;
  return text.str();
}

std::string JoinedParameterWords(const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
}

/// NaN for anything but a number.
double ParameterNumber(const XmlRpc::XmlRpcValue& value) {
  if (value.getType() == XmlRpc::XmlRpcValue::TypeInt) return static_cast<int>(value);
  if (value.getType() == XmlRpc::XmlRpcValue::TypeDouble) return static_cast<double>(value);
  return std::numeric_limits<double>::quiet_NaN();
}

/// Written so that NaN is outside.
bool IsWithinParameterRange(double number, ParameterRange range) {
  return number >= range.min && number <= range.max;
}

/// The double that a person would write for it: 0.1, and not 0.10000000149.
double ParameterNumberText(float number) {
  char text[32];
  for (int digits = 1; digits <= std::numeric_limits<float>::max_digits10; ++digits) {
    std::snprintf(text, sizeof(text), "%.*g", digits, static_cast<double>(number));
    if (std::strtof(text, nullptr) == number) break;
  }
  return std::strtod(text, nullptr);
}

}  // namespace

ParameterReader::ParameterReader(const ros::NodeHandle& private_handle)
    : ParameterReader(private_handle.getNamespace(),
                      AllParametersOf(private_handle.getNamespace())) {}

ParameterReader::ParameterReader(std::string name_space, const XmlRpc::XmlRpcValue& values)
    : name_space_(std::move(name_space)), values_(values) {}

void ParameterReader::Section(const std::string& title, const std::string& note) {
  section_ = title;
  section_note_ = note;
}

ParameterDescription& ParameterReader::Describe(const std::string& name, const std::string& type,
                                                const std::string& meaning,
                                                const XmlRpc::XmlRpcValue& standard) {
  ParameterDescription description;
  description.section = section_;
  description.section_note = section_note_;
  description.name = name;
  description.type = type;
  description.meaning = meaning;
  description.standard = standard;
  if (!Find(name, description.value)) description.value = standard;
  descriptions_.push_back(description);
  return descriptions_.back();
}

bool ParameterReader::Find(const std::string& name, XmlRpc::XmlRpcValue& value) {
  if (values_.getType() != XmlRpc::XmlRpcValue::TypeStruct || !values_.hasMember(name)) {
    return false;
  }
  value = values_[name];
  return true;
}

std::string ParameterReader::FullName(const std::string& name) const {
  return ros::names::append(name_space_, name);
}

void ParameterReader::Refuse(const std::string& name, const XmlRpc::XmlRpcValue& value,
                             const std::string& accepted) const {
  throw Error("parameter '" + FullName(name) + "' is " + ToText(value) + ", accepted is " +
              accepted);
}

void ParameterReader::Read(const std::string& name, std::string& value,
                           const std::string& meaning) {
  Describe(name, "text", meaning, value);
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  // roslaunch turns an all-digit string into a number: take it back as written.
  if (found.getType() == XmlRpc::XmlRpcValue::TypeInt) {
    value = std::to_string(static_cast<int>(found));
    return;
  }
  if (found.getType() != XmlRpc::XmlRpcValue::TypeString) Refuse(name, found, "a text");
  value = static_cast<std::string>(found);
}

void ParameterReader::ReadRequired(const std::string& name, std::string& value,
                                   const std::string& example, const std::string& meaning) {
  Read(name, value, meaning);
  ParameterDescription& description = descriptions_.back();
  description.presence = Presence::kRequired;
  description.standard = example;
  if (use_examples_ && value.empty()) value = example;
}

void ParameterReader::Read(const std::string& name, bool& value, const std::string& meaning) {
  Describe(name, "boolean", meaning, XmlRpc::XmlRpcValue(value));
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  if (found.getType() != XmlRpc::XmlRpcValue::TypeBoolean) Refuse(name, found, "true or false");
  value = static_cast<bool>(found);
}

double ParameterReader::ReadNumber(const std::string& name, double standard, ParameterRange range,
                                   const std::string& meaning, const std::string& unit) {
  ParameterDescription& description = Describe(name, "number", meaning, standard);
  description.range = range;
  description.unit = unit;
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return standard;
  const double number = ParameterNumber(found);
  if (!IsWithinParameterRange(number, range)) Refuse(name, found, "a number " + ToText(range));
  return number;
}

void ParameterReader::Read(const std::string& name, double& value, ParameterRange range,
                           const std::string& meaning, const std::string& unit) {
  value = ReadNumber(name, value, range, meaning, unit);
}

void ParameterReader::Read(const std::string& name, float& value, ParameterRange range,
                           const std::string& meaning, const std::string& unit) {
  value = static_cast<float>(ReadNumber(name, ParameterNumberText(value), range, meaning, unit));
}

void ParameterReader::Read(const std::string& name, int& value, ParameterRange range,
                           const std::string& meaning, const std::string& unit) {
  ParameterDescription& description = Describe(name, "integer", meaning, value);
  description.range = range;
  description.unit = unit;
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  if (found.getType() != XmlRpc::XmlRpcValue::TypeInt ||
      !IsWithinParameterRange(ParameterNumber(found), range)) {
    Refuse(name, found, "a whole number " + ToText(range));
  }
  value = static_cast<int>(found);
}

void ParameterReader::ReadChoice(const std::string& name, std::string& value,
                                 const std::vector<std::string>& accepted,
                                 const std::string& meaning) {
  Describe(name, "text", meaning, value).choices = accepted;
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  if (found.getType() == XmlRpc::XmlRpcValue::TypeString &&
      std::count(accepted.begin(), accepted.end(), static_cast<std::string>(found)) > 0) {
    value = static_cast<std::string>(found);
    return;
  }
  Refuse(name, found, "one of: " + JoinedParameterWords(accepted));
}

void ParameterReader::ReadMap(const std::string& name, std::map<std::string, double>& value,
                              ParameterRange range, const std::string& meaning,
                              const std::string& unit) {
  XmlRpc::XmlRpcValue standard;
  for (const auto& [key, number] : value) standard[key] = number;
  ParameterDescription& description = Describe(name, "map", meaning, standard);
  description.range = range;
  description.unit = unit;
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  const std::string accepted = "a map from names to numbers " + ToText(range);
  if (found.getType() != XmlRpc::XmlRpcValue::TypeStruct) Refuse(name, found, accepted);
  value.clear();
  for (const auto& [key, number] : found) {
    value[key] = ParameterNumber(number);
    if (!IsWithinParameterRange(value[key], range)) Refuse(name, found, accepted);
  }
}

XmlRpc::XmlRpcValue ParameterReader::ReadList(const std::string& name, const std::string& meaning) {
  ParameterDescription& description = Describe(name, "list", meaning, {});
  description.presence = Presence::kRequired;
  return description.value;
}

void ParameterReader::Foreign(const std::string& name, const std::string& example,
                              const std::string& meaning) {
  ParameterDescription& description = Describe(name, "text", meaning, {});
  description.presence = Presence::kOptional;
  description.standard = example;
}

bool ParameterReader::Has(const std::string& name) const {
  return values_.getType() == XmlRpc::XmlRpcValue::TypeStruct && values_.hasMember(name);
}

void ParameterReader::Renamed(const std::string& former, const std::string& present) const {
  if (!Has(former)) return;
  throw Error("parameter '" + FullName(former) + "' is now called '" + present + "'");
}

void ParameterReader::Removed(const std::string& former, const std::string& instead) const {
  if (!Has(former)) return;
  throw Error("parameter '" + FullName(former) + "' is no longer accepted: " + instead);
}

void ParameterReader::RejectUnknown(const std::set<std::string>& foreign) const {
  if (values_.getType() != XmlRpc::XmlRpcValue::TypeStruct) return;
  std::set<std::string> known;
  for (const ParameterDescription& description : descriptions_) known.insert(description.name);
  for (const auto& entry : values_) {
    if (known.count(entry.first) != 0 || foreign.count(entry.first) != 0) continue;
    throw Error("unknown parameter '" + FullName(entry.first) +
                "', accepted are: " + JoinedParameterWords({known.begin(), known.end()}));
  }
}

}  // namespace livemap::ros_io
