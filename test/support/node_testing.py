"""What the tests of our nodes share: patience, child processes, and the ends of a node's topics."""

import ctypes
import os
import re
import signal
import subprocess
import tempfile
import threading
import time

import rospy
import yaml
from diagnostic_msgs.msg import DiagnosticArray

TEST_DIRECTORY = os.path.dirname(os.path.realpath(__file__))
SOURCE_DIRECTORY = os.path.dirname(os.path.dirname(TEST_DIRECTORY))
# Keeps a broken test from hanging; nothing is measured by it.
PATIENCE_S = 180


def eventually(condition, what):
    """The first true value of `condition`; AssertionError naming `what` when patience ends."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError("never happened: " + what)
        time.sleep(0.05)


def program(package, name):
    """The path of a package's program. `rosrun` takes half a second of a processor to find the same."""
    for prefix in [*os.environ["CMAKE_PREFIX_PATH"].split(os.pathsep), "/usr"]:
        path = os.path.join(prefix, "lib", package, name)
        if os.access(path, os.X_OK):
            return path
    raise AssertionError(f"package '{package}' has no program '{name}'")


def start_child(command, **options):
    """A process that ends with this one, however this one ends, and holds none of its pipes."""
    pr_set_pdeathsig = 1
    options.setdefault("stdin", subprocess.DEVNULL)
    options.setdefault("stdout", subprocess.DEVNULL)
    options.setdefault("stderr", subprocess.DEVNULL)
    libc = ctypes.CDLL(None)
    return subprocess.Popen(
        command, preexec_fn=lambda: libc.prctl(pr_set_pdeathsig, signal.SIGTERM), **options)


def parameters_of(node_name):
    """config/NODE_NAME.yaml as the launch files load it."""
    with open(os.path.join(SOURCE_DIRECTORY, "config", node_name + ".yaml"), encoding="utf-8") as file:
        return yaml.safe_load(file)


class NodeletUnderTest:
    """Processes in namespace `/name`, what they print, and what they publish: all messages of the
    topics subscribed to and the diagnostics of the node called `node_name`."""

    def __init__(self, name, node_name):
        self.name, self.node_name = name, node_name
        self.log = tempfile.NamedTemporaryFile(suffix=".log")
        self.lock = threading.Lock()
        self.messages = {}
        self.processes = []
        self.ends = [rospy.Subscriber("/diagnostics", DiagnosticArray, self._keep, "diagnostics")]

    def subscribe(self, topic, message_class):
        subscriber = rospy.Subscriber(f"/{self.name}/{topic}", message_class, self._keep, topic)
        self.ends.append(subscriber)
        return subscriber

    def advertise(self, topic, message_class, queue_size=200, latch=False):
        publisher = rospy.Publisher(f"/{self.name}/{topic}", message_class, queue_size=queue_size, latch=latch)
        self.ends.append(publisher)
        return publisher

    def _keep(self, message, topic):
        with self.lock:
            self.messages.setdefault(topic, []).append(message)

    def received(self, topic):
        with self.lock:
            return list(self.messages.get(topic, []))

    def start_nodelet(self, node_name, *arguments):
        """The program of nodelets with `arguments`, in a process group of its own."""
        process = start_child(
            [program("nodelet", "nodelet"), *arguments, f"__name:={node_name}", f"__ns:=/{self.name}"],
            stdout=self.log, stderr=subprocess.STDOUT, start_new_session=True)
        self.processes.append(process)
        return process

    def stop(self):
        for process in self.processes:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait(PATIENCE_S)
        for end in self.ends:
            end.unregister()

    def output(self):
        with open(self.log.name, encoding="utf-8", errors="replace") as file:
            return re.sub(r"\x1b\[[0-9;]*m", "", file.read())

    def diagnostics(self):
        """The newest key-values, as a map of texts."""
        for message in reversed(self.received("diagnostics")):
            for status in message.status:
                if status.hardware_id == self.node_name and self.name in status.name:
                    return {pair.key: pair.value for pair in status.values}
        return {}

    def wait_for(self, **counters):
        """Until the diagnostics say so."""
        expected = {key: str(value) for key, value in counters.items()}

        def reached():
            values = self.diagnostics()
            return all(values.get(key) == value for key, value in expected.items())

        try:
            eventually(reached, f"diagnostics {expected}")
        except AssertionError as error:
            raise AssertionError(f"{error}, last were {self.diagnostics()}") from None
