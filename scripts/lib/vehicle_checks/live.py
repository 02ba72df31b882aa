"""What is heard on the ROS master: whether a vehicle runs there, its diagnostics, and the drivers' topics."""

import http.client
import math
import os
import threading
import time
import xmlrpc.client

from vehicle_checks.finding import fault, ok, unknown, warning

MASTER_S, LISTEN_S = 2.0, 4.0
MANY_REPORTS = 100


class PatientTransport(xmlrpc.client.Transport):
    def make_connection(self, host):
        self._connection = host, http.client.HTTPConnection(host, timeout=MASTER_S)
        return self._connection[1]


class Heard:
    """Messages of a topic. `last` is the newest one, whose type is known."""

    def __init__(self):
        self.first_s = self.last_s = self.last = None
        self.count = 0
        self.seconds = LISTEN_S

    def take(self, message):
        self.last_s = time.monotonic()
        self.first_s = self.first_s or self.last_s
        self.last = message
        self.count += 1

    @property
    def rate_hz(self):
        return (self.count - 1) / (self.last_s - self.first_s) if self.count > 1 and self.last_s > self.first_s else None


class Live:
    """Asks the master at its construction, listens in the background. `problem`: why nothing can be heard."""

    def __init__(self, topics):
        self.uri = os.environ.get("ROS_MASTER_URI") or "http://localhost:11311"
        self.problem = None
        self.vehicle_runs = False
        self.diagnostics = {}  # Of a node: the first and the newest status.
        self._heard = {topic: Heard() for topic in topics}
        self._types = {}
        self._done = threading.Event()
        self._started = False
        self._ask_master()
        if self.problem:
            self._done.set()
        else:
            threading.Thread(target=self._listen, daemon=True).start()

    def _ask_master(self):
        asked = threading.Event()

        def ask():
            try:
                master = xmlrpc.client.ServerProxy(self.uri, transport=PatientTransport())
                _, _, state = master.getSystemState("/livemap_vehicle_check")
                _, _, types = master.getTopicTypes("/livemap_vehicle_check")
                self._types = {name: kind for name, kind in types}
                self.vehicle_runs = any("/vehicle_manager" in nodes for part in state for _, nodes in part)
            except Exception as error:  # Whatever answers there is no master, or none does.
                refused = isinstance(error, ConnectionRefusedError)
                self.problem = f"no ROS master {'runs' if refused else 'answers'} at {self.uri}"
            asked.set()

        threading.Thread(target=ask, daemon=True).start()
        if not asked.wait(3 * MASTER_S):
            self.problem = f"no ROS master answers at {self.uri}"
            self.vehicle_runs = False

    def _listen(self):
        try:
            import rospy
            from diagnostic_msgs.msg import DiagnosticArray
            from sensor_msgs.msg import CameraInfo, NavSatFix
            known = {"sensor_msgs/CameraInfo": CameraInfo, "sensor_msgs/NavSatFix": NavSatFix}
            # Without an argv of its own rospy would take launch arguments for names to be replaced.
            rospy.init_node("livemap_vehicle_check", argv=[], anonymous=True, disable_signals=True, log_level=rospy.FATAL)
            self._started = True
            rospy.Subscriber("/diagnostics", DiagnosticArray, self._take)
            for topic, heard in self._heard.items():
                if topic in self._types:
                    rospy.Subscriber(topic, known.get(self._types[topic], rospy.AnyMsg), heard.take)
            time.sleep(LISTEN_S)
        except ImportError as error:
            self.problem = f"Python finds no {error.name}: ./livemap setup installs it"
        except Exception as error:  # A master that goes away in between.
            self.problem = f"the ROS master at {self.uri} was lost: {error}"
        self._done.set()

    def _take(self, message):
        for status in message.status:
            first, _ = self.diagnostics.get(status.hardware_id, (status, None))
            self.diagnostics[status.hardware_id] = first, status

    def wait(self):
        self._done.wait(LISTEN_S + 8)
        if not self._done.is_set():
            self.problem = f"the ROS master at {self.uri} did not answer in time"

    def topic(self, name):
        """Heard, or a text: why nothing could be."""
        self.wait()
        return self.problem or self._heard[name]

    def close(self):
        """Says good-bye to the master."""
        if self._started:
            import rospy
            leaving = threading.Thread(target=rospy.signal_shutdown, args=("checked",), daemon=True)
            leaving.start()
            leaving.join(2)

    def node(self, name):
        """Level, summary, first and newest values of the node's line; None where it said nothing."""
        self.wait()
        if name not in self.diagnostics:
            return None
        first, last = self.diagnostics[name]
        return last.level, last.message, *({pair.key: pair.value for pair in status.values} for status in (first, last))


def number_of(values, key):
    try:
        number = float(values[key])
    except (KeyError, ValueError):
        return None
    return number if math.isfinite(number) else None


def of_node(live, name, judge):
    """The finding of `judge(level, summary, first, last)` about a node of the running vehicle."""
    said = live.node(name)
    if said is None:
        if live.problem:
            return unknown(live.problem)
        return fault(f"{name} says nothing on /diagnostics within {LISTEN_S:.0f} s",
                     f"it has not loaded or is stuck: see the vehicle's log for {name}")
    return judge(*said)


def risen(first, last, key):
    before, now = number_of(first, key), number_of(last, key)
    return None if before is None or now is None else int(now - before)


def picture(live):
    def judge(level, summary, first, last):
        rate, dropped = number_of(last, "rate_hz"), risen(first, last, "frames_dropped")
        figures = {"rate_hz": rate, "dropped": dropped}
        if not rate:
            return fault(f"no pictures: {summary}", "see the picture above, and the calibration's topic", **figures)
        found = f"{rate:.1f} pictures a second, {'unknown' if dropped is None else dropped} dropped while looking"
        if level:
            return warning(f"{found}: {summary}", "see the vehicle's log for camera_ingest", **figures)
        return ok(found, **figures)
    return of_node(live, "camera_ingest", judge)


def receiver(live):
    def judge(_level, summary, _first, last):
        state = last.get("state")
        if state != "fix":
            return fault(summary, "docs/how-to/run-a-vehicle.md, a USB receiver")
        return ok(summary, clock_offset_s=number_of(last, "clock_offset_s"), sigma_m=number_of(last, "sigma_m"))
    return of_node(live, "gps_receiver", judge)


def mounting(live):
    def judge(_level, _summary, _first, last):
        problem, knocks = last.get("mounting_problem", ""), number_of(last, "mounting_knocks")
        pitch = number_of(last, "mounting_pitch_deg")
        figures = {"pitch_deg": pitch, "knocks": knocks}
        sources = {"tf": "as tf has it", "found": "as the vehicle found it", "parameters": "as its arguments say"}
        found = sources.get(last.get("mounting"), "unknown") + (f", {pitch:.1f} degrees down" if pitch is not None else "")
        if problem or knocks:
            return warning(f"{found}; {problem or f'knocked {knocks:.0f} times'}",
                           "fix the camera firmly, and measure its mounting again", **figures)
        return ok(found, **figures)
    return of_node(live, "edge_vo", judge)


def detector(live):
    def judge(level, summary, first, last):
        rate, took = number_of(last, "rate_hz"), number_of(last, "detection_ms")
        dropped = risen(first, last, "frames_dropped")
        figures = {"rate_hz": rate, "detection_ms": took, "dropped": dropped}
        if not rate:
            return fault(f"no picture is looked at: {summary}", "see the running picture", **figures)
        found = (f"{last.get('model')}, {rate:.1f} pictures a second" + (f", {took:.0f} ms each" if took else "")
                 + f", {'unknown' if dropped is None else dropped} dropped while looking")
        if level:
            return warning(f"{found}: {summary}", "docs/how-to/choose-a-detector.md: a faster one, or a slower camera", **figures)
        return ok(found, **figures)
    return of_node(live, "hazard_detection", judge)


def broker(live):
    def judge(_level, summary, _first, last):
        figures = {"connections": number_of(last, "connections"), "refused": number_of(last, "publishes_refused")}
        if last.get("connected", "").lower() not in ("true", "1"):
            return fault(f"not connected to {last.get('broker')}: {summary}", "see broker and identity above", **figures)
        if figures["refused"]:
            return fault(f"connected, and {figures['refused']:.0f} messages were refused: {last.get('last_error')}",
                         "vehicle:= and zone:= must be those that the zone knows", **figures)
        return ok(f"connected to {last.get('broker')} as '{last.get('user')}'", **figures)
    return of_node(live, "mqtt_bridge", judge)


def reports(live):
    def judge(level, summary, _first, last):
        waiting = number_of(last, "pending")
        figures = {"waiting": waiting}
        if waiting is None:
            return unknown("hazard_reporting does not say how many reports wait", **figures)
        found = f"{waiting:.0f} reports wait for the zone's receipt"
        if waiting > MANY_REPORTS or level:
            return warning(f"{found}: {summary}", "see receiver and broker above; reports are sent until the zone answers",
                           **figures)
        return ok(found, **figures)
    return of_node(live, "hazard_reporting", judge)
