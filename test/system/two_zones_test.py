#!/usr/bin/python3
"""A vehicle drives from one zone into the next and back, each zone is killed on the way: nothing is lost, nothing is
doubled, and the driver is warned of what lies behind the border before the vehicle is there.

Everything is real: three ROS masters, two brokers, two zones with their stores, a signed zone directory, the vehicle's
nodelets. The test is the vehicle's receiver and detector.
"""

import concurrent.futures
import contextlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import uuid

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CameraInfo, NavSatFix, NavSatStatus

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts" / "lib"), str(ROOT / "test" / "support")]
import demo_observers as observers  # noqa: E402
import demo_system as system  # noqa: E402
from hazard_reporting_fixture import (FOCAL_PX, HEIGHT, OPTICAL, SPEED_MPS, WIDTH, detection, on_street,  # noqa: E402
                                      place)
from livemap.msg import CellHazards, DetectionArray, HazardAlert, HazardNotice, HazardReport, VehicleZones  # noqa: E402
from mqtt_bridge_fixture import Master, Peer  # noqa: E402
from node_testing import eventually  # noqa: E402

VEHICLE = "car-1"
BORDER_M = 280.0  # Along the way; all lengths below are.
STEP_M = SPEED_MPS / 10
SEEN_AHEAD_M = 12.0
IN_WEST_M = (60.0, 130.0)  # West is killed when the vehicle has just seen the first one.
BEHIND_THE_BORDER_M = 286.0  # Seen from before it.
OF_OTHERS_M = 305.0  # East knows it before the vehicle comes.
DEEP_IN_EAST_M = (380.0, 430.0)  # East is killed when the vehicle has just seen the first one.
SAME_PLACE_M = 3.0


def place_on_way(way_m):
    return place(*on_street(way_m / SPEED_MPS))


def square(west_deg, east_deg):
    latitude = place_on_way(0)[0]
    south, north = latitude - 0.03, latitude + 0.03
    return [[west_deg, south], [east_deg, south], [east_deg, north], [west_deg, north], [west_deg, south]]


class Zone:
    """A LiveMapSystem without a vehicle."""

    def __init__(self, folder, name):
        folder.mkdir()
        # A vehicle has one password for all brokers.
        credentials = folder / "broker" / "credentials"
        credentials.mkdir(parents=True, mode=0o700)
        (credentials / VEHICLE).write_text("password-of-the-vehicle\n")
        self.live_map = system.LiveMapSystem(folder, name, VEHICLE)
        self.live_map.zone_parameters = "{}"
        self.live_map.zone_arguments = {"detect_for_small": "false"}
        self.name = name

    def start(self):
        self.live_map.start_zone()
        self.map = observers.MapClient(self.live_map.url)

    def kill(self):
        """The zone and its bridge; the broker stays."""
        self.live_map.stop("zone", signal.SIGKILL)
        mark = f"ROS_MASTER_URI=http://127.0.0.1:{self.live_map.zone_port}".encode()
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if any(value.rstrip(b"/") == mark for value in (entry / "environ").read_bytes().split(b"\0")):
                    os.kill(int(entry.name), signal.SIGKILL)

    def feature(self, west_deg, east_deg):
        return {"type": "Feature", "id": self.name,
                "geometry": {"type": "Polygon", "coordinates": [square(west_deg, east_deg)]},
                "properties": {"brokers": [{"host": "127.0.0.1", "port": self.live_map.broker_port}]}}

    def hazards(self):
        return self.map.stored_hazards()


def sign_directory(folder, features):
    """The signed file and the authority's certificate."""
    text = folder / "zones.geojson"
    text.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    identity = folder / "identity"
    subprocess.run([system.program("livemap_zone_identity"), "init", str(identity), "--zone", "town"], check=True,
                   stdout=subprocess.DEVNULL)
    signed = folder / "zones.cms"
    subprocess.run([system.program("livemap_sign_directory"), str(text), "--out", str(signed), "--dir", str(identity),
                    "--checker", system.program("livemap_zone_directory")], check=True, stdout=subprocess.DEVNULL)
    return signed, identity / "authority" / "ca.pem"


def report_of_another(number):
    """What another vehicle has told east of the hazard behind the border."""
    latitude, longitude = place_on_way(OF_OTHERS_M)
    report = HazardReport(schema_version=HazardReport.SCHEMA_VERSION, vehicle_id=f"car-{number}", drive_id="yesterday",
                          stamp=rospy.Time.now(), class_name="pothole", confidence=0.9, x_min=300, y_min=200, x_max=340,
                          y_max=240, latitude=latitude, longitude=longitude, covariance=[0.2, 0, 0, 0.2],
                          image_width=WIDTH, image_height=HEIGHT, uuid=uuid.uuid4().bytes)
    report.image.header.stamp = report.stamp
    return report


class TwoZonesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("two_zones_test")
        cls.told, cls.zones, cls.values, cls.alerts = set(), [], {}, []
        cls.ends = [rospy.Subscriber("/hazard/cell_notice", HazardNotice, cls.keep_notice),
                    rospy.Subscriber("/hazard/cell_hazards", CellHazards, cls.keep_cells),
                    rospy.Subscriber("/zones", VehicleZones, cls.zones.append),
                    rospy.Subscriber("/hazard/alert", HazardAlert, cls.keep_alert),
                    rospy.Subscriber("/diagnostics", DiagnosticArray, cls.keep_diagnostics)]
        cls.fixes = rospy.Publisher("/fix", NavSatFix, queue_size=100)
        cls.detections = rospy.Publisher("/hazard/detections", DetectionArray, queue_size=100)
        cls.camera = rospy.Publisher("/camera_rect/camera_info", CameraInfo, queue_size=1, latch=True)
        folder = pathlib.Path(tempfile.mkdtemp(prefix="two-zones-"))
        cls.west, cls.east = Zone(folder / "west", "west"), Zone(folder / "east", "east")
        border_deg = place_on_way(BORDER_M)[1]
        cls.signed, cls.authority = sign_directory(
            folder, [cls.west.feature(border_deg - 0.05, border_deg), cls.east.feature(border_deg, border_deg + 0.05)])
        # Also when the start fails.
        for zone in (cls.west, cls.east):
            cls.addClassCleanup(zone.live_map.__exit__)
        with concurrent.futures.ThreadPoolExecutor() as starts:
            for _ in starts.map(Zone.start, (cls.west, cls.east)):
                pass
        cls.tell_east_of_the_hazard()
        cls.at_m, cls.direction = 0.0, 1
        cls.start_vehicle(folder / VEHICLE)

    @classmethod
    def keep_notice(cls, message):
        if message.action != HazardNotice.REMOVED:
            cls.told.add((message.zone, bytes(message.hazard_uuid)))

    @classmethod
    def keep_cells(cls, message):
        for hazard in message.hazards:
            if not hazard.removed:
                cls.told.add((message.zone, bytes(hazard.hazard_uuid)))

    @classmethod
    def told_by_east(cls):
        return {hazard for zone, hazard in set(cls.told) if zone == "east"}

    @classmethod
    def keep_alert(cls, message):
        """With the place of the vehicle."""
        cls.alerts.append((message, cls.at_m))

    @classmethod
    def keep_diagnostics(cls, message):
        for status in message.status:
            cls.values.setdefault(status.hardware_id, {}).update({pair.key: pair.value for pair in status.values})

    @classmethod
    def tell_east_of_the_hazard(cls):
        others = Peer(Master(cls.east.live_map.zone_master), {"pub:/hazard/report": HazardReport})
        try:
            for number in (7, 8, 9):
                others.publish("/hazard/report", report_of_another(number))
            eventually(lambda: [hazard for hazard in list(cls.east.map.hazards.values())
                                if hazard["properties"]["state"] == "active"], "east tells drivers of the hazard")
        finally:
            others.stop()

    @classmethod
    def start_vehicle(cls, folder):
        folder.mkdir()
        cls.west.live_map.start("vehicle", ["roslaunch", "--wait", system.launch_file("vehicle.launch")] + [
            f"{key}:={value}" for key, value in {
                "vehicle": VEHICLE, "zone": "west", "directory": folder, "detect": "false", "vo": "false",
                "broker_port": cls.west.live_map.broker_port, "password_file": cls.west.live_map.password_file(VEHICLE),
                "zone_directory": cls.signed, "zone_authority": cls.authority,
                "mqtt_bridge": "{zone_near_m: 60.0, zone_linger_s: 20.0}",
                "hazard_reporting": "{privacy: false, settle_wait_s: 0.0, resend_longest_s: 5.0}"}.items()],
            master=os.environ["ROS_MASTER_URI"])
        info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob")
        info.K = [FOCAL_PX, 0, WIDTH / 2 - 0.5, 0, FOCAL_PX, HEIGHT / 2 - 0.5, 0, 0, 1]
        info.P = [FOCAL_PX, 0, WIDTH / 2 - 0.5, 0, 0, FOCAL_PX, HEIGHT / 2 - 0.5, 0, 0, 0, 1, 0]
        info.header.frame_id = OPTICAL
        cls.camera.publish(info)
        eventually(lambda: cls.fixes.get_num_connections() and cls.detections.get_num_connections(),
                   "the vehicle's nodelets listen")
        eventually(lambda: cls.bridge("west.connected") == "True", "the vehicle is connected to west")

    @classmethod
    def bridge(cls, key):
        return cls.values.get("mqtt_bridge", {}).get(key)

    @classmethod
    def pending(cls):
        return cls.values.get("hazard_reporting", {}).get("pending")

    def tell_fix(self):
        message = NavSatFix()
        message.header.stamp = rospy.Time.now()
        message.status.status = NavSatStatus.STATUS_FIX
        message.latitude, message.longitude = place_on_way(self.at_m)
        message.position_covariance = [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.04]
        message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
        self.fixes.publish(message)
        return message.header.stamp

    def look(self, stamp, things_m):
        """What the detector finds in the image of a camera at this place."""
        found = [detection((thing_m - self.at_m) * self.direction) for thing_m in things_m
                 if abs((thing_m - self.at_m) * self.direction - SEEN_AHEAD_M) <= STEP_M / 2]
        message = DetectionArray(model="test", image_width=WIDTH, image_height=HEIGHT, detections=found)
        message.header.stamp, message.header.frame_id = stamp, OPTICAL
        self.detections.publish(message)

    def drive(self, to_m, things_m=()):
        """Ten fixes a second, to that place."""
        self.direction = 1 if to_m >= self.at_m else -1
        while (to_m - self.at_m) * self.direction >= STEP_M:
            self.at_m += self.direction * STEP_M
            self.look(self.tell_fix(), things_m)
            time.sleep(0.1)

    def stand_until(self, condition, what):
        """The vehicle stands; its receiver goes on."""
        def ticked():
            self.tell_fix()
            return condition()
        eventually(ticked, what)

    def assert_hazards(self, zone, expected_m):
        hazards = zone.hazards()
        for way_m in expected_m:
            latitude, longitude = place_on_way(way_m)
            here = [hazard for hazard in hazards if observers.distance_m(
                hazard, {"latitude": latitude, "longitude": longitude}) <= SAME_PLACE_M]
            self.assertEqual(len(here), 1, f"{zone.name} at {way_m} m, of {hazards}")
        self.assertEqual(len(hazards), len(expected_m), f"{zone.name}: {hazards}")

    def test_a_drive_across_the_border_and_back_loses_and_doubles_nothing_though_either_zone_is_killed(self):
        things_m = [*IN_WEST_M, BEHIND_THE_BORDER_M, OF_OTHERS_M, *DEEP_IN_EAST_M]
        self.drive(IN_WEST_M[0] - SEEN_AHEAD_M + 2 * STEP_M, things_m)
        self.west.kill()
        self.drive(230.0, things_m)
        # Before the border: east talks to the vehicle, though the vehicle still is in west, which is dead.
        self.stand_until(self.told_by_east, "the hazard behind the border is known")
        self.assertEqual(self.zones[-1].zones, ["west", "east"])
        self.assertEqual(self.bridge("present_zone"), "west")
        self.assertIn(self.pending(), ("1", "2"), "what was seen since waits for west")
        self.drive(340.0, things_m)
        self.assert_warned_before_the_border()
        self.stand_until(lambda: len(self.east.hazards()) == 2, "east has the hazard that was seen from before the border")
        self.assertEqual(self.bridge("present_zone"), "east")
        self.assertIn(self.pending(), ("1", "2"), "east does not answer for west")
        self.west.live_map.launch_zone()
        self.stand_until(lambda: self.pending() == "0", "west has answered")
        self.drive(DEEP_IN_EAST_M[0] - SEEN_AHEAD_M + 2 * STEP_M, things_m)
        self.east.kill()
        self.drive(460.0, things_m)
        self.stand_until(lambda: self.pending() in ("1", "2"), "what was seen since waits for east")
        waiting = self.pending()
        # Back into west, and so far that east is no longer near. Just after the turn the course is not sure yet.
        self.drive(180.0, [thing_m for thing_m in things_m if thing_m < 400.0])
        self.stand_until(lambda: self.bridge("present_zone") == "west" and self.zones[-1].zones == ["west"],
                         "the vehicle is in west again")
        self.assertEqual(self.pending(), waiting, "west does not answer for east")
        self.east.live_map.launch_zone()
        self.stand_until(lambda: self.pending() == "0", "east has answered")
        self.assert_hazards(self.west, IN_WEST_M)
        self.assert_hazards(self.east, (BEHIND_THE_BORDER_M, OF_OTHERS_M, *DEEP_IN_EAST_M))

    def assert_warned_before_the_border(self):
        announced = self.told_by_east()
        warned_at_m = [at_m for alert, at_m in self.alerts
                       if alert.state == HazardAlert.APPROACH and bytes(alert.hazard_uuid) in announced]
        self.assertTrue(warned_at_m, self.alerts)
        self.assertLess(warned_at_m[0], BORDER_M, "the driver is warned too late")


if __name__ == "__main__":
    rostest.rosrun("livemap", "two_zones", TwoZonesTest)
