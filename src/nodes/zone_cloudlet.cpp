// The zone cloudlet: see docs/how-to/run-a-zone.md. Exit code 1 for a bad parameter or store, 2 for
// wrong usage.
#include <ros/package.h>
#include <ros/ros.h>

#include <iostream>
#include <optional>
#include <string>
#include <utility>

#include "nodes/json_log.h"
#include "nodes/zone_failover.h"
#include "nodes/zone_node.h"

namespace {

constexpr char kUsage[] =
    "usage: zone_cloudlet [--help] [ROS remappings and _parameter:=value]\n"
    "\n"
    "Keeps a zone's hazards: takes reports from hazard/report and vehicles from vehicle/position,\n"
    "answers on hazard/receipt, tells every vehicle on hazard/notice, shows the map for rviz on\n"
    "hazard/markers and for browsers on web_port. Parameters: config/zone_cloudlet.yaml.\n";

}  // namespace

int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--help" || argument == "-h") {
      std::cout << kUsage;
      return 0;
    }
    if (argument.find(":=") == std::string::npos) {
      std::cerr << "zone_cloudlet: unknown argument '" << argument << "', try --help\n";
      return 2;
    }
  }
  ros::init(argc, argv, "zone_cloudlet");
  try {
    ros::NodeHandle node;
    ros::NodeHandle private_node("~");
    livemap::ros_io::ParameterReader parameters(private_node);
    auto config =
        livemap::ros_io::ReadZoneCloudletConfig(parameters, ros::package::getPath("livemap"));
    if (config.json_log) livemap::nodes::LogAsJson("zone_cloudlet");
    // Before anything waits for the lease: a standby has the streets in memory already.
    config = livemap::nodes::WithStreets(std::move(config));
    std::optional<livemap::nodes::ZoneFailover> failover;
    if (config.lease_s > 0) {
      failover.emplace(node, private_node, config);
      if (!failover->AwaitLease()) return 0;
      config.zone.lease = failover->lease();
    }
    livemap::nodes::ZoneNode zone(node, private_node, config);
    if (failover) failover->SayActive();
    ros::spin();
  } catch (const std::exception& error) {
    livemap::nodes::LogTheEnd("zone_cloudlet", error.what());
    return 1;
  }
  return 0;
}
