#!/usr/bin/python3
"""A zone gives the signed zone directory to the vehicles that it hears, by its bridge and a real mosquitto; a vehicle that
knows one broker and the authority's certificate keeps it."""

import datetime
import json
import math
import os
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))

import rostest  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from livemap.msg import VehiclePosition  # noqa: E402
from node_testing import SOURCE_DIRECTORY  # noqa: E402
from mqtt_bridge_fixture import Bridge, Broker, Master, Peer, envelope, eventually  # noqa: E402

sys.path.insert(0, os.path.join(SOURCE_DIRECTORY, "scripts", "lib"))
import certificate_authority  # noqa: E402

TOPIC_OF_CAR_1 = "livemap/v1/test/vehicle/car-1/directory"
DAY = datetime.timedelta(days=1)
# The broker takes no message of more than 1 MiB, which is less than a directory may have.
BROKERS_MOST_BYTES = 1 << 20


def feature(name, port, corners):
    angles = [2 * math.pi * corner / corners for corner in range(corners)]
    ring = [[7.5 + 0.5 * math.cos(angle), 50.5 + 0.5 * math.sin(angle)] for angle in angles]
    ring.append(ring[0])
    return {"type": "Feature", "id": name, "geometry": {"type": "Polygon", "coordinates": [ring]},
            "properties": {"brokers": [{"host": "127.0.0.1", "port": port}]}}


class ZoneDirectoryTest(unittest.TestCase):
    """Each test has an authority, a broker, a zone's bridge and a vehicle's of its own."""

    @classmethod
    def setUpClass(cls):
        cls.zone_master, cls.vehicle_master = Master(os.environ["ROS_MASTER_URI"]), Master()
        cls.addClassCleanup(cls.vehicle_master.stop)
        cls.zone_peer = Peer(cls.zone_master, {"sub:/diagnostics": DiagnosticArray})
        cls.addClassCleanup(cls.zone_peer.stop)
        cls.vehicle_peer = Peer(cls.vehicle_master,
                                {"pub:/vehicle/position": VehiclePosition, "sub:/diagnostics": DiagnosticArray})
        cls.addClassCleanup(cls.vehicle_peer.stop)
        cls.bridges = 0

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_zone_directory_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.authority = self.new_authority("town")
        self.zones_file, self.vehicles_file = self.folder / "zone.cms", self.folder / "vehicle.cms"
        self.broker = Broker()
        self.broker.start()
        self.addCleanup(self.broker.kill)

    def new_authority(self, name):
        with certificate_authority.Authority.create(str(self.folder / name), name) as authority:
            return authority

    def signed(self, version, authority=None, issued=-DAY, expires=DAY, corners=5):
        now = certificate_authority.now()
        text = json.dumps({
            "type": "FeatureCollection", "livemap_zone_directory": 1, "authority": "town", "version": version,
            "issued": f"{(now + issued).isoformat()}Z", "expires": f"{(now + expires).isoformat()}Z",
            "features": [feature("test", self.broker.port, corners)]})
        return (authority or self.authority).sign_directory(text.encode(), DAY)

    def put(self, content):
        """A person replaces the zone's file."""
        new = self.folder / "new"
        new.write_bytes(content)
        new.replace(self.zones_file)

    def start_bridge(self, master, side, user, file, **parameters):
        ZoneDirectoryTest.bridges += 1
        name = f"{side}_bridge_{self.bridges}"
        bridge = Bridge(master, side, name, zone="test", port=self.broker.port, user=user,
                        password_file=self.broker.password_file(user), diagnostics_period_s=0.2, reconnect_min_s=0.1,
                        reconnect_max_s=1.0, zone_directory=str(file),
                        zone_authority=str(self.folder / "town" / "authority" / "ca.pem"), **parameters)
        self.addCleanup(bridge.stop)
        return bridge, name

    def start_zone(self, **parameters):
        bridge, self.zone_bridge = self.start_bridge(self.zone_master, "zone", "zone", self.zones_file, **parameters)
        return bridge

    def start_vehicle(self):
        bridge, self.car_bridge = self.start_bridge(self.vehicle_master, "vehicle", "car-1", self.vehicles_file)
        eventually(lambda: self.of_vehicle("connected") == "True", "the vehicle's bridge connects")
        return bridge

    def of_vehicle(self, key):
        return self.vehicle_peer.diagnostics(self.car_bridge).get(key)

    def of_zone(self, key):
        return self.zone_peer.diagnostics(self.zone_bridge).get(key)

    def drive_until_version(self, version):
        def drove():
            self.vehicle_peer.publish("/vehicle/position", VehiclePosition(latitude=50.5, longitude=7.5))
            return self.of_vehicle("zone_directory_version") == str(version)
        eventually(drove, f"the vehicle has version {version}, with {self.of_vehicle('zone_directory_refusal')}")

    def offer_raw(self, payload, sentence):
        """In the zone's name, past its bridge, until the vehicle has refused it."""
        before = int(self.of_vehicle("zone_directory_refused"))
        self.assertEqual(self.broker.publish_raw("zone", TOPIC_OF_CAR_1, payload), 0)
        eventually(lambda: int(self.of_vehicle("zone_directory_refused")) == before + 1, sentence)
        self.assertIn(sentence, self.of_vehicle("zone_directory_refusal"))

    def test_a_vehicle_that_knows_one_broker_and_the_authority_is_given_the_directory_and_newer_ones(self):
        first, second = self.signed(1), self.signed(2)
        self.put(first)
        self.start_zone()
        self.start_vehicle()
        self.drive_until_version(1)
        self.assertEqual(self.vehicles_file.read_bytes(), first)
        self.put(second)
        self.drive_until_version(2)
        self.assertEqual(self.vehicles_file.read_bytes(), second)

    def test_a_file_that_comes_after_the_start_is_given_and_an_older_or_damaged_one_takes_nothing_away(self):
        zone = self.start_zone(zone_directory_repeat_s=1)
        self.start_vehicle()
        self.put(self.signed(2))
        self.drive_until_version(2)
        self.put(b"half a file")
        eventually(lambda: "is no signed document" in zone.output(), "the zone says that its file is damaged")
        self.put(self.signed(1))
        # The zone goes on giving the newest one that it had.
        given = int(self.of_vehicle("zone_directory_in"))

        def is_given_again():
            self.drive_until_version(2)
            return int(self.of_vehicle("zone_directory_in")) > given + 1
        eventually(is_given_again, "it is given again")
        self.assertEqual(self.of_vehicle("zone_directory_refused"), "0")

    def test_what_is_forged_older_or_expired_is_refused_counted_and_said_and_the_kept_one_stays(self):
        kept = self.signed(4)
        self.put(kept)
        self.start_zone()
        vehicle = self.start_vehicle()
        self.drive_until_version(4)
        for payload, sentence in (
                (self.signed(9, self.new_authority("forger")), "is not signed by the authority"),
                (self.signed(3), "has version 3, accepted is 4 or newer"),
                (self.signed(9, issued=-2 * DAY, expires=-DAY), "has version 9, which expired at"),
                (self.signed(9, issued=DAY, expires=2 * DAY), "which is issued at"),
                (b"no directory", "is no signed document"),
                (b"0", "is no signed document")):
            self.offer_raw(payload, sentence)
        self.assertEqual(vehicle.output().count("refused a message of topic 'zone_directory'"), 1, "once a minute")
        self.assertIn("from zone 'test': 'the offered zone directory'", vehicle.output())
        self.assertEqual(self.vehicles_file.read_bytes(), kept)
        self.assertEqual(self.of_vehicle("zone_directory_version"), "4")

    def test_one_that_is_too_large_for_the_broker_is_counted_by_the_zone_and_does_not_arrive(self):
        self.put(self.signed(1))
        zone = self.start_zone()
        self.start_vehicle()
        self.drive_until_version(1)
        large = self.signed(2, corners=30000)
        self.assertGreater(len(large), BROKERS_MOST_BYTES)
        self.put(large)

        def is_refused():
            self.drive_until_version(1)
            return self.of_zone("zone_directory_refused") == "1"
        eventually(is_refused, "the zone counts it")
        self.assertIn("refused a message of topic 'zone_directory': the broker: ", zone.output())

    def test_only_the_zone_can_give_a_vehicle_a_directory(self):
        self.start_zone()
        self.start_vehicle()
        valid = self.signed(7)
        # mosquitto_pub ends with 135 or 0, as its version has it: what counts is what arrives.
        for user in ("car-1", "car-2"):
            self.broker.publish_raw(user, TOPIC_OF_CAR_1, valid)
        self.put(self.signed(1))
        self.drive_until_version(1)
        self.assertEqual(self.of_vehicle("zone_directory_in"), "1")

    def test_a_vehicle_that_was_heard_before_it_subscribed_is_given_it_at_its_next_message(self):
        self.put(self.signed(1))
        self.start_zone()
        position = envelope(VehiclePosition(latitude=50.5, longitude=7.5))

        def is_given_to_nobody():
            self.broker.publish_raw("car-1", "livemap/v1/test/vehicle/car-1/position", position)
            return int(self.of_zone("zone_directory_out") or 0) > 0
        eventually(is_given_to_nobody, "the zone gives it to the one that it heard")
        self.start_vehicle()
        self.drive_until_version(1)

    def test_a_restart_of_zone_vehicle_and_broker_keeps_it_and_gives_it_again(self):
        self.put(self.signed(1))
        zone = self.start_zone()
        vehicle = self.start_vehicle()
        self.drive_until_version(1)
        zone.stop()
        self.put(self.signed(2))
        vehicle.stop()
        self.broker.kill()
        self.broker.start()
        self.start_vehicle()
        self.assertEqual(self.of_vehicle("zone_directory_version"), "1", "of the vehicle's own file")
        self.start_zone()
        self.drive_until_version(2)
        self.vehicles_file.unlink()
        self.broker.kill()
        self.broker.start()
        # After a new login every vehicle is given it, though it was a moment ago.

        def is_there_again():
            self.drive_until_version(2)
            return self.vehicles_file.exists()
        eventually(is_there_again, "the vehicle's file is there again")


if __name__ == "__main__":
    rostest.rosrun("livemap", "zone_directory", ZoneDirectoryTest)
