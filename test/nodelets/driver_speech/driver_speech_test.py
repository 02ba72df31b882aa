#!/usr/bin/python3
"""driver_speech in a process of its own with a real speech-dispatcher: what the driver hears, and in which order."""

import os
import sys
import tempfile
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, os.pardir, "support"))
from livemap.msg import HazardAlert  # noqa: E402
from node_testing import NodeletUnderTest, eventually  # noqa: E402
from speech_dispatcher import SpeechDispatcher, alsa_config  # noqa: E402


def alert(number, class_name="pothole", urgency=3, state=HazardAlert.APPROACH, side=HazardAlert.AHEAD, distance=2000):
    """Far enough that the time of a test does not change what is said of its distance."""
    message = HazardAlert(class_name=class_name, urgency=urgency, state=state, side=side)
    message.header.stamp = rospy.Time.now()
    message.hazard_uuid = bytes([number] * 16)
    if state == HazardAlert.APPROACH:
        message.distance, message.seconds, message.probability = distance, 1000, 0.9
    return message


class DriverSpeechTest(unittest.TestCase):
    """Each test has a nodelet of its own in a namespace of its own."""

    def setUp(self):
        name = self.id().rsplit(".", 1)[-1]
        self.node = NodeletUnderTest(name, "driver_speech")
        self.addCleanup(self.node.stop)
        self.alerts = self.node.advertise("hazard/alert", HazardAlert)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def speech_dispatcher(self, **options):
        server = SpeechDispatcher(**options)
        self.addCleanup(server.stop)
        os.environ["SPEECHD_ADDRESS"] = server.address
        return server

    def start(self, hears, **parameters):
        parameters.setdefault("diagnostics_period_s", 0.1)
        parameters.setdefault("begin_timeout_s", 10)
        rospy.set_param(f"/{self.node.name}/driver_speech", parameters)
        self.node.start_nodelet("driver_speech", "standalone", "livemap/DriverSpeechNodelet")
        eventually(lambda: self.alerts.get_num_connections(), "the nodelet listens: " + self.node.output())
        self.node.wait_for(voice=hears)

    def test_one_sentence_after_the_other_and_the_most_urgent_next(self):
        os.environ["ALSA_CONFIG_PATH"] = alsa_config(self.folder, os.path.join(self.folder, "sound"))
        server = self.speech_dispatcher()
        self.start("speech", language="de")
        self.alerts.publish(alert(1, "traffic_cone", 2))
        eventually(lambda: server.said(), "the first sentence begins")
        self.alerts.publish(alert(2, "pothole", 3, side=HazardAlert.LEFT))
        self.alerts.publish(alert(3, "deer", 1, side=HazardAlert.RIGHT))
        self.node.wait_for(said=3)
        self.assertEqual(server.said(), [f"{edge} {sentence}" for sentence in (
            "Leitkegel in 2000 Metern.", "Wild in 2000 Metern, rechts.", "Schlagloch in 2000 Metern, links.")
            for edge in ("begin", "end")])

    def test_a_hazard_that_is_removed_is_not_announced(self):
        os.environ["ALSA_CONFIG_PATH"] = alsa_config(self.folder, os.path.join(self.folder, "sound"))
        server = self.speech_dispatcher(seconds=4)
        self.start("speech")
        self.alerts.publish(alert(1))
        eventually(lambda: server.said(), "the first sentence begins")
        self.alerts.publish(alert(2, "barrier"))
        self.alerts.publish(alert(2, "barrier", state=HazardAlert.CANCELLED))
        self.alerts.publish(alert(1, state=HazardAlert.CANCELLED))
        self.alerts.publish(alert(3, "debris"))
        self.node.wait_for(withdrawn=1, interrupted=1, said=1)
        self.assertEqual(server.said(), ["begin Pothole in 2000 metres.", "begin Debris on the road in 2000 metres.",
                                         "end Debris on the road in 2000 metres."])

    def test_espeak_speaks_to_the_sound_device(self):
        sound = os.path.join(self.folder, "sound")
        os.environ["ALSA_CONFIG_PATH"] = alsa_config(self.folder, sound)
        self.speech_dispatcher(synthesizer=True)
        self.start("speech", language="pt")
        before = os.path.getsize(sound)
        self.alerts.publish(alert(1))
        self.node.wait_for(said=1)
        self.assertGreater(os.path.getsize(sound), before + 20000)

    def test_without_words_a_tone_is_heard(self):
        sound = os.path.join(self.folder, "sound")
        os.environ["ALSA_CONFIG_PATH"] = alsa_config(self.folder, sound)
        self.start("tone", voice="tone")
        before = os.path.getsize(sound)
        self.alerts.publish(alert(1))
        self.node.wait_for(said=1)
        self.assertGreater(os.path.getsize(sound), before + 15000)

    def test_without_a_sound_device_the_diagnostics_say_so(self):
        os.environ["ALSA_CONFIG_PATH"] = alsa_config(self.folder)
        os.environ["SPEECHD_ADDRESS"] = f"unix_socket:{self.folder}/nowhere/socket"
        self.start("none")
        self.alerts.publish(alert(1))
        self.node.wait_for(failed=1)
        self.assertIn("speech-dispatcher", self.node.diagnostics()["silent_1"])
        self.assertIn("sound device", self.node.diagnostics()["silent_2"])

    def test_a_language_that_lacks_a_class_is_refused_by_name(self):
        path = os.path.join(self.folder, "xx.txt")
        with open(path, "w", encoding="utf-8") as file:
            file.write("language = xx\nahead = {hazard} {metres}\n")
        rospy.set_param(f"/{self.node.name}/driver_speech", {"language_file": path})
        self.node.start_nodelet("driver_speech", "standalone", "livemap/DriverSpeechNodelet")
        eventually(lambda: f"{path}, line 2" in self.node.output(), "the refusal")


if __name__ == "__main__":
    rospy.init_node("driver_speech_test")
    rostest.rosrun("livemap", "driver_speech", DriverSpeechTest)
