"""Starts and stops the parts of a LiveMap on one machine: two ROS masters, broker, zone, vehicle."""

import collections
import contextlib
import os
import pathlib
import re
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request

import rospkg

import drive_bag
import listening_port
from process_end import how_it_ended
from system_error import StartError

Drive = collections.namedtuple("Drive", "frames start_s duration_s")
PROGRAMS = pathlib.Path(__file__).resolve().parents[1]
# A program that has done nothing for so long will not go on.
STUCK_S = 120
# One call of a ROS service; a node may be dead and still be known to the master.
SERVICE_S = 20
PROGRAM_WORDS = re.compile(r"(?:livemap|livemap_broker): (.+)")


def program(name):
    """Path of one of the package's programs: beside this file, or in a workspace of the environment."""
    folders = [PROGRAMS] + [pathlib.Path(prefix) / "lib/livemap" for prefix in
                            os.environ.get("CMAKE_PREFIX_PATH", "").split(":") if prefix]
    for folder in folders:
        if (folder / name).is_file():
            return str(folder / name)
    raise StartError(f"program '{name}' is not built; ./livemap setup --dev builds every program")


def package_file(name):
    """Full path: a source tree with an install folder in it holds every file of the package twice."""
    source = PROGRAMS.parent / name
    if source.is_file():
        return source
    return require_workspace() / name


def require_workspace():
    """The folder of the package that ROS knows."""
    try:
        return pathlib.Path(rospkg.RosPack().get_path("livemap"))
    except rospkg.ResourceNotFound as error:
        raise StartError("ROS does not know the package livemap; source install/setup.bash or call ./livemap demo") from error


def launch_file(name):
    return str(package_file(pathlib.Path("launch") / name))


def run_tool(command, log, stuck_s=STUCK_S):
    """Runs one of the package's programs to its end; StartError where it fails, or neither computes nor writes any more."""
    command = [program(command[0])] + command[1:]
    with open(log, "w") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
    try:
        code = wait_while_it_works(process, log, stuck_s)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    if code is None:
        raise StartError(f"{os.path.basename(command[0])} has neither computed nor written anything for {stuck_s:g} s, "
                         "so it was ended: the disk or a file that it reads does not answer")
    if code != 0:
        words = pathlib.Path(log).read_text().strip().splitlines()
        raise StartError(words[-1] if words and code > 0 else f"{os.path.basename(command[0])} {how_it_ended(code)}")


def wait_while_it_works(process, log, stuck_s):
    """Its exit code; None when its processor time and its log have stood still for too long, as nothing else limits it:
    a long recording takes as long as it takes."""
    seen, since = None, time.monotonic()
    while True:
        try:
            return process.wait(0.5)
        except subprocess.TimeoutExpired:
            now = (processor_ticks(process.pid), os.path.getsize(log))
        if now != seen:
            seen, since = now, time.monotonic()
        elif time.monotonic() - since > stuck_s:
            return None


def processor_ticks(pid):
    """Of a process and those of its children that have ended; 0 when it is gone."""
    try:
        fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return sum(map(int, fields[11:15]))


def read_bag(path, positions=False, depth=None, boxes=False):
    """Number of camera frames and duration of a drive; StartError where a vehicle could use no frame of it.

    `positions`: the drive must also place hazards, by fixes and the camera's mounting; `depth` names the topic of
    depth images that it must have; `boxes`: it must answer for the detector.
    """
    drive, topics = drive_bag.DriveBag([path]), drive_bag.DEFAULT_TOPICS
    faults = drive_bag.faults_of(drive, topics, mounting_comes_from_bag=positions, depth=depth, boxes=boxes,
                                 fixes=positions)
    if faults:
        raise StartError(drive_bag.as_sentence(drive, faults))
    return Drive(frames=drive.frames(topics.image, drive.transport_of(topics.image)), start_s=drive.start_s,
                 duration_s=max(drive.end_s - drive.start_s, 1e-3))


def doubts_about(path):
    """Sentences about stamps of the drive that a vehicle may stumble over."""
    topics = drive_bag.DEFAULT_TOPICS
    return drive_bag.DriveBag([path]).doubts_about_stamps([topics.camera_info, topics.fix])


class LiveMapSystem:
    """Broker, zone and vehicle as child processes; leaving the `with` block stops them."""

    # Of zone_cloudlet: the drives that are played here were driven long ago.
    zone_parameters = "{replay: true}"
    # More arguments of zone.launch.
    zone_arguments = {}

    def __init__(self, directory, zone, vehicle, web_port=0):
        # Nodes run in ROS's own folder, so nothing relative is handed to them.
        self.directory = pathlib.Path(directory).resolve()
        self.zone, self.vehicle = zone, vehicle
        self.broker_port, self.zone_port, self.vehicle_port = (listening_port.free_port() for _ in range(3))
        self.web_port = web_port or listening_port.free_port()
        self.url = f"http://127.0.0.1:{self.web_port}/"
        self.zone_master = f"http://127.0.0.1:{self.zone_port}"
        self.vehicle_master = f"http://127.0.0.1:{self.vehicle_port}"
        self.processes = {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        # The vehicle first: a zone that goes away under it would only fill its log.
        for name in reversed(list(self.processes)):
            self.stop(name)

    def stop(self, name, how=signal.SIGINT):
        process = self.processes.pop(name)
        if process.poll() is not None:
            return
        os.killpg(process.pid, how)
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def start(self, name, command, master=None):
        environment = dict(os.environ, ROS_HOSTNAME="127.0.0.1")
        environment.pop("ROS_IP", None)
        if master:
            environment["ROS_MASTER_URI"] = master
        with open(self.directory / f"{name}.log", "a") as log:
            self.processes[name] = subprocess.Popen(
                command, env=environment, stdout=log, stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL, start_new_session=True)

    def launch(self, name, port, file, arguments):
        self.start(name, [program("livemap_launch"), launch_file(file), f"--port={port}"]
                   + [f"{key}:={value}" for key, value in arguments.items()],
                   master=f"http://127.0.0.1:{port}")

    def start_broker(self):
        self.start("broker", [program("livemap_broker"),
                              "--directory", str(self.directory / "broker"),
                              "--port", str(self.broker_port), "--zone", self.zone,
                              "--vehicles", self.vehicle])
        self.wait_for("the broker", lambda: self.accepts(self.broker_port))

    def start_zone(self, rviz=False):
        taken = listening_port.why_not("127.0.0.1", self.web_port)
        if taken:
            raise StartError(f"the live map cannot be served: {taken}")
        self.start_broker()
        self.launch_zone(rviz)

    def launch_zone(self, rviz=False):
        self.launch("zone", self.zone_port, "zone.launch", {
            "zone": self.zone, "directory": self.directory / "zone",
            "broker_port": self.broker_port, "password_file": self.password_file("zone"),
            "web_port": self.web_port, "rviz": str(rviz).lower(), "zone_cloudlet": self.zone_parameters,
            **self.zone_arguments})
        self.wait_for("the zone's live map", self.map_answers)

    def start_vehicle(self, bag, rate, rviz=False, **arguments):
        """`arguments` are more of those of replay.launch."""
        self.launch("vehicle", self.vehicle_port, "replay.launch", {
            "bag": bag, "rate": rate, "paused": "true", "vehicle": self.vehicle,
            "zone": self.zone, "directory": self.directory / "vehicle",
            "broker_port": self.broker_port,
            "password_file": self.password_file(self.vehicle), "rviz": str(rviz).lower(), **arguments})

    def play(self):
        environment = dict(os.environ, ROS_MASTER_URI=self.vehicle_master, ROS_HOSTNAME="127.0.0.1")

        def resumed():
            with contextlib.suppress(subprocess.TimeoutExpired):
                return subprocess.call(
                    ["rosservice", "call", "/player/pause_playback", "data: false"], env=environment,
                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=SERVICE_S) == 0
            return False
        self.wait_for("the bag's player", resumed)

    def password_file(self, user):
        return self.directory / "broker" / "credentials" / user

    def map_answers(self):
        try:
            with urllib.request.urlopen(self.url + "healthz", timeout=2) as answer:
                return answer.status == 200
        except (urllib.error.URLError, OSError):
            return False

    @staticmethod
    def accepts(port):
        with socket.socket() as probe:
            probe.settimeout(1)
            return probe.connect_ex(("127.0.0.1", port)) == 0

    def wait_for(self, what, is_there, timeout_s=60):
        deadline = time.monotonic() + timeout_s
        while not is_there():
            self.check_alive()
            if time.monotonic() > deadline:
                raise StartError(f"{what} did not come up within {timeout_s} s")
            time.sleep(0.1)

    def check_alive(self):
        for name, process in self.processes.items():
            if process.poll() is not None:
                raise StartError(f"the {name} {self.how_it_ended(name, process.returncode)}, "
                                 f"see {self.directory / (name + '.log')}")

    def how_it_ended(self, name, code):
        """In the words of what ended first, where it has any; else what the system says of the process."""
        try:
            last = (self.directory / f"{name}.log").read_text(errors="replace").strip().splitlines()[-1:]
        except OSError:
            last = []
        told = PROGRAM_WORDS.fullmatch(last[0]) if last and code > 0 else None
        return f"ended: {told.group(1)}" if told else how_it_ended(code)
