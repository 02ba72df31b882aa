#!/usr/bin/python3
"""livemap zone backup and restore, with a real zone that goes on taking reports.

  zone_store_copy_test.py PATH_OF_map_page_server
"""

import json
import os
import pathlib
import sqlite3
import subprocess
import sys
import tempfile
import threading
import unittest
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import postgresql_server  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
SERVER = sys.argv.pop(1)
LAT, LON = 40.4433, -79.9436


class Zone:
    """A real zone with its store in `directory`, or a database of PostgreSQL, and its web server."""

    def __init__(self, directory, store_url=""):
        self.process = subprocess.Popen([SERVER, "", "", directory, "", "", store_url], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.port = json.loads(self.process.stdout.readline())["port"]

    def report(self, class_name, north, vehicle="car-1"):
        told = {"do": "report", "class": class_name, "lat": LAT + north, "lon": LON, "picture": True, "vehicle": vehicle}
        self.process.stdin.write(json.dumps(told) + "\n")
        self.process.stdin.flush()
        answer = json.loads(self.process.stdout.readline())
        assert answer["status"] == "committed", answer

    def hazards(self):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/api/v1/hazards?limit=1000", timeout=30) as answer:
            return {one["id"]: one for one in json.load(answer)["features"]}

    def close(self):
        self.process.stdin.close()
        self.process.wait(timeout=60)
        self.process.stdout.close()


class StoreCopy(unittest.TestCase):
    def database(self, directory):
        """The URL of the database in place of the folder's zone.sqlite3; none here."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_store_copy_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.store, self.copy, self.other = (self.folder / name for name in ("zone", "copy", "other"))

    def zone_in(self, directory):
        zone = Zone(str(directory), self.database(directory) or "")
        self.addCleanup(lambda: zone.process.poll() is None and zone.close())
        return zone

    def run_it(self, command, directory):
        url = self.database(directory)
        return subprocess.run([ROOT / "scripts/livemap_zone_store", command, self.copy, "--directory", directory,
                               *(["--store-url", url] if url else [])], text=True, capture_output=True, timeout=120, check=False)

    def assert_done(self, result):
        self.assertEqual((result.returncode, result.stderr), (0, ""), result)

    def assert_refused(self, result, *words):
        self.assertEqual((result.returncode, result.stdout), (2, ""), result)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_a_copy_made_while_reports_come_is_a_whole_zone(self):
        zone = self.zone_in(self.store)
        for i in range(20):
            zone.report("pothole", 0.001 * i)
        before = zone.hazards()
        stop, came = threading.Event(), []

        def go_on():
            while not stop.is_set() and len(came) < 3000:
                zone.report("deer", -0.001 * (1 + len(came) % 100), vehicle=f"car-{len(came)}")
                came.append(1)
        others = threading.Thread(target=go_on)
        others.start()
        try:
            result = self.run_it("backup", self.store)
        finally:
            stop.set()
            others.join()
        self.assert_done(result)
        self.assertGreater(len(came), 0, "nothing was reported meanwhile")
        zone.close()
        self.assert_done(self.run_it("restore", self.other))
        again = self.zone_in(self.other).hazards()
        self.assertEqual({key: again[key]["geometry"] for key in before},
                         {key: before[key]["geometry"] for key in before})
        pictures = {path.name for path in (self.other / "images").rglob("*.*")}
        shown = {one["properties"]["image"].rsplit("/", 1)[-1] for one in before.values()}
        self.assertTrue(shown)
        self.assertLessEqual({name.split(".")[0] for name in shown}, {name.split(".")[0] for name in pictures})

    def test_what_is_restored_goes_on_counting(self):
        zone = self.zone_in(self.store)
        zone.report("pothole", 0)
        self.assert_done(self.run_it("backup", self.store))
        zone.close()
        self.assert_done(self.run_it("restore", self.other))
        zone = self.zone_in(self.other)
        zone.report("pothole", 0, vehicle="car-2")
        (hazard,) = zone.hazards().values()
        self.assertEqual(hazard["properties"]["sightings"], 2)

    def test_only_its_owner_reads_a_copy(self):
        self.zone_in(self.store).report("pothole", 0)
        self.assert_done(self.run_it("backup", self.store))
        self.assertEqual(self.copy.stat().st_mode & 0o777, 0o700)

    def test_a_store_is_never_overwritten(self):
        zone = self.zone_in(self.store)
        zone.report("pothole", 0)
        self.assert_done(self.run_it("backup", self.store))
        self.assert_refused(self.run_it("backup", self.store), "exists already")
        self.assert_refused(self.run_it("restore", self.store), "a zone runs")
        zone.close()
        self.assert_refused(self.run_it("restore", self.store), "holds zone.sqlite3")

    def test_a_url_with_a_password_is_refused(self):
        result = subprocess.run([ROOT / "scripts/livemap_zone_store", "backup", self.copy, "--store-url",
                                 "postgresql://zone:secret@db/livemap"], text=True, capture_output=True, timeout=60, check=False)
        self.assert_refused(result, "password", ".pgpass")
        self.assertNotIn("secret", result.stderr)

    def test_what_is_no_store_and_no_copy_is_said(self):
        self.assert_refused(self.run_it("backup", self.store), "holds no store")
        self.assert_refused(self.run_it("restore", self.other), "no copy of a store")
        self.copy.mkdir()
        (self.copy / "backup.json").write_text('{"format": 99}')
        self.assert_refused(self.run_it("restore", self.other), "formats 1 and 2")

    def test_a_damaged_copy_is_not_restored(self):
        self.zone_in(self.store).report("pothole", 0)
        self.assert_done(self.run_it("backup", self.store))
        database = self.copy / "zone.sqlite3"
        content = bytearray(database.read_bytes())
        content[4096 * 2:] = os.urandom(len(content) - 4096 * 2)
        database.write_bytes(content)
        result = self.run_it("restore", self.other)
        self.assertEqual(result.returncode, 2, result)
        self.assertFalse((self.other / "zone.sqlite3").exists())

    def test_an_interrupted_copy_is_no_copy_and_is_made_anew(self):
        self.zone_in(self.store).report("pothole", 0)
        part = self.folder / "copy.part"
        part.mkdir()
        (part / "zone.sqlite3").write_text("half")
        self.assert_refused(self.run_it("restore", self.other), "no copy of a store")
        self.assert_done(self.run_it("backup", self.store))
        self.assertFalse(part.exists())
        with sqlite3.connect(self.copy / "zone.sqlite3") as database:
            self.assertEqual(database.execute("SELECT count(*) FROM hazards").fetchone(), (1,))


@unittest.skipUnless(postgresql_server.programs(), "skipped, no PostgreSQL server installed")
class StoreCopyOnPostgresql(StoreCopy):
    """The same with the zone's rows in a server, and what differs there."""

    @classmethod
    def setUpClass(cls):
        cls.server = postgresql_server.PostgresqlServer()
        cls.addClassCleanup(cls.server.close)

    def database(self, directory):
        name = f"{self.id().rsplit('.', 1)[-1]}_{directory.name}"[-60:]
        if self.server.ask("postgres", f"SELECT count(*) FROM pg_database WHERE datname = '{name}'") == "0":
            self.server.make_database(name)
        return self.server.url(name)

    def test_a_store_is_never_overwritten(self):
        zone = self.zone_in(self.store)
        zone.report("pothole", 0)
        self.assert_done(self.run_it("backup", self.store))
        self.assert_refused(self.run_it("restore", self.store), "holds a store", "never overwritten")

    def test_a_damaged_copy_is_not_restored(self):
        self.zone_in(self.store).report("pothole", 0)
        self.assert_done(self.run_it("backup", self.store))
        dump = self.copy / "zone.pgdump"
        dump.write_bytes(dump.read_bytes()[:-200])
        self.assertEqual(self.run_it("restore", self.other).returncode, 2)
        self.assertEqual(self.server.ask(self.database(self.other).split("/")[3].split("?")[0],
                                         "SELECT to_regclass('livemap_schema') IS NULL"), "t")

    def test_an_interrupted_copy_is_no_copy_and_is_made_anew(self):
        self.zone_in(self.store).report("pothole", 0)
        part = self.folder / "copy.part"
        part.mkdir()
        (part / "zone.pgdump").write_text("half")
        self.assert_refused(self.run_it("restore", self.other), "no copy of a store")
        self.assert_done(self.run_it("backup", self.store))
        self.assertFalse(part.exists())
        self.assertEqual(json.loads((self.copy / "backup.json").read_text())["hazards"], 1)

    def test_a_copy_goes_to_no_other_kind_of_store(self):
        self.zone_in(self.store).report("pothole", 0)
        self.assert_done(self.run_it("backup", self.store))
        result = subprocess.run([ROOT / "scripts/livemap_zone_store", "restore", self.copy, "--directory", self.other], text=True,
                                capture_output=True, timeout=60, check=False)
        self.assert_refused(result, "of a store in PostgreSQL", "--store-url")


if __name__ == "__main__":
    unittest.main(verbosity=2)
