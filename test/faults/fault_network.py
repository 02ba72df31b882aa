"""Two places with a wire between them: network namespaces where this machine permits them, else this machine's loopback.

The vehicles live in the namespace of this process, zone and broker in one of their own. Both, all mounts and all
processes go when this process does: `enter_own_world` makes it the child of an `unshare`.
"""

import os
import shutil
import subprocess
import sys
import time

VEHICLE_ADDRESS, ZONE_ADDRESS = "10.77.0.2", "10.77.0.1"
INSIDE = "LIVEMAP_FAULTS_INSIDE"
PROGRAMS = ("unshare", "nsenter", "ip", "nft", "mount")
# /sbin is not on every user's PATH.
SEARCH = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"

# What a RST answers must itself come through.
TABLE = """table inet faults
flush table inet faults
table inet faults {{
  chain input {{ type filter hook input priority 0; tcp flags & rst == rst accept; iifname "veth-z" {rule}; }}
  chain output {{ type filter hook output priority 0; tcp flags & rst == rst accept; oifname "veth-z" {rule}; }}
}}
"""
RULES = {
    "reset": "meta l4proto tcp reject with tcp reset",
    "drop": "drop",
    "loss": "numgen random mod 100 < 30 drop",
    "pass": "accept",
}


def unshare_command():
    kinds = ["unshare", "--net", "--mount", "--pid", "--fork", "--mount-proc", "--kill-child"]
    return kinds if os.geteuid() == 0 else kinds + ["--map-root-user"]


def namespaces_permitted():
    """Whether everything that a wire, its faults and small disks need is permitted here."""
    if any(shutil.which(program, path=SEARCH) is None for program in PROGRAMS):
        return False
    try_all = ("ip link set lo up && ip link add veth-v type veth peer name veth-z && mount -t tmpfs none /mnt && "
               "printf '%s' \"$0\" | nft -f -")
    rules = "".join(TABLE.format(rule=rule) for rule in RULES.values())
    environment = dict(os.environ, PATH=SEARCH)
    return subprocess.run(unshare_command() + ["bash", "-c", try_all, rules], env=environment, stdin=subprocess.DEVNULL,
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0


def enter_own_world():
    """Runs this program again in namespaces of its own, and ends as it does; returns where that is done or not permitted."""
    if INSIDE in os.environ or not namespaces_permitted():
        return
    environment = dict(os.environ, PATH=SEARCH, **{INSIDE: "1"})
    # The shell is the first process there and buries what is orphaned.
    shell = ["bash", "-c", '"$@"; exit $?', "bash"]
    os.execvpe("unshare", unshare_command() + shell + [sys.executable] + sys.argv, environment)


def is_inside():
    return INSIDE in os.environ


def run(*command, **options):
    subprocess.run(command, check=True, stdin=options.pop("stdin", subprocess.DEVNULL), **options)


class Wire:
    """The vehicles' end and the zone's, of a pair of virtual network cards."""

    broker_address = ZONE_ADDRESS

    def __init__(self):
        run("ip", "link", "set", "lo", "up")
        self.holder = subprocess.Popen(["unshare", "--net", "sleep", "infinity"], stdin=subprocess.DEVNULL)
        self._await_namespace()
        run("ip", "link", "add", "veth-v", "type", "veth", "peer", "name", "veth-z", "netns", str(self.holder.pid))
        for inside, name, address in (([], "veth-v", VEHICLE_ADDRESS), (self.at_zone(), "veth-z", ZONE_ADDRESS)):
            run(*inside, "ip", "addr", "add", f"{address}/24", "dev", name)
            run(*inside, "ip", "link", "set", name, "up")
        run(*self.at_zone(), "ip", "link", "set", "lo", "up")

    def _await_namespace(self):
        ours = os.readlink("/proc/self/ns/net")
        deadline = time.monotonic() + 10
        while os.readlink(f"/proc/{self.holder.pid}/ns/net") == ours:
            if time.monotonic() > deadline:
                raise RuntimeError("the zone's network namespace did not come up within 10 s")
            time.sleep(0.01)

    def at_zone(self):
        """Goes before a command that runs at the zone's end."""
        return ["nsenter", f"--net=/proc/{self.holder.pid}/ns/net"]

    def set(self, what):
        run(*self.at_zone(), "nft", "-f", "-", stdin=None, input=TABLE.format(rule=RULES[what]).encode())

    def close(self):
        # The kernel takes a killed namespace down later than wait returns: the next wire would find this one's name.
        subprocess.run(["ip", "link", "del", "veth-v"], check=False, stdin=subprocess.DEVNULL)
        self.holder.kill()
        self.holder.wait()


class Loopback:
    """Without namespaces: all at 127.0.0.1; faults are the relays' alone."""

    broker_address = "127.0.0.1"

    def at_zone(self):
        return []

    def close(self):
        pass
