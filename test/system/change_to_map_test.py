#!/usr/bin/python3
"""Semantic change detection, end to end: simulated passes of one street, two vehicles, the zone's live map.

Everything is real but the detector, whose answers are the bags' labels, so that nothing but the change decides: two ROS masters,
mosquitto, vehicle.launch with the network of change, zone.launch.
"""

import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

import rosbag
import rospy
import rostest
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts" / "lib"), str(ROOT / "test" / "support")]
import demo_system as system  # noqa: E402
from demo_observers import parse_time  # noqa: E402
from listening_port import free_port  # noqa: E402
from node_testing import eventually  # noqa: E402

SPEED_MPS, SECONDS, RATE_HZ = 8, 15, 5
# A third of the speed: the network has the time it has on a vehicle, whatever else this machine does.
REPLAY_RATE = 0.35
REMOVED_M, STANDING_M, BARRIER_M = 42, 66, 88
LEFT_M = -3.4
LATITUDE, LONGITUDE = 48.8566, 9.0  # Of the world's origin; the road goes east.
BEFORE = [("road_work_sign", REMOVED_M), ("road_work_sign", STANDING_M)]
AFTER = [("road_work_sign", STANDING_M), ("barrier", BARRIER_M)]
VEHICLES = ("car-1", "car-2")
# Single pictures place an object too far by the few pixels by which its mask is too small.
NEAR_M = 8
AFTER_THE_DRIVE_S = 6


def simulate(folder, name, hazards, condition):
    """A bag of a pass with its labels."""
    world = folder / (name + ".yaml")
    world.write_text(yaml.safe_dump({
        "road": {"bearing_deg": 90, "pieces": [{"length_m": 400}], "crossings_m": []},
        "scene": {"buildings": True, "trees": True, "parked_cars": False},
        "hazards": [{"class": kind, "at_m": at, "left_m": LEFT_M} for kind, at in hazards]}), encoding="ascii")
    bag = folder / (name + ".bag")
    done = subprocess.run(
        [system.program("livemap_simulate"), "--seed", "5", "--world", str(world), "--condition", condition, "--bag", str(bag),
         "--size", "512x384", "--one-ray", "--seconds", str(SECONDS), "--rate", str(RATE_HZ), "--speed", str(SPEED_MPS),
         "--fix-noise-m", "0.2", "--multipath-m", "0"], capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return bag


def later(bag, days):
    """The same pass on another day: the simulator's drives all begin at one moment."""
    shifted, delay = bag.with_suffix(".later.bag"), rospy.Duration(86400 * days)
    with rosbag.Bag(str(bag)) as source, rosbag.Bag(str(shifted), "w") as target:
        for topic, message, stamp in source.read_messages():
            for stamped in [message, *getattr(message, "transforms", [])]:
                if hasattr(stamped, "header"):
                    stamped.header.stamp += delay
            target.write(topic, message, stamp + delay)
    return shifted


def along(longitude):
    """Metres along the road from its start."""
    radius, flattening = 6378137.0, 0.00669438
    sine = math.sin(math.radians(LATITUDE))
    return math.radians(longitude - LONGITUDE) * radius * math.cos(math.radians(LATITUDE)) / math.sqrt(1 - flattening * sine * sine)


class Zone(system.LiveMapSystem):
    """A zone that asks about a hazard as soon as it doubts, the same vehicle as often as it passes, and lets two denials do:
    the default asks for more where many were sure."""

    zone_parameters = ("{replay: true, poll_price_s: 1.0, poll_same_vehicle_gap_s: 0.1, max_evidence_per_hour: 100000.0, "
                       "max_presence: 0.9, gone_below: 0.28}")

    zone_arguments = {"detect_for_small": "false"}

    def __init__(self, directory):
        super().__init__(directory, "test", ",".join(VEHICLES))

    def start_pass(self, vehicle, bag, drive):
        """`vehicle` drives down the street once, with what it remembers of its other drives."""
        self.vehicle_port = free_port()
        self.vehicle_master = f"http://127.0.0.1:{self.vehicle_port}"
        self.launch(f"{vehicle}-{drive}", self.vehicle_port, "replay.launch", {
            "bag": bag, "rate": REPLAY_RATE, "delay": 8, "vehicle": vehicle, "zone": self.zone, "drive": drive,
            "directory": self.directory / vehicle, "broker_port": self.broker_port,
            "password_file": self.password_file(vehicle), "use_truth": "true", "vo": "false",
            "changes": "true"})

    def end_pass(self, vehicle, bag, drive):
        """When the vehicle has told the zone where the bag ends, and what it saw there."""
        end_s = system.read_bag(bag).start_s + system.read_bag(bag).duration_s
        eventually(lambda: self.position_time(vehicle, drive) > end_s - 1.5, f"{vehicle} drives to the end")
        time.sleep(AFTER_THE_DRIVE_S)
        self.stop(f"{vehicle}-{drive}")

    def position_time(self, vehicle, drive):
        """Of the newest position of that drive, seconds of the bag; 0 when there is none."""
        self.check_alive()
        return max([parse_time(feature["properties"]["time"]) for feature in self.features("vehicles")
                    if (feature["properties"]["vehicle"], feature["properties"]["drive"]) == (vehicle, drive)], default=0)

    def features(self, what):
        with urllib.request.urlopen(f"{self.url}api/v1/{what}", timeout=10) as answer:
            return json.load(answer)["features"]

    def places(self, what, **properties):
        """(metres along the road, properties) of the features with these properties."""
        return sorted((round(along(feature["geometry"]["coordinates"][0]), 1), feature["properties"])
                      for feature in self.features(what)
                      if all(feature["properties"].get(key) == value for key, value in properties.items()))

    def is_active(self, at_m):
        """Whether the map tells drivers of a sign there."""
        return any(abs(place - at_m) < NEAR_M for place, _ in self.places("hazards", **{"class": "road_work_sign"}, state="active"))


class ChangeToMapTest(unittest.TestCase):
    """The tests are the chapters of one story, in this order."""

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="livemap_change_to_map_"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.monday = simulate(cls.folder, "monday", BEFORE, "day")
        cls.zone = Zone(cls.folder)
        cls.addClassCleanup(cls.zone.__exit__)
        cls.zone.start_zone()

    def drive(self, bag, drive, vehicles=VEHICLES, together=False):
        for vehicle in vehicles:
            self.zone.start_pass(vehicle, bag, drive)
            if not together:
                self.zone.end_pass(vehicle, bag, drive)
        for vehicle in vehicles if together else ():
            self.zone.end_pass(vehicle, bag, drive)

    def test_1_the_first_pass_puts_the_signs_on_the_map_and_tells_no_change(self):
        self.drive(self.monday, "monday", together=True)
        for sign_m in (REMOVED_M, STANDING_M):
            eventually(lambda at_m=sign_m: self.zone.is_active(at_m), f"two vehicles have seen the sign at {sign_m} m")
        self.assertEqual(self.zone.features("changes"), [])

    def test_2_a_pass_in_another_season_with_nothing_changed_changes_nothing(self):
        self.drive(later(simulate(self.folder, "winter", BEFORE, "snow"), 1), "winter", VEHICLES[:1])
        time.sleep(2)
        self.assertEqual(self.zone.places("changes"), [])
        self.assertTrue(self.zone.is_active(REMOVED_M) and self.zone.is_active(STANDING_M), self.zone.places("hazards"))

    def test_3_a_removed_sign_leaves_the_map_a_standing_one_stays_and_a_new_barrier_appears(self):
        self.drive(later(simulate(self.folder, "tuesday", AFTER, "day"), 2), "tuesday")
        eventually(lambda: not self.zone.is_active(REMOVED_M), "the removed sign leaves the map")
        self.assertTrue(self.zone.is_active(STANDING_M), self.zone.places("hazards"))
        barriers = eventually(lambda: self.zone.places("changes", direction="appeared", **{"class": "barrier"}), "the barrier is told")
        self.assertEqual(len(barriers), 1, barriers)
        self.assertLess(abs(barriers[0][0] - BARRIER_M), NEAR_M)
        # Whether the sign that went is told, and as what, is not sure yet: docs/results/change.md.
        for place, properties in self.zone.places("changes"):
            self.assertLess(min(abs(place - changed_m) for changed_m in (REMOVED_M, BARRIER_M)), NEAR_M, (place, properties))


if __name__ == "__main__":
    rostest.rosrun("livemap", "change_to_map", ChangeToMapTest)
