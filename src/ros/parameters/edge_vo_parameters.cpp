#include "ros/parameters/edge_vo_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadOdometry(ParameterReader& parameters, odometry::EdgeOdometry::Config& odometry) {
  std::string edges = odometry::EdgeKindName(odometry.edges.kind);
  parameters.ReadChoice("edges", edges, {"canny", "log", "sobel", "structured"});
  odometry.edges.kind = odometry::ParseEdgeKind(edges);
  parameters.Read("structured_model", odometry.edges.structured_model);
  parameters.Read("strong_share", odometry.edges.strong_share, {0.001, 0.9});
  parameters.Read("least_gradient", odometry.edges.min_gradient, {0, 255});
  std::string source = "keyframe";
  parameters.ReadChoice("edge_source", source, {"keyframe", "new_image"});
  odometry.edge_source =
      source == "keyframe" ? odometry::EdgeSource::kKeyframe : odometry::EdgeSource::kNewImage;
  parameters.Read("estimate_illumination", odometry.alignment.estimate_illumination);
  parameters.Read("max_iterations", odometry.alignment.max_iterations, {1, 100});
  parameters.Read("max_points", odometry.max_points[0], {100, 100000});
  // Coarser levels have fewer edges in the same proportion.
  odometry.max_points[1] = odometry.max_points[0] * 2 / 3;
  odometry.max_points[2] = odometry.max_points[0] / 3;
  double nearest_m = odometry.depth_range.min_m, farthest_m = odometry.depth_range.max_m;
  parameters.Read("min_depth_m", nearest_m, {0.01, 1000});
  parameters.Read("max_depth_m", farthest_m, {0.01, 1000});
  if (!(nearest_m < farthest_m)) {
    throw Error("parameter 'max_depth_m' is " + std::to_string(farthest_m) +
                ", it must be above min_depth_m, " + std::to_string(nearest_m));
  }
  odometry.depth_range = {static_cast<float>(nearest_m), static_cast<float>(farthest_m)};
  parameters.Read("keyframe_every", odometry.keyframe_every, {0, 10000});
  parameters.Read("keyframe_overlap", odometry.keyframe_overlap, {0, 1});
  parameters.Read("keyframe_motion", odometry.keyframe_motion, {0.001, 10});
  parameters.Read("keyframe_steps", odometry.keyframe_steps, {0, 1000});
  parameters.Read("keyframe_most_motion", odometry.keyframe_most_motion, {0, 1});
  parameters.Read("keyframe_sigma_ratio", odometry.keyframe_sigma_ratio, {1, 100});
  parameters.Read("keyframes_kept", odometry.keyframes_kept, {2, 100});
  parameters.Read("give_up_s", odometry.give_up_s, {0, 3600});
  parameters.Read("lost_sigma", odometry.lost_sigma, {1, 255});
  parameters.Read("lost_speed_mps", odometry.lost_speed_mps, {0, 100});
  parameters.Read("lost_turn_rps", odometry.lost_turn_rps, {0, 100});
}

}  // namespace

EdgeVoConfig ReadEdgeVoConfig(ParameterReader& parameters) {
  EdgeVoConfig config;
  ReadOdometry(parameters, config.odometry);
  parameters.ReadChoice("sync", config.sync, {"exact", "approximate"});
  parameters.Read("queue_size", config.queue_size, {1, 1000});
  parameters.Read("depth_units_per_m", config.depth_units_per_m, {1, 1e6});
  parameters.Read("odom_frame", config.odom_frame);
  parameters.Read("base_frame", config.base_frame);
  parameters.Read("publish_tf", config.publish_tf);
  parameters.Read("path_spacing_m", config.path_spacing_m, {0, 1000});
  parameters.Read("path_max_poses", config.path_max_poses, {1, 1000000});
  parameters.Read("cloud_voxel_m", config.cloud_voxel_m, {0, 10});
  parameters.Read("silence_warning_s", config.silence_warning_s, {0.1, 3600});
  parameters.Read("diagnostics_period_s", config.diagnostics_period_s, {0.05, 60});
  parameters.RejectUnknown({"image_transport"});
  return config;
}

}  // namespace livemap::ros_io
