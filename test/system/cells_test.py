#!/usr/bin/python3
"""A vehicle hears of the hazards in the cells of the map around it, and of no others, wherever it drives; what it was not
told while it was away, off or cut off, it is told when it is there.

Everything is real: two ROS masters, the broker, the zone with its store, the vehicle's nodelets. The test is the
vehicle's receiver, and other vehicles' reports.
"""

import contextlib
import itertools
import json
import math
import os
import pathlib
import signal
import sqlite3
import sys
import tempfile
import time
import unittest
import urllib.request
import uuid

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import NavSatFix, NavSatStatus

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts" / "lib"), str(ROOT / "test" / "support")]
import demo_observers as observers  # noqa: E402
import demo_system as system  # noqa: E402
from hazard_reporting_fixture import COURSE_RAD, place  # noqa: E402
from livemap.msg import CellHazards, HazardNotice, HazardReport, VehicleCells  # noqa: E402
from mqtt_bridge_fixture import Master, Peer  # noqa: E402
from node_testing import eventually  # noqa: E402

ZONE, VEHICLE = "town", "car-1"
OFFICIAL, TOKEN = "miller", "correct-horse-battery-staple"
# Along the way, m. Cells are 0.93 km wide here, and heard of up to 0.7 km away.
HOME_M, AWAY_M = 0.0, 3600.0
RADIUS_M = 300.0
STEP_M = 4.0  # Ten fixes a second.
SAME_PLACE_M = 3.0


def place_on_way(way_m):
    return place(way_m * math.sin(COURSE_RAD), way_m * math.cos(COURSE_RAD))


def lies_at(way_m, latitude, longitude):
    there = dict(zip(("latitude", "longitude"), place_on_way(way_m)))
    return observers.distance_m({"latitude": latitude, "longitude": longitude}, there) <= SAME_PLACE_M


class CellsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("cells_test")
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="cells-"))
        tokens = cls.folder / "officials"
        tokens.write_text(f"{OFFICIAL} {TOKEN}\n")
        tokens.chmod(0o600)
        cls.live_map = system.LiveMapSystem(cls.folder, ZONE, VEHICLE)
        cls.addClassCleanup(cls.live_map.__exit__)
        cls.live_map.zone_parameters = f"{{web_token_file: {tokens}}}"
        cls.live_map.zone_arguments = {"detect_for_small": "false"}
        cls.live_map.start_zone()
        cls.map = observers.MapClient(cls.live_map.url)
        cls.others = Peer(Master(cls.live_map.zone_master), {"pub:/hazard/report": HazardReport})
        cls.addClassCleanup(cls.others.stop)
        cls.heard, cls.to_all, cls.cells, cls.values = [], [], [], {}
        cls.ends = [rospy.Subscriber("/hazard/cell_notice", HazardNotice, cls.keep_notice),
                    rospy.Subscriber("/hazard/cell_hazards", CellHazards, cls.keep_cells),
                    rospy.Subscriber("/hazard/notice", HazardNotice, cls.to_all.append),
                    rospy.Subscriber("/vehicle/cells_heard", VehicleCells, cls.cells.append),
                    rospy.Subscriber("/diagnostics", DiagnosticArray, cls.keep_diagnostics)]
        cls.fixes = rospy.Publisher("/fix", NavSatFix, queue_size=100)
        cls.at_m = HOME_M
        cls.numbers = itertools.count(7)

    @classmethod
    def keep_notice(cls, message):
        cls.heard.append((message.latitude, message.longitude))

    @classmethod
    def keep_cells(cls, message):
        cls.heard += [(hazard.latitude, hazard.longitude) for hazard in message.hazards if not hazard.removed]

    @classmethod
    def keep_diagnostics(cls, message):
        for status in message.status:
            cls.values.setdefault(status.hardware_id, {}).update({pair.key: pair.value for pair in status.values})

    def start_vehicle(self):
        directory = self.folder / VEHICLE
        directory.mkdir(exist_ok=True)
        self.live_map.start("vehicle", ["roslaunch", "--wait", system.launch_file("vehicle.launch")] + [
            f"{key}:={value}" for key, value in {
                "vehicle": VEHICLE, "zone": ZONE, "directory": directory, "detect": "false", "vo": "false",
                "alerts": "false", "broker_port": self.live_map.broker_port,
                "password_file": self.live_map.password_file(VEHICLE),
                "hazard_reporting": f"{{privacy: false, cell_radius_m: {RADIUS_M}, cell_refresh_s: 10.0}}"}.items()],
            master=os.environ["ROS_MASTER_URI"])
        eventually(self.fixes.get_num_connections, "the vehicle's nodelets listen")

    def kill_with_master(self, master, kind=b""):
        """All processes of that ROS master, but this one, in whose command line `kind` stands."""
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                words = (entry / "environ").read_bytes().split(b"\0")
                is_meant = kind in (entry / "cmdline").read_bytes() and int(entry.name) != os.getpid()
                if is_meant and any(word.rstrip(b"/") == f"ROS_MASTER_URI={master}".encode().rstrip(b"/") for word in words):
                    os.kill(int(entry.name), signal.SIGKILL)

    def kill_vehicle(self):
        self.live_map.stop("vehicle", signal.SIGKILL)
        self.kill_with_master(os.environ["ROS_MASTER_URI"], b"nodelet")
        eventually(lambda: not self.fixes.get_num_connections(), "the vehicle is gone")

    def report(self, way_m):
        """Three other vehicles see it: the zone announces it. Returns its id."""
        latitude, longitude = place_on_way(way_m)
        for _ in range(3):
            # Each of them is at one place only.
            report = HazardReport(schema_version=HazardReport.SCHEMA_VERSION, vehicle_id=f"car-{next(self.numbers)}", drive_id="x",
                                  stamp=rospy.Time.now(), class_name="pothole", confidence=0.9, x_min=300, y_min=200,
                                  x_max=340, y_max=240, latitude=latitude, longitude=longitude,
                                  covariance=[0.2, 0, 0, 0.2], image_width=640, image_height=480, uuid=uuid.uuid4().bytes)
            report.image.header.stamp = report.stamp
            self.others.publish("/hazard/report", report)

        def announced():
            return [hazard for hazard in list(self.map.hazards.values())
                    if hazard["properties"]["state"] == "active"
                    and lies_at(way_m, *reversed(hazard["geometry"]["coordinates"][:2]))]
        return eventually(announced, f"the zone tells drivers of the hazard at {way_m} m")[0]["properties"]["id"]

    def reject(self, hazard):
        request = urllib.request.Request(
            f"{self.live_map.url}api/v1/hazards/{hazard}/reject", data=json.dumps({"reason": "there is none"}).encode(),
            headers={"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=20) as answer:
            self.assertEqual(answer.status, 200)

    def known(self):
        """What stands in the vehicle's local map, latitude and longitude."""
        path = self.folder / VEHICLE / "local_hazards.sqlite3"
        if not path.exists():
            return []
        with contextlib.suppress(sqlite3.OperationalError), contextlib.closing(
                sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=5)) as database:
            return database.execute("SELECT latitude, longitude FROM known WHERE of_zone=1").fetchall()
        return []

    def knows(self, way_m):
        return any(lies_at(way_m, *known) for known in self.known())

    def has_heard(self, way_m):
        return any(lies_at(way_m, *heard) for heard in list(self.heard))

    def tell_fix(self):
        message = NavSatFix()
        message.header.stamp = rospy.Time.now()
        message.status.status = NavSatStatus.STATUS_FIX
        message.latitude, message.longitude = place_on_way(self.at_m)
        message.position_covariance = [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.04]
        message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
        self.fixes.publish(message)

    def drive(self, to_m):
        direction = 1 if to_m >= self.at_m else -1
        while (to_m - self.at_m) * direction >= STEP_M:
            self.at_m += direction * STEP_M
            self.tell_fix()
            time.sleep(0.1)

    def stand_until(self, condition, what):
        """The vehicle stands; its receiver goes on."""
        def ticked():
            self.tell_fix()
            return condition()
        try:
            eventually(ticked, what)
        except AssertionError as error:
            raise AssertionError(f"{error}; known are {self.known()}, of the nodelets {self.values}") from None

    def test_a_vehicle_knows_what_is_around_it_wherever_it_drives_and_hears_of_nothing_else(self):
        at_home = self.report(HOME_M + 40)
        self.report(AWAY_M + 40)
        self.start_vehicle()
        self.stand_until(lambda: self.knows(HOME_M + 40), "what was there before it came is known")

        # The one that is further away comes first: it would have been heard.
        self.report(AWAY_M + 80)
        self.report(HOME_M + 80)
        self.stand_until(lambda: self.knows(HOME_M + 80), "what comes to be near it is known")
        for way_m in (AWAY_M + 40, AWAY_M + 80):
            self.assertFalse(self.knows(way_m))
            self.assertFalse(self.has_heard(way_m), "what is far away is not sent to the vehicle")

        self.drive(AWAY_M)
        self.stand_until(lambda: self.knows(AWAY_M + 40) and self.knows(AWAY_M + 80), "what is near now is known")

        # It is off when one is removed where it was, and another comes to be where it is.
        self.assertTrue(self.knows(HOME_M + 40))
        self.kill_vehicle()
        self.reject(at_home)
        self.report(AWAY_M + 120)
        self.start_vehicle()
        self.stand_until(lambda: self.knows(AWAY_M + 120), "what came to be while it was off is known")
        self.assertTrue(self.knows(HOME_M + 40), "it is not there, so nobody has told it")

        self.drive(HOME_M)
        self.stand_until(lambda: not self.knows(HOME_M + 40), "what was removed while it was away disappears")
        self.assertTrue(self.knows(HOME_M + 80))
        for way_m in (AWAY_M + 40, AWAY_M + 80, AWAY_M + 120):
            self.assertTrue(self.knows(way_m), "what it knew of other cells it still knows")

        # The broker dies with all that it had.
        self.live_map.stop("broker", signal.SIGKILL)
        for path in (self.folder / "broker").glob("**/mosquitto.db"):
            path.unlink()
        self.stand_until(lambda: self.values["mqtt_bridge"].get("connected") == "False", "the connection is lost")
        self.report(HOME_M + 120)
        self.live_map.start_broker()
        self.stand_until(lambda: self.knows(HOME_M + 120), "what came to be while it was cut off is known")

        # The zone's process dies.
        self.live_map.stop("zone", signal.SIGKILL)
        self.kill_with_master(self.live_map.zone_master)
        self.live_map.launch_zone()
        type(self).map = observers.MapClient(self.live_map.url)
        type(self).others = Peer(Master(self.live_map.zone_master), {"pub:/hazard/report": HazardReport})
        self.addCleanup(self.others.stop)
        self.report(HOME_M + 160)
        self.stand_until(lambda: self.knows(HOME_M + 160), "a zone that was killed goes on")
        self.assertTrue(self.knows(HOME_M + 80))
        self.assertFalse(self.knows(HOME_M + 40))
        self.assertEqual([notice for notice in self.to_all if notice.sequence], [],
                         "nothing was told to everybody, nor around the vehicle")


if __name__ == "__main__":
    rostest.rosrun("livemap", "cells", CellsTest)
