"""A LiveMap whose zone is two processes on two ROS masters: one of them is active by its lease, the other its standby.

Their state is in a server of PostgreSQL, and one broker serves both. A listener at the broker keeps every notice.
"""

import json
import pathlib
import re
import struct
import subprocess
import sys
import urllib.error
import urllib.request
import uuid

import fault_ledger as ledger
import fault_network as network
from fault_world import HERE, ROOT, VEHICLES, ZONE, World, flow, wait_until, zone_settings
import yaml

sys.path.insert(0, str(HERE.parent / "support"))
import postgresql_server  # noqa: E402
import demo_system as system  # noqa: E402
from listening_port import free_port  # noqa: E402

ZONES = ("zone", "zone_b")
LISTENER = "listener"
LEASE_S, RENEW_S = 2, 0.5
# One statement: one moment of the database.
MAP = """SELECT json_build_object(
  'reports', (SELECT coalesce(json_agg(json_build_array(uuid, hazard_id)), '[]') FROM reports),
  'sightings', (SELECT coalesce(json_agg(json_build_array(id, sightings)), '[]') FROM hazards))"""
EVENTS = """SELECT json_build_object(
  'hazards', (SELECT coalesce(json_agg(json_build_array(e.sequence, h.uuid)), '[]')
              FROM events e JOIN hazards h ON h.id = e.hazard_id),
  'others', (SELECT count(*) FROM map_change_events),
  'newest', greatest((SELECT coalesce(max(sequence), 0) FROM events),
                     (SELECT coalesce(max(sequence), 0) FROM map_change_events)))"""
LEASE = """SELECT json_build_object('holder', holder, 'epoch', epoch, 'token', (SELECT token FROM livemap_owner))
  FROM livemap_lease"""


class ServerMap:
    """The zone's map in a database of PostgreSQL, as fault_ledger reads it."""

    def __init__(self, server, database):
        self.server, self.database = server, database

    def ask(self, sql):
        return json.loads(self.server.ask(self.database, sql))

    def read(self):
        found = self.ask(MAP)
        return ledger.Map({uuid.UUID(report): hazard for report, hazard in found["reports"]},
                          dict(map(tuple, found["sightings"])))


def parse_notice(payload):
    """Sequence and hazard of a notice as it travels (docs/reference/wire.md, msg/HazardNotice.msg)."""
    at = 9 + payload[8] + 16 + 4
    _, action, sequence, _, addressee = struct.unpack_from("<HBQQI", payload, at)
    at += 23 + addressee
    return sequence, str(uuid.UUID(bytes=payload[at:at + 16])), action


class FailoverWorld(World):
    def __init__(self, directory, seed, small_stores=False):
        super().__init__(directory, seed, small_stores)
        self.ports[ZONES[1]] = free_port()
        self.web_ports = {name: free_port() for name in ZONES}
        self.server = postgresql_server.PostgresqlServer()
        self.url = self.server.make_database("zone")
        self.map = ServerMap(self.server, "zone")
        self.ledger = ledger.Ledger([self.outbox(vehicle) for vehicle in VEHICLES], self.map)

    def __exit__(self, *arguments):
        zone, self.ports["zone"] = self.ports["zone"], self.ports[ZONES[1]]
        super().__exit__(*arguments)
        self.ports["zone"] = zone
        self.kill_all(self.pids_of(zone))
        self.server.close()

    def make_identities(self):
        super().make_identities()
        network.run(sys.executable, system.program("livemap_zone_identity"), "enroll", LISTENER, "--dir",
                    self.directory / "identity", stdout=subprocess.DEVNULL)

    def start_zone(self):
        catalogue = self.directory / "hazards.yaml"
        known = yaml.safe_load((ROOT / "config/hazards.yaml").read_text(encoding="utf-8"))
        catalogue.write_text(yaml.safe_dump(dict(known, classes={})), encoding="ascii")
        for name in ZONES:
            if name != "zone":
                self.run(f"{name}_master", ["roscore", "-p", self.ports[name]], at_zone=True, master=self.ports[name])
            self.run(name, ["roslaunch", "--wait", system.launch_file("zone.launch"), f"zone:={ZONE}", f"hazards:={catalogue}",
                            f"directory:={self.directory / name}", f"store_url:={self.url}", f"lease_s:={LEASE_S}",
                            f"broker_port:={self.ports['broker']}", f"identity:={self.directory / 'identity/zone'}",
                            "web_address:=0.0.0.0", f"web_port:={self.web_ports[name]}", "detect_for_small:=false",
                            f"zone_cloudlet:={flow(zone_settings() | {'web': True, 'lease_renew_s': RENEW_S})}"],
                     at_zone=True, master=self.ports[name])
            # The first one is to be the active one: its store is new.
            wait_until(lambda one=name: self.health(one), f"the start of {name}")
        self.start_listener()

    def start_listener(self):
        mine = self.directory / "identity/vehicles" / LISTENER
        self.notices_file = self.directory / "notices.txt"
        with open(self.notices_file, "ab") as notices:
            self.run("listener", [
                "mosquitto_sub", "-V", "5", "-h", self.wire.broker_address, "-p", self.ports["broker"], "-q", "1", "-c", "-x", "3600",
                "-i", LISTENER, "--cafile", mine / "ca.pem", "--cert", mine / "certificate.pem", "--key", mine / "key.pem",
                "-t", f"livemap/v1/{ZONE}/notice", "-F", "%x"], master=self.ports["zone"], stdout=notices)

    def get(self, name, path):
        """Status and text; none while nobody answers."""
        try:
            with urllib.request.urlopen(f"http://{self.wire.broker_address}:{self.web_ports[name]}{path}", timeout=2) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()
        except OSError:
            return None, ""

    def health(self, name):
        """"ok" of the active one, "standby", or none."""
        status, text = self.get(name, "/healthz")
        return json.loads(text)["status"] if status == 200 else None

    def has_map(self, name, sequence):
        """Whether this one is ready, and its map holds all up to the event of that number."""
        if self.get(name, "/readyz")[0] != 200:
            return False
        newest = re.search(r"^livemap_sequence (\S+)$", self.get(name, "/metrics")[1], re.MULTILINE)
        return newest is not None and float(newest[1]) >= sequence and self.get(name, "/api/v1/hazards")[0] == 200

    def lease(self):
        return self.map.ask(LEASE)

    def pid_of_active(self):
        return int(self.lease()["holder"].rsplit(":", 1)[1])

    def bridge_beside(self, name):
        return self.pids_of(self.ports[name], "MqttBridgeNodelet", "__name:=")

    def zone_of(self, pid):
        return next(name for name in ZONES if pid in self.pids_of(self.ports[name], "/zone_cloudlet", "__name:="))

    def wrong_events(self):
        """Sentences on event numbers: one that was told of two things, or told and not kept, or left out, or kept twice."""
        told = {}
        for line in self.notices_file.read_text(encoding="ascii").splitlines():
            sequence, hazard, action = parse_notice(bytes.fromhex(line))
            told.setdefault(sequence, set()).add((hazard, action))
        events = self.map.ask(EVENTS)
        kept = dict(map(tuple, events["hazards"]))
        wrong = [f"event {sequence} was told of {sorted(things)}" for sequence, things in told.items() if len(things) > 1]
        wrong += [f"event {sequence} was told of {hazard} and is kept of {kept.get(sequence)}" for sequence, things in told.items()
                  for hazard, _ in things if kept.get(sequence) != hazard]
        if len(events["hazards"]) + events["others"] != events["newest"]:
            wrong.append(f"{len(events['hazards']) + events['others']} events have numbers up to {events['newest']}")
        return wrong, len(told)
