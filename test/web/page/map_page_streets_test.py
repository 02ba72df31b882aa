#!/usr/bin/python3
"""The zone's streets on the page, in real Chromium: drawn with names, said of hazards, and never run as a script.

  map_page_streets_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import math
import os
import shutil
import sqlite3
import struct
import sys
import tempfile
import zlib
from xml.sax.saxutils import quoteattr

from map_page_fixture import LAT, LON, MapPage, run_tests

SCRIPT = "<img src=x onerror=\"document.title='owned'\">"
BLOCKS = 9
BLOCK_M = 180


def at(east_m, north_m):
    return LAT + north_m / 111132, LON + east_m / (111320 * math.cos(math.radians(LAT)))


def write_town(path, odd_name=SCRIPT):
    """A lattice of streets, one of them of two carriageways, one with an odd name; a motorway passes by."""
    nodes, ways, half = [], [], BLOCKS * BLOCK_M / 2

    def node(east_m, north_m):
        lat, lon = at(east_m, north_m)
        nodes.append(f'<node id="{len(nodes) + 1}" lat="{lat:.7f}" lon="{lon:.7f}"/>')
        return len(nodes)

    def way(places, **tags):
        refs = "".join(f'<nd ref="{place}"/>' for place in places)
        said = "".join(f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in tags.items())
        ways.append(f'<way id="{len(ways) + 1}">{refs}{said}</way>')

    grid = {(i, k): node(i * BLOCK_M - half, k * BLOCK_M - half)
            for i in range(BLOCKS + 1) for k in range(BLOCKS + 1)}
    for k in range(BLOCKS + 1):
        name = odd_name if k == 5 else f"{k + 1}th Street"
        kind = "primary" if k == 4 else "residential"
        # Mappers cut streets into short ways.
        for i in range(BLOCKS):
            way([grid[i, k], grid[i + 1, k]], highway=kind, name=name)
    for i in range(BLOCKS + 1):
        way([grid[i, k] for k in range(BLOCKS + 1)], highway="secondary" if i == 4 else "residential",
            name=f"{chr(65 + i)} Avenue")
    road = [node(-half - 600 + 60 * n, -half - 300 + 120 * math.sin(n / 6)) for n in range(60)]
    back = [node(-half - 600 + 60 * n, -half - 286 + 120 * math.sin(n / 6)) for n in range(60)]
    way(road, highway="motorway", name="Parkway", oneway="yes")
    way(back[::-1], highway="motorway", name="Parkway", oneway="yes")
    with open(path, "w") as file:
        file.write(f'<osm version="0.6">{"".join(nodes)}{"".join(ways)}</osm>')


def write_tiles(path):
    """One picture for every tile around the town at the zooms 10 to 14, in a file as MBTiles defines it."""
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    rows = b"".join(b"\0" + (b"\x90\xb0\x88" * 255 + b"\x60\x80\x58") for _ in range(256))
    png = (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 256, 256, 8, 2, 0, 0, 0))
           + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
    database.execute("CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)")
    database.executemany("INSERT INTO metadata VALUES (?, ?)", [
        ("minzoom", "10"), ("maxzoom", "14"), ("attribution", SCRIPT + "The City")])
    for zoom in range(10, 15):
        count = 2 ** zoom
        column = int((LON / 360 + 0.5) * count)
        sine = math.sin(math.radians(LAT))
        row = int((0.5 + math.log((1 + sine) / (1 - sine)) / (4 * math.pi)) * count)
        database.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", [
            (zoom, column + x, row + y, png) for x in range(-6, 7) for y in range(-6, 7)])
    database.commit()
    database.close()


class Streets(MapPage):
    has_tiles = False

    @classmethod
    def setUpClass(cls):
        folder = tempfile.mkdtemp(prefix="livemap_streets_")
        cls.addClassCleanup(shutil.rmtree, folder)
        paths = [os.path.join(folder, "town.osm")]
        write_town(paths[0])
        if cls.has_tiles:
            paths.append(os.path.join(folder, "city.mbtiles"))
            write_tiles(paths[1])
        cls.server_arguments = paths
        super().setUpClass()

    def label(self):
        return self.browser.execute_script(
            "return document.querySelector('.leaflet-streets-pane canvas')?.getAttribute('aria-label') ?? ''")

    def ink(self):
        """How many different colours the streets' canvas has."""
        return self.browser.execute_script("""
            const canvas = document.querySelector('.leaflet-streets-pane canvas');
            const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
            const seen = new Set();
            for (let i = 0; i < data.length; i += 4) if (data[i + 3] === 255) {
              seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
            }
            return seen.size;""")

    def pass_by(self, vehicle, east_m, north_m, east=True):
        """A vehicle drives eastwards or westwards past a pothole and reports it."""
        step = 10 if east else -10
        self.zone.drive([at(east_m - step, north_m), at(east_m, north_m)], vehicle=vehicle)
        return self.zone.report("pothole", *at(east_m, north_m), picture=False, vehicle=vehicle)


class Desktop(Streets):
    def test_an_empty_map_shows_the_streets_with_their_names(self):
        self.open()
        self.wait(lambda: "Parkway" in self.label() or "Street" in self.label(), "no names of streets")
        self.assertGreater(self.ink(), 3)
        self.picture("streets_light")
        for _ in range(3):
            self.click(".leaflet-control-zoom-in")
            self.wait_still()
        self.wait(lambda: "Avenue" in self.label(), "no avenues")
        self.picture("streets_light_near")
        for _ in range(6):
            self.click(".leaflet-control-zoom-out")
            self.wait_still()
        self.picture("streets_light_far")
        self.assert_quiet()

    def test_a_street_named_as_a_script_is_drawn_listed_and_shown_as_text(self):
        hazard = self.pass_by("car-1", 40, BLOCK_M / 2)
        self.open()
        self.open_popup_of(hazard)
        self.wait_for_text(f'.popup[data-hazard="{hazard}"]', SCRIPT, "near", "eastbound")
        self.wait(lambda: SCRIPT in self.label(), "the name is not drawn")
        row = self.find(f'#hazard-list button[data-hazard="{hazard}"] .row-facts')
        self.assertIn(SCRIPT, row.text)
        self.picture("streets_script")
        self.assertEqual(self.count("img[src='x']"), 0)
        self.assertEqual(self.browser.title, "LiveMap")
        self.assert_quiet()

    def test_a_hazard_is_found_by_its_street(self):
        first = self.pass_by("car-1", 40, -BLOCK_M / 2)
        self.pass_by("car-2", 40, -1.5 * BLOCK_M, east=False)
        self.open()
        self.wait_for(".hazard-list .row", 2)
        search = self.find("#list-search")
        search.send_keys("5TH street east")
        self.wait(lambda: self.count(".hazard-list .row") == 1, "the search finds not one")
        row = self.find(".hazard-list .row")
        self.assertEqual(row.get_attribute("data-hazard"), first)
        self.assertIn("5th Street, near F Avenue, eastbound", row.text)
        search.send_keys(" nowhere")
        self.wait_for_text("#list-note", "matches the search")
        search.clear()
        search.send_keys("westbound")
        self.wait(lambda: "westbound" in self.find(".hazard-list .row").text, "no westbound hazard")
        self.assert_quiet()


class Tiles(Streets):
    has_tiles = True

    def test_tiles_of_a_file_lie_under_the_streets(self):
        self.open()
        self.wait(lambda: self.count(".leaflet-tile-loaded") > 3 and "Street" in self.label(), "no tiles")
        self.wait_for_text(".attribution", "The City")
        self.assertEqual(self.count("img[src='x']"), 0)
        self.picture("streets_tiles")
        self.assert_quiet()


class Dark(Streets):
    dark = True

    def test_streets_are_drawn_in_dark_colours(self):
        hazard = self.pass_by("car-1", 40, -BLOCK_M / 2)
        self.open()
        self.open_popup_of(hazard)
        self.wait(lambda: "Street" in self.label(), "no names of streets")
        self.picture("streets_dark")
        self.assert_quiet()


class Phone(Streets):
    size = (390, 800)

    def test_streets_are_drawn_on_a_phone(self):
        self.pass_by("car-1", 40, -BLOCK_M / 2)
        self.open()
        self.wait(lambda: "Street" in self.label(), "no names of streets")
        self.picture("streets_phone")
        self.assert_quiet()


if __name__ == "__main__":
    sys.exit(run_tests(__doc__))
