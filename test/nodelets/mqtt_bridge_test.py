#!/usr/bin/python3
"""The MQTT bridge between two ROS masters over a real mosquitto: rostest's master is the zone's, a
second one the vehicle's."""

import os
import shutil
import struct
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "support"))

import genmsg  # noqa: E402
import yaml  # noqa: E402
import genmsg.msg_loader  # noqa: E402
import rostest  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from livemap.msg import (  # noqa: E402
    CellHazard, CellHazards, CellRequest, CellState, HazardNotice, HazardPoll, HazardPollAnswer, HazardReport, HazardTrail,
    MapChange,
    ReportReceipt, VehicleCells, VehiclePosition)
from node_testing import SOURCE_DIRECTORY  # noqa: E402
from mqtt_bridge_fixture import (  # noqa: E402
    Bridge, Broker, Master, Peer, WIRE_MD5, envelope, eventually, free_port, serialise, wire_payload)

ZONE_TOPICS = {
    "sub:/hazard/report": HazardReport,
    "sub:/vehicle/position": VehiclePosition,
    "pub:/hazard/receipt": ReportReceipt,
    "pub:/hazard/notice": HazardNotice,
    "pub:/hazard/vehicle_notice": HazardNotice,
    "pub:/hazard/cell_notice": HazardNotice,
    "sub:/hazard/cell_request": CellRequest,
    "pub:/hazard/cell_hazards": CellHazards,
    "pub:/hazard/poll": HazardPoll,
    "sub:/hazard/poll_answer": HazardPollAnswer,
    "sub:/change/map_change": MapChange,
    "pub:/change/receipt": ReportReceipt,
    "sub:/diagnostics": DiagnosticArray,
}
VEHICLE_TOPICS = {
    "pub:/hazard/report": HazardReport,
    "pub:/stranger/hazard/report": HazardReport,
    "pub:/counted/hazard/report": HazardReport,
    "pub:/moved/hazard/report": HazardReport,
    "pub:/vehicle/position": VehiclePosition,
    "sub:/hazard/receipt": ReportReceipt,
    "sub:/hazard/notice": HazardNotice,
    "sub:/hazard/cell_notice": HazardNotice,
    "pub:/vehicle/cells": VehicleCells,
    "sub:/vehicle/cells_heard": VehicleCells,
    "pub:/hazard/cell_request": CellRequest,
    "sub:/hazard/cell_hazards": CellHazards,
    "sub:/old/hazard/notice": HazardNotice,
    "sub:/hazard/poll": HazardPoll,
    "pub:/hazard/poll_answer": HazardPollAnswer,
    "pub:/change/map_change": MapChange,
    "sub:/change/receipt": ReportReceipt,
    "sub:/diagnostics": DiagnosticArray,
}


def report(drive_id):
    """A report that the tests tell apart by its drive."""
    message = HazardReport(schema_version=HazardReport.SCHEMA_VERSION, drive_id=drive_id,
                           class_name="pothole", confidence=0.75, latitude=-27.5, longitude=-48.5)
    message.uuid = bytes(range(16))
    message.image.format = "jpeg"
    message.image.data = bytes(range(256)) * 100
    return message


STANDARD_MESSAGES = "/usr/share/{}/msg"
# Cells at 11.5 degrees east: the Web Mercator tiles 15/17430/11377 and 15/17430/11349, their quadkeys read to the base 4.
CELL_OF_48_1, CELL_OF_48_3 = 414198550, 414196534
# Of HazardReport.msg before it had the fields that are now its last 16 bytes.
MD5_OF_VERSION_1 = "6c9f383b83ba26551f53b42caa304fa7"
# Of VehiclePosition.msg before it had its last 4 bytes.
MD5_OF_POSITIONS_2 = "9146c7869de30f12ed97927d98d9681d"
# Of HazardNotice.msg and CellHazards.msg before they had courses and trails, their last 8 bytes where there are none,
# and before they had trails, the last 4.
MD5_OF_NOTICES_2 = "88d23041ceb511154d96daa5ff718aef"
MD5_OF_CELL_HAZARDS_1 = "83fa272e40c3f88a9c695865cbe9209e"
MD5_OF_CELL_HAZARDS_2 = "ef3eb3b08eefca405332cf9c2d023276"


class MqttBridgeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.broker = Broker()
        cls.broker.start()
        cls.zone_master = Master(os.environ["ROS_MASTER_URI"])
        cls.vehicle_master = Master()
        cls.zone_peer = Peer(cls.zone_master, ZONE_TOPICS)
        cls.vehicle_peer = Peer(cls.vehicle_master, VEHICLE_TOPICS)
        common = {"zone": "test", "port": cls.broker.port, "diagnostics_period_s": 0.2,
                  "reconnect_min_s": 0.1, "reconnect_max_s": 1.0}
        cls.common = common
        cls.zone = Bridge(cls.zone_master, "zone", "zone_bridge", **common,
                          password_file=cls.broker.password_file("zone"))
        cls.vehicle = Bridge(cls.vehicle_master, "vehicle", "car_bridge", **common, user="car-1",
                             password_file=cls.broker.password_file("car-1"))
        try:
            cls.wait_connected()
        except AssertionError as error:
            raise AssertionError(cls.zone.output() + cls.vehicle.output()) from error

    @classmethod
    def tearDownClass(cls):
        for part in (cls.zone, cls.vehicle, cls.zone_peer, cls.vehicle_peer, cls.vehicle_master):
            part.stop()
        cls.broker.kill()
        shutil.rmtree(cls.broker.directory, ignore_errors=True)

    @classmethod
    def wait_connected(cls):
        eventually(lambda: cls.zone_peer.diagnostics("zone_bridge").get("connected") == "True",
                   "the zone's bridge connects")
        eventually(lambda: cls.vehicle_peer.diagnostics("car_bridge").get("connected") == "True",
                   "the vehicle's bridge connects")

    def zone_count(self, key):
        return int(self.zone_peer.diagnostics("zone_bridge").get(key, "0"))

    def vehicle_count(self, bridge, key):
        return int(self.vehicle_peer.diagnostics(bridge).get(key, "0"))

    def another_bridge(self, name, **parameters):
        """A connected bridge of car-3 whose ROS topics stand below its name."""
        bridge = Bridge(self.vehicle_master, "vehicle", name, prefix=f"/{name}/", user="car-3",
                        password_file=self.broker.password_file("car-3"),
                        **dict(self.common, **parameters))
        eventually(lambda: self.vehicle_peer.diagnostics(name).get("connected") == "True",
                   name + " connects")
        return bridge

    def reports_of(self, drive_id):
        return [r for r in self.zone_peer.received("/hazard/report") if r.drive_id == drive_id]

    def test_zone_receives_report_under_the_identity_of_the_connection(self):
        sent = report("identity")
        sent.vehicle_id = "car-2"
        self.vehicle_peer.publish("/hazard/report", sent)
        received = eventually(lambda: self.reports_of("identity"), "the report arrives")[0]
        self.assertEqual(received.vehicle_id, "car-1")
        sent.vehicle_id = "car-1"
        self.assertEqual(serialise(received), serialise(sent))

    def test_zone_receives_position_under_the_identity_of_the_connection(self):
        self.vehicle_peer.publish("/vehicle/position", VehiclePosition(
            vehicle_id="mayor", drive_id="p", latitude=1.5, course=float("nan")))
        received = eventually(lambda: [m for m in self.zone_peer.received("/vehicle/position")
                                       if m.drive_id == "p"], "the position arrives")[0]
        self.assertEqual((received.vehicle_id, received.latitude), ("car-1", 1.5))

    def hear_of(self, *cells):
        """The vehicle wants to hear of these cells of the map alone, and does."""
        self.vehicle_peer.publish("/vehicle/cells", VehicleCells(cells=cells))
        eventually(lambda: (heard := self.vehicle_peer.received("/vehicle/cells_heard"))
                   and heard[-1].zone == "test" and sorted(heard[-1].cells) == sorted(cells), "the broker grants it")

    def test_a_receipt_reaches_its_addressee_alone(self):
        for vehicle in ("car-2", "car-1"):
            self.zone_peer.publish("/hazard/receipt",
                                   ReportReceipt(vehicle_id=vehicle, reason="for " + vehicle))
        receipts = eventually(lambda: self.vehicle_peer.received("/hazard/receipt"),
                              "the receipt arrives")
        self.assertEqual([r.reason for r in receipts], ["for car-1"])

    def test_a_notice_reaches_the_vehicles_that_hear_of_its_cell_alone(self):
        def tell(sequence, latitude):
            self.zone_peer.publish("/hazard/cell_notice", HazardNotice(sequence=sequence, class_name="pothole",
                                                                       latitude=latitude, longitude=11.5))

        def heard(sequence):
            return [notice for notice in self.vehicle_peer.received("/hazard/cell_notice") if notice.sequence == sequence]
        self.hear_of(CELL_OF_48_1)
        tell(201, 48.3)
        tell(202, 48.1)
        self.assertEqual(eventually(lambda: heard(202), "the notice arrives")[0].zone, "test")
        self.assertEqual(heard(201), [])
        self.hear_of(CELL_OF_48_3)
        tell(203, 48.1)
        tell(204, 48.3)
        eventually(lambda: heard(204), "the notice of the other cell arrives")
        self.assertEqual(heard(203), [])

    def test_a_notice_of_no_place_and_a_list_of_impossible_cells_are_refused(self):
        before = self.zone_count("cell_notices_refused")
        self.zone_peer.publish("/hazard/cell_notice", HazardNotice(sequence=205, latitude=float("nan")))
        eventually(lambda: self.zone_count("cell_notices_refused") == before + 1, "it is counted")
        self.vehicle_peer.publish("/vehicle/cells", VehicleCells(cells=[1 << 30]))
        self.vehicle_peer.publish("/vehicle/cells", VehicleCells(cells=range(65)))
        self.hear_of(CELL_OF_48_1)

    def test_a_question_about_cells_and_its_answer_reach_zone_and_vehicle(self):
        self.vehicle_peer.publish("/hazard/cell_request", CellRequest(
            vehicle_id="mayor", cells=[CELL_OF_48_1, CELL_OF_48_3], sequences=[0, 1 << 40]))
        asked = eventually(lambda: self.zone_peer.received("/hazard/cell_request"), "the question arrives")[0]
        self.assertEqual((asked.vehicle_id, list(asked.cells), list(asked.sequences)),
                         ("car-1", [CELL_OF_48_1, CELL_OF_48_3], [0, 1 << 40]))
        for vehicle in ("car-2", "car-1"):
            self.zone_peer.publish("/hazard/cell_hazards", CellHazards(
                vehicle_id=vehicle, cells=[CellState(cell=CELL_OF_48_1, sequence=7, hazards=1)],
                hazards=[CellHazard(class_name="for " + vehicle)]))
        told = eventually(lambda: self.vehicle_peer.received("/hazard/cell_hazards"), "the answer arrives")
        self.assertEqual([(news.zone, news.hazards[0].class_name) for news in told], [("test", "for car-1")])

    def test_a_vehicle_that_does_not_know_of_cells_hears_of_the_whole_zone(self):
        path = os.path.join(SOURCE_DIRECTORY, "config", "mqtt_bridge_vehicle.yaml")
        with open(path, encoding="utf-8") as file:
            topics = [topic for topic in yaml.safe_load(file)["topics"] if "cell" not in topic["name"]]
        topics.append({"name": "notices", "ros_topic": "hazard/notice", "type": "livemap/HazardNotice", "direction": "in",
                       "mqtt_topic": "livemap/v1/{zone}/notice"})
        for topic in topics:
            topic["ros_topic"] = "/old/" + topic["ros_topic"]
        old = self.another_bridge("old", topics=topics)
        try:
            def arrived():
                self.zone_peer.publish("/hazard/notice", HazardNotice(sequence=7, class_name="pothole"))
                return self.vehicle_peer.received("/old/hazard/notice")
            eventually(arrived, "the notice arrives")
            self.assertEqual([notice for notice in self.vehicle_peer.received("/hazard/notice") if notice.sequence == 7], [])
        finally:
            old.stop()

    def test_polls_and_what_one_vehicle_is_told_reach_that_vehicle_alone(self):
        for vehicle in ("car-2", "car-1"):
            self.zone_peer.publish("/hazard/poll", HazardPoll(vehicle_id=vehicle, class_name="for " + vehicle))
            self.zone_peer.publish("/hazard/vehicle_notice",
                                   HazardNotice(vehicle_id=vehicle, class_name="for " + vehicle, sequence=70))
        polls = eventually(lambda: self.vehicle_peer.received("/hazard/poll"), "the poll arrives")
        self.assertEqual([p.class_name for p in polls], ["for car-1"])
        own = eventually(lambda: [n for n in self.vehicle_peer.received("/hazard/notice") if n.vehicle_id],
                         "the notice arrives where all notices do")
        self.assertEqual([n.class_name for n in own if n.sequence == 70], ["for car-1"])

    def test_zone_receives_a_poll_answer_under_the_identity_of_the_connection(self):
        sent = HazardPollAnswer(vehicle_id="mayor", drive_id="p", confidence=0.5)
        sent.image.data = bytes(50000)
        self.vehicle_peer.publish("/hazard/poll_answer", sent)
        received = eventually(lambda: self.zone_peer.received("/hazard/poll_answer"), "the answer arrives")[0]
        self.assertEqual((received.vehicle_id, len(received.image.data)), ("car-1", 50000))

    def test_a_map_change_comes_under_the_identity_of_the_connection_and_its_receipt_goes_back(self):
        self.vehicle_peer.publish("/change/map_change", MapChange(vehicle_id="mayor", class_name="barrier"))
        received = eventually(lambda: self.zone_peer.received("/change/map_change"), "the map change arrives")[0]
        self.assertEqual((received.vehicle_id, received.class_name), ("car-1", "barrier"))
        for vehicle in ("car-2", "car-1"):
            self.zone_peer.publish("/change/receipt", ReportReceipt(vehicle_id=vehicle, reason="for " + vehicle))
        receipts = eventually(lambda: self.vehicle_peer.received("/change/receipt"), "the receipt arrives")
        self.assertEqual([r.reason for r in receipts], ["for car-1"])

    def test_receipt_without_a_possible_addressee_is_refused_and_counted(self):
        before = self.zone_count("receipts_refused")
        for addressee in ("", "+", "#", "car-1/notice"):
            self.zone_peer.publish("/hazard/receipt", ReportReceipt(vehicle_id=addressee))
        eventually(lambda: self.zone_count("receipts_refused") == before + 4, "four are refused")

    def test_hostile_payloads_are_refused_and_counted_and_a_good_one_still_passes(self):
        good = report("raw")
        body = wire_payload(good)
        huge_length = bytearray(body)
        huge_length[18:22] = struct.pack("<I", 0xFFFFFFFF)  # the length of vehicle_id
        hostile = [
            b"",
            b"LMAP",
            b"\x00" * 1000,
            os.urandom(5000),
            envelope(good, version=2),
            envelope(good, type_name="livemap/VehiclePosition"),
            envelope(good, type_name="livemap/<script>"),
            envelope(good, md5="0" * 32),
            envelope(good, payload=bytes(huge_length)),
            envelope(good, payload=body[:-1]),
            envelope(good, payload=body + b"\x00"),
            envelope(good, payload=b""),
            envelope(good, md5=MD5_OF_VERSION_1),
            envelope(good, md5=MD5_OF_VERSION_1, payload=body[:-17]),
            envelope(VehiclePosition()),
            envelope(good)[:-100],
        ]
        before = self.zone_count("reports_refused")
        topic = "livemap/v1/test/vehicle/car-2/report"
        for payload in hostile:
            self.assertEqual(self.broker.publish_raw("car-2", topic, payload), 0)
        good.vehicle_id = "car-1"
        self.assertEqual(self.broker.publish_raw("car-2", topic, envelope(good)), 0)
        received = eventually(lambda: self.reports_of("raw"), "the good report arrives")
        self.assertEqual([r.vehicle_id for r in received], ["car-2"])
        eventually(lambda: self.zone_count("reports_refused") == before + len(hostile),
                   "every hostile payload is counted")
        self.assertTrue(self.zone.alive())
        self.assertIn("refused a message of topic 'reports': from 'car-2'", self.zone.output())

    def test_a_report_of_a_vehicle_that_knows_the_definition_of_version_1_arrives(self):
        old = report("of version 1")
        old.schema_version = 1
        old.shown_width = 77
        self.broker.publish_raw("car-2", "livemap/v1/test/vehicle/car-2/report",
                                envelope(old, md5=MD5_OF_VERSION_1, payload=wire_payload(old)[:-16]))
        received = eventually(lambda: self.reports_of("of version 1"), "it arrives")[0]
        self.assertEqual((received.schema_version, received.vehicle_id), (1, "car-2"))
        self.assertEqual(bytes(received.image.data), bytes(old.image.data))
        self.assertEqual((received.shown_x, received.shown_y, received.shown_width, received.shown_height),
                         (0, 0, 0, 0))

    def test_positions_of_version_2_do_not_say_how_old_the_outbox_is(self):
        old = VehiclePosition(schema_version=2, drive_id="of version 2", latitude=40, outbox_age=7)
        self.broker.publish_raw("car-2", "livemap/v1/test/vehicle/car-2/position",
                                envelope(old, md5=MD5_OF_POSITIONS_2, payload=wire_payload(old)[:-4]))
        received = eventually(lambda: [m for m in self.zone_peer.received("/vehicle/position")
                                       if m.drive_id == "of version 2"], "it arrives")[0]
        self.assertEqual((received.schema_version, received.vehicle_id, received.outbox_age), (2, "car-2", 0))

    def test_cells_of_a_zone_that_tells_no_courses_or_no_trails_arrive(self):
        cells = CellHazards(schema_version=1, cells=[CellState(cell=7, hazards=1)],
                            hazards=[CellHazard(class_name="pothole", sequence=303)])
        self.broker.publish_raw("zone", "livemap/v1/test/vehicle/car-1/cell_hazards",
                                envelope(cells, md5=MD5_OF_CELL_HAZARDS_1, payload=wire_payload(cells)[:-8]))
        news = eventually(lambda: [m for m in self.vehicle_peer.received("/hazard/cell_hazards")
                                   if m.hazards and m.hazards[0].sequence == 303], "the cell arrives")[0]
        self.assertEqual((news.schema_version, list(news.courses)), (1, []))
        cells.schema_version = 2
        cells.hazards[0].sequence = 306
        cells.courses = [1.5]
        self.broker.publish_raw("zone", "livemap/v1/test/vehicle/car-1/cell_hazards",
                                envelope(cells, md5=MD5_OF_CELL_HAZARDS_2, payload=wire_payload(cells)[:-4]))
        news = eventually(lambda: [m for m in self.vehicle_peer.received("/hazard/cell_hazards")
                                   if m.hazards and m.hazards[0].sequence == 306], "the cell arrives")[0]
        self.assertEqual((news.schema_version, list(news.courses), news.trails), (2, [1.5], []))
        # The login of the plain client has ended the connection of the zone's bridge.
        self.zone_peer.publish("/hazard/vehicle_notice", HazardNotice(vehicle_id="car-1", sequence=305))
        eventually(lambda: 305 in [n.sequence for n in self.vehicle_peer.received("/hazard/notice")],
                   "the bridge is connected again")

    def test_who_is_told_alone_is_told_as_version_2_defines_it_and_reads_that(self):
        self.zone_peer.publish("/hazard/vehicle_notice", HazardNotice(
            schema_version=HazardNotice.SCHEMA_VERSION, vehicle_id="car-1", sequence=302, class_name="pothole",
            course=1.5, trails=[HazardTrail(offsets=[0, -500, 0, 500])]))
        received = eventually(lambda: [m for m in self.vehicle_peer.received("/hazard/notice") if m.sequence == 302],
                              "the notice arrives")[0]
        self.assertEqual((received.schema_version, received.class_name, received.course, received.trails),
                         (2, "pothole", 0, []))

    def test_vehicles_that_know_no_cells_are_told_as_version_2_defines_it(self):
        path = os.path.join(self.broker.directory, "raw_notice")
        listener = self.broker.subscribe_raw("car-2", "livemap/v1/test/notice", path)
        notice = HazardNotice(schema_version=HazardNotice.SCHEMA_VERSION, sequence=304, class_name="pothole", course=1.5,
                              trails=[HazardTrail(offsets=[0, -500, 0, 500])])

        def arrived():
            self.zone_peer.publish("/hazard/notice", notice)
            return listener.poll() is not None
        eventually(arrived, "the raw payload arrives")
        notice.schema_version = 2
        notice.trails = []
        with open(path, "rb") as file:
            self.assertEqual(file.read(), envelope(notice, md5=MD5_OF_NOTICES_2, payload=wire_payload(notice)[:-8]))

    def test_the_zone_in_a_message_stays_on_the_vehicle_and_comes_from_the_topic(self):
        path = os.path.join(self.broker.directory, "raw")
        listener = self.broker.subscribe_raw("zone", "livemap/v1/test/vehicle/car-1/change", path)
        change = MapChange(class_name="with a zone", zone="test")

        def arrived():
            self.vehicle_peer.publish("/change/map_change", change)
            return listener.poll() is not None
        eventually(arrived, "the raw payload arrives")
        with open(path, "rb") as file:
            self.assertEqual(file.read(), envelope(change), "as vehicles without the field send it")

        def received():
            # The login of the plain client has ended the connection of the zone's bridge.
            self.vehicle_peer.publish("/change/map_change", change)
            return [c for c in self.zone_peer.received("/change/map_change") if c.class_name == "with a zone"]
        self.assertEqual({c.zone for c in eventually(received, "the zone receives it")}, {""})
        self.zone_peer.publish("/hazard/vehicle_notice",
                               HazardNotice(sequence=77, vehicle_id="car-1", zone="elsewhere"))
        notice = eventually(lambda: [n for n in self.vehicle_peer.received("/hazard/notice") if n.sequence == 77],
                            "the notice arrives")[0]
        self.assertEqual(notice.zone, "test")

    def test_a_message_for_a_zone_that_is_not_connected_is_dropped_and_counted(self):
        before = self.vehicle_count("car_bridge", "reports_dropped")
        elsewhere = report("for elsewhere")
        elsewhere.zone = "elsewhere"
        self.vehicle_peer.publish("/hazard/report", elsewhere)
        eventually(lambda: self.vehicle_count("car_bridge", "reports_dropped") == before + 1, "it is counted")
        self.assertEqual(self.reports_of("for elsewhere"), [])

    def test_definitions_on_the_wire_are_the_messages_without_their_zone(self):
        for name, md5 in WIRE_MD5.items():
            with self.subTest(name):
                context = genmsg.MsgContext.create_default()
                path = os.path.join(SOURCE_DIRECTORY, "msg", name.split("/")[1] + ".msg")
                with open(path, encoding="utf-8") as file:
                    lines = file.read().rstrip("\n").split("\n")
                self.assertRegex(lines[-1], r"^string zone\b")
                search = {"livemap": [os.path.dirname(path)], "std_msgs": [STANDARD_MESSAGES.format("std_msgs")],
                          "sensor_msgs": [STANDARD_MESSAGES.format("sensor_msgs")]}
                spec = genmsg.msg_loader.load_msg_from_string(context, "\n".join(lines[:-1]), name)
                genmsg.msg_loader.load_depends(context, spec, search)
                self.assertEqual(genmsg.compute_md5(context, spec), md5)

    def test_broker_keeps_a_vehicle_from_another_vehicles_topic(self):
        forged = envelope(report("forged"))
        self.broker.publish_raw("car-2", "livemap/v1/test/vehicle/car-1/report", forged)
        self.broker.publish_raw("car-2", "livemap/v1/test/vehicle/car-2/report",
                                envelope(report("after the forged one")))
        eventually(lambda: self.reports_of("after the forged one"), "the allowed report arrives")
        self.assertEqual(self.reports_of("forged"), [])

    def test_publication_that_the_broker_refuses_is_counted_and_said(self):
        stranger = self.another_bridge("stranger", zone="elsewhere")
        try:
            self.vehicle_peer.publish("/stranger/hazard/report", report("elsewhere"))
            eventually(lambda: self.vehicle_count("stranger", "reports_refused") == 1,
                       "the refusal is counted")
            self.assertEqual(self.vehicle_count("stranger", "reports_out"), 0)
            self.assertIn("Not authorized (MQTT reason 135)", stranger.output())
        finally:
            stranger.stop()

    def test_uplink_bytes_are_payload_and_topic_of_what_was_published(self):
        counted = self.another_bridge("counted")
        try:
            message = report("bytes")
            self.vehicle_peer.publish("/counted/hazard/report", message)
            eventually(lambda: self.vehicle_count("counted", "reports_out") == 1,
                       "the report is counted")
            topic = "livemap/v1/test/vehicle/car-3/report"
            self.assertEqual(self.vehicle_count("counted", "uplink_bytes"),
                             len(topic) + len(envelope(message)))
        finally:
            counted.stop()

    def test_a_bridge_takes_the_next_node_of_the_broker_when_the_first_ones_are_down(self):
        moved = self.another_bridge("moved", port=free_port(),
                                    other_brokers=f"[::1]:{free_port()}, 127.0.0.1:{self.broker.port}")
        try:
            self.assertEqual(self.vehicle_peer.diagnostics("moved")["broker"], f"127.0.0.1:{self.broker.port}")
            self.vehicle_peer.publish("/moved/hazard/report", report("moved"))
            eventually(lambda: self.reports_of("moved"), "the report arrives")
        finally:
            moved.stop()

    def test_flow_resumes_after_the_broker_was_killed_and_lost_its_state(self):
        self.broker.kill()
        eventually(lambda: self.vehicle_peer.diagnostics("car_bridge")["connected"] == "False",
                   "the vehicle's bridge notices")
        dropped = self.vehicle_count("car_bridge", "reports_dropped")
        self.vehicle_peer.publish("/hazard/report", report("into the void"))
        eventually(lambda: self.vehicle_count("car_bridge", "reports_dropped") == dropped + 1,
                   "the report is dropped and counted")
        self.zone_peer.publish("/hazard/cell_notice", HazardNotice(sequence=1000, latitude=48.1, longitude=11.5))
        shutil.rmtree(os.path.join(self.broker.directory, "data"))
        self.broker.start()
        self.wait_connected()
        self.vehicle_peer.publish("/hazard/report", report("resumed"))
        eventually(lambda: self.reports_of("resumed"), "the next report arrives")
        self.hear_of(CELL_OF_48_1)
        self.zone_peer.publish("/hazard/cell_notice", HazardNotice(sequence=1001, latitude=48.1, longitude=11.5))
        eventually(lambda: 1001 in [n.sequence for n in
                                    self.vehicle_peer.received("/hazard/cell_notice")],
                   "the next notice arrives")

    def test_bad_parameters_are_one_clear_sentence_and_a_failed_load(self):
        cases = [
            ({"role": "mayor"}, "accepted is one of: vehicle, zone"),
            ({"zone": "a/b"}, "parameter 'zone' of the bridge is 'a/b'"),
            ({"keepalive": 3}, "unknown parameter"),
            ({"topics": []}, "parameter 'topics' of the bridge is no list"),
            ({"topics": [{"name": "x", "ros_topic": "x", "type": "livemap/Nothing",
                          "direction": "out", "mqtt_topic": "x"}]},
             "'livemap/Nothing' is not known"),
            ({"topics": [{"name": "x", "ros_topic": "x", "type": "livemap/HazardNotice",
                          "direction": "sideways", "mqtt_topic": "x"}]}, "accepted is in or out"),
            ({"topics": [{"name": "x", "ros_topic": "x", "type": "livemap/HazardNotice", "direction": "out",
                          "mqtt_topic": "x", "write_version": 1}]},
             "'livemap/HazardNotice' cannot be written as version 1, accepted is 0 (the present one), 2, 3"),
            ({"topics": [{"name": "x", "ros_topic": "x", "type": "livemap/HazardNotice", "direction": "in",
                          "mqtt_topic": "x", "write_version": 2}]}, "accepted is 0 where the direction is in"),
            ({"password_file": "/nowhere", "password_wait_s": 0.0}, "/nowhere"),
            ({"other_brokers": "node-2"}, "has 'node-2', accepted is HOST:PORT"),
            ({"other_brokers": "node-2:8883,,node-3:8883"}, "has '', accepted is HOST:PORT"),
            ({"other_brokers": "node-2:65536"}, "has 'node-2:65536', accepted is HOST:PORT"),
            ({"other_brokers": "::1:8883"}, "has '::1:8883', accepted is HOST:PORT"),
            ({"other_brokers": ",".join(["node:1"] * 8)}, "has 8 addresses, accepted are at most 7"),
            ({"ca_file": "/nowhere", "certificate_file": "/nowhere"}, "parameter 'key_file' of the bridge is missing"),
            ({"ca_file": "/nowhere", "certificate_file": "/nowhere", "key_file": "/nowhere"},
             "MQTT ca_file is '/nowhere', accepted is a PEM file that can be read"),
        ]
        for number, (spoiled, sentence) in enumerate(cases):
            with self.subTest(sentence):
                parameters = dict(self.common, user="car-3", **{"password_file": ""})
                parameters.update(spoiled)
                bridge = Bridge(self.vehicle_master, "vehicle", f"bad_{number}", **parameters)
                self.assertEqual(bridge.process.wait(timeout=120), 255, "refused, not crashed")
                self.assertIn(sentence, bridge.output())


if __name__ == "__main__":
    rostest.rosrun("livemap", "mqtt_bridge", MqttBridgeTest)
