#!/usr/bin/python3
"""The zone_cloudlet node with its store in a real server of PostgreSQL, which is killed, and so is the node."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request
import uuid

import rospy
import rostest
from livemap.msg import HazardReport, ReportReceipt

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))
from node_testing import PATIENCE_S, eventually, program  # noqa: E402
import postgresql_server  # noqa: E402


def make_report(number):
    report = HazardReport(schema_version=HazardReport.SCHEMA_VERSION, vehicle_id="car-1", drive_id="drive-1",
                          class_name="pothole", confidence=0.5, x_min=10, y_min=20, x_max=110, y_max=90,
                          latitude=40.44 + 1e-4 * number, longitude=-79.94, covariance=[1.0, 0.0, 0.0, 1.0],
                          image_width=640, image_height=480)
    report.uuid = uuid.uuid4().bytes
    report.stamp = rospy.Time.from_sec(time.time() - 1)
    return report


@unittest.skipUnless(postgresql_server.programs(), "skipped, no PostgreSQL server installed")
class ZonePostgresqlTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("zone_postgresql_test")
        cls.reports = rospy.Publisher("hazard/report", HazardReport, queue_size=1000)
        cls.answered = set()
        cls.receipts = rospy.Subscriber("hazard/receipt", ReportReceipt, cls.add, queue_size=10000)

    @classmethod
    def add(cls, receipt):
        if receipt.status == ReportReceipt.COMMITTED:
            cls.answered.add(bytes(receipt.report_uuid))

    def setUp(self):
        self.directory = tempfile.mkdtemp(prefix="livemap_zone_")
        self.addCleanup(shutil.rmtree, self.directory, ignore_errors=True)
        self.server = postgresql_server.PostgresqlServer()
        self.addCleanup(self.server.close)
        self.url = self.server.make_database("zone")
        self.process = None
        self.start()
        self.addCleanup(self.stop)

    def start(self):
        self.process = subprocess.Popen([program("livemap", "zone_cloudlet"), "__name:=zone_cloudlet", "_web_port:=0",
                                         f"_directory:={self.directory}/zone", f"_store_url:={self.url}",
                                         "_max_speed_mps:=10000.0"], start_new_session=True)
        eventually(lambda: self.reports.get_num_connections() == 1 and self.receipts.get_num_connections() == 1,
                   "the zone connects")

    def stop(self):
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait(PATIENCE_S)
        eventually(lambda: self.reports.get_num_connections() == 0, "the zone is gone")

    def send_until_answered(self, reports):
        """As vehicles do: what is not answered is sent again."""
        def unanswered():
            return [report for report in reports if bytes(report.uuid) not in self.answered]
        deadline = time.time() + PATIENCE_S
        while unanswered():
            self.assertLess(time.time(), deadline, f"{len(unanswered())} reports are never answered")
            for report in unanswered():
                self.reports.publish(report)
            time.sleep(0.5)

    def ask_readiness(self):
        """Status and body of /readyz."""
        port = rospy.get_param("/livemap/web_port")
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=PATIENCE_S) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as refusal:
            return refusal.code, json.load(refusal)

    def test_a_zone_that_hears_of_nothing_knows_that_its_server_is_away_and_that_it_is_back(self):
        eventually(lambda: self.ask_readiness() == (200, {"status": "ready"}), "the zone is ready")
        for how in (signal.SIGINT, signal.SIGKILL):
            self.server.kill(how)
            status, answer = eventually(lambda: [a for a in [self.ask_readiness()] if a[0] != 200], "not ready")[0]
            self.assertEqual(status, 503)
            self.assertIn("the store does not answer", answer["error"])
            self.server.start()
            eventually(lambda: self.ask_readiness()[0] == 200, "ready again")

    def count(self, table):
        return int(self.server.ask("zone", f"SELECT count(*) FROM {table}"))

    def test_nothing_that_was_answered_is_lost_when_the_server_or_the_zone_is_killed(self):
        reports = [make_report(number) for number in range(20)]
        self.send_until_answered(reports)
        for killed in ("server", "zone", "server"):
            more = [make_report(len(reports) + number) for number in range(20)]
            for report in more:
                self.reports.publish(report)
            if killed == "zone":
                self.stop()
                self.start()
            else:
                self.server.kill()
                unheard = [make_report(len(reports) + 20 + number) for number in range(3)]
                for report in unheard:
                    self.reports.publish(report)
                time.sleep(1)
                self.assertFalse({bytes(report.uuid) for report in unheard} & self.answered, "nobody has committed it")
                more += unheard
                self.server.start()
            self.send_until_answered(more)
            reports += more
            rows = self.server.ask("zone", "SELECT uuid FROM reports").splitlines()
            self.assertEqual(sorted(rows), sorted(str(uuid.UUID(bytes=bytes(report.uuid))) for report in reports),
                             f"each once after the {killed} was killed")
        self.assertEqual(self.count("events"), len(reports))
        self.assertFalse(os.path.exists(f"{self.directory}/zone/zone.sqlite3"))


if __name__ == "__main__":
    rostest.rosrun("livemap", "zone_postgresql_test", ZonePostgresqlTest)
