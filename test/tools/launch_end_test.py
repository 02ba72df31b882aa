#!/usr/bin/python3
"""What livemap_launch says, and its exit code, when a zone or a vehicle refuses its parameters or loses a node."""

import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/lib"))
import demo_system  # noqa: E402
from listening_port import free_port  # noqa: E402

PATIENCE_S = 120


class LaunchEnd(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="livemap_launch_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.port = free_port()
        self.environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{self.port}", "ROS_HOSTNAME": "127.0.0.1",
                            "ROS_HOME": str(self.folder / "ros"), "ROS_LOG_DIR": str(self.folder / "ros")}

    def start(self, file, *arguments):
        with open(self.folder / "out", "wb") as out, open(self.folder / "err", "wb") as err:
            process = subprocess.Popen(
                ["/usr/bin/python3", str(ROOT / "scripts/livemap_launch"), str(ROOT / "launch" / file), f"--port={self.port}",
                 f"directory:={self.folder / 'state'}", f"broker_port:={free_port()}", *arguments],
                env=self.environment, stdout=out, stderr=err, stdin=subprocess.DEVNULL, start_new_session=True)
        self.addCleanup(self.end, process)
        return process

    @staticmethod
    def end(process):
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            process.wait(PATIENCE_S)

    def zone(self, *arguments):
        return self.start("zone.launch", "detect_for_small:=false", f"web_port:={free_port()}", *arguments)

    def words(self):
        return (self.folder / "out").read_text(errors="replace"), (self.folder / "err").read_text(errors="replace")

    def last_line(self, process):
        self.assertEqual(process.wait(PATIENCE_S), 1, self.words()[1])
        return self.words()[1].strip().splitlines()[-1]

    def wait_until_ready(self, process):
        deadline = time.monotonic() + PATIENCE_S
        while "zone ready in" not in self.words()[0]:
            self.assertIsNone(process.poll(), self.words())
            self.assertLess(time.monotonic(), deadline, self.words())
            time.sleep(0.1)

    def pid_of(self, node):
        """Of the program that runs as this node on our master."""
        for folder in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "cmdline").read_bytes().split(b"\0")
                environment = (folder / "environ").read_bytes()
            except OSError:
                continue
            if f"__name:={node}".encode() in words and f":{self.port}".encode() in environment:
                return int(folder.name)
        raise AssertionError(f"no {node} runs")

    def test_a_tool_that_neither_computes_nor_writes_is_not_waited_for(self):
        log = self.folder / "tool.log"
        for program, code in (("sleep 60", None), ("for i in 1 2 3 4 5 6; do echo $i; sleep 0.5; done; exit 3", 3)):
            with self.subTest(program), open(log, "w") as output, \
                    subprocess.Popen(["sh", "-c", program], stdout=output) as tool:
                self.addCleanup(tool.kill)
                self.assertEqual(demo_system.wait_while_it_works(tool, log, stuck_s=2), code)
                tool.kill()

    def test_a_zone_that_refuses_a_parameter_ends_with_1_and_its_sentence(self):
        self.assertEqual(self.last_line(self.zone("zone_cloudlet:={join_radius_m: -5}")),
                         "livemap: zone_cloudlet ended with code 1: parameter '/zone_cloudlet/join_radius_m' is -5, "
                         "accepted is a number from 1 to 100000")

    def test_a_zone_whose_nodelet_refuses_a_parameter_ends_with_1_and_its_sentence(self):
        line = self.last_line(self.zone("mqtt_bridge:={keepalive_s: -1}"))
        self.assertIn("livemap: mqtt_bridge ", line)
        self.assertIn("'/mqtt_bridge/keepalive_s' is -1, accepted is", line)

    def test_a_vehicle_that_refuses_a_parameter_ends_with_1_and_its_sentence(self):
        for node, parameter in (("hazard_reporting", "max_range_m: -5"), ("camera_ingest", "no_such_parameter: 1")):
            line = self.last_line(self.start("vehicle.launch", "detect:=false", f"{node}:={{{parameter}}}"))
            self.assertIn(f"livemap: {node} refuses its parameters: ", line)
            self.assertIn(parameter.split(":")[0], line)

    def test_a_zone_that_is_killed_ends_with_1_and_the_signals_name(self):
        process = self.zone()
        self.wait_until_ready(process)
        os.kill(self.pid_of("zone_cloudlet"), signal.SIGKILL)
        self.assertEqual(self.last_line(process), "livemap: zone_cloudlet was ended by signal 9 (SIGKILL)")

    def test_a_zone_that_is_interrupted_ends_with_0(self):
        process = self.zone()
        self.wait_until_ready(process)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(PATIENCE_S), 0)
        self.assertNotIn("livemap: ", self.words()[1])

    def test_a_demo_whose_zone_or_broker_is_killed_names_part_and_signal(self):
        for name in ("zone", "broker"):
            with demo_system.LiveMapSystem(self.folder / name, "demo", "car-1") as live_map:
                live_map.directory.mkdir()
                live_map.zone_arguments = {"detect_for_small": "false"}
                live_map.start_zone()
                self.port = live_map.zone_port
                killed = self.pid_of("zone_cloudlet") if name == "zone" else live_map.processes["broker"].pid
                os.kill(killed, signal.SIGKILL)
                live_map.processes[name].wait(PATIENCE_S)
                with self.assertRaises(demo_system.StartError) as ended:
                    live_map.check_alive()
            words = {"zone": "the zone ended: zone_cloudlet was ended by signal 9 (SIGKILL), see ",
                     "broker": "the broker was ended by signal 9 (SIGKILL), see "}
            self.assertIn(words[name], str(ended.exception))

    def test_a_missing_file_is_waited_for_as_roslaunch_does(self):
        process = self.start("vehicle.launch", "detect:=false", f"hazards:={self.folder / 'absent.yaml'}", "respawn_delay:=0.5")
        deadline = time.monotonic() + PATIENCE_S
        while self.words()[1].count("Failed to load nodelet '/hazard_reporting`") < 2:
            self.assertIsNone(process.poll(), self.words()[1])
            self.assertLess(time.monotonic(), deadline, self.words()[1])
            time.sleep(0.1)

    def test_the_port_of_the_live_map_that_is_taken_is_named_with_its_program(self):
        with socket.socket() as other:
            other.bind(("127.0.0.1", 0))
            other.listen()
            port = other.getsockname()[1]
            line = self.last_line(self.start("zone.launch", "detect_for_small:=false", f"web_port:={port}"))
            self.assertIn(f"port {port}", line)
            self.assertIn("127.0.0.1", line)
            self.assertIn(f"(process {os.getpid()}) listens there", line)

    def test_the_port_of_the_master_that_is_taken_is_named_with_its_program(self):
        with socket.socket() as other:
            other.bind(("0.0.0.0", self.port))
            other.listen()
            line = self.last_line(self.zone())
        self.assertIn(f"livemap: the ROS master cannot start, because port {self.port} of 0.0.0.0 is in use already by", line)
        self.assertIn(f"(process {os.getpid()})", line)

    def test_a_launch_file_that_is_refused_ends_with_1(self):
        process = self.start("vehicle.launch", "vo:=false", "position_source:=fused")
        self.assertEqual(process.wait(PATIENCE_S), 1)
        self.assertIn("position_source:=fused needs localize:=true", self.words()[1])


if __name__ == "__main__":
    unittest.main()
