#!/usr/bin/python3
"""An official asks for the whole frame of a hazard: the next vehicle that passes brings it.

Everything is real: ROS masters, mosquitto, the zone with its store and web server, both vehicles' nodelets with their
masks. The first vehicle replays the committed drive, whose labels stand in for the detector, and reports; the second
one drives the same way later and is asked.
"""

import json
import pathlib
import sys
import tempfile
import unittest
import urllib.error
import urllib.request

import cv2
import numpy
import rospy
import rostest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts" / "lib"), str(ROOT / "test" / "support")]
import demo_observers as observers  # noqa: E402
import demo_system as system  # noqa: E402
import listening_port  # noqa: E402
from node_testing import eventually  # noqa: E402

ZONE, FIRST, SECOND = "test", "car-1", "car-2"
OFFICIAL, TOKEN = "miller", "correct-horse-battery-staple"
FRAME_BYTES = 60000
# What a report's picture of the same image shows (imaging::kMinCropPx).
CROP_PX = 480


class FrameRequestTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.directory = pathlib.Path(tempfile.mkdtemp(prefix="frame-request-"))
        tokens = cls.directory / "officials"
        tokens.write_text(f"{OFFICIAL} {TOKEN}\n")
        tokens.chmod(0o600)
        cls.live_map = system.LiveMapSystem(cls.directory, ZONE, f"{FIRST},{SECOND}")
        cls.live_map.zone_parameters = (f"{{replay: true, web_token_file: {tokens}, "
                                        f"poll_frame_bytes: {FRAME_BYTES}.0}}")
        cls.live_map.start_zone()
        cls.map = observers.MapClient(cls.live_map.url)

    @classmethod
    def tearDownClass(cls):
        cls.live_map.__exit__()

    def drive(self, vehicle, hazard_reporting):
        """Replays the committed drive as this vehicle, from now on."""
        if "vehicle" in self.live_map.processes:
            self.live_map.stop("vehicle")
        self.live_map.vehicle = vehicle
        self.live_map.vehicle_port = listening_port.free_port()
        self.live_map.vehicle_master = f"http://127.0.0.1:{self.live_map.vehicle_port}"
        self.live_map.start_vehicle(system.package_file("rosbags/town.bag"), 1.0, use_truth="true", vo="false", delay=0,
                                    directory=self.directory / vehicle, hazard_reporting=hazard_reporting)
        self.live_map.play()

    def ask(self, path, body=None):
        """Status and answer."""
        headers = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}
        request = urllib.request.Request(self.live_map.url + path, headers=headers,
                                         data=None if body is None else json.dumps(body).encode())
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                return answer.status, answer.read()
        except urllib.error.HTTPError as refusal:
            return refusal.code, refusal.read()

    def json(self, path, body=None, status=200):
        found, answer = self.ask(path, body)
        self.assertEqual(found, status, answer)
        return json.loads(answer)

    def size_of(self, path):
        status, picture = self.ask(path.lstrip("/"))
        self.assertEqual(status, 200, path)
        return cv2.imdecode(numpy.frombuffer(picture, numpy.uint8), cv2.IMREAD_COLOR).shape[1::-1]

    def frame(self, hazard):
        return self.json(f"api/v1/hazards/{hazard}/frame")

    def test_the_next_vehicle_that_passes_brings_the_whole_frame(self):
        self.drive(FIRST, "{privacy: false, settle_wait_s: 0.0}")
        hazards = eventually(lambda: len(found := self.map.stored_hazards()) >= 3 and found, "three hazards on the map")
        ids = [hazard["id"] for hazard in hazards]
        # The first vehicle must not be the one that is asked: it has passed, or is stopped.
        self.live_map.stop("vehicle")
        self.assertEqual(self.ask(f"api/v1/hazards/{ids[0]}/frame", {"reason": 7})[0], 400)
        for hazard in ids:
            self.assertEqual(self.frame(hazard)["state"], "none")
            self.json(f"api/v1/hazards/{hazard}/frame", {"reason": "is it water or a hole?"})
            self.assertEqual(self.frame(hazard)["state"], "waiting")
        self.json(f"api/v1/hazards/{ids[0]}/frame", {}, status=409)

        self.drive(SECOND, "{picture_wait_s: 10.0}")
        taken = eventually(lambda: [one for one in map(self.frame, ids) if one["state"] == "taken"],
                           "a frame for one of the requests")[0]
        hazard, picture = taken["id"], taken["picture"]
        self.assertEqual(taken["official"], OFFICIAL)
        self.assertIn(picture["answer"], ("yes", "no", "cant_see"))
        whole = self.size_of(picture["image"])
        told = self.json(f"api/v1/hazards/{hazard}/sightings")
        self.assertEqual([one["image"] for one in told["answers"] if one["whole_frame"]], [picture["image"]])
        report = next(one["image"] for one in told["sightings"] if one["image"])
        # Smaller where so many pixels do not fit into a report's bytes.
        width = self.size_of(report)[0]
        self.assertTrue(CROP_PX / 2 < width <= CROP_PX, f"a report's picture has {width} pixels")
        self.assertGreater(whole[0], CROP_PX, "the camera's whole image")
        self.assertAlmostEqual(whole[0] / whole[1], 640 / 400, 1)
        sizes = [path.stat().st_size for path in (self.directory / "zone" / "images").rglob("*.jpeg")]
        self.assertLessEqual(max(sizes), FRAME_BYTES)
        trail = self.json(f"api/v1/decisions?hazard={hazard}")["decisions"]
        self.assertEqual([(one["decision"], one["official"], one["reason"]) for one in trail],
                         [("frame", OFFICIAL, "is it water or a hole?")])


if __name__ == "__main__":
    rospy.init_node("frame_request_test")
    rostest.rosrun("livemap", "frame_request", FrameRequestTest)
