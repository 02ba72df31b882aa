#!/usr/bin/python3
"""The signed directory of zones: what `livemap zone directory make` writes, `show` and openssl read."""

import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

from zone_fixture import ROOT, livemap_zone


def zone(name, west, south, side=0.1):
    ring = [[west, south], [west + side, south], [west + side, south + side], [west, south + side], [west, south]]
    return {"type": "Feature", "id": name, "geometry": {"type": "Polygon", "coordinates": [ring]},
            "properties": {"name": name.title(), "brokers": [{"host": f"{name}.example.org"}]}}


class DirectoryTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_directory_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.identity = self.folder / "identity"
        self.assertEqual(livemap_zone("init", self.identity, "--zone", "town").returncode, 0)
        self.authority = self.identity / "authority" / "ca.pem"
        self.signed = self.folder / "zones.cms"

    def write(self, name, content):
        path = self.folder / name
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    def make(self, *arguments):
        return subprocess.run(["/usr/bin/python3", str(ROOT / "scripts/livemap_sign_directory"), *map(str, arguments),
                               "--out", str(self.signed), "--dir", str(self.identity), "--checker", PROGRAM],
                              capture_output=True, text=True, check=False)

    def show(self, *arguments):
        return subprocess.run([PROGRAM, "show", str(self.signed), *map(str, arguments)],
                              capture_output=True, text=True, check=False)

    def assert_refused(self, sentence, result):
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertIn(sentence, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)

    def make_town(self):
        result = self.make(self.write("west.geojson", zone("west", -80.0, 40.4)),
                           self.write("east.geojson", {"type": "FeatureCollection", "features": [zone("east", -79.9, 40.4)]}))
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def test_what_is_signed_is_shown_and_finds_the_zone_of_a_place(self):
        self.assertIn("version 1 with 2 zones", self.make_town().stdout)
        shown = self.show("--authority", self.authority)
        self.assertIn("authority town, version 1, ", shown.stdout)
        self.assertIn("west (West)\twest.example.org:8883", shown.stdout)
        self.assertIn("east (East)", self.show("--authority", self.authority, "--at", "40.45", "-79.85").stdout)
        self.assert_refused("no zone is within 2000 m", self.show("--authority", self.authority, "--at", "52", "13"))

    def test_openssl_reads_the_same(self):
        self.make_town()
        result = subprocess.run(["openssl", "cms", "-verify", "-inform", "DER", "-in", self.signed, "-CAfile", self.authority],
                                capture_output=True, check=True)
        content = json.loads(result.stdout)
        self.assertEqual([feature["id"] for feature in content["features"]], ["west", "east"])

    def test_each_one_has_the_next_version_also_after_one_that_was_refused(self):
        self.make_town()
        self.assert_refused("'id' is missing", self.make(self.write("none.geojson", {"type": "Feature"})))
        self.assertIn("version 2 with", self.make_town().stdout)

    def test_anothers_directory_is_not_shown(self):
        self.make_town()
        other = self.folder / "other"
        livemap_zone("init", other, "--zone", "town")
        self.assert_refused("is not signed by the authority", self.show("--authority", other / "authority" / "ca.pem"))

    def test_an_enrolled_vehicle_cannot_sign_one(self):
        self.make_town()
        livemap_zone("enroll", "car-1", "--dir", self.identity)
        car = self.identity / "vehicles" / "car-1"
        text = subprocess.run(["openssl", "cms", "-verify", "-inform", "DER", "-in", self.signed, "-CAfile", self.authority],
                              capture_output=True, check=True).stdout
        subprocess.run(["openssl", "cms", "-sign", "-binary", "-nodetach", "-outform", "DER", "-out", self.signed,
                        "-signer", car / "certificate.pem", "-inkey", car / "key.pem"], input=text, check=True)
        self.assert_refused("is not signed by the authority", self.show("--authority", self.authority))

    def test_a_zone_that_claims_its_neighbours_streets_is_not_signed(self):
        greedy = zone("greedy", -79.95, 40.42)
        west = self.write("west.geojson", zone("west", -80.0, 40.4))
        self.assert_refused("zone 'greedy' and zone 'west' overlap by", self.make(west, self.write("greedy.geojson", greedy)))
        self.assertFalse(self.signed.exists())
        result = self.make(west, self.write("greedy.geojson", greedy), "--max-overlap-m", "9000")
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_files_that_are_none_and_wrong_flags_are_one_sentence(self):
        self.assert_refused("is no JSON", self.make(self.write("a.geojson", "{")))
        self.assert_refused("is no JSON", self.make(self.write("a.geojson", "[" * 100_000)))
        self.assert_refused("is no GeoJSON of zones", self.make(self.write("a.geojson", "[]")))
        self.assert_refused("cannot be used", self.make(self.folder / "absent.geojson"))
        self.assert_refused("--days 0 is not accepted", self.make(self.write("a.geojson", zone("a", 0, 0)), "--days", "0"))
        self.assert_refused("--max-overlap-m 'x' is not accepted",
                            self.make(self.write("a.geojson", zone("a", 0, 0)), "--max-overlap-m", "x"))
        self.assert_refused("'id' is \"a b\"", self.make(self.write("a.geojson", zone("a b", 0, 0))))
        self.assert_refused("--authority is missing", self.show())


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main()
