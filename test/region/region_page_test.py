#!/usr/bin/python3
"""The page of a region in real Chromium: hazards of all zones, outlines, a zone that is down in grey.

  region_page_test.py --server PATH_OF_map_page_server --region PATH_OF_livemap_serve_region
    --user PATH_OF_livemap_zone_user [--screenshots DIR]

Skips as map_page_test.py does.
"""

import argparse
import os
import sys
import unittest

from region_fixture import Region, Zone, directory_of, square, temporary_folder
from parts_fixture import PASSWORD, Metropolis
from map_page_fixture import HOSTILE, LAT, LON, OPTIONS, MapPage, missing


class RegionPage(MapPage):
    @classmethod
    def setUpClass(cls):
        cls.take_browser()

    def setUp(self):
        self.folder = temporary_folder(self)
        self.north = Zone(os.path.join(self.folder, "north"))
        self.south = Zone(os.path.join(self.folder, "south"))
        for zone in (self.north, self.south):
            self.addCleanup(zone.close)
            zone.start()
        self.directory, self.authority = directory_of(
            [square("north", "The North", LAT, LON - 0.05, LAT + 0.05, LON + 0.05, self.north.url),
             square("south", HOSTILE, LAT - 0.05, LON - 0.05, LAT, LON + 0.05, self.south.url)], self.folder)
        self.region = Region(OPTIONS.region, os.path.join(self.folder, "region"), "--directory", self.directory,
                             "--authority", self.authority, "--title", "All zones of the town")
        self.addCleanup(self.region.close)
        self.region.start()
        self.addCleanup(self.leave, self.region.url + "/")
        self.browser.get_log("browser")

    def open(self):
        self.browser.get(self.region.url + "/")
        self.wait_state("live")

    def wait_zone(self, zone, state):
        self.wait(lambda: self.find(f'[data-zone="{zone}"]').get_attribute("data-state") == state,
                  f"zone '{zone}' is not {state} on the page")

    def wait_listed(self, count):
        self.wait(lambda: self.find("#list-count").get_attribute("textContent") == str(count), f"not {count} are listed")


class NeighbourPage(RegionPage):
    """A zone's own page, which shows what lies behind its border."""

    def test_what_another_zone_tells_behind_the_border_has_a_pin_of_its_own_kind_and_leads_to_that_zone(self):
        here, behind = LAT + 0.0005, LAT - 0.0005
        self.north.add("pothole", here, LON)
        # On the border: both zones hold it.
        self.north.add("debris", LAT + 0.00001, LON + 0.001)
        self.south.add("debris", LAT - 0.00001, LON + 0.001)
        hazard = self.south.add("barrier", behind, LON)
        self.assertEqual(self.north.process.do("follow", zone="north", directory=self.directory, authority=self.authority,
                                               store=os.path.join(self.folder, "neighbours"))["zones"], ["south"])
        self.browser.get(self.north.process.url)
        self.wait_state("live")
        pin = '.pin[data-neighbour="south"]'
        self.wait(lambda: self.count(pin) == 1, "not one hazard of the other zone is shown")
        self.wait(lambda: self.count(".pin:not([data-neighbour])") == 2, "the zone's own two are not shown")
        self.assertIn(HOSTILE, self.find(pin).get_attribute("aria-label"))
        self.wait_listed(2)
        self.click(pin)
        self.wait_for_text(".popup", "Barrier", HOSTILE, "Another zone tells drivers of it")
        self.assertEqual(self.find(".popup a").get_attribute("href"), self.south.url + "/")
        self.picture("neighbour")
        self.assertTrue(self.south.process.do("remove", id=hazard)["removed"])
        self.wait(lambda: self.count(pin) == 0, "it stays though the other zone took it back")
        self.assert_quiet()


class Desktop(RegionPage):
    def test_a_zone_that_goes_down_is_grey_with_its_last_state_until_it_is_back(self):
        self.north.add("pothole", LAT + 0.02, LON)
        self.south.add("debris", LAT - 0.02, LON + 0.01)
        self.open()
        self.wait_listed(2)
        self.wait_zone("north", "up")
        self.assertEqual(self.count(".zone-area"), 2)
        self.assertEqual(self.count(".zone-area.zone-down"), 0)
        self.assertEqual(self.find("#title").text, "All zones of the town")
        # The zone's name is text, whatever it holds.
        self.assertIn(HOSTILE, self.find('[data-zone="south"]').text)
        self.picture("region_up")
        self.north.kill()
        self.wait_zone("north", "down")
        self.wait(lambda: self.count(".zone-area.zone-down") == 1, "no zone is grey")
        self.wait_for_text('[data-zone="north"]', "Down, last heard at", "1 hazard")
        self.wait_for_text(".zone-label.zone-down", "The North", "last heard at")
        self.wait_listed(2)
        self.assertIn("1 of 2 down", self.find("#zone-count").text)
        self.picture("region_down")
        # What the other one tells comes at once.
        self.south.add("pothole", LAT - 0.03, LON - 0.02)
        self.wait_listed(3)
        self.north.start()
        self.north.add("traffic_cone", LAT + 0.03, LON - 0.02)
        self.wait_zone("north", "up")
        self.wait_listed(4)
        self.assertEqual(self.count(".zone-area.zone-down"), 0)
        self.picture("region_back")
        self.assert_quiet()

    def test_a_hazard_can_be_looked_at_and_nothing_can_be_done_with_it(self):
        self.north.add("pothole", LAT + 0.02, LON)
        self.open()
        self.wait_listed(1)
        self.open_popup_of(next(iter(self.region.hazards())))
        self.assertEqual(self.count(".popup .decide"), 0)
        self.assertEqual(self.count(".popup details"), 0)
        self.assertFalse(self.find("#session").is_displayed())
        self.picture("region_popup")
        self.assert_quiet()

    def test_the_page_finds_a_region_that_was_restarted_and_what_left_meanwhile_is_gone(self):
        hole = self.north.add("pothole", LAT + 0.02, LON)
        self.south.add("debris", LAT - 0.02, LON)
        self.region.arguments[self.region.arguments.index("--port") + 1] = self.region.url.rsplit(":", 1)[1]
        self.open()
        self.wait_listed(2)
        self.region.end()
        self.wait_state("offline")
        self.assertTrue(self.north.process.do("remove", id=hole)["removed"])
        self.region.start()
        self.wait_state("live")
        self.wait_listed(1)


class OfficialsOfParts(MapPage):
    """One zone of two parts: an official of the region at a keyboard."""

    @classmethod
    def setUpClass(cls):
        cls.take_browser()

    def setUp(self):
        self.metro = Metropolis(temporary_folder(self), OPTIONS.region, OPTIONS.user)
        self.addCleanup(self.metro.close)
        self.metro.start()
        self.addCleanup(self.browser.get, "about:blank")
        self.browser.execute_cdp_cmd("Network.clearBrowserCookies", {})
        self.browser.get_log("browser")

    def test_an_official_logs_in_reviews_the_candidates_of_both_parts_and_finds_it_in_the_trail(self):
        for name in self.metro.parts:
            self.metro.report(name)
        # Browsers keep a secure cookie of this machine's own.
        self.browser.get(self.metro.region.url.replace("127.0.0.1", "localhost") + "/")
        self.wait_state("live")
        self.assertEqual(self.find("#list-count").get_attribute("textContent"), "0")
        self.click("#session")
        self.find("#log-in-name").send_keys("alice")
        self.find("#log-in-password").send_keys(PASSWORD)
        self.click("#log-in-submit")
        self.wait(lambda: self.find("#session").text == "Log out alice", "alice has not logged in")
        self.wait_state("live")
        self.wait(lambda: self.find("#list-count").get_attribute("textContent") == "2", "not both candidates are listed")
        self.assertFalse(self.find("#vehicle-section").is_displayed())
        self.click("#review-open")
        self.wait_for_text("#review-place", "1 of 2")
        self.picture("region_review")
        self.click("#review-confirm")
        self.wait_for_text("#review-place", "2 of 2")
        self.find("#review-reason").send_keys("a shadow")
        self.click("#review-reject")
        self.wait_for_text("#review-subject", "That was the last one")
        self.click("#review-undo")
        self.wait_for_text("#review-place", "2 of 2")
        self.click("#review-close")
        self.click("#trail-section summary")
        self.wait(lambda: self.count(".trail-row") == 3, "the trail has not three decisions")
        self.assertIn("alice at metro", self.find("#trail").text)
        self.picture("region_trail")
        self.metro.parts["metro-2"].kill()
        self.wait(lambda: self.find('[data-zone="metro-2"]').get_attribute("data-state") == "down", "the part is not down")
        self.assert_quiet()


class Phone(RegionPage):
    size = (390, 844)
    dark = True

    def test_the_zones_stand_in_the_sheet(self):
        self.north.add("pothole", LAT + 0.02, LON)
        self.south.kill()
        self.open()
        self.wait_zone("south", "down")
        self.picture("region_phone_map")
        self.open_sheet()
        self.wait(lambda: self.find("#zone-count").text == "1 of 2 down", "the zones are not seen")
        self.picture("region_phone_sheet")
        self.assert_quiet()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--server", required=True)
    parser.add_argument("--region", required=True)
    parser.add_argument("--user", required=True)
    parser.add_argument("--screenshots")
    parser.add_argument("--failures")
    parser.add_argument("tests", nargs="*")
    parser.parse_args(namespace=OPTIONS)
    lacking = missing()
    if lacking:
        print(f"skipped: {lacking} is not installed")
        return 1 if os.environ.get("CI") else 77
    program = unittest.main(argv=[sys.argv[0], *OPTIONS.tests], exit=False, verbosity=2)
    return 0 if program.result.wasSuccessful() else 1


sys.exit(main())
