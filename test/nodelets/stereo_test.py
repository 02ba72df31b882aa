#!/usr/bin/python3
"""A stereo camera as a vehicle runs them: the bag of a simulated drive through camera_ingest and edge_vo."""

import copy
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy
import rosbag
import rospy
import rostest
import tf2_ros
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_srvs.srv import Trigger
from tf.transformations import quaternion_matrix

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import NodeletUnderTest, eventually, parameters_of, program  # noqa: E402

FRAMES, WIDTH, HEIGHT, BASELINE_M = 15, 320, 240, 0.4
LEFT, LEFT_INFO = "camera/image_raw/compressed", "camera/camera_info"
RIGHT, RIGHT_INFO = "camera_right/image_raw/compressed", "camera_right/camera_info"
CLASSES = {LEFT: CompressedImage, LEFT_INFO: CameraInfo, RIGHT: CompressedImage, RIGHT_INFO: CameraInfo}
IMAGE, DEPTH, DEPTH_INFO = "camera_rect/image", "camera_rect/depth/image_raw", "camera_rect/depth/camera_info"
SETTLED = ("depth_published", "depth_dropped", "depth_bad", "depth_right_missing")
TRUE_DEPTH, TRUE_ODOMETRY = "camera/depth/image_raw", "ground_truth/odom"


def metres(image):
    return numpy.frombuffer(image.data, numpy.float32).reshape(image.height, image.width)


def base_pose(pose):
    p, q = pose.position, pose.orientation
    result = quaternion_matrix((q.x, q.y, q.z, q.w))
    result[:3, 3] = p.x, p.y, p.z
    return result


class Vehicle(NodeletUnderTest):
    def __init__(self, name):
        super().__init__(name, "camera_ingest")
        self.inputs = {topic: self.advertise(topic, message) for topic, message in CLASSES.items()}
        self.outputs = [self.subscribe(IMAGE, Image), self.subscribe(DEPTH, Image),
                        self.subscribe(DEPTH_INFO, CameraInfo)]
        self.start_nodelet("manager", "manager")

    def load(self, **parameters):
        values = dict(parameters_of("camera_ingest"), stereo=True, diagnostics_period_s=0.2, **parameters)
        rospy.set_param(f"/{self.name}/camera_ingest", values)
        self.start_nodelet("camera_ingest", "load", "livemap/CameraIngestNodelet", "manager")

    def connect(self):
        eventually(lambda: all(p.get_num_connections() > 0 for p in self.inputs.values()), "it listens")
        eventually(lambda: all(s.get_num_connections() > 0 for s in self.outputs), "it speaks")

    def follow(self):
        rospy.set_param(f"/{self.name}/edge_vo", parameters_of("edge_vo"))
        self.outputs.append(self.subscribe("odom", Odometry))
        self.start_nodelet("edge_vo", "load", "livemap/EdgeVoNodelet", "manager",
                           "camera/depth/image_raw:=" + DEPTH)

    def send(self, frame, topics=tuple(CLASSES)):
        for topic in topics:
            self.inputs[topic].publish(frame[topic])

    def calibrate(self, frame):
        """Topics have no order among each other: the nodelet must know the calibrations first."""
        self.send(frame, (LEFT_INFO, RIGHT_INFO))


class StereoTest(unittest.TestCase):
    number = 0

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="livemap_stereo_")
        bag = os.path.join(cls.folder, "drive.bag")
        done = subprocess.run(
            [program("livemap", "livemap_simulate"), "--seed", "5", "--size", f"{WIDTH}x{HEIGHT}", "--rate", "10",
             "--seconds", str(FRAMES / 10 + 0.01), "--one-ray", "--stereo", str(BASELINE_M), "--bag-depth",
             "--bag", bag], capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        wanted = [*CLASSES, TRUE_DEPTH, TRUE_ODOMETRY]
        cls.frames = [{} for _ in range(FRAMES)]
        with rosbag.Bag(bag) as recorded:
            for topic in wanted:
                messages = [m for _, m, _ in recorded.read_messages("/" + topic)]
                assert len(messages) == FRAMES, f"{topic}: {len(messages)} messages"
                for frame, message in zip(cls.frames, messages):
                    frame[topic] = message
            (_, mounting, _), = recorded.read_messages("/tf_static")
        cls.static = tf2_ros.StaticTransformBroadcaster()
        cls.static.sendTransform(mounting.transforms)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def vehicle(self):
        StereoTest.number += 1
        vehicle = Vehicle(f"stereo{StereoTest.number}")
        self.addCleanup(vehicle.stop)
        return vehicle

    def loaded(self, **parameters):
        vehicle = self.vehicle()
        vehicle.load(**parameters)
        vehicle.connect()
        vehicle.calibrate(self.frames[0])
        return vehicle

    def play(self, vehicle, frames, answer=DEPTH):
        """One after the other, each until it is answered, so that none is dropped on a slow machine."""
        for frame in frames:
            answered = len(vehicle.received(answer))
            vehicle.send(frame)
            eventually(lambda: len(vehicle.received(answer)) > answered, f"{answer} answers")

    def warm_up(self, vehicle):
        """Earlier copies of the first pair until the odometry has all its topics and the mounting, which nobody
        sees from outside; then it starts anew. Returns how many poses it gave."""
        early = copy.deepcopy(self.frames[0])
        for camera in (LEFT, RIGHT):
            early[camera].header.stamp -= rospy.Duration(50)

        def answers():
            for camera in (LEFT, RIGHT):
                early[camera].header.stamp += rospy.Duration(0.1)
            vehicle.send(early)
            return vehicle.received("odom")

        eventually(answers, "odom answers")
        vehicle.wait_for(right_in=round((early[LEFT].header.stamp - self.frames[0][LEFT].header.stamp).to_sec() * 10) + 500)
        eventually(lambda: sum(int(vehicle.diagnostics().get(key, "0")) for key in SETTLED) ==
                   int(vehicle.diagnostics()["depth_wanted"]), "nothing waits")
        rospy.sleep(0.5)  # The last depth is on its way.
        self.assertTrue(rospy.ServiceProxy(f"/{vehicle.name}/edge_vo/reset", Trigger)().success)
        return len(vehicle.received("odom"))

    def test_a_pair_gives_depth_with_the_stamp_and_frame_of_the_left_image(self):
        vehicle = self.loaded()
        self.play(vehicle, self.frames[:4])
        for frame, depth, info in zip(self.frames, vehicle.received(DEPTH), vehicle.received(DEPTH_INFO)):
            self.assertEqual(depth.header.stamp, frame[LEFT].header.stamp)
            self.assertEqual(depth.header.frame_id, "camera_optical_frame")
            self.assertEqual((depth.encoding, depth.width, depth.height), ("32FC1", WIDTH, HEIGHT))
            self.assertEqual((info.header.stamp, info.P), (depth.header.stamp, frame[LEFT_INFO].P))
            found, truth = metres(depth), metres(frame[TRUE_DEPTH])
            both = numpy.isfinite(found) & numpy.isfinite(truth) & (truth > 2.5) & (truth < 40)
            self.assertGreater(both.mean(), 0.4, "share of the picture with depth")
            scale = frame[LEFT_INFO].P[0] * BASELINE_M
            wrong_px = numpy.abs(scale / found[both] - scale / truth[both])
            self.assertLess(numpy.median(wrong_px), 0.6)
        vehicle.wait_for(depth_wanted=4, depth_published=4, depth_right_missing=0, depth_bad=0, depth_dropped=0,
                         right_in=4, right_unpaired=0)

    def test_odometry_follows_the_depth(self):
        vehicle = self.vehicle()
        vehicle.load()
        vehicle.follow()
        vehicle.connect()
        vehicle.calibrate(self.frames[0])
        before = self.warm_up(vehicle)
        self.play(vehicle, self.frames, "odom")
        poses = [base_pose(message.pose.pose) for message in vehicle.received("odom")[before:]]
        truth = [base_pose(frame[TRUE_ODOMETRY].pose.pose) for frame in self.frames]
        self.assertEqual(len(poses), FRAMES)
        way_m = numpy.linalg.norm(truth[-1][:3, 3] - truth[0][:3, 3])
        self.assertGreater(way_m, 5)
        error = numpy.linalg.inv(poses[-1]) @ numpy.linalg.inv(truth[0]) @ truth[-1]
        self.assertLess(numpy.linalg.norm(error[:3, 3]), 0.03 * way_m)

    def test_a_resize_is_of_both_eyes_and_of_depth(self):
        vehicle = self.loaded(output_width=160)
        self.play(vehicle, self.frames[:1])
        depth, image = vehicle.received(DEPTH)[0], vehicle.received(IMAGE)[0]
        self.assertEqual((depth.width, depth.height), (160, 120))
        self.assertEqual((image.width, image.height), (160, 120))
        truth = metres(self.frames[0][TRUE_DEPTH])[::2, ::2]
        found = metres(depth)
        both = numpy.isfinite(found) & numpy.isfinite(truth) & (truth > 2.5) & (truth < 20)
        self.assertLess(numpy.median(numpy.abs(found[both] / truth[both] - 1)), 0.1)

    def test_without_right_images_left_ones_go_on_and_it_is_said(self):
        vehicle = self.loaded(stereo_wait_s=0.05, queue_size=20)
        self.play(vehicle, self.frames[:1])
        for frame in self.frames[1:6]:
            answered = len(vehicle.received(IMAGE))
            vehicle.send(frame, (LEFT,))
            eventually(lambda: len(vehicle.received(IMAGE)) > answered, "the left image goes on")
        vehicle.wait_for(depth_published=1, depth_right_missing=5, right_in=1, frames_published=6)
        self.assertEqual(len(vehicle.received(DEPTH)), 1)
        self.assertRegex(vehicle.output(), r"no right image for the left one of .*: 1 images came on "
                         rf"/{vehicle.name}/camera_right/image_raw/compressed; left images go on without depth")
        levels = [status.message for message in vehicle.received("diagnostics") for status in message.status
                  if vehicle.name in status.name]
        self.assertTrue(any("right images are missing" in text for text in levels), levels)
        # A camera that was silent is not waited for: it comes back with its next image.
        vehicle.send(self.frames[6], (RIGHT,))
        vehicle.wait_for(right_in=2)
        vehicle.send(self.frames[6], (LEFT,))
        eventually(lambda: len(vehicle.received(DEPTH)) == 2, "depth is back")
        self.play(vehicle, self.frames[7:8])
        stamps = [message.header.stamp for message in vehicle.received(DEPTH)]
        self.assertEqual(stamps[1:], [frame[LEFT].header.stamp for frame in self.frames[6:8]])

    def test_when_depth_is_behind_the_oldest_pairs_go_and_are_counted(self):
        vehicle = self.loaded(stereo_wait_s=10)
        for frame in self.frames[:9]:
            answered = len(vehicle.received(IMAGE))
            vehicle.send(frame, (LEFT,))
            eventually(lambda: len(vehicle.received(IMAGE)) > answered, "the left image goes on")
        # One waits for its partner, two wait for that, six had to go; then the newest one's partner comes.
        vehicle.send(self.frames[8], (RIGHT,))
        vehicle.wait_for(depth_wanted=9, depth_dropped=6, depth_right_missing=2, depth_published=1)
        self.assertEqual(vehicle.received(DEPTH)[0].header.stamp, self.frames[8][LEFT].header.stamp)

    def test_stamps_that_differ_are_paired_within_the_tolerance_only(self):
        late = copy.deepcopy(self.frames[1])
        late[RIGHT].header.stamp += rospy.Duration(0.004)
        exact = self.loaded(stereo_wait_s=0.05)
        self.play(exact, self.frames[:1])
        exact.send(late)
        exact.wait_for(depth_published=1, depth_right_missing=1)
        tolerant = self.loaded(stereo_sync_s=0.005)
        self.play(tolerant, [self.frames[0], late])
        self.assertEqual(tolerant.received(DEPTH)[1].header.stamp, late[LEFT].header.stamp)

    def test_a_calibration_that_is_no_pair_is_refused_by_a_sentence(self):
        vehicle = self.loaded()
        alone = copy.deepcopy(self.frames[0])
        alone[RIGHT_INFO].P = alone[LEFT_INFO].P
        vehicle.send(alone, (RIGHT_INFO,))
        rospy.sleep(0.5)  # Topics have no order among each other.
        vehicle.send(alone)
        vehicle.wait_for(depth_bad=1, depth_published=0, frames_published=1)
        self.assertIn("accepted is -fx times the baseline in metres", vehicle.output())

    def test_a_second_eye_of_a_folder_is_refused(self):
        vehicle = self.vehicle()
        vehicle.load(source="folder", uri=self.folder, camera_info_url="file:///nowhere.yaml")
        eventually(lambda: "a right camera is read from topics only" in vehicle.output(), "it is refused")

    def test_parameters_that_cannot_be_are_refused(self):
        vehicle = self.vehicle()
        vehicle.load(stereo_block_size=4)
        eventually(lambda: "stereo's block size is 4, accepted is an odd number" in vehicle.output(), "refused")


if __name__ == "__main__":
    rospy.init_node("stereo_test")
    rostest.rosrun("livemap", "stereo", StereoTest)
