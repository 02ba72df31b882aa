#!/usr/bin/python3
"""livemap vehicle install and zone install write units that systemd takes, or nothing."""

import contextlib
import getpass
import importlib.machinery
import importlib.util
import io
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import types
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


class ServiceTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_service_")
        self.addCleanup(folder.cleanup)
        self.units = pathlib.Path(folder.name)

    def install(self, kind, *arguments):
        return subprocess.run([sys.executable, str(ROOT / "scripts/livemap_service"), kind, str(ROOT), "--units", str(self.units),
                               "--user", getpass.getuser(), *arguments], capture_output=True, text=True, timeout=60)

    def unit(self, kind):
        return (self.units / f"livemap-{kind}.service").read_text(encoding="utf-8")

    def assert_refused(self, done, *words):
        self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, "one sentence")
        for word in words:
            self.assertIn(word, done.stderr)
        self.assertEqual(list(self.units.iterdir()), [])

    def test_both_units_are_taken_by_systemd_start_at_boot_and_come_back(self):
        for kind in ("vehicle", "zone"):
            done = self.install(kind, "zone:=town")
            self.assertEqual(done.returncode, 0, done.stderr)
            unit = self.unit(kind)
            self.assertIn(f'ExecStart="{ROOT}/livemap" "{kind}" "zone:=town"\n', unit)
            for line in ("UMask=0077", "Restart=always", "StartLimitIntervalSec=0", "WantedBy=multi-user.target"):
                self.assertIn(line + "\n", unit)
        checker = shutil.which("systemd-analyze")
        if not checker:
            self.skipTest("no systemd-analyze")
        done = subprocess.run([checker, "verify", *map(str, self.units.glob("*.service"))], capture_output=True, text=True)
        self.assertEqual((done.returncode, "livemap" in done.stderr), (0, False), done.stderr)

    def test_the_brokers_unit_names_its_identity_and_nothing_of_ros(self):
        done = self.install("broker", "--identity", "/var/lib/livemap/identity")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f'ExecStart="{ROOT}/livemap" "broker" "--identity" "/var/lib/livemap/identity"\n', self.unit("broker"))
        self.assertNotIn("ROS_MASTER_URI", self.unit("broker"))
        checker = shutil.which("systemd-analyze")
        if checker:
            done = subprocess.run([checker, "verify", str(self.units / "livemap-broker.service")], capture_output=True, text=True)
            self.assertEqual((done.returncode, "livemap" in done.stderr), (0, False), done.stderr)

    def test_a_broker_without_a_whole_path_of_its_identity_is_refused(self):
        self.assert_refused(self.install("broker"), "--identity", "whole path")
        self.assert_refused(self.install("broker", "--identity", "identity"), "'identity'", "whole path")
        self.assert_refused(self.install("broker", "--identity", "/i", "zone:=town"), "zone:=town")

    def test_values_reach_the_vehicle_as_they_are(self):
        done = self.install("vehicle", 'hazard_reporting:={max_range_m: 15}', 'path:=/data/50% "off" $HOME\\x')
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(r'"hazard_reporting:={max_range_m: 15}" "path:=/data/50%% \"off\" $$HOME\\x"', self.unit("vehicle"))

    def test_what_the_launch_file_does_not_take_is_refused(self):
        self.assert_refused(self.install("vehicle", "camera:=front"), "camera:=front", "vehicle.launch")
        self.assert_refused(self.install("vehicle", "front"), "'front'")
        self.assert_refused(self.install("zone", "directory:=~/zone"), "~/zone", "whole path")
        self.assert_refused(self.install("vehicle", "camera_info_url:=file://~/camera.yaml"), "camera.yaml", "whole path")
        self.assert_refused(self.install("vehicle", "identity:=car-1"), "car-1", "whole path")
        self.assert_refused(self.install("zone", "work_orders:=orders.yaml"), "orders.yaml", "whole path")
        self.assert_refused(self.install("zone", "web_certificate:=fullchain.pem"), "fullchain.pem", "whole path")
        self.assert_refused(self.install("vehicle", "--master-port", "80"), "80", "1024")
        self.assert_refused(self.install("vehicle", "vehicle:=car\n[Service]\nUser=root"), "control character")
        self.assert_refused(self.install("vehicle", "--user", "nobody-of-this-name"), "nobody-of-this-name")

    def test_a_unit_of_somebody_else_is_left_alone(self):
        own = self.units / "livemap-zone.service"
        own.write_text("[Unit]\n", encoding="utf-8")
        for arguments in ([], ["--remove"]):
            done = self.install("zone", *arguments)
            self.assertEqual(done.returncode, 2)
            self.assertIn("is not of this command", done.stderr)
        self.assertEqual(own.read_text(encoding="utf-8"), "[Unit]\n")

    def test_vehicle_and_zone_have_masters_of_their_own(self):
        self.install("vehicle")
        self.install("zone")
        self.assertIn("ROS_MASTER_URI=http://localhost:11311\n", self.unit("vehicle"))
        self.assertIn("ROS_MASTER_URI=http://localhost:11312\n", self.unit("zone"))

    def test_a_service_that_runs_gets_its_new_arguments(self):
        """systemctl enable --now leaves what runs as it is. No test may call systemctl: a stub notes how it is called."""
        loader = importlib.machinery.SourceFileLoader("livemap_service", str(ROOT / "scripts/livemap_service"))
        service = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
        dont_write, sys.dont_write_bytecode = sys.dont_write_bytecode, True
        try:
            loader.exec_module(service)
        finally:
            sys.dont_write_bytecode = dont_write
        called = []
        service.UNITS, service.systemctl = str(self.units), lambda *arguments: called.append(arguments)
        service.os = types.SimpleNamespace(**{**vars(os), "geteuid": lambda: 0})
        with contextlib.redirect_stdout(io.StringIO()):
            status = service.main(["zone", str(ROOT), "--user", getpass.getuser(), "--units", str(self.units)])
        self.assertEqual(status, 0)
        self.assertEqual(called, [("daemon-reload",), ("enable", "livemap-zone.service"), ("restart", "livemap-zone.service")])

    def test_a_unit_is_removed_again(self):
        self.assert_refused(self.install("zone", "--remove"), "livemap-zone.service")
        self.install("zone")
        done = self.install("zone", "--remove")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(list(self.units.iterdir()), [])


if __name__ == "__main__":
    unittest.main()
