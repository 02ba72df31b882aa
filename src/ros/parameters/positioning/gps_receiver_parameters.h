#pragma once

#include <string>

#include "receiver/gpsd_client.h"
#include "receiver/receiver_watch.h"
#include "ros/parameters/shared/parameter_reader.h"

namespace livemap::ros_io {

/// Defaults of the gps_receiver nodelet; the reader states their meanings.
struct GpsReceiverConfig {
  receiver::GpsdConfig gpsd;
  receiver::ReceiverWatch::Config watch;
  std::string frame = "gps";  ///< Of the antenna.
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error.
GpsReceiverConfig ReadGpsReceiverConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
