"""A zone with certificates in a folder of its own, made by `livemap zone`, and its real mosquitto on a free port."""

import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time

from mqtt_sender import PATIENCE_S, Sender, tls_context

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/lib"))
from listening_port import free_port  # noqa: E402

ZONE = "test"


def livemap_zone(*arguments):
    """Runs `./livemap zone ARGUMENTS`'s program; the finished process with its output."""
    return subprocess.run(["/usr/bin/python3", str(ROOT / "scripts" / "livemap_zone_identity"), *map(str, arguments)],
                          capture_output=True, text=True, check=False)


def topic(vehicle, name):
    return f"livemap/v1/{ZONE}/vehicle/{vehicle}/{name}"


NOTICE = f"livemap/v1/{ZONE}/notice"


class Zone:
    """`broker` is the process once `start` was called."""

    def __init__(self, *init_arguments):
        self.folder = tempfile.TemporaryDirectory(prefix="livemap_identity_")
        self.directory = os.path.join(self.folder.name, "zone")
        self.port = free_port()
        self.broker = None
        self.succeed("init", self.directory, "--zone", ZONE, "--port", self.port, *init_arguments)

    def succeed(self, *arguments):
        result = livemap_zone(*arguments)
        if result.returncode:
            raise AssertionError(f"livemap zone {arguments} ended with {result.returncode}: {result.stderr}")
        return result.stdout

    def enroll(self, vehicle):
        self.succeed("enroll", vehicle, "--dir", self.directory)
        return self.identity(vehicle)

    def revoke(self, vehicle):
        return self.succeed("revoke", vehicle, "--dir", self.directory)

    def identity(self, name):
        folder = "zone" if name == "zone" else os.path.join("vehicles", name)
        return os.path.join(self.directory, folder)

    def start(self):
        with open(self.log, "ab") as log:
            command = ["/usr/sbin/mosquitto", "-c", os.path.join(self.directory, "mosquitto.conf")]
            self.broker = subprocess.Popen(command, stdout=log, stderr=log)
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                return
            except OSError as error:
                if self.broker.poll() is not None or time.monotonic() > deadline:
                    raise AssertionError(f"the broker does not run: {self.words()}") from error
                time.sleep(0.02)

    @property
    def log(self):
        return os.path.join(self.folder.name, "broker.log")

    def words(self):
        return pathlib.Path(self.log).read_text(errors="replace")

    def kill(self, how=signal.SIGKILL):
        if self.broker:
            self.broker.send_signal(how)
            self.broker.wait()
            self.broker = None

    def connect(self, name, **options):
        """A connection with the identity of `name`, which is its client id as well unless told otherwise."""
        options.setdefault("client_id", name)
        return Sender(self.port, options.pop("context", None) or tls_context(self.identity(name)), **options)

    def close(self):
        self.kill()
        self.folder.cleanup()
