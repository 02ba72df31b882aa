#!/usr/bin/python3
"""The zone_cloudlet node by its topics: reports in, receipts, notices, markers and the store out."""

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import urllib.request
import uuid

import cv2
import numpy
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from livemap.msg import (HazardNotice, HazardPoll, HazardPollAnswer, HazardReport, MapChange,
                         ReportReceipt, VehiclePosition)
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import PATIENCE_S, eventually, program  # noqa: E402


def make_report(latitude=40.44, longitude=-79.94, class_name="pothole", vehicle_id="car-1"):
    report = HazardReport(schema_version=HazardReport.SCHEMA_VERSION)
    report.uuid = uuid.uuid4().bytes
    report.vehicle_id = vehicle_id
    report.drive_id = "drive-1"
    report.stamp = rospy.Time.from_sec(time.time() - 1)
    report.class_name = class_name
    report.confidence = 0.5
    report.x_min, report.y_min, report.x_max, report.y_max = 10, 20, 110, 90
    report.latitude, report.longitude = latitude, longitude
    report.covariance = [1.0, 0.0, 0.0, 1.0]
    report.image_width, report.image_height = 640, 480
    return report


def make_map_change(vehicle_id="car-1", direction=MapChange.APPEARED):
    change = MapChange(schema_version=MapChange.SCHEMA_VERSION, vehicle_id=vehicle_id, drive_id="drive-1",
                       class_name="barrier", direction=direction, confidence=0.5, seen=5, missed=1,
                       latitude=40.44, longitude=-79.94, covariance=[1.0, 0.0, 0.0, 1.0])
    change.uuid = uuid.uuid4().bytes
    change.stamp = rospy.Time.from_sec(time.time() - 1)
    change.earlier_stamp = rospy.Time.from_sec(time.time() - 86400)
    return change


def make_position(vehicle_id, latitude, longitude, map_sequence=0, course=1.0):
    return VehiclePosition(
        schema_version=VehiclePosition.SCHEMA_VERSION, vehicle_id=vehicle_id, drive_id="drive-1",
        stamp=rospy.Time.from_sec(time.time()), latitude=latitude, longitude=longitude,
        course=course, speed=10.0, horizontal_sigma=2.0, map_sequence=map_sequence)


class Inbox:
    """What came on one topic."""

    def __init__(self, topic, message_class):
        self.lock = threading.Lock()
        self.messages = []
        self.subscriber = rospy.Subscriber(topic, message_class, self.add, queue_size=10000)

    def add(self, message):
        with self.lock:
            self.messages.append(message)

    def all(self):
        with self.lock:
            return list(self.messages)

    def clear(self):
        with self.lock:
            self.messages.clear()


class ZoneCloudletTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("zone_cloudlet_test")
        cls.receipts = Inbox("hazard/receipt", ReportReceipt)
        cls.notices = Inbox("hazard/notice", HazardNotice)
        cls.own_notices = Inbox("hazard/vehicle_notice", HazardNotice)
        cls.polls = Inbox("hazard/poll", HazardPoll)
        cls.answers = rospy.Publisher("hazard/poll_answer", HazardPollAnswer, queue_size=100)
        cls.markers = Inbox("hazard/markers", MarkerArray)
        cls.diagnostics = Inbox("/diagnostics", DiagnosticArray)
        cls.reports = rospy.Publisher("hazard/report", HazardReport, queue_size=1000)
        cls.map_changes = rospy.Publisher("change/map_change", MapChange, queue_size=100)
        cls.change_receipts = Inbox("change/receipt", ReportReceipt)
        cls.positions = rospy.Publisher("vehicle/position", VehiclePosition, queue_size=1000)

    def setUp(self):
        self.directory = tempfile.mkdtemp(prefix="livemap_zone_")
        self.process = None
        self.start()

    def tearDown(self):
        self.stop(signal.SIGKILL)
        shutil.rmtree(self.directory, ignore_errors=True)

    def command(self, **parameters):
        values = {"directory": os.path.join(self.directory, "zone"), "web_port": 0,
                  "marker_period_s": 0.1, "diagnostics_period_s": 0.2, "join_gap_s": 600.0,
                  # The vehicles here do not know of cells.
                  "cell_wait_s": 0.0,
                  "catch_up_lag_s": 0.2, "catch_up_retry_s": 0.2, "catch_up_longest_retry_s": 0.4}
        values.update(parameters)
        return ([program("livemap", "zone_cloudlet"), "__name:=zone_cloudlet"] +
                [f"_{name}:={value}" for name, value in values.items()])

    def start(self):
        for inbox in (self.receipts, self.notices, self.own_notices, self.polls, self.markers, self.diagnostics,
                      self.change_receipts):
            inbox.clear()
        self.process = subprocess.Popen(self.command(), start_new_session=True)
        eventually(lambda: self.reports.get_num_connections() == 1 and
                   self.positions.get_num_connections() == 1 and
                   self.receipts.subscriber.get_num_connections() == 1 and
                   self.answers.get_num_connections() == 1 and
                   self.map_changes.get_num_connections() == 1 and
                   self.change_receipts.subscriber.get_num_connections() == 1 and
                   self.polls.subscriber.get_num_connections() == 1 and
                   self.own_notices.subscriber.get_num_connections() == 1 and
                   self.notices.subscriber.get_num_connections() == 1, "the zone connects")

    def stop(self, signal_number):
        if self.process is None:
            return
        os.killpg(self.process.pid, signal_number)
        self.process.wait(PATIENCE_S)
        self.process = None
        eventually(lambda: self.reports.get_num_connections() == 0, "the zone is gone")

    def restart(self, signal_number):
        self.stop(signal_number)
        self.start()

    def send(self, report):
        """Publishes a report and returns its receipt."""
        count = len(self.receipts.all())
        self.reports.publish(report)
        eventually(lambda: len(self.receipts.all()) > count, "a receipt")
        receipt = self.receipts.all()[-1]
        self.assertEqual(receipt.report_uuid, report.uuid)
        return receipt

    def rows(self, query):
        """Straight from the file."""
        path = os.path.join(self.directory, "zone", "zone.sqlite3")
        with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as database:
            return sorted(database.execute(query))

    def stored(self):
        return self.rows("SELECT uuid, class_name, latitude, longitude, sightings FROM hazards")

    def stored_map_changes(self):
        return self.rows("SELECT uuid, state, vehicles, reports FROM map_changes")

    def count(self, key):
        for message in reversed(self.diagnostics.all()):
            for status in message.status:
                if status.hardware_id == "zone_cloudlet":
                    return int({pair.key: pair.value for pair in status.values}.get(key, -1))
        return -1

    def test_a_report_is_answered_announced_stored_and_shown(self):
        report = make_report()
        receipt = self.send(report)
        self.assertEqual(receipt.status, ReportReceipt.COMMITTED)
        self.assertEqual(receipt.vehicle_id, "car-1")
        hazard_id = str(uuid.UUID(bytes=receipt.hazard_uuid))
        self.assertEqual(self.stored(), [(hazard_id, "pothole", 40.44, -79.94, 1)])
        self.assertEqual(self.notices.all(), [], "one vehicle's word is none for drivers")
        self.send(make_report(vehicle_id="car-2"))
        notice = eventually(self.notices.all, "a notice")[0]
        self.assertEqual(notice.action, HazardNotice.ADDED)
        self.assertEqual(notice.hazard_uuid, receipt.hazard_uuid)
        self.assertEqual((notice.previous_sequence, notice.vehicle_id), (0, ""))
        self.assertEqual(notice.sightings, 2)
        self.assertEqual(notice.first_seen, report.stamp)
        spheres = eventually(
            lambda: [m for a in self.markers.all() for m in a.markers if m.ns == "hazards"],
            "markers")[-1]
        self.assertEqual(spheres.header.frame_id, "map")
        # The first hazard is the datum.
        self.assertAlmostEqual(spheres.points[0].x, 0.0, places=3)
        self.assertAlmostEqual(spheres.points[0].y, 0.0, places=3)
        port = rospy.get_param("/livemap/web_port")
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/v1/hazards") as answer:
            features = json.load(answer)["features"]
        self.assertEqual([feature["id"] for feature in features], [hazard_id])

    def test_a_repeated_report_is_one_sighting_and_another_report_nearby_a_second(self):
        report = make_report()
        first = self.send(report)
        again = self.send(report)
        self.assertEqual(again.status, ReportReceipt.COMMITTED)
        self.assertEqual(again.hazard_uuid, first.hazard_uuid)
        self.assertEqual([row[4] for row in self.stored()], [1])
        for number, vehicle in enumerate(("car-2", "car-3"), start=2):
            other = self.send(make_report(latitude=40.44001, vehicle_id=vehicle))
            self.assertEqual(other.hazard_uuid, first.hazard_uuid)
            self.assertEqual([row[4] for row in self.stored()], [number])
        eventually(lambda: self.count("reports_repeated") == 1, "the repetition is counted")
        eventually(lambda: self.count("reports_merged") == 2, "the sightings are counted")
        eventually(lambda: [n.action for n in self.notices.all()] ==
                   [HazardNotice.ADDED, HazardNotice.UPDATED], "drivers are told by the second vehicle")
        added, updated = self.notices.all()
        self.assertEqual(updated.previous_sequence, added.sequence, "nothing lies in between")

    def test_a_restart_keeps_the_same_hazards_and_knows_the_old_reports(self):
        report = make_report(class_name="<img src=x onerror=alert(1)>")
        first = self.send(report)
        self.send(make_report(latitude=40.45, vehicle_id="car-2"))
        before = self.stored()
        for signal_number in (signal.SIGINT, signal.SIGKILL):
            self.restart(signal_number)
            self.assertEqual(self.stored(), before)
            self.assertEqual(self.send(report).hazard_uuid, first.hazard_uuid)
            self.assertEqual(self.stored(), before)
            eventually(lambda: self.count("hazards_on_map") == 2, "both hazards are on the map")

    def test_hostile_reports_are_refused_with_a_reason_and_leave_nothing(self):
        bad_position = make_report(latitude=float("nan"))
        huge_name = make_report(class_name="x" * 1000000)
        negative = make_report()
        negative.covariance = [-1.0, 0.0, 0.0, 1.0]
        not_a_picture = make_report()
        not_a_picture.image.data = b"GIF89a" + bytes(100)
        newer_schema = make_report()
        newer_schema.schema_version = 99
        for report, word in ((bad_position, "position"), (huge_name, "class name"),
                             (negative, "covariance"), (not_a_picture, "picture"),
                             (newer_schema, "schema version")):
            receipt = self.send(report)
            self.assertEqual(receipt.status, ReportReceipt.REFUSED)
            self.assertIn(word, receipt.reason)
            self.assertEqual(receipt.hazard_uuid, bytes(16))
        self.assertEqual(self.stored(), [])
        eventually(lambda: self.count("reports_refused") == 4, "refusals are counted")
        eventually(lambda: self.count("reports_malformed") == 1, "the unknown schema is counted")

    def tell(self, change):
        """Publishes a map change and returns its receipt."""
        count = len(self.change_receipts.all())
        self.map_changes.publish(change)
        eventually(lambda: len(self.change_receipts.all()) > count, "a receipt")
        receipt = self.change_receipts.all()[-1]
        self.assertEqual((receipt.report_uuid, receipt.vehicle_id), (change.uuid, change.vehicle_id))
        return receipt

    def test_a_map_change_is_answered_stored_and_counts_once(self):
        change = make_map_change()
        first = self.tell(change)
        self.assertEqual(first.status, ReportReceipt.COMMITTED)
        feature = str(uuid.UUID(bytes=first.hazard_uuid))
        for signal_number in (None, signal.SIGKILL):
            if signal_number:
                self.restart(signal_number)
            self.assertEqual(self.tell(change).hazard_uuid, first.hazard_uuid)
            self.assertEqual(self.stored_map_changes(), [(feature, 0, 1, 1)])
        self.tell(make_map_change("car-2"))
        self.assertEqual(self.stored_map_changes(), [(feature, 1, 2, 2)], "two vehicles confirm")
        eventually(lambda: self.count("map_changes_confirmed") == 1, "it is counted")
        self.assertEqual(self.count("map_changes_repeated"), 1)
        for vehicle in ("car-3", "car-4"):
            self.assertEqual(self.tell(make_map_change(vehicle, MapChange.VANISHED)).hazard_uuid, first.hazard_uuid)
        self.assertEqual(self.stored_map_changes(), [(feature, 2, 2, 2)], "two tell the opposite")

    def test_hostile_map_changes_are_refused_with_a_reason_and_leave_nothing(self):
        changes = [make_map_change() for _ in range(4)]
        changes[0].latitude = float("nan")
        changes[1].class_name = "no_change"
        changes[2].direction = 7
        changes[3].schema_version = 99
        for change, word in zip(changes, ("position", "accepted is barrier", "direction 7", "schema version")):
            receipt = self.tell(change)
            self.assertEqual((receipt.status, receipt.hazard_uuid), (ReportReceipt.REFUSED, bytes(16)))
            self.assertIn(word, receipt.reason)
        self.assertEqual(self.stored_map_changes(), [])

    def told(self, vehicle):
        """What this vehicle alone was told, until the end of a catch-up."""
        notices = [n for n in self.own_notices.all() if n.vehicle_id == vehicle]
        return notices if notices and notices[-1].action == HazardNotice.CAUGHT_UP else None

    def report_by_two(self, **place):
        receipt = self.send(make_report(vehicle_id="car-8", **place))
        self.send(make_report(vehicle_id="car-9", **place))
        return receipt

    def test_a_joining_vehicle_alone_is_told_what_is_around_it_once(self):
        near = self.report_by_two()
        # 111 km away: other vehicles, for none drives so fast.
        for vehicle in ("car-6", "car-7"):
            self.send(make_report(latitude=41.44, vehicle_id=vehicle))
        announced = eventually(lambda: self.notices.all()[1:], "both are announced")[-1].sequence
        self.notices.clear()
        self.positions.publish(make_position("car-2", 40.45, -79.94))
        told = eventually(lambda: self.told("car-2"), "the vehicle is told")
        self.assertEqual([(n.action, n.hazard_uuid) for n in told],
                         [(HazardNotice.ADDED, near.hazard_uuid), (HazardNotice.CAUGHT_UP, bytes(16))])
        self.assertEqual(told[0].class_name, "pothole")
        self.assertEqual((told[1].sequence, told[1].previous_sequence, told[1].told), (announced, 0, 1))
        self.assertEqual(told[1].radius, 5000)
        self.positions.publish(make_position("car-2", 40.4501, -79.94, map_sequence=announced))
        eventually(lambda: self.count("vehicle_positions") == 2, "both positions arrive")
        self.assertEqual(len(self.own_notices.all()), 2)
        self.assertEqual(self.notices.all(), [], "nobody else hears of it")
        eventually(lambda: [m for a in self.markers.all() for m in a.markers
                            if m.ns == "vehicles" and m.type == Marker.ARROW], "a vehicle marker")

    def test_a_vehicle_that_missed_announcements_is_told_those_alone(self):
        self.report_by_two()
        first = eventually(self.notices.all, "it is announced")[0].sequence
        self.positions.publish(make_position("car-2", 40.44, -79.94))
        eventually(lambda: self.told("car-2"), "the vehicle is told")
        self.positions.publish(make_position("car-2", 40.44, -79.94, map_sequence=first))
        self.own_notices.clear()
        missed = self.report_by_two(latitude=40.4405)
        second = eventually(lambda: self.notices.all()[1:], "the second is announced")[0]
        self.assertEqual(second.previous_sequence, first)

        def still_behind():
            self.positions.publish(make_position("car-2", 40.44, -79.94, map_sequence=first))
            return self.told("car-2")
        told = eventually(still_behind, "it is told what it missed")
        self.assertEqual([n.hazard_uuid for n in told[:2]], [missed.hazard_uuid, bytes(16)])
        self.assertEqual((told[1].previous_sequence, told[1].sequence), (first, second.sequence))
        eventually(lambda: self.count("vehicles_behind") >= 1, "it is counted")

    def test_a_notice_of_a_new_hazard_carries_a_small_picture(self):
        pixels = numpy.full((480, 640, 3), 120, numpy.uint8)
        cv2.rectangle(pixels, (10, 20), (110, 90), (0, 0, 255), 3)
        picture = cv2.imencode(".jpg", pixels)[1].tobytes()
        for vehicle in ("car-1", "car-2"):
            report = make_report(vehicle_id=vehicle)
            report.image.format, report.image.data = "jpeg", picture
            self.send(report)
        notice = eventually(self.notices.all, "a notice")[0]
        self.assertEqual(notice.image.format, "jpeg")
        self.assertLessEqual(len(notice.image.data), 4096)
        small = cv2.imdecode(numpy.frombuffer(notice.image.data, numpy.uint8), cv2.IMREAD_COLOR)
        self.assertLessEqual(small.shape[1], 192)

    def test_an_answer_to_no_poll_is_refused_and_counted(self):
        answer = HazardPollAnswer(schema_version=HazardPollAnswer.SCHEMA_VERSION, poll_uuid=bytes([1] * 16),
                                  hazard_uuid=bytes([2] * 16), vehicle_id="car-1", confidence=0.5,
                                  latitude=40.44, longitude=-79.94)
        answer.stamp = rospy.Time.from_sec(time.time())
        self.answers.publish(answer)
        eventually(lambda: self.count("answers_refused") == 1, "an invented poll is counted")
        answer.confidence = float("nan")
        self.answers.publish(answer)
        eventually(lambda: self.count("answers_refused") == 2, "nonsense is counted, too")

    def test_a_position_that_is_none_is_dropped_and_counted(self):
        self.positions.publish(make_position("car-2", float("nan"), 0.0))
        eventually(lambda: self.count("vehicle_positions_refused") == 1, "the position is counted")

    def refusal(self, *arguments, **parameters):
        """Exit code and standard error of a node started with these parameters."""
        command = self.command(**parameters)
        command[1] = "__name:=refused_zone"
        done = subprocess.run(command + list(arguments), timeout=PATIENCE_S, text=True,
                              stderr=subprocess.PIPE, check=False)
        if rospy.has_param("/refused_zone"):
            rospy.delete_param("/refused_zone")
        return done.returncode, done.stderr

    def test_wrong_parameters_and_arguments_are_one_sentence_and_an_exit_code(self):
        self.stop(signal.SIGKILL)
        for parameters, words in (({"directory": ""}, "directory"),
                                  ({"directory": "/dev/null/zone"}, "/dev/null/zone"),
                                  ({"zone_bounds": "1,2,3"}, "zone_bounds"),
                                  ({"map_datum": "91,0"}, "map_datum"),
                                  ({"web_port": 70000}, "web_port"),
                                  ({"hazards": "/nowhere.yaml"}, "/nowhere.yaml"),
                                  ({"batch_report": 3}, "batch_report")):
            code, text = self.refusal(**parameters)
            self.assertEqual(code, 1, text)
            self.assertIn(words, text)
        code, text = self.refusal("--colour")
        self.assertEqual(code, 2, text)
        self.assertIn("--colour", text)

    def test_a_corrupt_store_is_refused_and_left_alone(self):
        self.stop(signal.SIGKILL)
        path = os.path.join(self.directory, "zone", "zone.sqlite3")
        for end in ("-wal", "-shm"):
            if os.path.exists(path + end):
                os.remove(path + end)
        with open(path, "wb") as file:
            file.write(b"x" * 5000)
        code, text = self.refusal()
        self.assertEqual(code, 1, text)
        self.assertIn(path, text)
        with open(path, "rb") as file:
            self.assertEqual(file.read(), b"x" * 5000)


if __name__ == "__main__":
    rostest.rosrun("livemap", "zone_cloudlet", ZoneCloudletTest, sys.argv)
