#!/usr/bin/python3
"""A real mosquitto, started by livemap_broker on a folder that a power loss left behind, or where it cannot listen."""

import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import unittest.mock

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/lib"))
import listening_port  # noqa: E402
from listening_port import free_port  # noqa: E402

PATIENCE_S = 60


def answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


class BrokerFolder:
    """A broker's folder and the process that runs on it."""

    def __init__(self, folder, *arguments):
        self.folder, self.arguments, self.process = pathlib.Path(folder), list(arguments), None
        self.log = tempfile.TemporaryFile()

    @property
    def state(self):
        return self.folder / "data" / "mosquitto.db"

    def set_aside(self):
        return sorted(self.state.parent.glob("mosquitto.db.torn-*"))

    def start(self, port):
        """Until it listens; False where it ends instead."""
        self.log.seek(0)
        self.log.truncate()
        self.process = subprocess.Popen(["/usr/bin/python3", str(ROOT / "scripts/livemap_broker"), *map(str, self.arguments)],
                                        stdout=self.log, stderr=self.log, stdin=subprocess.DEVNULL)
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            if self.process.poll() is not None:
                break
            if self.listens(port):
                return True
            time.sleep(0.02)
        return False

    def listens(self, port):
        """Whether this very process is mosquitto and answers."""
        name = pathlib.Path(f"/proc/{self.process.pid}/comm").read_text().strip()
        return name == "mosquitto" and answers(port)

    def words(self):
        self.log.seek(0)
        return self.log.read().decode("utf-8", "replace")

    def stop(self, how=signal.SIGTERM):
        """mosquitto forgets a signal that comes after it listens and before its loop begins: then it is told again."""
        deadline = time.monotonic() + PATIENCE_S
        while self.process and self.process.poll() is None:
            self.process.send_signal(how)
            try:
                self.process.wait(1)
            except subprocess.TimeoutExpired:
                if time.monotonic() > deadline:
                    raise

    def close(self):
        self.stop()
        self.log.close()


class BrokerStart(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_broker_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.port = free_port()

    def broker(self, folder, **flags):
        flags = {"port": self.port, "zone": "demo", "vehicles": "car-1", **flags}
        broker = BrokerFolder(folder, "--directory", folder, *(f"--{name}={value}" for name, value in flags.items()))
        self.addCleanup(broker.close)
        return broker

    def started_once(self, folder):
        broker = self.broker(folder)
        self.assertTrue(broker.start(self.port), broker.words())
        self.keep_a_message(broker)
        broker.stop()
        self.assertGreater(broker.state.stat().st_size, 100)
        return broker

    def keep_a_message(self, broker):
        """In the queue of a client that is away."""
        login = ["-p", str(self.port), "-u", "zone", "-i", "zone", "-P",
                 (broker.folder / "credentials/zone").read_text().strip(), "-q", "1", "-V", "5"]
        session = [*login, "-t", "livemap/v1/demo/notice", "-x", "600", "-c"]
        subprocess.run(["mosquitto_sub", *session, "-E"], check=True, timeout=PATIENCE_S)
        car = [*login[:2], "-u", "car-1", "-i", "car-1", "-P", (broker.folder / "credentials/car-1").read_text().strip()]
        subprocess.run(["mosquitto_pub", *car, "-q", "1", "-t", "livemap/v1/demo/vehicle/car-1/report", "-m", "m" * 500],
                       check=True, timeout=PATIENCE_S)

    def test_a_state_file_that_cannot_be_restored_is_set_aside_with_a_sentence_and_the_broker_runs(self):
        broker = self.started_once(self.folder / "broker")
        whole = broker.state.read_bytes()
        torn = {"zeroed": bytes(4096), "noise": os.urandom(999), "cut short": whole[:len(whole) // 2],
                "its head alone": whole[:10], "the end missing": whole[:-1]}
        for number, (name, data) in enumerate(torn.items(), 1):
            with self.subTest(name):
                broker.state.write_bytes(data)
                self.assertTrue(broker.start(self.port), broker.words())
                kept = broker.set_aside()
                self.assertEqual(len(kept), number)
                self.assertIn(data, [path.read_bytes() for path in kept])
                lines = [line for line in broker.words().splitlines() if line.startswith("livemap_broker: ")]
                self.assertEqual(len(lines), 1, broker.words())
                for part in (f"'{broker.state}' cannot be restored", "was set aside as", "no receipt"):
                    self.assertIn(part, lines[0])
                broker.stop(signal.SIGKILL)

    def test_a_folder_in_the_place_of_the_state_file_is_set_aside_too(self):
        broker = self.started_once(self.folder / "broker")
        broker.state.unlink()
        broker.state.mkdir()
        self.assertTrue(broker.start(self.port), broker.words())
        self.assertEqual(len(broker.set_aside()), 1)

    def test_a_whole_state_file_is_kept_with_its_messages(self):
        broker = self.started_once(self.folder / "broker")
        before = broker.state.read_bytes()
        self.assertTrue(broker.start(self.port), broker.words())
        self.assertEqual(broker.set_aside(), [])
        self.assertEqual(broker.state.read_bytes(), before)
        self.assertEqual([path.name for path in broker.state.parent.iterdir()], ["mosquitto.db"])
        self.assertNotIn("livemap_broker:", broker.words())

    def test_a_port_that_is_taken_is_named_with_the_program_that_has_it(self):
        with socket.socket() as other:
            other.bind(("127.0.0.1", self.port))
            other.listen()
            broker = self.broker(self.folder / "broker")
            self.assertFalse(broker.start(self.port))
        self.assertEqual(broker.process.returncode, 2)
        said = broker.words().splitlines()
        self.assertEqual(len(said), 1, said)
        self.assertIn(f"port {self.port} of 127.0.0.1 is in use already by", said[0])
        self.assertIn(f"(process {os.getpid()})", said[0])

    def test_an_address_of_another_machine_is_named(self):
        broker = self.broker(self.folder / "broker", address="192.0.2.7")
        self.assertFalse(broker.start(self.port))
        self.assertEqual(broker.process.returncode, 2)
        self.assertIn("address '192.0.2.7' is not one of this machine", broker.words())

    def test_a_folder_with_blanks_quotes_dollars_and_other_letters_serves(self):
        folder = self.folder / "my $HOME's \"d\u00fcrst\" #1"
        broker = self.started_once(folder)
        broker.state.write_bytes(bytes(4096))
        self.assertTrue(broker.start(self.port), broker.words())
        self.assertEqual(len(broker.set_aside()), 1)

    def test_a_torn_password_file_is_made_anew_and_says_so(self):
        broker = self.started_once(self.folder / "broker")
        path = broker.folder / "credentials/car-1"
        path.write_bytes(bytes(33))
        self.assertTrue(broker.start(self.port), broker.words())
        self.assertIn(f"'{path}' holds no password, so a new one was made: give it to car-1 again", broker.words())
        self.keep_a_message(broker)


class BrokerWithCertificates(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_broker_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name) / "an identity"
        self.port = free_port()
        self.init()
        self.broker = BrokerFolder(self.folder, "--identity", self.folder)
        self.addCleanup(self.broker.close)

    def init(self):
        done = subprocess.run(["/usr/bin/python3", str(ROOT / "scripts/livemap_zone_identity"), "init", str(self.folder),
                               "--zone", "demo", "--port", str(self.port)], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_init_names_the_command_that_runs_its_broker(self):
        self.assertIn(f"./livemap broker --identity '{self.folder}'", self.init())

    def test_a_torn_state_file_is_set_aside_there_too(self):
        self.broker.state.write_bytes(bytes(4096))
        self.assertTrue(self.broker.start(self.port), self.broker.words())
        self.assertEqual(len(self.broker.set_aside()), 1)
        self.assertIn("was set aside as", self.broker.words())

    def test_a_port_that_is_taken_is_named_there_too(self):
        with socket.socket() as other:
            other.bind(("127.0.0.1", self.port))
            other.listen()
            self.assertFalse(self.broker.start(self.port))
        self.assertIn(f"port {self.port} of 127.0.0.1 is in use already", self.broker.words())

    def test_a_torn_certificate_is_named_and_init_makes_it_anew(self):
        for name in ("certificate.pem", "key.pem"):
            path = self.folder / "broker" / name
            path.write_bytes(path.read_bytes()[:100])
            self.assertFalse(self.broker.start(self.port))
            self.assertEqual(self.broker.process.returncode, 2)
            self.assertIn(f"'{path}' is damaged, ./livemap zone init makes the broker's certificate anew",
                          self.broker.words())
            self.init()
            self.assertTrue(self.broker.start(self.port), self.broker.words())
            self.broker.stop()

    def test_another_flag_is_refused_because_the_zones_configuration_holds_it(self):
        self.broker.arguments += ["--port", str(self.port)]
        self.assertFalse(self.broker.start(self.port))
        self.assertEqual(self.broker.process.returncode, 2)
        self.assertIn("--identity takes no other flag", self.broker.words())


class FreePort(unittest.TestCase):
    """Ports for servers that are started later."""

    ASK = "import listening_port, sys; print(listening_port.free_port(), flush=True); sys.stdin.read()"

    def test_a_free_port_is_given_to_nobody_else_while_who_asked_lives(self):
        with open("/proc/sys/net/ipv4/ip_local_port_range", encoding="ascii") as file:
            drawn = range(*map(int, file.read().split()))
        given = [free_port() for _ in range(20)]
        other = subprocess.Popen([sys.executable, "-c", self.ASK], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                 env=dict(os.environ, PYTHONPATH=str(ROOT / "scripts/lib")))
        self.addCleanup(other.wait)
        self.addCleanup(other.stdin.close)
        self.addCleanup(other.stdout.close)
        others = int(other.stdout.readline())
        self.assertEqual(len(set(given)), 20)
        if drawn.start >= listening_port.FREE_PORTS.stop:
            self.assertFalse([port for port in given if port in drawn], f"the system draws {drawn}")
        with unittest.mock.patch.object(listening_port, "FREE_PORTS", range(others, others + 1)):
            with self.assertRaises(OSError):
                free_port()
            other.stdin.close()
            other.wait()
            self.assertEqual(free_port(), others)


if __name__ == "__main__":
    for program in ("/usr/sbin/mosquitto", "/usr/bin/mosquitto_sub"):
        if not os.path.exists(program):
            sys.exit(f"{program} is missing: ./livemap setup --dev installs it")
    unittest.main()
