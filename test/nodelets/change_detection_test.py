#!/usr/bin/python3
"""change_detection as the vehicle runs it, on simulated passes of one street.

The method is DAISY: it needs no weights and tells no classes, and these passes are such that it can cope with them: by day, without
trees and parked cars, and the second one on the first one's line, at its speed, with pictures of a lower quality. What parallax, light
and season do is measured by `livemap evaluate change`, not here.
"""

import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy
import rosbag
import rospy
import rostest
import yaml
from sensor_msgs.msg import CameraInfo, Image, NavSatFix
from tf2_msgs.msg import TFMessage

from livemap.msg import ChangedObject, ChangedObjects, MapChange, ReportReceipt
sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import NodeletUnderTest, eventually, parameters_of, program  # noqa: E402

SECONDS, RATE_HZ = 9, 5
BARRIER_M, SIGN_M, NEW_BARRIER_M = 34, 48, 60
BEFORE = [("barrier", BARRIER_M), ("road_work_sign", SIGN_M)]
AFTER = [("barrier", BARRIER_M), ("barrier", NEW_BARRIER_M)]
LEFT_M = -3.4
LATITUDE, LONGITUDE = 48.8566, 9.0  # Of the world's origin; the road goes east.
UNKNOWN = 255


def simulate(folder, name, hazards, quality):
    """A bag of a pass, with a receiver that knows where it is."""
    world = os.path.join(folder, name + ".yaml")
    with open(world, "w", encoding="utf-8") as file:
        yaml.safe_dump({
            "road": {"bearing_deg": 90, "pieces": [{"length_m": 400}], "crossings_m": []},
            "scene": {"buildings": True, "trees": False, "parked_cars": False},
            "hazards": [{"class": kind, "at_m": at, "left_m": LEFT_M} for kind, at in hazards],
        }, file)
    bag = os.path.join(folder, name + ".bag")
    done = subprocess.run(
        [program("livemap", "livemap_simulate"), "--seed", "5", "--world", world, "--bag", bag, "--size", "320x256", "--one-ray",
         "--seconds", str(SECONDS), "--rate", str(RATE_HZ), "--speed", "8", "--fix-noise-m", "0.02", "--multipath-m", "0",
         "--jpeg-quality", str(quality)], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return bag


def along_left(latitude, longitude):
    """Metres along the road from its start, and to the left of its middle line."""
    radius = 6378137.0
    north = math.radians(latitude - LATITUDE) * radius * (1 - 0.00669438) / (1 - 0.00669438 * math.sin(math.radians(LATITUDE)) ** 2) ** 1.5
    east = math.radians(longitude - LONGITUDE) * radius * math.cos(math.radians(LATITUDE)) / math.sqrt(
        1 - 0.00669438 * math.sin(math.radians(LATITUDE)) ** 2)
    return east, north


class Vehicle(NodeletUnderTest):
    """The nodelet in a namespace of its own, which drives one pass of the street."""

    def __init__(self, name, places, drive, **parameters):
        super().__init__(name, "change_detection")
        settings = {"method": "daisy", "directory": places, "drive_id": drive, "spacing_m": 1.0, "remember_spacing_m": 1.0,
                    "diagnostics_period_s": 0.1}
        rospy.set_param(f"/{name}/change_detection", dict(parameters_of("change_detection"), **dict(settings, **parameters)))
        self.image = self.advertise("camera_rect/image", Image)
        self.info = self.advertise("camera_rect/camera_info", CameraInfo)
        self.fix = self.advertise("fix", NavSatFix)
        self.receipt = self.advertise("change/receipt", ReportReceipt)
        self.mounting = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self.ends.append(self.mounting)
        for topic, kind in (("change/report", ChangedObjects), ("change/mask", Image), ("change/overlay", Image),
                            ("change/map_change", MapChange)):
            self.subscribe(topic, kind)
        self.process = self.start_nodelet("change_detection", "standalone", "livemap/ChangeDetectionNodelet")

    def count(self, *keys):
        values = self.diagnostics()
        return sum(int(values.get(key, 0)) for key in keys)

    def accounted(self):
        """Images of which the nodelet knows what became of them."""
        return self.count("frames_displaced", "frames_no_pose", "frames_no_camera", "frames_near", "frames_skipped_busy",
                          "frames_unusable", "frames_looked_at")

    def listen(self):
        eventually(lambda: self.image.get_num_connections() and self.info.get_num_connections() and
                   self.fix.get_num_connections(), "it listens")
        eventually(self.diagnostics, "it speaks")

    def drive(self, path, hurried=False):
        """Plays a bag; each image waits until the last one is dealt with, unless the vehicle is `hurried`."""
        self.listen()
        sent = 0
        with rosbag.Bag(path) as bag:
            fixes = [message for _, message, _ in bag.read_messages(["/fix"])]
            for topic, message, _ in bag.read_messages(["/tf_static", "/camera/camera_info", "/camera/image_raw/compressed"]):
                if topic == "/tf_static":
                    self.mounting.publish(message)
                    rospy.sleep(0.5)
                elif topic == "/camera/camera_info":
                    self.info.publish(message)
                else:
                    until = message.header.stamp + rospy.Duration(0.4)
                    while fixes and fixes[0].header.stamp <= until:
                        self.fix.publish(fixes.pop(0))
                    self.image.publish(self.decoded(message))
                    sent += 1
                    if not hurried:
                        eventually(lambda: self.accounted() >= sent, f"image {sent} is dealt with: {self.diagnostics()}")
        eventually(lambda: self.accounted() == sent, f"all {sent} images are dealt with: {self.diagnostics()}")
        return sent

    @staticmethod
    def decoded(message):
        pixels = cv2.imdecode(numpy.frombuffer(message.data, numpy.uint8), cv2.IMREAD_COLOR)
        image = Image(header=message.header, height=pixels.shape[0], width=pixels.shape[1], encoding="bgr8",
                      step=3 * pixels.shape[1])
        image.data = pixels.tobytes()
        return image

    def reports(self):
        """Of the pictures that were compared with earlier ones."""
        return [report for report in self.received("change/report") if report.outcome == ChangedObjects.COMPARED]

    def objects(self):
        """All that were ever told, as they were told last: (along, left, message)."""
        last = {}
        for report in self.reports():
            for each in report.objects:
                last[each.id] = each
        return [(*along_left(each.latitude, each.longitude), each) for each in last.values()]


class ChangeDetectionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("change_detection_test")
        cls.folder = tempfile.mkdtemp(prefix="livemap_change_")
        cls.first = simulate(cls.folder, "first", BEFORE, 95)
        cls.places = os.path.join(cls.folder, "places")
        vehicle = Vehicle("first", cls.places, "monday")
        try:
            cls.first_images = vehicle.drive(cls.first)
            cls.first_diagnostics = vehicle.diagnostics()
            cls.first_reports = vehicle.reports()
            cls.first_outcomes = vehicle.received("change/report")
            # As a vehicle ends that nobody asks: what was told to be remembered is.
            os.killpg(vehicle.process.pid, 9)
            vehicle.process.wait()
        finally:
            vehicle.stop()

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def second(self, name, bag, **parameters):
        """A vehicle that remembers the first pass, in a memory of its own."""
        directory = os.path.join(self.folder, "places_" + name)
        shutil.copytree(self.places, directory)
        vehicle = Vehicle(name, directory, "tuesday", **parameters)
        self.addCleanup(vehicle.stop)
        if bag is not None:
            vehicle.drive(bag)
        return vehicle

    def test_1_the_first_pass_is_remembered_and_tells_nothing(self):
        values = self.first_diagnostics
        self.assertEqual(int(values["frames_in"]), self.first_images)
        self.assertEqual(values["pictures_compared"], "0")
        self.assertEqual(values["pictures_without_earlier"], values["frames_looked_at"])
        # A picture every 1.6 m, or at crossings and at the start less.
        self.assertGreater(int(values["places"]), 30, values)
        self.assertEqual(values["places"], values["pictures_remembered"])
        self.assertEqual(self.first_reports, [])
        self.assertEqual({report.outcome for report in self.first_outcomes}, {ChangedObjects.NOTHING_EARLIER})
        self.assertEqual(len(self.first_outcomes), int(values["frames_looked_at"]))

    def test_2_the_second_pass_tells_what_went_and_what_came(self):
        # DAISY's score is a distance and says little of how sure it is.
        vehicle = self.second("changed", simulate(self.folder, "changed", AFTER, 80), tell_confidence=0.0)
        self.assertGreater(vehicle.count("pictures_compared"), 20, vehicle.diagnostics())
        self.assertEqual(vehicle.count("registered_by_edges", "registered_by_features"), vehicle.count("pictures_compared"))
        reports, objects = vehicle.reports(), vehicle.objects()
        self.assertEqual(len(reports), vehicle.count("pictures_compared"))
        for report in reports:
            self.assertEqual((report.drive_id, report.earlier_drive_id, report.method), ("tuesday", "monday", "daisy"))
            self.assertGreaterEqual(report.known_share, 0.5)
            for each in report.objects:
                self.assertGreaterEqual(each.seen, 3, "said from too few pictures")
                self.assertGreater(each.last_seen, each.first_seen)
        where = [(round(along, 1), round(left, 1), each.direction) for along, left, each in objects]
        gone = [each for along, _, each in objects if abs(along - SIGN_M) < 6]
        came = [each for along, _, each in objects if abs(along - NEW_BARRIER_M) < 6]
        self.assertTrue(gone, f"the sign is not missed: {where}")
        self.assertTrue(came, f"the barrier is not seen: {where}")
        self.assertIn(ChangedObject.VANISHED, [each.direction for each in gone])
        self.assertNotIn(ChangedObject.VANISHED, [each.direction for each in came])
        for along, left, each in objects:
            self.assertLess(abs(left - LEFT_M), 4, where)
            covariance = numpy.reshape(each.covariance, (2, 2))
            self.assertTrue((numpy.linalg.eigvalsh(covariance) > 0).all())
            self.assertGreater(abs(along - BARRIER_M), 5, f"the barrier stands as it did: {where}")

        masks, overlays = vehicle.received("change/mask"), vehicle.received("change/overlay")
        self.assertGreater(len(masks), 0)
        self.assertGreater(len(overlays), 0)
        stamps = [report.header.stamp for report in reports]
        for mask in masks:
            self.assertEqual((mask.encoding, mask.width, mask.height), ("mono8", 320, 256))
            self.assertIn(mask.header.stamp, stamps)
            values = set(numpy.frombuffer(mask.data, numpy.uint8).tolist())
            self.assertLessEqual(values, {*range(10), UNKNOWN})
        self.assertEqual(overlays[0].encoding, "bgr8")
        self.check_what_the_zone_is_told(vehicle)

    def check_what_the_zone_is_told(self, vehicle):
        """Each object that was passed, again and again until the zone has answered."""
        told = vehicle.count("changes_told")
        self.assertGreater(told, 0, vehicle.diagnostics())
        eventually(lambda: len({bytes(each.uuid) for each in vehicle.received("change/map_change")}) == told, "all are sent")
        eventually(lambda: vehicle.count("changes_resent") > 0, "what nobody answers is sent again")
        changes = {bytes(each.uuid): each for each in vehicle.received("change/map_change")}
        signs = [each for each in changes.values() if abs(along_left(each.latitude, each.longitude)[0] - SIGN_M) < 6]
        self.assertIn(MapChange.VANISHED, [each.direction for each in signs], "the sign is passed and gone")
        for each in changes.values():
            self.assertEqual((each.schema_version, each.vehicle_id, each.drive_id, each.class_name),
                             (MapChange.SCHEMA_VERSION, "", "tuesday", "other_objects"))
            self.assertGreaterEqual(each.seen, 3)
            self.assertGreater(each.stamp, rospy.Time(1))
        for uuid in changes:
            vehicle.receipt.publish(ReportReceipt(schema_version=ReportReceipt.SCHEMA_VERSION, status=ReportReceipt.COMMITTED,
                                                  report_uuid=uuid, hazard_uuid=uuid))
        vehicle.wait_for(changes_committed=told, changes_pending=0)

    def test_3_a_pass_with_nothing_changed_tells_nothing(self):
        vehicle = self.second("same", simulate(self.folder, "same", BEFORE, 80))
        self.assertGreater(vehicle.count("pictures_compared"), 20, vehicle.diagnostics())
        self.assertEqual(vehicle.objects(), [])

    def test_4_pictures_that_come_faster_than_they_are_compared_are_skipped_and_counted(self):
        vehicle = self.second("hurried", None)
        sent = vehicle.drive(self.first, hurried=True)
        self.assertEqual(vehicle.count("frames_in"), sent)
        self.assertEqual(vehicle.accounted(), sent)
        self.assertGreater(vehicle.count("frames_skipped_busy"), 0, vehicle.diagnostics())

    def test_5_a_damaged_memory_is_mended_and_said(self):
        directory = os.path.join(self.folder, "damaged")
        shutil.copytree(self.places, directory)
        with open(os.path.join(directory, "places.sqlite3"), "wb") as file:
            file.write(b"not a database" * 1000)
        for more in ("-wal", "-shm"):
            if os.path.exists(os.path.join(directory, "places.sqlite3" + more)):
                os.remove(os.path.join(directory, "places.sqlite3" + more))
        vehicle = Vehicle("damaged", directory, "tuesday")
        self.addCleanup(vehicle.stop)
        vehicle.listen()
        self.assertEqual(vehicle.diagnostics()["places"], self.first_diagnostics["places"])
        self.assertIn("the index of places was corrupt", vehicle.output())

    def test_6_wrong_parameters_are_one_sentence(self):
        for name, parameters, expected in (
                ("no_model", {"method": "network"}, "'model' is empty"),
                ("other_method", {"method": "guess"}, "accepted"),
                ("one_picture", {"min_seen": 1}, "min_seen"),
                ("no_directory", {"directory": ""}, "'directory' is empty"),
                ("no_such_model", {"method": "network", "model": "/nowhere/net.yaml"}, "/nowhere/net.yaml"),
                ("misspelt", {"spacing": 3}, "spacing")):
            vehicle = Vehicle(name, os.path.join(self.folder, "unused"), "tuesday", **parameters)
            self.addCleanup(vehicle.stop)
            eventually(lambda: expected in vehicle.output(), f"{name}: {expected}")

    def test_7_an_image_that_is_not_its_cameras_is_dropped_and_counted(self):
        vehicle = self.second("odd", None, width_px=640)
        vehicle.listen()
        with rosbag.Bag(self.first) as bag:
            for _, message, _ in bag.read_messages(["/tf_static"]):
                vehicle.mounting.publish(message)
            for _, message, _ in bag.read_messages(["/fix"]):
                vehicle.fix.publish(message)
            _, info, _ = next(bag.read_messages(["/camera/camera_info"]))
            vehicle.info.publish(info)
            rospy.sleep(1)
            images = [message for _, message, _ in bag.read_messages(["/camera/image_raw/compressed"])]
            image = vehicle.decoded(images[20])
        image.width, image.height = image.width // 2, image.height * 2
        image.step = 3 * image.width
        vehicle.image.publish(image)
        vehicle.wait_for(frames_unusable=1)
        self.assertIn("its camera_info accepts 320x256", vehicle.output())


if __name__ == "__main__":
    rostest.rosrun("livemap", "change_detection", ChangeDetectionTest)
