"""A geo_localization nodelet in a process of its own, and the curve that the vehicle drives."""

import math
import random

import numpy
import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix, NavSatStatus
from tf.transformations import quaternion_from_euler, quaternion_matrix

from hazard_reporting_fixture import LATITUDE, LONGITUDE, place, stamp
from node_testing import NodeletUnderTest, eventually, parameters_of

SPEED_MPS = 10.0
START_YAW_RAD = 0.7
NOISE_M = 0.5
LAST_S = 24.0


def yaw(time_s):
    """Straight for five seconds, then a wide curve to the left."""
    return START_YAW_RAD + 0.08 * max(0.0, time_s - 5.0)


def true_pose(time_s):
    """East, north and yaw on the map whose datum is the fixture's place."""
    straight_s = min(time_s, 5.0)
    x = SPEED_MPS * straight_s * math.cos(START_YAW_RAD)
    y = SPEED_MPS * straight_s * math.sin(START_YAW_RAD)
    if time_s > 5.0:
        radius = SPEED_MPS / 0.08
        x += radius * (math.sin(yaw(time_s)) - math.sin(START_YAW_RAD))
        y -= radius * (math.cos(yaw(time_s)) - math.cos(START_YAW_RAD))
    return numpy.array([x, y, yaw(time_s)])


def planar_matrix(pose):
    x, y, turn = pose
    matrix = quaternion_matrix(quaternion_from_euler(0, 0, turn))
    matrix[:2, 3] = x, y
    return matrix


# The odometry's origin lies somewhere else, turned.
ODOM_FROM_MAP = planar_matrix((-12.0, 30.0, 2.1))


def fix(time_s, east_m=0.0, north_m=0.0):
    """The receiver's answer, with the noise that belongs to the moment and an error besides."""
    noise = random.Random(round(1000 * time_s))
    x, y, _ = true_pose(time_s)
    message = NavSatFix()
    message.header.stamp = stamp(time_s)
    message.status.status = NavSatStatus.STATUS_FIX
    message.latitude, message.longitude = place(x + noise.gauss(0, NOISE_M) + east_m,
                                                y + noise.gauss(0, NOISE_M) + north_m)
    message.position_covariance = [NOISE_M ** 2, 0, 0, 0, NOISE_M ** 2, 0, 0, 0, 1]
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return message


def odometry(time_s, pose=None):
    """What visual odometry says: the true way, one per cent too long."""
    matrix = ODOM_FROM_MAP @ planar_matrix(true_pose(time_s) if pose is None else pose)
    message = Odometry(child_frame_id="base_link")
    message.header.stamp = stamp(time_s)
    message.header.frame_id = "odom"
    position, rotation = message.pose.pose.position, message.pose.pose.orientation
    position.x, position.y, position.z = 1.01 * matrix[0, 3], 1.01 * matrix[1, 3], 0.3
    rotation.z = math.sin(0.5 * math.atan2(matrix[1, 0], matrix[0, 0]))
    rotation.w = math.cos(0.5 * math.atan2(matrix[1, 0], matrix[0, 0]))
    message.twist.twist.linear.x = SPEED_MPS
    return message


def lost(time_s, held_s):
    """The pose of an earlier moment, and a twist that is unknown: what edge_vo says when it is lost."""
    message = odometry(time_s, true_pose(held_s))
    message.twist.covariance = [1e6 if i % 7 == 0 else 0 for i in range(36)]
    return message


def pose_matrix(pose):
    p, q = pose.position, pose.orientation
    matrix = quaternion_matrix((q.x, q.y, q.z, q.w))
    matrix[:3, 3] = p.x, p.y, p.z
    return matrix


def planar_yaw(pose):
    matrix = pose_matrix(pose)
    return math.atan2(matrix[1, 0], matrix[0, 0])


class Vehicle(NodeletUnderTest):
    """The nodelet, and the test's ends of its topics."""

    def __init__(self, name, **parameters):
        super().__init__(name, "geo_localization")
        # The fixes stamp their moment. Messages of two topics overtake each other on a busy machine.
        self.parameters = dict(parameters_of("geo_localization"), latency_s=0.0, latency_sigma_s=0.0,
                               map_datum=f"{LATITUDE},{LONGITUDE}", order_wait_s=1.0, diagnostics_period_s=0.2)
        self.parameters.update(parameters)
        self.fixes = self.advertise("fix", NavSatFix, queue_size=2000)
        self.odometry = self.advertise("odom", Odometry, queue_size=2000)
        self.subscribers = [self.subscribe("localization/fix", NavSatFix),
                            self.subscribe("localization/odometry", Odometry)]

    def start(self, wait=True):
        rospy.set_param(f"/{self.name}/geo_localization", self.parameters)
        self.start_nodelet("geo_localization", "standalone", "livemap/GeoLocalizationNodelet")
        if not wait:
            return
        ends = [self.fixes, self.odometry, *self.subscribers]
        eventually(lambda: all(end.get_num_connections() > 0 for end in ends), "it listens and speaks")

    def drive(self, from_s, to_s, make_fix=fix, make_odometry=odometry):
        """Both at 10 Hz; what a maker leaves out is not sent."""
        for tenth in range(round(10 * from_s), round(10 * to_s) + 1):
            for publisher, make in ((self.fixes, make_fix), (self.odometry, make_odometry)):
                message = make(tenth / 10)
                if message:
                    publisher.publish(message)

    def poses(self):
        return self.received("localization/odometry")

    def wait_for_pose(self, time_s):
        """The pose of that moment."""
        return eventually(lambda: [m for m in self.poses() if m.header.stamp == stamp(time_s)],
                          f"a fused pose of {time_s} s")[-1]
