#include "ros/ingest_parameters.h"

namespace livemap {

IngestConfig ReadIngestConfig(ParameterReader& parameters) {
  IngestConfig config;
  std::string source = "topic";
  parameters.ReadChoice("source", source, {"topic", "device", "video", "folder"});
  config.source = source == "topic"    ? IngestSource::kTopic
                  : source == "device" ? IngestSource::kDevice
                  : source == "video"  ? IngestSource::kVideo
                                       : IngestSource::kFolder;
  parameters.ReadChoice("transport", config.transport, {"raw", "compressed"});
  parameters.Read("uri", config.uri);
  parameters.Read("rate_hz", config.rate_hz, {0.01, 1000});
  parameters.ReadChoice("stamps", config.stamps, {"wall", "file_order"});
  std::string at_end = "stay";
  parameters.ReadChoice("at_end", at_end, {"stay", "loop", "shutdown"});
  config.at_end = at_end == "stay"   ? IngestAtEnd::kStay
                  : at_end == "loop" ? IngestAtEnd::kLoop
                                     : IngestAtEnd::kShutdown;
  parameters.Read("frame_id", config.frame_id);
  parameters.Read("camera_info_url", config.camera_info_url);
  parameters.Read("output_width", config.output_width, {0, 16384});
  parameters.Read("output_height", config.output_height, {0, 16384});
  parameters.Read("queue_size", config.queue_size, {1, 1000});
  parameters.Read("subscriber_queue_size", config.subscriber_queue_size, {1, 100000});
  parameters.Read("calibration_wait_s", config.calibration_wait_s, {0, 60});
  parameters.Read("max_megapixels", config.max_megapixels, {0.001, 268});
  parameters.Read("diagnostics_period_s", config.diagnostics_period_s, {0.05, 60});
  parameters.RejectUnknown();

  if (config.source == IngestSource::kTopic) return config;
  if (config.uri.empty()) {
    throw Error("parameter 'uri' is empty, with source '" + source + "' it names the " + source);
  }
  if (config.camera_info_url.empty()) {
    throw Error("parameter 'camera_info_url' is empty, with source '" + source +
                "' it names the calibration file, e.g. file:///etc/livemap/camera.yaml");
  }
  return config;
}

}  // namespace livemap
