#include "ros/parameters/hazard_detection_parameters.h"

#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadDetectionNetwork(ParameterReader& parameters, HazardDetectionConfig& config) {
  parameters.Section("Network");
  parameters.ReadRequired("model", config.model, "models/hazards-base.yaml",
                          "Path of the model's manifest, models/NAME.yaml. The launch files set it "
                          "by the argument `model`.");
  parameters.Read(
      "engine", config.engine,
      "Library that runs the network: opencv, torch (libtorch, which needs the manifest's "
      "torch_file), or auto, which takes the manifest's choice. The results of the two libraries "
      "agree to 1e-3; docs/results/perception.md compares their speed.");
  parameters.Read("engines", config.engines, {1, 64},
                  "Number of networks that work side by side on images in turn, each on its own "
                  "thread and with its own copy of the weights. Results keep the order of the "
                  "images. No frame is dropped while engines / latency >= frame rate.");
  parameters.Read(
      "threads", config.threads, {0, 256},
      "Threads of each engine. torch's threads are its own: engines x threads of them compute at "
      "once, so a machine with N cores wants engines x threads <= N. OpenCV's threads are one pool "
      "for all nodelets of the manager. 0: one thread per core (OpenCV: its pool stays as it is).");
  parameters.Read("queue_size", config.queue_size, {1, 1000},
                  "Number of images that may wait while the engines are at work. With several "
                  "engines, as many more results may wait for an earlier image's result. When one "
                  "more image comes, the oldest is dropped and counted in frames_dropped: for a "
                  "live map the newest image is worth most. A longer queue only adds latency.");
  parameters.Read("all_views_hz", config.all_views_hz, {0, 1000},
                  "How often a second, by the images' stamps, a model that looks at images several "
                  "times does so. It looks once at those between, which takes less than half the "
                  "time: they show nearly the same, and others need the cores too. Needs a model "
                  "whose engine computes views apart (precision int8). 0: always all views.",
                  "Hz");
  parameters.Read("one_view_from_waiting", config.one_view_from_waiting, {0, 1000},
                  "While at least this many images wait, a model that looks at each image several "
                  "times looks once, which takes less than half the time: rather one look than a "
                  "dropped image. frames_in_one_view counts them. It needs a model whose engine "
                  "computes views apart (precision int8). 0: always all views.");
  ListImageTransport(parameters,
                     " Inside the manager raw images move by pointer. compressed is for a camera "
                     "on another machine; the receiving thread decodes.");
}

void ReadDetectionPictures(ParameterReader& parameters, HazardDetectionConfig& config) {
  parameters.Section("Pictures");
  parameters.Read("annotate_empty", config.annotate_empty,
                  "Publish hazard/annotated also for images in which nothing was found. Drawing "
                  "copies the image.");
  parameters.Removed("picture_frames",
                     "hazard_reporting keeps the images, as many as its own picture_frames says");
  parameters.Section("Faces and number plates");
  ReadPrivacy(parameters, config.privacy, config.mask,
              "Mask faces and number plates in hazard/annotated, which does not leave the vehicle. "
              "A picture that cannot be masked is not published. The pictures that leave the "
              "vehicle are hazard_reporting's: its own parameter says whether they are masked.");
}

void ReadDetectionTracking(ParameterReader& parameters, HazardTrackingConfig& config) {
  perception::ObjectTracker::Config& tracker = config.tracker;
  parameters.Section("Tracking");
  parameters.Read("tracking", config.tracking,
                  "Follow objects from image to image and publish each once on hazard/events "
                  "(livemap/DetectionArray), with the header of its best view's image. "
                  "hazard/detections keeps the detections of single images. vehicle.launch sets it "
                  "by the argument `tracking`, which is false.");
  parameters.Read("track_low_share", tracker.low_share, {0.01, 1},
                  "Share of the class's threshold from which detections take part in tracking.");
  parameters.Read(
      "track_sure", tracker.sure, {0.01, 100},
      "An object is reported when its evidence reaches this multiple of its class's threshold. The "
      "evidence is its best confidence plus track_repeat_gain times the sum of its other sights'. "
      "A larger value gives fewer false events and less recall.");
  parameters.Read("track_repeat_gain", tracker.repeat_gain, {0, 1},
                  "Share of further sights in the evidence.");
  parameters.Read(
      "track_max_delay_s", tracker.max_delay_s, {0, 60},
      "Longest time from being sure to being reported. Until then a better view may come.", "s");
  parameters.ReadMap(
      "track_class_max_delay_s", tracker.class_max_delay_s, {0, 60},
      "The same of single classes. 0 reports at once: drivers must know these hazards at once.",
      "s");
  parameters.Read("track_max_unseen_s", tracker.max_unseen_s, {0, 60},
                  "An object that was not recognised for this long has left the view.", "s");
  parameters.Read("track_max_unseen_m", tracker.max_unseen_m, {0, 1000},
                  "An object that was not recognised over this distance driven has left the view.",
                  "m");
  parameters.Read("track_good_range_m", tracker.good_range_m, {0.1, 1000},
                  "Views from nearer than this are equally good. Farther views lose.", "m");
  parameters.Read("track_max", tracker.max_tracks, {1, 10000},
                  "Number of objects followed at once. Beyond it the object with the least "
                  "evidence is forgotten.");
  parameters.Read("motion_frame", config.motion_frame,
                  "tf frame in which the camera moves. Without that tf, or without "
                  "camera_rect/camera_info, boxes are followed by their velocity in the image.");
  parameters.Read(
      "base_frame", config.base_frame,
      "Frame of the vehicle at road level, whose motion in motion_frame is the camera's.");
  parameters.Read("motion_max_age_s", config.motion_max_age_s, {0, 10},
                  "Where tf has no pose at an image's stamp, the newest pose serves if it is no "
                  "older than this.",
                  "s");
}

}  // namespace

HazardDetectionConfig ReadHazardDetectionConfig(ParameterReader& parameters) {
  HazardDetectionConfig config;
  ReadDetectionNetwork(parameters, config);
  ReadDetectionPictures(parameters, config);
  ReadDetectionTracking(parameters, config.tracking);
  parameters.Section("Period of the diagnostics");
  ReadStampLimit(parameters, config.max_stamp_ahead_s);
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s, 0.1);
  parameters.RejectUnknown({"diagnostic_period"});
  if (config.model.empty()) {
    throw Error(
        "parameter 'model' is empty, accepted is the path of a model manifest (models/NAME.yaml)");
  }
  return config;
}

}  // namespace livemap::ros_io
