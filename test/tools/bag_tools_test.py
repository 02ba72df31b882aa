#!/usr/bin/python3
"""The programs that make bags, run as a user runs them, on folders that this test makes."""
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np
import rosbag
import rostest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))

from node_testing import program  # noqa: E402

WIDTH, HEIGHT = 640, 400


def run(tool, *arguments):
    return subprocess.run([program("livemap", f"livemap_bag_{tool}"), *map(str, arguments)],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=200)


def messages(path, topic):
    with rosbag.Bag(path) as bag:
        return [message for _, message, _ in bag.read_messages(topic)]


def write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w") as file:
        file.write(text)


def write_image(path, width=WIDTH, height=HEIGHT, seed=0):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    pixels = np.random.RandomState(seed).randint(0, 255, (height, width, 3), np.uint8)
    cv2.imwrite(path, pixels)


class BagToolsTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="livemap_bags_")
        self.bag = os.path.join(self.folder, "out.bag")

    def tearDown(self):
        shutil.rmtree(self.folder)

    def path(self, *parts):
        return os.path.join(self.folder, *parts)

    def survey(self):
        frames = [("a", 100, 1), ("b", 105, 0), ("c", 110, 0), ("d", 1110, 0)]
        write(self.path("road", "frames.csv"), "frame,chainage_m,potholes\n" + "".join(
            f"{name},{chainage},{potholes}\n" for name, chainage, potholes in frames))
        for i, (name, _, _) in enumerate(frames):
            write_image(self.path("road", "images", f"{name}.jpg"), seed=i)
        write(self.path("road", "labels", "a.txt"), "0 0.5 0.75 0.25 0.1\n")
        return self.path("road")

    def assert_refused(self, result, *words):
        self.assertEqual(result.returncode, 2, result.stderr)
        lines = [line for line in result.stderr.splitlines() if not line.startswith(("frame ", "clocks, "))]
        self.assertEqual(len(lines), 1, result.stderr)
        for word in words:
            self.assertIn(word, lines[0])
        self.assertFalse([name for name in os.listdir(self.folder) if name.startswith("out.bag")])

    def test_survey_bag_holds_the_jpegs_as_they_are_at_times_of_chainage_over_speed(self):
        road = self.survey()
        result = run("from_survey", road, self.bag, "--speed-mps", 20, "--start", "-23.5,-46.25",
                     "--bearing", 0, "--fix-noise-m", 0)
        self.assertEqual(result.returncode, 0, result.stderr)
        images = messages(self.bag, "/camera/image_raw/compressed")
        with open(os.path.join(road, "images", "b.jpg"), "rb") as file:
            self.assertEqual(bytes(images[1].data), file.read())
        times = [image.header.stamp.to_sec() - images[0].header.stamp.to_sec() for image in images]
        np.testing.assert_allclose(times, [0, 0.25, 0.5, 50.5], atol=1e-6)
        boxes = messages(self.bag, "/ground_truth/boxes")
        self.assertEqual([len(array.detections) for array in boxes], [1, 0, 0, 0])
        box = boxes[0].detections[0]
        self.assertEqual((box.class_name, boxes[0].model), ("pothole", "ground_truth"))
        np.testing.assert_allclose([box.x_min, box.y_min, box.x_max, box.y_max],
                                   [240, 280, 400, 320], atol=1e-3)
        infos = messages(self.bag, "/camera/camera_info")
        self.assertEqual([i.header.stamp for i in infos], [i.header.stamp for i in images])
        # 1010 m to the north of the start, where a degree has 110.77 km.
        fixes = {fix.header.stamp: fix for fix in messages(self.bag, "/fix")}
        last = fixes[images[3].header.stamp]
        self.assertAlmostEqual((last.latitude + 23.5) * 110770, 1010, delta=1)
        self.assertAlmostEqual(last.longitude, -46.25, places=9)
        transforms = messages(self.bag, "/tf_static")[0].transforms
        self.assertEqual([(t.header.frame_id, t.child_frame_id) for t in transforms],
                         [("base_link", "camera_link"), ("camera_link", "camera_optical_frame")])

    def test_long_gaps_are_cut_with_the_speed_kept(self):
        self.assertEqual(run("from_survey", self.survey(), self.bag, "--speed-mps", 20,
                             "--max-gap-s", 2).returncode, 0)
        images = messages(self.bag, "/camera/image_raw/compressed")
        self.assertAlmostEqual((images[3].header.stamp - images[0].header.stamp).to_sec(), 2.5)
        truth = messages(self.bag, "/ground_truth/fix")
        for earlier, later in zip(truth, truth[1:]):
            north = (later.latitude - earlier.latitude) * 111000
            east = (later.longitude - earlier.longitude) * 111320 * math.cos(
                math.radians(later.latitude))
            self.assertAlmostEqual(math.hypot(north, east), 2.0, delta=0.02)

    def test_same_seed_same_bytes(self):
        road, other = self.survey(), self.path("other.bag")
        run("from_survey", road, self.bag, "--seed", 5, "--fix-bias-m", 1)
        run("from_survey", road, other, "--seed", 5, "--fix-bias-m", 1)
        with open(self.bag, "rb") as a, open(other, "rb") as b:
            self.assertEqual(a.read(), b.read())

    def test_mistakes_are_one_sentence_and_leave_no_bag(self):
        road = self.survey()
        self.assert_refused(run("from_survey", self.path("nowhere"), self.bag), "nowhere")
        self.assert_refused(run("from_survey", road, self.bag, "--sped", 3), "--sped")
        table = os.path.join(road, "frames.csv")
        with open(table, encoding="ascii") as file:
            before = file.read()
        self.assert_refused(run("from_survey", road, table), "frames.csv", "would be overwritten")
        with open(table, encoding="ascii") as file:
            self.assertEqual(file.read(), before)
        self.assert_refused(run("from_survey", road, self.bag, "--speed-mps", "fast"), "fast")
        self.assert_refused(run("from_survey", road, self.bag, "--start", "91,0"), "91,0")
        route = self.path("route.geojson")
        write(route, json.dumps({"type": "LineString", "coordinates": [[0, 0], [0, 0.001]]}))
        self.assert_refused(run("from_survey", road, self.bag, "--route", route), "110.6 m",
                            "needs 1010.0 m")
        with open(os.path.join(road, "images", "c.jpg"), "wb") as file:
            file.write(b"\xff\xd8 no picture")
        self.assert_refused(run("from_survey", road, self.bag), "c.jpg")
        os.remove(os.path.join(road, "images", "c.jpg"))
        self.assert_refused(run("from_survey", road, self.bag), "c.jpg", "missing")

    def test_tum_bag_holds_colour_depth_in_metres_and_poses(self):
        write_image(self.path("tum", "rgb", "1.png"), 64, 48)
        os.makedirs(self.path("tum", "depth"))
        depth = np.full((48, 64), 5000, np.uint16)
        depth[0, 0] = 0
        cv2.imwrite(self.path("tum", "depth", "1.png"), depth)
        write(self.path("tum", "associations.txt"), "1000.5 rgb/1.png 1000.625 depth/1.png\n")
        write(self.path("tum", "groundtruth.txt"), "# truth\n1000.5 1 2 3 0 0 0 1\n")
        write(self.path("tum", "camera.yaml"),
              "width: 64\nheight: 48\nfx: 50\nfy: 51\ncx: 31\ncy: 23\ndepth_scale: 2500\n")
        result = run("from_tum", self.path("tum"), self.bag)
        self.assertEqual(result.returncode, 0, result.stderr)
        image = messages(self.bag, "/camera/depth/image_raw")[0]
        metres = np.frombuffer(image.data, np.float32).reshape(48, 64)
        self.assertEqual((image.encoding, metres[1, 1]), ("32FC1", 2.0))
        self.assertTrue(math.isnan(metres[0, 0]))
        self.assertEqual(image.header.stamp.to_sec(), 1000.625)
        self.assertEqual(messages(self.bag, "/ground_truth/pose")[0].pose.position.z, 3)
        self.assertEqual(messages(self.bag, "/camera/camera_info")[0].K[4], 51)
        os.remove(self.bag)
        write(self.path("tum", "groundtruth.txt"), "1000.5 1 2 3 0 0 nan 1\n")
        self.assert_refused(run("from_tum", self.path("tum"), self.bag), "line 1", "groundtruth.txt")

    def test_kitti_bag_holds_images_and_poses(self):
        for i in range(2):
            write_image(self.path("kitti", "images", f"{i:06}.png"), 80, 40, i)
        write(self.path("kitti", "calib.txt"), "P0: 70 0 40 0 0 70 20 0 0 0 1 0\n")
        write(self.path("kitti", "poses.txt"), "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 4 0 1 0 5 0 0 1 6\n")
        result = run("from_kitti", self.path("kitti"), self.bag, "--rate-hz", 5)
        self.assertEqual(result.returncode, 0, result.stderr)
        images = messages(self.bag, "/camera/image_raw")
        self.assertAlmostEqual((images[1].header.stamp - images[0].header.stamp).to_sec(), 0.2)
        self.assertEqual(messages(self.bag, "/ground_truth/pose")[1].pose.position.y, 5)
        os.remove(self.bag)
        self.assert_refused(run("from_kitti", self.path("kitti"), self.bag, "--start-time", "2038-02-01T00:00:00Z"),
                            "2038-02-01", "before 2038-01-19")

    def test_kitti_bag_holds_the_right_eye_with_its_baseline(self):
        for side, eye in enumerate(("image_2", "image_3")):
            for i in range(2):
                write_image(self.path("pair", eye, f"{i:06}.png"), 80, 40, 2 * i + side)
        projections = [f"P{i}: 70 0 40 {shift} 0 70 20 0 0 0 1 0\n" for i, shift in enumerate((0, -14, 7, -28))]
        write(self.path("pair", "calib.txt"), "".join(projections))
        result = run("from_kitti", self.path("pair"), self.bag)
        self.assertEqual(result.returncode, 0, result.stderr)
        lefts, rights = (messages(self.bag, f"/{eye}/image_raw") for eye in ("camera", "camera_right"))
        infos = messages(self.bag, "/camera_right/camera_info")
        for one in (rights, infos):
            self.assertEqual([(m.header.stamp, m.header.frame_id) for m in one],
                             [(m.header.stamp, m.header.frame_id) for m in lefts])
        self.assertNotEqual(rights[0].data, lefts[0].data)
        self.assertAlmostEqual(infos[0].P[3], -35, msg="from P2 to P3")
        os.remove(self.bag)
        projections[3] = projections[3].replace("-28", "28")
        write(self.path("pair", "calib.txt"), "".join(projections))
        self.assert_refused(run("from_kitti", self.path("pair"), self.bag), "lines 3 and 4", "calib.txt")
        write(self.path("pair", "calib.txt"), projections[0])
        self.assertEqual(run("from_kitti", self.path("pair"), self.bag).returncode, 0)
        self.assertEqual(messages(self.bag, "/camera_right/image_raw"), [])

    def recording(self):
        """Two pieces of a film of 10 Hz, two seconds each, lying as a phone stores it, and a track around them."""
        for piece in range(2):
            for i in range(20):
                write_image(self.path("film", f"{piece}", f"{i:03}.jpg"), 96, 64, 20 * piece + i)
            lying, film = self.path("film", f"lying_{piece}.mp4"), self.path("film", f"{piece}.mp4")
            ffmpeg = ["ffmpeg", "-v", "error", "-y"]
            subprocess.run([*ffmpeg, "-framerate", "10", "-i", self.path("film", f"{piece}", "%03d.jpg"), lying], check=True)
            subprocess.run([*ffmpeg, "-i", lying, "-c", "copy", "-metadata:s:v", "rotate=90", "-metadata",
                            f"creation_time=2026-01-31T12:00:0{2 * piece}Z", film], check=True)
        points = "".join(f'<trkpt lat="48.{i:04}" lon="9"><time>2026-01-31T12:00:{i:02}Z</time><speed>11</speed>'
                         f"<course>0</course></trkpt>\n" for i in range(10))
        write(self.path("track.gpx"), f'<gpx version="1.0"><trk><trkseg>\n{points}</trkseg></trk></gpx>')
        return self.path("film", "1.mp4"), self.path("film", "0.mp4")

    def test_dashcam_bag_joins_pieces_upright_with_their_times(self):
        second, first = self.recording()
        result = run("from_dashcam", second, first, self.bag, "--gpx", self.path("track.gpx"), "--fov", 66, "--offset", 1.5)
        self.assertEqual(result.returncode, 0, result.stderr)
        images = messages(self.bag, "/camera/image_raw/compressed")
        self.assertEqual(len(images), 40)
        begin = images[0].header.stamp.to_sec()
        self.assertAlmostEqual(begin, 1769860801.5, 3)
        for i, image in enumerate(images):
            self.assertAlmostEqual(image.header.stamp.to_sec() - begin, 0.1 * i, 2)
        self.assertEqual(cv2.imdecode(np.frombuffer(images[0].data, np.uint8), cv2.IMREAD_COLOR).shape, (96, 64, 3))
        info = messages(self.bag, "/camera/camera_info")[0]
        self.assertEqual((info.width, info.height), (64, 96))
        fixes = messages(self.bag, "/fix")
        self.assertEqual((fixes[0].latitude, fixes[0].header.stamp.to_sec()), (48.0, 1769860800))
        self.assertAlmostEqual(messages(self.bag, "/gps/velocity")[0].twist.twist.linear.y, 11)

    def test_dashcam_that_cannot_be_placed_is_refused(self):
        second, first = self.recording()
        gpx, camera = ("--gpx", self.path("track.gpx")), ("--fov", 66)
        self.assert_refused(run("from_dashcam", first, self.bag, *gpx), "--camera", "--fov", "--lens")
        self.assert_refused(run("from_dashcam", first, self.bag, *gpx, *camera), "the recording is too short", "--offset")
        self.assert_refused(run("from_dashcam", first, self.bag, *camera), "no positions of its own", "--gpx")
        self.assert_refused(run("from_dashcam", first, self.bag, *gpx, *camera, "--start-time", "2026-01-31T14:00:00Z"),
                            "of different times", "--recorder-zone +02:00")
        self.assert_refused(run("from_dashcam", first, self.bag, *gpx, *camera, "--start-time", "2026-01-31T14:00:00",
                                "--recorder-zone", "+01:00"), "of different times", "--recorder-zone +02:00")
        self.assert_refused(run("from_dashcam", first, self.bag, *gpx, *camera, "--offset", 5000), "--offset 5000", first,
                            gpx[1], "2026-01-31T12:", "2026-01-31T13:", "accepted is what has to be added, from -")
        self.assert_refused(run("from_dashcam", self.path(), self.bag, *gpx, *camera), "is a folder", "video files")
        self.assert_refused(run("from_dashcam", self.path("track.gpx"), self.bag, *gpx, *camera), "track.gpx", "no whole video")
        write(self.path("bad.csv"), "time,lat,lon\n2026-01-31T12:00:00Z,91,9\n")
        self.assert_refused(run("from_dashcam", first, self.bag, "--csv", self.path("bad.csv"), *camera), "line 2", "bad.csv")

    def test_photos_become_a_bag_in_the_order_of_their_times(self):
        for i in range(3):
            write_image(self.path("photos", f"{i}.jpg"), seed=i)
            subprocess.run(["exiftool", "-q", "-overwrite_original", f"-GPSLatitude=48.000{i}", "-GPSLatitudeRef=N",
                            "-GPSLongitude=9", "-GPSLongitudeRef=W", f"-DateTimeOriginal=2026:01:31 14:00:0{3 - i}",
                            "-OffsetTimeOriginal=+02:00", self.path("photos", f"{i}.jpg")], check=True)
        result = run("from_photos", self.path("photos"), self.bag, "--lens", "phone")
        self.assertEqual(result.returncode, 0, result.stderr)
        fixes = messages(self.bag, "/fix")
        self.assertEqual([round(fix.latitude, 4) for fix in fixes], [48.0002, 48.0001, 48.0])
        self.assertEqual([fix.header.stamp.to_sec() for fix in fixes], [1769860801, 1769860802, 1769860803])
        self.assertAlmostEqual(fixes[0].longitude, -9)
        self.assertEqual(len(messages(self.bag, "/camera/image_raw/compressed")), 3)

    def test_real_survey_section_becomes_a_bag(self):
        data = os.environ.get("LIVEMAP_DATA_DIR", os.path.join(
            os.path.dirname(os.path.realpath(__file__)), "..", "..", "..", "shared", "data"))
        road = os.path.join(data, "road_survey", "386RS191729")
        if not os.path.isdir(road):
            self.skipTest("skipped, no data")
        result = run("from_survey", road, self.bag)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(messages(self.bag, "/camera/image_raw/compressed")), 104)


if __name__ == "__main__":
    rostest.rosrun("livemap", "bag_tools", BagToolsTest)
