"""One attack after the other on one zone, with the honest at work meanwhile; a record for each."""

import time

import attacks
import honest

QUIET = "nothing: the honest alone"


def run(zone, reporter, kinds, seconds, scale=1.0):
    """Yields a record for each attack, first one without any."""
    ids = honest.hazard_ids(zone, 50)
    for number, kind in enumerate((None, *kinds)):
        attack = kind(zone, reporter, scale) if kind else None
        vehicle = honest.Vehicle(reporter, f"honest-{number}")
        crew = {"watcher": honest.Watcher(zone), "reader": honest.Reader(zone), "official": honest.Official(zone, ids)}
        before_mb = zone.memory_mb()
        highest_mb = before_mb
        if attack:
            attack.start()
        with vehicle, crew["watcher"], crew["reader"], crew["official"]:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                highest_mb = max(highest_mb, zone.memory_mb())
                time.sleep(0.1)
        if attack:
            attack.stop()
        settled = vehicle.settle()
        yield {"attack": kind.name if kind else QUIET, "seconds": seconds, "memory_before_mb": round(before_mb),
               "memory_mb": round(highest_mb), "vehicle": settled, "stored_once": stored_once(zone, vehicle),
               "came_of_it": attack.record() if attack else {}} | {name: caller.record() for name, caller in crew.items()}


def stored_once(zone, vehicle):
    """Whether each of the vehicle's reports stands in the store exactly once."""
    if not vehicle.sent:
        return False
    prefix = vehicle.name + "-%"
    rows = zone.store("SELECT count(*), count(DISTINCT uuid) FROM reports WHERE vehicle_id LIKE ?", prefix)
    return rows[0] == (len(vehicle.sent), len(vehicle.sent))


def is_clean(record):
    """The honest were served, and nothing was lost or doubled."""
    vehicle = record["vehicle"]
    return (vehicle["lost"] == 0 and vehicle["doubled"] == 0 and record["stored_once"] and vehicle["sent"] > 0 and
            all(record[name]["failed"] == 0 and record[name]["asked"] > 0 for name in ("watcher", "reader", "official")))


__all__ = ["QUIET", "attacks", "is_clean", "run"]
