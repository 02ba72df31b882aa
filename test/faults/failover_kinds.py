"""The faults of a zone with a standby. Each takes a FailoverWorld and a seeded generator, as those of fault_kinds.

The outage is over when the map is back: a process is ready and has every event that was kept when the fault struck. That is
the standby, or a killed one which was started again and won the race for the lease.
"""

import os
import signal
import time

from fault_kinds import Kind, aim, over
from fault_world import wait_until, is_alive
from failover_world import EVENTS, ZONES

# From the fault until the map is back.
MAP_BACK_BOUND_S = 5.0


def strike(world, rng, blow):
    """Stops the active process by the signal `blow`; what it was, and the notes on how another one took over."""
    victim = world.pid_of_active()
    name = world.zone_of(victim)
    standby = next(other for other in ZONES if other != name)
    wait_until(lambda: world.health(standby) == "standby", f"the standby {standby}")
    # roslaunch starts a killed one again, and a second is less than a lease. A stopped one would keep us waiting.
    heirs = ZONES if blow == signal.SIGKILL else (standby,)
    pids = [victim]
    # Its bridge too, as when the machine goes.
    if rng.random() < 0.5:
        pids += world.bridge_beside(name)
    epoch = world.lease()["epoch"]
    aim(world, rng)
    begin = time.monotonic()
    for pid in pids:
        os.kill(pid, blow)
    newest = world.map.ask(EVENTS)["newest"]
    found = []
    wait_until(lambda: found.extend(heir for heir in heirs if world.has_map(heir, newest)) or found, "the map")
    map_back_s = time.monotonic() - begin
    notes = {"map_back_s": round(map_back_s, 2), "late": int(map_back_s > MAP_BACK_BOUND_S), "pids": len(pids),
             "by_standby": int(found[0] == standby), "epochs": world.lease()["epoch"] - epoch}
    return victim, name, pids, notes


def check_events(world, notes):
    wrong, told = world.wrong_events()
    return notes | {"event_numbers_wrong": len(wrong), "event_words": wrong[:10], "notices": told}


def kill_active(world, rng):
    """roslaunch starts the dead one again; afterwards there are an active one and a standby, as before."""
    _, _, _, notes = strike(world, rng, signal.SIGKILL)
    outage = over(world)
    wait_until(lambda: {world.health(each) for each in ZONES} == {"ok", "standby"}, "an active one and a standby")
    return outage._replace(notes=check_events(world, notes))


def pause_active(world, rng):
    """It stands still until another one has its lease, and goes on: it must end by itself, and write nothing."""
    victim, name, pids, notes = strike(world, rng, signal.SIGSTOP)
    outage = over(world)
    token = world.lease()["token"]
    time.sleep(rng.uniform(0, 2))
    woken = time.monotonic()
    for pid in pids:
        os.kill(pid, signal.SIGCONT)
    wait_until(lambda: not is_alive(victim), "the end of the process that lost its lease")
    notes["ended_s"] = round(time.monotonic() - woken, 2)
    wait_until(lambda: world.health(name) == "standby", f"the return of {name}")
    notes["wrote_late"] = int(world.lease()["token"] != token)
    return outage._replace(notes=check_events(world, notes))


KINDS = {
    "kill_active": Kind("kill -9 of the zone's active process", kill_active, False, False),
    "pause_active": Kind("SIGSTOP of the zone's active process, SIGCONT once the standby took over", pause_active, False, False),
}
