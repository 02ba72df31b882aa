#!/usr/bin/python3
"""The short form of `./livemap bench hostile`: every attack for seconds, on a real zone.

Nothing is measured here: the honest must get an answer at all, the memory must stay far below what the attacks asked for,
and nothing may be lost or doubled."""

import pathlib
import shutil
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import attacks  # noqa: E402
import rounds  # noqa: E402
from zone_under_attack import Reporter, Zone  # noqa: E402

HAZARDS, SECONDS = 4000, 3
# The answers asked for by those who do not read are ten times as much.
MOST_MB = 600


class HostileZoneTest(unittest.TestCase):
    """One zone that everything happens to, in the order of the names."""

    @classmethod
    def setUpClass(cls):
        directory = pathlib.Path(tempfile.mkdtemp(prefix="livemap_hostile_"))
        cls.addClassCleanup(shutil.rmtree, directory, ignore_errors=True)
        cls.zone = Zone(directory)
        cls.zone.__enter__()
        cls.addClassCleanup(cls.zone.__exit__)
        cls.reporter = Reporter()
        cls.reporter.fill(HAZARDS)
        cls.records = {record["attack"]: record
                       for record in rounds.run(cls.zone, cls.reporter, attacks.ATTACKS, SECONDS, scale=0.5)}
        for record in cls.records.values():
            print(record, flush=True)

    def test_everybody_honest_is_served_under_every_attack(self):
        for name, record in self.records.items():
            for caller in ("watcher", "reader", "official"):
                with self.subTest(attack=name, caller=caller):
                    self.assertGreater(record[caller]["asked"], 0)
                    self.assertEqual(record[caller]["failed"], 0, record[caller]["first_failure"])

    def test_nothing_of_an_honest_vehicle_is_lost_or_doubled(self):
        for name, record in self.records.items():
            with self.subTest(attack=name):
                vehicle = record["vehicle"]
                self.assertGreater(vehicle["sent"], 0)
                self.assertEqual((vehicle["lost"], vehicle["doubled"]), (0, 0), vehicle["refused"])
                self.assertTrue(record["stored_once"])

    def test_the_memory_stays_bounded(self):
        for name, record in self.records.items():
            with self.subTest(attack=name):
                self.assertLess(record["memory_mb"], MOST_MB)

    def test_every_attack_was_carried_out(self):
        for kind in attacks.HTTP_ATTACKS:
            self.assertGreater(self.records[kind.name]["came_of_it"]["opened"], 0, kind.name)
        for kind in attacks.VEHICLE_ATTACKS:
            self.assertGreater(self.records[kind.name]["came_of_it"]["sent"], 0, kind.name)

    def test_one_vehicle_is_not_in_ten_cities(self):
        told = self.records[attacks.ManyCities.name]["came_of_it"]
        # Those of one city agree with each other.
        self.assertLessEqual(told["accepted"], -(-told["sent"] // len(attacks.CITIES)))

    def test_spam_names_make_no_classes(self):
        known = {entry["class"] for entry in self.zone.get("/api/v1/classes")["classes"]}
        # Unknown ones may stand under one heading.
        self.assertLessEqual(len(attacks.classes_on_map(self.zone) - known), 1)

    def test_a_flood_is_not_taken_beyond_the_vehicles_share(self):
        told = self.records[attacks.Flood.name]["came_of_it"]
        self.assertLessEqual(told["accepted"], 3600)

    def test_who_asks_about_cells_all_the_time_is_told_no_more_than_its_share(self):
        told = self.records[attacks.AskingAlways.name]["came_of_it"]
        self.assertGreater(told["asked"], 100)
        # 256 at once, two more each second of an attack and of the pauses around it.
        self.assertLessEqual(told["answered_cells"], 256 + 2 * 300)
        self.assertGreater(told["answered_cells"], 0)


if __name__ == "__main__":
    unittest.main()
