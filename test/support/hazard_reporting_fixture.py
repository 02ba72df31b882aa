"""A hazard_reporting nodelet in a process of its own, and the street it drives along."""

import math
import os
import signal
import tempfile

import cv2
import numpy
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Path
from sensor_msgs.msg import CameraInfo, Image, NavSatFix, NavSatStatus
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from livemap.msg import (BestViews, ChangedObjects, Detection, DetectionArray, HazardNotice, HazardPoll, HazardPollAnswer, HazardReport,
                         LinkState, ReportReceipt, VehiclePosition)
from node_testing import NodeletUnderTest, eventually, parameters_of

LATITUDE, LONGITUDE = 40.4433, -79.9436
EPOCH_S = 1600000000
SPEED_MPS = 16.0
COURSE_RAD = 0.9
CAMERA_FORWARD_M, CAMERA_HEIGHT_M = 1.5, 1.6
FOCAL_PX, WIDTH, HEIGHT = 500.0, 640, 400
OPTICAL = "camera_optical_frame"


def radii(latitude):
    """Radii of curvature of WGS84, north-south and east-west, metres."""
    equator, eccentricity2 = 6378137.0, 6.69437999014e-3
    root = math.sqrt(1 - eccentricity2 * math.sin(math.radians(latitude)) ** 2)
    return equator * (1 - eccentricity2) / root ** 3, equator / root


def place(east_m, north_m):
    """Latitude and longitude; good to a millimetre within some hundred metres of the start."""
    middle, _ = radii(LATITUDE)
    latitude = LATITUDE + math.degrees(north_m / middle)
    meridian, prime = radii((LATITUDE + latitude) / 2)
    latitude = LATITUDE + math.degrees(north_m / meridian)
    return latitude, LONGITUDE + math.degrees(east_m / prime / math.cos(math.radians(latitude)))


def east_north(latitude, longitude):
    meridian, prime = radii((LATITUDE + latitude) / 2)
    return (math.radians(longitude - LONGITUDE) * prime * math.cos(math.radians(latitude)),
            math.radians(latitude - LATITUDE) * meridian)


POTHOLE_HALF_DEPTH_M = 0.4  # config/hazards.yaml


def middle_on_street(time_s, forward_m, left_m=0.0):
    """Where the middle of a pothole is put whose near edge is there, seen from the vehicle."""
    farther = 1 + POTHOLE_HALF_DEPTH_M / math.hypot(forward_m, left_m)
    return on_street(time_s, farther * forward_m, farther * left_m)


def on_street(time_s, forward_m=0.0, left_m=0.0):
    """East and north of what lies so in base_link at that time of the drive."""
    way_m = SPEED_MPS * time_s + forward_m
    return (way_m * math.sin(COURSE_RAD) - left_m * math.cos(COURSE_RAD),
            way_m * math.cos(COURSE_RAD) + left_m * math.sin(COURSE_RAD))


def stamp(time_s):
    return rospy.Time.from_sec(0) + rospy.Duration(EPOCH_S) + rospy.Duration(time_s)


def fix(time_s, status=NavSatStatus.STATUS_FIX):
    message = NavSatFix()
    message.header.stamp = stamp(time_s)
    message.status.status = status
    message.latitude, message.longitude = place(*on_street(time_s))
    message.position_covariance = [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.04]
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return message


def detection(forward_m, left_m=0.0, class_name="pothole"):
    """What the detector says of a thing that stands there on the road."""
    depth_m = forward_m - CAMERA_FORWARD_M
    u = WIDTH / 2 - FOCAL_PX * left_m / depth_m
    v = HEIGHT / 2 + FOCAL_PX * CAMERA_HEIGHT_M / depth_m
    return Detection(class_name=class_name, confidence=0.8, x_min=u - 10, y_min=v - 12,
                     x_max=u + 10, y_max=v)


def detections(time_s, *found):
    message = DetectionArray(model="test", image_width=WIDTH, image_height=HEIGHT)
    message.header.stamp = stamp(time_s)
    message.header.frame_id = OPTICAL
    message.detections = list(found)
    return message


def camera_image(time_s):
    message = Image(width=WIDTH, height=HEIGHT, encoding="bgr8", step=3 * WIDTH)
    message.header.stamp = stamp(time_s)
    message.header.frame_id = OPTICAL
    message.data = bytes([30, 120, 60]) * (WIDTH * HEIGHT)
    return message


def decode(image):
    return cv2.imdecode(numpy.frombuffer(image.data, numpy.uint8), cv2.IMREAD_COLOR)


class Vehicle(NodeletUnderTest):
    """The nodelet, its database, and the test's ends of its topics."""

    def __init__(self, name, **parameters):
        super().__init__(name, "hazard_reporting")
        self.directory = tempfile.mkdtemp(prefix="livemap_vehicle_")
        self.database = os.path.join(self.directory, "memory", "hazards.sqlite3")
        # Masking may take long beside other tests, and no test here is about pictures that come too late.
        self.parameters = {"picture_wait_s": 50.0, **parameters, "database": self.database}
        self.process = None
        self.publishers = {
            topic: self.advertise(topic, message_class, latch=latch)
            for topic, message_class, latch in [
                ("hazard/detections", DetectionArray, False), *self.events(), ("camera_rect/image", Image, False),
                ("fix", NavSatFix, False), ("camera_rect/camera_info", CameraInfo, True),
                ("hazard/notice", HazardNotice, False), ("hazard/receipt", ReportReceipt, False),
                ("hazard/poll", HazardPoll, False), ("link_state", LinkState, True),
                ("change/report", ChangedObjects, False)]}
        for topic, message_class in [("hazard/report", HazardReport), ("vehicle/position", VehiclePosition),
                                     ("hazard/local_map", MarkerArray), ("path", Path),
                                     ("hazard/poll_answer", HazardPollAnswer)]:
            self.subscribe(topic, message_class)
        self.mounting = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self.ends.append(self.mounting)

    def uses_events(self):
        return self.parameters.get("use_events", True)

    def events(self):
        """The tracker's topics, where it counts."""
        if not self.uses_events():
            return []
        return [("hazard/events", DetectionArray, False), ("hazard/best_views", BestViews, False)]

    def link(self, state):
        self.publish("link_state", LinkState(state=state))

    def reports(self):
        return self.received("hazard/report")

    def start(self, wait=True):
        rospy.set_param(f"/{self.name}/hazard_reporting", dict(parameters_of("hazard_reporting"), **self.parameters))
        self.process = self.start_nodelet("hazard_reporting", "standalone", "livemap/HazardReportingNodelet")
        if wait:
            eventually(lambda: all(publisher.get_num_connections() > 0
                                   for publisher in self.publishers.values()), "it listens")

    def kill(self):
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        eventually(lambda: all(publisher.get_num_connections() == 0
                               for publisher in self.publishers.values()), "it is gone")

    def publish(self, topic, message):
        self.publishers[topic].publish(message)

    def mount_camera(self):
        """A camera that looks straight ahead."""
        info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob")
        centre_u, centre_v = WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5
        info.K = [FOCAL_PX, 0, centre_u, 0, FOCAL_PX, centre_v, 0, 0, 1]
        info.P = [FOCAL_PX, 0, centre_u, 0, 0, FOCAL_PX, centre_v, 0, 0, 0, 1, 0]
        info.header.frame_id = OPTICAL
        self.publish("camera_rect/camera_info", info)
        mounting = TransformStamped()
        mounting.header.frame_id = "base_link"
        mounting.child_frame_id = OPTICAL
        mounting.transform.translation.x = CAMERA_FORWARD_M
        mounting.transform.translation.z = CAMERA_HEIGHT_M
        rotation = mounting.transform.rotation
        rotation.x, rotation.y, rotation.z, rotation.w = -0.5, 0.5, -0.5, 0.5
        self.mounting.publish(TFMessage([mounting]))

    def drive(self, from_s, to_s):
        """Fixes at 10 Hz."""
        for tenth in range(round(10 * from_s), round(10 * to_s) + 1):
            self.publish("fix", fix(tenth / 10))

    def see(self, time_s, *found, image=None):
        """The camera's image, and what the detector says of it, and the tracker: the objects at their best view."""
        self.publish("camera_rect/image", image or camera_image(time_s))
        self.publish("hazard/detections", detections(time_s, *found))
        if self.uses_events() and found:
            self.publish("hazard/events", detections(time_s, *found))
