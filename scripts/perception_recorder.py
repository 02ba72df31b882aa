#!/usr/bin/python3
"""Writes down, with the wall time, what a vehicle or a zone says of hazards: one line of JSON a message.

Topics are found by their type, so whoever publishes a report, its receipt, detections or candidate frames is heard.
"""

import argparse
import json
import os
import signal
import sys
import threading
import time

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock

from livemap.msg import DetectionArray, HazardReport, ReportReceipt

LOOK_AGAIN_S = 0.5


def boxes_of(message):
    return [[d.class_name, round(d.confidence, 4), d.x_min, d.y_min, d.x_max, d.y_max] for d in message.detections]


def told_detections(message):
    return {"stamp": message.header.stamp.to_nsec(), "ms": message.inference_ms, "boxes": boxes_of(message)}


def told_report(message):
    return {"stamp": message.stamp.to_nsec(), "uuid": message.uuid.hex(), "class": message.class_name,
            "box": [message.x_min, message.y_min, message.x_max, message.y_max], "picture": len(message.image.data)}


def told_receipt(message):
    return {"uuid": message.report_uuid.hex(), "committed": message.status == ReportReceipt.COMMITTED}


def told_judging(message):
    """A period's mean time per picture that the early discard judged; None where there was none."""
    times = [float(value.value) for status in message.status for value in status.values if value.key == "judging_ms"]
    return {"ms": times[0]} if times and times[0] > 0 else None


KINDS = {"livemap/DetectionArray": ("detections", DetectionArray, told_detections),
         "livemap/HazardReport": ("report", HazardReport, told_report),
         "livemap/ReportReceipt": ("receipt", ReportReceipt, told_receipt),
         "diagnostic_msgs/DiagnosticArray": ("judging", DiagnosticArray, told_judging)}
try:  # Only a vehicle without a detector of its own sends these.
    from livemap.msg import CandidateFrame
    KINDS["livemap/CandidateFrame"] = ("candidate", CandidateFrame, lambda message: {"stamp": message.stamp.to_nsec()})
except ImportError:
    pass


class Recorder:
    """Listens on the ROS master of this process until it is closed."""

    def __init__(self, path):
        self.file = open(path, "w", encoding="ascii")
        self.lock = threading.Lock()
        self.heard = set()
        self.clocks = 0
        self.ended = threading.Event()
        self.master = rosgraph.Master("/perception_recorder")
        rospy.Subscriber("/clock", Clock, self._take_clock, queue_size=1000)
        self.look()
        self.looking = threading.Thread(target=self._look_again, daemon=True)
        self.looking.start()

    def look(self):
        for topic, kind in self.master.getTopicTypes():
            # The truth is in the drive itself.
            if kind in KINDS and topic not in self.heard and not topic.startswith("/ground_truth"):
                self.heard.add(topic)
                name, message, told = KINDS[kind]
                rospy.Subscriber(topic, message, self._taker(topic, name, told), queue_size=10000, tcp_nodelay=True)

    def close(self):
        self.ended.set()
        self.looking.join()
        with self.lock:
            self.file.close()

    def _look_again(self):
        while not self.ended.wait(LOOK_AGAIN_S):
            self.look()

    def _taker(self, topic, name, told):
        def take(message):
            said = told(message)
            if said is not None:
                self._write({"topic": topic, "kind": name, **said})
        return take

    def _take_clock(self, message):
        self.clocks += 1
        if self.clocks % 10 == 1:
            self._write({"kind": "clock", "stamp": message.clock.to_nsec()})

    def _write(self, entry):
        wall = time.time()
        with self.lock:
            if not self.file.closed:
                self.file.write(json.dumps({"wall": wall, **entry}) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--master", required=True, help="URI of the ROS master")
    parser.add_argument("--out", required=True, metavar="FILE")
    options = parser.parse_args()
    os.environ["ROS_MASTER_URI"], os.environ["ROS_HOSTNAME"] = options.master, "127.0.0.1"
    rospy.init_node("perception_recorder", anonymous=True, disable_signals=True)
    recorder = Recorder(options.out)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    print("recording", flush=True)
    while not ended.wait(0.5):
        pass
    recorder.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
