// Prints every node's parameters as JSON, from which scripts/livemap_reference makes config/*.yaml
// and the tables of docs/reference/nodes.
#include "ros/parameters/node_parameters.h"

#include <iostream>

#include "common/error.h"

int main(int argc, char** argv) {
  if (argc != 2 || argv[1][0] == '-') {
    std::cerr << "usage: livemap_node_parameters PACKAGE   the package's folder, with config/\n";
    return 2;
  }
  try {
    std::cout << livemap::ros_io::NodeParametersAsJson(argv[1]);
  } catch (const livemap::Error& error) {
    std::cerr << "livemap_node_parameters: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
