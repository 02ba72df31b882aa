#!/usr/bin/python3
"""hazard_detection as the vehicle runs it: images in, detections and annotated images out.

The model is the tiny one of test/perception/inference/make_tiny_model.py: a red block is a pothole, a green one a
traffic cone.
"""

import os
import signal
import sys
import tempfile
import unittest

import cv2
import numpy
import rospy
import rostest
import yaml
from sensor_msgs.msg import Image

from livemap.msg import BestViews, DetectionArray
sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import SOURCE_DIRECTORY, NodeletUnderTest, eventually, parameters_of  # noqa: E402

TINY_MODEL = os.path.join(SOURCE_DIRECTORY, "test", "perception", "inference", "tiny.yaml")
WIDTH, HEIGHT = 64, 48
RED, GREEN = (0, 0, 255), (0, 255, 0)
# No more than the nodelet's queue of answers holds, which a subscriber that gets no processor time lets fill up.
BURST = 100


def image(number, *blocks):
    """Image `number` of a stream, with blocks (x, y, colour) of 8 x 8 px, blue green red."""
    pixels = numpy.zeros((HEIGHT, WIDTH, 3), numpy.uint8)
    for x, y, colour in blocks:
        pixels[y:y + 8, x:x + 8] = colour
    message = Image(width=WIDTH, height=HEIGHT, encoding="bgr8", step=3 * WIDTH)
    message.header.stamp = rospy.Time(1600000000, 1000 * number)
    message.header.frame_id = "camera_optical_frame"
    message.data = pixels.tobytes()
    return message


def street_with_face(number):
    """A large image of a grey street with a drawn face, and a red block that the model knows; where the face is."""
    pixels = numpy.random.RandomState(7).normal(120, 6, (240, 320, 3)).clip(0, 255).astype(numpy.uint8)
    height, centre = 80, numpy.array((180, 110))

    def part(x, y, width, part_height, colour):
        middle = centre + numpy.rint(numpy.array((x, y)) * height).astype(int)
        axes = (max(1, round(width * height)), max(1, round(part_height * height)))
        cv2.ellipse(pixels, tuple(map(int, middle)), axes, 0, 0, 360, colour, cv2.FILLED, cv2.LINE_AA)

    part(0, -0.15, 0.48, 0.55, (30, 40, 50))
    part(0, 0, 0.40, 0.52, (140, 170, 215))
    for side in (-0.17, 0.17):
        part(side, -0.10, 0.10, 0.05, (90, 110, 150))
        part(side, -0.10, 0.07, 0.03, (240, 240, 240))
        part(side, -0.10, 0.03, 0.03, (20, 20, 20))
        part(side, -0.19, 0.10, 0.03, (30, 40, 60))
    part(0, 0.08, 0.06, 0.10, (120, 150, 195))
    part(0, 0.30, 0.15, 0.04, (70, 70, 160))
    # Without colour: the model would take skin for red.
    pixels = cv2.merge([cv2.cvtColor(cv2.GaussianBlur(pixels, (0, 0), 1.0), cv2.COLOR_BGR2GRAY)] * 3)
    pixels[180:220, 10:50] = RED
    message = image(number)
    message.height, message.width = pixels.shape[:2]
    message.step = 3 * message.width
    message.data = pixels.tobytes()
    return message, (slice(85, 140), slice(155, 205))


def pixels_of(message):
    return numpy.frombuffer(message.data, numpy.uint8).reshape(message.height, message.width, 3)


class Detector(NodeletUnderTest):
    """A nodelet manager with the nodelet, and the test's ends of its topics."""

    def __init__(self, name):
        super().__init__(name, "hazard_detection")
        self.publisher = self.advertise("camera_rect/image", Image, queue_size=2 * BURST)
        self.results = self.subscribe("hazard/detections", DetectionArray)
        self.manager = self.start_nodelet("manager", "manager")

    def answers(self):
        return self.received("hazard/detections")

    def load(self, **parameters):
        """Starts loading with the package's own YAML, changed by the parameters."""
        values = parameters_of("hazard_detection")
        values.update({"model": TINY_MODEL, "diagnostics_period_s": 0.2}, **parameters)
        rospy.set_param(f"/{self.name}/hazard_detection", values)
        return self.start_nodelet("hazard_detection", "load", "livemap/HazardDetectionNodelet", "manager")

    def load_and_wait(self, **parameters):
        self.load(**parameters)
        eventually(lambda: self.publisher.get_num_connections() > 0, "it listens")
        eventually(lambda: self.results.get_num_connections() > 0, "it speaks")

    def signal_manager(self, number):
        os.killpg(self.manager.pid, number)


class HazardDetectionTest(unittest.TestCase):
    number = 0

    def make_detector(self):
        HazardDetectionTest.number += 1
        detector = Detector(f"vehicle{HazardDetectionTest.number}")
        self.addCleanup(detector.stop)
        return detector

    def loaded_detector(self, **parameters):
        detector = self.make_detector()
        detector.load_and_wait(**parameters)
        return detector

    def test_every_frame_gets_one_answer_with_its_stamp_also_when_empty(self):
        detector = self.loaded_detector(queue_size=100)
        frames = [image(0), image(1, (16, 8, RED)), image(2), image(3, (16, 8, RED), (40, 32, GREEN))]
        for frame in frames:
            detector.publisher.publish(frame)
        answers = eventually(lambda: len(detector.answers()) >= 4 and detector.answers(), "4 answers")
        detector.wait_for(frames_in=4, frames_processed=4, frames_dropped=0, frames_waiting=0,
                          detections=3)
        self.assertEqual(len(detector.answers()), 4)
        self.assertEqual([answer.header.stamp for answer in answers],
                         [frame.header.stamp for frame in frames])
        self.assertEqual([sorted(found.class_name for found in answer.detections) for answer in answers],
                         [[], ["pothole"], [], ["pothole", "traffic_cone"]])
        for answer in answers:
            self.assertEqual(answer.header.frame_id, "camera_optical_frame")
            self.assertEqual((answer.model, answer.image_width, answer.image_height),
                             ("tiny", WIDTH, HEIGHT))
            self.assertGreater(answer.inference_ms, 0)
        pothole = answers[1].detections[0]
        for edge, expected in [(pothole.x_min, 12), (pothole.y_min, 8), (pothole.x_max, 28),
                               (pothole.y_max, 16)]:
            self.assertAlmostEqual(edge, expected, delta=0.1)
        self.assertEqual(detector.diagnostics()["model"], "tiny")

    def test_annotated_images_are_drawn_only_for_subscribers_and_only_with_detections(self):
        detector = self.loaded_detector(queue_size=100)
        detector.publisher.publish(image(0, (16, 8, RED)))
        detector.wait_for(frames_processed=1, frames_annotated=0)
        annotated = detector.subscribe("hazard/annotated", Image)
        eventually(lambda: annotated.get_num_connections() > 0, "the picture's topic")
        plain = [image(1), image(2, (16, 8, RED)), image(3)]
        for frame in plain:
            detector.publisher.publish(frame)
        detector.wait_for(frames_processed=4, frames_annotated=1)
        pictures = eventually(lambda: detector.received("hazard/annotated"), "a picture")
        self.assertEqual(len(pictures), 1)
        self.assertEqual(pictures[0].header.stamp, plain[1].header.stamp)
        self.assertEqual((pictures[0].width, pictures[0].height, pictures[0].encoding),
                         (WIDTH, HEIGHT, "bgr8"))
        self.assertNotEqual(bytes(pictures[0].data), bytes(plain[1].data))

    def test_empty_frames_are_annotated_when_asked_for(self):
        detector = self.loaded_detector(queue_size=100, annotate_empty=True)
        annotated = detector.subscribe("hazard/annotated", Image)
        eventually(lambda: annotated.get_num_connections() > 0, "the picture's topic")
        frame = image(0)
        detector.publisher.publish(frame)
        pictures = eventually(lambda: detector.received("hazard/annotated"), "a picture")
        self.assertEqual(bytes(pictures[0].data), bytes(frame.data))

    def picture_of_a_face(self, **parameters):
        """The face in the published picture, and how the camera saw it."""
        detector = self.loaded_detector(queue_size=100, **parameters)
        annotated = detector.subscribe("hazard/annotated", Image)
        eventually(lambda: annotated.get_num_connections() > 0, "the picture's topic")
        frame, face = street_with_face(0)
        detector.publisher.publish(frame)
        picture = eventually(lambda: detector.received("hazard/annotated"), "a picture")[0]
        detector.wait_for(pictures_withheld=0, frames_annotated=1)
        return pixels_of(picture)[face], pixels_of(frame)[face]

    def test_a_face_in_the_picture_is_masked(self):
        masked, seen = self.picture_of_a_face(privacy_finder="cascades")
        colours = {tuple(pixel) for pixel in masked.reshape(-1, 3)}
        self.assertLess(len(colours), 50, "more blocks than a mask leaves")
        self.assertGreater(len({tuple(pixel) for pixel in seen.reshape(-1, 3)}), 100)

    def test_without_privacy_the_picture_is_what_the_camera_saw(self):
        picture, seen = self.picture_of_a_face(privacy=False)
        self.assertTrue(numpy.array_equal(picture, seen))

    def test_without_a_detector_of_faces_the_load_fails_with_one_sentence(self):
        detector = self.make_detector()
        loader = detector.load(privacy_finder="cascades", privacy_cascades="/nowhere")
        self.assertNotEqual(loader.wait(60), 0)
        eventually(lambda: "cascade '/nowhere/" in detector.output(), "the sentence")

    def test_other_encodings_work_and_unusable_images_are_dropped_and_counted(self):
        detector = self.loaded_detector(queue_size=100)
        blue = image(0, (16, 8, (255, 0, 0)))
        blue.encoding = "rgb8"  # the first channel is red then
        grey = Image(width=WIDTH, height=HEIGHT, encoding="mono8", step=WIDTH,
                     data=bytes(WIDTH * HEIGHT))
        grey.header.stamp = rospy.Time(1600000000, 1000)
        unknown = image(2)
        unknown.encoding = "no encoding"
        short = image(3)
        short.data = short.data[:100]
        empty = Image(encoding="bgr8")
        for frame in [unknown, short, empty, blue, grey]:
            detector.publisher.publish(frame)
        detector.wait_for(frames_in=5, frames_processed=2, frames_dropped=3, frames_unusable=3,
                          frames_waiting=0)
        answers = detector.answers()
        self.assertEqual([len(answer.detections) for answer in answers], [1, 0])
        self.assertEqual(detector.output().count("dropped an image"), 1, detector.output())

    def test_in_is_processed_plus_dropped_under_overload(self):
        detector = self.loaded_detector(queue_size=1)
        detector.signal_manager(signal.SIGSTOP)
        for number in range(BURST):
            detector.publisher.publish(image(number, (16, 8, RED)))
        detector.signal_manager(signal.SIGCONT)
        detector.wait_for(frames_in=BURST, frames_waiting=0)
        values = {key: int(value) for key, value in detector.diagnostics().items()
                  if key.startswith("frames_")}
        self.assertEqual(values["frames_processed"] + values["frames_dropped"], BURST)
        self.assertGreater(values["frames_dropped"], 0)
        answers = eventually(lambda: len(detector.answers()) >= values["frames_processed"]
                             and detector.answers(), "an answer for each processed frame")
        self.assertEqual(len(answers), values["frames_processed"])
        stamps = [answer.header.stamp for answer in answers]
        self.assertEqual(stamps, sorted(set(stamps)), "each frame once, in order")
        self.assertEqual(stamps[-1], rospy.Time(1600000000, 1000 * (BURST - 1)), "the newest stays")

    def test_stamps_stay_in_order_under_an_uneven_worker_pool(self):
        detector = self.loaded_detector(queue_size=100, engines=3, threads=1)
        # Every fourth image has a thousand times the pixels, whose colours must be swapped too.
        large = numpy.zeros((1500, 2000, 3), numpy.uint8)
        large[:, :1000] = (255, 0, 0)
        large = large.tobytes()
        frames = []
        for number in range(48):
            frame = image(number, (16, 8, RED))
            if number % 4 == 0:
                frame.width, frame.height, frame.step, frame.encoding = 2000, 1500, 6000, "rgb8"
                frame.data = large
            frames.append(frame)
        unusable = frames[5]
        unusable.encoding = "no encoding"
        for frame in frames:
            detector.publisher.publish(frame)
        detector.wait_for(frames_in=48, frames_processed=47, frames_dropped=1, frames_waiting=0, engines=3)
        answers = eventually(lambda: len(detector.answers()) >= 47 and detector.answers(), "47 answers")
        self.assertEqual([answer.header.stamp for answer in answers],
                         [frame.header.stamp for frame in frames if frame is not unusable])
        times = [answer.inference_ms for answer in answers]
        self.assertGreater(max(times), 2 * min(times), "the engines' work was even")

    def test_both_engines_find_the_same(self):
        found = {}
        for engine in ("opencv", "torch"):
            detector = self.loaded_detector(queue_size=100, engine=engine)
            detector.publisher.publish(image(0, (16, 8, RED), (40, 32, GREEN)))
            answer = eventually(detector.answers, "an answer")[0]
            detector.wait_for(engine=engine)
            found[engine] = [(each.class_name, each.confidence, each.x_min, each.y_min, each.x_max, each.y_max)
                             for each in answer.detections]
        self.assertEqual(len(found["opencv"]), 2)
        for one, other in zip(found["opencv"], found["torch"]):
            self.assertEqual(one[0], other[0])
            numpy.testing.assert_allclose(one[1:], other[1:], atol=1e-3)

    def test_an_object_in_many_images_is_one_event_with_the_stamp_of_its_best_view(self):
        detector = self.loaded_detector(queue_size=100, track_max_delay_s=0.3)
        events = detector.subscribe("hazard/events", DetectionArray)
        eventually(lambda: events.get_num_connections() > 0, "the events' topic")
        for number in range(8):
            frame = image(number, (16, 8, RED))
            frame.header.stamp = rospy.Time(1600000000 + number // 10, 100000000 * (number % 10))
            detector.publisher.publish(frame)
        detector.wait_for(frames_processed=8, events=1, tracks=1)
        event = eventually(lambda: detector.received("hazard/events"), "an event")[0]
        self.assertEqual(len(detector.received("hazard/events")), 1)
        self.assertEqual([found.class_name for found in event.detections], ["pothole"])
        # All views are equally good: the first one is the best.
        self.assertEqual(event.header.stamp, rospy.Time(1600000000))
        self.assertEqual((event.header.frame_id, event.image_width), ("camera_optical_frame", WIDTH))
        self.assertEqual(len(detector.answers()), 8)

    def test_without_tracking_nothing_speaks_on_the_events_topic(self):
        detector = self.loaded_detector(queue_size=100, tracking=False)
        events = detector.subscribe("hazard/events", DetectionArray)
        detector.publisher.publish(image(0, (16, 8, RED)))
        detector.wait_for(frames_processed=1, detections=1)
        self.assertEqual(events.get_num_connections(), 0)

    def test_names_the_best_views_of_what_it_follows_until_their_event_is_out(self):
        detector = self.loaded_detector(queue_size=100, track_max_delay_s=0.3)
        events = detector.subscribe("hazard/events", DetectionArray)
        best_views = detector.subscribe("hazard/best_views", BestViews)
        eventually(lambda: events.get_num_connections() > 0 and best_views.get_num_connections() > 0, "the topics")
        for number in range(8):
            frame = image(number, (16, 8, RED))
            frame.header.stamp = rospy.Time(1600000000, 100000000 * number)
            detector.publisher.publish(frame)
        detector.wait_for(frames_processed=8, events=1)
        event = eventually(lambda: detector.received("hazard/events"), "an event")[0]
        told = eventually(lambda: len(detector.received("hazard/best_views")) == 8
                          and detector.received("hazard/best_views"), "the best views after each image")
        named = [message.stamps for message in told]
        self.assertEqual(named[0], [event.header.stamp], "all views are equally good: the first one is the best")
        last = max(index for index, stamps in enumerate(named) if event.header.stamp in stamps)
        self.assertEqual(named[:last + 1], [[event.header.stamp]] * (last + 1))
        self.assertLess(last, 7, "an object that was reported needs no image any more")

    def test_the_number_of_kept_images_is_refused_with_who_keeps_them_now(self):
        detector = self.make_detector()
        loader = detector.load(picture_frames=64)
        self.assertNotEqual(loader.wait(60), 0)
        eventually(lambda: "picture_frames' is no longer accepted: hazard_reporting keeps" in detector.output(),
                   "the sentence")

    def test_a_bad_manifest_fails_the_load_with_one_sentence_and_the_manager_lives(self):
        detector = self.make_detector()
        with open(TINY_MODEL, encoding="utf-8") as file:
            manifest = yaml.safe_load(file)
        folder = tempfile.mkdtemp(prefix="livemap_manifest_")
        bad = os.path.join(folder, "bad.yaml")
        for key, value, expected in [
                ("sha256", "0" * 64, "has SHA-256"), ("nms_iou", float("nan"), "nms_iou is"),
                ("file", "nowhere.onnx", "nowhere.onnx")]:
            with open(bad, "w", encoding="utf-8") as file:
                yaml.safe_dump({**manifest, "file": TINY_MODEL.replace(".yaml", ".onnx"), key: value},
                               file)
            loader = detector.load(model=bad)
            self.assertNotEqual(loader.wait(60), 0)
            said = [line for line in detector.output().splitlines()
                    if "hazard_detection: " in line and expected in line]
            self.assertEqual(len(said), 1, detector.output())
        for parameters, expected in [({"model": ""}, "is empty, accepted is the path"),
                                     ({"queue_sise": 3}, "unknown parameter"),
                                     ({"queue_size": 0}, "a whole number from 1"),
                                     ({"engines": 0}, "a whole number from 1"),
                                     ({"engine": "abacus"}, "accepted are auto, opencv and torch")]:
            self.assertNotEqual(detector.load(**parameters).wait(60), 0)
            self.assertIn(expected, detector.output())
        self.assertIsNone(detector.manager.poll(), detector.output())
        detector.load_and_wait()
        detector.publisher.publish(image(0))
        eventually(detector.answers, "an answer from the good one")


if __name__ == "__main__":
    rospy.init_node("hazard_detection_test")
    rostest.rosrun("livemap", "hazard_detection", HazardDetectionTest, sys.argv)
