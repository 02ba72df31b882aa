"""Real zones that can be killed and come back at their address, and a real region that follows them."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "web", "page"))
from map_page_fixture import HANG_S, ZoneProcess  # noqa: E402


ROOT = os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, os.pardir)
FILES = ("--web-root", os.path.join(ROOT, "web"), "--catalogue", os.path.join(ROOT, "config", "hazards.yaml"))


def eventually(condition, what):
    """What the condition answers as soon as it holds."""
    end = time.monotonic() + HANG_S
    while time.monotonic() < end:
        if found := condition():
            return found
        time.sleep(0.05)
    raise AssertionError(what)


class Door:
    """One address for a zone whose process gets another port at every start; shut, nobody comes in."""

    def __init__(self):
        self.target = None
        self.port = 0
        self.open()
        self.port = self.listener.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"

    def open(self):
        self.listener = socket.create_server(("127.0.0.1", self.port))
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                guest, _ = self.listener.accept()
            except OSError:
                return
            try:
                host = socket.create_connection(("127.0.0.1", self.target))
            except (OSError, TypeError, OverflowError):
                guest.close()
                continue
            for one, other in ((guest, host), (host, guest)):
                threading.Thread(target=self.carry, args=(one, other), daemon=True).start()

    @staticmethod
    def carry(one, other):
        try:
            while data := one.recv(1 << 16):
                other.sendall(data)
        except OSError:
            pass
        finally:
            # The other way ends, too: an answer is whole by then.
            one.close()
            other.close()

    def close(self):
        """Whoever knocks is refused, as where no process listens."""
        self.listener.shutdown(socket.SHUT_RDWR)  # Else whoever waits for guests keeps it open.
        self.listener.close()


class Zone:
    """The zone's process with a store that stays."""

    def __init__(self, folder):
        os.makedirs(folder, exist_ok=True)
        self.folder = folder
        self.door = Door()
        self.process = None

    @property
    def url(self):
        return self.door.url

    def start(self):
        self.process = ZoneProcess("", "", self.folder)
        self.door.target = self.process.port

    def kill(self):
        """As a power cut does."""
        self.door.target = None
        self.process.process.kill()
        self.process.process.wait()
        self.process.process.stdin.close()
        self.process.process.stdout.close()
        self.process = None

    def begin_anew(self):
        """Killed, and its store is lost."""
        self.kill()
        self.folder += "_anew"
        os.makedirs(self.folder)
        self.start()

    def add(self, class_name, lat, lon):
        """A hazard of which drivers are told."""
        hazard = self.process.report(class_name, lat, lon, picture=False)
        assert self.process.do("confirm", id=hazard)["confirmed"]
        return hazard

    def close(self):
        if self.process:
            self.kill()
        self.door.close()


class Region:
    """The region's program."""

    def __init__(self, program, folder, *arguments):
        self.arguments = [program, *FILES, "--port", "0", "--store", folder, "--ask-every-s", "0.2", "--timeout-s", "5", *arguments]
        self.lines = []
        self.process = None

    def start(self):
        self.lines = []
        self.process = subprocess.Popen(self.arguments, stderr=subprocess.PIPE, text=True)
        threading.Thread(target=self.read, args=(self.process,), daemon=True).start()
        ready = re.compile(r"ready with .* live map at (\S+)/$")
        self.url = eventually(lambda: next((found.group(1) for line in self.lines if (found := ready.search(line))), None),
                              f"the region does not start: {self.lines}")

    def read(self, process):
        for line in process.stderr:
            self.lines.append(line.rstrip("\n"))

    def end(self, with_signal=signal.SIGTERM):
        """Its exit status."""
        self.process.send_signal(with_signal)
        status = self.process.wait(timeout=HANG_S)
        self.process.stderr.close()
        self.process = None
        return status

    def close(self):
        if self.process:
            self.end(signal.SIGKILL)

    def get(self, path):
        with urllib.request.urlopen(self.url + path, timeout=HANG_S) as answer:
            return answer.read().decode()

    def is_ready(self):
        try:
            return json.loads(self.get("/readyz")) == {"status": "ready"}
        except urllib.error.HTTPError as error:
            error.close()
            return False

    def hazards(self):
        """Features by the region's id."""
        return {one["id"]: one for one in json.loads(self.get("/api/v1/hazards"))["features"]}

    def zones(self):
        """Properties by the zone's id."""
        return {one["id"]: one["properties"] for one in json.loads(self.get("/api/v1/zones"))["features"]}


def directory_of(features, folder):
    """Files of a zone directory signed by a new authority: (directory, certificate)."""
    scripts = os.path.join(ROOT, "scripts")
    identity = os.path.join(folder, "identity")
    text = os.path.join(folder, "zones.geojson")
    signed = os.path.join(folder, "zones.cms")
    with open(text, "w", encoding="utf-8") as file:
        json.dump({"type": "FeatureCollection", "features": features}, file)
    python = "/usr/bin/python3"
    subprocess.run([python, os.path.join(scripts, "livemap_zone_identity"), "init", identity, "--zone", "town",
                    "--host", "localhost"], check=True, capture_output=True)
    subprocess.run([python, os.path.join(scripts, "livemap_sign_directory"), text, "--out", signed, "--dir", identity,
                    "--checker", "/bin/true"], check=True, capture_output=True)
    return signed, os.path.join(identity, "authority", "ca.pem")


def square(zone, name, south, west, north, east, url):
    """A zone of a directory."""
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    return {"type": "Feature", "id": zone, "geometry": {"type": "Polygon", "coordinates": [ring]},
            "properties": {"name": name, "map": url, "brokers": [{"host": "localhost", "port": 8883}]}}


def temporary_folder(test):
    folder = tempfile.TemporaryDirectory(prefix="livemap_region_")
    test.addCleanup(folder.cleanup)
    return folder.name
