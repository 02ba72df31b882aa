#include "ros/parameters/positioning/gps_receiver_parameters.h"

#include "common/error.h"
#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadReceiverConnection(ParameterReader& parameters, receiver::GpsdConfig& gpsd) {
  parameters.Section("gpsd");
  parameters.Read("host", gpsd.host, "Name or address of the computer that runs gpsd.");
  if (gpsd.host.empty()) {
    throw Error("parameter 'host' is empty, accepted is the name or address of gpsd's computer");
  }
  parameters.Read("port", gpsd.port, {1, 65535}, "Port of gpsd.");
  parameters.Read("device", gpsd.device,
                  "The only receiver to listen to, by gpsd's name of it, such as /dev/ttyACM0; "
                  "empty: any, one at a time.");
  // What libgps holds for its name.
  constexpr std::size_t kMaxDeviceBytes = 127;
  if (gpsd.device.size() > kMaxDeviceBytes ||
      gpsd.device.find_first_of("\"\\\n\r") != std::string::npos) {
    throw Error("parameter 'device' is '" + gpsd.device +
                "', accepted are at most 127 characters without quotes, backslashes and line ends");
  }
  parameters.Read("connect_timeout_s", gpsd.connect_timeout_s, {0.1, 600},
                  "Longest wait for a connection, and for the first word of gpsd.", "s");
  parameters.Read("reconnect_min_s", gpsd.reconnect_min_s, {0.01, 3600},
                  "First wait after a lost connection; it doubles up to reconnect_max_s.", "s");
  parameters.Read("reconnect_max_s", gpsd.reconnect_max_s, {0.01, 3600},
                  "Longest wait between two attempts to connect. At least reconnect_min_s.", "s");
  if (gpsd.reconnect_max_s < gpsd.reconnect_min_s) {
    throw Error("parameter 'reconnect_max_s' is " + std::to_string(gpsd.reconnect_max_s) +
                ", it must be at least reconnect_min_s, " + std::to_string(gpsd.reconnect_min_s));
  }
}

void ReadReceiverMeasurements(ParameterReader& parameters, receiver::ReceiverWatch::Config& watch) {
  parameters.Section("Measurements");
  parameters.Read("silence_s", watch.silence_s, {0.5, 600},
                  "A receiver that says nothing for longer is silent. gpsd, too, is asked then "
                  "whether it lives.",
                  "s");
  parameters.Read("max_clock_offset_s", watch.max_clock_offset_s, {0.05, 1e9},
                  "Fixes are withheld while this computer's clock and the receiver's are further "
                  "apart. Images are stamped by the former: at 14 m/s a second is 14 m.",
                  "s");
  parameters.Read("error_sigmas", watch.conversion.error_sigmas, {0.1, 10},
                  "How many standard deviations an error estimate of gpsd is. gpsd guesses that "
                  "its estimates have a confidence of 95 %; set 1 for a receiver whose own "
                  "estimates are standard deviations.");
  parameters.Read(
      "velocity_sigma_mps", watch.conversion.velocity_sigma_mps, {0, 100},
      "Standard deviation of the velocity along each axis of the plane, by the "
      "receiver's data sheet; 0: gpsd's estimate, which is far too large for a receiver "
      "that states none itself.",
      "m/s");
  parameters.Read("max_speed_mps", watch.conversion.max_speed_mps, {1, 1000},
                  "A velocity above it is refused. A fix that needs one is counted as a jump and "
                  "published: those who know the track judge it.",
                  "m/s");
}

}  // namespace

GpsReceiverConfig ReadGpsReceiverConfig(ParameterReader& parameters) {
  GpsReceiverConfig config;
  ReadReceiverConnection(parameters, config.gpsd);
  ReadReceiverMeasurements(parameters, config.watch);
  config.watch.device = config.gpsd.device;
  config.gpsd.silence_s = config.watch.silence_s;
  parameters.Section("Messages");
  parameters.Read("frame", config.frame, "Frame of the antenna, in all messages.");
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown();
  return config;
}

}  // namespace livemap::ros_io
