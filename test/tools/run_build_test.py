#!/usr/bin/python3
"""What a build for running alone has: neither tools nor tests, as ./livemap demo makes it from scratch."""

import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
OPENED = "liblivemap_torch_engine.so"


class RunBuild(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="livemap_run_build_")
        cls.addClassCleanup(cls.folder.cleanup)
        subprocess.run(["cmake", "-G", "Ninja", "-S", ROOT, "-B", cls.folder.name, "-DLIVEMAP_TOOLS=OFF",
                        "-DLIVEMAP_DEVELOPMENT=OFF", "-DLIVEMAP_UNITY=ON"], check=True, capture_output=True, text=True)

    def steps(self, target):
        """The commands that build a target."""
        return subprocess.run(["ninja", "-C", self.folder.name, "-t", "commands", target], check=True, capture_output=True,
                              text=True).stdout

    def test_the_library_of_networks_is_built_and_installed_though_nothing_is_linked_with_it(self):
        cache = pathlib.Path(self.folder.name, "CMakeCache.txt").read_text(encoding="utf-8")
        if "TORCH_CPU_LIBRARY-NOTFOUND" in cache:
            self.skipTest("libtorch-dev is not installed")
        for target in ("all", "livemap_run"):
            self.assertTrue(f"-o lib/{OPENED}" in self.steps(target), f"{target} does not build it")
        installs = pathlib.Path(self.folder.name, "cmake_install.cmake").read_text(encoding="utf-8")
        self.assertTrue(OPENED in installs, "it is left out of an installation")

    def test_no_test_is_built(self):
        self.assertFalse("gtest_main" in self.steps("all"))


if __name__ == "__main__":
    unittest.main()
