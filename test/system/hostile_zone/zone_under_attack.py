"""A real zone with its own ROS master, and what an onlooker sees of it: its memory, its store, its map.

A Zone that is entered sets ROS_MASTER_URI: enter it before anything of rospy is used."""

import contextlib
import json
import os
import pathlib
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import time
import urllib.request
import uuid

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(ROOT / "scripts/lib"))
from listening_port import free_port  # noqa: E402

OFFICIAL, TOKEN = "miller", "correct-horse-battery-staple"
PATIENCE_S = 120


class ZoneError(RuntimeError):
    """What keeps the attacks from being tried, in one sentence."""


def wait_until(is_so, what, patience_s=PATIENCE_S):
    deadline = time.monotonic() + patience_s
    while True:
        value = is_so()
        if value:
            return value
        if time.monotonic() > deadline:
            raise ZoneError(f"{what} did not happen within {patience_s} s")
        time.sleep(0.05)


def program(name):
    """The package's program. rosrun does not look into a build folder below the package."""
    folders = subprocess.run(["catkin_find", "--libexec", "livemap"], capture_output=True, text=True, check=False).stdout
    for folder in folders.splitlines():
        if (path := pathlib.Path(folder) / name).is_file():
            return path
    raise ZoneError(f"there is no program {name} of the package livemap: is its environment set up?")


def end_group(process):
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


class Zone:
    """roscore and zone_cloudlet in a folder of their own. `settings` are private parameters."""

    def __init__(self, directory, **settings):
        self.directory = pathlib.Path(directory)
        self.directory.mkdir(parents=True, exist_ok=True)
        tokens = self.directory / "tokens"
        tokens.write_text(f"{OFFICIAL} {TOKEN}\n", encoding="utf-8")
        tokens.chmod(0o600)
        self.port = free_port()
        self.settings = {"directory": self.directory / "zone", "web_port": self.port, "web_token_file": tokens,
                         "diagnostics_period_s": 0.5} | settings
        self.master_port = free_port()
        self.processes = []

    def __enter__(self):
        os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{self.master_port}"
        os.environ["ROS_IP"] = "127.0.0.1"
        try:
            self.run("master", ["roscore", "-p", str(self.master_port)])
            wait_until(self.has_master, "the start of the ROS master")
            self.run("zone", [program("zone_cloudlet"), "__name:=zone_cloudlet"] +
                     [f"_{name}:={value}" for name, value in self.settings.items()])
            wait_until(self.is_served, "the start of the zone")
            self.pid = self.processes[-1].pid
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for process in reversed(self.processes):
            end_group(process)

    def run(self, name, command):
        with open(self.directory / f"{name}.log", "ab") as log:
            self.processes.append(subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log,
                                                   stderr=subprocess.STDOUT, start_new_session=True))

    def has_master(self):
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.master_port)) == 0

    def is_served(self):
        if self.processes[-1].poll() is not None:
            raise ZoneError(f"the zone ended, see {self.directory / 'zone.log'}")
        with contextlib.suppress(OSError):
            return self.get("/healthz")["status"] == "ok"
        return False

    def memory_mb(self, line="VmRSS"):
        for text in pathlib.Path(f"/proc/{self.pid}/status").read_text(encoding="utf-8").splitlines():
            if text.startswith(line + ":"):
                return int(text.split()[1]) / 1024
        raise ZoneError("the zone is gone")

    def url(self, address):
        return f"http://127.0.0.1:{self.port}{address}"

    def get(self, address, patience_s=30):
        with urllib.request.urlopen(self.url(address), timeout=patience_s) as answer:
            return json.load(answer)

    def points(self):
        """The header and the rows of /api/v1/hazards/points."""
        with urllib.request.urlopen(self.url("/api/v1/hazards/points"), timeout=60) as answer:
            lines = answer.read().splitlines()
        return json.loads(lines[0]), [json.loads(line) for line in lines[1:]]

    def store(self, query, *values):
        uri = f"file:{self.directory / 'zone' / 'zone.sqlite3'}?mode=ro"
        with contextlib.closing(sqlite3.connect(uri, uri=True, timeout=30)) as database:
            return database.execute(query, values).fetchall()


class Reporter:
    """Sends reports to the zone by ROS, as its bridge does, and keeps the receipts."""

    def __init__(self):
        import rospy
        from livemap.msg import CellHazards, CellRequest, HazardReport, ReportReceipt, VehiclePosition
        self.rospy, self.report_class, self.position_class = rospy, HazardReport, VehiclePosition
        self.request_class = CellRequest
        rospy.init_node("hostile_zone", anonymous=True, disable_signals=True)
        self.lock = threading.Lock()
        self.receipts, self.told_cells = {}, {}
        self.subscriber = rospy.Subscriber("hazard/receipt", ReportReceipt, self.keep, queue_size=100000)
        self.publisher = rospy.Publisher("hazard/report", HazardReport, queue_size=100000)
        self.positions = rospy.Publisher("vehicle/position", VehiclePosition, queue_size=10000)
        self.cell_requests = rospy.Publisher("hazard/cell_request", CellRequest, queue_size=100000)
        self.cell_subscriber = rospy.Subscriber("hazard/cell_hazards", CellHazards, self.count_cells, queue_size=100000)
        wait_until(lambda: self.publisher.get_num_connections() and self.positions.get_num_connections() and
                   self.subscriber.get_num_connections(), "the zone's subscription to reports")

    def keep(self, receipt):
        with self.lock:
            self.receipts[receipt.report_uuid] = receipt

    def count_cells(self, news):
        with self.lock:
            self.told_cells[news.vehicle_id] = self.told_cells.get(news.vehicle_id, 0) + len(news.cells)

    def cells_told(self, vehicle):
        with self.lock:
            return self.told_cells.get(vehicle, 0)

    def ask_cells(self, vehicle, cells, odd=False):
        """`odd`: about cells that do not exist, and with too few sequences."""
        self.cell_requests.publish(self.request_class(
            schema_version=self.request_class.SCHEMA_VERSION, vehicle_id=vehicle,
            cells=[0xffffffff - cell for cell in cells] if odd else cells, sequences=[0] * (len(cells) - odd)))

    def receipt(self, report):
        with self.lock:
            return self.receipts.get(report.uuid)

    def make(self, vehicle, latitude, longitude, class_name="pothole", age_s=1.0, image=b"", image_format="jpeg"):
        report = self.report_class(schema_version=self.report_class.SCHEMA_VERSION, uuid=uuid.uuid4().bytes,
                                   vehicle_id=vehicle, drive_id="drive-1", class_name=class_name, confidence=0.8,
                                   x_min=10, y_min=20, x_max=110, y_max=90, latitude=latitude, longitude=longitude,
                                   covariance=[1.0, 0.0, 0.0, 1.0], image_width=640, image_height=480)
        report.stamp = self.rospy.Time.from_sec(time.time() - age_s)
        report.image.data, report.image.format = image, image_format if image else ""
        return report

    def send(self, report):
        self.publisher.publish(report)

    def tell_position(self, vehicle, latitude, longitude, age_s=0.0, speed=10.0):
        self.positions.publish(self.position_class(
            schema_version=self.position_class.SCHEMA_VERSION, vehicle_id=vehicle, drive_id="drive-1",
            stamp=self.rospy.Time.from_sec(time.time() - age_s), latitude=latitude, longitude=longitude, course=1.0,
            speed=speed, horizontal_sigma=2.0))

    def fill(self, count, per_vehicle=100):
        """Puts `count` hazards on the map, 30 m apart, each vehicle a row of them; waits until all are committed."""
        reports = []
        for number in range(count):
            vehicle, place = divmod(number, per_vehicle)
            reports.append(self.make(f"filler-{vehicle}", 40 + 0.0003 * place, -80 + 0.0005 * vehicle,
                                     age_s=2 * (per_vehicle - place) + 1))
        for first in range(0, count, 2000):
            batch = reports[first:first + 2000]
            for report in batch:
                self.send(report)
            wait_until(lambda waiting=batch: all(self.receipt(report) for report in waiting), "the filling of the map")
        refused = [receipt.reason for report in reports if (receipt := self.receipt(report)).status != receipt.COMMITTED]
        if refused:
            raise ZoneError(f"{len(refused)} of {count} reports that fill the map were refused: {refused[0]}")
