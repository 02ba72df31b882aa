#include "ros/parameters/parameters.h"

#include <ros/names.h>
#include <ros/param.h>

#include <cmath>
#include <sstream>

namespace livemap::ros_io {
namespace {

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

}  // namespace

ParameterReader::ParameterReader(const ros::NodeHandle& private_handle) : handle_(private_handle) {}

bool ParameterReader::Find(const std::string& name, XmlRpc::XmlRpcValue& value) {
  known_.insert(name);
  return handle_.getParam(name, value);
}

void ParameterReader::Refuse(const std::string& name, const XmlRpc::XmlRpcValue& value,
                             const std::string& accepted) const {
  throw Error("parameter '" + handle_.resolveName(name) + "' is " + ToText(value) +
              ", accepted is " + accepted);
}

void ParameterReader::Read(const std::string& name, std::string& value) {
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

void ParameterReader::Read(const std::string& name, bool& value) {
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  if (found.getType() != XmlRpc::XmlRpcValue::TypeBoolean) Refuse(name, found, "true or false");
  value = static_cast<bool>(found);
}

void ParameterReader::Read(const std::string& name, double& value, ParameterRange range) {
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  double number = std::numeric_limits<double>::quiet_NaN();
  if (found.getType() == XmlRpc::XmlRpcValue::TypeInt) number = static_cast<int>(found);
  if (found.getType() == XmlRpc::XmlRpcValue::TypeDouble) number = static_cast<double>(found);
  // Written so that NaN is refused too.
  if (!(number >= range.min && number <= range.max)) {
    Refuse(name, found, "a number " + ToText(range));
  }
  value = number;
}

void ParameterReader::Read(const std::string& name, int& value, ParameterRange range) {
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  if (found.getType() != XmlRpc::XmlRpcValue::TypeInt || static_cast<int>(found) < range.min ||
      static_cast<int>(found) > range.max) {
    Refuse(name, found, "a whole number " + ToText(range));
  }
  value = static_cast<int>(found);
}

void ParameterReader::ReadChoice(const std::string& name, std::string& value,
                                 const std::vector<std::string>& accepted) {
  XmlRpc::XmlRpcValue found;
  if (!Find(name, found)) return;
  std::string list;
  for (const std::string& choice : accepted) {
    if (found.getType() == XmlRpc::XmlRpcValue::TypeString &&
        static_cast<std::string>(found) == choice) {
      value = choice;
      return;
    }
    list += (list.empty() ? "" : ", ") + choice;
  }
  Refuse(name, found, "one of: " + list);
}

XmlRpc::XmlRpcValue ParameterReader::ReadStructured(const std::string& name) {
  XmlRpc::XmlRpcValue value;
  Find(name, value);
  return value;
}

void ParameterReader::RejectUnknown(const std::set<std::string>& foreign) const {
  XmlRpc::XmlRpcValue all;
  const std::string name_space = handle_.getNamespace();
  if (!ros::param::get(name_space, all) || all.getType() != XmlRpc::XmlRpcValue::TypeStruct) return;
  for (const auto& entry : all) {
    if (known_.count(entry.first) != 0 || foreign.count(entry.first) != 0) continue;
    std::string accepted;
    for (const std::string& name : known_) accepted += (accepted.empty() ? "" : ", ") + name;
    throw Error("unknown parameter '" + ros::names::append(name_space, entry.first) +
                "', accepted are: " + accepted);
  }
}

}  // namespace livemap::ros_io
