#!/usr/bin/python3
"""A zone that `livemap zone directory split` cuts into parts, which `make` signs and vehicles' code reads."""

import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest

from zone_fixture import ROOT, livemap_zone

sys.path.insert(0, str(ROOT / "scripts" / "lib"))
import area_cut  # noqa: E402

SQUARE = [[-80.1, 40.3], [-79.8, 40.3], [-79.8, 40.6], [-80.1, 40.6]]
# The letter U: a cut across it has an outside in its middle.
LETTER = [[-80.1, 40.3], [-79.8, 40.3], [-79.8, 40.6], [-79.87, 40.6], [-79.87, 40.4], [-80.03, 40.4], [-80.03, 40.6],
          [-80.1, 40.6]]
HOLE = [[-80.0, 40.4], [-79.9, 40.4], [-79.9, 40.5], [-80.0, 40.5]]
AREAS = {"square": [SQUARE], "letter": [LETTER], "with a hole": [SQUARE, HOLE]}


def zone(name, rings):
    return {"type": "Feature", "id": name, "geometry": {"type": "Polygon", "coordinates": [ring + ring[:1] for ring in rings]},
            "properties": {"name": "The Metropolis", "map": "https://metro.example",
                           "brokers": [{"host": "broker.metro.example", "port": 8883}]}}


def rings_of(feature):
    return [ring[:-1] for polygon in feature["geometry"]["coordinates"] for ring in polygon]


class SplitTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_split_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.random = random.Random(5)

    def write(self, name, content):
        path = self.folder / name
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    def split(self, features, *arguments, zone_id="metro", parts=2):
        out = self.folder / "parts.geojson"
        out.unlink(missing_ok=True)
        result = subprocess.run(["/usr/bin/python3", str(ROOT / "scripts/livemap_split_zone"), str(self.write("zones", features)),
                                 "--zone", zone_id, "--parts", str(parts), "--out", str(out), *map(str, arguments)],
                                capture_output=True, text=True, check=False)
        return result, json.loads(out.read_text())["features"] if out.exists() else None

    def assert_refused(self, sentence, result):
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertIn(sentence, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)

    def places(self, count):
        return [[self.random.uniform(-80.15, -79.75), self.random.uniform(40.25, 40.65)] for _ in range(count)]

    def test_every_place_of_the_zone_is_in_one_part_and_no_other_place_in_any(self):
        for name, rings in AREAS.items():
            for count in (2, 3, 7):
                result, parts = self.split(zone("metro", rings), parts=count)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual([part["id"] for part in parts], [f"metro-{i}" for i in range(1, count + 1)])
                areas = [rings_of(part) for part in parts]
                for place in self.places(2000):
                    held = sum(area_cut.contains(area, place) for area in areas)
                    self.assertEqual(held, 1 if area_cut.contains(rings, place) else 0, (name, count, place))
                sizes = [area_cut.size_of(area) for area in areas]
                self.assertAlmostEqual(sum(sizes) / area_cut.size_of(rings), 1, places=5)
                self.assertLess(max(sizes), 1.2 * min(sizes), (name, count))

    def star(self, middle):
        """Around a corner of cells, so that some of its corners lie on lines of cells."""
        corners = []
        for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
            for _ in range(self.random.randrange(1, 8)):
                corners.append([round(middle[0] + x * self.random.randrange(1, 9) * 360 / area_cut.CELLS, 7),
                                round(middle[1] + y * self.random.randrange(1, 9) * 0.008, 7)])
        return sorted(corners, key=lambda corner: math.atan2(corner[1] - middle[1], corner[0] - middle[0]))

    def test_areas_of_any_form_keep_their_places(self):
        cut = 0
        while cut < 40:
            middle = [area_cut.column_line(9100 + self.random.randrange(50)), area_cut.row_line(12300 + self.random.randrange(50))]
            star = self.star(middle)
            parts = area_cut.split([star], 3, [])
            if parts is None:
                continue
            cut += 1
            for _ in range(300):
                place = [middle[0] + self.random.uniform(-0.1, 0.1), middle[1] + self.random.uniform(-0.08, 0.08)]
                held = sum(area_cut.contains(part, place) for part in parts)
                self.assertEqual(held, 1 if area_cut.contains([star], place) else 0, (star, place))

    def test_cuts_lie_on_lines_of_cells(self):
        _, parts = self.split(zone("metro", [SQUARE]), parts=4)
        borders = {-80.1, -79.8, 40.3, 40.6}
        for part in parts:
            for ring in rings_of(part):
                for longitude, latitude in ring:
                    column, row = area_cut.column_of(longitude), area_cut.row_of(latitude)
                    self.assertTrue(longitude in borders or abs(column - round(column)) < 1e-4, longitude)
                    self.assertTrue(latitude in borders or abs(row - round(row)) < 1e-4, latitude)

    def test_the_load_is_shared_by_hazards_where_they_are_given(self):
        # Nine of ten hazards lie in the west.
        rows = [[self.random.uniform(-80.09, -80.0), self.random.uniform(40.31, 40.59)] for _ in range(900)]
        rows += [[self.random.uniform(-80.0, -79.81), self.random.uniform(40.31, 40.59)] for _ in range(100)]
        rows.append([-70, 40])
        table = self.write("hazards.csv", "id,latitude,longitude\n" + "".join(f"x,{lat},{lon}\n" for lon, lat in rows))
        result, parts = self.split(zone("metro", [SQUARE]), "--hazards", table, parts=4)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("1 hazards lie outside of the zone", result.stdout)
        held = [sum(area_cut.contains(rings_of(part), row) for row in rows) for part in parts]
        self.assertEqual(sum(held), 1000)
        self.assertLess(max(held), 1.5 * min(held), held)

    def test_other_zones_stay_and_parts_have_brokers_and_map_of_the_zone(self):
        other = zone("elsewhere", [[[-79.8, 40.3], [-79.7, 40.3], [-79.7, 40.6], [-79.8, 40.6]]])
        _, features = self.split({"type": "FeatureCollection", "features": [other, zone("metro", [SQUARE])]})
        self.assertEqual(features[0], other)
        for number, part in enumerate(features[1:], 1):
            self.assertEqual(part["properties"], {**zone("metro", [SQUARE])["properties"], "name": f"The Metropolis {number}"})

    def test_the_parts_are_signed_and_a_vehicle_finds_its_own(self):
        _, parts = self.split(zone("metro", [SQUARE, HOLE]), parts=3)
        identity, signed = self.folder / "identity", self.folder / "zones.cms"
        self.assertEqual(livemap_zone("init", identity, "--zone", "town").returncode, 0)
        made = subprocess.run(["/usr/bin/python3", str(ROOT / "scripts/livemap_sign_directory"), str(self.folder / "parts.geojson"),
                               "--out", str(signed), "--dir", str(identity), "--checker", PROGRAM, "--max-overlap-m", "1"],
                              capture_output=True, text=True, check=False)
        self.assertEqual(made.returncode, 0, made.stderr)
        for longitude, latitude in self.places(20):
            holders = [part["id"] for part in parts if area_cut.contains(rings_of(part), [longitude, latitude])]
            if not holders:
                continue
            shown = subprocess.run([PROGRAM, "show", str(signed), "--authority", str(identity / "authority" / "ca.pem"), "--at",
                                    str(latitude), str(longitude)], capture_output=True, text=True, check=False)
            self.assertEqual(shown.stdout.split(" ")[0], holders[0])

    def test_what_is_not_accepted_is_one_sentence(self):
        good = zone("metro", [SQUARE])
        tiny = zone("metro", [[[-80.001, 40.301], [-80.0011, 40.301], [-80.0011, 40.3011]]])
        across = zone("metro", [[[179.9, 1], [-179.9, 1], [-179.9, 2], [179.9, 2]]])
        endless = json.dumps(good).replace("-80.1", "NaN")
        taken = {"type": "FeatureCollection", "features": [good, zone("metro-2", [HOLE])]}
        for sentence, features, arguments in (
                ("has zone 'else' 0 times", good, {"zone_id": "else"}), ("--parts 1 is not accepted", good, {"parts": 1}),
                ("--parts 65 is not accepted", good, {"parts": 65}), ("too few cells", tiny, {}),
                ("lies across 180 degrees", across, {}), ("has a ring that is not accepted", endless, {}),
                ("has zone 'metro-2' already", taken, {}), ("is no JSON", "{", {}), ("is no GeoJSON of zones", "[]", {}),
                ("is no GeoJSON of zones", {"type": "FeatureCollection", "features": [1]}, {}),
                ("has no area", {**good, "geometry": None}, {}),
                ("has no area", {**good, "geometry": {"type": "Polygon", "coordinates": []}}, {})):
            result, parts = self.split(features, **arguments)
            self.assert_refused(sentence, result)
            self.assertIsNone(parts)
        for sentence, table in (("no columns latitude and longitude", "a,b\n1,2\n"), ("has no position", "latitude,longitude\nnan,1\n"),
                                ("has no position", "latitude,longitude\n40.4\n"), ("no hazard in the zone", "latitude,longitude\n1,1\n"),
                                ("no columns latitude and longitude", "")):
            self.assert_refused(sentence, self.split(good, "--hazards", self.write("bad.csv", table))[0])
        self.assert_refused("cannot be used", self.split(good, "--hazards", self.folder / "none")[0])

    def test_nothing_that_is_there_is_overwritten(self):
        (self.folder / "there").write_text("mine")
        result = subprocess.run(["/usr/bin/python3", str(ROOT / "scripts/livemap_split_zone"),
                                 str(self.write("zones", zone("metro", [SQUARE]))), "--zone", "metro", "--parts", "2", "--out",
                                 str(self.folder / "there")], capture_output=True, text=True, check=False)
        self.assert_refused("cannot be used", result)
        self.assertEqual((self.folder / "there").read_text(), "mine")


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main()
