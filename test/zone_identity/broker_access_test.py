#!/usr/bin/python3
"""Who gets into a zone's broker, how far, and what each sender is told: a real mosquitto, set up by `livemap zone init`.

Where nothing may arrive, the test sends something lawful afterwards on the same way: that must come first.
"""

import os
import signal
import ssl
import time
import unittest

from mqtt_sender import (ACCEPTED, NOT_AUTHORIZED, PACKET_TOO_LARGE, RETAIN_NOT_SUPPORTED, Message, Refused, Sender,
                         Will, tls_context)
from zone_fixture import NOTICE, Zone, free_port, livemap_zone, topic

MAX_MESSAGE_BYTES = 1 << 20
GRANTED_QOS_1 = 1
# What a vehicle tells the zone on its own topics, and hears from it.
WRITTEN = ("report", "position", "answer", "change", "cell_request")
HEARD = ("receipt", "notice", "poll", "change_receipt", "directory", "cell_hazards")
# What it hears of one cell of the map.
CELL_NOTICE = NOTICE + "/120210233222021"


class NoOneInTest(unittest.TestCase):
    """Vehicles car-1 and car-2, and the zone's own client, which hears all reports."""

    @classmethod
    def setUpClass(cls):
        cls.zone = Zone()
        cls.addClassCleanup(cls.zone.close)
        cls.zone.enroll("car-1")
        cls.zone.enroll("car-2")
        cls.zone.start()

    def connect(self, name, **options):
        sender = self.zone.connect(name, **options)
        self.addCleanup(sender.close)
        return sender

    def listening_zone(self):
        zone = self.connect("zone")
        for name in WRITTEN:
            self.assertEqual(zone.subscribe(topic("+", name)), GRANTED_QOS_1)
        return zone

    def assert_not_let_in(self, words, name="car-1", **options):
        with self.assertRaises(Refused) as refused:
            self.connect(name, **options)
        self.assertIn(words, str(refused.exception))

    def test_a_vehicle_reports_and_hears_its_receipt_and_what_the_zone_tells_all(self):
        zone, car = self.listening_zone(), self.connect("car-1")
        for topic_filter in (*(topic("car-1", name) for name in HEARD), NOTICE):
            self.assertEqual(car.subscribe(topic_filter), GRANTED_QOS_1)
        for name in WRITTEN:
            self.assertEqual(car.publish(topic("car-1", name), b"mine"), 0)
            self.assertEqual(zone.receive(), Message(topic("car-1", name), b"mine"))
        for name in HEARD:
            self.assertEqual(zone.publish(topic("car-1", name), b"yours"), 0)
            self.assertEqual(car.receive(), Message(topic("car-1", name), b"yours"))
        self.assertEqual(zone.publish(NOTICE, b"all"), 0)
        self.assertEqual(car.receive(), Message(NOTICE, b"all"))

    def test_a_vehicle_hears_of_the_cells_that_it_wants_to_hear_of_and_tells_nothing_there(self):
        zone, car, other = self.connect("zone"), self.connect("car-1"), self.connect("car-2")
        self.assertEqual(car.subscribe(CELL_NOTICE), GRANTED_QOS_1)
        self.assertEqual(other.subscribe(CELL_NOTICE[:-1] + "3"), GRANTED_QOS_1)
        self.assertEqual(other.publish(CELL_NOTICE, b"invented"), NOT_AUTHORIZED)
        self.assertEqual(car.publish(CELL_NOTICE, b"invented"), NOT_AUTHORIZED)
        self.assertEqual(zone.publish(CELL_NOTICE, b"near"), 0)
        self.assertEqual(car.receive(), Message(CELL_NOTICE, b"near"))
        self.assertEqual(zone.publish(CELL_NOTICE[:-1] + "3", b"elsewhere"), 0)
        self.assertEqual(other.receive(), Message(CELL_NOTICE[:-1] + "3", b"elsewhere"))

    def test_anothers_topic_is_not_authorized_and_nothing_arrives(self):
        zone, car = self.listening_zone(), self.connect("car-1")
        for name in WRITTEN:
            self.assertEqual(car.publish(topic("car-2", name), b"forged"), NOT_AUTHORIZED)
        self.assertEqual(car.publish(topic("car-1", "report"), b"own"), 0)
        self.assertEqual(zone.receive(), Message(topic("car-1", "report"), b"own"))

    def test_mqtt_3_acknowledges_anothers_topic_but_nothing_arrives(self):
        zone, car = self.listening_zone(), self.connect("car-1", version=4)
        self.assertEqual(car.publish(topic("car-2", "report"), b"forged"), 0)
        self.assertEqual(car.publish(topic("car-1", "report"), b"own"), 0)
        self.assertEqual(zone.receive(), Message(topic("car-1", "report"), b"own"))

    def test_no_way_leads_from_vehicle_to_vehicle(self):
        """mosquitto 2 grants every subscription and then delivers only what may be read."""
        zone, spy, car = self.connect("zone"), self.connect("car-2"), self.connect("car-1")
        own = [topic("car-1", name) for name in WRITTEN + HEARD]
        for topic_filter in ("#", "+/#", topic("+", "#"), "$SYS/#", *own):
            spy.subscribe(topic_filter)
        self.assertEqual(spy.subscribe(NOTICE), GRANTED_QOS_1)
        for name in WRITTEN + HEARD + ("chat",):
            self.assertEqual(car.publish(topic("car-2", name), b"psst"), NOT_AUTHORIZED)
        for other in (NOTICE, "livemap/v1/test/chat", "chat", "$SYS/broker/version",
                      "livemap/v1/other/vehicle/car-1/report"):
            self.assertEqual(car.publish(other, b"psst"), NOT_AUTHORIZED)
        for name in WRITTEN:
            self.assertIn(car.publish(topic("car-1", name), b"for the zone"), ACCEPTED)
        for name in HEARD:
            zone.publish(topic("car-1", name), b"for car-1")
        zone.publish(NOTICE, b"for all")
        self.assertEqual(spy.receive(), Message(NOTICE, b"for all"))

    def test_a_vehicle_cannot_ask_or_tell_itself_in_the_zones_name(self):
        zone, car = self.connect("zone"), self.connect("car-1")
        for name in HEARD:
            car.subscribe(topic("car-1", name))
            self.assertEqual(car.publish(topic("car-1", name), b"invented"), NOT_AUTHORIZED)
        zone.publish(topic("car-1", "poll"), b"asked")
        self.assertEqual(car.receive(), Message(topic("car-1", "poll"), b"asked"))

    def test_the_zones_own_client_can_write_no_report(self):
        zone, car = self.listening_zone(), self.connect("car-1")
        for name in ("report", "answer", "change"):
            self.assertEqual(zone.publish(topic("car-1", name), b"invented"), NOT_AUTHORIZED)
        car.publish(topic("car-1", "report"), b"true")
        self.assertEqual(zone.receive().payload, b"true")

    def test_a_last_will_on_anothers_topic_is_not_sent(self):
        zone = self.listening_zone()
        self.connect("car-1", will=Will(topic("car-2", "report"), b"forged")).close()
        # The will of a connection that broke comes before what its successor sends.
        own_will = self.connect("car-1", will=Will(topic("car-1", "report"), b"own will"))
        own_will.publish(topic("car-1", "report"), b"own")
        own_will.close()
        self.assertEqual([zone.receive().payload, zone.receive().payload], [b"own", b"own will"])

    def test_another_authoritys_certificate_is_unknown(self):
        other = Zone()
        self.addCleanup(other.close)
        stranger = tls_context(other.enroll("car-1"), authority=os.path.join(self.zone.identity("car-1"), "ca.pem"))
        self.assert_not_let_in("TLSV1_ALERT_UNKNOWN_CA", context=stranger)

    def test_a_vehicle_does_not_trust_a_broker_of_another_authority(self):
        other = Zone()
        self.addCleanup(other.close)
        other.enroll("car-1")
        self.assert_not_let_in("CERTIFICATE_VERIFY_FAILED", context=tls_context(other.identity("car-1")))

    def test_a_vehicle_does_not_trust_another_vehicle_that_plays_the_broker(self):
        impostor = Zone()
        self.addCleanup(impostor.close)
        conf = os.path.join(impostor.directory, "mosquitto.conf")
        with open(conf, encoding="ascii") as file:
            text = file.read()
        for name in ("certificate", "key"):
            text = text.replace(f"{impostor.directory}/broker/{name}.pem", f"{self.zone.identity('car-2')}/{name}.pem")
        with open(conf, "w", encoding="ascii") as file:
            file.write(text)
        impostor.start()
        context = tls_context(self.zone.identity("car-1"))
        context.check_hostname = False
        with self.assertRaises(Refused) as refused:
            Sender(impostor.port, context, "car-1")
        self.assertIn("CERTIFICATE_VERIFY_FAILED", str(refused.exception))

    def test_without_a_certificate_one_is_asked_for(self):
        self.assert_not_let_in("TLSV13_ALERT_CERTIFICATE_REQUIRED",
                               context=tls_context(self.zone.identity("car-1"), certificate=False))

    def test_the_brokers_certificate_is_no_clients(self):
        self.assert_not_let_in("ALERT_UNSUPPORTED_CERTIFICATE",
                               context=tls_context(os.path.join(self.zone.directory, "broker")))

    def test_tls_1_2_is_refused_by_name(self):
        self.assert_not_let_in("ALERT_PROTOCOL_VERSION",
                               context=tls_context(self.zone.identity("car-1"), version=ssl.TLSVersion.TLSv1_2))

    def test_without_tls_the_connection_ends(self):
        with self.assertRaises(Refused):
            Sender(self.zone.port, None, "car-1")

    def test_anothers_client_id_takes_nothing_over(self):
        zone, car = self.listening_zone(), self.connect("car-1", keep_session=True)
        car.subscribe(topic("car-1", "receipt"))
        thief = self.connect("car-2", client_id="car-1", keep_session=True)
        self.assertEqual(thief.publish(topic("car-1", "report"), b"forged"), NOT_AUTHORIZED)
        thief.publish(topic("car-2", "report"), b"as itself")
        self.assertEqual(zone.receive(), Message(topic("car-2", "report"), b"as itself"))
        zone.publish(topic("car-1", "receipt"), b"for car-1")
        self.assertEqual(car.receive(), Message(topic("car-1", "receipt"), b"for car-1"))

    def test_an_absent_vehicles_queue_is_not_handed_to_who_takes_its_client_id(self):
        zone, car = self.connect("zone"), self.connect("car-1", keep_session=True)
        car.subscribe(topic("car-1", "receipt"))
        car.disconnect()
        zone.publish(topic("car-1", "receipt"), b"waiting")
        thief = self.connect("car-2", client_id="car-1", keep_session=True)
        thief.subscribe(NOTICE)
        zone.publish(NOTICE, b"first of the thief")
        self.assertEqual(thief.receive().payload, b"first of the thief")
        back = self.connect("car-1", keep_session=True)
        self.assertEqual(back.receive().payload, b"waiting")

    def test_an_oversize_message_is_named_too_large_and_does_not_arrive(self):
        zone, car = self.listening_zone(), self.connect("car-1")
        self.assertEqual(car.publish(topic("car-1", "report"), bytes(MAX_MESSAGE_BYTES)), 0)
        self.assertEqual(car.publish(topic("car-1", "report"), bytes(MAX_MESSAGE_BYTES + 1)), PACKET_TOO_LARGE)
        self.assertEqual(car.publish(topic("car-1", "report"), b"small"), 0)
        self.assertEqual([len(zone.receive().payload), zone.receive().payload], [MAX_MESSAGE_BYTES, b"small"])

    def test_an_oversize_packet_ends_the_connection_with_the_reason(self):
        car = self.connect("car-1")
        with self.assertRaises(Refused) as refused:
            car.publish(topic("car-1", "report"), bytes(MAX_MESSAGE_BYTES + 8192))
        self.assertEqual(str(refused.exception), f"MQTT reason {PACKET_TOO_LARGE}")

    def test_mqtt_3_acknowledges_an_oversize_message_but_it_does_not_arrive(self):
        zone, car = self.listening_zone(), self.connect("car-1", version=4)
        self.assertEqual(car.publish(topic("car-1", "report"), bytes(MAX_MESSAGE_BYTES + 1)), 0)
        self.assertEqual(car.publish(topic("car-1", "report"), b"small"), 0)
        self.assertEqual(zone.receive().payload, b"small")

    def test_mqtt_3_is_cut_off_without_a_reason_for_an_oversize_packet_or_a_retained_message(self):
        for payload, retain in ((bytes(MAX_MESSAGE_BYTES + 8192), False), (b"for ever", True)):
            car = self.connect("car-1", version=4)
            with self.assertRaises(Refused) as refused:
                car.publish(topic("car-1", "report"), payload, retain=retain)
            self.assertNotIn("MQTT reason", str(refused.exception))

    def test_a_retained_message_ends_the_connection_with_the_reason(self):
        car = self.connect("car-1")
        with self.assertRaises(Refused) as refused:
            car.publish(topic("car-1", "report"), b"for ever", retain=True)
        self.assertEqual(str(refused.exception), f"MQTT reason {RETAIN_NOT_SUPPORTED}")


class RevocationTest(unittest.TestCase):
    """Each test has a broker of its own, which runs unless the test says otherwise."""

    def setUp(self):
        self.zone = Zone()
        self.addCleanup(self.zone.close)
        # What a vehicle keeps of its folder, whatever the zone does with its own copy.
        self.contexts = {name: tls_context(self.zone.enroll(name)) for name in ("car-1", "car-2")}

    def connect(self, name, **options):
        sender = self.zone.connect(name, context=self.contexts[name], **options)
        self.addCleanup(sender.close)
        return sender

    def assert_revoked(self, name, **options):
        with self.assertRaises(Refused) as refused:
            self.connect(name, **options)
        self.assertIn("ALERT_CERTIFICATE_REVOKED", str(refused.exception))

    def test_a_vehicle_revoked_before_the_broker_starts_is_not_let_in(self):
        self.zone.revoke("car-1")
        self.zone.start()
        self.assert_revoked("car-1")
        self.connect("car-2")

    def test_a_running_broker_ends_the_vehicles_connection_and_lets_it_in_no_more(self):
        self.zone.start()
        car, other = self.connect("car-1"), self.connect("car-2")
        self.assertIn("the running broker", self.zone.revoke("car-1"))
        # mosquitto 2.0.11 gives no reason when a second login ends a connection.
        self.assertEqual(car.ended(), "connection closed")
        self.assert_revoked("car-1")
        self.assertIn(other.publish(topic("car-2", "report"), b"undisturbed"), ACCEPTED)

    def test_who_opened_tls_before_its_revocation_and_logs_in_after_it_can_do_nothing(self):
        self.zone.start()
        zone = self.zone.connect("zone")
        self.addCleanup(zone.close)
        zone.subscribe(topic("+", "report"))
        sleeper = self.connect("car-1", wait=lambda: self.zone.revoke("car-1"))
        self.assertEqual(sleeper.publish(topic("car-1", "report"), b"still here"), NOT_AUTHORIZED)
        for topic_filter in (NOTICE, topic("car-1", "receipt")):
            sleeper.subscribe(topic_filter)
            zone.publish(topic_filter, b"not for the revoked")
        # A message would stand before this answer.
        sleeper.subscribe(NOTICE)
        self.assertEqual(list(sleeper.messages), [])
        self.connect("car-2").publish(topic("car-2", "report"), b"welcome")
        self.assertEqual(zone.receive(), Message(topic("car-2", "report"), b"welcome"))

    def test_such_a_connection_ends_before_its_name_is_given_to_another(self):
        self.zone.start()
        sleeper = self.connect("car-1", wait=lambda: self.zone.revoke("car-1"))
        self.contexts["car-1"] = tls_context(self.zone.enroll("car-1"))
        self.assertEqual(sleeper.ended(), "connection closed")
        self.assertIn(self.connect("car-1").publish(topic("car-1", "report"), b"new"), ACCEPTED)

    def test_revocations_in_quick_succession_all_hold(self):
        self.zone.start()
        names = [f"car-{number}" for number in range(10, 16)]
        self.contexts.update({name: tls_context(self.zone.enroll(name)) for name in names})
        for name in names:
            self.zone.revoke(name)
        for name in names:
            self.assert_revoked(name)

    def test_a_revoked_vehicle_cannot_resume_its_tls_session(self):
        self.zone.start()
        car = self.connect("car-1")
        car.publish(topic("car-1", "report"), b"the broker's session ticket comes before its answer")
        ticket = car.connection.session
        self.assertTrue(ticket.has_ticket)
        self.assertTrue(self.connect("car-1", resume=ticket).connection.session_reused, "tickets work until then")
        self.zone.revoke("car-1")
        self.assert_revoked("car-1", resume=ticket)

    def test_what_waited_for_a_revoked_vehicle_is_not_kept_for_its_successor(self):
        self.zone.start()
        car = self.connect("car-1", keep_session=True)
        car.subscribe(topic("car-1", "receipt"))
        car.disconnect()
        zone = self.zone.connect("zone")
        self.addCleanup(zone.close)
        zone.publish(topic("car-1", "receipt"), b"old")
        self.zone.revoke("car-1")
        self.contexts["car-1"] = tls_context(self.zone.enroll("car-1"))
        successor = self.connect("car-1", keep_session=True)
        successor.subscribe(topic("car-1", "receipt"))
        zone.publish(topic("car-1", "receipt"), b"new")
        self.assertEqual(successor.receive().payload, b"new")

    def test_a_vehicle_enrolled_anew_comes_in_by_its_new_certificate_alone(self):
        self.zone.start()
        old = self.contexts["car-1"]
        self.zone.revoke("car-1")
        self.contexts["car-1"] = tls_context(self.zone.enroll("car-1"))
        self.connect("car-1")
        self.contexts["car-1"] = old
        self.assert_revoked("car-1")

    def test_a_vehicle_enrolled_while_the_broker_runs_is_let_in(self):
        self.zone.start()
        self.contexts["car-3"] = tls_context(self.zone.enroll("car-3"))
        self.assertIn(self.connect("car-3").publish(topic("car-3", "report"), b"new here"), ACCEPTED)

    def test_a_revocation_outlives_a_kill_of_the_broker_and_another_init(self):
        self.zone.start()
        self.zone.revoke("car-1")
        self.zone.kill()
        self.zone.succeed("init", self.zone.directory, "--zone", "test", "--port", self.zone.port)
        self.zone.start()
        self.assert_revoked("car-1")

    def test_a_connection_that_could_not_be_ended_is_told_and_ended_by_another_revoke(self):
        self.zone.start()
        car = self.connect("car-1")
        init = ("init", self.zone.directory, "--zone", "test", "--port")
        self.zone.succeed(*init, free_port())
        result = livemap_zone("revoke", "car-1", "--dir", self.zone.directory)
        self.assertEqual(result.returncode, 2)
        self.assertIn("could not be ended", result.stderr)
        # Nobody could ask the broker whether it has read the rights yet: it does within its next round.
        deadline = time.monotonic() + 10
        while car.publish(topic("car-1", "report"), b"still here") != NOT_AUTHORIZED:
            self.assertLess(time.monotonic(), deadline, "a revoked vehicle may still publish after 10 s")
        self.zone.succeed(*init, self.zone.port)
        self.zone.revoke("car-1")
        self.assertEqual(car.ended(), "connection closed")

    def test_sessions_and_queues_survive_an_orderly_restart(self):
        self.zone.start()
        listener = self.zone.connect("zone", keep_session=True)
        listener.subscribe(topic("+", "report"))
        listener.disconnect()
        self.assertEqual(self.connect("car-1").publish(topic("car-1", "report"), b"before"), 0)
        self.zone.kill(signal.SIGTERM)
        self.zone.start()
        listener = self.zone.connect("zone", keep_session=True)
        self.addCleanup(listener.close)
        self.assertEqual(listener.receive().payload, b"before")

    def test_a_killed_brokers_process_file_does_not_mislead(self):
        self.zone.start()
        self.zone.kill(signal.SIGKILL)
        self.assertTrue(os.path.exists(os.path.join(self.zone.directory, "mosquitto.pid")))
        self.assertIn("no broker runs now", self.zone.revoke("car-1"))


if __name__ == "__main__":
    unittest.main()
