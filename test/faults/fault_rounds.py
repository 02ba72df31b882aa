"""One round: the vehicles report, a fault strikes, the vehicles rest, and everything must be on the map exactly once."""

import os
import random
import time

import failover_kinds
from failover_world import FailoverWorld
from fault_kinds import KINDS as ONE_ZONE_KINDS
from fault_world import VEHICLES, World, WorldError, wait_until

# A report that waits longer than this after the fault is over counts as stuck. Pauses between two sendings grow to 30 s.
BOUND_S = 120

KINDS = ONE_ZONE_KINDS | failover_kinds.KINDS


def world_of(kind):
    """The class of the world that the fault strikes."""
    return FailoverWorld if kind in failover_kinds.KINDS else World


def run_round(world, kind, seed, number):
    """The round's record. An unclean one leaves a world that nobody should go on with."""
    rng = random.Random(f"{seed} {kind} {number}")
    record = {"kind": kind, "round": number, "seed": seed, "namespaces": world.inside, "load": round(os.getloadavg()[0], 1)}
    before = world.ledger.entered()
    world.feed()
    wait_until(lambda: all(now > then for now, then in zip(world.ledger.entered(), before)),
               f"a new report of each of {', '.join(VEHICLES)}")
    time.sleep(rng.uniform(0, 1.2))
    outage = KINDS[kind].function(world, rng)
    time.sleep(rng.uniform(0, 0.5))
    world.rest()
    recovery_s, stuck = settle(world.ledger, outage)
    verdicts = outage.verdicts + [world.ledger.judge()]
    merged_before, world.merged = world.merged, world.ledger.merged()
    return record | outage.notes | {
        "merged": world.merged - merged_before,
        "reports": sum(world.ledger.entered()) - sum(before), "waiting": len(outage.waiting), "stuck": stuck,
        "lost": count(verdicts, "lost"), "doubled": count(verdicts, "doubled"), "unknown": count(verdicts, "unknown"),
        "recovery_s": recovery_s, "words": [word for verdict in verdicts for word in verdict.words][:20]}


def count(verdicts, what):
    """The same report may be missed twice in a round."""
    return len(set().union(*(getattr(verdict, what) for verdict in verdicts)))


def settle(ledger, outage):
    """Seconds from the fault's end until all is answered that waited then (None: nothing did), and how many of all
    reports wait still when patience ends."""
    recovery_s = None
    while True:
        pending = ledger.pending()
        now = time.monotonic()
        if recovery_s is None and outage.waiting and not outage.waiting & pending:
            recovery_s = round(now - outage.over_s, 3)
        if not pending or now - outage.over_s > BOUND_S:
            return recovery_s, len(pending)
        time.sleep(0.05)


def is_clean(record):
    return not any(record.get(what) for what in ("lost", "doubled", "unknown", "stuck", "failed", "late", "event_numbers_wrong",
                                             "wrote_late"))


def run_rounds(world, kind, seed, numbers):
    """Records of these rounds, as far as the world stands them."""
    for number in numbers:
        try:
            record = run_round(world, kind, seed, number)
        except WorldError as error:
            record = {"kind": kind, "round": number, "seed": seed, "namespaces": world.inside, "failed": str(error)}
        yield record
        # A late map has harmed nothing.
        if not is_clean(record | {"late": 0}):
            return
