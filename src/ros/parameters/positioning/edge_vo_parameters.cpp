#include "ros/parameters/positioning/edge_vo_parameters.h"

#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadVoEdges(ParameterReader& parameters, odometry::EdgeOdometry::Config& odometry) {
  parameters.Section("Edges and their depth");
  std::string edges = odometry::EdgeKindName(odometry.edges.kind);
  parameters.ReadChoice("edges", edges, {"canny", "log", "sobel", "structured"},
                        "Kind of edges: canny, log (Laplacian of Gaussian), sobel, or structured "
                        "with OpenCV's model file.");
  odometry.edges.kind = odometry::ParseEdgeKind(edges);
  parameters.Read("structured_model", odometry.edges.structured_model,
                  "OpenCV's model file of structured edges; needed with edges: structured only.");
  parameters.Read("strong_share", odometry.edges.strong_share, {0.001, 0.9},
                  "Share of the pixels whose gradient starts an edge.");
  parameters.Renamed("least_gradient", "min_gradient");
  parameters.Read("min_gradient", odometry.edges.min_gradient, {0, 255},
                  "Gradient below which no pixel starts an edge.", "grey levels per px");
  parameters.ReadChoice<odometry::EdgeSource>("edge_source", odometry.edge_source,
                                              {{"keyframe", odometry::EdgeSource::kKeyframe},
                                               {"new_image", odometry::EdgeSource::kNewImage}},
                                              "Whose edges choose the pixels: keyframe (extracted "
                                              "once), or new_image (thesis, equation 5.2).");
  parameters.Read("estimate_illumination", odometry.alignment.estimate_illumination,
                  "Whether gain and bias of the light between two images are estimated.");
  parameters.Read("max_iterations", odometry.alignment.max_iterations, {1, 100},
                  "Most steps of the alignment per level of the pyramid.");
  parameters.Read(
      "max_points", odometry.max_points[0], {100, 100000},
      "Most points of the finest level; the coarser levels have two thirds and a third of it.");
  // Coarser levels have fewer edges in the same proportion.
  odometry.max_points[1] = odometry.max_points[0] * 2 / 3;
  odometry.max_points[2] = odometry.max_points[0] / 3;
  parameters.Read("min_depth_m", odometry.depth_range.min_m, {0.01, 1000},
                  "Depth below this counts as unknown.", "m");
  parameters.Read("max_depth_m", odometry.depth_range.max_m, {0.01, 1000},
                  "Depth above this counts as unknown. It must be above min_depth_m.", "m");
  if (!(odometry.depth_range.min_m < odometry.depth_range.max_m)) {
    throw Error("parameter 'max_depth_m' is " + std::to_string(odometry.depth_range.max_m) +
                ", it must be above min_depth_m, " + std::to_string(odometry.depth_range.min_m));
  }
}

void ReadVoKeyframes(ParameterReader& parameters, odometry::EdgeOdometry::Config& odometry) {
  parameters.Section("Keyframes");
  parameters.Read(
      "keyframe_every", odometry.keyframe_every, {0, 10000},
      "A keyframe every so many frames; 1: frame to frame, 0: only by the rules that follow.");
  parameters.Read(
      "keyframe_overlap", odometry.keyframe_overlap, {0, 1},
      "A new keyframe is made when a smaller share than this of the keyframe's points is in view.");
  parameters.Read(
      "keyframe_motion", odometry.keyframe_motion, {0.001, 10},
      "A new keyframe is made when the points moved by more than this share of the image's width.");
  parameters.Read("keyframe_sigma_ratio", odometry.keyframe_sigma_ratio, {1, 100},
                  "A new keyframe is made when the residuals grew by this factor.");
  parameters.Read("keyframe_steps", odometry.keyframe_steps, {0, 1000},
                  "A camera so fast that one step moves the points by more than half of "
                  "keyframe_motion keeps its keyframe for so many steps; 0: every frame that "
                  "moved by keyframe_motion becomes one. "
                  "keyframe_max_motion may end this earlier.");
  parameters.Renamed("keyframe_most_motion", "keyframe_max_motion");
  parameters.Read("keyframe_max_motion", odometry.keyframe_max_motion, {0, 1},
                  "Such a fast camera keeps its keyframe at most until the points moved by this "
                  "share of the width.");
  parameters.Read("keyframes_kept", odometry.keyframes_kept, {2, 100},
                  "Number of keyframes that are kept to recover after tracking was lost.");
}

void ReadVoLoss(ParameterReader& parameters, odometry::EdgeOdometry::Config& odometry) {
  parameters.Section("Loss of tracking");
  parameters.Read("lost_sigma", odometry.lost_sigma, {1, 255},
                  "Residuals of this standard deviation mean that tracking is lost.",
                  "grey levels");
  parameters.Read("give_up_s", odometry.give_up_s, {0, 3600},
                  "When tracking has been lost for so long, it goes on from the held pose.", "s");
  parameters.Read("lost_speed_mps", odometry.lost_speed_mps, {0, 100},
                  "Growth of the held pose's uncertainty while lost: standard deviation of the "
                  "position after 1 s.",
                  "m");
  parameters.Read("lost_turn_rps", odometry.lost_turn_rps, {0, 100},
                  "Growth of the held pose's uncertainty while lost: standard deviation of the "
                  "rotation after 1 s.",
                  "rad");
}

void ReadVoEye(ParameterReader& parameters, EdgeVoConfig& config) {
  parameters.Section("One eye",
                     "Without depth the metres come from the first of these that there is: the "
                     "wheels' speed, the receiver's speed on gps/velocity, the fixes, the camera's "
                     "height over the road, which tf states.");
  parameters.ReadChoice("eye", config.eye, {"auto", "depth", "mono"},
                        "By what the camera is followed: depth (images with depth, of a depth "
                        "camera or of two eyes), mono (the images alone), or auto (depth where "
                        "depth images come together with the images, else mono). "
                        "vehicle.launch sets it by the argument `vo`.");
  parameters.Read("eye_wait_s", config.eye_wait_s, {0, 60},
                  "With eye: auto, images without depth for so long mean that there is none.", "s");
  parameters.Read("background_keyframes", config.background_keyframes,
                  "Whether one eye's keyframes are made on a thread of their own while images are "
                  "followed. False: within the image's time, so that a replay gives the same "
                  "poses again.");
  parameters.Read("wheel_velocity_topic", config.wheel_velocity_topic,
                  "Topic of the wheels' speed (geometry_msgs/TwistWithCovarianceStamped, the speed "
                  "is linear.x); empty: none.");
  parameters.Read("wheel_sigma_mps", config.wheel_sigma_mps, {0.001, 100},
                  "Standard deviation of the wheels' speed where the message states none.", "m/s");
  parameters.Read("receiver_sigma_mps", config.receiver_sigma_mps, {0.001, 100},
                  "Standard deviation of the receiver's speed where the message states none.",
                  "m/s");
}

void ReadVoMounting(ParameterReader& parameters, EdgeVoConfig& config) {
  parameters.Section("The camera's mounting",
                     "edge_vo finds out how the camera is mounted while the vehicle drives. Each "
                     "number replaces the one that tf states as soon as it is surer.");
  parameters.Read("calibrate_mounting", config.calibrate_mounting,
                  "Whether yaw, pitch, roll and height of the camera are estimated.");
  parameters.Read("mounting_file", config.mounting_file,
                  "File in which the mounting is kept from drive to drive; empty: none. "
                  "vehicle.launch sets it to a file in `directory`.");
  parameters.Read("mounting_sigma_rad", config.mounting_sigma_rad, {0.0001, 1},
                  "How sure tf's angles are, standard deviation.", "rad");
  parameters.Read("mounting_sigma_m", config.mounting_sigma_m, {0.001, 1},
                  "How sure tf's height is, standard deviation.", "m");
  parameters.Read("publish_mounting", config.publish_mounting,
                  "Whether a mounting that is surer replaces tf's, as a static transform of the "
                  "frame below base_frame. False where tf's mounting is published all the time, as "
                  "of a camera that moves.");
}

}  // namespace

EdgeVoConfig ReadEdgeVoConfig(ParameterReader& parameters) {
  EdgeVoConfig config;
  ReadVoEdges(parameters, config.odometry);
  ReadVoKeyframes(parameters, config.odometry);
  ReadVoLoss(parameters, config.odometry);
  ReadVoEye(parameters, config);
  ReadVoMounting(parameters, config);
  parameters.Section("Topics and frames");
  parameters.ReadChoice("sync", config.sync, {"exact", "approximate"},
                        "How image, depth and calibration are matched by their stamps.");
  parameters.Read("queue_size", config.queue_size, {1, 1000},
                  "Messages of each of the three topics that may wait for the others.");
  parameters.Read("waiting_frames", config.waiting_frames, {1, 1000},
                  "Frames that may wait while one is followed. When one more comes, the oldest is "
                  "left out and counted in frames_displaced: a longer queue only adds latency.");
  ReadDepthUnits(parameters, config.depth_units_per_m);
  parameters.Read("odom_frame", config.odom_frame, "Frame of the odometry, after REP 105.");
  parameters.Read("base_frame", config.base_frame, "Frame of the vehicle, after REP 105.");
  parameters.Read("publish_tf", config.publish_tf, "Whether tf odom -> base_link is published.");
  parameters.Read("path_spacing_m", config.path_spacing_m, {0, 1000},
                  "Distance after which a pose is added to vo/path.", "m");
  parameters.Read("path_max_poses", config.path_max_poses, {1, 1000000},
                  "Most poses of vo/path; beyond it the oldest goes.");
  parameters.Read("cloud_voxel_m", config.cloud_voxel_m, {0, 10},
                  "vo/points has one point per cube of this edge; 0: every point.", "m");
  parameters.Read("silence_warning_s", config.silence_warning_s, {0.1, 3600},
                  "Without a synchronised frame for so long, the log says which topic is missing.",
                  "s");
  ReadStampLimit(parameters, config.max_stamp_ahead_s);
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown({"image_transport"});
  return config;
}

}  // namespace livemap::ros_io
