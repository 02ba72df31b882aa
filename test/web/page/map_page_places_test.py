#!/usr/bin/python3
"""Where the page looks, in real Chromium: it opens where the zone says, also where east meets west.

  map_page_places_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import math
import sys

from map_page_fixture import LAT, LON, MapPage, run_tests

# Clicks what the argument selects when a zoom, which lasts a quarter of a second, has begun.
WHILE_IT_ZOOMS = """
    const [selector, done] = arguments;
    const pane = document.querySelector('.leaflet-map-pane');
    new MutationObserver((_, observer) => {
      if (!pane.classList.contains('leaflet-zoom-anim')) return;
      observer.disconnect();
      document.querySelector(selector).click();
      done();
    }).observe(pane, { attributes: true });
    document.querySelector('.leaflet-control-zoom-in').click();"""


class Places(MapPage):
    def pins_seen(self):
        """Class and place in the window of the pins that one sees."""
        return self.browser.execute_script("""
            const map = document.getElementById('map').getBoundingClientRect();
            return [...document.querySelectorAll('.pin')].map((pin) => {
              const box = pin.getBoundingClientRect();
              return [pin.getAttribute('aria-label'), box.left + box.width / 2, box.top];
            }).filter(([, x, y]) => x > map.left && x < map.right && y > map.top && y < map.bottom);""")

    def kilometres(self):
        """Of the map's scale bar."""
        number, unit = self.find(".leaflet-control-scale-line").text.split()
        return float(number) / (1000 if unit == "m" else 1)


class Desktop(Places):
    def test_the_page_opens_where_most_hazards_are_and_no_vehicle_alone_decides(self):
        for number in range(6):
            self.zone.report("pothole", LAT + 0.003 * number, LON, picture=False, vehicle=f"car-{number}")
        for number in range(8):
            self.zone.report("debris", LAT - 20 - number, LON + 40, picture=False, vehicle="liar")
        self.open()
        self.wait(lambda: len(self.pins_seen()) == 6, "the hazards of six vehicles are not in view")
        self.assertTrue(all(name.startswith("Pothole") for name, _, _ in self.pins_seen()), self.pins_seen())
        self.assertLess(self.kilometres(), 5)
        # Everything is shown on demand.
        self.click(".fit-control button")
        self.wait(lambda: self.kilometres() > 100, "not everything is shown")
        self.assert_quiet()

    def test_everything_is_shown_also_where_that_is_asked_for_while_the_map_zooms(self):
        self.zone.report("pothole", LAT, LON, picture=False)
        self.zone.report("debris", LAT + 0.5, LON + 0.5, picture=False)
        self.open()
        self.wait(lambda: self.find("#list-count").text == "2", "not all are listed")
        self.wait_still()
        self.browser.execute_async_script(WHILE_IT_ZOOMS, ".fit-control button")
        self.wait(lambda: len(self.pins_seen()) == 2, "not everything is in view")
        self.assert_quiet()

    def test_a_vehicle_is_followed_also_where_that_is_asked_for_while_the_map_zooms(self):
        self.zone.report("pothole", LAT + 0.2, LON, picture=False)
        self.zone.drive([(LAT, LON), (LAT + 0.0005, LON)])
        self.open()
        self.wait_for("#vehicles button")
        self.wait_still()
        self.browser.execute_async_script(WHILE_IT_ZOOMS, "#vehicles button")
        self.wait(lambda: self.vehicle_off_centre() < 20, "the vehicle is not in the middle")
        self.assert_quiet()

    def vehicle_off_centre(self):
        return self.browser.execute_script("""
            const of = (one) => document.querySelector(one).getBoundingClientRect();
            const [map, car] = [of('#map'), of('.vehicle')];
            return Math.hypot(map.x + map.width / 2 - car.x - car.width / 2,
              map.y + map.height / 2 - car.y - car.height / 2);""")

    def test_an_empty_zone_opens_at_its_centre_wherever_a_vehicle_drives(self):
        self.zone.drive([(LAT + 3, LON + 3), (LAT + 3.0005, LON + 3)])
        self.open()
        self.wait_for("#vehicles button")
        self.assertLess(self.kilometres(), 5)
        self.assertEqual(self.vehicle_seen(), False)
        self.click("#vehicles button")
        self.wait(self.vehicle_seen, "a vehicle that is followed is not in view")

    def vehicle_seen(self):
        return self.browser.execute_script("""
            const map = document.getElementById('map').getBoundingClientRect();
            const { x, y } = document.querySelector('.vehicle').getBoundingClientRect();
            return x > map.left && x < map.right && y > map.top && y < map.bottom;""")

    def across(self):
        """Hazards, a map change and a drive on both sides of 180 degrees, 1100 m from end to end."""
        lat = -17.9
        self.zone.report("pothole", lat, 179.995, picture=False)
        self.zone.report("debris", lat, 179.999, picture=False)
        self.zone.report("deer", lat, -179.999, picture=False)
        self.zone.report("barrier", lat, -179.995, picture=False)
        self.zone.change("sign", lat + 0.001, -179.999)
        points = [(lat - 0.001, east if east <= 180 else east - 360)
                  for east in (179.996 + 0.00005 * step for step in range(160))]
        self.zone.drive(points)

    def test_across_180_degrees_the_page_opens_on_the_hazards_of_both_sides(self):
        self.across()
        self.open()
        self.wait(lambda: len(self.pins_seen()) == 4, f"pins in view: {self.pins_seen()}")
        self.assertLess(self.kilometres(), 5)
        self.assert_row_from_west_to_east()
        self.picture("antimeridian")
        self.click(".fit-control button")
        self.wait_still()
        self.wait(lambda: len(self.pins_seen()) == 4 and self.kilometres() < 5, "everything is the whole world")
        self.assert_row_from_west_to_east()
        self.wait(lambda: self.vehicle_seen() and self.count(".change") == 1, "vehicle or change is not in view")
        self.assert_quiet()

    def assert_row_from_west_to_east(self):
        names = [name.split(",")[0] for name, _, _ in sorted(self.pins_seen(), key=lambda pin: pin[1])]
        self.assertEqual(names, ["Pothole", "Debris", "Deer", "Barrier"])
        xs = sorted(x for _, x, _ in self.pins_seen())
        self.assertLess(xs[-1] - xs[0], 940)

    def test_a_drive_across_180_degrees_is_no_road_around_the_world(self):
        self.across()
        self.open()
        self.click(".fit-control button")
        self.wait_still()
        self.wait(lambda: len(self.pins_seen()) == 4, "the hazards are not in view")
        first, last = (min(x for _, x, _ in self.pins_seen()), max(x for _, x, _ in self.pins_seen()))
        for pane in ("roads", "trails"):
            drawn = self.wait(lambda pane=pane: self.drawn_columns(pane), f"nothing is drawn in {pane}")
            self.assertGreater(drawn[0], first - 20, pane)
            self.assertLess(drawn[1], last + 20, pane)
            self.assertGreater(drawn[1] - drawn[0], (last - first) * 0.6, pane)

    def drawn_columns(self, pane):
        """From where to where in the window something is drawn on the pane's canvas."""
        return self.browser.execute_script("""
            const canvas = document.querySelector(`.leaflet-${arguments[0]}-pane canvas`);
            const { data, width, height } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
            let first = width;
            let last = -1;
            for (let y = 0; y < height; y += 1) {
              for (let x = 0; x < width; x += 1) {
                if (data[4 * (y * width + x) + 3] < 128) continue;
                if (x < first) first = x;
                if (x > last) last = x;
              }
            }
            const { left } = canvas.getBoundingClientRect();
            return last < 0 ? null : [left + first, left + last];""", pane)

    def test_a_hazard_beyond_180_degrees_is_opened_from_the_list_and_from_the_map(self):
        self.across()
        self.open()
        self.wait(lambda: len(self.pins_seen()) == 4, "the hazards are not in view")
        for name in ("Barrier", "Pothole", "Deer", "Debris"):
            row = next(row for row in self.all("#hazard-list button") if name in row.text)
            self.open_popup_of(row.get_attribute("data-hazard"))
            self.wait(lambda: self.is_above(name), f"the popup of {name} is not above it")
        self.assert_quiet()

    def is_above(self, name):
        pin = next((pin for pin in self.pins_seen() if pin[0].startswith(name)), None)
        popup = self.browser.execute_script(
            "const r = document.querySelector('.leaflet-popup').getBoundingClientRect(); return r.left + r.width / 2")
        return pin is not None and math.isclose(pin[1], popup, abs_tol=3)

    def test_the_view_crosses_180_degrees_for_what_is_listed_in_view(self):
        self.across()
        self.zone.report("construction_machine", -17.9, 0.5, picture=False, vehicle="car-2")
        self.open()
        self.wait(lambda: self.find("#list-count").text == "5", "not all are listed")
        self.wait(lambda: len(self.pins_seen()) == 4, "the hazards are not in view")
        self.click("#in-view")
        self.wait(lambda: self.find("#list-count").text == "4", "the list ignores the view")


class Phone(Places):
    size = (390, 844)

    def test_everything_is_shown_as_near_as_the_map_has_room_for_it_above_the_sheet(self):
        for step in range(4):
            self.zone.report("pothole", LAT + 0.0006 * step, LON, picture=False, vehicle=f"car-{step}")
        self.open()
        self.click(".fit-control button")
        self.wait_still()
        self.wait(lambda: len(self.pins_seen()) == 4, "not all are in view")
        foot = self.browser.execute_script("return document.getElementById('sheet-handle').getBoundingClientRect().top")
        tops = [top for _, _, top in self.pins_seen()]
        self.assertLess(max(tops) + 40, foot)
        # Half a step nearer than half the room; the zoom goes by half steps.
        self.assertGreater(max(tops) - min(tops), (foot - 160) / 2)
        self.assert_quiet()


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
