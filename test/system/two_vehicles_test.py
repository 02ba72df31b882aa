#!/usr/bin/python3
"""Two vehicles: the driver of the second is warned of what the first one saw a moment ago.

Everything is real: three ROS masters, mosquitto, the zone with its store, both vehicles' nodelets. The first vehicle
replays the committed drive, whose labels stand in for the detector; the second one has no camera at all, and its
receiver is this test.
"""

import math
import os
import pathlib
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import rospy
import rostest
from sensor_msgs.msg import NavSatFix, NavSatStatus

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts" / "lib"), str(ROOT / "test" / "support")]
import demo_observers as observers  # noqa: E402
import demo_system as system  # noqa: E402
from livemap.msg import HazardAlert  # noqa: E402
from node_testing import eventually  # noqa: E402

ZONE, FIRST, SECOND = "test", "car-1", "car-2"
MOST_SECONDS = 2.0  # From the zone's commit to the alert.
SPEED_MPS = 10.0
START_M = 150.0  # Of the second vehicle before the hazard.
RUN_UP_S = 4.0  # Driven by the second one before the first goes on.
# Two hazards of the committed drive's street (rosbags/town.geojson): the second vehicle drives through both.
FROM, TO = (9.000296171120556, 48.85664146641328), (9.000535970496031, 48.856732550917044)
METRES_PER_DEGREE = 111_195.0


def towards_the_hazard():
    """The unit vector east, north of the second vehicle's way."""
    east = (TO[0] - FROM[0]) * METRES_PER_DEGREE * math.cos(math.radians(TO[1]))
    north = (TO[1] - FROM[1]) * METRES_PER_DEGREE
    length = math.hypot(east, north)
    return east / length, north / length


def fix(before_m):
    """A fix so many metres before the hazard."""
    east, north = towards_the_hazard()
    message = NavSatFix()
    message.header.stamp = rospy.Time.now()
    message.status.status = NavSatStatus.STATUS_FIX
    message.longitude = TO[0] - before_m * east / (METRES_PER_DEGREE * math.cos(math.radians(TO[1])))
    message.latitude = TO[1] - before_m * north / METRES_PER_DEGREE
    message.position_covariance = [0.25, 0, 0, 0, 0.25, 0, 0, 0, 1]
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return message


def uuid_text(octets):
    text = bytes(octets).hex()
    return "-".join((text[:8], text[8:12], text[12:16], text[16:20], text[20:]))


class TwoVehiclesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("two_vehicles_test")
        cls.alerts = []
        cls.ends = [rospy.Subscriber("/hazard/alert", HazardAlert, lambda alert: cls.alerts.append((time.time(), alert)))]
        cls.fixes = rospy.Publisher("/fix", NavSatFix, queue_size=10)
        cls.directory = pathlib.Path(tempfile.mkdtemp(prefix="two-vehicles-"))
        cls.live_map = system.LiveMapSystem(cls.directory, ZONE, f"{FIRST},{SECOND}")
        cls.live_map.start_zone()
        cls.live_map.vehicle = FIRST
        cls.live_map.start_vehicle(system.package_file("rosbags/town.bag"), 1.0, use_truth="true", vo="false", delay=0,
                                   hazard_reporting="{privacy: false}")
        cls.start_second()
        cls.map = observers.MapClient(cls.live_map.url)

    @classmethod
    def tearDownClass(cls):
        cls.live_map.__exit__()

    @classmethod
    def start_second(cls):
        """A phone's profile. It is told early, so that what comes late is late."""
        (cls.directory / SECOND).mkdir()
        cls.live_map.start("second", ["roslaunch", "--wait", system.launch_file("vehicle.launch")] + [
            f"{key}:={value}" for key, value in {
                "vehicle": SECOND, "zone": ZONE, "directory": cls.directory / SECOND, "profile": "small",
                "broker_port": cls.live_map.broker_port, "password_file": cls.live_map.password_file(SECOND),
                "driver_alert": "{min_lead_s: 14.0, alert_above: 0.2}"}.items()],
            master=os.environ["ROS_MASTER_URI"])
        eventually(lambda: cls.fixes.get_num_connections() and cls.ends[0].get_num_connections(),
                   "the second vehicle's nodelets listen")

    def pause_first(self):
        environment = dict(os.environ, ROS_MASTER_URI=self.live_map.vehicle_master, ROS_HOSTNAME="127.0.0.1")
        subprocess.check_call(["rosservice", "call", "/player/pause_playback", "data: true"], env=environment,
                              stdout=subprocess.DEVNULL)

    def drive_second(self, until):
        """Five fixes a second, until the time has come or the hazard is reached."""
        for tick in range(round(5 * (START_M - 15) / SPEED_MPS)):
            if until():
                return
            self.fixes.publish(fix(START_M - SPEED_MPS * tick / 5))
            time.sleep(0.2)

    def approaches(self, seen_before):
        """Hazard and time of every approach that was told, of those that the map did not have before."""
        return {uuid_text(alert.hazard_uuid): when for when, alert in list(self.alerts)
                if alert.state == HazardAlert.APPROACH and uuid_text(alert.hazard_uuid) not in seen_before}

    def test_the_second_driver_is_warned_of_what_the_first_vehicle_has_just_seen(self):
        self.live_map.play()
        eventually(self.map.seen, "the first vehicle's first hazard on the map")
        self.pause_first()
        time.sleep(1)
        before = self.map.seen()
        began = time.time()
        resumed = threading.Timer(RUN_UP_S, self.live_map.play)
        resumed.start()
        self.drive_second(lambda: self.approaches(before))
        resumed.join()
        told = self.approaches(before)
        self.assertTrue(told, f"no approach was told; on the map: {self.map.first_heard.keys() - before}, after "
                              f"{time.time() - began:.1f} s, alerts {[(a.state, a.distance) for _, a in self.alerts]}")
        for hazard, when in told.items():
            _, on_the_map = self.map.first_heard[hazard]
            self.assertLess(when - on_the_map, MOST_SECONDS, "from the report's commit to the alert, s")


if __name__ == "__main__":
    rostest.rosrun("livemap", "two_vehicles", TwoVehiclesTest)
