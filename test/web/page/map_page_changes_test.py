#!/usr/bin/python3
"""Map changes in real Chromium: their own layer beside the hazards, by mouse and by keyboard, and officials.

  map_page_changes_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import sys

from map_page_fixture import LAT, LON, Keys, MapPage, run_tests

FAR = 0.002  # Degrees to the north: markers that are not gathered.


class Desktop(MapPage):
    def open_change(self, change):
        self.click(f'#changes button[data-change="{change}"]')
        self.wait_for(f'.popup[data-change="{change}"]')

    def wait_fact(self, change, *parts):
        self.wait_for_text(f'.popup[data-change="{change}"]', *parts)

    def counted(self, number):
        self.wait(lambda: self.find("#change-count").text == str(number), f"the box does not count {number}")

    def test_changes_are_squares_of_their_own_beside_the_hazards(self):
        self.zone.report("pothole", LAT, LON)
        self.zone.change("barrier", LAT + FAR, LON)
        self.zone.change("sign", LAT - FAR, LON, vanished=True)
        self.open()
        self.wait_for('.change [data-direction="appeared"]')
        self.wait_for('.change [data-direction="vanished"]')
        self.assertEqual(self.count(".pin"), 1)
        self.assertEqual(self.count("#hazard-list button"), 1)
        self.counted(2)
        signs = [self.find(f'.change [data-direction="{direction}"] path').get_attribute("d")
                 for direction in ("appeared", "vanished")]
        self.assertNotEqual(*signs)
        self.assertEqual(self.count(".change .change-badge"), 2)
        self.picture("map_changes")
        self.assert_quiet()

    def test_a_popup_says_what_happened_and_changes_before_ones_eyes(self):
        change = self.zone.change("barrier", LAT, LON)
        self.open()
        self.open_change(change)
        self.wait_fact(change, "Barrier appeared", "Proposed", "It appeared", "1 vehicle, 1 drive", "First seen")
        self.picture("map_change_popup")
        self.zone.change("barrier", LAT, LON, vehicle="car-2")
        self.wait_fact(change, "Confirmed", "2 vehicles, 2 drives")
        self.wait(lambda: self.count('.change [data-state="confirmed"]') == 1, "the square stays dashed")
        for vehicle in ("car-3", "car-4"):
            self.zone.change("barrier", LAT, LON, vanished=True, vehicle=vehicle)
        self.wait(lambda: self.count(".change") == 0, "what was undone stays")
        self.counted(0)
        self.assertFalse(self.find("#change-section").is_displayed())
        self.assert_quiet()

    def test_the_box_hides_and_shows_the_layer(self):
        self.zone.report("pothole", LAT, LON)
        self.zone.change("barrier", LAT + FAR, LON)
        self.open()
        self.wait_for(".change")
        self.click("#show-changes")
        self.wait(lambda: self.count(".change") == 0, "the layer stays")
        self.assertFalse(self.find("#change-section").is_displayed())
        self.assertEqual(self.count(".pin"), 1)
        self.zone.change("bin", LAT - FAR, LON)
        self.counted(2)
        self.assertEqual(self.count(".change"), 0)
        self.click("#show-changes")
        self.wait_for(".change", 2)
        self.assert_quiet()

    def test_a_new_one_is_announced_and_one_gets_along_without_a_mouse(self):
        first = self.zone.change("barrier", LAT, LON)
        self.open()
        second = self.zone.change("traffic_cone", LAT + FAR, LON)
        self.wait(lambda: "New map change: Traffic cone appeared" in
                  self.find("#announcer").get_attribute("textContent"), "it is not announced")
        self.wait_for("#changes button", 2)
        self.assertEqual(self.count('#changes button[tabindex="0"]'), 1)
        self.browser.execute_script("document.querySelector('#changes button[tabindex=\"0\"]').focus()")
        focused = "return document.activeElement.dataset.change"
        before = self.browser.execute_script(focused)
        self.press(Keys.ARROW_DOWN if before == second else Keys.ARROW_UP)
        other = first if before == second else second
        self.wait(lambda: self.browser.execute_script(focused) == other, "the arrow does not move")
        self.press(Keys.ENTER)
        self.wait_for(f'.popup[data-change="{other}"]')
        self.wait(lambda: self.browser.execute_script(focused) == other and self.browser.execute_script(
            "return document.activeElement.classList.contains('popup')"), "the popup has no focus")
        self.press(Keys.ESCAPE)
        self.wait(lambda: self.browser.execute_script(
            "return document.activeElement.closest('#changes') !== null"), "the focus is lost")
        self.assert_quiet()

    def test_an_official_confirms_and_dismisses(self):
        change = self.zone.change("barrier", LAT, LON)
        self.open()
        self.open_change(change)
        self.click('.popup [data-focus="confirm"]')
        self.wait_for_text("#decision-title", "Confirm this map change?")
        self.find("#decision-token").send_keys(self.zone.token)
        self.click("#decision-submit")
        self.wait(lambda: not self.find("#decision").is_displayed(), "the question stays")
        self.wait_fact(change, "Confirmed")
        self.click('.popup [data-focus="dismiss"]')
        self.wait_for_text("#decision-label", "Barrier appeared", "40.44330")
        self.click("#decision-submit")
        self.wait_for_text("#decision-error", "Please say why")
        self.find("#decision-reason").send_keys("a shadow")
        self.click("#decision-submit")
        self.wait(lambda: self.count(".change") == 0, "it stays on the map")
        self.wait(lambda: "Dismissed: Barrier appeared" in
                  self.find("#announcer").get_attribute("textContent"), "nothing is announced")
        self.click("#notice-undo")
        self.wait_for('.change [data-state="confirmed"]')
        self.open_change(change)
        self.click('.popup [data-focus="dismiss"]')
        self.find("#decision-reason").send_keys("a shadow")
        self.click("#decision-submit")
        self.wait(lambda: self.count(".change") == 0, "it stays on the map")
        self.zone.change("barrier", LAT, LON, vehicle="car-9")
        self.zone.change("bin", LAT + FAR, LON)
        self.wait_for(".change")
        self.counted(1)
        self.assert_quiet()

    def test_without_officials_there_are_no_buttons(self):
        self.zone.do("close_decisions")
        change = self.zone.change("barrier", LAT, LON)
        self.open()
        self.open_change(change)
        self.wait_fact(change, "Barrier appeared")
        self.assertEqual(self.count(".popup .decide"), 0)


if __name__ == "__main__":
    sys.exit(run_tests(__doc__))
