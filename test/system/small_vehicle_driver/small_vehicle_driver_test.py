#!/usr/bin/python3
"""A small vehicle as the launch file starts it, which detects nothing itself: its driver hears and sees what the zone
announced on its way, in that order, and no more of it when it is passed or removed."""

import json
import os
import pathlib
import signal
import sys
import tempfile
import threading
import unittest
import urllib.request

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import NavSatFix, NavSatStatus

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "scripts" / "lib"), str(ROOT / "test" / "support")]
import demo_system as system  # noqa: E402
from hazard_reporting_fixture import place  # noqa: E402
from livemap.msg import HazardNotice  # noqa: E402
from node_testing import eventually, start_child  # noqa: E402
from speech_dispatcher import SpeechDispatcher, alsa_config  # noqa: E402

SPEED_MPS, RATE_HZ = 12.0, 5.0


def notice(number, sequence, class_name, north_m, action=HazardNotice.ADDED):
    message = HazardNotice(schema_version=HazardNotice.SCHEMA_VERSION, action=action, sequence=sequence,
                           previous_sequence=sequence - 1, class_name=class_name, confidence=0.9, sightings=2)
    message.hazard_uuid = bytes([number] * 16)
    message.stamp = message.first_seen = message.last_seen = rospy.Time.now()
    message.latitude, message.longitude = place(0, north_m)
    message.covariance = [1, 0, 0, 1]
    return message


class SmallVehicleDriverTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        os.environ["ALSA_CONFIG_PATH"] = alsa_config(folder.name, os.path.join(folder.name, "sound"))
        self.speech = SpeechDispatcher(0.3)
        self.addCleanup(self.speech.stop)
        os.environ["SPEECHD_ADDRESS"] = self.speech.address
        self.address = None
        rospy.Subscriber("/diagnostics", DiagnosticArray, self.on_diagnostics)
        self.fixes = rospy.Publisher("/fix", NavSatFix, queue_size=10)
        self.notices = rospy.Publisher("/hazard/notice", HazardNotice, queue_size=10)
        self.log = open(os.path.join(folder.name, "log"), "w+", encoding="utf-8")
        self.vehicle = start_child(
            ["roslaunch", system.launch_file("vehicle.launch"), "profile:=small", "speech:=true", "page:=true",
             f"directory:={folder.name}", "broker_port:=1", "driver_page:={page_port: 0, period_s: 0.1}",
             "driver_speech:={begin_timeout_s: 20.0}"],
            stdout=self.log, stderr=self.log)
        self.addCleanup(self.stop)
        eventually(lambda: self.address, "the page has an address")
        eventually(lambda: self.notices.get_num_connections() and self.page()["alerts"] and self.page()["reports"],
                   "driver_alert and hazard_reporting run")

    def stop(self):
        self.vehicle.send_signal(signal.SIGINT)
        self.vehicle.wait()
        self.log.close()

    def on_diagnostics(self, message):
        for status in message.status:
            if status.hardware_id == "driver_page":
                self.address = {pair.key: pair.value for pair in status.values}["address"]

    def page(self):
        with urllib.request.urlopen(self.address + "api/v1/driver", timeout=20) as answer:
            return json.load(answer)

    def drive(self, ended):
        """North, in real time, until it is told to end."""
        start = rospy.Time.now()
        rate = rospy.Rate(RATE_HZ)
        while not ended.is_set():
            now = rospy.Time.now()
            fix = NavSatFix(position_covariance=[1, 0, 0, 0, 1, 0, 0, 0, 4],
                            position_covariance_type=NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN)
            fix.header.stamp, fix.status.status = now, NavSatStatus.STATUS_FIX
            fix.latitude, fix.longitude = place(0, SPEED_MPS * (now - start).to_sec())
            self.fixes.publish(fix)
            rate.sleep()

    def test_the_driver_hears_and_sees_what_the_zone_announced(self):
        eventually(lambda: (self.page()["voice"] or {}).get("voice") == "speech", "the voice is ready")
        for each in (notice(1, 1, "pothole", 200), notice(2, 2, "deer", 420), notice(3, 3, "debris", 640)):
            self.notices.publish(each)
        self.notices.publish(notice(2, 4, "deer", 420, HazardNotice.REMOVED))
        eventually(lambda: (self.page()["alerts"] or {}).get("hazards") == 2, "two hazards are known")
        ended = threading.Event()
        driving = threading.Thread(target=self.drive, args=(ended,))
        driving.start()
        self.addCleanup(driving.join)
        self.addCleanup(ended.set)
        first = eventually(lambda: self.page()["hazards"], "the page shows the pothole")[0]
        self.assertEqual(first["class"], "pothole")
        nearer = eventually(lambda: [each for each in self.page()["hazards"] if each["distance_m"] < 0.6 * first["distance_m"]],
                            "the distance falls")[0]
        self.assertEqual(nearer["id"], first["id"])
        eventually(lambda: not self.page()["hazards"], "the pothole is passed")
        last = eventually(lambda: self.page()["hazards"], "the page shows the debris")[0]
        self.assertEqual(last["class"], "debris")
        said = eventually(lambda: [line for line in self.speech.said() if line.startswith("end")][1:], "two sentences")
        self.assertIn("Debris on the road in", said[0])
        self.assertEqual([line.split(" ")[1] for line in self.speech.said() if line.startswith("begin")],
                         ["Pothole", "Debris"])
        state = self.page()
        self.assertEqual((state["zone"]["connected"], state["receiver"]["fix"], state["reports"]["pending"]),
                         (False, True, 0))


if __name__ == "__main__":
    rospy.init_node("small_vehicle_driver_test")
    rostest.rosrun("livemap", "small_vehicle_driver", SmallVehicleDriverTest)
