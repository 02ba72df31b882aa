#!/usr/bin/python3
"""The region's program with two real zones, of which one is killed and comes back, and with a region that is killed.

  region_process_test.py --server PATH_OF_map_page_server --region PATH_OF_livemap_serve_region
"""

import argparse
import os
import signal
import subprocess
import sys
import unittest
import urllib.error

from region_fixture import FILES, Region, Zone, directory_of, eventually, square, temporary_folder
from map_page_fixture import LAT, LON, OPTIONS


class RegionTest(unittest.TestCase):
    def setUp(self):
        self.folder = temporary_folder(self)
        self.north = Zone(os.path.join(self.folder, "north"))
        self.south = Zone(os.path.join(self.folder, "south"))
        for zone in (self.north, self.south):
            self.addCleanup(zone.close)
            zone.start()
        self.region = Region(OPTIONS.region, os.path.join(self.folder, "region"), "--zone", f"north={self.north.url}",
                             "--zone", f"south={self.south.url}")
        self.addCleanup(self.region.close)

    def wait_hazards(self, count):
        eventually(lambda: len(self.region.hazards()) == count, f"not {count} hazards: {self.region.lines}")

    def wait_state(self, zone, state):
        eventually(lambda: self.region.zones()[zone]["state"] == state, f"zone '{zone}' is not {state}")

    def latitudes(self):
        return sorted(one["geometry"]["coordinates"][1] for one in self.region.hazards().values())

    def test_a_zone_that_is_killed_is_shown_with_its_last_state_and_followed_on_when_it_is_back(self):
        hole = self.north.add("pothole", LAT, LON)
        self.south.add("debris", LAT - 0.2, LON)
        self.region.start()
        self.wait_hazards(2)
        eventually(self.region.is_ready, "the region is not ready")
        self.north.kill()
        self.wait_state("north", "down")
        down = self.region.zones()["north"]
        self.assertEqual(down["hazards"], 1)
        self.assertRegex(down["last_heard"], r"^20\d\d-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
        self.assertEqual(len(self.region.hazards()), 2)
        self.assertIn('livemap_region_zone_up{zone="north"} 0', self.region.get("/metrics"))
        self.assertIn('livemap_region_zone_up{zone="south"} 1', self.region.get("/metrics"))
        # The other zone goes on.
        self.south.add("pothole", LAT - 0.21, LON)
        self.wait_hazards(3)
        self.north.start()
        self.wait_state("north", "up")
        self.north.add("pothole", LAT + 0.01, LON)
        self.wait_hazards(4)
        self.assertTrue(self.north.process.do("remove", id=hole)["removed"])
        self.wait_hazards(3)
        self.assertTrue(any("zone 'north' is down and was last heard at" in line for line in self.region.lines))
        self.assertEqual(self.region.end(), 0)

    def test_a_region_that_is_killed_shows_a_zone_that_is_down_as_it_was(self):
        self.north.add("pothole", LAT, LON)
        self.south.add("debris", LAT - 0.2, LON)
        self.region.start()
        self.wait_hazards(2)
        before = self.region.hazards()
        heard = self.region.zones()["north"]["last_heard"]
        self.north.kill()
        self.wait_state("north", "down")
        self.region.end(signal.SIGKILL)
        self.region.start()
        self.assertEqual(set(self.region.hazards()), set(before))
        self.wait_state("south", "up")
        north = self.region.zones()["north"]
        self.assertEqual((north["state"], north["hazards"]), ("down", 1))
        # To the second in which it is kept on disk.
        self.assertLessEqual(north["last_heard"][:16], heard[:16])

    def test_a_zone_whose_store_is_lost_is_read_anew_and_its_old_hazards_leave(self):
        for step in range(5):
            self.north.add("pothole", LAT + 0.01 * step, LON)
        self.region.start()
        self.wait_hazards(5)
        self.north.begin_anew()
        for step in range(6):
            self.north.add("debris", LAT + 0.5 + 0.01 * step, LON)
        eventually(lambda: len(self.region.hazards()) == 6 and min(self.latitudes()) > LAT + 0.4,
                   f"the old hazards stay: {self.latitudes()}")
        self.assertIn('livemap_region_zone_begun_anew_total{zone="north"} 1', self.region.get("/metrics"))

    def test_a_hazard_of_both_zones_at_their_border_is_there_once(self):
        self.north.add("pothole", LAT, LON)
        self.region.start()
        self.wait_hazards(1)
        self.south.add("pothole", LAT + 0.00001, LON)
        self.south.add("pothole", LAT + 0.001, LON)
        self.wait_hazards(2)
        self.assertIn("livemap_region_duplicates 1", self.region.get("/metrics"))

    def test_zones_of_a_signed_directory_have_names_and_areas(self):
        directory, authority = directory_of(
            [square("north", "The North", LAT - 0.1, LON - 0.1, LAT + 0.1, LON + 0.1, self.north.url)], self.folder)
        region = Region(OPTIONS.region, os.path.join(self.folder, "other"), "--directory", directory, "--authority",
                        authority)
        self.addCleanup(region.close)
        self.north.add("pothole", LAT, LON)
        self.north.add("pothole", LAT + 5, LON)  # Far outside.
        region.start()
        eventually(lambda: len(region.hazards()) == 1, "the zone is not read")
        self.assertEqual(region.zones()["north"]["name"], "The North")
        self.assertIn('livemap_region_zone_refused_hazards_total{zone="north"} 1', region.get("/metrics"))

    def test_nothing_can_be_changed(self):
        self.region.start()
        with self.assertRaises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(self.region.url + "/api/v1/session", data=b"{}")
        self.assertEqual(refused.exception.code, 405)
        refused.exception.close()

    def test_a_mistake_is_one_sentence_and_exit_code_2(self):
        for arguments, part in ((["--zone", "north"], "accepted is NAME=VALUE"), ([], "no zone is given"),
                                (["--zone", "a=ftp://b"], "accepted is http(s)://HOST"), (["--port"], "needs a value"),
                                (["--zone", "a=http://b", "--port", "70000"], "accepted is 0 to 65535"),
                                (["--zone", "a=http://b", "--ask-every-s", "nan"], "ask_every_s is nan"),
                                (["--zone", "a=http://b", "--directory", "x"], "accepted are both or none"),
                                (["--zone", "a=http://b", "--accounts", os.path.join(self.folder, "none")],
                                 "accepted is a folder that there is"),
                                (["--bad", "x"], "unknown flag '--bad'")):
            ended = subprocess.run([OPTIONS.region, *FILES, "--store", os.path.join(self.folder, "none"), *arguments],
                                   capture_output=True, text=True, check=False, timeout=60)
            self.assertEqual(ended.returncode, 2, arguments)
            self.assertIn(part, ended.stderr, arguments)
            self.assertEqual(ended.stderr.count("\n"), 1, ended.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--server", required=True)
    parser.add_argument("--region", required=True)
    parser.add_argument("tests", nargs="*")
    parser.parse_args(namespace=OPTIONS)
    program = unittest.main(argv=[sys.argv[0], *OPTIONS.tests], exit=False, verbosity=2)
    return 0 if program.result.wasSuccessful() else 1


sys.exit(main())
