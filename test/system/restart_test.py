#!/usr/bin/python3
"""Broker, zone or vehicle manager is killed in the middle of a drive: the map ends up the same.

Everything is real: two ROS masters, mosquitto, the zone with its store, the vehicle's nodelets. The
drive's labels stand in for the detector, so that the comparison does not hang on a model.
"""

import contextlib
import os
import pathlib
import signal
import sys
import tempfile
import unittest
import xmlrpc.client

import rosgraph
import rospy
import rostest
from std_srvs.srv import SetBool

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts" / "lib"), str(ROOT / "test" / "support")]
import demo_observers as observers  # noqa: E402
import demo_system as system  # noqa: E402
from node_testing import PATIENCE_S, eventually  # noqa: E402

ZONE, VEHICLE = "test", "car-1"
# A vehicle that was killed has forgotten the sights before: its next report of a hazard lies elsewhere.
SAME_PLACE_M = {"broker": 0.5, "zone": 0.5, "vehicle": 4.0}


class Drive:
    """One replay of the committed drive through a whole LiveMap."""

    def __init__(self, directory, bag):
        self.bag, self.drive = bag, system.read_bag(bag)
        directory.mkdir()
        self.live_map = system.LiveMapSystem(directory, ZONE, VEHICLE)
        # This process stands on the vehicle's master, which rostest started.
        self.live_map.vehicle_master = os.environ["ROS_MASTER_URI"]
        self.live_map.vehicle_port = None

    def __enter__(self):
        self.live_map.start_zone()
        self.start_vehicle()
        self.map = observers.MapClient(self.live_map.url)
        return self

    def __exit__(self, *_):
        self.live_map.__exit__()

    def start_vehicle(self):
        self.live_map.start("vehicle", ["roslaunch", "--wait", system.launch_file("replay.launch")] + [
            f"{key}:={value}" for key, value in {
                "bag": self.bag, "paused": "true", "delay": 0, "use_truth": "true", "vo": "false",
                "vehicle": VEHICLE, "zone": ZONE,
                # Nobody is in the town, and the masks' work would let a busy machine drop frames. How many further
                # sights a report waits for differs from run to run, and with them its place.
                "hazard_reporting": "{privacy: false, settle_wait_s: 0.0}",
                "directory": self.live_map.directory / "vehicle",
                "broker_port": self.live_map.broker_port,
                "password_file": self.live_map.password_file(VEHICLE)}.items()],
            master=self.live_map.vehicle_master)
        self.watch_vehicle()
        self.vehicle.wait_until_up(PATIENCE_S, ("hazard_reporting", "mqtt_bridge"))

    def watch_vehicle(self):
        self.vehicle = observers.VehicleObserver(self.live_map.vehicle_master)

    def play(self):
        self.live_map.play()

    def pause(self):
        rospy.ServiceProxy("/player/pause_playback", SetBool)(True)

    def play_until(self, share):
        """Until this share of the drive's detections has been seen by hazard_reporting."""
        eventually(lambda: self.vehicle.clock_share(self.drive) >= share,
                   f"the replay reaches {share:.0%}")

    def finish(self):
        """The hazards on the map when the drive is over and every report is answered."""
        self.play_until(1.0)
        # Two seconds beyond the end the diagnostics know of the last frames: which wait for their pictures.
        end_s = self.drive.start_s + self.drive.duration_s
        eventually(lambda: self.vehicle.clock_s() > end_s + 2, "the clock goes on beyond the end")
        eventually(lambda: self.vehicle.counts()["frames_waiting"] == self.vehicle.counts()["reports_settling"] == 0,
                   "every frame is reported")
        eventually(lambda: self.vehicle.counts()["pending"] == 0, "every report is committed")
        return self.map.stored_hazards()


class RestartTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.victim = rospy.myargv()[1]
        cls.directory = pathlib.Path(tempfile.mkdtemp(prefix=f"restart-{cls.victim}-"))
        cls.bag = system.package_file("rosbags/town.bag")
        with Drive(cls.directory / "undisturbed", cls.bag) as drive:
            drive.play()
            cls.expected = drive.finish()

    def test_the_map_is_the_same_after_a_kill_in_the_middle(self):
        self.assertGreaterEqual(len(self.expected), 3, "hazards of the undisturbed drive")
        with Drive(self.directory / "disturbed", self.bag) as drive:
            drive.play()
            drive.play_until(0.3)
            getattr(self, "kill_" + self.victim)(drive)
            found = drive.finish()
        self.assert_same_hazards(found)

    def kill_broker(self, drive):
        drive.live_map.stop("broker", signal.SIGKILL)
        drive.play_until(0.6)
        drive.live_map.start_broker()

    def kill_zone(self, drive):
        # Roslaunch first, or it would tidy up; then what it started.
        drive.live_map.stop("zone", signal.SIGKILL)
        processes = self.processes_of(drive.live_map.zone_port)
        self.assertGreaterEqual(len(processes), 2, "zone_cloudlet and its bridge run")
        for process in processes:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        drive.play_until(0.6)
        drive.live_map.launch_zone()

    def kill_vehicle(self, drive):
        # Without a broker the reports pile up in the vehicle's store; then its process dies. The car
        # stands meanwhile: what it does not look at, it cannot report.
        drive.live_map.stop("broker", signal.SIGKILL)
        drive.play_until(0.6)
        drive.pause()
        # A frame that waits for its picture is no report yet, and dies with the process.
        eventually(lambda: drive.vehicle.counts()["frames_waiting"] == drive.vehicle.counts()["reports_settling"] == 0,
                   "every frame is reported")
        self.assertGreater(drive.vehicle.counts()["pending"], 0, "reports wait in the store")
        manager = rosgraph.Master("/restart_test").lookupNode("/vehicle_manager")
        os.kill(xmlrpc.client.ServerProxy(manager).getPid("/restart_test")[2], signal.SIGKILL)
        drive.watch_vehicle()
        drive.vehicle.wait_until_up(PATIENCE_S, ("hazard_reporting", "mqtt_bridge"))
        self.assertGreater(drive.vehicle.counts()["pending"], 0, "reports survived in the store")
        drive.live_map.start_broker()
        drive.play()

    @staticmethod
    def processes_of(master_port):
        """Processes whose ROS master is at this port."""
        marks = {f"ROS_MASTER_URI=http://127.0.0.1:{master_port}{end}".encode() for end in ("", "/")}
        found = []
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                if marks & set((entry / "environ").read_bytes().split(b"\0")):
                    found.append(int(entry.name))
            except OSError:
                continue
        return found

    def assert_same_hazards(self, found):
        left = list(found)
        for hazard in self.expected:
            twins = [each for each in left if each["class"] == hazard["class"]
                     and observers.distance_m(each, hazard) <= SAME_PLACE_M[self.victim]]
            twin = min(twins, key=lambda each: observers.distance_m(each, hazard), default=None)
            self.assertIsNotNone(twin, f"missing after the restart: {hazard}; there are {found}")
            left.remove(twin)
        self.assertEqual(left, [], "hazards that the undisturbed drive does not have")


if __name__ == "__main__":
    rostest.rosrun("livemap", "restart_test", RestartTest)
