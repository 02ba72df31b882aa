#!/usr/bin/python3
"""Work orders reach real recipients exactly once, whoever is killed in the middle.

  order_delivery_test.py PATH_OF_order_desk_server
"""

import asyncio
import email
import json
import logging
import pathlib
import signal
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings

from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts" / "lib"))
from listening_port import free_port  # noqa: E402

SERVER = sys.argv.pop(1)
RECIPIENTS = pathlib.Path(__file__).with_name("order_recipients.py")
PATIENCE_S = 60
COMMON = "retry_s: 0.1\nlongest_retry_s: 0.2\n"


class Process:
    """A program that answers a line with a line."""

    def __init__(self, *command):
        self.command = command
        self.start()

    def start(self):
        self.process = subprocess.Popen(self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                        text=True)
        self.said = []
        self.reader = threading.Thread(target=lambda pipe, said: said.extend(pipe), args=(self.process.stderr, self.said))
        self.reader.start()
        line = self.process.stdout.readline()
        assert line == "ready\n", (line, self.said)

    def ask(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.wait()

    def wait(self):
        self.process.wait(timeout=PATIENCE_S)
        for pipe in (self.process.stdin, self.process.stdout):
            pipe.close()
        self.reader.join()
        self.process.stderr.close()

    def restart(self):
        self.kill()
        self.start()


class Mailbox:
    """A handler of aiosmtpd that keeps messages, and drops the repeat of a Message-ID, as mailboxes do."""

    def __init__(self):
        self.messages = {}  # content by Message-ID
        self.deliveries = 0
        self.mode = "well"
        self.is_stalled = threading.Event()

    async def handle_DATA(self, _server, _session, envelope):
        if self.mode == "busy":
            return "451 try again later"
        if self.mode == "die":
            raise ConnectionResetError
        message = email.message_from_bytes(envelope.content)
        known = self.messages.setdefault(message["Message-ID"], envelope.content)
        assert known == envelope.content, "the repeat differs"
        self.deliveries += 1
        if self.mode == "keep-stall":
            self.is_stalled.set()
            await asyncio.sleep(PATIENCE_S)
        return "250 OK"


class OrderDelivery(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_orders_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.hazards = 0

    def secret(self, name, text):
        path = self.folder / name
        path.write_text(text + "\n")
        path.chmod(0o600)

    def start_zone(self, recipient):
        (self.folder / "orders.yaml").write_text(
            "recipients:\n  - " + recipient + "\nrules:\n  - {recipient: r, delay_s: 0}\n" + COMMON)
        self.zone = Process(SERVER, str(self.folder / "zone"), str(self.folder / "orders.yaml"))
        self.addCleanup(lambda: self.zone.process.poll() is None and self.zone.kill())

    def start_recipient(self, kind):
        self.port = free_port()
        self.ledger = self.folder / "ledger"
        self.recipient = Process(sys.executable, str(RECIPIENTS), kind, str(self.port), str(self.ledger))
        self.addCleanup(lambda: self.recipient.process.poll() is None and self.recipient.kill())

    def start_webhook(self):
        self.start_recipient("webhook")
        self.secret("hmac", "top-secret-key")
        self.start_zone("{name: r, kind: webhook, url: 'http://127.0.0.1:%d/', secret_file: hmac, timeout_s: 5}" % self.port)

    def start_open311(self, api_key="open-sesame"):
        self.start_recipient("open311")
        self.secret("key", api_key)
        self.start_zone("{name: r, kind: open311, url: 'http://127.0.0.1:%d/v2', api_key_file: key, jurisdiction_id: "
                        "city.example, services: {pothole: '001'}, poll_s: 1, timeout_s: 5}" % self.port)

    def kept(self):
        return [json.loads(line) for line in self.ledger.read_text().splitlines()] if self.ledger.exists() else []

    def confirm(self):
        self.hazards += 1
        return self.zone.ask("new 40.44 %f" % (-79.9 - 0.01 * self.hazards))

    def orders(self):
        return json.loads(self.zone.ask("orders"))

    def wait_for(self, what, condition):
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            self.assertLess(time.monotonic(), deadline, "%s; %s" % (what, self.orders()))
            time.sleep(0.02)

    def wait_for_state(self, *states):
        self.wait_for("orders are %s" % (states,), lambda: len(self.orders()) == self.hazards and
                      all(order["state"] in states for order in self.orders()))

    def wait_for_end(self, process):
        self.wait_for("the recipient is killed", lambda: process.process.poll() is not None)
        process.wait()

    def assert_no_secret(self, secret):
        said = "".join(self.zone.said) + json.dumps(self.orders())
        self.assertNotIn(secret, said)
        for path in (self.folder / "zone").glob("orders.sqlite3*"):
            self.assertNotIn(secret.encode(), path.read_bytes())

    def lives_through(self, kill_modes, other_modes):
        """Orders while the recipient is killed, misbehaves, and the zone is killed; each is kept once."""
        for mode in kill_modes:
            self.recipient.ask(mode)
            self.confirm()
            self.wait_for_end(self.recipient)
            self.recipient.start()
            self.wait_for_state("sent")
        for mode in other_modes:
            self.recipient.ask(mode)
            before = len(self.kept())
            self.confirm()
            if mode == "busy":
                self.wait_for("it was refused", lambda: self.orders()[0]["attempts"] > 1)
            else:
                self.wait_for("it is kept", lambda: len(self.kept()) > before)
            if mode == "keep-stall":
                self.zone.restart()
            self.recipient.ask("well")
            self.wait_for_state("sent")

    def test_a_webhook_keeps_each_order_once(self):
        self.start_webhook()
        self.lives_through(["keep-die", "die"], ["busy", "keep-drop", "keep-500", "keep-stall", "flood"])
        keys = [entry["key"] for entry in self.kept()]
        self.assertEqual(sorted(keys), sorted('"%s"' % order["id"] for order in self.orders()))
        hazards = [json.loads(entry["body"])["hazard"] for entry in self.kept()]
        self.assertEqual(sorted(hazards), sorted(order["hazard"] for order in self.orders()))
        self.assert_no_secret("top-secret-key")

    def test_open311_which_knows_no_repeats_gets_each_order_once(self):
        self.start_open311()
        self.lives_through(["keep-die", "die"], ["busy", "keep-drop", "keep-500", "keep-stall", "flood"])
        self.recipient.ask("token")
        self.confirm()
        self.wait_for_state("sent")
        self.wait_for("each has the recipient's id", lambda: all(order["reference"] for order in self.orders()))
        ids = [entry["service_request_id"] for entry in self.kept()]
        self.assertEqual(sorted(ids), sorted(order["reference"] for order in self.orders()))
        for order in self.orders():
            self.assertEqual(sum(order["id"] in entry["description"] for entry in self.kept()), 1)
        self.assertAlmostEqual(float(self.kept()[0]["lat"]), 40.44)
        self.assertAlmostEqual(float(self.kept()[0]["long"]), -79.91)

    def test_a_request_that_open311_closes_has_its_hazard_verified(self):
        self.start_open311()
        hazard = self.confirm()
        self.wait_for_state("sent")
        self.assertEqual(self.zone.ask("state " + hazard), "active")
        self.recipient.ask("close " + self.orders()[0]["reference"])
        self.wait_for_state("closed")
        self.wait_for("the hazard is verified", lambda: self.zone.ask("state " + hazard) == "verifying")

    def test_a_refusal_that_repeats_the_key_shows_it_nowhere(self):
        self.start_open311(api_key="wrong-but-secret")
        self.confirm()
        self.wait_for("it is refused", lambda: any("not valid" in order["error"] for order in self.orders()))
        self.assertEqual(self.kept(), [])
        self.assert_no_secret("wrong-but-secret")

    def test_the_zone_is_killed_at_any_moment(self):
        self.start_open311()
        for round_number in range(6):
            for _ in range(5):
                self.confirm()
            time.sleep(0.05 * round_number)
            self.zone.restart()
        self.wait_for_state("sent")
        ids = [entry["service_request_id"] for entry in self.kept()]
        self.assertEqual(len(ids), 30)
        self.assertEqual(sorted(ids), sorted(order["reference"] for order in self.orders()))

    def make_certificate(self, name):
        key, certificate = self.folder / (name + ".key"), self.folder / (name + ".pem")
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                        "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-days", "2", "-keyout", str(key),
                        "-out", str(certificate)], check=True, capture_output=True)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(certificate, key)
        return context

    def start_mail(self, trusted="server"):
        context = self.make_certificate("server")
        if trusted != "server":
            self.make_certificate(trusted)
        self.secret("password", "mail-password")
        self.mailbox = Mailbox()

        def log_in(_server, _session, _envelope, mechanism, data):
            right = mechanism in ("PLAIN", "LOGIN") and (data.login, data.password) == (b"map", b"mail-password")
            return AuthResult(success=right)

        controller = Controller(self.mailbox, hostname="localhost", port=free_port(), tls_context=context, require_starttls=True,
                                authenticator=log_in, auth_required=True)
        controller.start()
        self.addCleanup(controller.stop)
        self.start_zone("{name: r, kind: mail, server: 'smtp://localhost:%d', user: map, password_file: password, from: "
                        "map@city.example, to: [roads@city.example, night@city.example], ca_file: %s.pem, timeout_s: 5}" %
                        (controller.port, trusted))

    def test_a_mailbox_keeps_each_order_once(self):
        self.start_mail()
        self.confirm()
        self.wait_for_state("sent")
        for mode in ("busy", "die"):
            self.mailbox.mode = mode
            self.confirm()
            self.wait_for("it was refused", lambda: self.orders()[0]["attempts"] > 1)
            self.mailbox.mode = "well"
            self.wait_for_state("sent")
        self.mailbox.mode = "keep-stall"
        self.confirm()
        self.assertTrue(self.mailbox.is_stalled.wait(PATIENCE_S))
        self.zone.kill()
        self.mailbox.mode = "well"
        self.zone.start()
        self.wait_for_state("sent")
        # SMTP cannot be asked: the message came twice, and the mailbox dropped the second one.
        self.assertEqual(self.mailbox.deliveries, 5)
        self.assertEqual(sorted(self.mailbox.messages),
                         sorted("<%s@city.example>" % order["id"] for order in self.orders()))
        text = email.message_from_bytes(next(iter(self.mailbox.messages.values())))
        self.assertEqual(text["To"], "roads@city.example,\r\n night@city.example")
        self.assertIn("Confirmed by: miller", text.get_payload(decode=True).decode())
        self.assert_no_secret("mail-password")

    def test_a_server_whose_certificate_nobody_vouches_for_gets_nothing(self):
        self.start_mail(trusted="stranger")
        self.confirm()
        self.wait_for("it is refused", lambda: any("certificate" in order["error"] for order in self.orders()))
        self.assertEqual(self.mailbox.deliveries, 0)


def run_all_at_once():
    """Each test in a process of its own: most of the time they wait."""
    names = unittest.TestLoader().getTestCaseNames(OrderDelivery)
    runs = [subprocess.Popen([sys.executable, __file__, SERVER, "OrderDelivery." + name]) for name in names]
    return max([run.wait() for run in runs])


if __name__ == "__main__":
    if len(sys.argv) == 1:
        sys.exit(run_all_at_once())
    # Of aiosmtpd: clients that go away are what is tried here.
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore", DeprecationWarning)
    unittest.main(warnings="ignore")
