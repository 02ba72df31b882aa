#!/usr/bin/python3
"""driver_alert in a process of its own: a vehicle that drives north at 10 m/s, and what its driver is told."""

import os
import sys
import tempfile
import unittest

import rospy
import rostest
from sensor_msgs.msg import NavSatFix, NavSatStatus

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from hazard_reporting_fixture import place, stamp  # noqa: E402
from livemap.msg import HazardAlert, HazardNotice  # noqa: E402
from node_testing import NodeletUnderTest, eventually  # noqa: E402
from nodelet_manager import NodeletManager  # noqa: E402

SPEED_MPS = 10.0


def fix(time_s):
    message = NavSatFix()
    message.header.stamp = stamp(time_s)
    message.status.status = NavSatStatus.STATUS_FIX
    message.latitude, message.longitude = place(0, SPEED_MPS * time_s)
    message.position_covariance = [1, 0, 0, 0, 1, 0, 0, 0, 4]
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return message


def notice(number, sequence, north_m, east_m=0.0, class_name="pothole", action=HazardNotice.ADDED):
    message = HazardNotice(schema_version=HazardNotice.SCHEMA_VERSION, action=action, sequence=sequence,
                           previous_sequence=sequence - 1, class_name=class_name, confidence=0.9, sightings=2)
    message.hazard_uuid = bytes([number] * 16)
    message.stamp = message.first_seen = message.last_seen = stamp(0)
    message.latitude, message.longitude = place(east_m, north_m)
    message.covariance = [1, 0, 0, 1]
    return message


class DriverAlertTest(unittest.TestCase):
    """Each test has a nodelet of its own in a namespace of its own."""

    def setUp(self):
        name = self.id().rsplit(".", 1)[-1]
        self.node = NodeletUnderTest(name, "driver_alert")
        self.addCleanup(self.node.stop)
        self.node.subscribe("hazard/alert", HazardAlert)
        self.fixes = self.node.advertise("fix", NavSatFix)
        self.notices = self.node.advertise("hazard/notice", HazardNotice)
        self.sent = self.told = 0

    def start(self, **parameters):
        parameters.setdefault("diagnostics_period_s", 0.1)
        rospy.set_param(f"/{self.node.name}/driver_alert", parameters)
        self.node.start_nodelet("driver_alert", "standalone", "livemap/DriverAlertNodelet")
        eventually(lambda: self.fixes.get_num_connections() and self.notices.get_num_connections(),
                   "the nodelet listens: " + self.node.output())

    def tell(self, *notices):
        for each in notices:
            self.notices.publish(each)
        self.told += len(notices)
        self.node.wait_for(notices=self.told)

    def drive(self, from_s, to_s):
        """Five fixes a second, all of which the nodelet has worked off at the end."""
        for i in range(round(5 * from_s), round(5 * to_s)):
            self.fixes.publish(fix(i / 5))
            self.sent += 1
            rospy.sleep(0.002)
        self.node.wait_for(fixes=self.sent)

    def alerts(self):
        return [(each.hazard_uuid[0], each.state) for each in self.node.received("hazard/alert")]

    def test_approach_comes_before_passing(self):
        self.start()
        self.tell(notice(1, 1, 200), notice(2, 2, 205, class_name="debris"), notice(3, 3, 200, east_m=40),
                  notice(4, 4, 500))
        self.drive(1, 24)
        eventually(lambda: len(self.alerts()) >= 4, "four alerts")
        self.assertEqual(sorted(self.alerts()[:2]), [(1, HazardAlert.APPROACH), (2, HazardAlert.APPROACH)])
        self.assertEqual(self.alerts()[2:], [(1, HazardAlert.PASSED), (2, HazardAlert.PASSED)])
        first = self.node.received("hazard/alert")[0]
        self.assertGreaterEqual(first.seconds, 4)
        self.assertLess(first.seconds, 8)
        self.assertAlmostEqual(first.distance, 10 * first.seconds, delta=10)
        self.assertEqual(first.side, HazardAlert.AHEAD)
        self.assertGreater(first.header.stamp, stamp(12))

    def test_a_hazard_that_is_removed_is_cancelled_or_never_told(self):
        self.start()
        self.tell(notice(1, 1, 200), notice(2, 2, 300))
        self.drive(1, 17)
        eventually(lambda: self.alerts() == [(1, HazardAlert.APPROACH)], "the first alert")
        self.tell(notice(1, 3, 200, action=HazardNotice.REMOVED), notice(2, 4, 300, action=HazardNotice.REMOVED))
        self.drive(17, 35)
        self.assertEqual(self.alerts(), [(1, HazardAlert.APPROACH), (1, HazardAlert.CANCELLED)])

    def test_what_the_local_map_knows_is_told_after_a_restart(self):
        with tempfile.TemporaryDirectory() as folder:
            database = os.path.join(folder, "hazards.sqlite3")
            manager = NodeletManager("map_keeper")
            self.addCleanup(manager.stop)
            self.assertTrue(manager.load("hazard_reporting", "hazard_reporting", {"database": database},
                                         {"/hazard/notice": f"/{self.node.name}/hazard/notice"}), manager.output())
            eventually(lambda: self.notices.get_num_connections(), "the map's keeper listens")
            self.notices.publish(notice(1, 1, 200))
            self.start(database=database, database_period_s=0.2)
            self.node.wait_for(hazards=1)
            self.drive(1, 24)
            eventually(lambda: self.alerts() == [(1, HazardAlert.APPROACH), (1, HazardAlert.PASSED)], "alerts")

    def test_a_wrong_parameter_is_refused_by_name(self):
        rospy.set_param(f"/{self.node.name}/driver_alert", {"alert_above": 2.0})
        self.node.start_nodelet("driver_alert", "standalone", "livemap/DriverAlertNodelet")
        eventually(lambda: "alert_above" in self.node.output(), "the refusal")


if __name__ == "__main__":
    rospy.init_node("driver_alert_test")
    rostest.rosrun("livemap", "driver_alert", DriverAlertTest)
