#!/usr/bin/python3
"""The page on small screens and by keyboard, in real Chromium: the list has room, the focus is seen, all is reached.

  map_page_access_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import sys

from map_page_fixture import LAT, LON, Keys, MapPage, run_tests, street

ACTIVE = """
    const node = document.activeElement;
    const style = getComputedStyle(node);
    const box = node.getBoundingClientRect();
    return { id: node.id, hazard: node.dataset.hazard ?? null, classes: [...node.classList], tag: node.tagName,
      label: node.getAttribute('aria-label') ?? node.textContent, outline: style.outlineStyle,
      outlineWidth: parseFloat(style.outlineWidth), left: box.left, top: box.top, right: box.right,
      bottom: box.bottom, width: box.width };"""


class Full:
    """Beside a mixin: a page with all that stands above the list."""

    def open_full(self):
        road = street()
        self.zone.drive(road[:30])
        self.zone.drive(road[40:60], vehicle="car-2")
        for step in range(10):
            self.zone.change("barrier", LAT + 0.001 * step, LON + 0.002)
        for step, name in enumerate(("pothole", "traffic_cone", "debris", "road_work_sign", "barrier", "deer",
                                     "stopped_accident", "construction_machine", "spam")):
            self.zone.report(name, LAT + 0.0012 * step, LON, picture=False)
        self.open()
        self.wait(lambda: self.find("#list-count").get_attribute("textContent") == "9", "not all are listed")
        self.wait_for("#changes button", 10)

    def rows_seen(self):
        """Rows of hazards that nothing covers."""
        return self.browser.execute_script("""
            return [...document.querySelectorAll('#hazard-list button')].filter((row) => {
              const box = row.getBoundingClientRect();
              const at = (y) => document.elementFromPoint(box.left + box.width / 2, y)?.closest('button') === row;
              return at(box.top + 4) && at(box.bottom - 4);
            }).length;""")

    def assert_rows(self, least):
        self.wait(lambda: self.rows_seen() >= least, f"{self.rows_seen()} rows are seen")


class Laptop(Full, MapPage):
    size = (1280, 720)

    def test_the_list_has_room_below_ten_map_changes(self):
        self.open_full()
        self.assert_rows(3)
        self.picture("laptop")
        self.assert_quiet()

    def test_every_box_and_row_above_the_list_can_be_scrolled_to(self):
        self.open_full()
        for selector in ("#changes li:last-child button", "#vehicles li:last-child button", "#show-changes"):
            self.click(selector)
            if self.count(".popup"):
                self.press(Keys.ESCAPE)
        self.assert_rows(3)

    def test_a_section_folds_and_gives_its_room_to_the_list(self):
        self.open_full()
        before = self.rows_seen()
        for section in ("filter", "vehicle", "change"):
            self.click(f"#{section}-section summary")
        self.wait(lambda: self.rows_seen() > before, "the list does not grow")
        self.assertFalse(self.find("#filter").is_displayed())

    def walk(self, most, stop):
        """Tab by Tab: what had the focus."""
        visited = []
        for _ in range(most):
            self.press(Keys.TAB)
            visited.append(self.browser.execute_script(ACTIVE))
            if stop(visited[-1]):
                return visited
        raise AssertionError(f"not reached: {[one['label'][:30] for one in visited]}")

    def assert_seen(self, one):
        self.assertEqual(one["outline"], "solid", one)
        self.assertGreaterEqual(one["outlineWidth"], 2, one)

    def test_tab_reaches_the_map_its_buttons_and_the_signs_in_view_each_with_a_visible_focus(self):
        self.open_full()
        self.click(".fit-control button")
        self.wait_still()
        self.wait(lambda: self.count('.pin[tabindex="0"]') == 9, "not all are drawn")
        self.browser.execute_script("document.getElementById('in-view').focus()")
        in_view = self.count('#map .sign[tabindex="0"], #map .vehicle')
        self.assertGreaterEqual(in_view, 10)
        visited = self.walk(60, lambda one: one["tag"] == "BODY" or "skip" in one["classes"])[:-1]
        for one in visited:
            self.assert_seen(one)
            self.assertGreater(one["width"], 0)
            self.assertGreaterEqual(one["left"], 0)
            self.assertLessEqual(one["right"], 1281)
            self.assertLessEqual(one["top"], 720)
            self.assertGreaterEqual(one["bottom"], 0)
        self.assertIn("map", [one["id"] for one in visited])
        labels = [one["label"] for one in visited]
        for label in ("Zoom in", "Zoom out", "Show everything", "Vehicle car-1", "Vehicle car-2", "Barrier appeared"):
            self.assertIn(label, labels)
        for name in ("Accident", "Deer"):
            self.assertTrue(any(label.startswith(name) for label in labels), (name, labels))
        self.assertEqual(sum("pin" in one["classes"] for one in visited), 9)
        self.assert_quiet()

    def test_a_sign_opens_by_enter_and_escape_goes_back_to_it(self):
        self.open_full()
        self.click(".fit-control button")
        self.wait_still()
        self.wait_for('.pin[tabindex="0"]')
        self.browser.execute_script("document.querySelector('.pin[tabindex=\"0\"]').focus()")
        sign = self.browser.execute_script(ACTIVE)["label"]
        self.press(Keys.ENTER)
        self.wait_for(".popup[data-hazard]")
        self.wait(lambda: "popup" in self.browser.execute_script(ACTIVE)["classes"], "the popup has no focus")
        self.assert_seen(self.browser.execute_script(ACTIVE))
        seen = []
        for _ in range(5):
            self.press(Keys.TAB)
            seen.append(self.browser.execute_script(ACTIVE))
            self.assert_seen(seen[-1])
        self.assertTrue(any(one["tag"] == "SUMMARY" for one in seen), seen)
        self.press(Keys.ESCAPE)
        self.wait(lambda: self.count(".popup") == 0, "Escape does not close")
        self.wait(lambda: self.browser.execute_script(ACTIVE)["label"] == sign, "the focus is lost")
        self.assert_quiet()

    def test_the_arrows_go_from_sign_to_sign(self):
        for step in range(4):
            self.zone.report("pothole", LAT, LON + 0.002 * step, picture=False)
        self.open()
        self.click(".fit-control button")
        self.wait_still()
        self.wait_for(".pin", 4)
        self.browser.execute_script("""
            [...document.querySelectorAll('.pin')].sort((a, b) =>
              a.getBoundingClientRect().left - b.getBoundingClientRect().left)[0].focus();""")
        lefts = [self.browser.execute_script(ACTIVE)["left"]]
        for _ in range(3):
            self.press(Keys.ARROW_RIGHT)
            lefts.append(self.browser.execute_script(ACTIVE)["left"])
        self.assertEqual(lefts, sorted(set(lefts)))
        self.press(Keys.ARROW_LEFT)
        self.assertEqual(self.browser.execute_script(ACTIVE)["left"], lefts[2])

    def test_the_focus_is_seen_on_the_map_itself(self):
        self.open()
        self.browser.execute_script("document.getElementById('in-view').focus()")
        visited = self.walk(6, lambda one: one["id"] == "map")
        self.assert_seen(visited[-1])
        # Leaflet takes the outline away when a key goes up or down.
        self.press(Keys.ARROW_RIGHT)
        self.assert_seen(self.browser.execute_script(ACTIVE))

    def test_a_vehicles_popup_by_keyboard(self):
        self.zone.drive(street()[:30])
        self.open()
        self.wait_for(".vehicle")
        self.browser.execute_script("document.querySelector('.vehicle').focus()")
        self.press(Keys.ENTER)
        self.wait_for(".vehicle-popup")
        self.wait(lambda: "vehicle-popup" in self.browser.execute_script(ACTIVE)["classes"], "no focus")
        self.press(Keys.ESCAPE)
        self.wait(lambda: "vehicle" in self.browser.execute_script(ACTIVE)["classes"], "the focus is lost")
        self.assert_quiet()


class WideLaptop(Full, MapPage):
    size = (1366, 768)

    def test_the_list_has_room_below_ten_map_changes(self):
        self.open_full()
        self.assert_rows(3)


class Tablet(Full, MapPage):
    size = (800, 480)

    def test_the_list_has_room_on_a_low_screen(self):
        self.open_full()
        self.assert_rows(3)
        self.picture("low_screen")
        self.click("#filter-section summary")
        self.wait(lambda: self.find("#filter").is_displayed(), "the kinds do not open")
        self.assert_rows(2)
        self.picture("low_screen_kinds")
        self.assert_quiet()


class TabletDark(Tablet):
    dark = True


class Phone(Full, MapPage):
    size = (390, 844)

    def test_the_sheet_shows_the_list(self):
        self.open_full()
        self.open_sheet()
        self.assert_rows(4)
        self.picture("phone_sheet")
        hazard = self.find("#hazard-list button").get_attribute("data-hazard")
        self.open_popup_of(hazard)
        self.press(Keys.ESCAPE)
        self.wait(lambda: self.browser.execute_script(ACTIVE)["id"] == "sheet-handle", "the focus is lost")
        self.assert_quiet()


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
