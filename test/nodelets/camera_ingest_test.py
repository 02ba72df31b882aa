#!/usr/bin/python3
"""The camera_ingest nodelet as other nodes see it: topics in, topics and diagnostics out."""
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import cv2
import numpy as np
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))

from node_testing import program  # noqa: E402

WIDTH, HEIGHT = 640, 400
K = np.array([[420.0, 0, 310], [0, 425, 205], [0, 0, 1]])
DISTORTION = [-0.28, 0.09, 0.001, -0.0008, 0.0]
P = np.array([[400.0, 0, 320, 0], [0, 400, 200, 0], [0, 0, 1, 0]])
# Only keeps a broken nodelet from hanging the test.
PATIENCE_S = 60


def camera_info(stamp, distortion, frame_id="camera_optical_frame", k=K, p=P):
    info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob")
    info.header.stamp, info.header.frame_id = stamp, frame_id
    info.D, info.K, info.P = distortion, k.ravel().tolist(), p.ravel().tolist()
    info.R = np.eye(3).ravel().tolist()
    return info


def raw_image(stamp, pixels, frame_id="camera_optical_frame"):
    image = Image(width=pixels.shape[1], height=pixels.shape[0], step=pixels[0].nbytes)
    image.header.stamp, image.header.frame_id = stamp, frame_id
    image.encoding = "mono8" if pixels.ndim == 2 else "bgr8"
    image.data = pixels.tobytes()
    return image


def compressed_image(stamp, data, frame_id="camera_optical_frame"):
    image = CompressedImage(format="jpeg", data=bytes(data))
    image.header.stamp, image.header.frame_id = stamp, frame_id
    return image


def jpeg(pixels):
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()


def pixels_of(image):
    channels = 1 if image.encoding == "mono8" else 3
    array = np.frombuffer(image.data, np.uint8).reshape(image.height, image.step)
    return array[:, : image.width * channels].reshape(image.height, image.width, channels)


def draw_disc(centre):
    """A white disc, radius 6, drawn to 1/256 pixel."""
    pixels = np.zeros((HEIGHT, WIDTH), np.uint8)
    fixed = tuple(int(round(value * 256)) for value in centre)
    cv2.circle(pixels, fixed, 6 * 256, 255, cv2.FILLED, cv2.LINE_AA, 8)
    return pixels


def centroid(pixels):
    moments = cv2.moments(pixels)
    return moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]


CALIBRATION = """\
image_width: 640
image_height: 400
camera_name: camera_optical_frame
camera_matrix: {rows: 3, cols: 3, data: [420, 0, 310, 0, 425, 205, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [420, 0, 310, 0, 0, 425, 205, 0, 0, 0, 1, 0]}
"""


class Ingest:
    """Talks to the nodelet of one namespace."""

    def __init__(self, namespace, transport):
        self.namespace = namespace
        self.changed = threading.Condition()
        self.images, self.infos, self.values = [], [], {}
        topic, kind = f"/{namespace}/camera/image_raw", Image
        if transport == "compressed":
            topic, kind = topic + "/compressed", CompressedImage
        self.image_publisher = rospy.Publisher(topic, kind, queue_size=1000)
        self.info_publisher = rospy.Publisher(
            f"/{namespace}/camera/camera_info", CameraInfo, queue_size=1000)
        self.subscribers = [
            rospy.Subscriber(f"/{namespace}/camera_rect/image", Image, self.on_image,
                             queue_size=1000, buff_size=1 << 26),
            rospy.Subscriber(f"/{namespace}/camera_rect/camera_info", CameraInfo, self.on_info,
                             queue_size=1000),
            rospy.Subscriber("/diagnostics", DiagnosticArray, self.on_diagnostics, queue_size=1000)]

    def on_image(self, image):
        with self.changed:
            self.images.append(image)
            self.changed.notify_all()

    def on_info(self, info):
        with self.changed:
            self.infos.append(info)
            self.changed.notify_all()

    def on_diagnostics(self, message):
        for status in message.status:
            if status.hardware_id == "camera_ingest" and f"{self.namespace}/camera_ingest" in status.name:
                with self.changed:
                    self.values = {value.key: value.value for value in status.values}
                    self.changed.notify_all()

    def wait(self, condition, what):
        end = time.monotonic() + PATIENCE_S
        with self.changed:
            while not condition():
                left = end - time.monotonic()
                assert left > 0, f"{what}: {len(self.images)} images, {self.values}"
                self.changed.wait(left)

    def connect(self):
        end = time.monotonic() + PATIENCE_S
        self.wait(lambda: self.values, "no diagnostics")
        while (self.image_publisher.get_num_connections() < 1
               or self.info_publisher.get_num_connections() < 1
               or any(s.get_num_connections() < 1 for s in self.subscribers)):
            assert time.monotonic() < end, f"no connection with {self.namespace}"
            time.sleep(0.02)

    def count(self, key):
        return int(self.values.get(f"frames_{key}", "-1"))

    def wait_until_all_accounted(self, frames_in):
        self.wait(lambda: self.count("in") == frames_in and frames_in == sum(
            self.count(key) for key in ("published", "dropped", "bad")), f"of {frames_in} frames")


class CameraIngestTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="livemap_ingest_")
        self.process = None

    def tearDown(self):
        if self.process:
            self.process.terminate()
            self.process.wait(PATIENCE_S)
        shutil.rmtree(self.folder)

    def test_raw_images_are_rectified_and_keep_their_stamp(self):
        ingest = Ingest("raw", "raw")
        ingest.connect()
        frames_in = ingest.count("in")
        points = [(100.5, 80.25), (320, 200), (540.75, 330), (90, 320)]
        stamps = [rospy.Time(1700000000 + i, 123456789) for i in range(len(points))]
        ingest.info_publisher.publish(camera_info(stamps[0], DISTORTION))
        for stamp, point in zip(stamps, points):
            ingest.image_publisher.publish(raw_image(stamp, draw_disc(point)))
        ingest.wait(lambda: len(ingest.images) == len(points) == len(ingest.infos), "images")
        self.assertEqual([image.header.stamp for image in ingest.images], stamps)
        self.assertEqual([info.header.stamp for info in ingest.infos], stamps)
        self.assertEqual(ingest.images[0].header.frame_id, "camera_optical_frame")
        self.assertEqual(set(ingest.infos[0].D), {0.0})
        np.testing.assert_allclose(np.reshape(ingest.infos[0].K, (3, 3)), P[:, :3])
        expected = cv2.undistortPoints(np.array([points]).reshape(-1, 1, 2), K,
                                       np.array(DISTORTION), P=P[:, :3]).reshape(-1, 2)
        for image, point in zip(ingest.images, expected):
            np.testing.assert_allclose(centroid(pixels_of(image)), point, atol=0.25)
        ingest.wait_until_all_accounted(frames_in + len(points))

        # Another calibration takes over: without distortion images pass through untouched.
        ingest.images.clear()
        ingest.info_publisher.publish(camera_info(stamps[0], [0.0] * 5, p=np.hstack(
            [K, np.zeros((3, 1))])))
        noise = np.random.RandomState(1).randint(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
        time.sleep(0.5)  # Topics have no order among each other.
        ingest.image_publisher.publish(raw_image(stamps[0], noise))
        ingest.wait(lambda: ingest.images, "image")
        np.testing.assert_array_equal(pixels_of(ingest.images[0]), noise)

    def test_compressed_images_are_resized_and_bad_ones_counted(self):
        ingest = Ingest("compressed", "compressed")
        ingest.connect()
        frames_in, bad = ingest.count("in"), ingest.count("bad")
        stamp = rospy.Time(1700000000, 5)
        good = jpeg(draw_disc((320, 200)))
        nan_k = K.copy()
        nan_k[0, 0] = float("nan")
        ingest.info_publisher.publish(camera_info(stamp, DISTORTION))
        ingest.info_publisher.publish(camera_info(stamp, DISTORTION, "broken", k=nan_k))
        ingest.image_publisher.publish(compressed_image(stamp, good))
        ingest.wait(lambda: len(ingest.images) == 1 == len(ingest.infos), "first image")
        info = ingest.infos[0]
        self.assertEqual((info.width, info.height), (320, 200))
        self.assertEqual((ingest.images[0].width, ingest.images[0].height), (320, 200))
        self.assertAlmostEqual(info.K[0], 200)
        self.assertAlmostEqual(info.K[2], 0.5 * 320.5 - 0.5)
        self.assertAlmostEqual(info.P[6], 0.5 * 200.5 - 0.5)

        huge = bytearray(good)
        at = huge.index(b"\xff\xc0") + 5
        huge[at:at + 4] = b"\xfd\xe8\xfd\xe8"  # 65000 x 65000
        unusable = [
            compressed_image(stamp, b""),
            compressed_image(stamp, b"no picture at all"),
            compressed_image(stamp, good[: len(good) // 2]),
            compressed_image(stamp, huge),
            compressed_image(stamp, jpeg(np.zeros((300, 300), np.uint8))),
            compressed_image(stamp, good, "broken"),
            compressed_image(stamp, good, "never_calibrated")]
        for image in unusable:
            ingest.image_publisher.publish(image)
        ingest.image_publisher.publish(compressed_image(rospy.Time(1700000001), good))
        ingest.wait_until_all_accounted(frames_in + 2 + len(unusable))
        self.assertEqual(ingest.count("bad"), bad + len(unusable))
        self.assertEqual(ingest.images[-1].header.stamp, rospy.Time(1700000001))

    def test_when_behind_the_oldest_frames_go_and_are_counted(self):
        ingest = Ingest("behind", "raw")
        ingest.connect()
        side = 2400
        info = camera_info(rospy.Time(1), DISTORTION)
        info.width = info.height = side
        ingest.info_publisher.publish(info)
        image = raw_image(rospy.Time(1), np.zeros((side, side, 3), np.uint8))
        frames = 40
        for i in range(frames):
            image.header.stamp = rospy.Time(1700000000 + i)
            ingest.image_publisher.publish(image)
        ingest.wait_until_all_accounted(frames)
        self.assertGreater(ingest.count("dropped"), 0)
        self.assertEqual(ingest.count("bad"), 0)
        # The newest one is never dropped.
        newest = rospy.Time(1700000000 + frames - 1)
        ingest.wait(lambda: ingest.images and ingest.images[-1].header.stamp == newest, "newest")

    def play(self, namespace, uri, **parameters):
        """Starts the nodelet on a file or folder."""
        calibration = os.path.join(self.folder, "camera.yaml")
        with open(calibration, "w") as file:
            file.write(CALIBRATION)
        ingest = Ingest(namespace, "raw")
        parameters.update(_uri=uri, _camera_info_url=f"file://{calibration}", _stamps="file_order",
                          _diagnostics_period_s="0.1", _queue_size="20")
        self.process = subprocess.Popen(
            [program("nodelet", "nodelet"), "standalone", "livemap/CameraIngestNodelet",
             f"__ns:={namespace}", "__name:=camera_ingest"] + [f"{key}:={value}" for key, value in parameters.items()])
        return ingest

    def test_a_video_is_played_at_its_own_rate_in_order(self):
        video = os.path.join(self.folder, "drive.avi")
        writer = cv2.VideoWriter(video, cv2.VideoWriter_fourcc(*"MJPG"), 4.0, (WIDTH, HEIGHT))
        for i in range(12):
            writer.write(np.full((HEIGHT, WIDTH, 3), 20 * i, np.uint8))
        writer.release()
        ingest = self.play("video", video, _source="video")
        ingest.wait_until_all_accounted(12)
        self.assertEqual(ingest.count("published"), 12)
        ingest.wait(lambda: ingest.images and pixels_of(ingest.images[-1]).mean() > 215, "last")
        brightness = [pixels_of(image).mean() for image in ingest.images]
        self.assertEqual(brightness, sorted(brightness))
        stamps = [image.header.stamp.to_sec() for image in ingest.images]
        for i in range(1, len(stamps)):
            frames_between = round((brightness[i] - brightness[i - 1]) / 20)
            self.assertAlmostEqual(stamps[i] - stamps[i - 1], frames_between / 4, places=4)

    def test_folder_is_played_in_order_and_a_corrupt_file_counted(self):
        for i in range(5):
            with open(os.path.join(self.folder, f"{i:03}.jpg"), "wb") as file:
                file.write(b"not a jpeg" if i == 2 else jpeg(np.full((HEIGHT, WIDTH), 40 * i,
                                                                     np.uint8)))
        ingest = self.play("folder", self.folder, _source="folder", _rate_hz="1")
        ingest.wait_until_all_accounted(5)
        self.assertEqual((ingest.count("published"), ingest.count("bad")), (4, 1))
        # The subscriber may have come late to the first pictures, never to the last.
        ingest.wait(lambda: ingest.images and pixels_of(ingest.images[-1]).mean() > 155, "last")
        stamps = [image.header.stamp.to_sec() for image in ingest.images]
        self.assertEqual(stamps, sorted(stamps))
        for earlier, later in zip(stamps, stamps[1:]):
            self.assertAlmostEqual((later - earlier) % 1, 0, places=4)
        self.assertIsNone(self.process.poll())


if __name__ == "__main__":
    rospy.init_node("camera_ingest_test")
    rostest.rosrun("livemap", "camera_ingest", CameraIngestTest)
