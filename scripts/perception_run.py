#!/usr/bin/python3
"""One drive through a whole LiveMap, recorded: a part of `livemap bench perception`, which calls it for each run.

    perception_run.py SPEC.json     writes what it measured into the file that SPEC.json names

A process each: a ROS process knows one master.
"""

import contextlib
import json
import os
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "lib"))
import demo_observers as observers  # noqa: E402
import demo_system as system  # noqa: E402
from listening_port import free_port  # noqa: E402
import perception_recorder

ZONE, VEHICLE = "bench", "vehicle-1"
# The last frames' reports and receipts, over a slow link.
AFTER_THE_DRIVE_S = 5.0
START_TIMEOUT_S = 120


def launch_arguments(name):
    """The arguments that a launch file declares."""
    return set(re.findall(r'<arg name="(\w+)"', pathlib.Path(system.launch_file(name)).read_text(encoding="utf-8")))


class MeasuredSystem(system.LiveMapSystem):
    """With the zone's arguments, and where asked for a mobile network between vehicle and broker."""

    def __init__(self, directory, spec):
        super().__init__(directory, ZONE, VEHICLE)
        self.zone_arguments = spec["zone_arguments"]

    def start_link(self, link):
        """The port at which the vehicle finds its broker."""
        if not link:
            return self.broker_port
        port = free_port()
        self.start("link", [system.program("lte_relay.py"), "--port", str(port), "--to-port", str(self.broker_port),
                            "--counts", str(self.directory / "link.json")]
                   + [part for key, value in link.items() for part in (f"--{key.replace('_', '-')}", str(value))])
        self.wait_for("the link", lambda: self.accepts(port))
        return port

    def start_recorder(self, name, master):
        self.start(name, [system.program("perception_recorder.py"), "--master", master,
                          "--out", str(self.directory / f"{name}.jsonl")])


def bytes_on_wire(directory):
    """What the link carried to the broker, TCP payload; None without a link."""
    file = directory / "link.json"
    return json.loads(file.read_text(encoding="ascii"))["up_bytes"] if file.is_file() else None


def read_lines(path):
    with open(path, encoding="ascii") as file:
        return [json.loads(line) for line in file if line.endswith("\n")]


def vehicle_arguments(spec, port):
    known = launch_arguments("vehicle.launch") | launch_arguments("replay.launch")
    wanted = {"broker_port": port, **spec["vehicle_arguments"]}
    missing = sorted(set(wanted) - known)
    if missing:
        raise system.StartError(f"this build's vehicle has no argument {', '.join(missing)}")
    return wanted


def follow(drive, vehicle, live_map, rate):
    """Until every frame and report is through; False when that does not happen in time."""
    deadline = time.monotonic() + drive.duration_s / rate + 60.0
    while not vehicle.is_through(drive):
        live_map.check_alive()
        if time.monotonic() > deadline:
            return False
        time.sleep(0.25)
    return True


def measure(spec, directory):
    bag = pathlib.Path(spec["bag"])
    drive = system.read_bag(bag)
    with contextlib.ExitStack() as stack:
        live_map = stack.enter_context(MeasuredSystem(directory, spec))
        live_map.start_zone()
        live_map.start_recorder("zone_record", live_map.zone_master)
        map_client = observers.MapClient(live_map.url)
        port = live_map.start_link(spec["link"])
        live_map.start_vehicle(bag, spec["rate"], **vehicle_arguments(spec, port))
        vehicle = observers.VehicleObserver(live_map.vehicle_master, detects=spec["detects"])
        vehicle.wait_until_up(START_TIMEOUT_S)
        recorder = perception_recorder.Recorder(directory / "vehicle_record.jsonl")
        stack.callback(recorder.close)
        load = os.getloadavg()[0]
        live_map.play()
        complete = follow(drive, vehicle, live_map, spec["rate"])
        time.sleep(AFTER_THE_DRIVE_S)
        counts, stored = vehicle.counts(), map_client.stored_hazards()
        latencies = map_client.latencies_ms(vehicle.wall_time_of)
    # Everything has ended, so its files are whole.
    return {"complete": complete, "counts": counts, "frames": drive.frames, "drive_s": drive.duration_s,
            "load": [round(load, 1), round(os.getloadavg()[0], 1)], "map_ms": latencies, "stored": stored,
            "wire_bytes": bytes_on_wire(directory), "vehicle": read_lines(directory / "vehicle_record.jsonl"),
            "zone": read_lines(directory / "zone_record.jsonl")}


def main():
    spec = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
    socket.setdefaulttimeout(30)
    with tempfile.TemporaryDirectory(prefix="perception_", dir=spec["scratch"]) as folder:
        os.environ["ROS_HOME"] = os.environ["ROS_LOG_DIR"] = str(pathlib.Path(folder) / "ros")
        try:
            figures = measure(spec, pathlib.Path(folder))
        except (system.StartError, OSError, subprocess.SubprocessError) as error:
            for log in sorted(pathlib.Path(folder).glob("*.log")):
                print(f"--- {log.name}\n" + "\n".join(log.read_text(errors="replace").splitlines()[-15:]), file=sys.stderr)
            print(f"perception_run: {error}", file=sys.stderr)
            return 1
    pathlib.Path(spec["out"]).write_text(json.dumps(figures) + "\n", encoding="ascii")
    return 0


if __name__ == "__main__":
    sys.exit(main())
