#!/usr/bin/python3
"""livemap zone forget, with a real zone that runs and with its store alone.

  zone_forget_test.py PATH_OF_map_page_server PATH_OF_livemap_zone_forget
"""

import json
import pathlib
import sqlite3
import subprocess
import sys
import tempfile
import unittest
import urllib.request

SERVER, FORGET = sys.argv.pop(1), sys.argv.pop(1)
LAT, LON = 40.4433, -79.9436


class Zone:
    """A real zone with its store in `directory` and its web server."""

    def __init__(self, directory):
        self.process = subprocess.Popen([SERVER, "", "", directory], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.port = json.loads(self.process.stdout.readline())["port"]

    def do(self, verb, **arguments):
        self.process.stdin.write(json.dumps({"do": verb, **arguments}) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def report(self, north, vehicle):
        answer = self.do("report", **{"class": "pothole"}, lat=LAT + north, lon=LON, picture=True, vehicle=vehicle)
        assert answer["status"] == "committed", answer

    def get(self, target):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{target}", timeout=30) as answer:
            return json.load(answer)

    def hazards(self):
        return {one["id"]: (one["properties"]["state"], one["properties"]["vehicles"])
                for one in self.get("/api/v1/hazards?limit=1000")["features"]}

    def close(self):
        self.process.stdin.close()
        self.process.wait(timeout=60)
        self.process.stdout.close()


class Forget(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_forget_")
        self.addCleanup(folder.cleanup)
        self.store = pathlib.Path(folder.name, "zone")
        self.zone = Zone(str(self.store))
        self.addCleanup(lambda: self.zone.process.poll() is None and self.zone.close())
        for i in range(10):
            self.zone.report(0.001 * i, "car-erika")
        for i in range(5):
            self.zone.report(0.001 * i, "car-2")

    def run_it(self, *arguments):
        return subprocess.run([FORGET, *arguments, "--directory", self.store], text=True, capture_output=True, timeout=120,
                              check=False)

    def files_with(self, text):
        return [str(path) for path in self.store.rglob("*") if path.is_file() and text in path.read_bytes()]

    def test_a_running_zone_forgets(self):
        before = self.zone.hazards()
        self.assertTrue(self.files_with(b"erika"))
        self.zone.do("vehicle", id="car-erika", lat=LAT, lon=LON, course=0, speed=1)
        result = self.run_it("car-erika", "--by", "anna")
        self.assertEqual(result.returncode, 0, result)
        self.assertIn("forgotten: 10 reports, 0 answers, 10 hazards and map changes", result.stdout)
        self.assertEqual(self.files_with(b"erika"), [])
        self.assertEqual(self.zone.hazards(), before)
        self.assertEqual(self.zone.get("/api/v1/vehicles")["features"], [])
        (decision,) = self.zone.get("/api/v1/decisions")["decisions"]
        self.assertEqual((decision["decision"], decision["about"], decision["official"]), ("forget", "vehicle", "anna"))
        self.assertNotIn("erika", json.dumps(decision))

    def test_a_store_whose_zone_does_not_run_is_cleaned_of_what_older_versions_left(self):
        before = self.zone.hazards()
        self.zone.close()
        # As a version did that left in free pages what it dropped.
        with sqlite3.connect(self.store / "zone.sqlite3") as database:
            database.execute("PRAGMA secure_delete=OFF")
            database.execute("CREATE TABLE old (vehicle TEXT)")
            database.executemany("INSERT INTO old VALUES (?)", [("car-erika" * 20,)] * 2000)
            database.commit()
            database.execute("DROP TABLE old")
        database.close()
        self.assertTrue(self.files_with(b"car-erikacar-erika"))
        result = self.run_it("car-erika")
        self.assertEqual((result.returncode, result.stderr), (0, ""), result)
        self.assertEqual(self.files_with(b"erika"), [])
        self.zone = Zone(str(self.store))
        self.assertEqual(self.zone.hazards(), before)

    def test_a_vehicle_that_is_not_there_is_said(self):
        result = self.run_it("car-77")
        self.assertEqual((result.returncode, result.stdout), (0, "the store has nothing of such a vehicle\n"), result)

    def test_wrong_usage_is_one_sentence(self):
        for arguments, words in (((), "0 vehicles were given"), (("a", "b"), "2 vehicles were given"),
                                 (("a", "--force"), "unknown flag '--force'"), (("a\nb",), "the vehicle's name")):
            result = self.run_it(*arguments)
            self.assertEqual((result.returncode, result.stdout, result.stderr.count("\n")), (2, "", 1), result)
            self.assertIn(words, result.stderr)
        result = subprocess.run([FORGET, "a", "--directory", self.store / "none"], text=True, capture_output=True, check=False)
        self.assertEqual(result.returncode, 2)
        self.assertIn("there is no zone.sqlite3 in", result.stderr)


if __name__ == "__main__":
    unittest.main()
