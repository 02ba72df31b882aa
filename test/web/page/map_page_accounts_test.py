#!/usr/bin/python3
"""The admins' list of accounts in real Chromium: adding, roles, passwords, locks, sessions, removal.

  map_page_accounts_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import sys

from map_page_console_test import ConsolePage
from map_page_fixture import HOSTILE, Keys, run_tests, start_browser, stop_browser

NEW_PASSWORD = "staple battery horse"


class AccountsPage(ConsolePage):
    """What the tests of accounts share."""

    def open_as(self, name):
        """As somebody who has just shown the password."""
        super().open_as(name)
        status = self.browser.execute_async_script("""
            const [password, done] = arguments;
            (async () => {
              const { csrf_token: token } = await (await fetch('api/v1/session')).json();
              done((await fetch('api/v1/session/confirm', { method: 'POST',
                headers: { 'X-CSRF-Token': token, 'Content-Type': 'application/json' },
                body: JSON.stringify({ password }) })).status);
            })();""", self.password)
        self.assertEqual(status, 200)

    def open_list(self):
        if self.size[0] < 600 and not self.count("#panel.open"):
            self.open_sheet()
        self.click("#accounts-open")
        self.wait_for_account("root", "this is you")

    def row(self, name):
        return f'#accounts-list [data-account="{name}"]'

    def wait_for_account(self, name, *parts):
        self.wait(lambda: (text := self.find(self.row(name)).text) and all(part in text for part in parts),
                  f"{name} is not listed with {parts}")

    def press_in(self, name, button):
        self.click(f'{self.row(name)} [data-focus="{button}"]')

    def fill_passwords(self, password, again=None):
        self.write("#account-password", password)
        self.write("#account-again", password if again is None else again)

    def choose_role(self, role):
        self.browser.execute_script("document.getElementById('account-role').value = arguments[0]", role)

    def save(self):
        self.click("#account-submit")
        self.wait(lambda: not self.find("#account").is_displayed(), "the question stays")

    def add(self, name, role, password=NEW_PASSWORD):
        self.click("#accounts-add")
        self.write("#account-name", name)
        self.choose_role(role)
        self.fill_passwords(password)
        self.save()

    def in_other_browser(self, name, password=None):
        """Logs in as somebody else and comes back; the other browser."""
        other = start_browser(900, 700)
        self.addCleanup(stop_browser, other)
        self.browser, mine = other, self.browser
        try:
            self.open()
            self.log_in(name, password)
            self.wait_logged_in(name)
        finally:
            self.browser = mine
        return other


class Accounts(AccountsPage):
    def test_an_account_is_added_changed_and_removed(self):
        self.open_as("root")
        self.open_list()
        self.wait_for_account("miller", "official", "never", "0")
        self.look("accounts")
        self.click("#accounts-add")
        self.look("accounts_add")
        self.write("#account-name", "anna")
        self.fill_passwords(NEW_PASSWORD, "staple battery mouse")
        self.click("#account-submit")
        self.wait_for_text("#account-error", "The two passwords differ.")
        self.fill_passwords(NEW_PASSWORD)
        self.save()
        self.wait_for_account("anna", "viewer", "never")
        self.press_in("anna", "role")
        self.choose_role("official")
        self.save()
        self.wait_for_account("anna", "official")
        self.press_in("anna", "remove")
        self.wait_for_text("#account", "This cannot be taken back.")
        self.save()
        self.wait(lambda: self.count(self.row("anna")) == 0, "anna is still listed")
        self.click("#accounts-log summary")
        self.wait_for_text("#accounts-trail", "anna: removed", "anna: has another role, official", "anna: added, viewer",
                           "by root from 127.0.0.1")
        self.look("accounts_trail")
        self.assert_quiet()

    def test_a_lock_and_ended_sessions_throw_somebody_out(self):
        self.open_as("root")
        other = self.in_other_browser("miller")
        self.open_list()
        self.wait_for_account("miller", "just now")
        self.press_in("miller", "end")
        self.wait_for_text("#accounts-note", "miller: sessions ended")
        other.get(self.zone.url)
        self.browser, mine = other, self.browser
        self.wait_for_text("#session", "Log in")
        self.browser = mine
        self.press_in("miller", "lock")
        self.wait_for_account("miller", "locked")
        self.look("accounts_locked")
        self.browser = other
        self.log_in("miller")
        self.wait_for_text("#log-in-error", "The name or the password is wrong.")
        self.browser = mine
        self.press_in("miller", "lock")
        self.wait(lambda: "locked" not in self.find(self.row("miller")).text.split(), "the lock stays")
        self.assert_quiet()

    def test_the_own_password_is_asked_for_where_it_was_not_shown_lately(self):
        self.open_as("root")
        self.open_list()
        # A zone that has restarted does not know when it was.
        self.zone.do("stop")
        self.zone.do("start")
        self.press_in("jones", "lock")
        self.wait_for_text("#own-password", "Password of root")
        self.look("accounts_own_password")
        self.write("#own-password-input", "wrong horse battery")
        self.click("#own-password-submit")
        self.wait_for_text("#own-password-error", "The name or the password is wrong.")
        self.press(Keys.ESCAPE)
        self.wait_for_text("#accounts-error", "Enter your own password again.")
        self.press_in("jones", "lock")
        self.wait_for("#own-password-input")
        self.write("#own-password-input", self.password)
        self.click("#own-password-submit")
        self.wait_for_account("jones", "locked")
        self.press_in("jones", "lock")
        self.wait(lambda: "locked" not in self.find(self.row("jones")).text.split(), "it is asked again at once")
        self.assertEqual(self.count("#own-password"), 0, "the question stays in the page")
        self.assert_quiet_but(403, 401)

    def test_a_new_password_holds_at_once(self):
        self.open_as("root")
        self.open_list()
        self.press_in("jones", "password")
        self.fill_passwords(NEW_PASSWORD)
        self.save()
        self.wait_for_text("#accounts-note", "jones: has a new password")
        self.in_other_browser("jones", NEW_PASSWORD)
        self.click("#accounts-log summary")
        self.wait_for_text("#accounts-trail", "jones: logged in", "jones: has a new password")
        self.assert_quiet()

    def test_whoever_sets_the_own_password_logs_in_anew(self):
        self.open_as("root")
        self.open_list()
        own = self.find(self.row("root")).text
        for word in ("Role", "Lock", "Remove"):
            self.assertNotIn(word, own, "the last admin would lock everybody out")
        self.press_in("root", "password")
        self.fill_passwords(NEW_PASSWORD)
        self.click("#account-submit")
        self.wait_for_text("#session", "Log in")
        self.log_in("root", NEW_PASSWORD)
        self.wait_logged_in("root")
        self.assert_quiet()

    def test_what_the_zone_refuses_is_said_where_it_was_asked(self):
        self.open_as("root")
        self.open_list()
        self.click("#accounts-add")
        self.write("#account-name", "miller")
        self.fill_passwords(NEW_PASSWORD)
        self.click("#account-submit")
        self.wait_for_text("#account-error", "There is an account of this name already.")
        self.press(Keys.ESCAPE)
        self.wait(lambda: not self.find("#account").is_displayed(), "Escape does not close it")
        self.assertTrue(self.find("#accounts").is_displayed(), "Escape has closed both")
        self.assert_quiet_but(409)

    def test_a_hostile_name_stays_text_and_is_searched(self):
        self.open_as("root")
        self.open_list()
        self.add(HOSTILE, "viewer")
        self.wait_for_text("#accounts-list", HOSTILE)
        self.assertEqual(self.count("#accounts img"), 0)
        self.write("#accounts-search", "ONERROR")
        self.wait(lambda: self.count("#accounts-list > li") == 1, "the others are still listed")
        self.write("#accounts-search", "nobody")
        self.wait_for_text("#accounts-note", "There is no account of such a name.")
        self.assert_quiet()

    def test_the_list_is_used_by_keyboard_and_the_focus_comes_back(self):
        self.open_as("root")
        self.find("#accounts-open").send_keys(Keys.ENTER)
        self.wait_for_account("miller")
        self.find(f'{self.row("miller")} [data-focus="lock"]').send_keys(Keys.ENTER)
        self.wait_for_account("miller", "locked")
        focus = "return document.activeElement.getAttribute('aria-label')"
        self.wait(lambda: self.browser.execute_script(focus) == "Unlock (miller)", "the focus is lost")
        self.find(f'{self.row("miller")} [data-focus="role"]').send_keys(Keys.ENTER)
        self.wait(lambda: self.find("#account").is_displayed(), "no question is asked")
        self.press(Keys.ESCAPE)
        self.wait(lambda: self.browser.execute_script(focus) == "Role… (miller)", "the focus does not come back")
        self.press(Keys.ESCAPE)
        self.wait(lambda: self.browser.execute_script("return document.activeElement.id") == "accounts-open",
                  "the focus does not come back to the page")
        self.assert_quiet()

    def test_nobody_but_an_admin_is_shown_or_told_of_accounts(self):
        self.open_as("miller")
        self.assertFalse(self.find("#accounts-open").is_displayed(), "an official sees accounts")
        statuses = self.browser.execute_async_script("""
            const [done] = arguments;
            (async () => {
              const { csrf_token: token } = await (await fetch('api/v1/session')).json();
              const post = async (what) => (await fetch(`api/v1/accounts/${what}`, { method: 'POST',
                headers: { 'X-CSRF-Token': token, 'Content-Type': 'application/json' },
                body: JSON.stringify({ name: 'miller', role: 'admin' }) })).status;
              done([(await fetch('api/v1/accounts')).status, await post('role'), await post('add')]);
            })();""")
        self.assertEqual(statuses, [403, 403, 403])


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
