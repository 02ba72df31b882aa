#!/usr/bin/python3
"""The page by HTTPS in real Chromium: the way there, the log-in, the live stream, a new certificate.

  map_page_https_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import os
import subprocess
import sys
import tempfile
import time
import unittest

from map_page_fixture import HANG_S, LAT, LON, ZoneProcess, run_tests, start_browser, stop_browser
from map_page_log_in_test import LogIn

# No address of this machine: only there does a browser insist on HTTPS for Secure cookies.
HOST = "map.example"


def openssl(*arguments, data=None):
    return subprocess.run(["openssl", *arguments], input=data, check=True, capture_output=True).stdout


class Certificate:
    """A pair of files, and the hash of its public key, by which the browser is told to trust it."""

    def __init__(self, folder):
        self.folder = folder
        self.files = os.path.join(folder, "certificate.pem"), os.path.join(folder, "key.pem")
        openssl("genpkey", "-algorithm", "EC", "-pkeyopt", "ec_paramgen_curve:P-256", "-out", self.files[1])
        os.chmod(self.files[1], 0o600)
        self.renew(30)
        public = openssl("pkey", "-in", self.files[1], "-pubout", "-outform", "DER")
        digest = openssl("dgst", "-sha256", "-binary", data=public)
        self.key_hash = openssl("base64", "-A", data=digest).decode()

    def renew(self, days):
        new = self.files[0] + ".new"
        openssl("req", "-x509", "-key", self.files[1], "-days", str(days), "-subj", "/CN=livemap test",
                "-addext", f"subjectAltName=DNS:{HOST}", "-out", new)
        os.rename(new, self.files[0])


class Https(LogIn):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="livemap_https_")
        cls.addClassCleanup(folder.cleanup)
        cls.certificate = Certificate(folder.name)
        cls.browser = start_browser(*cls.size, flags=(
            f"--ignore-certificate-errors-spki-list={cls.certificate.key_hash}",
            f"--host-resolver-rules=MAP {HOST} 127.0.0.1"))
        cls.addClassCleanup(stop_browser, cls.browser)

    def setUp(self):
        self.zone = ZoneProcess("", "", "", *self.certificate.files)
        self.addCleanup(self.zone.close)
        self.zone.url = f"https://{HOST}:{self.zone.port}/"
        self.addCleanup(self.leave, self.zone.url)  # Before the zone goes.
        self.browser.get_log("browser")

    def cookies(self):
        return self.browser.execute_cdp_cmd("Network.getCookies", {"urls": [self.zone.url]})["cookies"]

    def test_who_asks_in_plain_text_comes_to_the_page_by_https(self):
        self.browser.get(f"http://{HOST}:{self.zone.port}/")
        self.wait_state("live")
        self.assertEqual(self.browser.current_url, self.zone.url)
        self.assert_quiet()

    def test_the_live_stream_comes_by_tls(self):
        self.open()
        self.zone.report("pothole", LAT, LON)
        self.wait_for("#hazard-list button", 1)
        self.assert_quiet()

    def test_the_sessions_cookie_is_kept_by_https_alone(self):
        self.open_accounts()
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.log_in("miller")
        self.wait_logged_in("miller")
        [cookie] = self.cookies()
        self.assertTrue(cookie["secure"] and cookie["httpOnly"], cookie)
        self.assertEqual(cookie["sameSite"], "Strict")
        self.open()
        self.wait_logged_in("miller")
        self.open_popup_of(hazard)
        self.ask("reject")
        self.write("#decision-reason", "filled yesterday")
        self.submit()
        self.wait_closed()
        self.assert_quiet()

    def test_a_new_certificate_disturbs_no_page(self):
        self.open()
        self.browser.execute_script("""
            window.states = [];
            new MutationObserver(() => window.states.push(document.getElementById('connection').dataset.state))
              .observe(document.getElementById('connection'), {attributes: true});""")
        self.certificate.renew(60)
        end = time.monotonic() + HANG_S
        while self.zone.do("certificate")["loads"] < 2:
            self.assertLess(time.monotonic(), end, "the new certificate is not taken")
            time.sleep(0.05)
        self.zone.report("pothole", LAT, LON)
        self.wait_for("#hazard-list button", 1)
        self.assertEqual(set(self.browser.execute_script("return window.states")) - {"live"}, set())
        self.assert_quiet()


def load_tests(loader, _tests, _pattern):
    """Its own alone: those that it inherits are another program's."""
    own = [name for name in vars(Https) if name.startswith("test_")]
    return unittest.TestSuite(Https(name) for name in own) if loader else None


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
