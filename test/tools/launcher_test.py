#!/usr/bin/python3
"""Which packages each command of ./livemap installs, and what it says where one is missing or asked for wrongly."""

import os
import pathlib
import shutil
import subprocess
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
OF_RUN, OF_TOOLS, OF_DEVELOPMENT = "libopencv-dev", "libembree-dev", "chromium"


def listed():
    """Packages of each section of apt-packages.txt."""
    sections = {}
    for line in (ROOT / "apt-packages.txt").read_text().splitlines():
        if line.startswith("["):
            section = sections.setdefault(line.strip("[]"), [])
        elif line and not line.startswith("#"):
            section.append(line)
    return sections


class LauncherTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_launcher_")
        self.addCleanup(folder.cleanup)
        self.tree = pathlib.Path(folder.name)
        for name in ("livemap", "apt-packages.txt", "cmake", "launch", "scripts"):
            (self.tree / name).symlink_to(ROOT / name)
        # The launcher finds its folder by its own path, whatever links lead there.
        (self.tree / "livemap").unlink()
        (self.tree / "livemap").write_bytes((ROOT / "livemap").read_bytes())
        (self.tree / "livemap").chmod(0o755)
        self.tools = self.tree / "tools"
        self.tools.mkdir()
        self.stub("dpkg-query", "echo bash installed")
        self.stub("sudo", 'exec "$@"')
        self.stub("apt-get", f"echo \"$*\" >>'{self.tree}/apt'; test $1 = update")

    def stub(self, name, text):
        (self.tools / name).write_text(f"#!/bin/sh\n{text}\n")
        (self.tools / name).chmod(0o755)

    def call(self, *command, before=()):
        environment = {**os.environ, "PATH": f"{self.tools}:/usr/bin:/bin"}
        return subprocess.run([*before, str(self.tree / "livemap"), *command], env=environment, capture_output=True,
                              text=True, timeout=60)

    def wanted_by(self, *command):
        """Packages that a command asks apt-get for; the stub then fails, so that nothing is built."""
        answer = self.call(*command)
        self.assertEqual(answer.returncode, 1, answer.stderr)
        self.assertIn("installing packages failed, the whole log is build/apt.log", answer.stderr)
        lines = (self.tree / "apt").read_text().splitlines()
        (self.tree / "apt").unlink()
        return [word for word in lines[-1].split()[1:] if not word.startswith("-") and "::" not in word]

    def test_what_drives_and_shows_the_map_needs_the_first_section_alone(self):
        run = listed()["run"]
        for command in (["setup"], ["demo", "--headless"], ["broker"], ["zone"], ["vehicle"], ["zone", "init"]):
            self.assertEqual(self.wanted_by(*command), run, command)

    def test_tools_need_the_second_section_too(self):
        expected = listed()["run"] + listed()["tools"]
        for command in (["simulate"], ["evaluate", "vo"], ["bag", "from-tum"], ["demo", "--drive", "x"], ["demo", "--drive=x"]):
            self.assertEqual(self.wanted_by(*command), expected, command)

    def test_development_needs_everything(self):
        for command in (["setup", "--dev"], ["bench"], ["bench", "vo"]):
            self.assertEqual(self.wanted_by(*command), sum(listed().values(), []), command)

    def test_every_package_is_listed_once(self):
        sections = listed()
        self.assertEqual(list(sections), ["run", "tools", "development"])
        packages = sum(sections.values(), [])
        self.assertEqual(sorted(packages), sorted(set(packages)))
        self.assertIn(OF_RUN, sections["run"])
        self.assertIn(OF_TOOLS, sections["tools"])
        self.assertIn(OF_DEVELOPMENT, sections["development"])

    def test_a_stamp_without_the_environment_that_it_promises_is_not_believed(self):
        """As a power loss may leave it: setup said "ready", and everything else "run ./livemap setup first"."""
        self.stub("dpkg-query", f"sed -n 's/^[a-z].*/& installed/p' '{ROOT}/apt-packages.txt'")
        install = self.tree / "install"
        install.mkdir()
        (install / ".livemap-built-run").touch()
        (install / "setup.bash").touch()
        objects = self.tree / "build/colcon/livemap"
        objects.mkdir(parents=True)
        (objects / "torn.o").touch()
        answer = self.call("setup")
        self.assertIn("livemap: building", answer.stderr)
        self.assertFalse((objects / "torn.o").exists())

    def built(self):
        """The tree as a build leaves it, for whoever asks for its stamp."""
        (self.tree / "scripts").unlink()
        (self.tree / "scripts/lib").mkdir(parents=True)
        install = self.tree / "install"
        install.mkdir()
        (install / "setup.bash").write_text("true\n", encoding="utf-8")
        time_of_build = time.time() + 1
        (install / ".livemap-built-run").touch()
        os.utime(install / ".livemap-built-run", (time_of_build, time_of_build))
        return time_of_build

    def test_what_python_keeps_of_a_script_asks_for_no_build(self):
        """A script that root starts leaves it in the clone: a service, which may not write there, started no more."""
        self.stub("dpkg-query", f"sed -n 's/^[a-z].*/& installed/p' '{ROOT}/apt-packages.txt'")
        after = self.built() + 1
        folder = self.tree / "scripts/lib"
        (folder / "__pycache__").mkdir()
        for path in (folder / "__pycache__", folder):
            os.utime(path, (after, after))
        self.assertNotIn("building", self.call("setup").stderr)
        (folder / "new.py").touch()
        os.utime(folder / "new.py", (after, after))
        self.assertIn("livemap: building", self.call("setup").stderr)

    @unittest.skipIf(os.geteuid() == 0 and not shutil.which("setpriv"), "root may write everywhere")
    def test_who_may_not_build_is_told_who_can(self):
        self.stub("dpkg-query", f"sed -n 's/^[a-z].*/& installed/p' '{ROOT}/apt-packages.txt'")
        (self.tree / "build").mkdir()
        (self.tree / "build").chmod(0o555)
        self.tree.chmod(0o755)
        as_other = ["setpriv", "--reuid", "65534", "--clear-groups"] if os.geteuid() == 0 else []
        answer = self.call("setup", before=as_other)
        self.assertEqual(answer.returncode, 2, answer.stderr)
        self.assertRegex(answer.stderr, r"^livemap: what is in .* is not built, .* may not write there: sudo .*/livemap setup builds it\n$")

    def test_a_wrong_argument_of_setup_is_refused_with_what_is_accepted(self):
        for arguments in (["--development"], ["--dev", "now"]):
            answer = self.call("setup", *arguments)
            self.assertEqual(answer.returncode, 2)
            self.assertEqual(answer.stderr, f"livemap: setup takes --dev or nothing, '{arguments[-1]}' was given\n")


if __name__ == "__main__":
    unittest.main()
