"""Starts and stops the parts of a LiveMap on one machine: two ROS masters, broker, zone, vehicle."""

import collections
import os
import pathlib
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request

import rosbag
import rospkg

Drive = collections.namedtuple("Drive", "frames start_s duration_s")
PROGRAMS = pathlib.Path(__file__).resolve().parents[1]
CAMERA_TOPICS = ("camera/image_raw/compressed", "camera/image_raw")


class StartError(RuntimeError):
    """A part that did not start or died, in one sentence."""


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


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
    try:
        return pathlib.Path(rospkg.RosPack().get_path("livemap")) / name
    except rospkg.ResourceNotFound as error:
        raise StartError("ROS does not know the package livemap; source install/setup.bash or call ./livemap demo") from error


def launch_file(name):
    return str(package_file(pathlib.Path("launch") / name))


def run_tool(command, log):
    command = [program(command[0])] + command[1:]
    with open(log, "w") as output:
        code = subprocess.call(command, stdout=output, stderr=subprocess.STDOUT)
    if code != 0:
        words = pathlib.Path(log).read_text().strip().splitlines()
        raise StartError(words[-1] if words else f"{command[0]} ended with code {code}")


def is_bag(path):
    """Whether rosbag can open the file."""
    try:
        rosbag.Bag(str(path)).close()
        return True
    except (rosbag.ROSBagException, OSError):
        return False


def read_bag(path):
    """Number of camera frames and duration of a drive."""
    with rosbag.Bag(str(path)) as bag:
        topics = bag.get_type_and_topic_info().topics
        counts = [info.message_count for name, info in topics.items()
                  if name.lstrip("/") in CAMERA_TOPICS]
        if not counts:
            raise StartError(f"bag '{path}' has no topic {' or '.join(CAMERA_TOPICS)}")
        return Drive(frames=sum(counts), start_s=bag.get_start_time(),
                     duration_s=max(bag.get_end_time() - bag.get_start_time(), 1e-3))


class LiveMapSystem:
    """Broker, zone and vehicle as child processes; leaving the `with` block stops them."""

    # Of zone_cloudlet: the drives that are played here were driven long ago.
    zone_parameters = "{replay: true}"
    # More arguments of zone.launch.
    zone_arguments = {}

    def __init__(self, directory, zone, vehicle, web_port=0):
        self.directory = pathlib.Path(directory)
        self.zone, self.vehicle = zone, vehicle
        self.broker_port, self.zone_port, self.vehicle_port = free_port(), free_port(), free_port()
        self.web_port = web_port or free_port()
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
        self.start(name, ["roslaunch", f"--port={port}", launch_file(file)]
                   + [f"{key}:={value}" for key, value in arguments.items()],
                   master=f"http://127.0.0.1:{port}")

    def start_broker(self):
        self.start("broker", [program("livemap_broker"),
                              "--directory", str(self.directory / "broker"),
                              "--port", str(self.broker_port), "--zone", self.zone,
                              "--vehicles", self.vehicle])
        self.wait_for("the broker", lambda: self.accepts(self.broker_port))

    def start_zone(self, rviz=False):
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
            return subprocess.call(
                ["rosservice", "call", "/player/pause_playback", "data: false"], env=environment,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) == 0
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
                raise StartError(f"the {name} ended with code {process.returncode}, "
                                 f"see {self.directory / (name + '.log')}")
