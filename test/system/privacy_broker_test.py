#!/usr/bin/python3
"""What of a passer-by and a parked car reaches the wire: the vehicle drives past, and the test reads the broker.

hazard_detection with the tiny model, hazard_reporting and mqtt_bridge in one manager, a real mosquitto, and a
subscriber to every topic that looks for JPEG files in whatever bytes come and for the face and the plate in each.
"""

import os
import re
import subprocess
import sys
import tempfile
import threading
import unittest

import cv2
import numpy
import rospy
import rostest
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo, Image, NavSatFix
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
import hazard_reporting_fixture as street  # noqa: E402
from livemap.msg import DetectionArray, HazardPoll, HazardPollAnswer, HazardReport
from mqtt_bridge_fixture import Broker  # noqa: E402
from node_testing import SOURCE_DIRECTORY, NodeletUnderTest, eventually, parameters_of, start_child  # noqa: E402

TINY_MODEL = os.path.join(SOURCE_DIRECTORY, "test", "perception", "inference", "tiny.yaml")
WIDTH, HEIGHT, FOCAL_PX = 320, 240, 250.0
# Rows and columns: the eyes, and the letters of the plate.
EYES = (slice(92, 114), slice(160, 201))
LETTERS = (slice(187, 208), slice(126, 226))
# Correlation with what the camera saw: 1 but for what JPEG takes; blocks of a mask have none of the detail.
SEEN = 0.8


def grey_scene():
    """A street with a face and a number plate; a red block, which the model takes for a pothole, beside them: the picture
    of the hazard and its surroundings cuts through the face."""
    pixels = numpy.random.RandomState(7).normal(120, 6, (HEIGHT, WIDTH, 3)).clip(0, 255).astype(numpy.uint8)
    height, centre = 80, numpy.array((180, 110))

    def part(x, y, width, part_height, colour):
        middle = centre + numpy.rint(numpy.array((x, y)) * height).astype(int)
        axes = (max(1, round(width * height)), max(1, round(part_height * height)))
        cv2.ellipse(pixels, tuple(map(int, middle)), axes, 0, 0, 360, colour, cv2.FILLED, cv2.LINE_AA)

    part(0, -0.15, 0.48, 0.55, (30, 40, 50))
    part(0, 0, 0.40, 0.52, (140, 170, 215))
    for side in (-0.17, 0.17):
        part(side, -0.10, 0.10, 0.05, (90, 110, 150))
        part(side, -0.10, 0.07, 0.03, (240, 240, 240))
        part(side, -0.10, 0.03, 0.03, (20, 20, 20))
        part(side, -0.19, 0.10, 0.03, (30, 40, 60))
    part(0, 0.08, 0.06, 0.10, (120, 150, 195))
    part(0, 0.30, 0.15, 0.04, (70, 70, 160))
    left, top, width, plate_height = 120, 185, 112, 24
    cv2.rectangle(pixels, (left - 3, top - 3), (left + width + 3, top + plate_height + 3), (20, 20, 20), cv2.FILLED)
    cv2.rectangle(pixels, (left, top), (left + width, top + plate_height), (235, 235, 235), cv2.FILLED)
    cv2.putText(pixels, "A174BC", (left + width * 8 // 100, top + plate_height * 8 // 10), cv2.FONT_HERSHEY_SIMPLEX,
                plate_height / 30, (10, 10, 10), max(1, plate_height // 9), cv2.LINE_AA)
    # Without colour: the model would take skin for red.
    return cv2.cvtColor(cv2.GaussianBlur(pixels, (0, 0), 0.7), cv2.COLOR_BGR2GRAY)


GREY = grey_scene()


def image(time_s, hazard=True):
    pixels = cv2.merge([GREY] * 3)
    if hazard:
        pixels[180:220, 10:50] = (0, 0, 255)
    message = Image(width=WIDTH, height=HEIGHT, encoding="bgr8", step=3 * WIDTH, data=pixels.tobytes())
    message.header.stamp = street.stamp(time_s)
    message.header.frame_id = street.OPTICAL
    return message


def jpegs_in(payload):
    """Every picture in the bytes, wherever it stands."""
    for start in re.finditer(rb"\xff\xd8\xff", payload):
        picture = cv2.imdecode(numpy.frombuffer(payload, numpy.uint8, offset=start.start()), cv2.IMREAD_GRAYSCALE)
        if picture is not None:
            yield picture


def likeness(picture, part):
    """The best correlation of the part, as the camera saw it, with any place of the picture."""
    wanted = GREY[part]
    if picture.shape[0] < wanted.shape[0] or picture.shape[1] < wanted.shape[1]:
        return 0.0
    return float(cv2.matchTemplate(picture, wanted, cv2.TM_CCOEFF_NORMED).max())


class Wire:
    """All that the broker carries, as the zone may read it."""

    def __init__(self, broker):
        with open(broker.password_file("zone"), encoding="ascii") as file:
            password = file.readline().strip()
        self.messages = []
        self.process = start_child(["mosquitto_sub", "-V", "5", "-p", str(broker.port), "-u", "zone", "-P", password,
                                    "-t", "#", "-F", "%t %x"], stdout=subprocess.PIPE, text=True)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            topic, _, payload = line.strip().partition(" ")
            self.messages.append((topic, bytes.fromhex(payload)))

    def of(self, kind, message_class):
        """What came on the topics that end so."""
        found = []
        for topic, payload in list(self.messages):
            if topic.endswith("/" + kind):
                name_length = payload[8]
                # On the wire a message has no zone.
                found.append(message_class().deserialize(payload[9 + name_length + 16 + 4:] + bytes(4)))
        return found

    def pictures(self):
        return [(topic, picture) for topic, payload in list(self.messages) for picture in jpegs_in(payload)]

    def stop(self):
        self.process.kill()
        self.process.wait()


class PassingVehicle(NodeletUnderTest):
    def __init__(self, name, broker, use_events, privacy):
        super().__init__(name, "hazard_reporting")
        self.use_events = use_events
        self.images = self.advertise("camera_rect/image", Image)
        self.info = self.advertise("camera_rect/camera_info", CameraInfo, latch=True)
        self.fixes = self.advertise("fix", NavSatFix)
        self.polls = self.advertise("hazard/poll", HazardPoll)
        self.detections = self.subscribe("hazard/detections", DetectionArray)
        self.mounting = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self.ends.append(self.mounting)
        detection = {"model": TINY_MODEL, "queue_size": 100}
        if use_events:
            detection["tracking"] = True
        self.start_nodelet("manager", "manager")
        for node, kind, parameters in [
                ("hazard_detection", "HazardDetectionNodelet", detection),
                ("hazard_reporting", "HazardReportingNodelet",
                 {"database": os.path.join(tempfile.mkdtemp(), "hazards.sqlite3"), "use_events": use_events,
                  "privacy": privacy, "privacy_finder": "cascades", "max_ground_sigma_m": 5.0, "picture_wait_s": 5.0,
                  "jpeg_quality": 95,
                  "poll_jpeg_quality": 95,
                  # Nobody answers: a few reports, each once, so that the answers to polls find their way.
                  "max_pending": 3, "resend_first_s": 600.0, "resend_longest_s": 600.0}),
                ("mqtt_bridge", "MqttBridgeNodelet",
                 {"zone": "test", "port": broker.port, "user": "car-1",
                  "password_file": broker.password_file("car-1")})]:
            name_in_config = "mqtt_bridge_vehicle" if node == "mqtt_bridge" else node
            rospy.set_param(f"/{name}/{node}",
                            {**parameters_of(name_in_config), "diagnostics_period_s": 0.2, **parameters})
            self.start_nodelet(node, "load", "livemap/" + kind, "manager")
        ends = (self.images, self.info, self.fixes, self.polls, self.detections)
        eventually(lambda: all(end.get_num_connections() > 0 for end in ends), "it listens")
        self._mount_camera()
        self.time_s = 3.0
        for tenth in range(30):
            self.fixes.publish(street.fix(tenth / 10))

    def _mount_camera(self):
        info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob")
        info.K = [FOCAL_PX, 0, WIDTH / 2, 0, FOCAL_PX, HEIGHT / 2, 0, 0, 1]
        info.P = [FOCAL_PX, 0, WIDTH / 2, 0, 0, FOCAL_PX, HEIGHT / 2, 0, 0, 0, 1, 0]
        info.header.frame_id = street.OPTICAL
        self.info.publish(info)
        mounting = TransformStamped()
        mounting.header.frame_id, mounting.child_frame_id = "base_link", street.OPTICAL
        mounting.transform.translation.z = street.CAMERA_HEIGHT_M
        rotation = mounting.transform.rotation
        rotation.x, rotation.y, rotation.z, rotation.w = -0.5, 0.5, -0.5, 0.5
        self.mounting.publish(TFMessage([mounting]))

    def pass_by(self):
        """A moment of the drive: fixes before and after, images with the hazard, then some without it."""
        for tick in range(12):
            self.fixes.publish(street.fix(self.time_s))
            self.images.publish(image(self.time_s, hazard=tick < 8))
            self.time_s += 0.1
            rospy.sleep(0.05)


class PrivacyBrokerTest(unittest.TestCase):
    number = 0

    @classmethod
    def setUpClass(cls):
        cls.broker = Broker()
        cls.broker.start()

    @classmethod
    def tearDownClass(cls):
        cls.broker.kill()

    def drive_past(self, use_events, privacy):
        """The pictures on the wire, by topic, of a report and of the answer to a poll that wants the whole frame."""
        PrivacyBrokerTest.number += 1
        wire = Wire(self.broker)
        vehicle = PassingVehicle(f"vehicle{self.number}", self.broker, use_events, privacy)
        try:
            def reported():
                vehicle.pass_by()
                return [report for report in wire.of("report", HazardReport) if report.image.data]
            report = eventually(reported, "a report with a picture on the wire")[0]
            self.assertLessEqual(len(report.image.data), 12000)
            poll = HazardPoll(schema_version=HazardPoll.SCHEMA_VERSION, hazard_uuid=os.urandom(16),
                              vehicle_id="car-1", stamp=rospy.Time(50), expires=rospy.Time(170), class_name="pothole",
                              covariance=[25, 0, 0, 25], picture_wanted=True, max_picture_bytes=200000)

            def answered():
                # The scene travels with the vehicle: the question is about where it is seen now. Asked past the broker,
                # where a second login of the zone would end the one that listens.
                poll.poll_uuid = os.urandom(16)
                poll.latitude, poll.longitude = street.place(*street.on_street(vehicle.time_s + 0.4, 4.0, 2.1))
                vehicle.polls.publish(poll)
                vehicle.pass_by()
                return [answer for answer in wire.of("answer", HazardPollAnswer) if answer.image.data]
            eventually(answered, "an answer with a picture on the wire")
        except AssertionError as error:
            raise AssertionError(f"{error}; it said: {vehicle.output()}; {vehicle.diagnostics()}") from None
        finally:
            vehicle.stop()
            wire.stop()
        pictures = wire.pictures()
        kinds = {topic.rsplit("/", 1)[1] for topic, _ in pictures}
        self.assertTrue({"report", "answer"} <= kinds, kinds)
        return pictures

    def modes(self):
        """With the tracker's events, where hazard_detection has them, and without."""
        return [False, True] if "tracking" in parameters_of("hazard_detection") else [False]

    def test_no_face_and_no_plate_is_to_be_seen_in_any_picture_on_any_topic(self):
        for use_events in self.modes():
            for topic, picture in self.drive_past(use_events, privacy=True):
                for name, part in (("face", EYES), ("plate", LETTERS)):
                    self.assertLess(likeness(picture, part), SEEN, f"{name} on {topic}, events {use_events}")

    def test_without_privacy_both_are_so_that_this_test_can_fail(self):
        for use_events in self.modes():
            pictures = self.drive_past(use_events, privacy=False)
            for name, part in (("face", EYES), ("plate", LETTERS)):
                best = max(likeness(picture, part) for _, picture in pictures)
                self.assertGreater(best, SEEN, f"{name}, events {use_events}")


if __name__ == "__main__":
    rospy.init_node("privacy_broker_test")
    rostest.rosrun("livemap", "privacy_broker", PrivacyBrokerTest, sys.argv)
