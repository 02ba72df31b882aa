"""A whole LiveMap to be hurt: two vehicles, a broker with certificates, a zone; each a real launch of its own.

car-1 reaches the broker directly, car-2 through a relay (without namespaces both do). Everything stays up over many
rounds; only the victim of a round dies.
"""

import contextlib
import os
import pathlib
import re
import signal
import subprocess
import sys
import time

import yaml

import fault_ledger as ledger
import fault_network as network

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "scripts" / "lib"))
import demo_system as system  # noqa: E402
from listening_port import free_port  # noqa: E402

ZONE, VEHICLES = "faults", ("car-1", "car-2")
START_S = 90
STORE_MB = {"car-1": 24, "car-2": 24, "zone": 160}


class WorldError(RuntimeError):
    """What keeps a round from being run, in one sentence."""


def wait_until(is_so, what, patience_s=START_S):
    deadline = time.monotonic() + patience_s
    while not is_so():
        if time.monotonic() > deadline:
            raise WorldError(f"{what} did not happen within {patience_s} s")
        time.sleep(0.05)


def zone_settings():
    """The load is far above what one vehicle may do in an hour, and leaves more hazards with one witness than a zone takes."""
    known = yaml.safe_load((ROOT / "config/zone_cloudlet.yaml").read_text(encoding="utf-8"))
    return {"web": False} | {
        key: 1000000 for key in ("max_reports_per_hour", "max_evidence_per_hour", "max_hazards_by_one_vehicle")
        if key in known}


class Process:
    """A child in a process group of its own, and what it says."""

    def __init__(self, command, log, **options):
        self.command = command
        with open(log, "a", encoding="utf-8") as output:
            self.child = subprocess.Popen(command, stderr=output, start_new_session=True,
                                          **{"stdin": subprocess.DEVNULL, "stdout": output} | options)

    def kill(self):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.child.pid, signal.SIGKILL)
        self.child.wait()

    def tell(self, line):
        self.child.stdin.write(line + "\n")
        self.child.stdin.flush()

    def await_line(self, line):
        said = self.child.stdout.readline().strip()
        if said != line:
            raise WorldError(f"'{self.command[1]}' was to say '{line}' and said '{said}'")


class World:
    """`small_stores`: outboxes and zone's store each on a disk of its own in memory, that can be filled."""

    def __init__(self, directory, seed, small_stores=False):
        self.directory, self.seed = pathlib.Path(directory), seed
        self.directory.mkdir(parents=True)
        self.inside = network.is_inside()
        self.small_stores = small_stores and self.inside
        self.wire = network.Wire() if self.inside else network.Loopback()
        self.processes = {}
        self.ports = {name: free_port() for name in ("broker", "zone", *VEHICLES)}
        self.relays = {}
        self.ledger = ledger.Ledger([self.outbox(vehicle) for vehicle in VEHICLES],
                                    self.directory / "zone/zone.sqlite3")

    def __enter__(self):
        try:
            self.start()
        except BaseException as error:
            self.__exit__()
            if isinstance(error, WorldError):
                raise WorldError(f"{error}; {self.complaints()}") from error
            raise
        return self

    def complaints(self):
        """The first of each process, without colours: folders of tests go."""
        first = [f"{log.name}: {lines[0].strip()}" for log in sorted(self.directory.glob("*.log"))
                if (lines := re.findall(r".*(?:FATAL|ERROR).*", log.read_text(encoding="utf-8", errors="replace")))]
        return re.sub(r"\x1b\[[0-9;]*m", "", "; ".join(first)) or "nothing complained"

    def __exit__(self, *_):
        for process in self.processes.values():
            process.kill()
        for port in (self.ports["zone"], *(self.ports[vehicle] for vehicle in VEHICLES)):
            for pid in self.pids_of(port):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        for folder in ("zone", *VEHICLES) if self.small_stores else ():
            subprocess.run(["umount", "--lazy", self.directory / folder], check=False)
        self.wire.close()

    def outbox(self, vehicle):
        return self.directory / vehicle / "local_hazards.sqlite3"

    def start(self):
        for folder in ("zone", *VEHICLES):
            (self.directory / folder).mkdir()
            if self.small_stores:
                network.run("mount", "-t", "tmpfs", "-o", f"size={STORE_MB[folder]}m", "none", self.directory / folder)
        self.make_identities()
        self.start_broker()
        self.run("zone_master", ["roscore", "-p", self.ports["zone"]], at_zone=True, master=self.ports["zone"])
        self.start_zone()
        for vehicle in VEHICLES:
            self.start_relay(vehicle)
            self.start_vehicle(vehicle)
        for vehicle in VEHICLES:
            wait_until(lambda name=vehicle: self.holders(self.outbox(name)), f"the start of {vehicle}")
            wait_until(lambda name=vehicle: self.start_journal(name), f"the outbox of {vehicle}")
        self.drive_began = int(time.time())
        for vehicle in VEHICLES:
            self.start_feeder(vehicle)
        for vehicle in VEHICLES:
            self.processes[f"feeder_{vehicle}"].await_line("connected")
        self.warm_up()
        self.merged = self.ledger.merged()

    def start_journal(self, vehicle):
        with contextlib.suppress(ledger.sqlite3.OperationalError):
            ledger.start_journal(self.outbox(vehicle))
            return True
        return False

    def warm_up(self):
        """Until a report of each vehicle went all the way."""
        self.feed()
        wait_until(lambda: all(outbox.entered for outbox in self.ledger.outboxes()), "a first report")
        self.rest()
        wait_until(lambda: not self.ledger.pending(), "the zone's answer to the first reports")

    def run(self, name, command, at_zone=False, master=None, **options):
        environment = dict(os.environ, ROS_HOSTNAME="127.0.0.1", ROS_MASTER_URI=f"http://127.0.0.1:{master}",
                           ROS_HOME=str(self.directory / "ros_home"))
        environment.pop("ROS_IP", None)
        self.processes[name] = Process((self.wire.at_zone() if at_zone else []) + [str(part) for part in command],
                                       self.directory / f"{name}.log", env=environment, **options)
        return self.processes[name]

    def make_identities(self):
        folder = self.directory / "identity"
        tool = system.program("livemap_zone_identity")
        address = "0.0.0.0" if self.inside else "127.0.0.1"
        quiet = {"stdout": subprocess.DEVNULL}
        network.run(sys.executable, tool, "init", folder, "--zone", ZONE, "--host", self.wire.broker_address,
                    "--address", address, "--port", str(self.ports["broker"]), **quiet)
        for vehicle in VEHICLES:
            network.run(sys.executable, tool, "enroll", vehicle, "--dir", folder, **quiet)

    def start_broker(self):
        self.run("broker", ["mosquitto", "-c", self.directory / "identity/mosquitto.conf"], at_zone=True)

    def start_zone(self):
        # Each thing is a class of its own: a catalogue without classes takes every name.
        catalogue = self.directory / "hazards.yaml"
        known = yaml.safe_load((ROOT / "config/hazards.yaml").read_text(encoding="utf-8"))
        catalogue.write_text(yaml.safe_dump(dict(known, classes={})), encoding="ascii")
        self.run("zone", ["roslaunch", "--wait", system.launch_file("zone.launch"), f"zone:={ZONE}",
                          f"hazards:={catalogue}",
                          f"directory:={self.directory / 'zone'}", f"broker_port:={self.ports['broker']}",
                          f"identity:={self.directory / 'identity/zone'}",
                          f"zone_cloudlet:={flow(zone_settings())}"], at_zone=True, master=self.ports["zone"])

    def start_relay(self, vehicle):
        if self.inside and vehicle == VEHICLES[0]:
            return
        port = free_port()
        relay = self.run(f"relay_{vehicle}", [
            sys.executable, HERE / "fault_relay.py", "--port", port, "--to-address", self.wire.broker_address,
            "--to-port", self.ports["broker"]], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        relay.await_line("listening")
        self.relays[vehicle] = (relay, port)

    def start_vehicle(self, vehicle):
        host, port = self.wire.broker_address, self.ports["broker"]
        if vehicle in self.relays:
            host, port = "127.0.0.1", self.relays[vehicle][1]
        self.run(vehicle, ["roslaunch", "-p", self.ports[vehicle], system.launch_file("vehicle.launch"),
                           "detect:=false", "vo:=false", "respawn_delay:=0", f"vehicle:={vehicle}", f"zone:={ZONE}",
                           f"directory:={self.directory / vehicle}", f"broker_host:={host}", f"broker_port:={port}",
                           f"identity:={self.directory / 'identity/vehicles' / vehicle}"], master=self.ports[vehicle])

    def start_feeder(self, vehicle):
        self.run(f"feeder_{vehicle}", [
            sys.executable, HERE / "fault_feeder.py", "--vehicle", VEHICLES.index(vehicle), "--start", self.drive_began,
            "--seed", self.seed], master=self.ports[vehicle], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def feed(self):
        self.tell_feeders("go")

    def rest(self):
        self.tell_feeders("rest")

    def tell_feeders(self, word):
        for vehicle in VEHICLES:
            self.processes[f"feeder_{vehicle}"].tell(word)

    def tell_relays(self, words):
        for relay, _ in self.relays.values():
            relay.tell(words)
            relay.await_line("done")

    @staticmethod
    def processes_where(is_meant):
        found = []
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if is_meant(entry):
                    found.append(int(entry.name))
        return found

    def pids_of(self, master_port, *words):
        """Processes at this ROS master whose command line has all these words."""
        mark = f"ROS_MASTER_URI=http://127.0.0.1:{master_port}".encode()

        def is_meant(entry):
            command = (entry / "cmdline").read_bytes().split(b"\0")
            environment = (entry / "environ").read_bytes().split(b"\0")
            return (any(value in (mark, mark + b"/") for value in environment)
                    and all(any(word.encode() in part for part in command) for word in words))
        return self.processes_where(is_meant)

    def holders(self, path):
        """Processes that have this file open."""
        return self.processes_where(lambda entry: any(os.readlink(link) == str(path) for link in (entry / "fd").iterdir()))

    def kill_all(self, pids):
        """And waits until they are dead, whoever has to bury them."""
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        wait_until(lambda: not any(is_alive(pid) for pid in pids), f"the death of {pids}")


def flow(settings):
    return yaml.safe_dump(settings, default_flow_style=True, width=9999).strip()


def is_alive(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] not in "ZX"
    except OSError:
        return False
