#pragma once

#include <map>
#include <string>
#include <vector>

#include "ros/parameters/shared/parameter_reader.h"

namespace livemap::ros_io {

/// A file of parameters, config/NAME.yaml, and the reader of the node that loads it.
struct NodeParameters {
  std::string name;    ///< Of the file, without its ending.
  std::string node;    ///< As docs/reference/nodes has it.
  std::string source;  ///< File of src/ros/parameters with the reader's calls.
  /// Parameters that this file gives although they have no default, for there are two sides of one
  /// node.
  std::map<std::string, std::string> given;
};

/// All of them.
const std::vector<NodeParameters>& AllNodeParameters();

/// Runs the reader of `parameters.name`; `package_path` holds config/. Throws Error.
void ReadNodeParameters(const NodeParameters& parameters, ParameterReader& reader,
                        const std::string& package_path);

/// What the reader says about its parameters where nothing but `given` is set.
std::vector<ParameterDescription> DescribeNodeParameters(const NodeParameters& parameters,
                                                         const std::string& package_path);

/// JSON with all of AllNodeParameters and their descriptions, for scripts/livemap_reference.
std::string NodeParametersAsJson(const std::string& package_path);

}  // namespace livemap::ros_io
