#include "ros/conversions/positioning/odometry_conversions.h"

#include <pcl/filters/voxel_grid.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl_conversions/pcl_conversions.h>
#include <tf2_eigen/tf2_eigen.h>

namespace livemap::ros_io {
namespace {

/// Row by row, as ROS has covariances.
void CopyOdometryCovariance(const odometry::Matrix6d& from, boost::array<double, 36>& to) {
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(to.data()) = from;
}

}  // namespace

Eigen::Isometry3d OdomFromBase(const odometry::VoResult& result, const OdometryFrames& frames) {
  return frames.odom_from_first_base * frames.base_from_optical * result.world_from_camera *
         frames.base_from_optical.inverse();
}

void ChangeMounting(const Eigen::Isometry3d& world_from_camera,
                    const Eigen::Isometry3d& base_from_optical, OdometryFrames& frames) {
  const auto heading = [](const Eigen::Isometry3d& pose) {
    return std::atan2(pose.linear()(1, 0), pose.linear()(0, 0));
  };
  const Eigen::Isometry3d as_before = frames.odom_from_first_base * frames.base_from_optical *
                                      world_from_camera * base_from_optical.inverse();
  const Eigen::Isometry3d level =
      base_from_optical * world_from_camera * base_from_optical.inverse();
  const Eigen::AngleAxisd turn(heading(as_before) - heading(level), Eigen::Vector3d::UnitZ());
  frames.base_from_optical = base_from_optical;
  frames.odom_from_first_base.linear() = turn.toRotationMatrix();
  frames.odom_from_first_base.translation() = as_before.translation() - turn * level.translation();
}

nav_msgs::Odometry ToOdometry(const odometry::VoResult& result, const OdometryFrames& frames,
                              const ros::Time& stamp) {
  const Eigen::Isometry3d odom_from_base = OdomFromBase(result, frames);
  const odometry::Matrix6d to_base = odometry::Se3Adjoint(frames.base_from_optical);
  nav_msgs::Odometry message;
  message.header.stamp = stamp;
  message.header.frame_id = frames.odom;
  message.child_frame_id = frames.base;
  message.pose.pose = tf2::toMsg(odom_from_base);
  // From the body's own axes, in which a right-hand perturbation is, to odom's.
  odometry::Matrix6d turn = odometry::Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = odom_from_base.linear();
  turn.bottomRightCorner<3, 3>() = odom_from_base.linear();
  const odometry::Matrix6d pose_jacobian = turn * to_base;
  CopyOdometryCovariance(pose_jacobian * result.covariance * pose_jacobian.transpose(),
                         message.pose.covariance);
  if (!result.twist) {
    CopyOdometryCovariance(kUnknownVariance * odometry::Matrix6d::Identity(),
                           message.twist.covariance);
    return message;
  }
  const odometry::Vector6d twist = to_base * *result.twist;
  message.twist.twist.linear.x = twist[0];
  message.twist.twist.linear.y = twist[1];
  message.twist.twist.linear.z = twist[2];
  message.twist.twist.angular.x = twist[3];
  message.twist.twist.angular.y = twist[4];
  message.twist.twist.angular.z = twist[5];
  CopyOdometryCovariance(to_base * result.twist_covariance * to_base.transpose(),
                         message.twist.covariance);
  return message;
}

sensor_msgs::PointCloud2 ToEdgeCloud(const odometry::Keyframe& keyframe,
                                     const Eigen::Isometry3d& world_from_keyframe,
                                     double metres_per_unit, const OdometryFrames& frames,
                                     double voxel_m, const ros::Time& stamp) {
  const Eigen::Isometry3f odom_from_keyframe =
      (frames.odom_from_first_base * frames.base_from_optical * world_from_keyframe).cast<float>();
  const auto scale = static_cast<float>(metres_per_unit);
  const odometry::EdgePoints& points = keyframe.finest_points();
  auto cloud = pcl::make_shared<pcl::PointCloud<pcl::PointXYZI>>();
  cloud->reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    pcl::PointXYZI point;
    point.getVector3fMap() =
        odom_from_keyframe * (scale * Eigen::Vector3f(points.x[i], points.y[i], points.z[i]));
    point.intensity = points.intensity[i];
    cloud->push_back(point);
  }
  if (voxel_m > 0) {
    pcl::VoxelGrid<pcl::PointXYZI> thin;
    const auto leaf = static_cast<float>(voxel_m);
    thin.setLeafSize(leaf, leaf, leaf);
    thin.setInputCloud(cloud);
    auto thinned = pcl::make_shared<pcl::PointCloud<pcl::PointXYZI>>();
    thin.filter(*thinned);
    cloud = thinned;
  }
  sensor_msgs::PointCloud2 message;
  pcl::toROSMsg(*cloud, message);
  message.header.stamp = stamp;
  message.header.frame_id = frames.odom;
  return message;
}

}  // namespace livemap::ros_io
