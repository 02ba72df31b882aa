#!/usr/bin/python3
"""Each rviz file loads under Xvfb without an error and shows what is published: its colours are seen."""

import os
import pathlib
import sys
import tempfile
import time
import unittest

import cv2
import numpy
import rospy
import rostest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from sensor_msgs.msg import Image
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "lib"))
import rviz_capture as views  # noqa: E402

# Colours that no widget and no background has, RGB.
CAMERA, DETECTIONS, HAZARD, PATH = (255, 0, 220), (0, 255, 140), (255, 120, 0), (66, 135, 245)
ENOUGH_PIXELS = 20
# Keeps a broken test from hanging; nothing is measured by it.
PATIENCE_S = 60


def plain_image(colour):
    message = Image(height=200, width=320, encoding="rgb8", step=960)
    message.header.frame_id = "camera_optical_frame"
    message.data = bytes(colour) * (200 * 320)
    return message


def hazard_markers():
    marker = Marker(ns="hazard", id=1, type=Marker.CUBE, action=Marker.ADD)
    marker.header.frame_id = "map"
    marker.pose.position.x = marker.pose.position.y = 5.0
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = 8.0
    marker.color = ColorRGBA(*(channel / 255.0 for channel in HAZARD), 1.0)
    return MarkerArray(markers=[marker])


def driven_path():
    path = Path()
    path.header.frame_id = "map"
    for i in range(40):
        pose = PoseStamped()
        pose.header.frame_id = "map"
        pose.pose.position.x, pose.pose.position.y = -20.0 + i, -8.0
        pose.pose.orientation.w = 1.0
        path.poses.append(pose)
    return path


def pixels_like(picture, colour, tolerance=60):
    """Pixels whose hue is that of `colour`; rviz shades what it lights, so brightness is free."""
    lit = picture.astype(float)
    length = numpy.linalg.norm(lit, axis=2) * numpy.linalg.norm(colour)
    cosine = (lit @ numpy.array(colour, float)) / numpy.maximum(length, 1.0)
    bright = lit.max(axis=2) > tolerance
    return int(numpy.count_nonzero((cosine > 0.995) & bright))


class RvizViewsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("rviz_views_test")
        cls.publishers = [
            (rospy.Publisher(topic, type(message), queue_size=1, latch=True), message)
            for topic, message in [
                ("camera_rect/image", plain_image(CAMERA)),
                ("hazard/annotated", plain_image(DETECTIONS)),
                ("hazard/local_map", hazard_markers()), ("hazard/markers", hazard_markers()),
                ("path", driven_path())]]

    def show(self, rviz_file, wanted, patience_s=PATIENCE_S):
        """Waits until every wanted colour is on the screen; fails with what rviz said."""
        with views.VirtualDisplay(1440, 900) as display, \
                tempfile.NamedTemporaryFile("w+", suffix=".log") as log:
            picture_file = os.path.join(tempfile.mkdtemp(), rviz_file.stem + ".png")
            rviz = views.start_rviz(rviz_file, display, os.environ["ROS_MASTER_URI"], log)
            try:
                deadline = time.monotonic() + patience_s
                missing = dict(wanted)
                while missing and time.monotonic() < deadline:
                    self.assertIsNone(rviz.poll(), "rviz ended: " + self.words(log))
                    for publisher, message in self.publishers:
                        publisher.publish(message)
                    time.sleep(0.5)
                    display.photograph(picture_file)
                    picture = cv2.imread(picture_file)[:, :, ::-1]
                    missing = {what: colour for what, colour in wanted.items()
                               if pixels_like(picture, colour) < ENOUGH_PIXELS}
            finally:
                rviz.terminate()
                rviz.wait(30)
            self.assertEqual(list(missing), [],
                             f"not seen in {picture_file}; rviz said: {self.words(log)}")
            complaints = [line for line in self.words(log).splitlines()
                          if "[ERROR]" in line or "[FATAL]" in line or "could not be loaded" in line]
            self.assertEqual(complaints, [], "errors of rviz")

    @staticmethod
    def words(log):
        return pathlib.Path(log.name).read_text()

    def test_the_vehicle_view_shows_camera_detections_hazards_and_path(self):
        self.show(views.rviz_file("vehicle"), {"camera": CAMERA, "detections": DETECTIONS,
                                               "hazard": HAZARD, "path": PATH})

    def test_the_zone_view_shows_hazards(self):
        self.show(views.rviz_file("zone"), {"hazard": HAZARD})

    def test_a_view_with_an_unknown_display_is_told(self):
        """The check itself must be able to fail."""
        broken = pathlib.Path(tempfile.mkdtemp()) / "broken.rviz"
        text = views.rviz_file("zone").read_text()
        broken.write_text(text.replace("rviz/MarkerArray", "rviz/NoSuchDisplay"))
        with self.assertRaises(AssertionError):
            self.show(broken, {"hazard": HAZARD}, patience_s=10)


if __name__ == "__main__":
    rostest.rosrun("livemap", "rviz_views_test", RvizViewsTest)
