#!/usr/bin/python3
"""Officials at work in real Chromium: states, confirming, rejecting, the history of a hazard.

  map_page_officials_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import sys

from map_page_fixture import (
    HOSTILE, LAT, LON, Keys, MapPage, run_tests, start_browser, stop_browser, street, webdriver)


class OfficialsPage(MapPage):
    """What the tests of decisions share."""

    def text(self, selector):
        return self.find(selector).text

    def mouse(self):
        return webdriver.ActionChains(self.browser)

    def state_in_popup(self, hazard, state):
        self.wait_for_text(f'.popup[data-hazard="{hazard}"] .state', state)

    def pin_state(self, state):
        return self.count(f'.pin[data-state="{state}"]')

    def ask(self, decision):
        self.click(f'.popup [data-focus="{decision}"]')
        self.wait(lambda: self.find("#decision").is_displayed(), "no question is asked")

    def write(self, selector, text):
        self.wait(lambda: self.find(selector).is_displayed(), f"{selector} is not asked for")
        field = self.find(selector)
        field.clear()
        field.send_keys(text)

    def submit(self):
        self.click("#decision-submit")

    def wait_closed(self):
        self.wait(lambda: not self.find("#decision").is_displayed(), "the question stays")

    def reject(self, hazard, reason, token):
        self.open_popup_of(hazard)
        self.ask("reject")
        self.write("#decision-reason", reason)
        self.write("#decision-token", token)
        self.submit()

    def assert_quiet_but(self, *statuses):
        """Chromium logs every answer that is an error: those were meant."""
        loud = [entry["message"] for entry in self.browser.get_log("browser")
                if entry["level"] == "SEVERE" and "WebSocket connection" not in entry["message"]
                and "ERR_CONNECTION_REFUSED" not in entry["message"]
                and not any(f"status of {status}" in entry["message"] for status in statuses)]
        self.assertEqual(loud, [])


class Desktop(OfficialsPage):
    def test_candidates_look_different_and_become_active_before_ones_eyes(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.zone.report("deer", LAT + 0.0006, LON + 0.0006)
        self.open()
        self.wait(lambda: self.pin_state("candidate") == 1 and self.pin_state("active") == 1,
                  "candidate and active look the same")
        self.assertIn("Unconfirmed", self.text("#hazard-list"))
        self.open_popup_of(hazard)
        self.state_in_popup(hazard, "Unconfirmed")
        self.wait_for_text(".popup", "Still there")
        self.picture("candidate_popup")
        self.zone.report("pothole", LAT, LON, vehicle="car-2")
        self.state_in_popup(hazard, "Active")
        self.wait_for_text(".popup", "2 times", "2 vehicles")
        self.wait(lambda: self.pin_state("candidate") == 0 and self.pin_state("active") == 2,
                  "the marker stays hollow")
        self.wait(lambda: "Unconfirmed" not in self.text("#hazard-list"), "the list lags behind")
        self.assert_quiet()

    def test_states_can_be_hidden_and_are_counted(self):
        self.zone.report("pothole", LAT, LON)
        deer = self.zone.report("deer", LAT + 0.001, LON)
        self.open()
        self.wait_for(".pin", 2)
        self.assertEqual(self.text("#states li:has([data-state=candidate]) .count"), "1")
        self.click('#states input[data-state="candidate"]')
        self.wait(lambda: self.count(".pin") == 1, "candidates are still shown")
        self.assertEqual(self.count("#hazard-list button"), 1)
        late = self.zone.report("debris", LAT + 0.002, LON)
        self.wait(lambda: self.text("#states li:has([data-state=candidate]) .count") == "2",
                  "a hidden state is not counted")
        self.assertEqual(self.count(".pin"), 1)
        self.zone.do("confirm", id=late)
        self.wait_for(f'#hazard-list button[data-hazard="{late}"]')
        self.click('#states input[data-state="active"]')
        self.wait(lambda: self.count(".pin") == 0, "active ones are still shown")
        self.click('#states input[data-state="active"]')
        self.wait_for(f'#hazard-list button[data-hazard="{deer}"]')
        self.assert_quiet()

    def test_rejecting_in_one_browser_takes_the_hazard_away_in_another(self):
        hazard = self.zone.report("pothole", LAT, LON)
        kept = self.zone.report("debris", LAT + 0.002, LON)
        other = start_browser(800, 600)
        self.addCleanup(stop_browser, other)
        other.get(self.zone.url)
        self.open()
        self.open_popup_of(hazard)
        self.ask("reject")
        self.wait_for_text("#decision-label", "Pothole", "40.44330", "last seen")
        self.picture("reject")
        self.write("#decision-reason", "filled yesterday")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait_closed()
        self.wait(lambda: self.count("#hazard-list button") == 1, "it stays in this browser")
        rows = "return [...document.querySelectorAll('#hazard-list button')]" \
               ".map((row) => row.dataset.hazard).join()"
        self.wait(lambda: other.execute_script(rows) == kept, "it stays in the other browser")
        self.wait(lambda: "Rejected: Pothole" in
                  self.find("#announcer").get_attribute("textContent"), "nothing is announced")
        self.assert_quiet()

    def test_the_token_is_asked_for_once_and_forgotten_with_the_tab(self):
        first = self.zone.report("pothole", LAT, LON)
        second = self.zone.report("debris", LAT + 0.002, LON)
        self.open()
        self.open_popup_of(first)
        self.ask("confirm")
        self.write("#decision-reason", "I was there")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait_closed()
        self.state_in_popup(first, "Active")
        self.click(".popup summary")
        self.wait_for_text(".history-list", "confirmed by miller: I was there")
        self.open_popup_of(second)
        self.ask("confirm")
        self.assertFalse(self.find("#decision-token").is_displayed())
        self.submit()
        self.wait_closed()
        self.state_in_popup(second, "Active")
        self.assertEqual(self.browser.execute_script("return localStorage.length"), 0)
        self.assertEqual(self.browser.execute_script("return document.cookie"), "")
        self.browser.execute_script("sessionStorage.clear()")
        self.ask("reject")
        self.assertTrue(self.find("#decision-token").is_displayed())
        self.assert_quiet()

    def test_a_button_that_is_pressed_while_news_of_the_hazard_comes_is_clicked(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.mouse().move_to_element(self.find('.popup [data-focus="reject"]')).click_and_hold().perform()
        self.zone.report("pothole", LAT, LON, vehicle="car-2")
        self.wait_for_text(".popup", "2 times", "Active")
        self.mouse().release().perform()
        self.wait(lambda: self.find("#decision").is_displayed(), "the click is lost")
        self.assert_quiet()

    def test_news_of_a_hazard_leaves_its_open_history_where_one_has_scrolled_to(self):
        hazard = self.zone.report("pothole", LAT, LON)
        for number in range(12):
            self.zone.do("confirm", id=hazard)
            self.zone.report("pothole", LAT, LON, vehicle=f"car-{number}")
        self.open()
        self.open_popup_of(hazard)
        self.click(".popup summary")
        self.wait_for(".history-list li", 10)
        self.browser.execute_script("document.querySelector('.history-list').scrollTop = 70")
        lines = self.count(".history-list li")
        self.zone.report("pothole", LAT, LON, vehicle="car-20")
        self.wait_for(".history-list li", lines + 1)
        self.assertEqual(self.browser.execute_script("return document.querySelector('.history-list').scrollTop"), 70)
        self.assert_quiet()

    def test_a_popup_that_another_one_replaces_takes_no_click_any_more(self):
        first = self.zone.report("pothole", LAT, LON)
        second = self.zone.report("debris", LAT + 0.002, LON)
        self.open()
        self.open_popup_of(first)
        popups = self.browser.execute_async_script("""
            const [second, done] = arguments;
            const pane = document.querySelector('.leaflet-popup-pane');
            new MutationObserver((_, observer) => {
              const ids = [...pane.querySelectorAll('.popup')].map((popup) => popup.dataset.hazard);
              if (!ids.includes(second)) return;
              observer.disconnect();
              done(ids);
            }).observe(pane, { childList: true, subtree: true });
            document.querySelector(`#hazard-list button[data-hazard="${second}"]`).click();""", second)
        self.assertEqual(popups, [second])
        self.assert_quiet()

    def test_what_was_sent_is_said_also_to_who_closes_the_question_before_the_answer(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.ask("confirm")
        self.write("#decision-token", self.zone.token)
        # The network is slow: the request goes when the test says so.
        self.browser.execute_script("""
            const real = window.fetch;
            window.fetch = async (address, options) => {
              if (options?.method === 'POST') await new Promise((go) => { window.sendNow = go; });
              return real(address, options);
            };""")
        self.submit()
        self.wait(lambda: self.browser.execute_script("return window.sendNow !== undefined"), "nothing is sent")
        self.press(Keys.ESCAPE)
        self.wait_closed()
        self.browser.execute_script("window.sendNow()")
        self.wait_for_text("#notice", "Confirmed: Pothole")
        self.assert_quiet()

    def test_officials_look_at_what_was_rejected_and_put_it_back(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.zone.report("debris", LAT + 0.002, LON)
        self.open()
        self.reject(hazard, "a shadow", self.zone.token)
        self.wait_closed()
        self.wait(lambda: self.count("#hazard-list button") == 1, "the hazard stays")
        self.click('#states input[data-state="rejected"]')
        self.wait(lambda: self.pin_state("rejected") == 1, "what was rejected is not shown")
        self.assertEqual(self.text("#states li:has([data-state=rejected]) .count"), "1")
        self.open_popup_of(hazard)
        self.state_in_popup(hazard, "Rejected")
        self.assertEqual(self.count('.popup [data-focus="reject"]'), 0)
        self.click(".popup summary")
        self.wait_for_text(".history-list", "rejected by miller: a shadow")
        self.picture("rejected")
        self.ask("confirm")
        self.wait_for_text("#decision-title", "Put this hazard back?")
        self.write("#decision-reason", "no shadow after all")
        self.submit()
        self.wait_closed()
        self.state_in_popup(hazard, "Active")
        self.wait_for_text(".history-list", "confirmed by miller: no shadow after all")
        self.wait(lambda: self.text("#states li:has([data-state=rejected]) .count") == "0",
                  "it counts as rejected")
        self.assert_quiet()

    def test_what_is_rejected_meanwhile_joins_those_that_are_shown_and_goes_with_the_box(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.click('#states input[data-state="rejected"]')
        self.reject(hazard, "a shadow", self.zone.token)
        self.wait_closed()
        self.wait(lambda: self.pin_state("rejected") == 1, "it is not shown as rejected")
        self.assertEqual(self.count("#hazard-list button"), 1)
        self.click('#states input[data-state="rejected"]')
        self.wait(lambda: self.count(".pin") == 0 and self.count("#hazard-list button") == 0,
                  "it stays")
        self.assert_quiet()

    def test_a_vehicle_is_distrusted_in_its_popup_and_its_words_are_taken_back(self):
        shared = self.zone.report("pothole", LAT, LON)
        self.zone.report("pothole", LAT, LON, vehicle="car-2")
        self.zone.report("debris", LAT + 0.002, LON, vehicle="car-2")
        self.zone.drive([(LAT, LON), (LAT + 0.0005, LON)], vehicle="car-2")
        self.open()
        self.wait(lambda: self.pin_state("active") == 1 and self.count("#hazard-list button") == 2,
                  "the hazards are not there")
        self.click("#vehicles button")
        self.wait_for_text(".vehicle-popup", "car-2")
        self.picture("vehicle_popup")
        self.ask("distrust")
        self.wait_for_text("#decision-label", "car-2")
        self.submit()
        self.wait_for_text("#decision-error", "Please say why")
        self.write("#decision-reason", "its key was stolen")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait_for_text("#decision-preview", "2 hazards", "1 of them vanishes")
        self.picture("distrust")
        self.assertEqual(self.count("#hazard-list button"), 2, "it was done without being shown first")
        self.submit()
        self.wait_closed()
        self.wait(lambda: self.count("#hazard-list button") == 1 and
                  self.pin_state("candidate") == 1, "its words still count")
        self.wait_for_text("#notice", "Distrusted: car-2, 2 hazards changed")
        self.picture("distrusted")
        self.open_popup_of(shared)
        self.state_in_popup(shared, "Unconfirmed")
        self.wait_for_text(".popup", "1 vehicle")
        self.click(".popup summary")
        self.wait_for_text(".history-list", "words of car-2 withdrawn by miller: its key was stolen")
        self.assert_quiet()

    def test_distrust_is_taken_back_at_once_or_later(self):
        self.zone.report("pothole", LAT, LON)
        self.zone.report("pothole", LAT, LON, vehicle="car-2")
        self.zone.report("debris", LAT + 0.002, LON, vehicle="car-2")
        self.zone.drive([(LAT, LON), (LAT + 0.0005, LON)], vehicle="car-2")
        self.open()
        for take_back in (self.undo_in_notice, self.trust_in_popup):
            self.wait(lambda: self.pin_state("active") == 1 and self.count("#hazard-list button") == 2,
                      "the hazards are not as before")
            if not self.count(".vehicle-popup"):
                self.click("#vehicles button")
            self.ask("distrust")
            self.write("#decision-reason", "its key was stolen")
            if self.find("#decision-token").is_displayed():
                self.write("#decision-token", self.zone.token)
                self.submit()
            self.wait_for_text("#decision-preview", "2 hazards")
            self.submit()
            self.wait_closed()
            self.wait(lambda: self.count("#hazard-list button") == 1, "its words still count")
            take_back()
            self.wait(lambda: "Trusted again: car-2, 2 hazards changed" in self.text("#notice"), "not said")
        self.wait(lambda: self.pin_state("active") == 1 and self.count("#hazard-list button") == 2,
                  "the hazards are not as before")
        self.assert_quiet()

    def undo_in_notice(self):
        self.click("#notice-undo")

    def trust_in_popup(self):
        self.ask("trust")
        self.submit()
        self.wait_closed()

    def test_undo_brings_back_the_state_before_the_mistake(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.reject(hazard, "wrong one", self.zone.token)
        self.wait_closed()
        self.wait(lambda: self.count("#hazard-list button") == 0, "the hazard stays")
        self.wait_for_text("#notice", "Rejected: Pothole")
        self.picture("notice")
        self.click("#notice-undo")
        self.wait(lambda: self.count("#hazard-list button") == 1, "it does not come back")
        self.wait(lambda: "Undone: Pothole" in self.text("#notice"), "not said")
        self.assertFalse(self.find("#notice-undo").is_displayed(), "an undo is offered twice")
        self.open_popup_of(hazard)
        # A candidate before, a candidate again: put back it would be active.
        self.state_in_popup(hazard, "Unconfirmed")
        self.click("#notice-close")
        self.assertFalse(self.find("#notice").is_displayed())
        self.assert_quiet()

    def test_the_notice_does_not_undo_what_another_official_has_decided_since(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.reject(hazard, "wrong one", self.zone.token)
        self.wait_closed()
        self.wait_for_text("#notice", "Rejected: Pothole")
        self.assertTrue(self.zone.do("confirm", id=hazard)["confirmed"])
        self.wait(lambda: self.count("#hazard-list button") == 1, "it does not come back")
        self.click("#notice-undo")
        self.wait_for_text("#notice", "Another decision about the hazard was made since, and nothing is undone.")
        self.open_popup_of(hazard)
        self.state_in_popup(hazard, "Active")

    def test_a_decision_is_undone_later_from_the_popup_and_only_once(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.ask("confirm")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait_closed()
        self.state_in_popup(hazard, "Active")
        self.ask("undo")
        self.submit()
        self.wait_closed()
        self.state_in_popup(hazard, "Unconfirmed")
        # What was undone is undone: once more changes nothing.
        self.ask("undo")
        self.submit()
        self.wait_closed()
        self.state_in_popup(hazard, "Unconfirmed")
        self.assert_quiet()

    def test_confirming_thrice_is_one_line_of_the_history(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        for _ in range(3):
            self.ask("confirm")
            if self.find("#decision-token").is_displayed():
                self.write("#decision-token", self.zone.token)
            self.submit()
            self.wait_closed()
            self.state_in_popup(hazard, "Active")
        self.click(".popup summary")
        self.wait_for_text(".history-list", "confirmed by miller")
        self.assertEqual(self.text(".history-list").count("confirmed by miller"), 1)
        self.assert_quiet()

    def test_the_speed_of_a_vehicle_that_is_silent_is_not_shown(self):
        self.zone.drive([(LAT, LON), (LAT + 0.0005, LON)], vehicle="car-2")
        self.open()
        self.click("#vehicles button")
        self.wait_for_text("#vehicles", "km/h")
        self.wait_for_text(".vehicle-popup", "km/h")
        self.browser.execute_script("const now = Date.now; Date.now = () => now() + 60000")
        self.wait(lambda: "km/h" not in self.text("#vehicles") and
                  "km/h" not in self.text(".vehicle-popup"), "an old speed is shown as if it held")
        self.assertIn("1 min. ago", self.text("#vehicles"))
        self.assertEqual(self.count(".vehicle.silent"), 1)
        self.assert_quiet()

    def test_a_wrong_token_says_so_and_can_be_mended(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.reject(hazard, "filled", "no-official-has-this-token")
        self.wait_for_text("#decision-error", "This token is not known here")
        self.assertEqual(self.browser.execute_script("return sessionStorage.length"), 0)
        self.assertEqual(self.browser.execute_script("return document.activeElement.id"),
                         "decision-token")
        self.picture("wrong_token")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait(lambda: self.count(".pin") == 0, "the hazard stays")
        self.assert_quiet_but(401)

    def test_a_reason_is_needed_and_a_decision_can_be_called_off(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.ask("reject")
        self.submit()
        self.wait_for_text("#decision-error", "Please say why")
        self.click("#decision-cancel")
        self.wait_closed()
        self.assertEqual(self.count(f'.popup[data-hazard="{hazard}"]'), 1)
        self.assertEqual(self.count(".pin"), 1)
        self.assert_quiet()

    def test_a_zone_that_does_not_answer_is_said_so(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.ask("confirm")
        self.zone.do("stop")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait_for_text("#decision-error", "The zone does not answer")
        self.zone.do("start")
        self.submit()
        self.wait_closed()
        self.state_in_popup(hazard, "Active")

    def test_a_hazard_that_was_rejected_meanwhile_is_said_so(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.ask("reject")
        self.zone.do("remove", id=hazard)
        self.write("#decision-reason", "filled")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait_for_text("#decision-error", "This hazard is no longer on the map")
        self.assert_quiet_but(409)

    def test_a_hazard_that_changed_under_the_question_is_left_and_what_changed_is_said(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.ask("reject")
        self.zone.report("pothole", LAT, LON, vehicle="car-2")
        self.write("#decision-reason", "nothing there")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait_for_text("#decision-error", "it was candidate and is active now")
        self.click("#decision-cancel")
        self.wait_closed()
        self.state_in_popup(hazard, "Active")
        self.ask("reject")
        self.write("#decision-reason", "nothing there")
        self.write("#decision-token", self.zone.token)
        self.submit()
        self.wait_closed()
        self.wait(lambda: self.count("#hazard-list button") == 0, "the second look decides nothing")
        self.assert_quiet_but(409)

    def test_everything_is_decided_by_keyboard(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.wait_for("#hazard-list button")
        self.browser.execute_script("document.querySelector('#hazard-list button').focus()")
        self.press(Keys.ENTER)
        self.wait(lambda: self.browser.execute_script(
            "return document.activeElement.matches(`.popup[data-hazard='${arguments[0]}']`)", hazard),
            "the popup has no focus")
        for _ in range(10):
            self.press(Keys.TAB)
            if self.browser.execute_script(
                    "return document.activeElement.dataset.focus") == "reject":
                break
        self.press(Keys.ENTER)
        self.wait(lambda: self.browser.execute_script(
            "return document.activeElement.id") == "decision-reason", "the reason has no focus")
        self.press(Keys.ESCAPE)
        self.wait_closed()
        self.assertEqual(self.count(".popup"), 1, "Escape closed the popup too")
        self.wait(lambda: self.browser.execute_script(
            "return document.activeElement.dataset.focus") == "reject", "the focus is lost")
        self.press(Keys.ENTER)
        self.wait(lambda: self.find("#decision").is_displayed(), "no question is asked")
        self.press("filled", Keys.TAB, self.zone.token, Keys.ENTER)
        self.wait(lambda: self.count(".pin") == 0, "the hazard stays")
        self.assert_quiet()

    def test_the_history_tells_what_happened_and_hostile_reasons_stay_text(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.reject(hazard, HOSTILE, self.zone.token)
        self.wait(lambda: self.count(".pin") == 0, "the hazard stays")
        self.assertTrue(self.zone.do("confirm", id=hazard)["confirmed"])
        self.open_popup_of(hazard)
        self.click(".popup summary")
        self.wait_for_text(".history-list", HOSTILE, "Rejected", "miller")
        self.assertEqual(self.count('img[src="x"]'), 0)
        self.assertGreaterEqual(self.count(".history-list li"), 3)
        self.assertEqual(self.browser.execute_script(
            "return document.activeElement.dataset.focus"), "history")
        self.zone.report("pothole", LAT, LON, vehicle="car-3")
        self.wait_for_text(".popup", "2 times")
        self.wait(lambda: self.count(".history-list li") >= 4, "the open history lags behind")
        self.picture("history")
        self.wait(lambda: self.browser.execute_script(
            "return document.querySelector('.leaflet-popup').getBoundingClientRect().top") >= 0,
            "the popup grows out of the window")
        self.assert_quiet()

    def test_without_officials_there_are_no_buttons(self):
        self.zone.do("close_decisions")
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.assertEqual(self.count(".popup .decide"), 0)
        self.assertEqual(self.count(".popup .history"), 1)
        self.assertEqual(self.count('#states input[data-state="rejected"]'), 0)
        self.zone.drive([(LAT, LON), (LAT + 0.0005, LON)])
        self.wait_for("#vehicles button")
        self.click("#vehicles button")
        self.wait_for(".vehicle-popup")
        self.assertEqual(self.count(".vehicle-popup .decide"), 0)


class Phone(OfficialsPage):
    size = (390, 844)

    def test_a_decision_fits_a_phone(self):
        road = street()
        hazard = self.zone.report("pothole", *road[40])
        self.zone.report("traffic_cone", *road[60])
        self.zone.report("deer", *road[80])
        self.zone.report("W" * 64, *road[100])
        self.open()
        self.zoom_until_pins(4)
        self.picture("phone_states")
        self.open_sheet()
        self.picture("phone_states_list")
        self.open_popup_of(hazard)
        self.click(".popup summary")
        self.wait_for(".history-list li")
        self.picture("phone_history")
        self.assert_inside(".leaflet-popup", 52)
        self.ask("reject")
        self.wait_for("#decision-token")
        self.picture("phone_reject")
        self.assert_inside("#decision", 0)
        self.assertGreaterEqual(self.find("#decision-submit").size["height"], 40)
        self.assert_quiet()

    def assert_inside(self, selector, top):
        def box():
            return self.browser.execute_script(
                "const r = document.querySelector(arguments[0]).getBoundingClientRect();"
                "return [r.left, r.top, r.right, r.bottom]", selector)

        def is_inside():
            # The map pans when a popup grows.
            left, upper, right, lower = box()
            return left >= 0 and upper >= top and right <= 390 and lower <= 844
        self.wait(is_inside, f"{selector} at {box()} is not within 390 x 844 below {top}")


class DesktopDark(OfficialsPage):
    dark = True

    def test_decisions_follow_the_dark_scheme(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.zone.report("debris", LAT + 0.0003, LON + 0.0008)
        self.open()
        self.open_popup_of(hazard)
        self.picture("dark_candidate")
        self.ask("reject")
        self.picture("dark_reject")
        self.assertEqual(self.browser.execute_script(
            "return getComputedStyle(document.querySelector('#decision')).backgroundColor"),
            "rgb(23, 28, 35)")
        self.assert_quiet()


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
