#!/usr/bin/python3
"""A street full of things, shown to one vehicle: fixes, and detections with pictures while told so.

Reads `go`, `rest` and `end`, a line each, from standard input; says `connected` once somebody listens to all it has.
Two feeders with the same start and seed drive the same street, so that some things are seen by both vehicles.
"""

import argparse
import pathlib
import random
import sys
import threading
import time

import numpy
import rospy
from sensor_msgs.msg import CameraInfo, Image, NavSatFix

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import hazard_reporting_fixture as street  # noqa: E402
from livemap.msg import DetectionArray  # noqa: E402

FIXES_PER_S = 10
AHEAD_M = (8.0, 9.5, 11.0, 12.5)
# A class comes again after this many things: hundreds of metres later.
CLASSES = 400
PICTURE_WIDTH, PICTURE_HEIGHT = 96, 64


def seen_by(seed, number):
    """Which of the two vehicles look at the thing: one of them, or both."""
    return random.Random(f"{seed} {number}").choice([(0,), (1,), (0, 1)])


class Feeder:
    def __init__(self, options):
        self.options = options
        street.EPOCH_S = options.start
        self.going = False
        self.publishers = {
            topic: rospy.Publisher(topic, message_class, queue_size=50, latch=latch)
            for topic, message_class, latch in [
                ("hazard/detections", DetectionArray, False), ("camera_rect/image", Image, False),
                ("fix", NavSatFix, False), ("camera_rect/camera_info", CameraInfo, True)]}
        self.publishers["camera_rect/camera_info"].publish(self.camera())

    @staticmethod
    def camera():
        info = CameraInfo(width=street.WIDTH, height=street.HEIGHT, distortion_model="plumb_bob")
        centre_u, centre_v = street.WIDTH / 2 - 0.5, street.HEIGHT / 2 - 0.5
        info.K = [street.FOCAL_PX, 0, centre_u, 0, street.FOCAL_PX, centre_v, 0, 0, 1]
        info.P = [street.FOCAL_PX, 0, centre_u, 0, 0, street.FOCAL_PX, centre_v, 0, 0, 0, 1, 0]
        info.header.frame_id = street.OPTICAL
        return info

    def picture(self, time_s):
        message = street.camera_image(time_s)
        message.width, message.height, message.step = PICTURE_WIDTH, PICTURE_HEIGHT, 3 * PICTURE_WIDTH
        noise = numpy.random.default_rng(int(time_s * 1000)).integers(0, 256, PICTURE_HEIGHT * message.step, numpy.uint8)
        message.data = noise.tobytes()
        return message

    def things(self, tick):
        first = tick * self.options.things
        return [street.detection(AHEAD_M[number % len(AHEAD_M)], class_name=f"thing_{number % CLASSES}")
                for number in range(first, first + self.options.things)
                if self.options.vehicle in seen_by(self.options.seed, number)]

    def drive(self):
        """Real time, so that stamps fit the zone's clock. An image lies between two fixes."""
        tick = round((time.time() - self.options.start) * FIXES_PER_S)
        while not rospy.is_shutdown():
            tick += 1
            time.sleep(max(0.0, self.options.start + tick / FIXES_PER_S - time.time()))
            self.publishers["fix"].publish(street.fix(tick / FIXES_PER_S))
            if self.going and tick % 2 == 0:
                time_s = (tick - 0.5) / FIXES_PER_S
                self.publishers["camera_rect/image"].publish(self.picture(time_s))
                self.publishers["hazard/detections"].publish(street.detections(time_s, *self.things(tick)))

    def connected(self):
        return all(publisher.get_num_connections() > 0 for publisher in self.publishers.values())


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicle", type=int, choices=(0, 1), required=True, help="which of the two this is")
    parser.add_argument("--start", type=int, required=True, help="s since 1970: when the drive began")
    parser.add_argument("--seed", required=True)
    parser.add_argument("--things", type=int, default=3, help="per image; five images a second")
    return parser.parse_args()


def main():
    options = parse_arguments()
    rospy.init_node("feeder", disable_signals=True)
    feeder = Feeder(options)
    threading.Thread(target=feeder.drive, daemon=True).start()
    while not feeder.connected():
        time.sleep(0.05)
    print("connected", flush=True)
    for line in sys.stdin:
        command = line.strip()
        if command == "end":
            break
        feeder.going = command == "go"
    rospy.signal_shutdown("told so")


if __name__ == "__main__":
    main()
