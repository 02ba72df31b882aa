"""What the demo watches: the live map as a browser sees it, and the vehicle's own counts."""

import bisect
import datetime
import http.client
import json
import math
import os
import sys
import threading
import time
import urllib.request
import xmlrpc.client

import rospy
import websocket
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock

from system_error import StartError

# Key-values of /diagnostics that the summary is made of, per nodelet.
COUNTS = {
    "camera_ingest": ("frames_in", "frames_published", "frames_dropped", "frames_bad"),
    "hazard_detection": ("frames_in", "frames_processed", "frames_dropped", "frames_in_one_view", "detections"),
    "hazard_reporting": ("detections", "reports_created", "committed", "refused", "pending",
                         "duplicates_suppressed", "waiting_frames", "settling_reports"),
    "mqtt_bridge": ("uplink_bytes",),
}
# Only small vehicles have this one.
DISCARD = "early_discard"


def parse_time(text):
    """RFC 3339 in UTC to seconds since the epoch."""
    return datetime.datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()


class MapClient:
    """A client of the live map: hears every event over the WebSocket, as the page does."""

    def __init__(self, url):
        self.url = url
        self.lock = threading.Lock()
        self.first_heard = {}
        self.hazards = {}
        self.sequence = 0
        self.socket = websocket.create_connection(
            "ws" + url[len("http"):] + "ws?since=0", timeout=5)
        self.socket.settimeout(None)
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self):
        while True:
            try:
                message = json.loads(self.socket.recv())
            except (websocket.WebSocketException, OSError, ValueError):
                return
            if message.get("type") == "hazard":
                self._take(message)

    def _take(self, message):
        heard = time.time()
        with self.lock:
            self.sequence = max(self.sequence, message["sequence"])
            identity = message["feature"]["properties"]["id"]
            if message["action"] == "removed":
                self.hazards.pop(identity, None)
                return
            self.hazards[identity] = message["feature"]
            if message["action"] == "added":
                stamp = parse_time(message["feature"]["properties"]["first_seen"])
                self.first_heard.setdefault(identity, (stamp, heard))

    def seen(self):
        with self.lock:
            return set(self.hazards)

    def latencies_ms(self, wall_time_of):
        """From the image's stamp to the map, for every hazard that was added."""
        with self.lock:
            return [1000.0 * (heard - wall_time_of(stamp))
                    for stamp, heard in self.first_heard.values()]

    def _get(self, path):
        try:
            with urllib.request.urlopen(self.url + path, timeout=10) as answer:
                return json.load(answer)
        except (OSError, ValueError) as error:
            raise StartError(f"the live map does not answer {self.url + path}: {error}") from error

    def stored_sequence(self):
        return self._get("api/v1/hazards?limit=1")["sequence"]

    def stored_hazards(self):
        """What the zone has stored: id, class, longitude, latitude of each."""
        features = self._get("api/v1/hazards?limit=50000")["features"]
        return [{"id": f["properties"]["id"], "class": f["properties"]["class"],
                 "longitude": f["geometry"]["coordinates"][0],
                 "latitude": f["geometry"]["coordinates"][1]} for f in features]

    def wait_for_sequence(self, sequence, timeout_s):
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            with self.lock:
                if self.sequence >= sequence:
                    return
            time.sleep(0.05)


class VehicleObserver:
    """Counts and clock of the vehicle, read on its ROS master."""

    def __init__(self, master_uri, detects=True):
        """`detects`: whether a detector runs there; else its answers come from the drive."""
        self.nodelets = [name for name in COUNTS if detects or name != "hazard_detection"]
        os.environ["ROS_MASTER_URI"] = master_uri
        os.environ["ROS_HOSTNAME"] = "127.0.0.1"
        self.lock = threading.Lock()
        self.values = {}
        self.clock_sim, self.clock_wall = [], []
        wait_for_master(master_uri)
        if not rospy.core.is_initialized():
            rospy.init_node("livemap_demo", anonymous=True, disable_signals=True)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._take_diagnostics, queue_size=100)
        rospy.Subscriber("/clock", Clock, self._take_clock, queue_size=1000)

    def _take_diagnostics(self, message):
        with self.lock:
            for status in message.status:
                if status.hardware_id in COUNTS or status.hardware_id == DISCARD:
                    self.values.setdefault(status.hardware_id, {}).update(
                        {pair.key: pair.value for pair in status.values})

    def _take_clock(self, message):
        with self.lock:
            sim = message.clock.to_sec()
            if not self.clock_sim or sim > self.clock_sim[-1]:
                self.clock_sim.append(sim)
                self.clock_wall.append(time.time())

    def wall_time_of(self, stamp):
        """When the replay's clock showed `stamp`, interpolated between two clock messages."""
        with self.lock:
            i = min(max(bisect.bisect(self.clock_sim, stamp), 1), len(self.clock_sim) - 1)
            sim0, sim1 = self.clock_sim[i - 1], self.clock_sim[i]
            wall0, wall1 = self.clock_wall[i - 1], self.clock_wall[i]
            return wall0 + (stamp - sim0) * (wall1 - wall0) / (sim1 - sim0)

    def clock_s(self):
        """What the replay's clock showed last."""
        with self.lock:
            return self.clock_sim[-1] if self.clock_sim else 0.0

    def clock_share(self, drive):
        """How much of a drive the replay's clock has shown, 0 to 1."""
        with self.lock:
            if not self.clock_sim:
                return 0.0
            return (self.clock_sim[-1] - drive.start_s) / drive.duration_s

    def wait_until_up(self, timeout_s, nodelets=None):
        """Until every one of `nodelets` (all that run, unless said) has told its counts."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            with self.lock:
                missing = [name for name in nodelets or self.nodelets if name not in self.values]
            if not missing:
                return
            time.sleep(0.1)
        raise StartError(f"no diagnostics from {', '.join(missing)} within {timeout_s} s")

    def _count(self, nodelet, key):
        return int(float(self.values.get(nodelet, {}).get(key, 0)))

    def counts(self):
        with self.lock:
            return {
                "frames_in": self._count("camera_ingest", "frames_in"),
                "frames_published": self._count("camera_ingest", "frames_published"),
                "frames_processed": self._count("hazard_detection", "frames_processed"),
                "frames_dropped": (self._count("camera_ingest", "frames_dropped")
                                   + self._count("camera_ingest", "frames_bad")
                                   + self._count("hazard_detection", "frames_dropped")
                                   + self._count(DISCARD, "frames_dropped")),
                "frames_in_one_view": self._count("hazard_detection", "frames_in_one_view"),
                "frames_judged": self._count(DISCARD, "frames_judged"),
                "detections": self._count("hazard_detection", "detections"),
                "detections_taken": self._count("hazard_reporting", "detections"),
                "duplicates_suppressed": self._count("hazard_reporting", "duplicates_suppressed"),
                "reports_created": self._count("hazard_reporting", "reports_created"),
                "committed": self._count("hazard_reporting", "committed"),
                "refused": self._count("hazard_reporting", "refused"),
                "pending": self._count("hazard_reporting", "pending"),
                "frames_waiting": self._count("hazard_reporting", "waiting_frames"),
                "reports_settling": self._count("hazard_reporting", "settling_reports"),
                "uplink_bytes": self._count("mqtt_bridge", "uplink_bytes"),
            }

    def is_through(self, drive):
        """Every frame processed or dropped, and every report answered by the zone."""
        counts = self.counts()
        if "hazard_detection" in self.nodelets:
            detected = (counts["frames_processed"] + counts["frames_dropped"] >= drive.frames
                        and counts["detections_taken"] >= counts["detections"])
        else:
            # A second beyond the end: what waited for a position has been placed.
            detected = self.clock_s() > drive.start_s + drive.duration_s + 1.0
        return (counts["frames_in"] >= drive.frames and detected
                and counts["committed"] + counts["refused"] >= counts["reports_created"]
                and counts["frames_waiting"] == 0 and counts["reports_settling"] == 0 and counts["pending"] == 0)


def wait_for_master(uri, timeout_s=30):
    class Patient(xmlrpc.client.Transport):
        """What accepts a connection and says nothing is no master."""

        def make_connection(self, host):
            connection = super().make_connection(host)
            connection.timeout = 5
            return connection

    deadline = time.monotonic() + timeout_s
    while True:
        try:
            xmlrpc.client.ServerProxy(uri, transport=Patient()).getPid("/livemap_demo")
            return
        except (OSError, http.client.HTTPException):
            if time.monotonic() > deadline:
                raise StartError(f"the ROS master {uri} did not come up within {timeout_s} s")
            time.sleep(0.1)


class Progress:
    """One line that is rewritten on a terminal; a plain line every ten seconds otherwise."""

    def __init__(self):
        self.is_terminal = sys.stderr.isatty()
        self.next_line = 0.0

    def show(self, counts, frames, hazards):
        if not self.is_terminal and time.monotonic() < self.next_line:
            return
        self.next_line = time.monotonic() + 10.0
        text = (f"demo: frame {counts['frames_in']}/{frames}, {counts['detections']} detections, "
                f"{counts['reports_created']} reports, {hazards} hazards on the map")
        print("\r\x1b[K" + text if self.is_terminal else text, file=sys.stderr,
              end="" if self.is_terminal else "\n", flush=True)

    def end(self):
        if self.is_terminal:
            print(file=sys.stderr)


def distance_m(a, b):
    """Metres between two positions a few hundred metres apart (local plane)."""
    north = math.radians(b["latitude"] - a["latitude"]) * 6371008.8
    east = (math.radians(b["longitude"] - a["longitude"]) * 6371008.8
            * math.cos(math.radians(a["latitude"])))
    return math.hypot(north, east)


MATCH_RADIUS_M = 5.0
"""A hazard on the map within so far of a true one of its class is that one."""


def compare_with_truth(hazards, truth, radius_m=MATCH_RADIUS_M):
    """Found and missed true hazards, false ones on the map, and the error of the found ones' positions.

    `truth` is what read_true_hazards gives. Only hazards that the vehicle went by can be missed. One hazard on the map stands for all of its class
    within `radius_m`, as the zone merges them.
    """
    classes = {name: compare_class([t for t in truth if t["class"] == name],
                                   [h for h in hazards if h["class"] == name], radius_m)
               for name in sorted({t["class"] for t in truth} | {h["class"] for h in hazards})}
    errors = [error for figures in classes.values() for error in figures.pop("errors_m")]
    total = {key: sum(figures[key] for figures in classes.values())
             for key in ("hazards", "found", "missed", "false")}
    return {**total, "position_error_m_mean": mean(errors), "position_error_m_median": percentile(errors, 0.5),
            "position_error_m_p95": percentile(errors, 0.95), "classes": classes,
            "position_errors_m": sorted(round(error, 2) for error in errors)}


def compare_class(truth, hazards, radius_m):
    """The same for one class, with the position errors in metres as a list too."""
    def nearest(place, places):
        return min((distance_m(place, other) for other in places), default=math.inf)
    passed = [t for t in truth if t["passed"]]
    errors = [error for error in (nearest(t, hazards) for t in passed) if error <= radius_m]
    return {"hazards": len(passed), "found": len(errors), "missed": len(passed) - len(errors),
            "false": sum(nearest(h, truth) > radius_m for h in hazards),
            "position_error_m_mean": mean(errors), "errors_m": errors}


def percentile(values, share, digits=2):
    """Nearest-rank percentile; None of no values."""
    if not values:
        return None
    ordered = sorted(values)
    return round(ordered[max(0, math.ceil(share * len(ordered)) - 1)], digits)


def mean(values):
    """Rounded to centimetres; None of no values."""
    return round(sum(values) / len(values), 2) if values else None
