#!/usr/bin/python3
"""The officials' console in real Chromium: comments, assignments, edits, statistics, export, time line.

  map_page_console_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import csv
import io
import json
import sys

import map_page_log_in_test as log_in_test
from map_page_fixture import HOSTILE, LAT, LON, OPTIONS, Keys, run_tests
from map_page_officials_test import OfficialsPage

# What a click on a link with `download` would save.
CATCH_FILES = """
  window.saved = null;
  URL.createObjectURL = (blob) => { blob.text().then((text) => { window.saved = text; }); return 'blob:'; };
  HTMLAnchorElement.prototype.click = function click() {};"""


class ConsolePage(OfficialsPage):
    """What the tests of the console share."""

    log_in, wait_logged_in = log_in_test.LogIn.log_in, log_in_test.LogIn.wait_logged_in

    def open_as(self, name):
        """As somebody who has logged in; how one does is for map_page_log_in_test."""
        self.open_accounts()
        cookie = self.zone.do("session", name=name)
        self.browser.execute_cdp_cmd("Network.setCookie", {**cookie, "url": self.zone.url, "httpOnly": True})
        self.open()
        self.wait_logged_in(name)

    def start_work(self, hazard, task):
        self.open_popup_of(hazard)
        self.click('.popup [data-focus="work"]')
        self.wait(lambda: self.find("#work").is_displayed(), "no dialog opens")
        self.browser.execute_script("""
            const task = document.getElementById('work-task');
            task.value = arguments[0];
            task.dispatchEvent(new Event('change'));""", task)

    def save_work(self):
        self.click("#work-submit")
        self.wait(lambda: not self.find("#work").is_displayed(), "the dialog stays")

    def open_history(self):
        self.click('.popup [data-focus="history"]')
        self.wait_for(".history-list li")

    def look(self, name):
        """A picture on a desktop and on a phone, light and dark; nothing where none are taken."""
        if not OPTIONS.screenshots:
            return
        for dark in (False, True):
            self.emulate_scheme(dark)
            for size, width, height in (("desktop", 1280, 800), ("phone", 390, 844)):
                self.emulate_size(width, height)
                self.picture(f"{name}_{size}_{'dark' if dark else 'light'}")
        self.emulate_size(*self.size)
        self.emulate_scheme(False)

    def emulate_scheme(self, dark):
        self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]})

    def emulate_size(self, width, height):
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
            "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600})


class Console(ConsolePage):
    def test_a_hostile_comment_stays_text_in_time_line_and_trail(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open_as("miller")
        self.click("#trail-section summary")
        self.start_work(hazard, "comment")
        self.picture("work_comment")
        self.write("#work-text", HOSTILE)
        self.save_work()
        self.wait_for_text("#trail", "Commented on a hazard", HOSTILE)
        self.open_popup_of(hazard)
        self.open_history()
        self.wait_for_text(".history-list", "Comment", HOSTILE, "miller")
        self.wait(lambda: self.browser.execute_script(
            "return document.querySelector('.history-picture img')?.naturalWidth > 0"),
            "the sighting has no picture")
        self.look("time_line")
        self.assertEqual(self.count(".history-list img[src='x'], #trail img"), 0)
        self.assert_quiet()

    def test_overdue_work_is_marked_and_the_filter_shows_a_team_alone(self):
        late = self.zone.report("pothole", LAT, LON)
        self.zone.report("deer", LAT + 0.001, LON)
        self.open_as("miller")
        self.start_work(late, "assign")
        self.write("#work-team", "Roads north")
        self.browser.execute_script("document.getElementById('work-due').value = '2025-12-01'")
        self.save_work()
        self.wait_for_text("#work-count", "1 overdue")
        self.wait_for_text("#work-list", "Roads north", "overdue since 2025-12-01")
        self.browser.execute_script("""
            const filter = document.getElementById('work-filter');
            filter.value = 'Roads north';
            filter.dispatchEvent(new Event('change'));""")
        self.wait(lambda: self.count("#hazard-list button") == 1, "the other hazard is still listed")
        self.look("assigned")
        self.click("#notice-undo")
        self.wait(lambda: self.text("#work-count") == "0", "the assignment stays")
        self.assert_quiet()

    def test_a_hazard_is_closed_as_repaired_and_the_statistics_count_it(self):
        repaired = self.zone.report("pothole", LAT, LON)
        confirmed = self.zone.report("pothole", LAT + 0.001, LON)
        self.zone.report("deer", LAT + 0.002, LON)
        self.open_as("miller")
        self.zone.do("confirm", id=confirmed)
        self.start_work(repaired, "close")
        self.save_work()
        self.wait(lambda: self.count("#hazard-list button") == 2, "it stays on the map")
        self.click("#select-section summary")
        self.click("#statistics-open")
        self.wait_for_text("#statistics-body", "Pothole", "100")
        self.wait_for(".statistics abbr")
        self.look("statistics")
        self.click("#statistics-close")
        self.assert_quiet()

    def test_a_class_is_changed_and_a_hazard_moved_by_typed_degrees_and_by_dragging(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open_as("miller")
        self.start_work(hazard, "class")
        self.browser.execute_script("document.getElementById('work-class').value = 'debris'")
        self.save_work()
        self.wait_for_text("#hazard-list", "Debris")
        self.start_work(hazard, "move")
        self.write("#work-latitude", str(LAT + 0.01))
        self.click("#work-submit")
        self.wait_for_text("#work-error", "at most 200 m")
        self.write("#work-latitude", str(LAT + 0.0005))
        self.save_work()
        self.start_work(hazard, "move")
        self.assertEqual(float(self.find("#work-latitude").get_attribute("value")), LAT + 0.0005)
        self.click("#work-drag")
        marker = self.wait_for(".work-marker")
        self.picture("work_drag")
        self.mouse().click_and_hold(self.find(".work-marker")).move_by_offset(30, 0).release().perform()
        self.wait(lambda: self.find("#work").is_displayed(), "the dialog does not come back")
        self.assertGreater(float(self.find("#work-longitude").get_attribute("value")), LON)
        self.save_work()
        self.wait_for_text("#notice-text", "Moved")
        self.assertIsNotNone(marker)
        self.assert_quiet_but(409)

    def test_two_hazards_are_merged_and_split_again(self):
        kept = self.zone.report("pothole", LAT, LON)
        self.zone.report("pothole", LAT + 0.0004, LON)
        self.open_as("miller")
        self.wait(lambda: self.count("#hazard-list button") == 2, "not both are listed")
        self.start_work(kept, "merge")
        self.wait_for("#work-other option")
        self.picture("work_merge")
        self.save_work()
        self.wait(lambda: self.count("#hazard-list button") == 1, "both are still there")
        self.open_popup_of(kept)
        self.open_history()
        self.wait_for_text(".history-list", "of the one that was merged")
        self.click(".history-list li button")
        self.wait(lambda: self.find("#decision").is_displayed(), "no question is asked")
        self.submit()
        self.wait_closed()
        self.wait(lambda: self.count("#hazard-list button") == 2, "they are not split")
        self.assert_quiet()

    def ask_for_frame(self, hazard):
        self.open_popup_of(hazard)
        self.click('.popup [data-focus="frame"]')
        self.wait_for_text(".frame-state", "Whole frame asked for", "by miller, waiting for a vehicle until")

    def pass_by(self, answer, picture=True):
        """A vehicle comes to the hazard at LAT, LON from the south, and answers what it is asked."""
        for metres in (60, 50, 40):
            self.zone.do("vehicle", id="car-7", lat=LAT - metres / 111132, lon=LON, course=0.0, speed=8.0)
        asked = self.zone.do("answer_polls", answer=answer, picture=picture)
        self.assertEqual(asked["answered"], asked["frames"], "another poll than that for the frame")
        return asked["frames"]

    def test_the_next_vehicle_is_asked_for_the_whole_frame_which_stands_in_the_history(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open_as("miller")
        self.ask_for_frame(hazard)
        self.assertEqual(self.count('.popup [data-focus="frame"]'), 0, "one request at a time")
        self.look("frame_waiting")
        self.assertEqual(self.pass_by("no"), 1)
        self.wait_for_text(".frame-state", "here it is")
        self.assertEqual(self.count('.popup [data-focus="frame"]'), 1, "another one may be asked for")
        self.open_history()
        self.wait_for_text(".history-list", "Whole frame asked for",
                           "Whole frame, asked for by an official: it was not found")
        self.wait(lambda: self.browser.execute_script(
            "return [...document.querySelectorAll('.history-picture img')].filter((one) => one.naturalWidth > 0)"
            ".length") == 2, "not both pictures are in the time line")
        self.look("frame_taken")
        self.click(".frame-state a")
        self.wait_for_text("#viewer-words", "1 of 2", "Whole frame")
        self.press(Keys.ESCAPE)
        self.wait(lambda: not self.find("#viewer").is_displayed(), "the viewer stays")
        self.click("#trail-section summary")
        self.wait_for_text("#trail", "Asked for a whole frame of a hazard", "miller")
        self.assert_quiet()

    def test_a_request_for_a_frame_is_taken_back_or_runs_out(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open_as("miller")
        self.ask_for_frame(hazard)
        self.click("#notice-undo")
        self.wait_for_text(".frame-state", "taken back")
        self.assertEqual(self.pass_by("yes"), 0, "nobody is asked any more")
        self.ask_for_frame(hazard)
        # The hazard itself stays as it is: nothing but the time tells the page.
        self.zone.do("pass", seconds=4 * 3600 + 60)
        self.wait_for_text(".frame-state", "no vehicle brought one in time")
        self.assert_quiet()

    def test_pictures_are_looked_at_closer_and_one_after_the_other(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.zone.report("pothole", LAT, LON, vehicle="car-2", label="second look")
        self.zone.report("pothole", LAT, LON, vehicle="car-3", label="third look")
        self.open_as("miller")
        self.open_popup_of(hazard)
        self.click(".popup .picture-link")
        self.wait_for_text("#viewer-words", " of 3", "% sure")
        self.wait(lambda: self.zoom_of_picture() == 1, "the picture does not come")
        self.assertIn("Pothole", self.find("#viewer-image").get_attribute("alt"))
        self.look("viewer")
        first = self.find("#viewer-image").get_attribute("src")
        # By keys.
        self.press("+")
        self.wait(lambda: self.zoom_of_picture() > 1.4, "+ does not enlarge")
        before = self.picture_place()
        self.press(Keys.ARROW_LEFT)
        self.wait(lambda: self.picture_place()["left"] > before["left"], "the arrow does not move it")
        self.assertEqual(self.find("#viewer-image").get_attribute("src"), first)
        self.press("-", "-")
        self.wait(lambda: self.zoom_of_picture() == 1, "- does not make it smaller")
        # By the wheel: what is under the pointer stays there.
        stage = self.find("#viewer-stage")
        self.browser.execute_script("""
            const {left, top, width, height} = arguments[0].getBoundingClientRect();
            arguments[0].dispatchEvent(new WheelEvent('wheel', {deltaY: -400, cancelable: true,
              clientX: left + width / 4, clientY: top + height / 2}));""", stage)
        self.wait(lambda: self.zoom_of_picture() > 2, "the wheel does not enlarge")
        self.picture("viewer_close")
        # By two fingers.
        self.press("0")
        self.wait(lambda: self.zoom_of_picture() == 1, "0 does not show the whole picture")
        self.pinch(stage, 100, 300)
        self.wait(lambda: self.zoom_of_picture() > 2, "two fingers do not enlarge")
        self.press("0", Keys.ARROW_RIGHT)
        self.wait_for_text("#viewer-words", "2 of 3")
        self.wait(lambda: self.find("#viewer-image").get_attribute("src") != first, "it is the same picture")
        self.press(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
        self.wait_for_text("#viewer-words", "3 of 3")
        self.assertFalse(self.find("#viewer-next").is_enabled(), "there is no fourth")
        self.press(Keys.ESCAPE)
        self.wait(lambda: not self.find("#viewer").is_displayed(), "Escape does not close it")
        self.assertEqual(self.browser.execute_script("return document.activeElement.className"), "picture-link")
        self.wait_for(".popup", 1)
        self.assert_quiet()

    def picture_place(self):
        return self.browser.execute_script(
            "return document.getElementById('viewer-image').getBoundingClientRect().toJSON()")

    def zoom_of_picture(self):
        """How much larger than fitted; 0 before the picture has come."""
        return self.browser.execute_script("""
            const image = document.getElementById('viewer-image');
            const width = parseFloat(image.style.width);
            return image.naturalWidth > 0 && width > 0
              ? Math.round(1000 * image.getBoundingClientRect().width / width) / 1000 : 0;""")

    def pinch(self, element, from_px, to_px):
        """Two fingers around the middle, from so far apart to so far apart."""
        self.browser.execute_script("""
            const [stage, from, to] = arguments;
            const {left, top, width, height} = stage.getBoundingClientRect();
            const tell = (kind, id, x) => stage.dispatchEvent(new PointerEvent(kind, {
              pointerId: id, pointerType: 'touch', bubbles: true, cancelable: true,
              clientX: left + width / 2 + x, clientY: top + height / 2}));
            for (const [id, side] of [[71, -1], [72, 1]]) tell('pointerdown', id, side * from / 2);
            for (let step = 1; step <= 5; step += 1) {
              const apart = from + (to - from) * step / 5;
              for (const [id, side] of [[71, -1], [72, 1]]) tell('pointermove', id, side * apart / 2);
            }
            for (const id of [71, 72]) tell('pointerup', id, 0);""", element, from_px, to_px)

    def test_what_the_filters_leave_is_exported(self):
        self.zone.report("pothole", LAT, LON)
        self.zone.report("deer", LAT + 0.002, LON)
        self.open()
        self.wait(lambda: self.count("#hazard-list button") == 2, "not both are listed")
        self.browser.execute_script(CATCH_FILES)
        self.click("#select-section summary")
        self.click("#area-draw")
        self.browser.execute_script("document.getElementById('map').scrollIntoView()")
        x, y = self.browser.execute_script("""
            const pin = [...document.querySelectorAll('.pin')].find((one) => one.title.startsWith('Pothole'));
            const place = pin.getBoundingClientRect();
            return [place.left + 17, place.top + 40];""")
        for dx, dy in ((-40, -40), (40, -40), (40, 40), (-40, 40)):
            self.click_map_at(x + dx, y + dy)
        self.wait_for_text("#area-draw", "4 corners")
        self.click("#area-draw")
        self.wait(lambda: self.count("#hazard-list button") == 1, "the area does not filter the list")
        self.picture("area")
        self.click("#export-geojson")
        told = json.loads(self.wait(lambda: self.browser.execute_script("return window.saved"), "no file"))
        self.assertEqual([one["properties"]["class"] for one in told["features"]], ["pothole"])
        self.assertAlmostEqual(told["features"][0]["geometry"]["coordinates"][1], LAT, 5)
        self.click("#area-clear")
        self.wait(lambda: self.count("#hazard-list button") == 2, "the area stays")
        self.browser.execute_script("window.saved = null")
        self.click("#export-csv")
        text = self.wait(lambda: self.browser.execute_script("return window.saved"), "no file")
        self.assertEqual({row["class"] for row in csv.DictReader(io.StringIO(text))}, {"pothole", "deer"})
        self.assert_quiet()

    def test_hazards_are_filtered_by_age(self):
        self.zone.report("pothole", LAT, LON)
        self.zone.do("pass", seconds=2 * 86400)
        self.zone.report("debris", LAT + 0.002, LON)
        self.open()
        self.browser.execute_script("const now = Date.now; Date.now = () => now() + 2 * 86400000;")
        rows = "return [...document.querySelectorAll('#hazard-list .row-label')].map((one) => one.textContent)"
        for age, left in (("First seen in the last 24 hours", ["Debris"]), ("Nothing new for 24 hours", ["Pothole"]),
                          ("First seen more than 7 days ago", []), ("Any age", ["Debris", "Pothole"])):
            self.browser.execute_script("""
                const select = document.getElementById('age-filter');
                select.value = [...select.options].find((one) => one.text === arguments[0]).value;
                select.dispatchEvent(new Event('change'));""", age)
            self.wait(lambda left=left: sorted(self.browser.execute_script(rows)) == left,
                      f"'{age}' does not leave {left}")
            self.assertEqual(self.count(".pin"), len(left), f"signs on the map with '{age}'")
        self.picture("age")
        self.assert_quiet()

    def click_map_at(self, x, y):
        for kind in ("mousePressed", "mouseReleased"):
            self.browser.execute_cdp_cmd("Input.dispatchMouseEvent", {
                "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1})

    def test_a_viewer_reads_and_a_stranger_sees_none_of_it(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open_accounts()
        self.open()
        for hidden in ("#work-section", "#statistics-open"):
            self.assertFalse(self.find(hidden).is_displayed(), f"a stranger sees {hidden}")
        self.log_in("jones")
        self.wait_logged_in("jones")
        self.assertTrue(self.find("#work-section").is_displayed())
        self.open_popup_of(hazard)
        self.assertEqual(self.count('.popup [data-focus="work"]'), 0)
        self.press(Keys.ESCAPE)
        self.assert_quiet()


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
