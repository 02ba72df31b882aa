#!/usr/bin/python3
"""Progress of long work (cmake/progress.bash): a bar on a terminal, else a line per 10 %."""

import os
import pathlib
import pty
import subprocess
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
# What ninja prints of a build of ten sources, half of whose steps compile nothing.
PLAN = "".join(f"[{2 * i + 1}/20] Generating {i}.h\n[{2 * i + 2}/20] Building CXX object {i}.o\n" for i in range(10))


def shell(function, text, stderr=subprocess.PIPE):
    """Standard error of one of the file's functions that reads `text`."""
    return subprocess.run(["bash", "-c", f"set -euo pipefail; source '{ROOT}/cmake/progress.bash'; {function}"],
                          input=text.encode(), stderr=stderr, check=True, timeout=60).stderr


def build(text, plan=PLAN, **kwargs):
    return shell(f"show_build_progress printf '%s' '{plan}'", text, **kwargs)


class ProgressTest(unittest.TestCase):
    def test_a_log_gets_a_line_per_ten_percent(self):
        lines = build(PLAN).decode().splitlines()
        self.assertEqual(lines, [f"livemap: building, {percent} % done" for percent in range(10, 101, 10)])

    def test_a_terminal_gets_a_bar_that_goes_away(self):
        leader, follower = pty.openpty()
        try:
            build(PLAN, stderr=follower)
            shown = os.read(leader, 65536).decode()
        finally:
            os.close(leader)
            os.close(follower)
        self.assertIn("livemap: building [###############               ]  50 %", shown)
        self.assertTrue(shown.endswith("\r\x1b[K"), repr(shown[-20:]))

    def test_what_is_left_of_a_build_counts_not_all_of_it(self):
        rest = "".join(PLAN.splitlines(keepends=True)[-4:])
        lines = build("[0/2] Re-checking globbed directories...\n" + rest, plan=rest).decode().splitlines()
        self.assertEqual(lines, ["livemap: building, 50 % done", "livemap: building, 100 % done"])

    def test_errors_are_shown_and_nothing_else_is(self):
        text = "--- livemap\n[1/2] Generating a.h\nFAILED: b.o\nb.cpp:3:1: error: what is this\nnote: no\n"
        self.assertEqual(build(text).decode().splitlines(), ["FAILED: b.o", "b.cpp:3:1: error: what is this"])

    def test_the_last_line_may_lack_its_end(self):
        self.assertIn("10 % done", build("[2/20] Building CXX object 0.o\n[3/20] Generating").decode())

    def test_packages_are_downloaded_and_then_installed(self):
        text = ("Reading package lists...\ndlstatus:1:50.0000:Retrieving file 1 of 2\n"
                "dlstatus:2:100.0000:Retrieving file 2 of 2\npmstatus:rviz:25.5:Preparing rviz\n"
                "Setting up rviz\npmstatus:dpkg-exec:100.0000:Running dpkg\n")
        self.assertEqual(shell("show_install_progress", text).decode().splitlines(),
                         ["livemap: downloading, 50 % done", "livemap: downloading, 100 % done",
                          "livemap: installing, 20 % done", "livemap: installing, 100 % done"])

    def test_the_time_left_follows_from_the_share(self):
        text = shell("progress_of=building progress_tenths=0; show_share 25 100; show_share 90 90", "").decode()
        self.assertEqual(text.splitlines(), ["livemap: building, 20 % done, about 5 min left",
                                             "livemap: building, 90 % done, less than a minute left"])


if __name__ == "__main__":
    unittest.main()
