#!/usr/bin/python3
"""Work orders in the officials' console, in real Chromium, with a real recipient.

  map_page_orders_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

from map_page_console_test import ConsolePage
from map_page_fixture import HANG_S, HOSTILE, LAT, LON, Keys, run_tests, start_browser, stop_browser

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "scripts" / "lib"))
from listening_port import free_port  # noqa: E402

RECIPIENTS = pathlib.Path(__file__).resolve().parents[2] / "orders" / "order_recipients.py"


class RecipientProcess:
    """A recipient of the tests of orders."""

    def __init__(self, kind, folder):
        self.port = free_port()
        self.process = subprocess.Popen(
            [sys.executable, RECIPIENTS, kind, str(self.port), pathlib.Path(folder) / kind],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.url = f"http://127.0.0.1:{self.port}/" + {"webhook": "hook", "open311": "v2"}[kind]

    def wait_ready(self):
        assert self.process.stdout.readline() == "ready\n", f"the recipient at {self.url} does not start"

    def be(self, mode):
        self.process.stdin.write(mode + "\n")
        self.process.stdin.flush()
        self.process.stdout.readline()

    def close(self):
        self.process.stdin.close()
        self.process.wait(timeout=HANG_S)
        self.process.stdout.close()


class OrdersPage(ConsolePage):
    """A zone that sends potholes to the city's Open311 server and everything to the works office."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_orders_")
        self.addCleanup(folder.cleanup)
        self.office = RecipientProcess("webhook", folder.name)
        self.addCleanup(self.office.close)
        self.city = RecipientProcess("open311", folder.name)
        self.addCleanup(self.city.close)
        # All of them start at once.
        super().setUp()
        self.office.wait_ready()
        self.city.wait_ready()
        self.zone.do("orders", recipients=[
            {"name": "works-office", "kind": "webhook", "url": self.office.url},
            {"name": "city-311", "kind": "open311", "url": self.city.url, "classes": ["pothole"]},
            {"name": "night crew", "kind": "webhook", "url": self.office.url, "classes": ["debris"], "delay_s": 3600}])

    def confirmed(self, class_name, lat=LAT, lon=LON):
        hazard = self.zone.report(class_name, lat, lon)
        self.zone.do("confirm", id=hazard)
        return hazard

    def open_orders(self):
        if self.size[0] < 600 and not self.count("#panel.open"):
            self.open_sheet()
        self.click("#orders-open")
        self.wait(lambda: self.find("#orders").is_displayed(), "no list of work orders opens")

    def choose(self, selector, value):
        self.wait_for(f'{selector} option[value="{value}"]')
        self.browser.execute_script("""
            const select = document.querySelector(arguments[0]);
            select.value = arguments[1];
            select.dispatchEvent(new Event('change'));""", selector, value)

    def wait_for_orders(self, count, *parts):
        self.wait(lambda: self.count("#orders-list > li") == count and all(
            part in self.text("#orders-list") for part in parts),
            f"not {count} orders that say {parts}")


class Orders(OrdersPage):
    def test_orders_of_every_state_are_listed_filtered_and_lead_to_their_hazards(self):
        pothole = self.confirmed("pothole")
        self.confirmed("debris", LAT + 0.001)
        self.open_as("miller")
        self.start_work(pothole, "assign")
        self.write("#work-team", "Roads north")
        self.browser.execute_script("document.getElementById('work-due').value = '2025-12-01'")
        self.save_work()
        self.open_orders()
        self.wait_for_orders(4, "Open at the recipient", "601", "Sent", "Waiting", "To be sent in",
                             "Roads north, overdue since 2025-12-01", "nobody")
        self.look("orders")
        self.choose("#orders-state", "waiting")
        self.wait_for_orders(1, "night crew", "Debris")
        self.choose("#orders-state", "")
        self.choose("#orders-recipient", "city-311")
        self.wait_for_orders(1, "Pothole", "Open at the recipient")
        self.city.be("close 601")
        self.wait_for_orders(1, "Closed", "its recipient")
        self.find("#orders-list .order-hazard").send_keys(Keys.ENTER)
        self.wait_for_text(f'.popup[data-hazard="{pothole}"]', "Being checked")
        self.assert_quiet()

    def test_an_order_that_failed_says_why_and_is_sent_again(self):
        self.office.be("refuse the depot is closed " + HOSTILE)
        deer = self.confirmed("deer")
        self.open_as("miller")
        self.wait_for_text("#orders-open", "1 failed")
        self.open_orders()
        self.wait_for_orders(1, "Failed", "Given up after 1 attempt", "answered 422: the depot is closed " + HOSTILE)
        self.look("orders_failed")
        self.office.be("well")
        self.find('#orders-list [data-focus^="retry"]').send_keys(Keys.ENTER)
        self.wait_for_orders(1, "Sent")
        self.wait(lambda: self.browser.execute_script(
            "return document.activeElement.closest('#orders') !== null"), "the focus has left the list")
        self.press(Keys.ESCAPE)
        self.wait(lambda: not self.find("#orders").is_displayed(), "the list stays")
        self.assertEqual(self.text("#orders-open"), "Work orders")
        self.click("#trail-section summary")
        self.wait_for_text("#trail", "Sent again a work order of a hazard to works-office", "miller")
        self.assertEqual(self.count("#trail-section .trail-row:first-child button"), 0, "it can be taken back")
        self.open_popup_of(deer)
        self.open_history()
        self.wait_for_text(".history-list", "Work order sent again", "miller")
        self.assert_quiet()

    def test_an_order_is_closed_after_a_second_question(self):
        deer = self.confirmed("deer")
        self.open_as("miller")
        self.open_orders()
        self.wait_for_orders(1, "Sent")
        self.click('#orders-list [data-focus^="close"]')
        self.wait_for('#orders-list [data-focus^="done"]')
        self.click('#orders-list [data-focus^="keep"]')
        self.click('#orders-list [data-focus^="close"]')
        self.click('#orders-list [data-focus^="done"]')
        self.wait_for_orders(1, "Closed", "by miller")
        self.click("#orders-close")
        self.open_popup_of(deer)
        self.state_in_popup(deer, "Being checked")
        self.assert_quiet()

    def test_the_popup_shows_team_and_orders(self):
        pothole = self.confirmed("pothole")
        self.open_as("miller")
        self.start_work(pothole, "assign")
        self.write("#work-team", "Roads north")
        self.browser.execute_script("document.getElementById('work-due').value = '2099-12-01'")
        self.save_work()
        self.open_popup_of(pothole)
        self.wait_for_text(".popup", "Roads north, due 2099-12-01", "Open at the recipient", "city-311", "works-office")
        self.look("orders_popup")
        self.assert_quiet()

    def test_nobody_else_is_shown_or_told_of_orders(self):
        pothole = self.confirmed("pothole")
        self.open_as("jones")
        self.assertFalse(self.find("#orders-open").is_displayed(), "a viewer sees work orders")
        self.open_popup_of(pothole)
        self.assertNotIn("Work orders", self.text(".popup"))
        self.assert_quiet()
        for body in ("{}", '{"X-CSRF-Token": "forged"}'):
            answer = self.browser.execute_async_script("""
                const [headers, done] = arguments;
                fetch('api/v1/orders/11111111-2222-4333-8444-555555555555/retry', { method: 'POST', headers })
                  .then(({ status }) => done(status));""", json.loads(body))
            self.assertEqual(answer, 403)

    def test_a_forged_csrf_token_sends_nothing_again(self):
        self.office.be("refuse closed")
        self.confirmed("deer")
        self.open_as("miller")
        self.wait_for_text("#orders-open", "1 failed")
        statuses = self.browser.execute_async_script("""
            const [done] = arguments;
            (async () => {
              const { orders } = await (await fetch('api/v1/orders')).json();
              const post = async (headers) => (await fetch(`api/v1/orders/${orders[0].id}/retry`,
                { method: 'POST', headers })).status;
              done([await post({}), await post({ 'X-CSRF-Token': 'forged' })]);
            })();""")
        self.assertEqual(statuses, [403, 403])

    def test_what_is_done_in_one_browser_is_seen_in_another(self):
        self.office.be("refuse closed")
        self.confirmed("deer")
        self.open_as("miller")
        self.open_orders()
        self.wait_for_orders(1, "Failed")
        other = start_browser(900, 700)
        self.addCleanup(stop_browser, other)
        self.browser, mine = other, self.browser
        self.open()
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.open_orders()
        self.office.be("well")
        self.click('#orders-list [data-focus^="retry"]')
        self.wait_for_orders(1, "Sent")
        self.browser = mine
        self.wait_for_orders(1, "Sent")


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
