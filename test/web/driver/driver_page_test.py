#!/usr/bin/python3
"""The in-car page in real Chromium, on a car's screen and on a phone, with a real server; nothing is touched."""

import json
import os
import subprocess
import sys
import threading

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "page"))
import map_page_fixture as fixture  # noqa: E402
from map_page_fixture import HOSTILE, OPTIONS  # noqa: E402

GOOD = {"more": 0, "speed_mps": 0, "dark": False, "alerts": {"level": "good", "hazards": 3},
        "camera": {"level": "good", "rate_hz": 9.84}, "receiver": {"level": "good", "fix": True, "accuracy_m": 2.3},
        "zone": {"level": "good", "connected": True}, "reports": {"level": "good", "pending": 0},
        "voice": {"level": "good", "voice": "speech"}, "hazards": []}


def hazard(name, distance, side="ahead", number=1, urgency=2):
    return {"id": f"hazard-{number}", "class": name, "urgency": urgency, "side": side, "distance_m": distance}


class Vehicle:
    """The server; `show` publishes a state that is good but for what is named, and again twice a second, as driver_page
    does."""

    def __init__(self):
        self.lock = threading.Lock()
        self.state = None
        self.ended = threading.Event()
        self.beat = threading.Thread(target=self.repeat)
        self.process = subprocess.Popen([OPTIONS.server], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.url = f"http://127.0.0.1:{json.loads(self.process.stdout.readline())['port']}/"
        self.beat.start()

    def tell(self, state):
        with self.lock:
            self.state = state
            self.write()

    def write(self):
        self.process.stdin.write(json.dumps(self.state) + "\n")
        self.process.stdin.flush()
        assert self.process.stdout.readline() == "{}\n"

    def repeat(self):
        while not self.ended.wait(0.5):
            with self.lock:
                if self.state is not None:
                    self.write()

    def show(self, **changes):
        self.tell({**GOOD, **changes})

    def close(self):
        self.ended.set()
        self.beat.join()
        self.process.stdin.close()
        self.process.wait(fixture.HANG_S)


# Of each text on the page: itself, its size in px, and its contrast by WCAG 2.2 against what lies behind it.
CONTRASTS = """
const channel = c => (c /= 255) <= .04045 ? c / 12.92 : ((c + .055) / 1.055) ** 2.4;
const luminance = text => { const [r, g, b] = text.match(/[\\d.]+/g).map(Number);
  return .2126 * channel(r) + .7152 * channel(g) + .0722 * channel(b); };
const ground = luminance(getComputedStyle(document.body).backgroundColor);
return [...document.querySelectorAll('main p, main li, .parts b, .parts span')]
  .filter(node => node.textContent.trim() && node.checkVisibility()).map(node => {
    const style = getComputedStyle(node), ink = luminance(style.color);
    return [node.textContent, parseFloat(style.fontSize),
            (Math.max(ink, ground) + .05) / (Math.min(ink, ground) + .05)]; });
"""
# What of the page does not lie in the window, and what is cut off that should be read.
OUTSIDE = """
const width = innerWidth, height = innerHeight;
return [...document.querySelectorAll('main, #label, #distance, #bar, .parts li')].filter(node => node.checkVisibility())
  .filter(node => { const box = node.getBoundingClientRect();
    return box.left < -1 || box.top < -1 || box.right > width + 1 || box.bottom > height + 1; })
  .concat([...document.querySelectorAll('.parts span')].filter(node => node.scrollWidth > node.clientWidth))
  .map(node => node.id || node.className || node.textContent);
"""


class Page(fixture.MapPage):
    """The browser of the map's tests with this page; a class per screen."""

    def setUp(self):
        self.vehicle = Vehicle()
        self.addCleanup(self.vehicle.close)
        self.addCleanup(self.leave, self.vehicle.url)
        self.browser.get_log("browser")

    def open(self, **changes):
        self.vehicle.show(**changes)
        self.browser.get(self.vehicle.url)
        self.wait(lambda: self.state() not in ("waiting", "lost"), "the page shows no state")

    def state(self):
        return self.find("#ahead").get_attribute("data-state")

    def text(self, selector):
        return self.find(selector).text

    def wait_text(self, selector, text):
        self.wait(lambda: self.text(selector) == text, f"{selector} never says '{text}'")

    def parts(self):
        return {part: (self.find(f"#{part}").get_attribute("data-level"), self.text(f"#{part} span"))
                for part in ("camera", "receiver", "zone", "reports", "voice")}

    def assert_readable(self):
        self.assertEqual(self.browser.execute_script(OUTSIDE), [])
        texts = self.browser.execute_script(CONTRASTS)
        self.assertGreater(len(texts), 10)
        for text, size, contrast in texts:
            self.assertGreaterEqual(contrast, 4.5, text)
            self.assertGreaterEqual(size, 11, text)


class CarScreen(Page):
    size = (800, 480)

    def test_the_next_hazard_is_large_and_counts_down(self):
        self.open(hazards=[hazard("pothole", 240, "right"), hazard("deer", 320, number=2)], speed_mps=60, more=2)
        self.assertEqual(self.text("#label"), "Pothole")
        self.assertEqual(self.text("#side"), "on the right")
        self.assertEqual(self.count("#badge .glyph-pothole"), 1)
        self.wait(lambda: int(self.text("#distance")) <= 220, "the distance does not fall")
        self.assertEqual([each.text.split(" ")[0] for each in self.all("#later li")], ["Deer", "and"])
        height = self.browser.execute_script("return document.querySelector('#distance').getBoundingClientRect().height")
        self.assertGreaterEqual(height, 100)
        self.vehicle.show(hazards=[hazard("pothole", 90, "right")], speed_mps=20)
        self.wait(lambda: int(self.text("#distance")) <= 90, "the new distance is not shown")
        self.picture("driver_hazard")
        self.assert_readable()
        self.vehicle.show(hazards=[hazard("pothole", 4, "right")], speed_mps=2)
        self.wait_text("#distance", "here")
        self.assert_quiet()

    def test_without_a_hazard_it_says_so(self):
        self.open()
        self.assertEqual((self.state(), self.text("#label")), ("clear", "No hazard ahead"))
        self.picture("driver_clear")
        self.assert_readable()
        self.vehicle.show(alerts=None)
        self.wait(lambda: self.state() == "lost", "driver_alert's silence is not seen")

    def test_a_hazard_that_is_cancelled_leaves_the_screen(self):
        self.open(hazards=[hazard("deer", 150, urgency=1)])
        self.vehicle.show()
        self.wait_text("#label", "No hazard ahead")

    def test_it_tells_how_the_parts_are(self):
        self.open()
        self.assertEqual(self.parts(), {
            "camera": ("good", "9.8 / s"), "receiver": ("good", "fix, \u00b12 m"), "zone": ("good", "connected"),
            "reports": ("good", "all sent"), "voice": ("good", "speech")})
        self.vehicle.show(camera={"level": "bad", "rate_hz": 0}, receiver={"level": "bad", "fix": False, "accuracy_m": None},
                          zone={"level": "warn", "connected": False}, reports={"level": "good", "pending": 3}, voice=None)
        self.wait(lambda: self.parts() == {
            "camera": ("bad", "0.0 / s"), "receiver": ("bad", "no fix"), "zone": ("bad", "no link"),
            "reports": ("warn", "3 waiting"), "voice": ("unknown", "off")}, "the parts do not change")
        self.assertEqual(self.text("#label"), "No warnings: no position")
        self.picture("driver_parts")
        self.assert_readable()

    def test_a_vehicle_that_falls_silent_is_not_taken_for_a_free_road(self):
        self.open(hazards=[hazard("pothole", 240)], speed_mps=10)
        self.vehicle.tell(None)
        self.wait_text("#label", "No word from the vehicle")
        self.assertEqual(self.count("#distance:not(:empty)") and self.find("#distance").is_displayed(), False)
        self.assertEqual({level for level, _ in self.parts().values()}, {"unknown"})
        self.vehicle.show(hazards=[hazard("barrier", 100)])
        self.wait_text("#label", "Barrier")

    def test_day_and_night_follow_the_vehicle(self):
        self.open(dark=True, hazards=[hazard("stopped_accident", 180, urgency=1)])
        self.wait(lambda: self.look() == "night", "no night")
        self.picture("driver_night")
        self.assert_readable()
        self.vehicle.show(dark=False)
        self.wait(lambda: self.look() == "day", "no day")

    def look(self):
        return self.browser.execute_script("return document.documentElement.dataset.look")

    def test_text_of_others_is_no_code(self):
        self.open(hazards=[hazard(HOSTILE, 240), hazard("<script>alert(1)</script>", 300, number=2)],
                  voice={"level": HOSTILE, "voice": HOSTILE})
        self.wait_text("#label", HOSTILE)
        self.assertEqual(self.count("main img, main script"), 0)
        self.assert_quiet()

    def test_it_asks_for_nothing_from_elsewhere(self):
        self.open()
        hosts = self.browser.execute_script(
            "return performance.getEntriesByType('resource').map(entry => new URL(entry.name).host)")
        self.assertEqual(set(hosts), {self.vehicle.url.split("/")[2]})


class CarScreenDark(Page):
    size = (800, 480)
    dark = True

    def test_without_a_sun_the_systems_scheme_counts(self):
        self.open(dark=None)
        self.assertEqual(self.browser.execute_script("return document.documentElement.dataset.look"), "night")


class Phone(Page):
    size = (390, 844)

    def test_a_phone_shows_all_without_scrolling(self):
        self.open(hazards=[hazard("construction_machine", 240, "left"), hazard("deer", 320, number=2)], speed_mps=0, more=7)
        self.assertEqual(self.text("#label"), "Construction machine")
        self.picture("driver_phone")
        self.assert_readable()
        self.vehicle.show(hazards=[hazard("W" * 64, 240, "left")], reports={"level": "good", "pending": 123456})
        self.wait(lambda: self.text("#label").startswith("WW"), "the long name is not shown")
        self.wait(lambda: not self.browser.execute_script(OUTSIDE), "the long name does not fit")
        self.assert_readable()
        self.picture("driver_phone_long")


if __name__ == "__main__":
    sys.exit(fixture.run_tests(__doc__.splitlines()[0]))
