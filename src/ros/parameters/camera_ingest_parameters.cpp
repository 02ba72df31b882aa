#include "ros/parameters/camera_ingest_parameters.h"

#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadIngestSource(ParameterReader& parameters, IngestConfig& config) {
  parameters.Section("Source");
  parameters.ReadChoice<IngestSource>(
      "source", config.source,
      {{"topic", IngestSource::kTopic},
       {"device", IngestSource::kDevice},
       {"video", IngestSource::kVideo},
       {"folder", IngestSource::kFolder}},
      "Where the images come from. topic: camera/image_raw (or camera/image_raw/compressed) with "
      "camera/camera_info. device: a V4L2 camera, uri: /dev/video0. video: a video file, uri: "
      "/path/drive.mp4. folder: the .jpg and .png files of a folder in the order of their names, "
      "uri: /path/images.");
  parameters.ReadChoice(
      "transport", config.transport, {"raw", "compressed"},
      "Transport of a source topic. The nodelet's own worker decodes compressed images.");
  parameters.Read("uri", config.uri,
                  "Path of the device, video file or folder. A source topic does not use it.");
  parameters.Read("rate_hz", config.rate_hz, {0.01, 1000},
                  "Frames per second of a folder, and of a video whose header names no rate.",
                  "Hz");
  parameters.ReadChoice(
      "stamps", config.stamps, {"wall", "file_order"},
      "Stamps of the frames of a video or folder: wall (ROS time when the frame is read) or "
      "file_order (ROS time at the start plus frame number / rate). Images of a topic keep their "
      "stamps. A device's frames get the time at which its driver says that they were taken, else "
      "that of their arrival.");
  parameters.ReadChoice<IngestAtEnd>(
      "at_end", config.at_end,
      {{"stay", IngestAtEnd::kStay},
       {"loop", IngestAtEnd::kLoop},
       {"shutdown", IngestAtEnd::kShutdown}},
      "What happens at the end of a video or folder: stay (diagnostics go on), loop, or shutdown "
      "(of the nodelet manager).");
  parameters.Read("frame_id", config.frame_id,
                  "frame_id of the images of a device, video or folder.");
  parameters.Read("camera_info_url", config.camera_info_url,
                  "Calibration of a device, video or folder, in the ROS calibration YAML format, "
                  "for example file:///etc/livemap/camera.yaml.");
}

void ReadIngestDevice(ParameterReader& parameters, imaging::DeviceConfig& device) {
  using imaging::DeviceFormat;
  parameters.Section("Device");
  parameters.Read("device_width", device.width, {0, 16384},
                  "Width of the images that a device is asked for. 0: the calibration's. A device "
                  "that gives another size is refused until it gives this one.",
                  "px");
  parameters.Read("device_height", device.height, {0, 16384},
                  "Height of the images that a device is asked for. 0: the calibration's.", "px");
  parameters.Read("device_rate_hz", device.rate_hz, {0, 1000},
                  "Frames per second that a device is asked for. 0: as it is set. The device may "
                  "give fewer, as in the dark; diagnostics say what comes.",
                  "Hz");
  parameters.ReadChoice<DeviceFormat>(
      "device_format", device.format,
      {{"mjpeg", DeviceFormat::kMjpeg}, {"yuyv", DeviceFormat::kYuyv}, {"any", DeviceFormat::kAny}},
      "How a device sends its images. mjpeg: as JPEG, which USB 2 wants for large images at 30 Hz. "
      "yuyv: uncompressed. any: as it is set.");
  parameters.Read("device_exposure_ms", device.exposure_ms, {0, 1000},
                  "Exposure time of a device. 0: the camera chooses. At 50 km/h the road moves "
                  "14 mm in 1 ms.",
                  "ms");
}

void ReadIngestOutput(ParameterReader& parameters, IngestConfig& config) {
  parameters.Section("Output");
  parameters.Read("output_width", config.output_width, {0, 16384},
                  "Width of the published image. 0 keeps the input's width, or the aspect ratio "
                  "when output_height is given. camera_rect/camera_info is scaled with the image.",
                  "px");
  parameters.Read("output_height", config.output_height, {0, 16384},
                  "Height of the published image. 0 keeps the input's height, or the aspect ratio "
                  "when output_width is given.",
                  "px");
  parameters.Section("Queues and limits");
  parameters.Read("queue_size", config.queue_size, {1, 1000},
                  "Number of frames that may wait for the worker. When one more comes, the oldest "
                  "frame is dropped and counted.");
  parameters.Read("subscriber_queue_size", config.subscriber_queue_size, {1, 100000},
                  "Number of messages that ROS itself may hold. The callback only enqueues, so "
                  "this queue fills only while all threads of the manager are busy. It is large so "
                  "that ROS drops no frame uncounted.");
  parameters.Read("calibration_wait_s", config.calibration_wait_s, {0, 60},
                  "Time that a frame waits for the first camera_info of its frame_id.", "s");
  parameters.Read("max_megapixels", config.max_megapixels, {0.001, 268},
                  "Larger images are refused by their header, before decoding.", "millions of px");
  ReadStampLimit(parameters, config.max_stamp_ahead_s);
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
}

void ReadIngestStereo(ParameterReader& parameters, IngestConfig& config) {
  parameters.Section("Stereo: depth from a right camera");
  parameters.Read("stereo", config.stereo,
                  "Compute depth from camera_right/image_raw (`transport` holds for both cameras) "
                  "with camera_right/camera_info, calibrated with the left camera. The nodelet "
                  "publishes camera_rect/depth/image_raw while somebody subscribes. Only a source "
                  "topic can be stereo. vehicle.launch sets it by the argument `stereo`.");
  parameters.Read("stereo_sync_s", config.stereo_sync_s, {0, 1},
                  "Largest difference of the stamps of a pair. 0 means exactly equal: the cameras "
                  "share a trigger.",
                  "s");
  parameters.Read("stereo_wait_s", config.stereo_wait_s, {0, 10},
                  "Time that the depth of a left image waits for the right image.", "s");
  imaging::StereoConfig& matching = config.matching;
  parameters.Read(
      "stereo_min_depth_m", matching.min_depth_m, {0.01, 1000},
      "Least depth of the search. A nearer object is not recognised and may get a false depth.",
      "m");
  parameters.Read("stereo_min_disparity_px", matching.min_disparity_px, {0.1, 100},
                  "Depth is unknown where the disparity is smaller than this, in pixels of the "
                  "published image. Depth is fx * baseline / disparity, and a disparity is wrong "
                  "by some tenths of a pixel.",
                  "px");
  parameters.Read(
      "stereo_scale", matching.scale, {1, 4},
      "The images are matched at a size smaller by 1, 2 or 4. 2 takes a quarter of the time of 1.");
  parameters.Read("stereo_block_size", matching.block_size, {1, 21},
                  "Side of the compared blocks of the semi-global matching (OpenCV's StereoSGBM), "
                  "an odd number, in pixels of the matched image.",
                  "px");
  parameters.Read("stereo_uniqueness_percent", matching.uniqueness_percent, {0, 100},
                  "Margin by which the best match must beat the second best.", "%");
  parameters.Read("stereo_left_right_px", matching.left_right_px, {0, 100},
                  "Largest difference between the left and the right camera's match, in pixels of "
                  "the matched image.",
                  "px");
  parameters.Read("stereo_speckle_pixels", matching.speckle_pixels, {0, 100000},
                  "Islands of depth with fewer pixels of the matched image than this are removed.",
                  "px");
  imaging::CheckStereoConfig(matching);
}

const char* IngestSourceName(IngestSource source) {
  return source == IngestSource::kDevice  ? "device"
         : source == IngestSource::kVideo ? "video"
                                          : "folder";
}

}  // namespace

IngestConfig ReadIngestConfig(ParameterReader& parameters) {
  IngestConfig config;
  ReadIngestSource(parameters, config);
  ReadIngestDevice(parameters, config.device);
  ReadIngestOutput(parameters, config);
  ReadIngestStereo(parameters, config);
  parameters.RejectUnknown();

  if (config.source == IngestSource::kTopic) return config;
  const std::string source = IngestSourceName(config.source);
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
