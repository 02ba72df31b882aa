"""The faults. Each takes the world and a seeded generator, does its damage while the vehicles report, and mends it.

It returns an `Outage`: when it was over, what waited in the outboxes then, and what it found in the stores of the dead.
"""

import collections
import contextlib
import errno
import os
import signal
import time

import fault_ledger as ledger
from fault_world import VEHICLES, WorldError, wait_until

Outage = collections.namedtuple("Outage", "over_s waiting verdicts notes")

# Longer than 1.5 times the keepalive of 15 s: the connection is given up, not only slow.
LONG_BLACK_HOLE_S = (23.0, 30.0)


def over(world, waiting=None, verdicts=(), **notes):
    return Outage(time.monotonic(), world.ledger.pending() if waiting is None else waiting, list(verdicts), notes)


def aim(world, rng):
    """In most rounds the moment is near one at which something is under way; a report is done in some 20 ms."""
    if rng.random() < 0.3:
        return
    deadline = time.monotonic() + 2
    while not world.ledger.pending() and time.monotonic() < deadline:
        time.sleep(0.002)
    time.sleep(rng.uniform(0, 0.03))


def phases_of(outbox, zone_map):
    """Where the reports stood that a dead vehicle had not finished."""
    phases = collections.Counter()
    for report, sent in outbox.pending.items():
        phases["unsent" if not sent else "committed, not yet ended" if report in zone_map.reports else "sent"] += 1
    return dict(phases)


def kill_vehicle(world, rng):
    """The manager with hazard_reporting and mqtt_bridge, and the loaders; in every third round with a backlog."""
    victims = rng.choice([(VEHICLES[0],), (VEHICLES[1],), VEHICLES])
    backlog = rng.random() < 1 / 3
    if backlog:
        world.processes["broker"].kill()
        time.sleep(rng.uniform(0.2, 1.5))
    verdicts, phases = [], collections.Counter()
    doomed = {vehicle: processes_of_vehicle(world, vehicle) for vehicle in victims}
    aim(world, rng)
    for vehicle, pids in doomed.items():
        verdict, found = kill_one_vehicle(world, vehicle, pids)
        verdicts.append(verdict)
        phases.update(found)
    time.sleep(rng.uniform(0, 0.5))
    # What waited in the dead store waits still: the file is read before anybody opens it.
    waiting = set().union(*(ledger.as_it_lies(world.outbox(vehicle), ledger.read_pending) for vehicle in victims))
    for vehicle in victims:
        world.processes[vehicle].child.send_signal(signal.SIGCONT)
    if backlog:
        world.start_broker()
    outage = over(world, waiting, verdicts, phases=dict(phases), victims=len(victims), backlog=backlog)
    for vehicle in victims:
        wait_until(lambda name=vehicle: world.holders(world.outbox(name)), f"the return of {vehicle}")
    return outage


def processes_of_vehicle(world, vehicle):
    manager = world.pids_of(world.ports[vehicle], "nodelet", "manager")
    if not set(manager) & set(world.holders(world.outbox(vehicle))):
        raise WorldError(f"no manager of {vehicle} has its outbox open")
    return manager + world.pids_of(world.ports[vehicle], "nodelet", "load")


def kill_one_vehicle(world, vehicle, pids):
    """Roslaunch stands still meanwhile, or it would start the next before the dead one was looked at."""
    world.processes[vehicle].child.send_signal(signal.SIGSTOP)
    world.kill_all(pids)
    outbox = ledger.as_it_lies(world.outbox(vehicle), ledger.read_outbox)
    zone_map = ledger.read_map(world.ledger.map_path)
    return ledger.judge([outbox], zone_map), phases_of(outbox, zone_map)


def kill_broker(world, rng):
    aim(world, rng)
    world.processes["broker"].kill()
    time.sleep(rng.uniform(0, 2))
    world.start_broker()
    return over(world)


def empty_broker(world, rng):
    """Killed, and its sessions and queues lost with its disk. SIGUSR1 makes it save first: there is a store to lose."""
    world.processes["broker"].child.send_signal(signal.SIGUSR1)
    time.sleep(0.1)
    aim(world, rng)
    world.processes["broker"].kill()
    data = world.directory / "identity/data"
    stores = list(data.glob("mosquitto.db*"))
    for store in stores:
        store.unlink()
    time.sleep(rng.uniform(0, 2))
    world.start_broker()
    return over(world, stores=len(stores))


def kill_zone(world, rng):
    """zone_cloudlet and its bridge; their roslaunch goes first, or it would tidy up."""
    launch = world.processes["zone"].child
    victims = world.pids_of(world.ports["zone"], "/zone_cloudlet", "__name:=") + world.pids_of(
        world.ports["zone"], "MqttBridgeNodelet", "__name:=")
    if len(victims) != 2:
        raise WorldError(f"the zone was to be two processes and is {victims}")
    aim(world, rng)
    os.kill(launch.pid, signal.SIGKILL)
    launch.wait()
    world.kill_all(victims)
    # What a vehicle has ended by now, the dead zone's store must have.
    outboxes = world.ledger.outboxes()
    verdict = ledger.judge(outboxes, ledger.as_it_lies(world.ledger.map_path, ledger.read_map))
    time.sleep(rng.uniform(0, 1))
    world.start_zone()
    outage = over(world, verdicts=[verdict])
    wait_until(lambda: world.holders(world.ledger.map_path), "the return of the zone")
    return outage


def partition(world, how, seconds):
    """Both vehicles are cut off; without namespaces by the relays."""
    if world.inside:
        world.wire.set(how)
    else:
        world.tell_relays({"reset": "reset", "drop": "hold"}[how])
    time.sleep(seconds)


def heal(world):
    world.wire.set("pass") if world.inside else world.tell_relays("pass")


def reset(world, rng):
    partition(world, "reset", rng.uniform(0.2, 3))
    heal(world)
    return over(world)


def black_hole(world, rng):
    long = rng.random() < 0.1
    seconds = rng.uniform(*LONG_BLACK_HOLE_S) if long else rng.uniform(0.5, 6)
    partition(world, "drop", seconds)
    heal(world)
    return over(world, seconds=round(seconds, 2))


def loss(world, rng):
    """30 % of all packets, each way."""
    world.wire.set("loss")
    time.sleep(rng.uniform(3, 6))
    heal(world)
    return over(world)


def delay(world, rng):
    """2 s each way, of what goes through relays."""
    world.tell_relays("delay 2")
    time.sleep(rng.uniform(3, 6))
    world.tell_relays("pass")
    return over(world)


def flaps(world, rng):
    """Eight short cuts in a row, each by reset or black hole."""
    for flap in range(8):
        partition(world, rng.choice(["reset", "drop"]), rng.uniform(0.1, 0.8))
        heal(world)
        if flap < 7:
            time.sleep(rng.uniform(0.1, 1.2))
    return over(world)


@contextlib.contextmanager
def filled(folder):
    """A disk without a free byte."""
    ballast = folder / "ballast"
    with open(ballast, "wb", buffering=0) as file:
        fill_up(file, 1 << 20)
        fill_up(file)
        try:
            yield lambda: fill_up(file)
        finally:
            file.truncate(0)
    ballast.unlink()


def fill_up(file, *sizes):
    """What the programs gave back meanwhile is taken, too."""
    for size in sizes or (1 << 12, 1):
        try:
            while file.write(bytes(size)) == size:
                pass
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise


def full_disk(world, stores, taken, rng):
    """`taken`: how many reports the stores have accepted. The fault is felt when that number stands still at the end."""
    for store in stores:
        # Else the log's old pages, which are on the disk already, would take what comes for a while.
        ledger.empty_log(store)
    with contextlib.ExitStack() as disks:
        refill = [disks.enter_context(filled(store.parent)) for store in stores]
        end = time.monotonic() + rng.uniform(1.5, 4)
        half_way = None
        while time.monotonic() < end:
            time.sleep(0.1)
            for fill in refill:
                fill()
            if half_way is None and time.monotonic() > end - 0.8:
                half_way = taken()
        felt = taken() == half_way
    return over(world, felt=felt)


def full_vehicle(world, rng):
    """The disk of one outbox, or of both."""
    victims = rng.choice([(VEHICLES[0],), (VEHICLES[1],), VEHICLES])
    outboxes = [world.outbox(vehicle) for vehicle in victims]
    return full_disk(world, outboxes, lambda: [ledger.count_entered(outbox) for outbox in outboxes], rng)


def full_zone(world, rng):
    store = world.ledger.map_path
    return full_disk(world, [store], lambda: len(ledger.read_map(store).reports), rng)


Kind = collections.namedtuple("Kind", "words function wants_namespaces small_stores")
KINDS = {
    "kill_vehicle": Kind("kill -9 of the vehicle's nodelet manager", kill_vehicle, False, False),
    "kill_broker": Kind("kill -9 of the broker", kill_broker, False, False),
    "kill_zone": Kind("kill -9 of zone_cloudlet and its bridge", kill_zone, False, False),
    "empty_broker": Kind("kill -9 of the broker, its store deleted", empty_broker, False, False),
    "reset": Kind("partition: every packet answered with a TCP reset", reset, False, False),
    "black_hole": Kind("partition: every packet dropped", black_hole, False, False),
    "loss": Kind("30 % of the packets lost, each way", loss, True, False),
    "delay": Kind("2 s delay, each way, of the vehicle behind the relay", delay, False, False),
    "flaps": Kind("8 cuts in a row", flaps, False, False),
    "full_vehicle": Kind("ENOSPC of the vehicle's store", full_vehicle, True, True),
    "full_zone": Kind("ENOSPC of the zone's store", full_zone, True, True),
}
