"""Pictures of what officials and admins see, and of the map with streets: a real zone in a made-up town, with drawn
camera pictures, in headless Chromium. The zone and the ways through the page are those of the page's tests."""

import base64
import os
import pathlib
import sys
import tempfile
import unittest


def write(root, server, directory):
    """Writes map_streets, console, viewer, statistics, orders and accounts.jpg; False where the page did not do as it
    was told. `server` is the built map_page_server."""
    sys.path.insert(0, str(pathlib.Path(root) / "test/web/page"))
    import map_page_fixture as fixture
    from map_page_accounts_test import AccountsPage
    from map_page_orders_test import OrdersPage
    from map_page_streets_test import at, write_town
    fixture.OPTIONS.server = str(server)
    fixture.OPTIONS.failures = None

    class Pictures(OrdersPage, AccountsPage):
        size = (1280, 800)

        @classmethod
        def setUpClass(cls):
            folder = tempfile.TemporaryDirectory(prefix="livemap_pictures_")
            cls.addClassCleanup(folder.cleanup)
            town = os.path.join(folder.name, "town.osm")
            write_town(town, odd_name="Market Street")
            cls.server_arguments = [town]
            super().setUpClass()

        def photograph(self, name):
            self.wait_still()
            # As PNG those with a camera's picture are twice as large.
            picture = self.browser.execute_cdp_cmd("Page.captureScreenshot", {"format": "jpeg", "quality": 85})
            (pathlib.Path(directory) / f"{name}.jpg").write_bytes(base64.b64decode(picture["data"]))

        def drive_past(self, class_name, east_m, north_m, vehicles=1, label=None):
            """Vehicles go east past a hazard; its id."""
            for i in range(vehicles):
                name = f"car-{i + 1}"
                self.zone.drive([at(east_m - 10, north_m), at(east_m, north_m)], vehicle=name)
                hazard = self.zone.report(class_name, *at(east_m, north_m), vehicle=name,
                                          label=label if i == 0 else f"{class_name} {i + 1}")
            return hazard

        def fill_town(self):
            """Hazards on the streets, one of them seen by three vehicles; that one first."""
            seen = self.drive_past("pothole", -90, 90, vehicles=3)
            places = [("debris", 90, 90), ("traffic_cone", 270, 90), ("deer", -270, -90), ("pothole", 90, -90),
                      ("road_work_sign", 270, -90), ("barrier", -90, -90), ("pothole", -270, 270), ("debris", 90, 270)]
            return [seen, *(self.drive_past(*place) for place in places)]

        def test_pictures(self):
            pothole, debris, cone, deer, other, sign, barrier, *rest = self.fill_town()
            for hazard in (pothole, debris, cone, sign, other):
                self.zone.do("confirm", id=hazard)
            self.zone.do("reject", id=barrier)
            self.open_accounts()
            self.open()
            self.wait(lambda: "Street" in self.browser.execute_script(
                "return document.querySelector('.leaflet-streets-pane canvas')?.getAttribute('aria-label') ?? ''"),
                "no names of streets")
            self.open_popup_of(other)
            self.photograph("map_streets")
            self.log_in("miller")
            self.wait_logged_in("miller")
            self.assign(debris, "Roads north", "2025-12-01")
            self.assign(pothole, "Roads south", "2099-12-01")
            self.start_work(other, "close")
            self.save_work()
            self.start_work(pothole, "comment")
            self.write("#work-text", "Two lanes, close one of them for the repair")
            self.save_work()
            self.click("#notice-close")
            self.open_popup_of(pothole)
            self.open_history()
            self.browser.execute_script("document.querySelector('.popup').scrollTop = 10000")
            self.photograph("console")
            self.click(".popup .picture-link")
            self.wait_for_text("#viewer-words", " of 3", "% sure")
            self.press("+")
            self.photograph("viewer")
            self.press(fixture.Keys.ESCAPE)
            self.click("#select-section summary")
            self.click("#statistics-open")
            self.wait_for(".statistics")
            self.photograph("statistics")
            self.click("#statistics-close")
            self.open_orders()
            self.wait_for_text("#orders-list", "Open at the recipient", "overdue since 2025-12-01")
            self.photograph("orders")
            self.click("#orders-close")
            self.click("#session")
            self.wait_for_text("#session", "Log in")
            self.log_in("root")
            self.wait_logged_in("root")
            self.open_list()
            self.add("anna", "official")
            self.press_in("jones", "lock")
            self.wait_for_account("jones", "locked")
            self.browser.execute_script("document.activeElement.blur()")
            self.photograph("accounts")

        def assign(self, hazard, team, due):
            self.start_work(hazard, "assign")
            self.write("#work-team", team)
            self.browser.execute_script("document.getElementById('work-due').value = arguments[0]", due)
            self.save_work()

    result = unittest.TextTestRunner(stream=sys.stderr).run(unittest.defaultTestLoader.loadTestsFromTestCase(Pictures))
    return result.wasSuccessful()
