#include "ros/parameters/early_discard_parameters.h"

#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadDiscardClassifier(ParameterReader& parameters, EarlyDiscardConfig& config) {
  parameters.Section("Classifier");
  parameters.ReadRequired(
      "model", config.model, "models/early-discard.yaml",
      "Path of the classifier's manifest, whose head has the type score. vehicle.launch sets it by "
      "the argument `discard_model`, whose default is models/early-discard.yaml.");
  if (config.model.empty()) {
    throw Error("parameter 'model' is empty, accepted is the path of a model manifest");
  }
  parameters.Read(
      "threshold", config.threshold, {-1, 1},
      "Least score of a frame that is sent, 0 to 1. Below 0: the manifest's threshold.");
  parameters.Read("threads", config.threads, {0, 256},
                  "OpenCV's threads, one pool for the whole nodelet manager. 0: all cores.");
  parameters.Read("queue_size", config.queue_size, {1, 1000},
                  "Number of frames that may wait for the classifier. When one more comes, the "
                  "oldest frame is dropped and counted.");
  parameters.Read("rate_hz", config.sender.rate_hz, {0.1, 60},
                  "Frames per second that the classifier looks at.", "Hz");
  ListImageTransport(parameters);
}

void ReadDiscardSender(ParameterReader& parameters, EarlyDiscardConfig& config,
                       std::int64_t now_ns) {
  vehicle::OffloadSender::Config& sender = config.sender;
  parameters.Section("Frames that leave the vehicle");
  parameters.Read("min_spacing_m", sender.min_spacing_m, {0, 1000},
                  "Road between two frames that are sent. A standing vehicle sends nothing new.",
                  "m");
  parameters.Read("max_bytes_per_s", sender.max_bytes_per_s, {1000, 10e6},
                  "Bytes of pictures per second in the long run. 60000 bytes/s are 0.48 Mbit/s.",
                  "bytes/s");
  parameters.Read("burst_s", sender.burst_s, {1, 600},
                  "Unused bytes of this time may be spent at once.", "s");
  parameters.Read("max_image_bytes", sender.max_image_bytes, {1000, 1e6},
                  "Size of one picture, where that much is left. JPEG quality, then size are "
                  "lowered to meet it.",
                  "bytes");
  parameters.Read("min_image_bytes", sender.min_image_bytes, {1, 1e6},
                  "A frame for which less than this is left is dropped and counted.", "bytes");
  parameters.Read("jpeg_quality", config.jpeg_quality, {1, 100},
                  "JPEG quality of a picture where the bytes suffice.");
  parameters.Read(
      "max_waiting_frames", sender.max_waiting_frames, {1, 1000},
      "Number of frames that may wait for their position. Beyond it the oldest frame is dropped.");
  sender.drive_id = ReadDriveId(parameters, now_ns);
}

}  // namespace

EarlyDiscardConfig ReadEarlyDiscardConfig(ParameterReader& parameters, std::int64_t now_ns) {
  EarlyDiscardConfig config;
  ReadDiscardClassifier(parameters, config);
  ReadDiscardSender(parameters, config, now_ns);
  parameters.Section("Faces and number plates");
  ReadPrivacy(parameters, config.privacy, config.mask,
              "Mask faces and number plates before a frame leaves the vehicle. A frame that cannot "
              "be masked is withheld and counted.");
  parameters.Section(
      "Position of the vehicle at the image's stamp",
      "The parameters are those of hazard_reporting. The camera's mounting comes from tf "
      "(base_frame to the frame_id of the images), its focal length from camera_rect/camera_info.");
  parameters.Read("base_frame", config.base_frame, "Frame at road level: x forward, y left, z up.");
  parameters.Read("map_frame", config.map_frame, "Frame of the fused poses.");
  ReadBasePoseSource(parameters, config.sender.pose);
  parameters.Section("Period of the diagnostics");
  ReadStampLimit(parameters, config.sender.pose.fixes.stamps.max_ahead_s);
  config.sender.pose.poses.stamps = config.sender.pose.fixes.stamps;
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown({"diagnostic_period"});
  return config;
}

}  // namespace livemap::ros_io
