#!/usr/bin/python3
"""What `livemap demo --bag` and replay.launch say of bags in which something is missing, before anything starts."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test/support"), str(ROOT / "scripts/lib")]
import drive_bag  # noqa: E402
import rosbag  # noqa: E402
from drive_bags import FRAME, fix, stamp, write_drive  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from system_error import StartError  # noqa: E402


class DriveBags(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_drive_bag_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def bag(self, name="drive.bag", **options):
        return write_drive(self.folder / name, **options)

    def demo(self, *arguments):
        return subprocess.run(["/usr/bin/python3", str(ROOT / "scripts/livemap_demo"), "--headless", "--json", *map(str, arguments)],
                              capture_output=True, text=True, timeout=60, cwd=self.folder, check=False)

    def replay(self, bag, *arguments, do="--nodes"):
        """What roslaunch makes of replay.launch, which starts nothing here."""
        return subprocess.run(["roslaunch", do, str(ROOT / "launch/replay.launch"), f"bag:={bag}", *arguments],
                              capture_output=True, text=True, timeout=60, cwd=self.folder, check=False)

    def ask(self, bag, **known):
        """What replay.launch asks livemap_player before it starts."""
        request = {"bag": str(bag), "check": "true", "input": "topic", "transport": "auto", "camera_ingest": "{}",
                   "image": "camera/image_raw", "camera_info": "camera/camera_info", "fix": "fix", "reports": "True",
                   "publish_mounting": "false", "use_truth": "false", "vo": "false", "stereo": "false",
                   "depth": "camera/depth/image_raw", "right_image": "camera_right/image_raw",
                   "right_camera_info": "camera_right/camera_info", **known}
        return subprocess.run(["/usr/bin/python3", str(ROOT / "scripts/livemap_player"), "--transport",
                               "\0".join(request.values()).encode().hex()], capture_output=True, text=True, timeout=60,
                              cwd=self.folder, check=False)

    def test_a_recording_that_is_none_is_refused_before_anything_starts(self):
        (self.folder / "a.mp4").touch()
        for arguments, sentence in (
                (["--drive", "a.mp4", "b.mp4", "--gpx", "track.gpx"], "video 'b.mp4' is no file"),
                (["--bag", "drive.bag", "--gpx", "track.gpx"], "--gpx needs --drive VIDEO"),
                (["--fov", "66"], "--fov needs --drive VIDEO")):
            with self.subTest(arguments=arguments):
                done = self.demo(*arguments)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertIn(sentence, done.stderr)

    def assert_refused(self, bag, *parts, code=1, arguments=()):
        """By the demo: one sentence, nothing on standard output, nothing started."""
        done = self.demo("--bag", bag, *arguments)
        self.assertEqual(done.returncode, code, done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        for part in parts:
            self.assertIn(part, done.stderr)

    def test_what_a_bag_lacks_is_named_with_the_topics_that_were_looked_at(self):
        wanted = {"/camera/camera_info": "no calibration of the camera: looked for sensor_msgs/CameraInfo under /camera/camera_info",
                  "/fix": "no fixes of a receiver: looked for sensor_msgs/NavSatFix under /fix",
                  "/tf_static": f"no mounting of the camera: looked for transforms from base_link to '{FRAME}' under /tf_static and /tf",
                  "/camera/image_raw/compressed": "no camera images: looked for sensor_msgs/Image under /camera/image_raw and "
                                                  "sensor_msgs/CompressedImage under /camera/image_raw/compressed"}
        for topic, sentence in wanted.items():
            with self.subTest(topic):
                bag = self.bag(leave_out=[topic])
                self.assert_refused(bag, f"bag '{bag}' has ", sentence)
                done = self.ask(bag)
                self.assertEqual(done.returncode, 1, done.stdout)
                self.assertIn(f"livemap replay: bag '{bag}' has {sentence}", done.stderr)

    def test_a_replay_of_a_bag_without_calibration_starts_nothing(self):
        done = self.replay(self.bag(leave_out=["/camera/camera_info"]))
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertNotIn("/player", done.stdout)
        self.assertIn("no calibration of the camera", done.stderr)

    def test_all_that_is_missing_is_named_at_once(self):
        self.assert_refused(self.bag(leave_out=["/fix", "/tf_static", "/camera/camera_info"]), "no calibration of the camera",
                            "no fixes of a receiver", "no mounting of the camera")

    def test_a_topic_of_another_name_is_named_too(self):
        bag = self.bag(rename={"/camera/image_raw/compressed": "/front/image/compressed", "/fix": "/gps/fix",
                               "/camera/camera_info": "/front/camera_info"})
        self.assert_refused(bag, "but it has /front/image/compressed", "but it has /gps/fix", "but it has /front/camera_info")
        names = ("image:=front/image", "camera_info:=front/camera_info", "fix:=gps/fix")
        self.assertEqual(self.replay(bag, *names).returncode, 0)

    def test_another_type_under_the_right_name_is_named(self):
        bag = self.bag(replace={"/fix": lambda seconds: String("here")})
        self.assert_refused(bag, "no fixes of a receiver: /fix holds std_msgs/String, wanted is sensor_msgs/NavSatFix")
        self.bag(images="raw", replace={"/camera/image_raw": lambda seconds: String("picture")})
        self.assert_refused(bag, "no camera images: /camera/image_raw holds std_msgs/String, wanted is sensor_msgs/Image")

    def test_true_boxes_and_depth_are_missed_only_where_they_are_wanted(self):
        bag = self.bag()
        self.assert_refused(bag, "no true boxes: looked for livemap/DetectionArray under /ground_truth/boxes",
                            arguments=["--use-truth"])
        self.assert_refused(bag, "no depth images: looked for sensor_msgs/Image under /camera/depth/image_raw",
                            arguments=["--positions", "fused"])

    def test_what_is_no_bag_is_told_apart(self):
        whole = self.bag("whole.bag")
        cut = self.folder / "cut.bag"
        cut.write_bytes(whole.read_bytes()[:-4000])
        active = self.folder / "drive.bag.active"
        with rosbag.Bag(str(active), "w") as bag:
            bag.write("/fix", fix(0), stamp(0))
            bag.flush()
            shutil.copy(active, self.folder / "running.bag.active")
        (self.folder / "nothing.bag").write_bytes(b"")
        (self.folder / "text.bag").write_text("dear diary")
        with rosbag.Bag(str(self.folder / "no_message.bag"), "w"):
            pass
        for name, part in {"running.bag.active": "has no index, because its recording was cut off", "cut.bag": "has no index",
                           "nothing.bag": "is empty", "text.bag": "is not a whole rosbag", "absent.bag": "is not a file",
                           "drives": "is a folder, which holds 1 bags, the first is 'one.bag'"}.items():
            (self.folder / "drives").mkdir(exist_ok=True)
            (self.folder / "drives/one.bag").touch()
            with self.subTest(name):
                self.assert_refused(name, part, code=2)
                done = self.ask(name)
                self.assertEqual(done.returncode, 1)
                self.assertIn(part, done.stderr)
        self.assert_refused("no_message.bag", "holds no message")

    def test_true_hazards_that_cannot_be_read_are_refused_before_the_replay(self):
        bag = self.bag()
        bag.with_suffix(".geojson").write_text('{"type":"FeatureCollection"}', encoding="ascii")
        self.assert_refused(bag, "drive.geojson' have no list of features", "accepted is a GeoJSON FeatureCollection", code=2)

    def test_two_bags_for_a_demo_are_refused(self):
        one, two = self.bag("one.bag"), self.bag("two.bag")
        self.assert_refused(one, "--bag takes one bag, 2 were given", code=2, arguments=["--bag", two])

    def test_two_bags_with_a_blank_between_are_replayed_as_one(self):
        one, two = self.bag("one.bag", leave_out=["/fix"]), self.bag("two.bag", leave_out=["/tf_static"])
        self.assertEqual(self.ask(f"{one} {two}").stdout, "compressed")
        self.assertEqual(self.ask(one).returncode, 1)

    def test_compressed_bags_are_read(self):
        for compression in ("bz2", "lz4"):
            with self.subTest(compression):
                drive = drive_bag.DriveBag([self.bag(compression=compression)])
                self.assertEqual(drive_bag.faults_of(drive, drive_bag.DEFAULT_TOPICS, True), [])

    def transport(self, bag, *arguments):
        done = self.replay(bag, *arguments, do="--dump-params")
        self.assertEqual(done.returncode, 0, done.stderr)
        return next(line.split()[1] for line in done.stdout.splitlines() if line.startswith("/camera_ingest/transport:"))

    def test_a_replay_takes_the_images_as_the_bag_holds_them_unless_told_otherwise(self):
        bags = {kind: self.bag(f"{kind}.bag", images=kind) for kind in ("raw", "compressed", "both")}
        self.assertEqual({kind: self.transport(bag) for kind, bag in bags.items()},
                         {"raw": "raw", "compressed": "compressed", "both": "compressed"})
        self.assertEqual(self.transport(bags["both"], "transport:=raw"), "raw")
        self.assertEqual(self.transport(bags["both"], "camera_ingest:={transport: raw}"), "raw")
        drive = drive_bag.DriveBag([bags["both"]])
        self.assertEqual(drive.frames("camera/image_raw", "compressed"), 20)

    def test_a_path_may_hold_what_shells_and_roslaunch_read(self):
        for name in ("to work.bag", "it's \"late\".bag", "$HOME \\t.bag", "s\u00fcd #1 & 2; {x: y}.bag", "-leading.bag", "--clock.bag",
                     "'", "$(arg bag).bag"):
            with self.subTest(name):
                self.bag(name)
                self.assertEqual(self.transport(name), "compressed")
                (self.folder / name).unlink()
                self.assertIn(f"bag '{self.folder / name}' is not a file", self.ask(name).stderr)

    def test_what_a_replay_does_without_is_not_asked_for(self):
        bag = self.bag(leave_out=["/fix", "/tf_static"])
        self.assertEqual(self.replay(bag, "detect:=false").returncode, 0)
        self.assertEqual(self.ask(self.bag(leave_out=["/tf_static"]), publish_mounting="true").returncode, 0)
        self.assertEqual(self.ask(self.bag(leave_out=["/fix"]), check="false").returncode, 0)
        self.assertEqual(self.ask(self.bag(leave_out=["/camera/camera_info"]), reports="False").returncode, 1)

    def test_stamps_that_go_back_or_are_missing_are_told(self):
        drive = drive_bag.DriveBag([self.bag(begin_again=1)])
        doubts = drive.doubts_about_stamps(["camera/camera_info", "fix"])
        self.assertEqual(len(doubts), 2)
        self.assertIn("the stamps of /fix go back by 1.9 s at 1767268800.000", doubts)
        drive = drive_bag.DriveBag([self.bag(replace={"/fix": lambda seconds: type(fix(0))()})])
        self.assertIn("/fix has messages without a stamp", drive.doubts_about_stamps(["fix"])[0])
        self.assertEqual(drive_bag.DriveBag([self.bag()]).doubts_about_stamps(["camera/camera_info", "fix"]), [])

    def test_a_message_of_another_year_is_refused_for_a_replay_would_wait_for_it(self):
        path = self.bag()
        with rosbag.Bag(str(path), "a") as bag:
            bag.write("/note", String("written when the clock was set"), stamp(86400 * 365))
        self.assert_refused(path, str(path), "messages from 2026-01-01 12:00 UTC to 2027-01-01 12:00 UTC", "24 hours", "rosbag filter")
        self.assertEqual(self.ask(path).returncode, 1)

    def test_a_bag_that_is_damaged_inside_is_named(self):
        path = self.bag()
        data = bytearray(path.read_bytes())
        begin = data.index(b"base_link") - 60
        data[begin:begin + 40] = bytes(40)
        path.write_bytes(data)
        with self.assertRaises(StartError) as refused:
            drive = drive_bag.DriveBag([path])
            drive_bag.faults_of(drive, drive_bag.DEFAULT_TOPICS, True)
        self.assertIn(str(path), str(refused.exception))


class WithoutAWorkspace(unittest.TestCase):
    def test_a_demo_says_in_one_sentence_what_to_source(self):
        for flags, part in (([], "source install/setup.bash or call ./livemap demo"), (["-S"], "call ./livemap demo")):
            done = subprocess.run(["/usr/bin/python3", *flags, str(ROOT / "scripts/livemap_demo"), "--headless"],
                                  env={"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/")}, capture_output=True,
                                  text=True, timeout=60, check=False)
            self.assertEqual(done.returncode, 1)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertIn(part, done.stderr)


if __name__ == "__main__":
    unittest.main()
