#!/usr/bin/python3
"""`livemap zone init`, `enroll` and `revoke`: the files they make, and what they refuse."""

import os
import pathlib
import subprocess
import tempfile
import threading
import unittest

from cryptography import x509
from cryptography.x509.oid import NameOID
from zone_fixture import ROOT, Zone, livemap_zone


def certificate(folder):
    return x509.load_pem_x509_certificate(pathlib.Path(folder, "certificate.pem").read_bytes())


def contents(directory):
    files = [path for path in pathlib.Path(directory).rglob("*") if path.is_file()]
    return {path.relative_to(directory): path.read_bytes() for path in files}


class CommandsTest(unittest.TestCase):
    def setUp(self):
        self.zone = Zone()
        self.addCleanup(self.zone.close)
        self.directory = pathlib.Path(self.zone.directory)

    def assert_refused(self, sentence, *arguments):
        """One sentence on standard error, nothing on standard output, exit code 2."""
        result = livemap_zone(*arguments)
        self.assertEqual((result.returncode, result.stdout), (2, ""), result)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertIn(sentence, result.stderr)

    def revoked_serials(self):
        revoked = x509.load_pem_x509_crl((self.directory / "crl.pem").read_bytes())
        return [entry.serial_number for entry in revoked]

    def test_a_vehicle_gets_one_folder_with_key_certificate_and_authority(self):
        folder = pathlib.Path(self.zone.enroll("car-1"))
        self.assertEqual(sorted(path.name for path in folder.iterdir()), ["ca.pem", "certificate.pem", "key.pem"])
        names = certificate(folder).subject.get_attributes_for_oid(NameOID.COMMON_NAME)
        self.assertEqual([name.value for name in names], ["car-1"])
        self.assertEqual((folder / "ca.pem").read_bytes(), (self.directory / "authority" / "ca.pem").read_bytes())

    def test_everything_made_is_its_owners_alone(self):
        self.zone.enroll("car-1")
        self.zone.enroll("car-2")
        self.zone.revoke("car-2")
        for path in [self.directory, *self.directory.rglob("*")]:
            self.assertEqual(path.stat().st_mode & 0o777, 0o700 if path.is_dir() else 0o600, path)

    def test_no_key_of_the_authority_leaves_its_folder(self):
        self.zone.enroll("car-1")
        secret = (self.directory / "authority" / "key.pem").read_bytes()
        holders = [path for path, data in contents(self.directory).items() if data == secret]
        self.assertEqual(holders, [pathlib.Path("authority/key.pem")])

    def test_init_again_keeps_keys_and_vehicles(self):
        self.zone.enroll("car-1")
        before = contents(self.directory)
        self.zone.succeed("init", self.directory, "--zone", "test", "--port", self.zone.port)
        changed = {str(path) for path, data in contents(self.directory).items() if before.get(path) != data}
        self.assertEqual(changed, {"crl.pem", "register.json"})

    def test_init_with_another_host_renews_the_brokers_certificate_alone(self):
        before = contents(self.directory)
        self.zone.succeed("init", self.directory, "--zone", "test", "--port", self.zone.port,
                          "--host", "zone.example.org")
        changed = {str(path) for path, data in contents(self.directory).items() if before.get(path) != data}
        self.assertEqual(changed, {"broker/certificate.pem", "broker/key.pem", "crl.pem", "register.json"})
        names = certificate(self.directory / "broker").extensions.get_extension_for_class(x509.SubjectAlternativeName)
        self.assertIn("zone.example.org", names.value.get_values_for_type(x509.DNSName))

    def test_an_init_that_was_cut_short_is_completed_by_another(self):
        os.remove(self.directory / "register.json")
        for name in ("acl", "mosquitto.conf", "crl.pem"):
            os.remove(self.directory / name)
        for name in ("broker", "zone"):
            for path in (self.directory / name).iterdir():
                path.unlink()
            (self.directory / name).rmdir()
        (self.directory / "data").rmdir()
        self.zone.succeed("init", self.directory, "--zone", "test", "--port", self.zone.port)
        self.zone.start()
        self.zone.enroll("car-1")
        self.zone.connect("car-1").disconnect()

    def test_a_folder_of_something_else_or_of_another_zone_is_left_alone(self):
        with tempfile.TemporaryDirectory() as other:
            pathlib.Path(other, "letter").write_text("dear zone")
            self.assert_refused("holds other files", "init", other)
            self.assertEqual(os.listdir(other), ["letter"])
        before = contents(self.directory)
        self.assert_refused("belongs to zone 'test', not to 'other'", "init", self.directory, "--zone", "other")
        self.assertEqual(contents(self.directory), before)

    def test_hostile_names_are_refused_and_leave_nothing(self):
        before = contents(self.directory.parent)
        hostile = ["", ".", "..", "../car", "a/b", "a b", "car+1", "#", "+", "%u", "car\n1", "k\u00e4fer", "a" * 65,
                   "CN=x,O=y", "$SYS", "\u202ecar", "zone"]
        for name in hostile:
            for command in ("enroll", "revoke"):
                with self.subTest(name=name, command=command):
                    self.assert_refused("is not accepted", command, name, "--dir", self.directory)
        for flags in (["--zone", "a/b"], ["--host", "a b"], ["--host", "x\ny"], ["--address", "::1\nlog_dest none"],
                      ["--port", "0"], ["--port", "65536"], ["--max-message-bytes", "1"]):
            with self.subTest(flags=flags):
                self.assert_refused("is not accepted", "init", self.directory, *flags)
        self.assertEqual(contents(self.directory.parent), before)

    def test_the_longest_name_is_accepted(self):
        longest = "v" * 64
        self.zone.start()
        self.zone.enroll(longest)
        self.zone.connect(longest).disconnect()

    def test_a_second_enrolling_is_refused_and_changes_nothing(self):
        self.zone.enroll("car-1")
        before = contents(self.directory)
        self.assert_refused("is enrolled already", "enroll", "car-1", "--dir", self.directory)
        self.assertEqual(contents(self.directory), before)

    def test_two_enrollings_at_once_are_both_registered(self):
        threads = [threading.Thread(target=self.zone.enroll, args=(f"car-{i}",)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        serials = {certificate(self.zone.identity(f"car-{i}")).serial_number for i in range(4)}
        for i in range(4):
            self.zone.revoke(f"car-{i}")
        self.assertEqual(set(self.revoked_serials()), serials)

    def test_revoking_twice_says_so_and_revoking_a_stranger_is_refused(self):
        serial = certificate(self.zone.enroll("car-1")).serial_number
        self.assertIn("'car-1' is revoked; no broker runs", self.zone.revoke("car-1"))
        self.assertIn("'car-1' was already revoked", self.zone.revoke("car-1"))
        self.assertEqual(self.revoked_serials(), [serial])
        self.assert_refused("was never enrolled", "revoke", "car-2", "--dir", self.directory)

    def test_a_revoked_vehicles_key_does_not_stay_behind(self):
        folder = pathlib.Path(self.zone.enroll("car-1"))
        self.zone.revoke("car-1")
        self.assertFalse(folder.exists())

    def test_a_damaged_register_or_key_is_one_sentence(self):
        for name in ("register.json", "authority/key.pem", "authority/ca.pem"):
            path = self.directory / name
            whole = path.read_bytes()
            path.write_bytes(whole[:len(whole) // 2])
            with self.subTest(name):
                self.assert_refused(f"{name}' is damaged", "enroll", "car-1", "--dir", self.directory)
            path.write_bytes(whole)

    def test_a_folder_without_a_zone_and_wrong_flags_are_one_sentence(self):
        self.assert_refused("holds no zone", "enroll", "car-1", "--dir", self.directory.parent)
        self.assert_refused("cannot be used", "init", "/proc/zone")
        self.assert_refused("unrecognized arguments", "enroll", "car-1", "--forever")
        self.assert_refused("--days 0 is not accepted", "enroll", "car-1", "--days", "0", "--dir", self.directory)
        self.assert_refused("required", "revoke")

    def test_every_command_has_help(self):
        for arguments in (["--help"], ["init", "--help"], ["enroll", "--help"], ["revoke", "--help"]):
            result = livemap_zone(*arguments)
            self.assertEqual(result.returncode, 0)
            self.assertIn("usage: livemap zone", result.stdout)

    def test_the_front_door_leads_to_the_commands_and_knows_no_others(self):
        front = subprocess.run([str(ROOT / "livemap"), "zone", "enrol", "car-1"], capture_output=True, text=True,
                               check=False)
        self.assertEqual(front.returncode, 2)
        self.assertIn("zone takes init, enroll, revoke, install, user, backup, restore, forget, export-labels, directory or "
                      "arguments like name:=value", front.stderr)


if __name__ == "__main__":
    unittest.main()
