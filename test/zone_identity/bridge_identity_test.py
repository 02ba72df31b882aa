#!/usr/bin/python3
"""The MQTT bridges of a zone and a vehicle with certificates: rostest's master is the zone's, a second one the vehicle's."""

import os
import shutil
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "support")]

import rostest  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from livemap.msg import HazardReport, ReportReceipt  # noqa: E402
from mqtt_bridge_fixture import Bridge, Master, Peer, eventually  # noqa: E402
from zone_fixture import Zone  # noqa: E402


class BridgeIdentityTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.certificates = Zone()
        cls.addClassCleanup(cls.certificates.close)
        cls.zone_master, cls.vehicle_master = Master(os.environ["ROS_MASTER_URI"]), Master()
        cls.addClassCleanup(cls.vehicle_master.stop)
        cls.zone_peer = Peer(cls.zone_master, {"sub:/hazard/report": HazardReport, "pub:/hazard/receipt": ReportReceipt,
                                               "sub:/diagnostics": DiagnosticArray})
        cls.addClassCleanup(cls.zone_peer.stop)
        names = ("honest", "liar", "revoked")
        topics = {f"pub:/{name}/hazard/report": HazardReport for name in names}
        topics.update({f"sub:/{name}/hazard/receipt": ReportReceipt for name in names})
        cls.vehicle_peer = Peer(cls.vehicle_master, {**topics, "sub:/diagnostics": DiagnosticArray})
        cls.addClassCleanup(cls.vehicle_peer.stop)
        cls.certificates.start()
        cls.zone_bridge = cls.bridge(cls.zone_master, "zone", "zone_bridge", "/", cls.certificates.identity("zone"))
        cls.addClassCleanup(cls.zone_bridge.stop)
        cls.wait_connected(cls.zone_peer, "zone_bridge", cls.zone_bridge)

    @classmethod
    def bridge(cls, master, side, name, prefix, folder, **parameters):
        return Bridge(master, side, name, prefix=prefix, zone="test", port=cls.certificates.port,
                      diagnostics_period_s=0.2, reconnect_min_s=0.1, reconnect_max_s=1.0,
                      ca_file=f"{folder}/ca.pem", certificate_file=f"{folder}/certificate.pem",
                      key_file=f"{folder}/key.pem", **parameters)

    @staticmethod
    def wait_connected(peer, name, bridge):
        try:
            eventually(lambda: peer.diagnostics(name).get("connected") == "True", name + " connects")
        except AssertionError as error:
            raise AssertionError(bridge.output()) from error

    def vehicle(self, name, certificate_of, user):
        """A connected bridge below /NAME that says it is `user` and has `certificate_of`'s folder on its PC."""
        pc = tempfile.mkdtemp(prefix="livemap_pc_")
        self.addCleanup(shutil.rmtree, pc)
        shutil.move(self.certificates.enroll(certificate_of), os.path.join(pc, "identity"))
        bridge = self.bridge(self.vehicle_master, "vehicle", name, f"/{name}/", os.path.join(pc, "identity"), user=user)
        self.addCleanup(bridge.stop)
        self.wait_connected(self.vehicle_peer, name, bridge)
        return bridge

    def reports_of(self, drive_id):
        return [r for r in self.zone_peer.received("/hazard/report") if r.drive_id == drive_id]

    def test_a_report_arrives_under_the_certificates_name_and_its_receipt_comes_back(self):
        self.vehicle("honest", "car-1", "car-1")
        self.vehicle_peer.publish("/honest/hazard/report", HazardReport(vehicle_id="mayor", drive_id="honest"))
        received = eventually(lambda: self.reports_of("honest"), "the report arrives")
        self.assertEqual([r.vehicle_id for r in received], ["car-1"])
        self.zone_peer.publish("/hazard/receipt", ReportReceipt(vehicle_id="car-1", reason="committed"))
        receipts = eventually(lambda: self.vehicle_peer.received("/honest/hazard/receipt"), "the receipt arrives")
        self.assertEqual([r.reason for r in receipts], ["committed"])

    def test_who_says_another_name_than_its_certificates_is_refused_and_told(self):
        liar = self.vehicle("liar", "car-2", "car-9")
        self.vehicle_peer.publish("/liar/hazard/report", HazardReport(drive_id="liar"))
        eventually(lambda: self.vehicle_peer.diagnostics("liar").get("reports_refused") == "1", "the refusal is counted")
        self.assertIn("Not authorized (MQTT reason 135)", liar.output())
        self.assertEqual(self.reports_of("liar"), [])

    def test_a_revoked_vehicles_bridge_says_that_it_is_revoked(self):
        bridge = self.vehicle("revoked", "car-3", "car-3")
        self.certificates.revoke("car-3")
        eventually(lambda: "certificate revoked" in self.vehicle_peer.diagnostics("revoked").get("last_error", ""),
                   "the bridge's diagnostics say so")
        self.assertEqual(self.zone_peer.diagnostics("zone_bridge").get("connections"), "1")
        # The connection's end had no reason; the next attempt has, and is not kept for a minute.
        eventually(lambda: "certificate revoked; trying again" in bridge.output(), "the bridge's log says so")
        self.assertNotIn(".;", bridge.output())


if __name__ == "__main__":
    rostest.rosrun("livemap", "bridge_identity", BridgeIdentityTest)
