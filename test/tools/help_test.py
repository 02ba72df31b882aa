#!/usr/bin/python3
"""Asking ./livemap for help starts no build and installs nothing, in a tree where nothing was ever built."""

import os
import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
OF_SCRIPTS = ("setup", "demo", "test", "bench", "bench vo", "bench life", "evaluate", "evaluate drive", "bag", "broker",
              "zone", "zone init", "zone enroll", "zone revoke", "zone install", "vehicle", "vehicle check", "vehicle install",
              "privacy-models")
OF_PROGRAMS = ("simulate", "region", "evaluate vo", "evaluate detection", "bag from-tum")


class HelpTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="livemap_help_")
        self.addCleanup(self.folder.cleanup)
        self.tree = pathlib.Path(self.folder.name)
        (self.tree / "livemap").write_bytes((ROOT / "livemap").read_bytes())
        (self.tree / "livemap").chmod(0o755)
        for name in ("launch", "scripts", "test"):
            (self.tree / name).symlink_to(ROOT / name)

    def ask(self, command):
        # What would install or build is found first, and leaves a trace.
        tools = self.tree / "tools"
        tools.mkdir(exist_ok=True)
        for name in ("apt-get", "colcon", "sudo"):
            (tools / name).write_text(f"#!/bin/sh\ntouch '{self.tree}/{name}_was_called'\nexit 1\n")
            (tools / name).chmod(0o755)
        environment = {**os.environ, "PATH": f"{tools}:/usr/bin:/bin"}
        return subprocess.run([str(self.tree / "livemap"), *command.split(), "--help"], env=environment,
                              capture_output=True, text=True, timeout=120)

    def assert_nothing_was_made(self, command):
        left = sorted(path.name for path in self.tree.iterdir())
        self.assertEqual(left, ["launch", "livemap", "scripts", "test", "tools"], command)

    def test_a_question_is_answered_without_a_build(self):
        for command in OF_SCRIPTS:
            answer = self.ask(command)
            self.assertEqual(answer.returncode, 0, f"{command}: {answer.stderr}")
            self.assertIn("usage: ", answer.stdout, command)
            self.assert_nothing_was_made(command)

    def test_the_help_of_a_program_that_is_not_built_says_so(self):
        for command in OF_PROGRAMS:
            answer = self.ask(command)
            self.assertEqual(answer.returncode, 2, command)
            self.assertIn("which is not built yet: ./livemap setup --dev builds every program", answer.stderr)
            self.assert_nothing_was_made(command)

    def test_every_argument_of_a_launch_file_is_listed_with_its_default(self):
        shown = self.ask("zone").stdout
        self.assertIn("  web_port (default 8080): Port of the live map", shown)
        self.assertIn("  identity (default empty): ", shown)


if __name__ == "__main__":
    unittest.main()
