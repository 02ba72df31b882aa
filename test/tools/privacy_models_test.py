#!/usr/bin/python3
"""livemap privacy-models places checked files beside the manifest, all of them or none."""

import hashlib
import pathlib
import subprocess
import sys
import tempfile
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
NETWORKS = ("faces", "plates", "road_users")


class PrivacyModelsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_privacy_models_")
        self.addCleanup(folder.cleanup)
        self.tree = pathlib.Path(folder.name) / "tree"
        self.downloads = pathlib.Path(folder.name) / "downloads"
        self.downloads.mkdir()
        manifest = {}
        for name in NETWORKS:
            content = f"the network of {name}".encode()
            (self.downloads / f"{name}.onnx").write_bytes(content)
            manifest[name] = {"file": f"privacy/{name}.onnx", "sha256": hashlib.sha256(content).hexdigest(),
                              "origin": f"https://example.org/{name}", "licence": "MIT"}
        self.write_manifest(self.tree / "models", manifest)

    @staticmethod
    def write_manifest(folder, manifest):
        folder.mkdir(parents=True)
        (folder / "privacy.yaml").write_text(yaml.safe_dump(manifest), encoding="utf-8")

    def run_it(self, *arguments):
        return subprocess.run([sys.executable, str(ROOT / "scripts/livemap_privacy_models"), "--root", str(self.tree),
                               *map(str, arguments)], capture_output=True, text=True, timeout=60)

    def placed(self, folder="models"):
        return sorted(path.name for path in (self.tree / folder / "privacy").glob("*"))

    def assert_refused(self, done, *words):
        self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, "one sentence")
        for word in words:
            self.assertIn(word, done.stderr)
        self.assertEqual(self.placed(), [])

    def test_checked_files_are_placed_beside_the_manifest_of_the_tree_and_of_the_installed_package(self):
        installed = self.tree / "install/share/livemap/models"
        self.write_manifest(installed, yaml.safe_load((self.tree / "models/privacy.yaml").read_text()))
        done = self.run_it(self.downloads)
        self.assertEqual(done.returncode, 0, done.stderr)
        names = sorted(f"{name}.onnx" for name in NETWORKS)
        self.assertEqual(self.placed(), names)
        self.assertEqual(self.placed("install/share/livemap/models"), names)
        for name in names:
            self.assertEqual((installed / "privacy" / name).read_bytes(), (self.downloads / name).read_bytes())

    def test_a_missing_file_is_named_with_where_it_comes_from_and_none_is_placed(self):
        (self.downloads / "road_users.onnx").unlink()
        self.assert_refused(self.run_it(self.downloads), "road_users.onnx' is missing", "https://example.org/road_users",
                            "MIT")

    def test_a_file_of_another_content_is_named_with_both_hashes_and_none_is_placed(self):
        (self.downloads / "road_users.onnx").write_bytes(b"half a netw")
        self.assert_refused(self.run_it(self.downloads), "road_users.onnx' has SHA-256 ",
                            hashlib.sha256(b"half a netw").hexdigest(), "accepted is ")

    def test_a_folder_that_is_none_is_refused(self):
        self.assert_refused(self.run_it(self.downloads / "nowhere"), "is no folder")

    def test_a_manifest_that_is_none_is_refused(self):
        (self.tree / "models/privacy.yaml").write_text("faces: 3", encoding="utf-8")
        self.assert_refused(self.run_it(self.downloads), "is no manifest")

    def test_remove_takes_away_what_is_placed(self):
        self.run_it(self.downloads)
        self.assert_refused_together()
        done = self.run_it("--remove")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.placed(), [])

    def assert_refused_together(self):
        done = self.run_it("--remove", self.downloads)
        self.assertEqual(done.returncode, 2, done.stdout)
        self.assertEqual(len(self.placed()), 3)

    def test_without_a_folder_it_says_what_is_placed_and_what_is_not(self):
        self.run_it(self.downloads)
        (self.tree / "models/privacy/plates.onnx").unlink()
        (self.tree / "models/privacy/faces.onnx").write_bytes(b"other")
        shown = self.run_it().stdout.splitlines()
        self.assertIn("another file", shown[0])
        self.assertIn("missing; https://example.org/plates (MIT)", shown[1])
        self.assertIn(": placed;", shown[2])


if __name__ == "__main__":
    unittest.main()
