#!/usr/bin/python3
"""livemap_evaluate_change and its plots as a person meets them.

    evaluate_change_test.py PROGRAM SIMULATE PLOT
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np

PROGRAM, SIMULATE, PLOT = sys.argv[1:4]
del sys.argv[1:4]
PAIRS = 4
CLASSES = 10


def run(*command, timeout=280):
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)


class EvaluateChangeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.data = os.path.join(cls.folder, "pairs")
        done = run(SIMULATE, "--seed", "3", "--change", cls.data, "--changes", "1", "--seconds", str(PAIRS), "--rate", "1",
                   "--size", "320x240", "--one-ray")
        if done.returncode != 0:
            raise RuntimeError(done.stderr)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def path(self, name):
        return os.path.join(self.folder, name)

    def figures(self, *arguments):
        done = run(PROGRAM, "--json", *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.count("\n"), 1)
        return json.loads(done.stdout)

    def masks(self):
        folder = os.path.join(self.data, "raw/000/GT")
        return {f"000/{name[2:4]}": cv2.imread(os.path.join(folder, name), cv2.IMREAD_UNCHANGED)
                for name in sorted(os.listdir(folder))}

    def write_predictions(self, name, make):
        """A folder of NAME.npy; `make` turns a mask into probabilities."""
        for pair, mask in self.masks().items():
            path = os.path.join(self.path(name), pair + ".npy")
            os.makedirs(os.path.dirname(path), exist_ok=True)
            np.save(path, make(mask))
        return self.path(name)

    @staticmethod
    def certain(mask):
        return (np.arange(CLASSES)[:, None, None] == mask).astype(np.float32)

    def test_the_truth_as_prediction_is_perfect_in_both_orders(self):
        truth = self.write_predictions("truth", self.certain)
        figures = self.figures("--predictions", truth, "--reversed-predictions", truth, self.data)
        self.assertEqual(figures["pairs"], PAIRS)
        self.assertGreater(figures["change_pixels"], 100)
        for part in (figures, figures["reversed"]):
            self.assertEqual(part["at_fpr"]["0.01"]["f1"], 1)
            self.assertEqual(part["argmax"]["accuracy"], 1)
            self.assertEqual(part["multi_class_accuracy"], 1)
            # At 512x512 outlines are smoothed.
            self.assertGreater(part["community"]["f1_per_pair_with_change"], 0.97)
        self.assertEqual(figures["classes"]["vehicle"]["ap"], 1)

    def test_figures_are_those_counted_with_numpy(self):
        random = np.random.default_rng(5)

        def unsure(mask):
            logits = random.normal(size=(CLASSES, *mask.shape)) + 2.5 * self.certain(mask)
            logits[0] += 2
            odds = np.exp(logits)
            return (odds / odds.sum(axis=0)).astype(np.float32)

        folder = self.write_predictions("unsure", unsure)
        figures = self.figures("--predictions", folder, self.data)
        masks = np.concatenate([mask.ravel() for mask in self.masks().values()])
        given = np.concatenate([np.load(os.path.join(folder, pair + ".npy")).reshape(CLASSES, -1) for pair in self.masks()],
                               axis=1)
        taken = given.argmax(axis=0)
        right = (taken > 0) & (masks > 0)
        self.assertAlmostEqual(figures["argmax"]["precision"], right.sum() / (taken > 0).sum())
        self.assertAlmostEqual(figures["argmax"]["recall"], right.sum() / (masks > 0).sum())
        self.assertAlmostEqual(figures["argmax"]["accuracy"], ((taken > 0) == (masks > 0)).mean())
        self.assertAlmostEqual(figures["multi_class_accuracy"], (taken == masks)[right].mean())
        score = 1 - given[0]
        for rate in ("0.10", "0.01"):
            threshold = np.sort(score[masks == 0])[::-1][int(float(rate) * (masks == 0).sum())]
            found = score > threshold
            recall = (found & (masks > 0)).sum() / (masks > 0).sum()
            precision = (found & (masks > 0)).sum() / found.sum()
            self.assertAlmostEqual(figures["at_fpr"][rate]["recall"], recall, places=2)
            self.assertAlmostEqual(figures["at_fpr"][rate]["precision"], precision, places=2)

    def test_classical_methods_run_and_are_drawn(self):
        reports = []
        for method in ("dense-sift", "daisy"):
            scores = self.path(f"scores_{method}")
            done = run(PROGRAM, "--json", "--curves", "--method", method, "--register", "homography", "--write", scores,
                       self.data)
            self.assertEqual(done.returncode, 0, done.stderr)
            figures = json.loads(done.stdout)
            self.assertEqual((figures["method"], figures["registration"], figures["pairs"]), (method, "homography", PAIRS))
            self.assertIsNone(figures["multi_class_accuracy"])
            self.assertIsNone(figures["classes"])
            # Better than a coin, in either order; refused pairs are no better than one.
            self.assertGreater(figures["roc_area"], 0.5)
            self.assertAlmostEqual(figures["roc_area"], figures["reversed"]["roc_area"], places=2)
            self.assertEqual(len(figures["pair_figures"]), PAIRS)
            self.assertEqual(len(figures["refusals"]), figures["refused_pairs"])
            # What was written is what was measured.
            again = self.figures("--predictions", scores, self.data)
            self.assertAlmostEqual(again["roc_area"], figures["roc_area"], places=3)
            reports.append(self.path(f"{method}.json"))
            with open(reports[-1], "w", encoding="utf-8") as file:
                file.write(done.stdout)
        plots = self.path("plots")
        done = run(PLOT, *reports, "--out", plots, "--data", self.data, "--predictions", self.path("scores_dense-sift"),
                   "--rows", "2")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(sorted(os.listdir(plots)), ["change_best.jpg", "change_precision_recall.png", "change_roc.png",
                                                     "change_worst.jpg"])
        self.assertEqual(cv2.imread(os.path.join(plots, "change_best.jpg")).shape[1], 4 * 320)
        for arguments, expected in [
                ([reports[1], "--data", self.data, "--predictions", self.path("scores_dense-sift")], "are of method dense-sift"),
                ([reports[0], "--data", self.folder + "/plots", "--predictions", self.path("scores_dense-sift")], "--data is")]:
            done = run(PLOT, "--out", plots, *arguments)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn(expected, done.stderr)

    def test_a_network_is_measured_as_its_predictions_are(self):
        model = os.environ.get("LIVEMAP_CHANGE_MODEL", "")
        if not os.path.exists(os.path.join(model, "made_of")):
            self.skipTest("skipped, no torch to make a network with")
        pairs = os.path.join(model, "pairs")
        own = self.figures("--model", os.path.join(model, "tiny.yaml"), "--register", "none", pairs)
        self.assertEqual((own["method"], own["pairs"], own["refused_pairs"]), ("tiny", 2, 0))
        predicted = self.figures("--predictions", os.path.join(model, "predictions/forward"),
                                 "--reversed-predictions", os.path.join(model, "predictions/reversed"), pairs)
        for part, expected in ((own, predicted), (own["reversed"], predicted["reversed"])):
            self.assertAlmostEqual(part["roc_area"], expected["roc_area"], places=3)
            self.assertAlmostEqual(part["argmax"]["accuracy"], expected["argmax"]["accuracy"], places=3)
            self.assertAlmostEqual(part["classes"]["sign"]["ap"], expected["classes"]["sign"]["ap"], places=3)

    def test_without_flags_it_measures_what_a_vehicle_runs(self):
        figures = self.figures(self.data)
        self.assertEqual((figures["method"], figures["registration"], figures["pairs"]), ("change-small", "both", PAIRS))
        alone = self.figures("--register", "edges", self.data)
        self.assertGreaterEqual(alone["refused_pairs"], figures["refused_pairs"])

    def test_pairs_of_which_less_has_changed_are_left_out(self):
        shares = {pair: float((mask > 0).mean()) for pair, mask in self.masks().items()}
        least = max(shares.values())
        figures = self.figures("--method", "daisy", "--register", "none", "--least-changed", str(0.999 * least), self.data)
        self.assertEqual((figures["pairs"], figures["left_out_pairs"]), (1, PAIRS - 1))
        self.assertAlmostEqual(figures["change_pixels"] / figures["pixels"], least)
        for rate in ("0.10", "0.01"):
            at_rate = figures["at_fpr"][rate]
            full = 2 * least / (2 * least + at_rate["fpr"] * (1 - least))
            self.assertAlmostEqual(at_rate["f1_at_full_recall"], full)
            self.assertLess(at_rate["f1"], full)

    def test_the_flat_layout_of_two_classes_is_read(self):
        flat = self.path("flat")
        for part in ("t0", "t1", "mask"):
            os.makedirs(os.path.join(flat, part), exist_ok=True)
        for pair, mask in self.masks().items():
            name = pair.replace("/", "_") + ".png"
            number = pair[-2:]
            shutil.copy(os.path.join(self.data, f"raw/000/RGB/1_{number}.png"), os.path.join(flat, "t0", name))
            shutil.copy(os.path.join(self.data, f"raw/000/RGB/2_{number}.png"), os.path.join(flat, "t1", name))
            cv2.imwrite(os.path.join(flat, "mask", name), ((mask > 0) * 255).astype(np.uint8))
        own = self.figures("--method", "daisy", "--register", "none", self.data)
        figures = self.figures("--method", "daisy", "--register", "none", flat)
        self.assertEqual(figures["at_fpr"], own["at_fpr"])

    def test_pairs_of_two_visits_are_measured_on_the_road_by_their_own_homography(self):
        visits = self.path("visits")
        shift = np.array([[1, 0, 6], [0, 1, 0], [0, 0, 1]], float)
        for pair, mask in self.masks().items():
            folder = os.path.join(visits, pair.replace("/", "_"))
            os.makedirs(folder, exist_ok=True)
            first, second = (cv2.imread(os.path.join(self.data, f"raw/000/RGB/{which}_{pair[-2:]}.png")) for which in (1, 2))
            moved = cv2.warpPerspective(first, np.linalg.inv(shift), (320, 240))
            for name, image in (("t0", second), ("t1", moved), ("mask", ((mask > 0) * 255).astype(np.uint8)),
                                ("ignore", np.repeat(np.uint8([[0] * 40 + [255] * 280]), 240, axis=0))):
                cv2.imwrite(os.path.join(folder, name + ".png"), image)
            np.savetxt(os.path.join(folder, "H_t1_to_t0.txt"), shift)
        everywhere = self.figures("--method", "difference", "--register", "given", visits)
        road = self.figures("--method", "difference", "--register", "given", "--region", "road", visits)
        self.assertEqual((everywhere["pairs"], everywhere["region"], road["region"]), (PAIRS, "all", "road"))
        self.assertEqual(everywhere["pixels"], PAIRS * 240 * 40)
        self.assertLess(road["pixels"], everywhere["pixels"])
        # What the warp does not show, 6 columns, is not compared.
        self.assertEqual(everywhere["unseen"]["pixels"], PAIRS * 240 * 6)
        self.assertEqual(everywhere["compared"]["pixels"] + everywhere["unseen"]["pixels"], everywhere["pixels"])
        self.assertIsNone(everywhere["on_board"])
        # The same pictures unmoved, of the columns that were compared.
        for folder in os.listdir(visits):
            moved = cv2.imread(os.path.join(visits, folder, "t1.png"))
            cv2.imwrite(os.path.join(visits, folder, "t1.png"), cv2.warpPerspective(moved, shift, (320, 240)))
            cv2.imwrite(os.path.join(visits, folder, "ignore.png"), np.repeat(np.uint8([[255] * 6 + [0] * 34 + [255] * 280]), 240, axis=0))
        unmoved = self.figures("--method", "difference", "--register", "none", visits)
        self.assertEqual(unmoved["at_fpr"], everywhere["compared"]["at_fpr"])
        board = self.figures("--register", "given", visits)["on_board"]
        self.assertGreaterEqual(board["threshold"], 0.5)
        done = run(PROGRAM, "--register", "given", self.data)
        self.assertEqual(done.returncode, 2)
        self.assertIn("has no H_t1_to_t0.txt", done.stderr)

    def test_without_json_it_is_a_table(self):
        done = run(PROGRAM, "--method", "daisy", self.data)
        self.assertEqual(done.returncode, 0, done.stderr)
        for words in ("daisy, 4 pairs", "at a FPR of 0.01", "multi-class accuracy", "order reversed", "512x512"):
            self.assertIn(words, done.stdout)

    def test_mistakes_are_one_sentence_and_exit_2(self):
        empty = self.path("empty")
        os.makedirs(empty, exist_ok=True)
        certain_of_nothing = self.write_predictions("nothing", lambda mask: np.zeros((CLASSES, *mask.shape), np.float32))
        for arguments, expected in [
                ([], "got 0 arguments"), (["/nowhere"], "/nowhere"), ([empty], "0 pairs"),
                (["--method", "best", self.data], "dense-sift and daisy"),
                (["--least-changed", "2", self.data], "--least-changed"),
                (["--least-changed", "1", self.data], "none of 4 pairs"), ([self.data, self.data], "named twice"),
                ([self.data, self.data + "/raw"], "named twice"),
                (["--write", self.data + "/scores", self.data], "lies in the data"),
                (["--write", self.data + "/camera.yaml", self.data], "is no folder"),
                (["--predictions", certain_of_nothing, self.data], "accepted is 1"),
                (["--predictions", "/nowhere", self.data], "'/nowhere' is not a folder"),
                (["--register", "well", self.data], "none, given, edges, homography and both"),
                (["--region", "sky", self.data], "all and road"),
                (["--predictions", empty, self.data], "000/00' is missing"),
                (["--method", "daisy", "--predictions", empty, self.data], "--method"),
                (["--method", "daisy", "--model", "tiny.yaml", self.data], "--model"),
                (["--model", os.path.join(self.folder, "tiny.yaml"), self.data], "tiny.yaml"),
                (["--curves", self.data], "--json"), (["--bogus", self.data], "--bogus")]:
            done = run(PROGRAM, *arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertEqual(done.stdout, "", arguments)
            self.assertIn(expected, done.stderr)
        report = self.path("report.json")
        with open(report, "w", encoding="utf-8") as file:
            json.dump(self.figures("--curves", "--method", "daisy", "--register", "none", self.data), file)
        broken = self.path("broken.json")
        with open(broken, "w", encoding="utf-8") as file:
            file.write('{"curve": 3}')
        for arguments, expected in [
                ([os.path.join(self.data, "camera.yaml"), "--out", empty], "camera.yaml"),
                ([broken, "--out", empty], "is not what --json --curves prints"),
                ([report, "--out", report], "cannot be made"), ([report, "--out", empty, "--rows", "0"], "--rows is 0"),
                ([report, "--out", empty, "--data", "/nowhere", "--predictions", empty], "/nowhere")]:
            done = run(PLOT, *arguments)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn(expected, done.stderr)

    def test_figures_of_pairs_without_any_change_are_drawn(self):
        folder = self.path("unchanged")
        done = run(SIMULATE, "--seed", "3", "--size", "96x72", "--seconds", "0.2", "--changes", "0", "--change", folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run(PROGRAM, "--json", "--curves", "--method", "daisy", "--register", "none", folder)
        report = self.path("unchanged.json")
        with open(report, "w", encoding="utf-8") as file:
            file.write(done.stdout)
        self.assertIsNone(json.loads(done.stdout)["ap"])
        done = run(PLOT, report, "--out", self.path("unchanged_plots"))
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_a_full_disk_is_no_success(self):
        with open("/dev/full", "w", encoding="utf-8") as full:
            done = subprocess.run([PROGRAM, "--json", "--method", "daisy", "--register", "none", self.data], stdout=full,
                                  stderr=subprocess.PIPE, text=True, timeout=280, check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn("cannot be written", done.stderr)

    def test_it_has_help(self):
        done = run(PROGRAM, "--help")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("usage: livemap_evaluate_change", done.stdout)


if __name__ == "__main__":
    unittest.main()
