#!/usr/bin/python3
"""livemap_evaluate_vo as a person meets it: on a simulated room and street, and on real sequences where there are any.

    evaluate_vo_test.py EVALUATE_VO SIMULATE
"""

import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

SIMULATE = sys.argv.pop()
PROGRAM = sys.argv.pop()
SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.realpath(__file__))))
DATA = os.environ.get("LIVEMAP_DATA_DIR", os.path.join(SOURCE, "..", "shared", "data"))


def run(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=600, check=False)


def as_kitti(tum, kitti):
    """The same drive as KITTI lays it out: numbered pictures of two cameras, projections, poses as matrices."""
    with open(os.path.join(tum, "camera.yaml"), encoding="ascii") as file:
        camera = {key: float(value) for key, value in (line.split(":") for line in file)}
    os.mkdir(kitti)
    for side, name in (("rgb", "image_0"), ("rgb_right", "image_1")):
        os.mkdir(os.path.join(kitti, name))
        for number, picture in enumerate(sorted(os.listdir(os.path.join(tum, side)))):
            shutil.copy(os.path.join(tum, side, picture), os.path.join(kitti, name, f"{number:06}.png"))
    with open(os.path.join(kitti, "calib.txt"), "w", encoding="ascii") as file:
        for name, shift in (("P0", 0), ("P1", -camera["fx"] * camera["baseline_m"])):
            file.write(f"{name}: {camera['fx']} 0 {camera['cx']} {shift} 0 {camera['fy']} {camera['cy']} 0 0 0 1 0\n")
    with open(os.path.join(tum, "groundtruth.txt"), encoding="ascii") as truth, \
            open(os.path.join(kitti, "poses.txt"), "w", encoding="ascii") as file:
        for line in truth:
            if line.startswith("#"):
                continue
            tx, ty, tz, x, y, z, w = map(float, line.split()[1:])
            rows = ((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), tx),
                    (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), ty),
                    (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), tz))
            file.write(" ".join(f"{value:.9f}" for row in rows for value in row) + "\n")


def write_blank_png(path, width, height):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = (b"\0" + bytes(3 * width)) * height
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def poses(file):
    """The lines of a trajectory, split."""
    with open(file, encoding="ascii") as lines:
        return [line.split() for line in lines if not line.startswith("#")]


class EvaluateVoTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.room = os.path.join(cls.temporary.name, "room")
        subprocess.run([SIMULATE, "--room", "--tum", cls.room, "--seconds", "2", "--rate", "15", "--size",
                        "320x240", "--seed", "4"], check=True, capture_output=True, timeout=600)
        cls.street = os.path.join(cls.temporary.name, "street_with_two_eyes")
        subprocess.run([SIMULATE, "--tum", cls.street, "--seed", "5", "--seconds", "1.6", "--rate", "10", "--size",
                        "320x240", "--one-ray", "--stereo", "0.4"], check=True, capture_output=True, timeout=600)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def figures(self, *arguments):
        return self.figures_and_words(*arguments)[0]

    def figures_and_words(self, *arguments):
        done = run("--json", *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.count("\n"), 1)
        return json.loads(done.stdout), done.stderr

    def refused(self, *arguments):
        done = run(*arguments)
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stderr.strip().count("\n"), 0, "one sentence")
        return done.stderr

    def test_a_calm_hand_is_followed_within_millimetres_by_every_kind_of_edges(self):
        for edges in ("canny", "log", "sobel"):
            for source in ("keyframe", "new-image" if edges == "log" else "new_image"):
                figures = self.figures(self.room, "--edges", edges, "--edge-source", source)
                self.assertEqual((figures["frames"], figures["initialising"], figures["lost"]), (30, 0, 0), edges)
                self.assertLess(figures["ate_rmse_m"], 0.004, f"{edges} {source}")
                self.assertLess(figures["rpe_rmse_m_per_s"], 0.006, f"{edges} {source}")

    def test_every_frame_can_be_a_keyframe_and_frames_can_be_left_out(self):
        self.assertEqual(self.figures(self.room, "--keyframe-every", "1")["keyframes"], 29)
        figures = self.figures(self.room, "--step", "3")
        self.assertEqual((figures["frames"], figures["lost"]), (10, 0))

    def test_opencvs_methods_run_beside_ours(self):
        for method in ("rgbd", "rgbd-icp"):
            figures = self.figures(self.room, "--method", method)
            self.assertEqual((figures["method"], figures["frames"]), (method, 30))
            self.assertLess(figures["ate_rmse_m"], 0.2)

    def test_the_trajectory_is_written_with_the_pictures_stamps(self):
        out = os.path.join(self.temporary.name, "out.txt")
        self.figures(self.room, "--out", out)
        rows = poses(out)
        self.assertEqual(len(rows), 30)
        self.assertEqual(rows[1][0], "0.066667000")
        self.assertEqual([float(value) for value in rows[0][1:]], [0, 0, 0, 0, 0, 0, 1])

    def test_a_folder_as_tum_packs_it_needs_neither_associations_nor_a_camera(self):
        folder = os.path.join(self.temporary.name, "rgbd_dataset_freiburg1_made_up")
        subprocess.run([SIMULATE, "--wall", "--tum", folder, "--seconds", "0.5", "--rate", "10"], check=True,
                       capture_output=True, timeout=600)
        as_simulated = self.figures(folder)
        self.assertEqual((as_simulated["frames"], as_simulated["lost"]), (5, 0))
        self.assertLess(as_simulated["ate_rmse_m"], 0.001)
        os.remove(os.path.join(folder, "associations.txt"))
        camera = os.path.join(self.temporary.name, "camera.yaml")
        os.rename(os.path.join(folder, "camera.yaml"), camera)
        by_name = self.figures(folder)
        self.assertEqual(by_name["frames"], 5)
        self.assertNotEqual(by_name["ate_rmse_m"], as_simulated["ate_rmse_m"], "the Kinect's focal length")
        self.assertEqual(self.figures(folder, "--camera", camera)["ate_rmse_m"], as_simulated["ate_rmse_m"])

    def test_the_wall_is_refused_with_what_belongs_to_other_worlds(self):
        for wrong, words in (("--wall --room", "--room and --wall"), ("--wall --condition rain", "--wall's"),
                             ("--wall", "--tum"), ("--vigour 2", "--room or --wall")):
            done = subprocess.run([SIMULATE, *wrong.split()], capture_output=True, text=True, timeout=60, check=False)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn(words, done.stderr)
    def test_two_eyes_are_followed_in_either_layout_and_their_matching_timed_apart(self):
        tum, kitti = (os.path.join(self.temporary.name, name) for name in ("street", "street_kitti"))
        shutil.copytree(self.street, tum)
        figures = self.figures(tum, "--stereo")
        self.assertEqual((figures["frames"], figures["lost"]), (16, 0))
        self.assertLess(figures["ate_rmse_m"], 0.01 * figures["length_m"])
        self.assertGreater(figures["stereo_ms"], 0)
        self.assertNotIn("stereo_ms", self.figures(tum), "with the folder's own depth")
        full = self.figures(tum, "--stereo", "--stereo-scale", "1")
        self.assertNotEqual(full["ate_rmse_m"], figures["ate_rmse_m"])
        self.assertLess(full["ate_rmse_m"], 0.01 * full["length_m"])
        as_kitti(tum, kitti)
        same = self.figures(kitti, "--stereo")
        self.assertEqual(same["frames"], 16)
        self.assertAlmostEqual(same["ate_rmse_m"], figures["ate_rmse_m"], delta=1e-4)

        shutil.rmtree(os.path.join(tum, "depth"))
        self.assertIn("is missing", self.refused(tum), "the folder's own depth is wanted here")
        self.assertEqual(self.figures(tum, "--stereo")["ate_rmse_m"], figures["ate_rmse_m"])
        self.assertEqual(self.figures(tum, "--mono")["depth"], "mono")

        self.assertIn("accepted is 1, 2 or 4", self.refused(tum, "--stereo", "--stereo-scale", "3"))
        self.assertIn("--stereo-scale needs --stereo", self.refused(tum, "--stereo-scale", "2"))
        os.remove(os.path.join(kitti, "image_1", "000007.png"))
        self.assertIn("000007.png", self.refused(kitti, "--stereo"))
        camera = os.path.join(tum, "camera.yaml")
        with open(camera, encoding="ascii") as file:
            lines = [line for line in file if "baseline" not in line]
        with open(camera, "w", encoding="ascii") as file:
            file.writelines(lines)
        self.assertIn("baseline_m in camera.yaml", self.refused(tum, "--stereo"))
        self.assertIn("no right camera", self.refused(self.room, "--stereo"))

    def test_a_kitti_folder_is_read_in_number_order_and_paired_by_number(self):
        kitti, odd = (os.path.join(self.temporary.name, name) for name in ("numbers", "numbers_odd"))
        as_kitti(self.street, kitti)
        sound = self.figures(kitti, "--stereo")
        shutil.copytree(kitti, odd)
        for side in ("image_0", "image_1"):
            for number in range(16):
                folder = os.path.join(odd, side)
                os.rename(os.path.join(folder, f"{number:06}.png"),
                          os.path.join(folder, f"{number}.{'PNG' if number % 2 else 'jpeg'}"))
        self.assertEqual(self.figures(odd, "--stereo")["ate_rmse_m"], sound["ate_rmse_m"])
        shutil.copy(os.path.join(odd, "image_0", "1.PNG"), os.path.join(odd, "image_0", "001.png"))
        refusal = self.refused(odd, "--stereo")
        self.assertIn("/001.png", refusal)
        self.assertIn("/1.PNG", refusal)
        for side in ("image_0", "image_1"):
            for number in (4, 5):
                os.remove(os.path.join(kitti, side, f"{number:06}.png"))
        lost = self.figures(kitti, "--stereo")
        self.assertEqual((lost["frames"], lost["pairs"]), (14, 14))
        self.assertAlmostEqual(lost["longest_gap_s"], 0.3)
        self.assertLess(lost["ate_rmse_m"], 0.01 * lost["length_m"])

    def test_a_sequence_whose_truth_is_of_another_time_has_no_errors(self):
        other = os.path.join(self.temporary.name, "other_time")
        shutil.copytree(self.room, other)
        with open(os.path.join(other, "groundtruth.txt"), "w", encoding="ascii") as file:
            file.write("5000 0 0 0 0 0 0 1\n5001 0 0 0 0 0 0 1\n")
        done = run("--json", other)
        figures = json.loads(done.stdout)
        self.assertEqual((done.returncode, figures["ate_rmse_m"], figures["rpe_rmse_m_per_s"]), (1, None, None))
        self.assertIn("0 of the 30 estimated poses", figures["reason"])
        self.assertGreater(figures["median_ms"], 0)

    def test_a_depth_image_of_another_kind_is_named(self):
        wrong = os.path.join(self.temporary.name, "wrong_depth")
        shutil.copytree(self.room, wrong)
        first = sorted(os.listdir(os.path.join(wrong, "depth")))[0]
        write_blank_png(os.path.join(wrong, "depth", first), 320, 240)
        refusal = self.refused(wrong)
        self.assertIn(os.path.join(wrong, "depth", first), refusal)
        self.assertIn("8 bits, three channels", refusal)

    def test_one_eye_follows_a_street_in_metres_by_the_speed(self):
        street, kitti = (os.path.join(self.temporary.name, name) for name in ("one_eye", "one_eye_kitti"))
        shutil.copytree(self.street, street)
        figures = self.figures(street, "--mono")
        self.assertEqual((figures["frames"], figures["lost"], figures["depth"]), (16, 0, "mono"))
        self.assertLess(figures["end_error_percent"], 3)
        noisy = self.figures(street, "--mono", "--speed-sigma", "0.3", "--seed", "4")
        self.assertNotEqual(noisy["ate_rmse_m"], figures["ate_rmse_m"])
        as_kitti(street, kitti)
        alone = self.figures(kitti)
        self.assertEqual((alone["depth"], alone["lost"]), ("mono", 0), "a drive without depth needs no flag")
        self.assertLess(alone["end_error_percent"], 3)

        by_height = self.figures(kitti, "--scale", "height", "--camera-height", "1.4", "--camera-pitch", "0.07")
        self.assertNotEqual(by_height["ate_rmse_m"], alone["ate_rmse_m"])

        self.assertIn("--camera needs TUM's", self.refused(kitti, "--camera", os.path.join(street, "camera.yaml")))
        self.assertIn("needs depth", self.refused(kitti, "--method", "rgbd"))
        self.assertIn("accepted are speed, height", self.refused(kitti, "--scale", "gps"))
        os.remove(os.path.join(kitti, "poses.txt"))
        self.assertIn("--scale height", self.refused(kitti))

    def test_frames_of_one_eye_before_its_start_have_no_pose(self):
        tum, kitti = (os.path.join(self.temporary.name, name) for name in ("begin", "begin_kitti"))
        shutil.copytree(self.street, tum)
        as_kitti(tum, kitti)
        out = os.path.join(self.temporary.name, "begin.txt")
        figures = self.figures(kitti, "--out", out)
        waiting = figures["initialising"]
        self.assertGreater(waiting, 0, "frame 1 is too near to frame 0")
        rows = poses(out)
        self.assertEqual((figures["frames"], figures["estimate_poses"], len(rows)), (16, 16 - waiting, 16 - waiting))
        self.assertEqual(rows[0], "0.000000000 0 0 0 0 0 0 1".split(), "the first frame is the origin")
        self.assertEqual([row[0] for row in rows[1:]], [f"{i / 10:.9f}" for i in range(waiting + 1, 16)])
        self.assertLess(figures["ate_max_m"], 0.01 * figures["length_m"])
        self.assertEqual(dict(line.split() for line in run(kitti).stdout.splitlines())["initialising"], str(waiting))

        # The lens is covered at first: the origin is the frame that the start began with.
        pictures = os.path.join(kitti, "image_0")
        blank = os.path.join(self.temporary.name, "blank.png")
        write_blank_png(blank, 320, 240)
        for number in range(3):
            shutil.copy(blank, os.path.join(pictures, f"{number:06}.png"))
        covered = self.figures(kitti, "--out", out)
        rows = poses(out)
        self.assertEqual(rows[0], "0.300000000 0 0 0 0 0 0 1".split())
        self.assertEqual((covered["initialising"], covered["lost"], len(rows)), (3 + waiting, 0, 13 - waiting))
        self.assertLess(covered["ate_max_m"], 0.01 * figures["length_m"])

    def test_one_eye_that_never_starts_says_so_and_has_no_errors(self):
        tum, still = (os.path.join(self.temporary.name, name) for name in ("stands", "stands_kitti"))
        shutil.copytree(self.street, tum)
        as_kitti(tum, still)
        moving = self.figures(still)
        for number in range(1, 16):
            shutil.copy(os.path.join(still, "image_0", "000000.png"),
                        os.path.join(still, "image_0", f"{number:06}.png"))
        out = os.path.join(self.temporary.name, "still.txt")
        done = run("--json", still, "--out", out)
        self.assertEqual(done.returncode, 1, "nothing was measured")
        figures, words = json.loads(done.stdout), done.stderr
        self.assertEqual((figures["frames"], figures["initialising"], figures["lost"]), (16, 16, 0))
        self.assertEqual(list(figures), [*moving, "reason"])
        self.assertIn("never started in 16 frames", figures["reason"])
        for key in ("ate_rmse_m", "ate_max_m", "segment_translation_percent", "end_error_percent", "pairs"):
            self.assertIsNone(figures[key], key)
        self.assertIn("never started in 16 frames", words)
        self.assertEqual(poses(out), [])

    def test_one_eye_keeps_the_bar_on_a_real_drive(self):
        drive = os.path.join(DATA, "mono", "kitti_a")
        if not os.path.isdir(drive):
            self.skipTest("skipped, no data")
        figures = self.figures(drive)
        self.assertEqual((figures["frames"], figures["initialising"], figures["lost"]), (51, 1, 0))
        self.assertEqual(figures["estimate_poses"], 50)
        self.assertLess(figures["ate_max_m"], 0.1, "no pose is made up")
        self.assertLess(figures["segment_translation_percent"], 3)
        self.assertLess(figures["end_error_percent"], 3)

    def test_figures_for_a_person_have_four_digits(self):
        done = run(self.room)
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = dict(line.split() for line in done.stdout.splitlines())
        self.assertEqual(rows["frames"], "30")
        self.assertRegex(rows["ate_rmse_m"], r"^0\.0*[1-9]\d{0,3}$")

    def test_without_truth_its_figures_are_null(self):
        with_truth = self.figures(self.room)
        os.rename(os.path.join(self.room, "groundtruth.txt"), os.path.join(self.room, "away"))
        try:
            figures = self.figures(self.room)
        finally:
            os.rename(os.path.join(self.room, "away"), os.path.join(self.room, "groundtruth.txt"))
        self.assertEqual(list(figures), list(with_truth), "no key is left out")
        for key in list(figures)[:list(figures).index("median_ms")]:
            self.assertIsNone(figures[key], key)
        self.assertGreater(figures["median_ms"], 0)
        self.assertEqual((figures["frames"], figures["lost"]), (30, 0))

    def test_mistakes_are_refused_in_one_sentence(self):
        self.assertIn("/nowhere", self.refused("/nowhere"))
        self.assertIn("canny, log, sobel", self.refused(self.room, "--edges", "prewitt"))
        self.assertIn("edge, rgbd, rgbd-icp", self.refused(self.room, "--method", "orb"))
        self.assertIn("/no/camera", self.refused(self.room, "--camera", "/no/camera.yaml"))
        self.assertIn("--edge-model FILE", self.refused(self.room, "--edges", "structured"))
        self.assertIn("which is no file",
                      self.refused(self.room, "--edges", "structured", "--edge-model", "/nowhere/model.yml.gz"))
        self.assertIn("is no folder", self.refused(os.path.join(self.room, "camera.yaml")))
        truth = os.path.join(self.room, "groundtruth.txt")
        with open(truth, encoding="ascii") as file:
            before = file.read()
        self.assertIn("would be overwritten", self.refused(self.room, "--out", truth))
        with open(truth, encoding="ascii") as file:
            self.assertEqual(file.read(), before)
        empty = os.path.join(self.temporary.name, "empty")
        os.mkdir(empty)
        self.assertIn("is no sequence", self.refused(empty))

    def test_flags_that_would_be_passed_over_are_refused(self):
        for flags, words in (
                ("--stereo --mono", "--stereo left out"),
                ("--scale speed", "--scale gives monocular odometry its scale: it needs --mono"),
                ("--scale height", "--scale gives monocular odometry its scale: it needs --mono"),
                ("--speed-sigma 0.2", "--speed-sigma gives monocular odometry its scale: it needs --mono"),
                ("--mono --camera-height 1.4", "--camera-height needs --scale height"),
                ("--mono --scale speed --camera-pitch 0.1", "--camera-pitch needs --scale height"),
                ("--mono --scale height --speed-sigma 0.2", "--speed-sigma needs --scale speed"),
                ("--mono --seed 4", "--seed needs --speed-sigma"),
                ("--edge-model somewhere", "--edge-model needs --edges structured"),
                ("--method rgbd --edges log", "--edges needs --method edge"),
                ("--method rgbd --keyframe-every 2", "--keyframe-every needs --method edge"),
                ("--method rgbd-icp --edge-source keyframe", "--edge-source needs --method edge"),
                ("--keyframe-every 1.5", "accepted is a whole number from 1 to 10000"),
                ("--step 1.5", "accepted is a whole number from 1 to 1000"),
                ("--step nan", "accepted is a whole number from 1 to 1000"),
                ("--stereo --stereo-scale 1.5", "accepted is a whole number from 1 to 4"),
                ("--mono --speed-sigma 0.1 --seed 1.5", "accepted is a whole number")):
            with self.subTest(flags):
                self.assertIn(words, self.refused(self.room, *flags.split()))

    def test_a_trajectory_that_cannot_be_written_is_refused_before_the_work(self):
        words = self.refused(self.room, "--out", "/nowhere/trajectory.txt")
        self.assertIn("--out is '/nowhere/trajectory.txt'", words)
        self.assertNotIn("following", words)
        kept = os.path.join(self.temporary.name, "kept.txt")
        with open(kept, "w", encoding="ascii") as file:
            file.write("an earlier one")
        self.refused(self.room, "--out", kept, "--method", "rgbd", "--edges", "log")
        with open(kept, encoding="ascii") as file:
            self.assertEqual(file.read(), "an earlier one")

    def test_real_sequences_are_followed_within_the_bars(self):
        bars = {"seven_scenes_a": (0.024, 0.039), "realsense_sample": (0.030, 0.030)}
        if not os.path.isdir(os.path.join(DATA, "rgbd")):
            self.skipTest("skipped, no data")
        for name, (ate_m, rpe_mps) in bars.items():
            figures = self.figures(os.path.join(DATA, "rgbd", name))
            self.assertEqual(figures["lost"], 0, name)
            self.assertLessEqual(figures["ate_rmse_m"], ate_m, name)
            self.assertLessEqual(figures["rpe_rmse_m_per_s"], rpe_mps, name)

    def test_a_hand_whose_pictures_blur_is_followed_at_a_few_frames_per_second(self):
        sequence = os.path.join(DATA, "rgbd", "seven_scenes_a")
        if not os.path.isdir(sequence):
            self.skipTest("skipped, no data")
        for step in ("5", "7", "10"):
            with self.subTest(step=step):
                figures = self.figures(sequence, "--step", step)
                self.assertEqual(figures["lost"], 0)
                self.assertLessEqual(figures["ate_rmse_m"], 2 * 0.0224)


if __name__ == "__main__":
    unittest.main()
