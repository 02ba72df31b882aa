"""The page of the rounds with a standby: what their records say, in a table."""

import statistics
import textwrap

import failover_kinds
import failover_world
import fault_page

HEAD = """# Failover: how soon the map is back

`./livemap bench faults --only kill_active --only pause_active` makes this page; do not edit it.
[Run a standby](../how-to/run-a-standby.md) says how to set one up, and
[delivery](../explanation/delivery.md#two-processes-of-one-zone) what is promised.

Machine: {machine}.

The set-up is that of [the other faults](faults.md), but the zone is two launches of `zone.launch`
on two ROS masters: an active one and its standby. They share one server of PostgreSQL and one
broker. The lease is {lease} s long and renewed every {renew} s. Vehicles report all the time. In
half of the rounds the fault strikes `zone_cloudlet` alone, in the other half its bridge too. Then
the page counts

- **lost**, **doubled**, **unknown** and **stuck** as [there](faults.md), by the outboxes and the
  rows of the database;
- **late**: a map that was back after more than {bound:g} s;
- **wrong numbers**: an event number that the broker's listener heard of two different things or of
  another hazard than the database has, or a gap or a repetition in the database's numbers;
- **wrote late**: a paused process that wrote after it lost its lease.

**Map back** is the time from the signal until a process answers `/readyz` and `/api/v1/hazards`
with status 200 and its map holds every event that the database had when the fault struck. **By the
standby** counts the rounds in which that was the other process. In the rest roslaunch started the
killed one again within the lease, and it won the race for it. After SIGCONT the page waits until
the paused process has ended by itself.

```
./livemap bench faults --only kill_active --only pause_active
```

"""
COLUMNS = ("fault", "rounds", "reports", "lost", "doubled", "unknown", "stuck", "late", "wrong numbers", "wrote late",
           "by the standby", "map back p50, s", "p95, s", "longest, s", "reports answered p50, s", "longest, s", "at")


def row(kind, records):
    done = [record for record in records if "failed" not in record]
    back = [record["map_back_s"] for record in done]
    recoveries = [record["recovery_s"] for record in done if record["recovery_s"] is not None]
    sums = [str(sum(record.get(key, 0) for record in done)) for key in
            ("reports", "lost", "doubled", "unknown", "stuck", "late", "event_numbers_wrong", "wrote_late", "by_standby")]
    figures = [fault_page.quantile(back, 0.5), fault_page.quantile(back, 0.95), fault_page.quantile(back, 1),
               fault_page.quantile(recoveries, 0.5), fault_page.quantile(recoveries, 1)]
    return [failover_kinds.KINDS[kind].words, str(len(done)), *sums, *figures,
            ", ".join(sorted({record["commit"] for record in records}))]


def notes(records_of):
    everything = [record for records in records_of.values() for record in records]
    lines = []
    ended = [record["ended_s"] for record in everything if "ended_s" in record]
    if ended:
        lines.append(f"Paused processes ended {min(ended):.1f} to {max(ended):.1f} s after SIGCONT (n = {len(ended)}).")
    failed = [f"{kind} {record['round']}: {record['failed']}" for kind, records in records_of.items()
              for record in records if "failed" in record]
    if failed:
        lines.append("Rounds that could not be run to their end, not in the table: " + "; ".join(failed) + ".")
    loads = [record["load"] for record in everything if "load" in record]
    dates = sorted({record["date"] for record in everything})
    if loads:
        lines.append(f"Measured on {' to '.join(sorted({dates[0], dates[-1]}))} (UTC); load of the machine "
                     f"{statistics.median(loads):.0f} (median, by its load average), up to {max(loads):.0f}.")
    return "\n\n".join(textwrap.fill(line, 100) for line in lines) + "\n"


def page(records_of, seed, _bound_s):
    """`records_of`: kind to its rounds' records, none empty."""
    head = HEAD.format(machine=fault_page.machine(), lease=failover_world.LEASE_S, renew=failover_world.RENEW_S,
                       bound=failover_kinds.MAP_BACK_BOUND_S)
    rows = [row(kind, records_of[kind]) for kind in failover_kinds.KINDS if kind in records_of]
    cells = "\n".join(f"| {' | '.join(line)} |" for line in [COLUMNS, ["---"] * len(COLUMNS), *rows]) + "\n"
    return head + cells + "\n" + notes(records_of) + f"\nSeed {seed}.\n"
