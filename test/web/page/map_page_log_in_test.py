#!/usr/bin/python3
"""Logging in and out in real Chromium, and what is seen with and without.

  map_page_log_in_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import sys

from map_page_fixture import HOSTILE, LAT, LON, Keys, run_tests, start_browser, stop_browser, street
from map_page_officials_test import OfficialsPage


class LogIn(OfficialsPage):
    def log_in(self, name, password=None):
        self.wait(lambda: self.find("#session").is_displayed(), "nobody can log in")
        if not self.find("#log-in").is_displayed():
            self.click("#session")
        self.write("#log-in-name", name)
        self.write("#log-in-password", password or self.password)
        self.find("#log-in-password").send_keys(Keys.ENTER)

    def wait_logged_in(self, name):
        self.wait_for_text("#session", f"Log out {name}")
        self.wait_state("live")

    def test_an_official_logs_in_rejects_and_takes_it_back(self):
        self.open_accounts()
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        other = start_browser(800, 600)
        self.addCleanup(stop_browser, other)
        other.get(self.zone.url)
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.picture("logged_in")
        self.open_popup_of(hazard)
        self.ask("reject")
        self.assertFalse(self.find("#decision-token-row").is_displayed(), "a token is asked for, too")
        self.write("#decision-reason", "filled yesterday")
        self.submit()
        self.wait_closed()
        rows = "return document.querySelectorAll('#hazard-list button').length"
        self.wait(lambda: other.execute_script(rows) == 0, "it stays in the logged-out browser")
        self.click("#notice-undo")
        self.wait(lambda: other.execute_script(rows) == 1, "it does not come back")
        self.assert_quiet()

    def test_the_queue_is_walked_by_keyboard(self):
        self.open_accounts()
        hazards = [self.zone.report("pothole", LAT + 0.001 * i, LON) for i in range(3)]
        self.open()
        self.assertFalse(self.find("#review-open").is_displayed(), "strangers review")
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.wait_for("#hazard-list button", 3)
        self.find("#review-open").send_keys(Keys.ENTER)
        self.wait_for_text("#review-place", "1 of 3")
        self.wait(lambda: self.browser.execute_script(
            "return document.querySelector('#review-picture img')?.naturalWidth > 0"), "no picture")
        self.picture("review")
        self.press("n")
        self.wait_for_text("#review-place", "2 of 3")
        self.press("r")
        self.wait_for_text("#review-place", "3 of 3")
        self.wait(lambda: self.count("#hazard-list button") == 2, "the second is not rejected")
        self.press("u")
        self.wait_for_text("#review-place", "2 of 3")
        self.wait(lambda: self.count("#hazard-list button") == 3, "the second does not come back")
        self.press("c")
        self.wait_for_text("#review-place", "3 of 3")
        self.press("c")
        self.wait_for_text("#review-subject", "That was the last one.")
        self.press(Keys.ESCAPE)
        self.wait(lambda: not self.find("#review").is_displayed(), "the queue stays")
        self.wait(lambda: self.pin_state("active") == 2 and self.pin_state("candidate") == 1,
                  "two were confirmed")
        self.assertEqual(len(hazards), 3)
        self.assert_quiet()

    def test_the_queue_shows_the_pictures_of_all_reports_side_by_side(self):
        self.open_accounts()
        for label in ("first sight", "second sight", "third sight"):
            self.zone.report("pothole", LAT, LON, label=label)
        self.zone.report("debris", LAT + 0.002, LON, picture=False)
        self.open()
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.wait_for("#hazard-list button", 2)
        self.click("#review-open")
        for at in ("1 of 2", "2 of 2"):
            self.wait_for_text("#review-place", at)
            if "Pothole" not in self.text("#review-subject"):
                self.assertEqual(self.count("#review-others a"), 0, "pictures of another hazard stay")
                self.press("n")
                continue
            self.wait(lambda: self.browser.execute_script("""
                const all = [...document.querySelectorAll('#review-picture img, #review-others img')];
                return all.length === 3 && all.every((one) => one.naturalWidth > 0)
                  && new Set(all.map((one) => one.src)).size === 3;"""), "not all three pictures are there")
            main, other = (self.browser.execute_script(
                "return document.querySelector(arguments[0]).getBoundingClientRect().toJSON()", one)
                for one in ("#review-picture", "#review-others a"))
            self.assertGreaterEqual(other["left"], main["right"], "they are not side by side")
            self.picture("review_side_by_side")
            self.press("n")
        self.assert_quiet()

    def test_letters_in_the_reason_decide_nothing(self):
        self.open_accounts()
        self.zone.report("pothole", LAT, LON)
        self.open()
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.click("#review-open")
        self.wait_for_text("#review-place", "1 of 1")
        self.write("#review-reason", "concrete run")
        self.assertIn("1 of 1", self.text("#review-place"))
        self.write("#review-reason", "")
        self.find("#review-reason").send_keys(Keys.ENTER)
        self.wait_for_text("#review-error", "say why")
        self.write("#review-reason", "a shadow")
        self.find("#review-reason").send_keys(Keys.ENTER)
        self.wait_for_text("#review-subject", "That was the last one.")
        self.wait(lambda: self.count("#hazard-list button") == 0, "it is not rejected")
        self.assert_quiet()

    def test_the_audit_trail_says_who_decided_and_takes_it_back(self):
        self.open_accounts()
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.assertFalse(self.find("#trail-section").is_displayed(), "strangers see who decided")
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.click("#trail-section summary")
        self.wait_for_text("#trail-note", "Nobody has decided anything yet.")
        self.open_popup_of(hazard)
        self.ask("reject")
        self.write("#decision-reason", HOSTILE)
        self.submit()
        self.wait_closed()
        self.wait_for_text("#trail", "Rejected a hazard", "miller", HOSTILE)
        self.picture("trail")
        self.click("#trail .trail-row button")
        self.wait_for_text("#decision-title", "Take the newest decision back?")
        self.submit()
        self.wait_closed()
        self.wait_for_text("#trail", "Took back a decision about a hazard", "taken back")
        self.wait(lambda: self.count("#hazard-list button") == 1, "the hazard does not come back")
        self.assert_quiet()

    def test_a_wrong_password_is_said_and_may_be_mended(self):
        self.open_accounts()
        self.open()
        self.log_in("miller", "wrong password")
        self.wait_for_text("#log-in-error", "name or the password is wrong")
        self.picture("log_in")
        self.write("#log-in-password", self.password)
        self.click("#log-in-submit")
        self.wait_logged_in("miller")
        self.assert_quiet_but(401)

    def test_vehicles_come_and_go_with_the_log_in(self):
        self.open_accounts()
        self.zone.drive(street(length=10))
        self.open()
        self.assertFalse(self.find("#vehicle-section").is_displayed(), "everybody sees vehicles")
        self.log_in("jones")
        self.wait_logged_in("jones")
        self.wait(lambda: self.find("#vehicle-section").is_displayed(), "a viewer sees no vehicle")
        self.click("#session")
        self.wait_for_text("#session", "Log in")
        self.wait_state("live")
        self.assertFalse(self.find("#vehicle-section").is_displayed(), "the vehicles stay")
        self.assert_quiet()

    def test_a_viewer_has_no_buttons_and_a_stranger_is_asked_to_log_in(self):
        self.open_accounts()
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.click('.popup [data-focus="reject"]')
        self.wait_for_text("#log-in-note", "Log in as an official to decide.")
        self.log_in("jones")
        self.wait_logged_in("jones")
        self.open_popup_of(hazard)
        self.assertEqual(self.count('.popup [data-focus="reject"]'), 0)
        self.assert_quiet()

    def test_who_is_logged_out_elsewhere_decides_no_more(self):
        self.open_accounts()
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.open_popup_of(hazard)
        self.ask("reject")
        self.zone.do("log_out_all")
        self.write("#decision-reason", "filled yesterday")
        self.submit()
        self.wait_for_text("#decision-error", "session has ended")
        self.assertEqual(self.count("#hazard-list button"), 1)
        self.assert_quiet_but(401)

    def test_a_closed_map_shows_nothing_but_the_log_in(self):
        self.open_accounts("nothing")
        self.zone.report("pothole", LAT, LON)
        self.browser.get(self.zone.url)
        self.wait_for_text("#log-in-note", "for those who have an account")
        self.assertEqual(self.count(".pin"), 0)
        self.log_in("jones")
        self.wait_logged_in("jones")
        self.wait_for(".pin", 1)
        self.assert_quiet()

    def test_the_public_sees_what_drivers_are_told(self):
        self.open_accounts("told")
        self.zone.report("pothole", LAT, LON)
        self.zone.report("deer", LAT + 0.001, LON)
        self.open()
        self.wait_for("#hazard-list button", 1)
        self.zone.report("pothole", LAT, LON, vehicle="car-2")
        self.wait_for("#hazard-list button", 2)
        self.assert_quiet()


class Phone(OfficialsPage):
    size = (390, 844)
    log_in, wait_logged_in = LogIn.log_in, LogIn.wait_logged_in

    def test_the_log_in_fits(self):
        self.open_accounts()
        self.zone.report("pothole", LAT, LON)
        self.open()
        self.picture("phone_logged_out")
        self.click("#session")
        self.picture("phone_log_in")
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.picture("phone_logged_in")
        self.open_sheet()
        self.click("#review-open")
        self.wait_for_text("#review-place", "1 of 1")
        self.picture("phone_review")
        self.assert_quiet()


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
