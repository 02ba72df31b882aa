#include "tools/bags/sequence_bag.h"

#include <cv_bridge/cv_bridge.h>
#include <geometry_msgs/PoseStamped.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <limits>

#include "datasets/image_file.h"
#include "tools/bags/bag_messages.h"
#include "tools/bags/bag_writer.h"
#include "tools/bags/drive_bag.h"
#include "tools/common/command_line.h"
#include "tools/common/progress.h"

namespace livemap::tools {
namespace {

ros::Time SequenceStamp(std::int64_t stamp_ns, const ros::Duration& start) {
  ros::Time stamp;
  stamp.fromNSec(static_cast<std::uint64_t>(stamp_ns));
  return stamp + start;
}

std_msgs::Header SequenceHeader(const ros::Time& stamp) {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = kOpticalFrame;
  return header;
}

sensor_msgs::ImagePtr ReadSequenceColour(const std::string& path, geo::CameraIntrinsics& intrinsics,
                                         const ros::Time& stamp) {
  const cv::Mat image = datasets::ReadPictureFile(path, intrinsics.width, intrinsics.height,
                                                  imaging::DecodeConfig::Pixels::kGreyOrColour);
  intrinsics.width = image.cols;
  intrinsics.height = image.rows;
  const std::string encoding = image.channels() == 1 ? sensor_msgs::image_encodings::MONO8
                                                     : sensor_msgs::image_encodings::BGR8;
  return cv_bridge::CvImage(SequenceHeader(stamp), encoding, image).toImageMsg();
}

/// Depth in metres, NaN where the sensor saw nothing (REP 118).
sensor_msgs::ImagePtr ReadSequenceDepth(const datasets::SequenceFrame& frame,
                                        const geo::CameraIntrinsics& intrinsics, double depth_scale,
                                        const ros::Time& stamp) {
  const cv::Mat raw =
      datasets::ReadDepthFile(frame.depth_path, intrinsics.width, intrinsics.height);
  cv::Mat metres;
  raw.convertTo(metres, CV_32FC1, 1 / depth_scale);
  metres.setTo(std::numeric_limits<float>::quiet_NaN(), raw == 0);
  return cv_bridge::CvImage(SequenceHeader(stamp), sensor_msgs::image_encodings::TYPE_32FC1, metres)
      .toImageMsg();
}

/// The right camera's picture with the stamp of the first one's.
void WriteSequenceRight(const datasets::Sequence& sequence, const datasets::SequenceFrame& frame,
                        geo::CameraIntrinsics& intrinsics, const ros::Time& stamp, BagWriter& bag) {
  if (frame.right_path.empty() || !(sequence.baseline_m > 0)) return;
  const sensor_msgs::ImagePtr image = ReadSequenceColour(frame.right_path, intrinsics, stamp);
  sensor_msgs::CameraInfo info = PinholeCameraInfo(intrinsics);
  info.header.stamp = stamp;
  info.P[3] = -intrinsics.fx * sequence.baseline_m;
  bag.Write("/camera_right/camera_info", stamp, info);
  bag.Write("/camera_right/image_raw", stamp, *image);
}

void WriteSequencePose(const datasets::StampedPose& pose, const ros::Duration& start,
                       BagWriter& bag) {
  const ros::Time stamp = SequenceStamp(pose.stamp_ns, start);
  const Eigen::Quaterniond rotation(pose.world_from_camera.linear());
  const Eigen::Vector3d position = pose.world_from_camera.translation();
  geometry_msgs::PoseStamped truth;
  truth.header.stamp = stamp;
  truth.header.frame_id = "world";
  truth.pose.position.x = position.x();
  truth.pose.position.y = position.y();
  truth.pose.position.z = position.z();
  truth.pose.orientation.x = rotation.x();
  truth.pose.orientation.y = rotation.y();
  truth.pose.orientation.z = rotation.z();
  truth.pose.orientation.w = rotation.w();
  bag.Write("/ground_truth/pose", stamp, truth);

  geometry_msgs::TransformStamped transform;
  transform.header = truth.header;
  transform.child_frame_id = kOpticalFrame;
  transform.transform.translation.x = position.x();
  transform.transform.translation.y = position.y();
  transform.transform.translation.z = position.z();
  transform.transform.rotation = truth.pose.orientation;
  tf2_msgs::TFMessage transforms;
  transforms.transforms.push_back(transform);
  bag.Write("/tf", stamp, transforms);
}

}  // namespace

void WriteSequenceBag(const datasets::Sequence& sequence, const std::string& path,
                      const ros::Duration& start) {
  BagWriter bag(path, BagWriter::Compression::kLz4);
  geo::CameraIntrinsics intrinsics = sequence.intrinsics;
  Progress progress("frame", sequence.frames.size());
  std::size_t next_pose = 0;
  const auto write_poses_until = [&](std::int64_t stamp_ns) {
    for (; next_pose < sequence.poses.size(); ++next_pose) {
      if (sequence.poses[next_pose].stamp_ns > stamp_ns) return;
      WriteSequencePose(sequence.poses[next_pose], start, bag);
    }
  };
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const datasets::SequenceFrame& frame = sequence.frames[i];
    write_poses_until(frame.stamp_ns);
    const ros::Time stamp = SequenceStamp(frame.stamp_ns, start);
    const sensor_msgs::ImagePtr image = ReadSequenceColour(frame.image_path, intrinsics, stamp);
    sensor_msgs::CameraInfo info = PinholeCameraInfo(intrinsics);
    info.header.stamp = stamp;
    bag.Write("/camera/camera_info", stamp, info);
    bag.Write("/camera/image_raw", stamp, *image);
    WriteSequenceRight(sequence, frame, intrinsics, stamp, bag);
    if (!frame.depth_path.empty()) {
      const ros::Time depth_stamp = SequenceStamp(frame.depth_stamp_ns, start);
      info.header.stamp = depth_stamp;
      bag.Write("/camera/depth/camera_info", depth_stamp, info);
      bag.Write("/camera/depth/image_raw", depth_stamp,
                *ReadSequenceDepth(frame, intrinsics, sequence.depth_scale, depth_stamp));
    }
    progress.At(i + 1);
  }
  write_poses_until(std::numeric_limits<std::int64_t>::max());
  bag.Finish();
}

}  // namespace livemap::tools
