"""A real broker, a second ROS master, bridges and peers for the tests of the MQTT bridge."""

import base64
import io
import json
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import xmlrpc.client

import yaml

from node_testing import PATIENCE_S, SOURCE_DIRECTORY, TEST_DIRECTORY, eventually, program, start_child

sys.path.insert(0, os.path.join(SOURCE_DIRECTORY, "scripts", "lib"))
from listening_port import free_port  # noqa: E402


def port_answers(port):
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
        return True
    except OSError:
        return False


# Of the definitions on the wire, which have no field `zone`.
WIRE_MD5 = {
    "livemap/CellHazards": "1703bed8d13e8657113584719179292f",
    "livemap/CellRequest": "eceb8c87685360e56aeb929ad7c324e1",
    "livemap/HazardNotice": "03acdf49de664439a0bbf08c02931b45",
    "livemap/HazardPoll": "78c6f168c0bc4ed892e7fbea24487d70",
    "livemap/HazardPollAnswer": "8f9e01f2a6d515909b89b0b9949f6e21",
    "livemap/HazardReport": "157e70184e3e48f3be020c650d2f788a",
    "livemap/MapChange": "f0c59a6ee1ac17ed9fe4b38192a4afe1",
    "livemap/ReportReceipt": "3bb0f7c51314b5a5e3dd08cca0268f28",
    "livemap/VehiclePosition": "c1b41f81adbf946a004a6ca4f4769454",
}


def wire_payload(message):
    """The message as it travels: without its last field, where that is the zone."""
    serialised = serialise(message)
    if message._type not in WIRE_MD5:
        return serialised
    return serialised[:-(4 + len(message.zone.encode()))]


def envelope(message, type_name=None, md5=None, version=1, payload=None):
    """The wire format of docs/reference/wire.md, written a second time on purpose."""
    name = (type_name or message._type).encode()
    if payload is None:
        payload = wire_payload(message)
    md5 = md5 or WIRE_MD5.get(message._type, message._md5sum)
    return (b"LMAP" + struct.pack("<HHB", version, 0, len(name)) + name +
            bytes.fromhex(md5) + struct.pack("<I", len(payload)) + payload)


def serialise(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


class Broker:
    """scripts/livemap_broker with zone "test" and vehicles car-1 to car-3."""

    def __init__(self):
        self.port = free_port()
        self.directory = tempfile.mkdtemp(prefix="livemap_broker_")
        self.process = None
        self.log = tempfile.NamedTemporaryFile(suffix=".log")

    def start(self):
        self.process = start_child(
            [os.path.join(SOURCE_DIRECTORY, "scripts", "livemap_broker"), "--directory",
             self.directory, "--port", str(self.port), "--zone", "test", "--vehicles",
             "car-1,car-2,car-3", "__name:=broker", "__log:=/dev/null"], stdout=self.log, stderr=subprocess.STDOUT)
        eventually(self._answers, "the broker answers")

    def _answers(self):
        if self.process.poll() is not None:
            with open(self.log.name, encoding="utf-8", errors="replace") as file:
                raise AssertionError(f"the broker ended with code {self.process.returncode}: {file.read()}")
        return port_answers(self.port)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def password_file(self, user):
        return os.path.join(self.directory, "credentials", user)

    def subscribe_raw(self, user, topic, path):
        """A plain client of `user` that writes the next payload on `topic` into the file `path`, then ends."""
        with open(self.password_file(user), encoding="ascii") as file:
            password = file.readline().strip()
        with open(path, "wb") as file:
            return subprocess.Popen(
                ["mosquitto_sub", "-V", "5", "-p", str(self.port), "-i", "raw", "-u", user, "-P", password,
                 "-t", topic, "-C", "1", "-W", "60", "-N"], stdout=file)

    def publish_raw(self, user, topic, payload):
        """Publishes bytes as `user` with the plain client, no bridge between; its exit code."""
        with open(self.password_file(user), encoding="ascii") as file:
            password = file.readline().strip()
        with tempfile.NamedTemporaryFile() as file:
            file.write(payload)
            file.flush()
            return subprocess.run(
                ["mosquitto_pub", "-V", "5", "-q", "1", "-p", str(self.port), "-u", user, "-P",
                 password, "-t", topic, "-f", file.name], check=False).returncode


class Master:
    """A ROS master: the one at `uri`, or a new one on a free port."""

    def __init__(self, uri=None):
        self.process = None
        self.uri = uri
        if uri is None:
            port = free_port()
            self.uri = f"http://127.0.0.1:{port}"
            self.process = start_child(["roscore", "-p", str(port)], env=self.environment())
            eventually(lambda: port_answers(port), "the vehicle's master answers")

    def environment(self):
        return dict(os.environ, ROS_MASTER_URI=self.uri)

    def set_parameters(self, name, values):
        xmlrpc.client.ServerProxy(self.uri).setParam("/test", name, values)

    def stop(self):
        if self.process is not None:
            self.process.terminate()
            self.process.wait()


class Bridge:
    """An mqtt_bridge nodelet in a process of its own, with the defaults of config/mqtt_bridge_SIDE
    except for `parameters`, its ROS topics below `prefix`."""

    def __init__(self, master, side, name, prefix="/", **parameters):
        path = os.path.join(SOURCE_DIRECTORY, "config", f"mqtt_bridge_{side}.yaml")
        with open(path, encoding="utf-8") as file:
            values = yaml.safe_load(file)
        for topic in values["topics"]:
            topic["ros_topic"] = prefix + topic["ros_topic"]
        values.update(parameters)
        master.set_parameters("/" + name, values)
        self.log = tempfile.NamedTemporaryFile(suffix=".log")
        self.process = start_child(
            [program("nodelet", "nodelet"), "standalone", "livemap/MqttBridgeNodelet", f"__name:={name}"],
            env=master.environment(), stdout=self.log, stderr=subprocess.STDOUT)

    def output(self):
        with open(self.log.name, encoding="utf-8", errors="replace") as file:
            return re.sub(r"\x1b\[[0-9;]*m", "", file.read())

    def alive(self):
        return self.process.poll() is None

    def stop(self):
        self.process.terminate()
        try:
            self.process.wait(timeout=PATIENCE_S)
        finally:
            self.process.kill()


class Peer:
    """mqtt_bridge_peer.py on a master, with what it has received so far."""

    def __init__(self, master, topics):
        """`topics`: {"pub:TOPIC" or "sub:TOPIC": message class}."""
        arguments = [f"{key}:{message_class._type}" for key, message_class in topics.items()]
        self.classes = {key.split(":")[1]: value for key, value in topics.items()}
        self.lock = threading.Lock()
        self.messages = {}
        self.ready = threading.Event()
        self.process = start_child(
            [os.path.join(TEST_DIRECTORY, "mqtt_bridge_peer.py")] + arguments,
            env=master.environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        threading.Thread(target=self._read, daemon=True).start()
        if not self.ready.wait(PATIENCE_S):
            raise AssertionError("the peer does not start")

    def _read(self):
        for line in self.process.stdout:
            told = json.loads(line)
            if "ready" in told:
                self.ready.set()
                continue
            message = self.classes[told["topic"]]()
            message.deserialize(base64.b64decode(told["data"]))
            with self.lock:
                self.messages.setdefault(told["topic"], []).append(message)

    def received(self, topic):
        with self.lock:
            return list(self.messages.get(topic, []))

    def publish(self, topic, message):
        data = base64.b64encode(serialise(message)).decode()
        self.process.stdin.write(json.dumps({"topic": topic, "data": data}) + "\n")
        self.process.stdin.flush()

    def diagnostics(self, name):
        """The newest values of the bridge called `name`, as a map of texts."""
        for message in reversed(self.received("/diagnostics")):
            for status in message.status:
                if status.hardware_id == "mqtt_bridge" and status.name.startswith(name + ":"):
                    return {pair.key: pair.value for pair in status.values}
        return {}

    def stop(self):
        self.process.stdin.close()
        self.process.kill()
        self.process.wait()
