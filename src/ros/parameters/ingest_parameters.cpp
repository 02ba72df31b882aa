#include "ros/parameters/ingest_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadStereo(ParameterReader& parameters, IngestConfig& config) {
  parameters.Read("stereo", config.stereo);
  parameters.Read("stereo_sync_s", config.stereo_sync_s, {0, 1});
  parameters.Read("stereo_wait_s", config.stereo_wait_s, {0, 10});
  imaging::StereoConfig& matching = config.matching;
  parameters.Read("stereo_min_depth_m", matching.min_depth_m, {0.01, 1000});
  parameters.Read("stereo_min_disparity_px", matching.min_disparity_px, {0.1, 100});
  parameters.Read("stereo_scale", matching.scale, {1, 4});
  parameters.Read("stereo_block_size", matching.block_size, {1, 21});
  parameters.Read("stereo_uniqueness_percent", matching.uniqueness_percent, {0, 100});
  parameters.Read("stereo_left_right_px", matching.left_right_px, {0, 100});
  parameters.Read("stereo_speckle_pixels", matching.speckle_pixels, {0, 100000});
  imaging::CheckStereoConfig(matching);
}

}  // namespace

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
  ReadStereo(parameters, config);
  parameters.RejectUnknown();

  if (config.source == IngestSource::kTopic) return config;
  if (config.stereo) {
    throw Error("parameter 'stereo' is true with source '" + source +
                "', a right camera is read from topics only");
  }
  if (config.uri.empty()) {
    throw Error("parameter 'uri' is empty, with source '" + source + "' it names the " + source);
  }
  if (config.camera_info_url.empty()) {
    throw Error("parameter 'camera_info_url' is empty, with source '" + source +
                "' it names the calibration file, e.g. file:///etc/livemap/camera.yaml");
  }
  return config;
}

}  // namespace livemap::ros_io
