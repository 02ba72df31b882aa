#pragma once

#include <ros/node_handle.h>

#include <limits>
#include <set>
#include <string>
#include <vector>

#include "common/error.h"

namespace livemap::ros_io {

/// Closed interval of accepted values.
struct ParameterRange {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};

/// Reads the private parameters of a nodelet or node into its struct of defaults.
///
///   ParameterReader parameters(private_handle);
///   parameters.Read("rate_hz", config.rate_hz, {0.1, 100.0});
///   parameters.RejectUnknown();
///
/// Throws livemap::Error with one sentence that names the parameter, its value and what is
/// accepted.
class ParameterReader {
 public:
  explicit ParameterReader(const ros::NodeHandle& private_handle);

  void Read(const std::string& name, std::string& value);
  void Read(const std::string& name, bool& value);
  void Read(const std::string& name, double& value, ParameterRange range = {});
  void Read(const std::string& name, int& value, ParameterRange range = {});
  /// One of `accepted`.
  void ReadChoice(const std::string& name, std::string& value,
                  const std::vector<std::string>& accepted);
  /// A structured parameter (list or map) that the caller parses; invalid when unset.
  XmlRpc::XmlRpcValue ReadStructured(const std::string& name);

  /// Call last: throws when the namespace holds a key that nothing above read, so that a misspelt
  /// parameter cannot go unnoticed. Sub-namespaces of other parties (image_transport's per-topic
  /// settings) are named in `foreign`.
  void RejectUnknown(const std::set<std::string>& foreign = {}) const;

 private:
  bool Find(const std::string& name, XmlRpc::XmlRpcValue& value);
  [[noreturn]] void Refuse(const std::string& name, const XmlRpc::XmlRpcValue& value,
                           const std::string& accepted) const;

  ros::NodeHandle handle_;
  std::set<std::string> known_;
};

}  // namespace livemap::ros_io
