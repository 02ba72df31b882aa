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

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import postgresql_server  # noqa: E402

SERVER, FORGET = sys.argv.pop(1), sys.argv.pop(1)
LAT, LON = 40.4433, -79.9436


class Zone:
    """A real zone with its store in `directory`, or a database of PostgreSQL, and its web server."""

    def __init__(self, directory, store_url=""):
        self.process = subprocess.Popen([SERVER, "", "", directory, "", "", store_url], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
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


class ForgetFixture(unittest.TestCase):
    store_url = ""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_forget_")
        self.addCleanup(folder.cleanup)
        self.store = pathlib.Path(folder.name, "zone")
        self.zone = Zone(str(self.store), self.store_url)
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

    def assert_refused(self, result, *words):
        self.assertEqual((result.returncode, result.stdout, result.stderr.count("\n")), (2, "", 1), result)
        for word in words:
            self.assertIn(word, result.stderr)


class Forget(ForgetFixture):
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
            self.assert_refused(result, words)
        self.assert_refused(self.run_it("a", "--store-url", "postgresql://zone:secret@db/livemap"), "password", ".pgpass")

    def test_what_is_no_store_is_said_and_left_alone(self):
        none = self.store / "none"
        self.assert_refused(subprocess.run([FORGET, "a", "--directory", none], text=True, capture_output=True, check=False),
                            "there is no folder", "none")
        none.mkdir()
        self.assert_refused(subprocess.run([FORGET, "a", "--directory", none], text=True, capture_output=True, check=False),
                            "there is no zone.sqlite3 in", "--store-url")
        self.assertEqual(list(none.iterdir()), [])


@unittest.skipUnless(postgresql_server.programs(), "skipped, no PostgreSQL server installed")
class ForgetOnPostgresql(ForgetFixture):
    """What a server keeps is forgotten as well, by the zone that runs or by the URL of its database."""

    @classmethod
    def setUpClass(cls):
        cls.server = postgresql_server.PostgresqlServer()
        cls.addClassCleanup(cls.server.close)

    def setUp(self):
        self.database = self.id().rsplit(".", 1)[-1][-60:].lower()
        self.store_url = self.server.make_database(self.database)
        super().setUp()

    def rows_with(self, name):
        """Tables of which a row holds the name in any column."""
        tables = self.server.ask(self.database, "SELECT table_name FROM information_schema.tables WHERE table_schema = 'public'")
        return [table for table in tables.split() if self.server.ask(
            self.database, f"SELECT count(*) FROM {table} AS one WHERE position('{name}' in one::text) > 0") != "0"]

    def test_a_running_zone_forgets(self):
        before = self.zone.hazards()
        self.assertIn("reports", self.rows_with("erika"))
        for arguments in ((), ("--store-url", self.store_url)):
            self.zone.report(0, "car-erika")
            result = self.run_it("car-erika", "--by", "anna", *arguments)
            self.assertEqual(result.returncode, 0, result)
            self.assertIn("forgotten: ", result.stdout)
            self.assertEqual((self.rows_with("erika"), self.files_with(b"erika")), ([], []))
        self.assertEqual(self.zone.hazards().keys(), before.keys())
        self.assertFalse((self.store / "zone.sqlite3").exists())

    def test_the_store_of_a_stopped_zone_is_named_by_its_url(self):
        before = self.zone.hazards()
        self.zone.close()
        self.assert_refused(self.run_it("car-erika"), "--store-url")
        result = self.run_it("car-erika", "--store-url", self.store_url)
        self.assertEqual((result.returncode, result.stderr), (0, ""), result)
        self.assertIn("forgotten: 10 reports, 0 answers, 10 hazards and map changes", result.stdout)
        self.assertEqual((self.rows_with("erika"), self.files_with(b"erika")), ([], []))
        self.assertFalse((self.store / "zone.sqlite3").exists())
        self.zone = Zone(str(self.store), self.store_url)
        self.assertEqual(self.zone.hazards(), before)

    def test_a_database_without_a_store_stays_without_one(self):
        self.zone.close()
        empty = self.server.make_database(self.database[-50:] + "_empty")
        self.assert_refused(self.run_it("car-erika", "--store-url", empty), "holds no store")
        self.assertEqual(self.server.ask(self.database[-50:] + "_empty", "SELECT to_regclass('livemap_schema') IS NULL"), "t")

    def test_a_database_that_another_folder_s_zone_has_is_refused(self):
        other = self.store.parent / "other"
        other.mkdir()
        result = subprocess.run([FORGET, "car-erika", "--directory", other, "--store-url", self.store_url], text=True,
                                capture_output=True, timeout=120, check=False)
        self.assert_refused(result, "is in use by another zone")
        self.assertNotEqual(self.rows_with("erika"), [])


if __name__ == "__main__":
    unittest.main()
