#!/usr/bin/python3
"""edge_vo as a vehicle runs it: a TUM sequence's bag through camera_ingest into the nodelet.

The sequence is a hand-held camera in the simulated room; `livemap evaluate vo` follows the same one.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

import numpy
import rosbag
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Trigger
from tf.transformations import quaternion_matrix
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import NodeletUnderTest, eventually, parameters_of, program  # noqa: E402

FRAMES, SIZE = 24, "320x240"
# base_link to the optical frame: ahead, up, and REP 103's turn.
MOUNTING = ((1.5, 0.2, 1.3), (-0.5, 0.5, -0.5, 0.5))
IMAGE, DEPTH, INFO = "camera/image_raw", "camera/depth/image_raw", "camera/camera_info"
CLASSES = {IMAGE: Image, DEPTH: Image, INFO: CameraInfo}


def run(tool, *arguments):
    done = subprocess.run([program("livemap", tool), *map(str, arguments)], capture_output=True, text=True,
                          timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


def matrix(translation, quaternion):
    result = quaternion_matrix(quaternion)
    result[:3, 3] = translation
    return result


BASE_FROM_OPTICAL = matrix(*MOUNTING)


def base_pose(pose):
    p, q = pose.position, pose.orientation
    return matrix((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def optical_pose(pose):
    """The odometry's own pose, camera in the first camera, from a message's pose of base_link."""
    return numpy.linalg.inv(BASE_FROM_OPTICAL) @ base_pose(pose) @ BASE_FROM_OPTICAL


class Vehicle(NodeletUnderTest):
    def __init__(self, name):
        super().__init__(name, "edge_vo")
        self.inputs = {topic: self.advertise(topic, message) for topic, message in CLASSES.items()}
        self.odometry = self.subscribe("odom", Odometry)
        self.subscribe("vo/path", Path)
        self.subscribe("vo/edges", Image)
        self.subscribe("vo/points", PointCloud2)
        self.start_nodelet("manager", "manager")

    def load(self, **parameters):
        values = dict(parameters_of("edge_vo"), diagnostics_period_s=0.2, **parameters)
        rospy.set_param(f"/{self.name}/edge_vo", values)
        rospy.set_param(f"/{self.name}/camera_ingest", dict(parameters_of("camera_ingest"), transport="raw"))
        self.start_nodelet("camera_ingest", "load", "livemap/CameraIngestNodelet", "manager")
        self.start_nodelet("edge_vo", "load", "livemap/EdgeVoNodelet", "manager")
        eventually(lambda: all(p.get_num_connections() > 0 for p in self.inputs.values()), "it listens")
        eventually(lambda: self.odometry.get_num_connections() > 0, "it speaks")

    def send(self, topic, message):
        self.inputs[topic].publish(message)

    def poses(self):
        return self.received("odom")


class EdgeVoTest(unittest.TestCase):
    number = 0

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="livemap_edge_vo_")
        cls.sequence, bag = os.path.join(cls.folder, "room"), os.path.join(cls.folder, "room.bag")
        run("livemap_simulate", "--room", "--tum", cls.sequence, "--size", SIZE, "--rate", 15,
               "--seconds", (FRAMES + 0.5) / 15, "--one-ray", "--vigour", 2)
        run("livemap_bag_from_tum", cls.sequence, bag)
        cls.frames = [{} for _ in range(FRAMES)]
        with rosbag.Bag(bag) as recorded:
            for topic in CLASSES:
                messages = [m for _, m, _ in recorded.read_messages("/" + topic)]
                assert len(messages) == FRAMES, f"{topic}: {len(messages)} messages"
                for frame, message in zip(cls.frames, messages):
                    frame[topic] = message
        cls.static = tf2_ros.StaticTransformBroadcaster()
        mounting = TransformStamped()
        mounting.header.frame_id = "base_link"
        mounting.child_frame_id = cls.frames[0][IMAGE].header.frame_id
        t, q = mounting.transform.translation, mounting.transform.rotation
        (t.x, t.y, t.z), (q.x, q.y, q.z, q.w) = MOUNTING
        cls.static.sendTransform(mounting)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def loaded(self, **parameters):
        EdgeVoTest.number += 1
        vehicle = Vehicle(f"vehicle{EdgeVoTest.number}")
        self.addCleanup(vehicle.stop)
        vehicle.load(**parameters)
        return vehicle

    def play(self, vehicle, frames):
        """One after the other, each until it is answered, so that none is dropped on a slow machine."""
        for frame in frames:
            answered = len(vehicle.poses())
            for topic in (INFO, DEPTH, IMAGE):
                vehicle.send(topic, frame[topic])
            eventually(lambda: len(vehicle.poses()) > answered, "the frame is answered")

    def black(self, frame):
        """The same moment with the lens covered."""
        image = frame[IMAGE]
        covered = Image(header=image.header, width=image.width, height=image.height,
                        encoding=image.encoding, step=image.step, data=bytes(len(image.data)))
        return {**frame, IMAGE: covered}

    def expected_poses(self):
        out = os.path.join(self.folder, "expected.txt")
        figures = json.loads(run("livemap_evaluate_vo", self.sequence, "--json", "--out", out))
        self.assertEqual(figures["lost"], 0)
        self.assertLess(figures["ate_rmse_m"], 0.005)
        return [matrix(row[1:4], row[4:8]) for row in numpy.loadtxt(out)]

    def test_the_nodelet_gives_the_poses_of_the_tool_in_odometry_and_tf(self):
        vehicle = self.loaded()
        transforms = []
        listener = rospy.Subscriber("/tf", TFMessage, lambda m: transforms.extend(
            t for t in m.transforms if t.header.frame_id == "odom"))
        self.addCleanup(listener.unregister)
        eventually(lambda: listener.get_num_connections() > 0, "tf is heard")
        self.play(vehicle, self.frames)
        for i, (message, expected) in enumerate(zip(vehicle.poses(), self.expected_poses())):
            self.assertEqual(message.header.stamp, self.frames[i][IMAGE].header.stamp)
            self.assertEqual((message.header.frame_id, message.child_frame_id), ("odom", "base_link"))
            difference = numpy.abs(optical_pose(message.pose.pose) - expected).max()
            self.assertLess(difference, 1e-6, f"frame {i}")
            covariance = numpy.array(message.pose.covariance).reshape(6, 6)
            numpy.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
            self.assertGreaterEqual(numpy.linalg.eigvalsh(covariance).min(), -1e-12)
            twist = numpy.array(message.twist.covariance).reshape(6, 6)
            self.assertGreater(numpy.linalg.eigvalsh(twist).min(), 0, f"frame {i}: a velocity without error")
        eventually(lambda: len(transforms) >= FRAMES, "tf came too")
        for message, transform in zip(vehicle.poses(), transforms):
            t, q = transform.transform.translation, transform.transform.rotation
            numpy.testing.assert_allclose(matrix((t.x, t.y, t.z), (q.x, q.y, q.z, q.w)),
                                          base_pose(message.pose.pose), atol=1e-12)
        moved = numpy.linalg.norm(base_pose(vehicle.poses()[-1].pose.pose)[:3, 3])
        self.assertGreater(moved, 0.05, "the camera moved, so base_link did")

    def test_frames_that_come_at_once_are_accounted_for_and_the_newest_is_followed(self):
        vehicle = self.loaded(waiting_frames=1)
        for frame in self.frames:
            for topic in (INFO, DEPTH, IMAGE):
                vehicle.send(topic, frame[topic])
        newest = self.frames[-1][IMAGE].header.stamp
        eventually(lambda: vehicle.poses() and vehicle.poses()[-1].header.stamp == newest, "the newest is followed")
        vehicle.wait_for(frames_waiting=0, frames=len(vehicle.poses()), frames_dropped=0)
        values = {key: int(vehicle.diagnostics()[key]) for key in ("frames_in", "frames", "frames_displaced")}
        self.assertEqual(values["frames_in"], values["frames"] + values["frames_displaced"], values)

    def test_edges_points_and_path_are_there_for_those_who_listen(self):
        vehicle = self.loaded(path_spacing_m=0.01, cloud_voxel_m=0.0)
        self.play(vehicle, self.frames)
        edges = eventually(lambda: vehicle.received("vo/edges"), "an edge image")[-1]
        self.assertEqual((edges.encoding, edges.width, edges.height), ("bgr8", 320, 240))
        pixels = numpy.frombuffer(edges.data, numpy.uint8).reshape(240, 320, 3)
        coloured = (pixels.max(axis=2).astype(int) - pixels.min(axis=2) > 100).sum()
        self.assertGreater(coloured, 1000, "coloured edge pixels")
        cloud = eventually(lambda: vehicle.received("vo/points"), "an edge cloud")[-1]
        self.assertEqual(cloud.header.frame_id, "odom")
        self.assertGreater(cloud.width * cloud.height, 500)
        path = eventually(lambda: vehicle.received("vo/path"), "a path")[-1]
        self.assertGreater(len(path.poses), 3)

    def test_a_covered_lens_is_lost_with_the_pose_held_and_tracking_comes_back(self):
        vehicle = self.loaded()
        self.play(vehicle, self.frames[:8])
        held = vehicle.poses()[-1]
        self.play(vehicle, [self.black(frame) for frame in self.frames[8:14]])
        for message in vehicle.poses()[8:14]:
            self.assertEqual(message.pose.pose, held.pose.pose)
        grown = [numpy.trace(numpy.reshape(m.pose.covariance, (6, 6))) for m in vehicle.poses()[7:14]]
        self.assertEqual(grown, sorted(grown))
        self.assertGreater(grown[-1], 100 * grown[0])
        vehicle.wait_for(state="lost", frames_lost=6)
        self.play(vehicle, self.frames[14:])
        vehicle.wait_for(state="tracking", frames_lost=6)
        expected = self.expected_poses()[-1]
        difference = optical_pose(vehicle.poses()[-1].pose.pose) - expected
        self.assertLess(numpy.abs(difference).max(), 0.01)

    def test_reset_makes_the_next_frame_the_origin(self):
        vehicle = self.loaded()
        self.play(vehicle, self.frames[:12])
        vehicle.wait_for(frames=12, resets=0)
        reset = rospy.ServiceProxy(f"/{vehicle.name}/edge_vo/reset", Trigger)
        self.assertTrue(reset().success)
        self.play(vehicle, self.frames[12:14])
        numpy.testing.assert_allclose(base_pose(vehicle.poses()[12].pose.pose), numpy.eye(4), atol=1e-9)
        vehicle.wait_for(resets=1)

    def test_a_replay_that_begins_again_starts_anew(self):
        vehicle = self.loaded()
        self.play(vehicle, self.frames[:20])
        # One stamp that goes back may be wrong; the third that agrees is believed, of those that a busy machine does not drop.
        for frame in self.frames[:20]:
            for topic in (INFO, DEPTH, IMAGE):
                vehicle.send(topic, frame[topic])
            time.sleep(0.5)
            if len(vehicle.poses()) > 20:
                break
        eventually(lambda: len(vehicle.poses()) > 20, "a frame of the second round is answered")
        numpy.testing.assert_allclose(base_pose(vehicle.poses()[20].pose.pose), numpy.eye(4), atol=1e-9)
        self.assertIn("stamps went back", vehicle.output())

    def test_depth_of_another_size_is_dropped_with_a_sentence(self):
        vehicle = self.loaded()
        self.play(vehicle, self.frames[:2])
        small = Image(header=self.frames[2][DEPTH].header, width=2, height=2, encoding="16UC1", step=4,
                      data=bytes(8))
        for topic, message in ((INFO, self.frames[2][INFO]), (DEPTH, small), (IMAGE, self.frames[2][IMAGE])):
            vehicle.send(topic, message)
        vehicle.wait_for(frames_dropped=1)
        self.assertIn("2x2", vehicle.output())
        self.play(vehicle, self.frames[3:5])
        vehicle.wait_for(state="tracking", frames=4)

    def test_missing_depth_is_named_in_the_warning(self):
        vehicle = self.loaded(silence_warning_s=0.5)
        for topic in (INFO, IMAGE):
            vehicle.send(topic, self.frames[0][topic])
        eventually(lambda: "0 depth images on" in vehicle.output() and "'exact'" in vehicle.output(),
                   "the warning names what is missing")

    def test_a_wrong_parameter_is_one_sentence(self):
        EdgeVoTest.number += 1
        vehicle = Vehicle(f"vehicle{EdgeVoTest.number}")
        self.addCleanup(vehicle.stop)
        rospy.set_param(f"/{vehicle.name}/edge_vo", dict(parameters_of("edge_vo"), edges="structured"))
        vehicle.start_nodelet("edge_vo", "load", "livemap/EdgeVoNodelet", "manager")
        eventually(lambda: "structured_model" in vehicle.output(), "it says what is missing")


if __name__ == "__main__":
    rospy.init_node("edge_vo_test")
    rostest.rosrun("livemap", "edge_vo_test", EdgeVoTest, sys.argv)
