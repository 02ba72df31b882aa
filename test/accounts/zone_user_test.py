#!/usr/bin/python3
"""livemap zone user as people type it: at a terminal and in a pipe.

  zone_user_test.py PATH_OF_livemap_zone_user
"""

import os
import pathlib
import pty
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop(1)
PASSWORD = "correct horse battery"


class ZoneUser(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_zone_user_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name, "zone")
        self.folder.mkdir()

    def run_it(self, *words, password=PASSWORD + "\n"):
        return subprocess.run([PROGRAM, *words, "--directory", str(self.folder)], input=password, text=True,
                              capture_output=True, timeout=60, check=False)

    def assert_done(self, result):
        self.assertEqual((result.returncode, result.stderr), (0, ""))

    def assert_refused(self, result, *words):
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_people_are_added_listed_changed_and_removed(self):
        self.assert_done(self.run_it("add", "miller", "--role", "official"))
        self.assert_done(self.run_it("add", "jones", "--role", "viewer"))
        self.assert_done(self.run_it("role", "jones", "--role", "admin"))
        self.assert_done(self.run_it("passwd", "jones", password="another good password\n"))
        self.assertEqual(self.run_it("list").stdout, "jones\tadmin\tnever logged in\nmiller\tofficial\tnever logged in\n")
        self.assert_done(self.run_it("remove", "miller"))
        self.assertNotIn("miller", self.run_it("list").stdout)

    def test_an_account_is_locked_and_unlocked(self):
        self.assert_done(self.run_it("add", "miller", "--role", "official"))
        self.assert_done(self.run_it("lock", "miller"))
        self.assertEqual(self.run_it("list").stdout, "miller\tofficial\tnever logged in\tlocked\n")
        self.assert_done(self.run_it("unlock", "miller"))
        self.assertNotIn("locked", self.run_it("list").stdout)
        self.assert_refused(self.run_it("lock", "jones"), "no account 'jones'")

    def test_mistakes_are_refused_by_one_sentence(self):
        self.assert_done(self.run_it("add", "miller", "--role", "official"))
        self.assert_refused(self.run_it("add", "miller", "--role", "viewer"), "already")
        self.assert_refused(self.run_it("add", "jones"), "viewer, official and admin")
        self.assert_refused(self.run_it("add", "jones", "--role", "king"), "'king'")
        self.assert_refused(self.run_it("add", "jones", "--role", "viewer", password="short\n"), "12 to 256")
        self.assert_refused(self.run_it("add", "jones", "--role", "viewer", password=""), "12 to 256")
        self.assert_refused(self.run_it("remove", "jones"), "no account 'jones'")
        self.assert_refused(self.run_it("dance"), "'dance'", "accepted are add")
        self.assert_refused(self.run_it("list", "jones"), "no name")
        self.assert_refused(self.run_it("list", "--rule", "x"), "--rule")

    def test_a_mistyped_folder_is_no_zone_without_accounts(self):
        self.folder.rmdir()
        self.assert_refused(self.run_it("list"), "no folder", str(self.folder))
        self.assert_refused(self.run_it("add", "miller", "--role", "viewer"), "no folder")
        self.assertFalse(self.folder.exists())

    def test_no_accounts_are_said_to_be_none(self):
        result = self.run_it("list")
        self.assertEqual((result.returncode, result.stdout), (0, ""))
        self.assertIn("no accounts", result.stderr)

    def test_a_terminal_is_asked_twice_and_shows_no_password(self):
        leader, follower = pty.openpty()
        self.addCleanup(os.close, leader)
        with subprocess.Popen([PROGRAM, "add", "miller", "--role", "viewer", "--directory", str(self.folder)],
                              stdin=follower, stdout=follower, stderr=follower) as process:
            os.close(follower)
            shown = b""
            for question in (b"Password: ", b"Again: "):
                while question not in shown:
                    shown += os.read(leader, 1024)
                os.write(leader, PASSWORD.encode() + b"\n")
            self.assertEqual(process.wait(timeout=60), 0)
            self.assertNotIn(PASSWORD.encode(), shown)
        self.assertIn("miller\tviewer", self.run_it("list").stdout)


if __name__ == "__main__":
    unittest.main()
